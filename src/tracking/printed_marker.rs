//! A marker as printed: its cells, and those around it that its family lays down.

use super::TrackingError;
use super::apriltag;
use super::aruco::installed_marker;
use crate::scene::{Drawing, Family, Ink};

/// A cell of a print.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cell {
    /// Inked.
    Black,
    /// Bare paper.
    White,
    /// What a family leaves to whoever prints it.
    Open,
}

impl Cell {
    /// The cell of a negative.
    fn inverted(self) -> Self {
        match self {
            Self::Black => Self::White,
            Self::White => Self::Black,
            Self::Open => Self::Open,
        }
    }
}

/// A marker's cells as printed, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PrintedMarker {
    side: i32,
    rim: i32,
    cells: Vec<Cell>,
    /// What lies beyond them.
    around: Cell,
}

impl PrintedMarker {
    /// `cells` are those of a square, as many to each side around the one of `side` cells whose corners are found.
    pub(super) fn new(side: u32, cells: Vec<Cell>) -> Self {
        let side = side as i32;
        Self {
            side,
            rim: (cells.len().isqrt() as i32 - side) / 2,
            cells,
            around: Cell::White,
        }
    }

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
        let mut printed = match family.is_april_tag() {
            true => apriltag::printed_marker(family, id).ok_or_else(no_such_marker)?,
            false => installed_marker(family, id)?.ok_or_else(no_such_marker)?,
        };
        if family.has_ring() {
            printed.around = Cell::Open;
        }
        if family.drawing() == Drawing::OpenCv {
            printed.cells.reverse();
        }
        if family.ink() == Ink::WhiteOnBlack {
            printed.around = printed.around.inverted();
            printed.cells = printed.cells.into_iter().map(Cell::inverted).collect();
        }
        Ok(printed)
    }

    /// Cells a side of the square whose corners are found: the border's, or the ring's.
    pub fn side(&self) -> i32 {
        self.side
    }

    /// Cells that are laid down beyond that square to each side.
    pub fn rim(&self) -> i32 {
        self.rim
    }

    /// A cell, counted from the top left one of that square.
    pub fn cell(&self, column: i32, row: i32) -> Cell {
        let across = self.side + 2 * self.rim;
        let (column, row) = (column + self.rim, row + self.rim);
        match (0..across).contains(&column) && (0..across).contains(&row) {
            true => self.cells[(row * across + column) as usize],
            false => self.around,
        }
    }

    /// The cells of that square, rows from the top, true for white.
    pub fn square(&self) -> Vec<bool> {
        let rows = 0..self.side;
        rows.flat_map(|row| (0..self.side).map(move |column| (column, row)))
            .map(|(column, row)| self.cell(column, row) == Cell::White)
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
