//! MTL files: what materials they describe, with the extensions for physically based ones (`Pr`, `Pm`, `Ke`, `norm`).

use std::path::Path;

use super::super::notes::Notes;
use super::text::{Record, number, records, without_comment};

/// A material as an MTL file describes it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MtlMaterial {
    /// All that stands behind `newmtl`.
    pub name: String,
    /// `Kd`.
    pub diffuse: Option<[f64; 3]>,
    /// `Ks`.
    pub specular: Option<[f64; 3]>,
    /// `Ke`.
    pub emission: Option<[f64; 3]>,
    /// `Ns`.
    pub shininess: Option<f64>,
    /// `Pr`.
    pub roughness: Option<f64>,
    /// `Pm`.
    pub metallic: Option<f64>,
    /// `d`, or what `Tr` leaves.
    pub opacity: Option<f64>,
    /// Where the file says how opaque it is, a byte of its text.
    pub opacity_at: usize,
    /// Its pictures, each role once.
    pub maps: Vec<MtlMap>,
}

/// What a picture says of a material.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MapRole {
    /// `map_Kd`.
    Diffuse,
    /// `map_Pr`.
    Roughness,
    /// `map_Pm`.
    Metallic,
    /// `norm`, and `map_bump`, `bump` or `map_Kn` where they turn out to be such.
    Normal,
    /// `map_bump`: heights or, with some exporters, normals.
    Bump,
    /// `map_Ke`.
    Emission,
    /// `map_d`.
    Opacity,
    /// `map_ao`.
    Occlusion,
}

/// A picture that a material names.
#[derive(Debug, Clone, PartialEq)]
pub struct MtlMap {
    /// What it says.
    pub role: MapRole,
    /// Its file, as it is written.
    pub file: String,
    /// `-s`: how often it lies along u and v.
    pub scale: [f64; 2],
    /// `-o`: where it begins.
    pub offset: [f64; 2],
    /// `-bm`.
    pub multiplier: f64,
    /// `-clamp on`.
    pub is_clamped: bool,
    /// The byte of the file's text that its record begins at.
    pub at: usize,
}

/// Reads an MTL file's text. Nothing in it is a mistake: what cannot be read is told and passed over.
pub fn read(path: &Path, text: &str, notes: &mut Notes) -> Vec<MtlMaterial> {
    let mut materials: Vec<MtlMaterial> = Vec::new();
    for record in records(text) {
        let keyword = record.keyword();
        if keyword.eq_ignore_ascii_case("newmtl") {
            let name = record.rest().to_owned();
            if name.is_empty() {
                notes.add_at(
                    path,
                    text,
                    record.start,
                    "newmtl: a material without a name",
                );
            }
            materials.push(MtlMaterial {
                name,
                ..MtlMaterial::default()
            });
            continue;
        }
        if keyword.is_empty() {
            continue;
        }
        let Some(material) = materials.last_mut() else {
            notes.add_at(
                path,
                text,
                record.start,
                "before the first newmtl: not used",
            );
            continue;
        };
        if let Some(message) = add(material, keyword, &record) {
            notes.add_at(path, text, record.start, message);
        }
    }
    materials
}

/// Adds a record to a material; what there is to say of it.
fn add(material: &mut MtlMaterial, keyword: &str, record: &Record) -> Option<String> {
    if let Some(role) = map_role(keyword) {
        let map = map(record, role);
        if !map.file.is_empty() {
            material.maps.retain(|known| known.role != role);
            material.maps.push(map);
        }
        return None;
    }
    let colour = || color(keyword, record);
    let part = || part(keyword, record);
    let set = |slot: &mut Option<[f64; 3]>, (value, note): (Option<[f64; 3]>, Option<String>)| {
        *slot = value.or(*slot);
        note
    };
    let set_part = |slot: &mut Option<f64>, (value, note): (Option<f64>, Option<String>)| {
        *slot = value.or(*slot);
        note
    };
    match keyword.to_ascii_lowercase().as_str() {
        "kd" => set(&mut material.diffuse, reflectance(keyword, colour())),
        "ks" => set(&mut material.specular, colour()),
        "ke" => set(&mut material.emission, colour()),
        "ns" => set_part(&mut material.shininess, number_of(keyword, record)),
        "pr" => set_part(&mut material.roughness, part()),
        "pm" => set_part(&mut material.metallic, part()),
        "d" => {
            material.opacity_at = record.start;
            set_part(&mut material.opacity, part())
        }
        "tr" => {
            let (transparency, note) = part();
            // Where both are there they should agree, and d is the one that the format has. Some write Tr 1 for opaque, and
            // nobody makes a thing that is not there.
            if let (Some(transparency), None) = (transparency, material.opacity) {
                material.opacity_at = record.start;
                if transparency == 1.0 {
                    return Some("Tr 1: taken for opaque, since nothing would be seen".to_owned());
                }
                material.opacity = Some(1.0 - transparency);
            }
            note
        }
        // What surroundings give is known here, a model of light is chosen by the numbers, and no light goes through.
        "ka" | "illum" | "ni" | "tf" | "sharpness" | "km" | "map_aat" => None,
        "pc" | "pcr" | "ps" | "aniso" | "anisor" => {
            let is_used = record
                .words()
                .filter_map(number)
                .any(|number| number != 0.0);
            is_used.then(|| format!("{keyword}: not used"))
        }
        _ => Some(format!("{keyword}: not used")),
    }
}

/// What a record's picture says; `None` for records of other kinds.
pub fn map_role(keyword: &str) -> Option<MapRole> {
    Some(match keyword.to_ascii_lowercase().as_str() {
        "map_kd" => MapRole::Diffuse,
        "map_pr" => MapRole::Roughness,
        "map_pm" => MapRole::Metallic,
        "norm" | "map_kn" => MapRole::Normal,
        "map_bump" | "bump" => MapRole::Bump,
        "map_ke" => MapRole::Emission,
        "map_d" => MapRole::Opacity,
        "map_ao" => MapRole::Occlusion,
        _ => return None,
    })
}

/// A picture's record: options that begin with `-`, then a name that may have spaces.
pub fn map(record: &Record, role: MapRole) -> MtlMap {
    let mut map = MtlMap {
        role,
        file: String::new(),
        scale: [1.0; 2],
        offset: [0.0; 2],
        multiplier: 1.0,
        is_clamped: false,
        at: record.start,
    };
    let mut rest = record.rest();
    while let Some((option, behind)) = option(rest) {
        rest = behind;
        let mut take = |most: usize| -> Vec<f64> {
            let mut numbers = Vec::new();
            while numbers.len() < most {
                let (word, behind) = first_word(rest);
                // The last word is the file's name, even if it is a number.
                let Some(number) = number(word).filter(|_| !behind.is_empty()) else {
                    break;
                };
                numbers.push(number);
                rest = behind;
            }
            numbers
        };
        let pair = |numbers: &[f64], usual: f64| {
            [0, 1].map(|axis| numbers.get(axis).copied().unwrap_or(usual))
        };
        match option.to_ascii_lowercase().as_str() {
            "-s" => map.scale = pair(&take(3), 1.0),
            "-o" => map.offset = pair(&take(3), 0.0),
            "-t" => drop(take(3)),
            "-mm" => drop(take(2)),
            "-boost" | "-texres" => drop(take(1)),
            "-bm" => map.multiplier = take(1).first().copied().unwrap_or(1.0),
            "-clamp" => {
                let (word, behind) = first_word(rest);
                map.is_clamped = word.eq_ignore_ascii_case("on");
                rest = behind;
            }
            _ => rest = first_word(rest).1,
        }
    }
    map.file = without_comment(rest).trim_matches('"').to_owned();
    map
}

/// The options that pictures have.
const OPTIONS: [&str; 14] = [
    "-s",
    "-o",
    "-t",
    "-mm",
    "-bm",
    "-boost",
    "-texres",
    "-clamp",
    "-blendu",
    "-blendv",
    "-imfchan",
    "-type",
    "-cc",
    "-colorspace",
];

/// An option at the beginning of a text, and what is behind it. A name may begin with `-` as well.
fn option(text: &str) -> Option<(&str, &str)> {
    let (word, behind) = first_word(text);
    let is_known = OPTIONS
        .iter()
        .any(|option| option.eq_ignore_ascii_case(word));
    is_known.then_some((word, behind))
}

fn first_word(text: &str) -> (&str, &str) {
    let text = text.trim_start();
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// Three numbers, or one that stands for them.
fn color(keyword: &str, record: &Record) -> (Option<[f64; 3]>, Option<String>) {
    let mut words = record.words().peekable();
    match words.peek() {
        None => return (None, None),
        Some(first) if matches!(*first, "spectral" | "xyz") => {
            return (None, Some(format!("{keyword} {first}: not used")));
        }
        Some(_) => {}
    }
    let numbers: Option<Vec<f64>> = words.take(3).map(number).collect();
    let color = match numbers.as_deref() {
        Some([grey]) => Some([*grey; 3]),
        Some([r, g, b]) => Some([*r, *g, *b]),
        _ => None,
    };
    match color {
        Some(color) if color.iter().all(|part| *part >= 0.0) => (Some(color), None),
        Some(color) => (
            Some(color.map(|part| part.max(0.0))),
            Some(format!("{keyword}: a negative number is taken for 0")),
        ),
        None => (
            None,
            Some(format!("{keyword}: not used; 1 or 3 numbers are expected")),
        ),
    }
}

/// More than this above 1 is no rounding.
const ROUNDING: f64 = 1e-3;

/// No surface reflects more than arrives.
fn reflectance(
    keyword: &str,
    (color, note): (Option<[f64; 3]>, Option<String>),
) -> (Option<[f64; 3]>, Option<String>) {
    let is_above = color.is_some_and(|color| color.iter().any(|part| *part > 1.0 + ROUNDING));
    let above = is_above.then(|| format!("{keyword}: more than 1 is taken for 1"));
    (
        color.map(|color| color.map(|part| part.min(1.0))),
        note.or(above),
    )
}

fn number_of(keyword: &str, record: &Record) -> (Option<f64>, Option<String>) {
    // `d -halo 0.5` is thinner in the middle, which no surface here is.
    match record.words().find(|word| *word != "-halo").map(number) {
        None => (None, None),
        Some(None) => (
            None,
            Some(format!("{keyword}: not used; a number is expected")),
        ),
        Some(number) => (number.map(|number| number.max(0.0)), None),
    }
}

/// A number from 0 to 1.
fn part(keyword: &str, record: &Record) -> (Option<f64>, Option<String>) {
    let (number, note) = number_of(keyword, record);
    let is_above = number.is_some_and(|number| number > 1.0 + ROUNDING);
    let above = is_above.then(|| format!("{keyword}: more than 1 is taken for 1"));
    (number.map(|number| number.min(1.0)), note.or(above))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_all(text: &str) -> (Vec<MtlMaterial>, Vec<String>) {
        let mut notes = Notes::default();
        let materials = read(Path::new("a.mtl"), text, &mut notes);
        (materials, notes.told())
    }

    #[test]
    fn materials_have_what_the_file_says() {
        let (materials, notes) = read_all(
            "# made\nnewmtl Wall Red # 3\nKd 1.0000001 .02 .02 # red\nKs 0.5\nNs 96\nKe 2 0 0\nPr .2\nPm 1\nd 0.2\nTr 0.8\n\
             illum 2\nmap_Kd -s 2 3 1 -o .5 0 -bm 0.2 -clamp on Red Wall.png\nmap_Kd \nnewmtl b\nTr .25\n",
        );
        assert_eq!(notes, [""; 0]);
        let wall = &materials[0];
        assert_eq!(wall.name, "Wall Red # 3");
        assert_eq!(wall.diffuse, Some([1.0, 0.02, 0.02]));
        assert_eq!(wall.specular, Some([0.5; 3]));
        assert_eq!((wall.shininess, wall.roughness), (Some(96.0), Some(0.2)));
        assert_eq!((wall.metallic, wall.opacity), (Some(1.0), Some(0.2)));
        assert_eq!(wall.emission, Some([2.0, 0.0, 0.0]));
        let map = &wall.maps[0];
        assert_eq!(
            (map.file.as_str(), map.role),
            ("Red Wall.png", MapRole::Diffuse)
        );
        assert_eq!((map.scale, map.offset), ([2.0, 3.0], [0.5, 0.0]));
        assert_eq!((map.multiplier, map.is_clamped), (0.2, true));
        assert_eq!(materials[1].opacity, Some(0.75));
    }

    #[test]
    fn capitals_and_halos_change_nothing() {
        let (materials, notes) = read_all("Newmtl a\nKD 0,5 .1 .1\nd -halo 0.25\n");
        assert_eq!(notes, [""; 0]);
        assert_eq!(materials[0].diffuse, Some([0.5, 0.1, 0.1]));
        assert_eq!(materials[0].opacity, Some(0.25));
    }

    #[test]
    fn names_of_pictures_may_look_like_anything() {
        for (written, file) in [
            ("map_Kd a b.png", "a b.png"),
            ("map_Kd\t-s 1 1 1 red.png", "red.png"),
            ("map_Kd -s 2 wall.png", "wall.png"),
            ("map_Kd -o 1 2 3 4", "4"),
            (
                "map_Kd -blendu off -imfchan l C:\\maps\\x y.tga # old",
                "C:\\maps\\x y.tga",
            ),
            ("map_Kd -odd.png", "-odd.png"),
            ("map_Kd -colorspace sRGB a.png", "a.png"),
            ("map_Kd \"in quotes.png\"", "in quotes.png"),
            ("map_Kd #1.png", "#1.png"),
        ] {
            let (materials, _) = read_all(&format!("newmtl a\n{written}\n"));
            assert_eq!(materials[0].maps[0].file, file, "{written}");
        }
    }

    #[test]
    fn what_is_not_used_is_told_once_with_its_line() {
        let (materials, notes) = read_all(
            "Kd 1 1 1\nnewmtl a\nKd 2 0 0\nKd 1 1\nKd spectral a.rfl\nKs x\nKd -1 0 0\nNs nan\nrefl a.png\nrefl b.png\nPc 0\n\
             aniso 0.5\nnewmtl\nTr 1\n",
        );
        assert_eq!(materials[0].diffuse, Some([0.0; 3]));
        assert_eq!(materials[1].opacity, None);
        let expected = [
            "a.mtl:1: before the first newmtl: not used",
            "a.mtl:3: Kd: more than 1 is taken for 1",
            "a.mtl:4: Kd: not used; 1 or 3 numbers are expected",
            "a.mtl:5: Kd spectral: not used",
            "a.mtl:6: Ks: not used; 1 or 3 numbers are expected",
            "a.mtl:7: Kd: a negative number is taken for 0",
            "a.mtl:8: Ns: not used; a number is expected",
            "a.mtl:9: refl: not used (and 1 more such)",
            "a.mtl:12: aniso: not used",
            "a.mtl:13: newmtl: a material without a name",
            "a.mtl:14: Tr 1: taken for opaque, since nothing would be seen",
        ];
        assert_eq!(notes, expected);
    }
}
