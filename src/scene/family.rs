//! The families of square markers, by the names under which people print them.

/// A family (AprilTag) or dictionary (ArUco) of square markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
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
}

/// Every family with its name.
const NAMES: [(&str, Family); 21] = [
    ("tag16h5", Family::Tag16h5),
    ("tag25h9", Family::Tag25h9),
    ("tag36h10", Family::Tag36h10),
    ("tag36h11", Family::Tag36h11),
    (
        "DICT_4X4_50",
        Family::Aruco {
            cells: 4,
            count: 50,
        },
    ),
    (
        "DICT_4X4_100",
        Family::Aruco {
            cells: 4,
            count: 100,
        },
    ),
    (
        "DICT_4X4_250",
        Family::Aruco {
            cells: 4,
            count: 250,
        },
    ),
    (
        "DICT_4X4_1000",
        Family::Aruco {
            cells: 4,
            count: 1000,
        },
    ),
    (
        "DICT_5X5_50",
        Family::Aruco {
            cells: 5,
            count: 50,
        },
    ),
    (
        "DICT_5X5_100",
        Family::Aruco {
            cells: 5,
            count: 100,
        },
    ),
    (
        "DICT_5X5_250",
        Family::Aruco {
            cells: 5,
            count: 250,
        },
    ),
    (
        "DICT_5X5_1000",
        Family::Aruco {
            cells: 5,
            count: 1000,
        },
    ),
    (
        "DICT_6X6_50",
        Family::Aruco {
            cells: 6,
            count: 50,
        },
    ),
    (
        "DICT_6X6_100",
        Family::Aruco {
            cells: 6,
            count: 100,
        },
    ),
    (
        "DICT_6X6_250",
        Family::Aruco {
            cells: 6,
            count: 250,
        },
    ),
    (
        "DICT_6X6_1000",
        Family::Aruco {
            cells: 6,
            count: 1000,
        },
    ),
    (
        "DICT_7X7_50",
        Family::Aruco {
            cells: 7,
            count: 50,
        },
    ),
    (
        "DICT_7X7_100",
        Family::Aruco {
            cells: 7,
            count: 100,
        },
    ),
    (
        "DICT_7X7_250",
        Family::Aruco {
            cells: 7,
            count: 250,
        },
    ),
    (
        "DICT_7X7_1000",
        Family::Aruco {
            cells: 7,
            count: 1000,
        },
    ),
    ("DICT_ARUCO_ORIGINAL", Family::ArucoOriginal),
];

/// OpenCV's own names of the AprilTag families, understood as well.
const OPENCV_NAMES: [(&str, Family); 4] = [
    ("DICT_APRILTAG_16h5", Family::Tag16h5),
    ("DICT_APRILTAG_25h9", Family::Tag25h9),
    ("DICT_APRILTAG_36h10", Family::Tag36h10),
    ("DICT_APRILTAG_36h11", Family::Tag36h11),
];

impl Family {
    /// The family of a name like `tag36h11` or `DICT_4X4_50`, capitals or not.
    pub fn from_name(name: &str) -> Option<Self> {
        NAMES
            .iter()
            .chain(&OPENCV_NAMES)
            .find(|(known, _)| known.eq_ignore_ascii_case(name))
            .map(|&(_, family)| family)
    }

    /// The name that [`Family::from_name`] knows.
    pub fn name(self) -> &'static str {
        // An `Aruco` of a size that does not exist can be written down in code, never read from a scene.
        NAMES
            .iter()
            .find(|&&(_, family)| family == self)
            .map_or("DICT_UNKNOWN", |&(name, _)| name)
    }

    /// The names of all families.
    pub fn all_names() -> impl Iterator<Item = &'static str> {
        NAMES.iter().map(|&(name, _)| name)
    }

    /// Number of markers; their ids run from 0.
    pub fn id_count(self) -> u32 {
        match self {
            Self::Tag16h5 => 30,
            Self::Tag25h9 => 35,
            Self::Tag36h10 => 2320,
            Self::Tag36h11 => 587,
            Self::Aruco { count, .. } => u32::from(count),
            Self::ArucoOriginal => 1024,
        }
    }

    /// Cells a side of the code, without the black border.
    pub fn cells(self) -> u32 {
        match self {
            Self::Tag16h5 => 4,
            Self::Tag25h9 | Self::ArucoOriginal => 5,
            Self::Tag36h10 | Self::Tag36h11 => 6,
            Self::Aruco { cells, .. } => u32::from(cells),
        }
    }

    /// Wrong bits that the smallest distance between two of its codes allows to correct, at most.
    pub fn correctable_bits(self) -> u32 {
        let distance = match self {
            Self::Tag16h5 => 5,
            Self::Tag25h9 => 9,
            Self::Tag36h10 => 10,
            Self::Tag36h11 => 11,
            Self::ArucoOriginal => 1,
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

    /// Whether it is one of AprilTag's families, which both detectors know.
    pub fn is_april_tag(self) -> bool {
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
        assert_eq!(Family::from_name("TAG36H11"), Some(Family::Tag36h11));
        assert_eq!(
            Family::from_name("DICT_APRILTAG_36h11"),
            Some(Family::Tag36h11)
        );
        for wrong in ["", "tag36h12", "DICT_4X4_51", "DICT_8X8_50", "36h11"] {
            assert_eq!(Family::from_name(wrong), None);
        }
    }
}
