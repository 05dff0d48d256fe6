//! The families of square markers, by the names under which people print them.

use std::fmt;
use std::ops::RangeInclusive;
use std::path::Path;

use super::{Dictionary, SceneError};

/// A family of markers as printed: its codes and the black border around them. The same code in another border is
/// another marker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Family {
    codes: Codes,
    border_cells: u8,
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
    /// OpenCV's `DICT_NxN_M`: N cells a side, M markers (50, 100, 250 or 1000).
    Aruco {
        /// Cells a side, without the black border: 4 to 7.
        cells: u8,
        /// Number of markers: 50, 100, 250 or 1000.
        count: u16,
    },
    /// The original ArUco library's markers: 5 × 5 cells.
    ArucoOriginal,
    /// Somebody's own, from a file.
    Own(&'static Dictionary),
}

/// All codes with their names.
const NAMES: [(&str, Codes); 21] = [
    ("tag16h5", Codes::Tag16h5),
    ("tag25h9", Codes::Tag25h9),
    ("tag36h10", Codes::Tag36h10),
    ("tag36h11", Codes::Tag36h11),
    ("DICT_4X4_50", aruco(4, 50)),
    ("DICT_4X4_100", aruco(4, 100)),
    ("DICT_4X4_250", aruco(4, 250)),
    ("DICT_4X4_1000", aruco(4, 1000)),
    ("DICT_5X5_50", aruco(5, 50)),
    ("DICT_5X5_100", aruco(5, 100)),
    ("DICT_5X5_250", aruco(5, 250)),
    ("DICT_5X5_1000", aruco(5, 1000)),
    ("DICT_6X6_50", aruco(6, 50)),
    ("DICT_6X6_100", aruco(6, 100)),
    ("DICT_6X6_250", aruco(6, 250)),
    ("DICT_6X6_1000", aruco(6, 1000)),
    ("DICT_7X7_50", aruco(7, 50)),
    ("DICT_7X7_100", aruco(7, 100)),
    ("DICT_7X7_250", aruco(7, 250)),
    ("DICT_7X7_1000", aruco(7, 1000)),
    ("DICT_ARUCO_ORIGINAL", Codes::ArucoOriginal),
];

const fn aruco(cells: u8, count: u16) -> Codes {
    Codes::Aruco { cells, count }
}

/// OpenCV's own names of the AprilTag families, understood as well.
const OPENCV_NAMES: [(&str, Codes); 4] = [
    ("DICT_APRILTAG_16h5", Codes::Tag16h5),
    ("DICT_APRILTAG_25h9", Codes::Tag25h9),
    ("DICT_APRILTAG_36h10", Codes::Tag36h10),
    ("DICT_APRILTAG_36h11", Codes::Tag36h11),
];

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
        }
    }

    /// The same codes in a border of so many cells; `None` outside [`Family::BORDERS`].
    pub fn with_border(self, border_cells: u32) -> Option<Self> {
        let border_cells = u8::try_from(border_cells)
            .ok()
            .filter(|&cells| Self::BORDERS.contains(&u32::from(cells)))?;
        Some(Self {
            border_cells,
            ..self
        })
    }

    /// The family of a name like `tag36h11` or `DICT_4X4_50`, capitals or not, in a border of one cell.
    pub fn from_name(name: &str) -> Option<Self> {
        NAMES
            .iter()
            .chain(&OPENCV_NAMES)
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|&(_, codes)| Self::of(codes))
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
            .find(|&&(_, codes)| codes == self.codes)
            .map_or("DICT_UNKNOWN", |&(name, _)| name)
    }

    /// The names of all families.
    pub fn all_names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().map(|&(name, _)| name)
    }

    /// Its codes.
    pub fn codes(self) -> Codes {
        self.codes
    }

    /// Width of the black border, cells.
    pub fn border_cells(self) -> u32 {
        u32::from(self.border_cells)
    }

    /// Cells a side of the black square, border and code.
    pub fn cells_across(self) -> u32 {
        self.codes.cells() + 2 * self.border_cells()
    }

    /// Number of markers; their ids run from 0.
    pub fn id_count(self) -> u32 {
        self.codes.id_count()
    }

    /// Wrong bits that the smallest distance between two of its codes allows to correct, at most.
    pub fn correctable_bits(self) -> u32 {
        self.codes.correctable_bits()
    }

    /// Whether it is one of AprilTag's families, which both detectors know.
    pub fn is_april_tag(self) -> bool {
        self.codes.is_april_tag()
    }
}

impl fmt::Display for Family {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())?;
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
            Self::Aruco { count, .. } => u32::from(count),
            Self::ArucoOriginal => 1024,
            Self::Own(dictionary) => dictionary.id_count(),
        }
    }

    /// Cells a side of the code, without the black border.
    pub fn cells(self) -> u32 {
        match self {
            Self::Tag16h5 => 4,
            Self::Tag25h9 | Self::ArucoOriginal => 5,
            Self::Tag36h10 | Self::Tag36h11 => 6,
            Self::Aruco { cells, .. } => u32::from(cells),
            Self::Own(dictionary) => dictionary.cells(),
        }
    }

    fn correctable_bits(self) -> u32 {
        let distance = match self {
            Self::Tag16h5 => 5,
            Self::Tag25h9 => 9,
            Self::Tag36h10 => 10,
            Self::Tag36h11 => 11,
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
        )
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
            Some(Family::TAG36H11)
        );
        for wrong in ["", "tag36h12", "DICT_4X4_51", "DICT_8X8_50", "36h11"] {
            assert_eq!(Family::from_name(wrong), None);
        }
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
