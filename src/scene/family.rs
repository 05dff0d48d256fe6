//! The families of square markers, by the names under which people print them.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;

use super::error::suggestion;
use super::{Dictionary, SceneError};

/// A family of markers as printed: its codes and the black border around them. The same code in another border is
/// another marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Family {
    codes: Codes,
    border_cells: u8,
    drawing: Drawing,
    ink: Ink,
}

/// Which way up a family's pictures stand: OpenCV's of AprilTag's families are turned by half against AprilTag's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Drawing {
    /// As those draw it who made the family.
    Own,
    /// As OpenCV up to 4.x draws AprilTag's families, by the name `DICT_APRILTAG_…`.
    OpenCv,
}

/// The colours of a print.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Ink {
    /// A black border on white.
    BlackOnWhite,
    /// Inverted: a white border on black, and each cell of the other colour.
    WhiteOnBlack,
}

/// The codes of a family (AprilTag) or dictionary (ArUco).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Codes {
    /// AprilTag 16h5: 4 × 4 cells; false ids are common.
    Tag16h5,
    /// AprilTag 25h9: 5 × 5 cells.
    Tag25h9,
    /// AprilTag 36h10: 6 × 6 cells.
    Tag36h10,
    /// AprilTag 36h11: 6 × 6 cells, the usual choice.
    Tag36h11,
    /// AprilTag Standard41h12: cells inside a white ring of 5 × 5 and around it.
    Standard41h12,
    /// AprilTag Standard52h13: cells inside a white ring of 6 × 6 and around it.
    Standard52h13,
    /// AprilTag Circle21h7: a round tag, its ring 5 × 5.
    Circle21h7,
    /// AprilTag Circle49h12: a round tag, its ring 5 × 5.
    Circle49h12,
    /// AprilTag Custom48h12: as Standard52h13, its middle left free.
    Custom48h12,
    /// OpenCV's `DICT_NxN_M`: N cells a side, M markers (50, 100, 250 or 1000).
    Aruco {
        /// Cells a side, without the black border: 4 to 7.
        cells: u8,
        /// Number of markers: 50, 100, 250 or 1000.
        count: u16,
    },
    /// The original ArUco library's markers: 5 × 5 cells.
    ArucoOriginal,
    /// ArUco's MIP 36h12: 6 × 6 cells.
    ArucoMip36h12,
    /// Somebody's own, from a file.
    Own(&'static Dictionary),
}

/// All families with their names; OpenCV's own names of AprilTag's families mean OpenCV's pictures.
const NAMES: [(&str, Codes, Drawing); 31] = [
    own("tag16h5", Codes::Tag16h5),
    own("tag25h9", Codes::Tag25h9),
    own("tag36h10", Codes::Tag36h10),
    own("tag36h11", Codes::Tag36h11),
    own("tagStandard41h12", Codes::Standard41h12),
    own("tagStandard52h13", Codes::Standard52h13),
    own("tagCircle21h7", Codes::Circle21h7),
    own("tagCircle49h12", Codes::Circle49h12),
    own("tagCustom48h12", Codes::Custom48h12),
    own("DICT_4X4_50", aruco(4, 50)),
    own("DICT_4X4_100", aruco(4, 100)),
    own("DICT_4X4_250", aruco(4, 250)),
    own("DICT_4X4_1000", aruco(4, 1000)),
    own("DICT_5X5_50", aruco(5, 50)),
    own("DICT_5X5_100", aruco(5, 100)),
    own("DICT_5X5_250", aruco(5, 250)),
    own("DICT_5X5_1000", aruco(5, 1000)),
    own("DICT_6X6_50", aruco(6, 50)),
    own("DICT_6X6_100", aruco(6, 100)),
    own("DICT_6X6_250", aruco(6, 250)),
    own("DICT_6X6_1000", aruco(6, 1000)),
    own("DICT_7X7_50", aruco(7, 50)),
    own("DICT_7X7_100", aruco(7, 100)),
    own("DICT_7X7_250", aruco(7, 250)),
    own("DICT_7X7_1000", aruco(7, 1000)),
    own("DICT_ARUCO_ORIGINAL", Codes::ArucoOriginal),
    own("DICT_ARUCO_MIP_36h12", Codes::ArucoMip36h12),
    ("DICT_APRILTAG_16h5", Codes::Tag16h5, Drawing::OpenCv),
    ("DICT_APRILTAG_25h9", Codes::Tag25h9, Drawing::OpenCv),
    ("DICT_APRILTAG_36h10", Codes::Tag36h10, Drawing::OpenCv),
    ("DICT_APRILTAG_36h11", Codes::Tag36h11, Drawing::OpenCv),
];

/// Other names that are understood: the ArUco library's own, and OpenCV's with a capital H.
const OTHER_NAMES: [(&str, &str); 2] = [
    ("ARUCO_MIP_36h12", "DICT_ARUCO_MIP_36h12"),
    ("ARUCO", "DICT_ARUCO_ORIGINAL"),
];

/// A name without what says that it is one: `36h11` of `AprilTag 36h11` and of `DICT_APRILTAG_36h11`.
fn core_of(name: &str) -> String {
    let plain: String = name
        .chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|letter| letter.to_ascii_lowercase())
        .collect();
    let mut core = plain.as_str();
    for word in ["dict", "april", "aruco", "tag"] {
        core = core.strip_prefix(word).unwrap_or(core);
    }
    core.to_owned()
}

const fn own(name: &'static str, codes: Codes) -> (&'static str, Codes, Drawing) {
    (name, codes, Drawing::Own)
}

const fn aruco(cells: u8, count: u16) -> Codes {
    Codes::Aruco { cells, count }
}

impl Family {
    /// AprilTag's 16h5 as AprilTag prints it.
    pub const TAG16H5: Self = Self::of(Codes::Tag16h5);
    /// AprilTag's 25h9 as AprilTag prints it.
    pub const TAG25H9: Self = Self::of(Codes::Tag25h9);
    /// AprilTag's 36h10 as AprilTag prints it.
    pub const TAG36H10: Self = Self::of(Codes::Tag36h10);
    /// AprilTag's 36h11 as AprilTag prints it: the usual choice.
    pub const TAG36H11: Self = Self::of(Codes::Tag36h11);

    /// How wide borders may be, cells; all but Kalibr's targets have 1.
    pub const BORDERS: RangeInclusive<u32> = 1..=2;

    /// Codes in the usual border of one cell.
    pub const fn of(codes: Codes) -> Self {
        Self {
            codes,
            border_cells: 1,
            drawing: Drawing::Own,
            ink: Ink::BlackOnWhite,
        }
    }

    /// The same codes in a border of so many cells; `None` outside [`Family::BORDERS`], and where the codes lie around a
    /// ring that is one cell wide.
    pub fn with_border(self, border_cells: u32) -> Option<Self> {
        let border_cells = u8::try_from(border_cells)
            .ok()
            .filter(|&cells| Self::BORDERS.contains(&u32::from(cells)))
            .filter(|&cells| cells == 1 || !self.has_ring())?;
        Some(Self {
            border_cells,
            ..self
        })
    }

    /// The same codes in these colours.
    pub fn with_ink(self, ink: Ink) -> Self {
        Self { ink, ..self }
    }

    /// The same codes as this drawing stands.
    pub fn drawn_as(self, drawing: Drawing) -> Self {
        Self { drawing, ..self }
    }

    /// The family of a name like `tag36h11` or `DICT_4X4_50`, capitals or not, in a black border of one cell.
    pub fn from_name(name: &str) -> Option<Self> {
        let other = OTHER_NAMES
            .iter()
            .find(|(known, _)| known.eq_ignore_ascii_case(name));
        let name = other.map_or(name, |(_, usual)| usual);
        NAMES
            .iter()
            .find(|(known, ..)| known.eq_ignore_ascii_case(name))
            .map(|&(_, codes, drawing)| Self::of(codes).drawn_as(drawing))
    }

    /// What to say of a name that is none: the families that it may mean, and all that there are.
    pub fn unknown(written: &str) -> String {
        let names: Vec<&str> = Self::all_names().collect();
        let core = core_of(written);
        let meant: Vec<String> = NAMES
            .iter()
            .filter(|(name, ..)| !core.is_empty() && core_of(name) == core)
            .map(
                |(name, codes, drawing)| match (drawing, Self::of(*codes).is_april_tag()) {
                    (Drawing::OpenCv, _) => {
                        format!("\"{name}\" (as OpenCV draws it, the other way up)")
                    }
                    (Drawing::Own, true) => format!("\"{name}\" (as AprilTag prints it)"),
                    (Drawing::Own, false) => format!("\"{name}\""),
                },
            )
            .collect();
        match meant.is_empty() {
            true => format!("unknown family{}", suggestion(written, &names)),
            false => format!(
                "unknown family; did you mean {}? allowed: {}",
                meant.join(" or "),
                names.join(", ")
            ),
        }
    }

    /// Of OpenCV's dictionaries, which begin with the same markers, the smallest that has a number; else the family itself.
    pub fn smallest_with(self, id: u32) -> Self {
        let Codes::Aruco { cells, .. } = self.codes else {
            return self;
        };
        let counts = [50, 100, 250, 1000].into_iter();
        let count = counts.filter(|&count| id < u32::from(count)).min();
        count.map_or(self, |count| Self {
            codes: aruco(cells, count),
            ..self
        })
    }

    /// Whether a name is that of a dictionary's file, which [`Family::from_file`] reads.
    pub fn is_file_name(name: &str) -> bool {
        let extension = Path::new(name).extension().unwrap_or_default();
        extension.eq_ignore_ascii_case("yml") || extension.eq_ignore_ascii_case("yaml")
    }

    /// The dictionary of a file as OpenCV's `writeDictionary` writes it (YAML), in a border of one cell.
    ///
    /// # Errors
    /// A file that cannot be read; a mistake in it, with its line.
    pub fn from_file(path: &Path) -> Result<Self, SceneError> {
        Dictionary::read(path).map(|dictionary| Self::of(Codes::Own(dictionary)))
    }

    /// The name that [`Family::from_name`] knows, or the path of its file; it does not tell the border.
    pub fn name(self) -> &'static str {
        if let Codes::Own(dictionary) = self.codes {
            return dictionary.name();
        }
        // An `Aruco` of a size that does not exist can be written down in code, never read from a scene.
        NAMES
            .iter()
            .find(|&&(_, codes, drawing)| (codes, drawing) == (self.codes, self.drawing))
            .map_or("DICT_UNKNOWN", |&(name, ..)| name)
    }

    /// The names of all families.
    pub fn all_names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().map(|&(name, ..)| name)
    }

    /// Which way up its pictures stand.
    pub fn drawing(self) -> Drawing {
        self.drawing
    }

    /// Its colours.
    pub fn ink(self) -> Ink {
        self.ink
    }

    /// Whether its codes lie inside and around a ring one cell wide, white on black, as AprilTag 3's new families have it.
    pub fn has_ring(self) -> bool {
        self.codes.ring_cells().is_some()
    }

    /// Its codes.
    pub fn codes(self) -> Codes {
        self.codes
    }

    /// Width of the black border, cells.
    pub fn border_cells(self) -> u32 {
        u32::from(self.border_cells)
    }

    /// Whether it is lighter outside the square whose corners are found than inside.
    pub fn is_lighter_outside(self) -> bool {
        (self.ink == Ink::BlackOnWhite) != self.has_ring()
    }

    /// Cells a side of the square whose corners are found: border and code, or the ring.
    pub fn cells_across(self) -> u32 {
        self.codes
            .ring_cells()
            .unwrap_or(self.codes.cells() + 2 * self.border_cells())
    }

    /// Cells of a code that the detectors read.
    pub fn bits(self) -> u32 {
        self.codes.bits()
    }

    /// Of a family with a lower [`Family::false_rate`] the code is proof enough.
    pub const STRONG_RATE: f64 = 1e-5;

    /// The part of all random codes that are taken for one of the family's, however they are turned, when so many wrong
    /// bits are corrected.
    pub fn false_rate(self, corrected_bits: u32) -> f64 {
        let bits = self.bits();
        let mut ways = 1.0;
        let mut within = 1.0;
        for wrong in 1..=corrected_bits.min(bits) {
            ways *= f64::from(bits - wrong + 1) / f64::from(wrong);
            within += ways;
        }
        4.0 * f64::from(self.id_count()) * within / f64::from(bits).exp2()
    }

    /// Number of markers; their ids run from 0.
    pub fn id_count(self) -> u32 {
        self.codes.id_count()
    }

    /// Wrong bits that the smallest distance between two of its codes allows to correct, at most.
    pub fn correctable_bits(self) -> u32 {
        self.codes.correctable_bits()
    }

    /// Whether it is one of AprilTag's families, which libapriltag knows; OpenCV knows those without a ring too.
    pub fn is_april_tag(self) -> bool {
        self.codes.is_april_tag()
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
        if self.ink == Ink::WhiteOnBlack {
            f.write_str(" white on black")?;
        }
        match self.border_cells {
            1 => Ok(()),
            cells => write!(f, " with a border of {cells} cells"),
        }
    }
}

impl Codes {
    fn id_count(self) -> u32 {
        match self {
            Self::Tag16h5 => 30,
            Self::Tag25h9 => 35,
            Self::Tag36h10 => 2320,
            Self::Tag36h11 => 587,
            Self::Standard41h12 => 2115,
            Self::Standard52h13 => 48_714,
            Self::Circle21h7 => 38,
            Self::Circle49h12 => 65_535,
            Self::Custom48h12 => 42_211,
            Self::Aruco { count, .. } => u32::from(count),
            Self::ArucoOriginal => 1024,
            Self::ArucoMip36h12 => Dictionary::mip_36h12().id_count(),
            Self::Own(dictionary) => dictionary.id_count(),
        }
    }

    /// Cells a side of the code, without the black border; with a ring, of what it and all around it take.
    pub fn cells(self) -> u32 {
        match self {
            Self::Tag16h5 => 4,
            Self::Tag25h9 | Self::ArucoOriginal => 5,
            Self::Tag36h10 | Self::Tag36h11 | Self::ArucoMip36h12 => 6,
            Self::Standard41h12 | Self::Circle21h7 => 9,
            Self::Standard52h13 | Self::Custom48h12 => 10,
            Self::Circle49h12 => 11,
            Self::Aruco { cells, .. } => u32::from(cells),
            Self::Own(dictionary) => dictionary.cells(),
        }
    }

    /// Cells a side of the ring, of the families that have one.
    fn ring_cells(self) -> Option<u32> {
        match self {
            Self::Standard41h12 | Self::Circle21h7 | Self::Circle49h12 => Some(5),
            Self::Standard52h13 | Self::Custom48h12 => Some(6),
            _ => None,
        }
    }

    fn bits(self) -> u32 {
        match self {
            Self::Standard41h12 => 41,
            Self::Standard52h13 => 52,
            Self::Circle21h7 => 21,
            Self::Circle49h12 => 49,
            Self::Custom48h12 => 48,
            _ => self.cells() * self.cells(),
        }
    }

    fn correctable_bits(self) -> u32 {
        let distance = match self {
            Self::Tag16h5 => 5,
            Self::Tag25h9 => 9,
            Self::Tag36h10 => 10,
            Self::Tag36h11 => 11,
            // Tables of more corrected bits take libapriltag gigabytes.
            Self::Standard52h13 | Self::Circle49h12 | Self::Custom48h12 => 3,
            Self::Standard41h12 | Self::ArucoMip36h12 => 12,
            Self::Circle21h7 => 7,
            Self::ArucoOriginal => 1,
            Self::Own(dictionary) => dictionary.least_distance(),
            Self::Aruco { cells, count } => match (cells, count) {
                (4, 50) => 4,
                (4, 100 | 250) => 3,
                (4, _) => 2,
                (5, 50) => 8,
                (5, 100) => 7,
                (5, 250) => 6,
                (5, _) => 5,
                (6, 50) => 13,
                (6, 100) => 12,
                (6, 250) => 11,
                (6, _) => 9,
                (_, 50) => 19,
                (_, 100) => 18,
                (_, 250) => 17,
                _ => 14,
            },
        };
        (distance - 1) / 2
    }

    fn is_april_tag(self) -> bool {
        matches!(
            self,
            Self::Tag16h5 | Self::Tag25h9 | Self::Tag36h10 | Self::Tag36h11
        ) || self.ring_cells().is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_there_and_back() {
        for name in Family::all_names() {
            assert_eq!(Family::from_name(name).map(Family::name), Some(name));
        }
        assert_eq!(Family::from_name("TAG36H11"), Some(Family::TAG36H11));
        assert_eq!(
            Family::from_name("DICT_APRILTAG_36h11"),
            Some(Family::TAG36H11.drawn_as(Drawing::OpenCv))
        );
        assert_eq!(
            Family::from_name("aruco_mip_36h12"),
            Some(Family::of(Codes::ArucoMip36h12))
        );
        for wrong in ["", "tag36h12", "DICT_4X4_51", "DICT_8X8_50", "36h11"] {
            assert_eq!(Family::from_name(wrong), None);
        }
    }

    #[test]
    fn weak_codes_are_known_for_weak() {
        let rate = |name, bits| Family::from_name(name).map_or(1.0, |f| f.false_rate(bits));
        assert!((rate("DICT_4X4_50", 0) - 200.0 / 65536.0).abs() < 1e-12);
        assert!((rate("DICT_4X4_50", 1) - 17.0 * 200.0 / 65536.0).abs() < 1e-12);
        assert!(rate("tag36h11", 1) < 2e-6);
    }

    #[test]
    fn a_border_makes_another_family_of_the_same_codes() {
        let wide = Family::TAG36H11.with_border(2).unwrap();
        assert_ne!(wide, Family::TAG36H11);
        assert_eq!(wide.with_border(1), Some(Family::TAG36H11));
        assert_eq!((wide.cells_across(), wide.id_count()), (10, 587));
        assert_eq!(wide.to_string(), "tag36h11 with a border of 2 cells");
        for wrong in [0, 3, 257] {
            assert_eq!(Family::TAG36H11.with_border(wrong), None);
        }
    }
}
