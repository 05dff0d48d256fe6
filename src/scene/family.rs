//! The families of square markers that the trackers know, by name.

use std::sync::LazyLock;

/// A family (AprilTag) or dictionary (ArUco) of square markers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Family {
    Tag16h5,
    Tag25h9,
    Tag36h10,
    Tag36h11,
    /// OpenCV's `DICT_NxN_M`: N cells a side, M markers (50, 100, 250 or 1000).
    Aruco {
        cells: u8,
        count: u16,
    },
    ArucoOriginal,
}

static NAMED: LazyLock<Vec<(String, Family)>> = LazyLock::new(|| {
    let tags = [
        ("tag16h5", Family::Tag16h5),
        ("tag25h9", Family::Tag25h9),
        ("tag36h10", Family::Tag36h10),
        ("tag36h11", Family::Tag36h11),
    ];
    let aruco = (4..=7_u8).flat_map(|cells| {
        [50, 100, 250, 1000].map(|count| {
            (
                format!("DICT_{cells}X{cells}_{count}"),
                Family::Aruco { cells, count },
            )
        })
    });
    let original = ("DICT_ARUCO_ORIGINAL".to_owned(), Family::ArucoOriginal);
    tags.map(|(name, family)| (name.to_owned(), family))
        .into_iter()
        .chain(aruco)
        .chain([original])
        .collect()
});

impl Family {
    /// The family of this name; AprilTag's names are its library's, ArUco's are OpenCV's.
    pub fn from_name(name: &str) -> Option<Self> {
        NAMED
            .iter()
            .find(|(known, _)| known == name)
            .map(|(_, family)| *family)
    }

    /// The name that [`Family::from_name`] takes.
    pub fn name(self) -> &'static str {
        NAMED
            .iter()
            .find(|(_, known)| *known == self)
            .map_or("unknown", |(name, _)| name)
    }

    /// All names, AprilTag's first.
    pub fn all_names() -> Vec<&'static str> {
        NAMED.iter().map(|(name, _)| name.as_str()).collect()
    }

    /// How many markers the family has; ids run from 0.
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_go_there_and_back() {
        assert_eq!(Family::all_names().len(), 21);
        for name in Family::all_names() {
            assert_eq!(Family::from_name(name).map(Family::name), Some(name));
        }
        assert_eq!(Family::from_name("tag36h12"), None);
        assert_eq!(
            Family::from_name("DICT_5X5_250").map(Family::id_count),
            Some(250)
        );
    }
}
