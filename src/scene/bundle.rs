//! Bundles of tags as the ROS package apriltag_ros describes them (its `tags.yaml`; Malyuta 2017): markers with full poses.
//!
//! `tag_bundles` is a list of `{name, layout}`, a layout a list of `{id, size, x, y, z, qw, qx, qy, qz}`: the place of the
//! tag's frame in the bundle's, metres and a quaternion. Name, place and turn may be left out. The tag's frame there is a
//! marker's here: x right, y up, z out of the print.

use std::path::{Path, PathBuf};

use glam::{DAffine3, DQuat, DVec3};

use super::error::{SceneError, suggestion};
use super::plain_file;
use super::ranges::{Numbers, Whole};
use super::yaml::{YamlContent, YamlValue};

/// A quaternion shorter than this has no direction.
const LEAST_TURN: f64 = 1e-6;

/// A tag's keys.
const TAG_KEYS: [&str; 9] = ["id", "size", "x", "y", "z", "qw", "qx", "qy", "qz"];

/// What a file of bundles says.
pub(super) struct BundleFile {
    path: PathBuf,
    text: String,
    bundles: Vec<Bundle>,
    /// Whether it has tags that stand alone.
    has_lone_tags: bool,
}

/// Tags that are one rigid thing.
pub(super) struct Bundle {
    name: String,
    pub tags: Vec<BundleTag>,
    layout: YamlValue,
}

/// A tag of a bundle.
pub(super) struct BundleTag {
    pub id: u32,
    pub size_m: f64,
    pub bundle_from_tag: DAffine3,
    id_value: YamlValue,
}

impl BundleFile {
    /// Reads a file.
    ///
    /// # Errors
    /// A file that cannot be read; a mistake in it, with its line.
    pub fn read(path: &Path, allowed: &TagRanges) -> Result<Self, SceneError> {
        let text = plain_file::read_text(path).map_err(|error| {
            SceneError::of_file(path, format!("the bundles cannot be read: {error}"))
        })?;
        let root = YamlValue::of_text(&text).map_err(|error| SceneError::of_file(path, error))?;
        let bundles = root.as_ref().and_then(|root| found(root, "tag_bundles"));
        let lone = root
            .as_ref()
            .and_then(|root| found(root, "standalone_tags"));
        let is_list_with_any = |value: &YamlValue| match &value.content {
            YamlContent::List(list) => !list.is_empty(),
            _ => false,
        };
        let mut file = Self {
            path: path.to_owned(),
            bundles: Vec::new(),
            has_lone_tags: lone.is_some_and(is_list_with_any),
            text,
        };
        let Some(listed) = bundles else {
            return Err(SceneError::of_file(path, file.none_in_words()));
        };
        for (number, value) in file.list(listed, "tag_bundles")?.iter().enumerate() {
            let bundle = file.bundle(value, number, allowed)?;
            file.bundles.push(bundle);
        }
        if file.bundles.is_empty() {
            return Err(file.error(listed, file.none_in_words()));
        }
        Ok(file)
    }

    /// The bundle of a name, or the only one.
    ///
    /// # Errors
    /// What names there are.
    pub fn bundle_of(&self, name: Option<&str>) -> Result<&Bundle, String> {
        let names: Vec<&str> = self
            .bundles
            .iter()
            .map(|bundle| bundle.name.as_str())
            .collect();
        let wanted = match (name, self.bundles.as_slice()) {
            (None, [only]) => return Ok(only),
            (None, _) => {
                return Err(format!(
                    "{} has {} bundles; say which with bundle_name; allowed: {}",
                    self.path.display(),
                    names.len(),
                    names.join(", ")
                ));
            }
            (Some(name), _) => name,
        };
        let found = self.bundles.iter().find(|bundle| bundle.name == wanted);
        found.ok_or_else(|| {
            format!(
                "{} has no such bundle{}",
                self.path.display(),
                suggestion(wanted, &names)
            )
        })
    }

    /// An error where a tag's number stands.
    pub fn error_of(&self, tag: &BundleTag, message: impl Into<String>) -> SceneError {
        self.error(&tag.id_value, message)
    }

    /// Where a tag's number stands, in words.
    pub fn place_of(&self, tag: &BundleTag) -> String {
        format!("{} line {}", self.path.display(), tag.id_value.line)
    }

    /// An error where a bundle's tags are listed.
    pub fn error_of_bundle(&self, bundle: &Bundle, message: impl Into<String>) -> SceneError {
        self.error(&bundle.layout, message)
    }

    fn none_in_words(&self) -> String {
        let lone = match self.has_lone_tags {
            true => "; its standalone_tags are [[marker]]s in a scene",
            false => "",
        };
        format!("no bundle of tags is in it (tag_bundles, as apriltag_ros has them){lone}")
    }

    fn bundle(
        &self,
        value: &YamlValue,
        number: usize,
        allowed: &TagRanges,
    ) -> Result<Bundle, SceneError> {
        let table = self.table(value, &["name", "layout"])?;
        let layout = entry(table, "layout")
            .ok_or_else(|| self.error(value, "missing layout; a list of tags is expected"))?;
        let name = match entry(table, "name") {
            Some(name) => self.word(name)?.to_owned(),
            None => format!("bundle_{number}"),
        };
        let listed = self.list(layout, "layout")?.iter();
        Ok(Bundle {
            name,
            tags: listed
                .map(|tag| self.tag(tag, allowed))
                .collect::<Result<_, SceneError>>()?,
            layout: layout.clone(),
        })
    }

    fn tag(&self, value: &YamlValue, allowed: &TagRanges) -> Result<BundleTag, SceneError> {
        let table = self.table(value, &TAG_KEYS)?;
        let required = |key: &str| {
            entry(table, key).ok_or_else(|| self.error(value, format!("a tag's {key} is missing")))
        };
        let (id_value, size) = (required("id")?, required("size")?);
        let number = |key: &str, default: f64, range: &Numbers| match entry(table, key) {
            Some(value) => self.number(value, key, range),
            None => Ok(default),
        };
        let parts = |keys: [&str; 3], range: &Numbers| -> Result<DVec3, SceneError> {
            Ok(DVec3::new(
                number(keys[0], 0.0, range)?,
                number(keys[1], 0.0, range)?,
                number(keys[2], 0.0, range)?,
            ))
        };
        let any = Numbers::between(-1e6, 1e6);
        let axis = parts(["qx", "qy", "qz"], &any)?;
        let turn = DQuat::from_vec4(axis.extend(number("qw", 1.0, &any)?));
        if turn.length() < LEAST_TURN {
            return Err(self.error(value, "qw, qx, qy, qz are all 0, which is no turn"));
        }
        let center_m = parts(["x", "y", "z"], &allowed.center)?;
        Ok(BundleTag {
            id: self.id(id_value, &allowed.ids)?,
            size_m: self.number(size, "size", &allowed.size)?,
            bundle_from_tag: DAffine3::from_rotation_translation(turn.normalize(), center_m),
            id_value: id_value.clone(),
        })
    }

    fn id(&self, value: &YamlValue, allowed: &Whole) -> Result<u32, SceneError> {
        let id = self.word(value)?.parse().ok();
        id.filter(|id| (allowed.least..=allowed.most).contains(id))
            .ok_or_else(|| self.error(value, format!("id: {}", allowed.refusal())))
    }

    fn number(&self, value: &YamlValue, key: &str, range: &Numbers) -> Result<f64, SceneError> {
        let number = self.word(value)?.parse::<f64>().ok();
        let number = number.ok_or_else(|| format!("not a number; allowed: {range}"));
        number
            .and_then(|number| range.check(number))
            .map_err(|message| self.error(value, format!("{key}: {message}")))
    }

    fn word<'a>(&self, value: &'a YamlValue) -> Result<&'a str, SceneError> {
        match &value.content {
            YamlContent::Scalar { text, .. } => Ok(text),
            _ => Err(self.error(value, "a number or a word is expected")),
        }
    }

    fn list<'a>(&self, value: &'a YamlValue, key: &str) -> Result<&'a [YamlValue], SceneError> {
        match &value.content {
            YamlContent::List(list) => Ok(list),
            YamlContent::Scalar { text, is_plain } if text.is_empty() && *is_plain => Ok(&[]),
            _ => Err(self.error(value, format!("{key}: a list is expected"))),
        }
    }

    fn table<'a>(
        &self,
        value: &'a YamlValue,
        allowed: &[&str],
    ) -> Result<&'a [(String, YamlValue)], SceneError> {
        let YamlContent::Table(table) = &value.content else {
            let keys = allowed.join(", ");
            return Err(self.error(value, format!("a table of {keys} is expected")));
        };
        for (key, of_key) in table {
            if !allowed.contains(&key.as_str()) {
                let hint = suggestion(key, allowed);
                return Err(self.error(of_key, format!("{key}: unknown key{hint}")));
            }
        }
        Ok(table)
    }

    fn error(&self, value: &YamlValue, message: impl Into<String>) -> SceneError {
        SceneError::at(&self.path, &self.text, value.span_in(&self.text), message)
    }
}

/// What is allowed of a tag.
pub(super) struct TagRanges {
    pub ids: Whole,
    pub size: Numbers,
    pub center: Numbers,
}

fn entry<'a>(table: &'a [(String, YamlValue)], key: &str) -> Option<&'a YamlValue> {
    let mut entries = table.iter();
    entries
        .find(|(known, _)| known == key)
        .map(|(_, value)| value)
}

/// The value of a key, as far in as the names of nodes and namespaces have put it.
fn found<'a>(value: &'a YamlValue, key: &str) -> Option<&'a YamlValue> {
    let YamlContent::Table(table) = &value.content else {
        return None;
    };
    let mut inside = table.iter();
    entry(table, key).or_else(|| inside.find_map(|(_, value)| found(value, key)))
}
