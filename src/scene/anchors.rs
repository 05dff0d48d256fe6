//! Reads `[[board]]` and `[[marker]]`: what is tracked.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec2, DVec3};

use super::bundle::{BundleFile, TagRanges};
use super::error::SceneError;
use super::named_files::FileKind;
use super::placement::{ANGLE, turn};
use super::ranges::{Digits, Numbers, Whole};
use super::reader::{Table, Value};
use super::schema::key::Missing::{Is, Means};
use super::schema::section::{Example, Section, Times};
use super::schema::values::{InWords, Written};
use super::{Anchor, DetectorKind, Drawing, Family, Ink, Marker};

/// A print is measured with a caliper, to 0.01 mm.
const PRINT: Digits = Digits::Decimals(5);
/// Side of a marker: below a tenth of a millimetre nothing is seen.
const SIZE: Numbers = Numbers::between(1e-4, 100.0).unit("m").digits(PRINT);
/// Of a marker's centre on its board.
pub const CENTER: Numbers = Numbers::between(-100.0, 100.0).unit("m").digits(PRINT);

keys! {
    /// The name of a board or a lone marker.
    pub static ANCHOR_NAME: AnchorNameKeys;
    required {
        /// No other board or marker may have it.
        name: String => "a name in quotes is expected";
    }
}

keys! {
    /// How markers are printed.
    pub static PRINTED: PrintedKeys;

    /// AprilTag: "tag16h5", "tag25h9", "tag36h10", "tag36h11", "tagStandard41h12", "tagStandard52h13", "tagCircle21h7",
    /// "tagCircle49h12", "tagCustom48h12"; "DICT_APRILTAG_36h11" and its like are OpenCV's drawings, which stand on their
    /// heads. ArUco: "DICT_4X4_50" … "DICT_7X7_1000" (4 to 7 cells; 50, 100, 250 or 1000 markers), "DICT_ARUCO_ORIGINAL"
    /// and "DICT_ARUCO_MIP_36h12". Or a dictionary's file, as OpenCV's writeDictionary writes it.
    family: Written, InWords::file("a family, or a file (.yml)", FileKind::Dictionary) => Means(Written, "\"tag36h11\"");
    /// Width of the black border: 2 as on Kalibr's AprilGrids. A marker of another border is another marker.
    border_cells: u32, Whole::between(*Family::BORDERS.start(), *Family::BORDERS.end()).unit("cells") => Is(1);
    /// Printed white on black, each cell of the other colour.
    inverted: bool => Is(false);
}

keys! {
    /// A marker.
    pub static MARKER: MarkerKeys;
    required {
        /// Its number in the family; a marker belongs to one board or stands alone, not both.
        id: Written, InWords::new("a number of the family") => "the marker's number in its family is expected";
        /// Side of its black square.
        size_m: f64, SIZE => "the side of the black square in metres is expected";
    }
}

keys! {
    /// A marker's place on its board.
    pub static ON_BOARD: OnBoardKeys;
    required {
        /// In the board's frame. With a third number markers lie in space, on a cube or on walls.
        center_m: Written, InWords::new("two or three numbers, -100 to 100 m")
            => "two numbers in metres are expected, or three in space";
    }
    /// Turn in the board's plane, counter-clockwise; or turns about x, then y, then z of the board's frame. A marker that is not
    /// turned has its right along x, its top along y, and is read from z.
    rotation_deg: Written, InWords::new("a number or three numbers, degrees") => Means(Written, "0");
}

keys! {
    /// The markers of a board.
    pub static BOARD: BoardKeys;

    /// Its markers, at least one; or a bundle has them.
    markers: Written, InWords::parts("a list of tables", &BOARD_MARKER_SECTION) => Means(Written, "none");
    /// Its markers as the ROS package apriltag_ros has them: a file with tag_bundles.
    bundle: Written, InWords::file("bundles of tags (.yaml)", FileKind::Bundles) => Means(Written, "none");
    /// The bundle's name in that file.
    bundle_name: Written, InWords::new("a name of the file") => Means(Written, "the only one");
}

/// An entry of a board's `markers`.
pub static BOARD_MARKER_SECTION: Section = Section {
    name: "markers",
    says: "A marker of a board.",
    times: Times::InBraces,
    groups: &[MarkerKeys::ALL, OnBoardKeys::ALL],
    shown: &[],
    is_aside: false,
};

/// `[[board]]`.
pub static BOARD_SECTION: Section = Section {
    name: "board",
    says: "Rigid boards of markers; the first is the world. A scene needs at least one board or marker.",
    times: Times::Any,
    groups: &[AnchorNameKeys::ALL, PrintedKeys::ALL, BoardKeys::ALL],
    shown: &[
        ("name", Example::Live("\"table\"")),
        ("family", Example::Live("\"tag36h11\"")),
        (
            "markers",
            Example::Live(
                "[\n    { id = 0, size_m = 0.045, center_m = [-0.175, 0.115], rotation_deg = 0 },\n    \
                 { id = 1, size_m = 0.045, center_m = [0.175, 0.115] },\n    \
                 { id = 2, size_m = 0.045, center_m = [-0.175, -0.115] },\n    \
                 { id = 3, size_m = 0.045, center_m = [0.175, -0.115] },\n]",
            ),
        ),
        ("bundle", Example::Aside("\"tags.yaml\"")),
        ("bundle_name", Example::Aside("\"cube\"")),
    ],
    is_aside: false,
};

/// `[[marker]]`.
pub static MARKER_SECTION: Section = Section {
    name: "marker",
    says: "Lone markers, each with a frame of its own at its centre.",
    times: Times::Any,
    groups: &[AnchorNameKeys::ALL, PrintedKeys::ALL, MarkerKeys::ALL],
    shown: &[
        ("name", Example::Live("\"card\"")),
        ("family", Example::Live("\"tag36h11\"")),
        ("id", Example::Live("17")),
        ("size_m", Example::Live("0.036")),
    ],
    is_aside: false,
};

/// The anchors, boards first.
pub fn anchors(root: &Table, detector: DetectorKind) -> Result<Vec<Anchor>, SceneError> {
    let mut reader = AnchorReader {
        detector,
        name_lines: HashMap::new(),
        owners: HashMap::new(),
    };
    let mut anchors = Vec::new();
    for board in BOARD_SECTION.tables(root)? {
        anchors.push(reader.board(&board)?);
    }
    for marker in MARKER_SECTION.tables(root)? {
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
    /// Name of the anchor that has a marker, and where that is said.
    owners: HashMap<(Family, u32), (String, String)>,
}

impl AnchorReader {
    fn board(&mut self, board: &Table) -> Result<Anchor, SceneError> {
        let name = self.name(board)?;
        let family = self.family(board)?;
        if let (Some(name), None) = (BOARD.bundle_name.value(board), BOARD.bundle.value(board)) {
            return Err(name.error("no bundle is named; give the file that has it with bundle"));
        }
        let markers = match (BOARD.markers.value(board), BOARD.bundle.value(board)) {
            (Some(listed), None) => self.listed(&listed, family, &name)?,
            (None, Some(file)) => self.bundle(board, &file, family, &name)?,
            (Some(_), Some(file)) => {
                return Err(file.error_without_value(
                    "bundle: the board has markers already; allowed: one of the two",
                ));
            }
            (None, None) => {
                return Err(board.error(
                    "missing markers: a list of { id, size_m, center_m, rotation_deg = 0 } is expected, or a bundle",
                ));
            }
        };
        Ok(Anchor { name, markers })
    }

    fn listed(
        &mut self,
        listed: &Value,
        family: Family,
        anchor: &str,
    ) -> Result<Vec<Marker>, SceneError> {
        let mut markers = Vec::new();
        for entry in listed.array("tables")? {
            let entry = BOARD_MARKER_SECTION.table_of(&entry)?;
            let id = self.id(&entry, family, anchor)?;
            markers.push(Marker {
                anchor_from_marker: place_on_board(&entry)?,
                ..Marker::alone(family, id, MARKER.size_m.read(&entry)?)
            });
        }
        if markers.is_empty() {
            return Err(listed.error("a board needs at least one marker"));
        }
        Ok(markers)
    }

    /// The markers of a bundle in a file.
    fn bundle(
        &mut self,
        board: &Table,
        file: &Value,
        family: Family,
        anchor: &str,
    ) -> Result<Vec<Marker>, SceneError> {
        let allowed = TagRanges {
            ids: Whole::between(0, family.id_count() - 1),
            size: SIZE,
            center: CENTER,
        };
        let bundles = BundleFile::read(&file.existing_path(FileKind::Bundles)?, &allowed)?;
        let name = BOARD.bundle_name.value(board);
        let wanted = name.as_ref().map(Value::text).transpose()?;
        let place = name.as_ref().unwrap_or(file);
        let bundle = bundles
            .bundle_of(wanted)
            .map_err(|message| place.error(message))?;
        let mut markers = Vec::new();
        for tag in &bundle.tags {
            self.own(family, tag.id, anchor, bundles.place_of(tag))
                .map_err(|message| bundles.error_of(tag, message))?;
            markers.push(Marker {
                anchor_from_marker: tag.bundle_from_tag,
                ..Marker::alone(family, tag.id, tag.size_m)
            });
        }
        if markers.is_empty() {
            return Err(bundles.error_of_bundle(bundle, "a bundle needs at least one tag"));
        }
        Ok(markers)
    }

    fn lone_marker(&mut self, marker: &Table) -> Result<Anchor, SceneError> {
        let name = self.name(marker)?;
        let family = self.family(marker)?;
        let id = self.id(marker, family, &name)?;
        let size_m = MARKER.size_m.read(marker)?;
        Ok(Anchor::lone(name, family, id, size_m))
    }

    fn name(&mut self, table: &Table) -> Result<String, SceneError> {
        unique_name(&ANCHOR_NAME.name.require(table)?, &mut self.name_lines)
    }

    fn family(&self, table: &Table) -> Result<Family, SceneError> {
        let family = match PRINTED.family.value(table) {
            Some(written) => self.named_family(&written)?,
            None => Family::TAG36H11,
        };
        let border_cells = PRINTED.border_cells.read(table)?;
        let ink = match PRINTED.inverted.read(table)? {
            true => Ink::WhiteOnBlack,
            false => Ink::BlackOnWhite,
        };
        let bordered = family.with_border(border_cells);
        Ok(bordered
            .ok_or_else(|| {
                table.error(format!(
                    "{family} has a ring of one cell; allowed: border_cells = 1"
                ))
            })?
            .with_ink(ink))
    }

    fn named_family(&self, value: &Value) -> Result<Family, SceneError> {
        let written = value.text()?;
        let family = if Family::is_file_name(written) {
            Family::from_file(&value.existing_path(FileKind::Dictionary)?)?
        } else {
            Family::from_name(written).ok_or_else(|| value.error(Family::unknown(written)))?
        };
        let unknown = match self.detector {
            DetectorKind::ByFamily => return Ok(family),
            DetectorKind::AprilTag => (!family.is_april_tag()).then_some("libapriltag"),
            DetectorKind::Aruco => family.has_ring().then_some("OpenCV's ArUco"),
        };
        match unknown {
            Some(detector) => Err(value.error(format!(
                "{detector} does not know this family; leave out tracking.detector, and the one that does is taken"
            ))),
            None => Ok(family),
        }
    }

    fn id(&mut self, table: &Table, family: Family, anchor: &str) -> Result<u32, SceneError> {
        let value = MARKER.id.require(table)?;
        let last = family.id_count() - 1;
        let id = value
            .integer(&Whole::between(0, last))
            .map_err(|mut error| {
                error.message += &format!(" (the ids of {})", family.name());
                error
            })?;
        self.own(family, id, anchor, format!("line {}", value.line()))
            .map_err(|message| value.error(message))?;
        Ok(id)
    }

    /// Notes that an anchor has a marker.
    fn own(&mut self, family: Family, id: u32, anchor: &str, place: String) -> Result<(), String> {
        // However it is drawn, it is one marker to a detector.
        let seen_as = family.drawn_as(Drawing::Own);
        match self
            .owners
            .insert((seen_as, id), (anchor.to_owned(), place))
        {
            Some((owner, place)) => Err(format!(
                "marker {id} of {family} is taken by \"{owner}\" on {place}; allowed: each marker once"
            )),
            None => Ok(()),
        }
    }
}

/// A marker's place on its board: in the plane with two numbers and one turn, anywhere with three.
fn place_on_board(entry: &Table) -> Result<DAffine3, SceneError> {
    let center = ON_BOARD.center_m.require(entry)?;
    let in_plane =
        |value: &Value| !value.is_array() || value.array("numbers").is_ok_and(|all| all.len() == 2);
    let center_m = match in_plane(&center) {
        true => DVec2::from_array(center.numbers(&CENTER)?).extend(0.0),
        false => DVec3::from_array(center.numbers(&CENTER)?),
    };
    let rotation = ON_BOARD.rotation_deg.value(entry);
    Ok(match rotation {
        Some(value) if value.is_array() => {
            let rotation_deg = DVec3::from_array(value.numbers(&ANGLE)?);
            DAffine3::from_rotation_translation(turn(rotation_deg), center_m)
        }
        Some(value) => {
            let rotation_rad = value.number(&ANGLE)?.to_radians();
            DAffine3::from_mat3_translation(DMat3::from_rotation_z(rotation_rad), center_m)
        }
        None => DAffine3::from_translation(center_m),
    })
}

/// A name that no other of its kind has.
pub fn unique_name(
    value: &Value,
    lines: &mut HashMap<String, usize>,
) -> Result<String, SceneError> {
    let name = value.name()?;
    match lines.insert(name.clone(), value.line()) {
        Some(line) => Err(value.error(format!(
            "the name is taken on line {line}; allowed: each name once"
        ))),
        None => Ok(name),
    }
}
