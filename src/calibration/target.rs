//! The patterns that a camera is calibrated by.

use std::fmt;

use glam::DVec2;

use crate::scene::Family;

/// A flat pattern of known size. Its frame: origin at the top left corner of the pattern, x right, y down, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Squares across and down.
    pub squares: [u32; 2],
    /// Side of a square, metres.
    pub square_m: f64,
    /// Markers in the white squares (ChArUco), or none (chessboard).
    pub markers: Option<TargetMarkers>,
}

/// Markers in the white squares of a ChArUco board, ids from 0 in rows from the top left.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetMarkers {
    /// Their family or dictionary.
    pub family: Family,
    /// Side of their black squares, metres.
    pub size_m: f64,
}

/// Why a target is none.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum TargetError {
    /// Squares too small or too large.
    #[error("squares of {square_mm} mm; allowed: {} to {} mm", SQUARE_MM[0], SQUARE_MM[1])]
    SquareSize {
        /// Their side.
        square_mm: f64,
    },
    /// Too few or too many of them.
    #[error("{kind} of {} x {} {counted}; allowed: at least {fewest} x {fewest}, at most {most} x {most}", counts[0], counts[1])]
    Counts {
        /// What it would be.
        kind: &'static str,
        /// What is counted on it.
        counted: &'static str,
        /// Columns and rows.
        counts: [u32; 2],
        /// Fewest each way.
        fewest: u32,
        /// Most each way.
        most: u32,
    },
    /// Markers that leave too little white around them, or are hardly seen.
    #[error(
        "markers of {marker_mm} mm in squares of {square_mm} mm; allowed: {:.1} to {:.1} mm",
        MARKER_SHARE[0] * square_mm,
        MARKER_SHARE[1] * square_mm
    )]
    MarkerSize {
        /// Side of the markers.
        marker_mm: f64,
        /// Side of the squares.
        square_mm: f64,
    },
    /// More markers than there are.
    #[error("the board needs {needed} markers, {family} has {}", family.id_count())]
    TooFewMarkers {
        /// How many it needs.
        needed: usize,
        /// The markers' family.
        family: Family,
    },
}

/// Inner corners of a chessboard each way; fewer cannot be told from their turns.
const CORNERS: [u32; 2] = [3, 100];
/// Squares of a ChArUco board each way.
const SQUARES: [u32; 2] = [3, 100];
/// Millimetres that the side of a square can have.
const SQUARE_MM: [f64; 2] = [1.0, 2000.0];
/// A marker needs white around it, and cells that can be seen.
const MARKER_SHARE: [f64; 2] = [0.3, 0.9];

impl Target {
    /// A chessboard of so many inner corners across and down.
    ///
    /// # Errors
    /// Sizes or counts that no chessboard has.
    pub fn chessboard(corners: [u32; 2], square_m: f64) -> Result<Self, TargetError> {
        check_counts("a chessboard", "inner corners", corners, CORNERS)?;
        check_square(square_m)?;
        Ok(Self {
            squares: corners.map(|count| count + 1),
            square_m,
            markers: None,
        })
    }

    /// A ChArUco board of so many squares across and down.
    ///
    /// # Errors
    /// Sizes or counts that no board has, or a family with too few markers.
    pub fn charuco(
        squares: [u32; 2],
        square_m: f64,
        markers: TargetMarkers,
    ) -> Result<Self, TargetError> {
        check_counts("a ChArUco board", "squares", squares, SQUARES)?;
        check_square(square_m)?;
        let share = markers.size_m / square_m;
        if !(MARKER_SHARE[0]..=MARKER_SHARE[1]).contains(&share) {
            return Err(TargetError::MarkerSize {
                marker_mm: millimetres(markers.size_m),
                square_mm: millimetres(square_m),
            });
        }
        let target = Self {
            squares,
            square_m,
            markers: Some(markers),
        };
        let needed = target.marker_squares(false).count();
        if needed > markers.family.id_count() as usize {
            return Err(TargetError::TooFewMarkers {
                needed,
                family: markers.family,
            });
        }
        Ok(target)
    }

    /// A board with its columns for rows.
    #[must_use]
    pub fn swapped(&self) -> Self {
        let [across, down] = self.squares;
        Self {
            squares: [down, across],
            ..*self
        }
    }

    /// Inner corners across and down.
    pub fn corners(&self) -> [u32; 2] {
        self.squares.map(|squares| squares - 1)
    }

    /// All inner corners in rows from the top left, metres.
    pub fn corners_m(&self) -> Vec<DVec2> {
        let [across, down] = self.corners();
        let corner = |k: u32| DVec2::new(f64::from(k % across + 1), f64::from(k / across + 1));
        (0..across * down)
            .map(|k| corner(k) * self.square_m)
            .collect()
    }

    /// Whether a square is black on a board that begins with a black one at the top left.
    pub fn is_black([column, row]: [u32; 2]) -> bool {
        (column + row).is_multiple_of(2)
    }

    /// The white squares, which hold a ChArUco board's markers, by column and row in the order of the ids. Boards begin
    /// with a black square at the top left, or `starts_white`.
    pub fn marker_squares(&self, starts_white: bool) -> impl Iterator<Item = [u32; 2]> + use<> {
        let [across, down] = self.squares;
        (0..across * down)
            .map(move |k| [k % across, k / across])
            .filter(move |&square| Self::is_black(square) == starts_white)
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let square_mm = millimetres(self.square_m);
        match &self.markers {
            None => {
                let [across, down] = self.corners();
                write!(
                    f,
                    "chessboard, {across} x {down} inner corners, squares of {square_mm} mm"
                )
            }
            Some(markers) => {
                let [across, down] = self.squares;
                write!(
                    f,
                    "ChArUco board, {across} x {down} squares of {square_mm} mm, {} markers of {} mm",
                    markers.family,
                    millimetres(markers.size_m)
                )
            }
        }
    }
}

fn check_counts(
    kind: &'static str,
    counted: &'static str,
    counts: [u32; 2],
    [fewest, most]: [u32; 2],
) -> Result<(), TargetError> {
    if counts.iter().all(|count| (fewest..=most).contains(count)) {
        return Ok(());
    }
    Err(TargetError::Counts {
        kind,
        counted,
        counts,
        fewest,
        most,
    })
}

fn check_square(square_m: f64) -> Result<(), TargetError> {
    let square_mm = millimetres(square_m);
    if (SQUARE_MM[0]..=SQUARE_MM[1]).contains(&square_mm) {
        return Ok(());
    }
    Err(TargetError::SquareSize { square_mm })
}

/// To a micrometre.
fn millimetres(length_m: f64) -> f64 {
    (length_m * 1e6).round() / 1e3
}

#[cfg(test)]
mod tests {
    use super::*;

    fn markers(name: &str, size_m: f64) -> TargetMarkers {
        TargetMarkers {
            family: Family::from_name(name).unwrap(),
            size_m,
        }
    }

    #[test]
    fn corners_are_counted_from_the_top_left_square() {
        let target = Target::chessboard([7, 5], 0.03).unwrap();
        assert_eq!((target.squares, target.corners()), ([8, 6], [7, 5]));
        let corners_m = target.corners_m();
        assert_eq!(corners_m.len(), 35);
        assert_eq!(corners_m[0], DVec2::new(0.03, 0.03));
        assert!((corners_m[34] - DVec2::new(0.21, 0.15)).length() < 1e-12);
    }

    #[test]
    fn markers_lie_in_the_white_squares() {
        let target = Target::charuco([3, 4], 0.03, markers("DICT_4X4_50", 0.02)).unwrap();
        let today: Vec<_> = target.marker_squares(false).collect();
        assert_eq!(today, [[1, 0], [0, 1], [2, 1], [1, 2], [0, 3], [2, 3]]);
        let before_4_6: Vec<_> = target.marker_squares(true).collect();
        assert_eq!(before_4_6, [[0, 0], [2, 0], [1, 1], [0, 2], [2, 2], [1, 3]]);
    }

    #[test]
    fn mistakes_tell_what_is_allowed() {
        let five = || markers("DICT_5X5_100", 0.029);
        for (target, part) in [
            (Target::chessboard([2, 5], 0.03), "at least 3 x 3"),
            (Target::chessboard([u32::MAX, 5], 0.03), "at most 100 x 100"),
            (Target::chessboard([7, 5], 0.0), "1 to 2000 mm"),
            (Target::chessboard([7, 5], f64::NAN), "1 to 2000 mm"),
            (Target::charuco([5, 7], 0.03, five()), "9.0 to 27.0 mm"),
            (Target::charuco([2, 7], 0.04, five()), "at least 3 x 3"),
            (
                Target::charuco([20, 20], 0.03, markers("DICT_4X4_50", 0.02)),
                "200 markers, DICT_4X4_50 has 50",
            ),
        ] {
            let message = target.unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
