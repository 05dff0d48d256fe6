//! Reads `[[board]]` and `[[marker]]`: what is tracked.

use std::collections::HashMap;

use glam::DVec2;

use super::error::{SceneError, suggestion};
use super::named_files::FileKind;
use super::reader::{Numbers, Table, Value};
use super::{Anchor, DetectorKind, Family, Marker};

/// Side of a marker: below a tenth of a millimetre nothing is seen.
const SIZE: Numbers = Numbers::between(1e-4, 100.0, "m");
const CENTER: Numbers = Numbers::between(-100.0, 100.0, "m");
/// Angles of any number of turns.
pub const ANGLE: Numbers = Numbers::between(-1e6, 1e6, "degrees");

/// The anchors, boards first.
pub fn anchors(root: &Table, detector: DetectorKind) -> Result<Vec<Anchor>, SceneError> {
    let mut reader = AnchorReader {
        detector,
        name_lines: HashMap::new(),
        owners: HashMap::new(),
    };
    let mut anchors = Vec::new();
    for board in root.tables("board", &["name", "family", "border_cells", "markers"])? {
        anchors.push(reader.board(&board)?);
    }
    for marker in root.tables(
        "marker",
        &["name", "family", "border_cells", "id", "size_m"],
    )? {
        anchors.push(reader.lone_marker(&marker)?);
    }
    if anchors.is_empty() {
        return Err(root.error("nothing to track; a [[board]] or a [[marker]] is expected"));
    }
    Ok(anchors)
}

struct AnchorReader {
    detector: DetectorKind,
    name_lines: HashMap<String, usize>,
    /// Name of the anchor that has a marker, and the line that says so.
    owners: HashMap<(Family, u32), (String, usize)>,
}

impl AnchorReader {
    fn board(&mut self, board: &Table) -> Result<Anchor, SceneError> {
        let name = self.name(board)?;
        let family = self.family(board)?;
        let what = "a list of { id, size_m, center_m, rotation_deg = 0 } is expected";
        let listed = board.required("markers", what)?;
        let mut markers = Vec::new();
        for entry in listed.array("tables")? {
            let entry = entry.table(&["id", "size_m", "center_m", "rotation_deg"])?;
            let center = entry.required("center_m", "two numbers in metres are expected")?;
            markers.push(Marker {
                family,
                id: self.id(&entry, family, &name)?,
                size_m: size(&entry)?,
                center_m: DVec2::from_array(center.numbers(&CENTER)?),
                rotation_rad: entry.number_or("rotation_deg", 0.0, &ANGLE)?.to_radians(),
            });
        }
        if markers.is_empty() {
            return Err(listed.error("a board needs at least one marker"));
        }
        Ok(Anchor { name, markers })
    }

    fn lone_marker(&mut self, marker: &Table) -> Result<Anchor, SceneError> {
        let name = self.name(marker)?;
        let family = self.family(marker)?;
        let id = self.id(marker, family, &name)?;
        let size_m = size(marker)?;
        Ok(Anchor::lone(name, family, id, size_m))
    }

    fn name(&mut self, table: &Table) -> Result<String, SceneError> {
        unique_name(table, &mut self.name_lines)
    }

    fn family(&self, table: &Table) -> Result<Family, SceneError> {
        let family = match table.optional("family") {
            Some(written) => self.named_family(&written)?,
            None => Family::TAG36H11,
        };
        let Some(border) = table.optional("border_cells") else {
            return Ok(family);
        };
        let border_cells = border.integer(Family::BORDERS)?;
        family
            .with_border(border_cells)
            .ok_or_else(|| border.error("no marker is printed so"))
    }

    fn named_family(&self, value: &Value) -> Result<Family, SceneError> {
        let written = value.text()?;
        let family = if Family::is_file_name(written) {
            Family::from_file(&value.existing_path(FileKind::Dictionary)?)?
        } else {
            Family::from_name(written).ok_or_else(|| {
                value.error(format!(
                    "unknown family{}",
                    suggestion(written, &Family::all_names().collect::<Vec<_>>())
                ))
            })?
        };
        if !family.is_april_tag() && self.detector == DetectorKind::AprilTag {
            return Err(value.error(
                "libapriltag does not know this family; set tracking.detector = \"aruco\" for it",
            ));
        }
        Ok(family)
    }

    fn id(&mut self, table: &Table, family: Family, anchor: &str) -> Result<u32, SceneError> {
        let value = table.required("id", "the marker's number in its family is expected")?;
        let last = family.id_count() - 1;
        let id = value.integer(0..=last).map_err(|mut error| {
            error.message += &format!(" (the ids of {})", family.name());
            error
        })?;
        match self.owners.insert((family, id), (anchor.to_owned(), value.line())) {
            Some((owner, line)) => Err(value.error(format!(
                "marker {id} of {family} is taken by \"{owner}\" on line {line}; allowed: each marker once"
            ))),
            None => Ok(id),
        }
    }
}

/// A name that no other of its kind has.
pub fn unique_name(
    table: &Table,
    lines: &mut HashMap<String, usize>,
) -> Result<String, SceneError> {
    let value: Value = table.required("name", "a name in quotes is expected")?;
    let name = value.name()?;
    match lines.insert(name.clone(), value.line()) {
        Some(line) => Err(value.error(format!(
            "the name is taken on line {line}; allowed: each name once"
        ))),
        None => Ok(name),
    }
}

fn size(table: &Table) -> Result<f64, SceneError> {
    table
        .required(
            "size_m",
            "the side of the black square in metres is expected",
        )?
        .number(&SIZE)
}
