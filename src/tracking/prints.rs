//! The markers of all families as they are printed, from the libraries that know their codes.

use super::TrackingError;
use super::apriltag;
use super::aruco_dictionary::installed_marker;
use super::printed_marker::PrintedMarker;
use crate::scene::Family;

impl PrintedMarker {
    /// A marker of a family.
    ///
    /// # Errors
    /// A marker that the family does not have.
    pub fn of(family: Family, id: u32) -> Result<Self, TrackingError> {
        let no_such_marker = || TrackingError::NoSuchMarker {
            family: family.name(),
            id,
            count: family.id_count(),
        };
        let drawn = match family.is_april_tag() {
            true => apriltag::printed_marker(family, id),
            false => installed_marker(family, id)?,
        };
        Ok(drawn.ok_or_else(no_such_marker)?.drawn_for(family))
    }
}

/// The cells of a marker as printed, rows from the top, true for white, of the square whose corners are found.
///
/// # Errors
/// A marker that the family does not have.
pub fn printed_cells(family: Family, id: u32) -> Result<Vec<bool>, TrackingError> {
    Ok(PrintedMarker::of(family, id)?.square())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Drawing, Ink};
    use crate::tracking::Cell;

    fn rows(name: &str, id: u32) -> Vec<String> {
        let family = Family::from_name(name).unwrap();
        let printed = PrintedMarker::of(family, id).unwrap();
        let reach = -printed.rim()..printed.side() + printed.rim();
        reach
            .clone()
            .map(|row| {
                let cells = reach.clone().map(|column| match printed.cell(column, row) {
                    Cell::Black => '.',
                    Cell::White => '#',
                    Cell::Open => '?',
                });
                cells.collect()
            })
            .collect()
    }

    #[test]
    fn a_round_tag_leaves_its_corners_open() {
        let found = rows("tagCircle21h7", 0);
        assert_eq!(found.len(), 9);
        assert!(found[0].starts_with("???") && found[0].ends_with("???"));
        assert_eq!(found[1], "?.......?");
        assert_eq!(found[2], "?.#####.?");
    }

    #[test]
    fn opencv_s_drawing_stands_on_its_head_and_an_inverted_one_is_its_negative() {
        let family = Family::TAG36H11;
        let own = PrintedMarker::of(family, 5).unwrap().square();
        let turned = PrintedMarker::of(family.drawn_as(Drawing::OpenCv), 5).unwrap();
        assert!(turned.square().iter().eq(own.iter().rev()));
        let inverted = PrintedMarker::of(family.with_ink(Ink::WhiteOnBlack), 5).unwrap();
        assert!(inverted.square().iter().zip(&own).all(|(a, b)| a != b));
        assert_eq!(inverted.cell(-3, 0), Cell::Black);
    }
}
