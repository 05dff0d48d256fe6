//! A marker as printed: its cells, and those around it that its family lays down.

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

    /// The same as a family has it drawn and inked; a family with a ring lays nothing down beyond its cells.
    pub(super) fn drawn_for(mut self, family: Family) -> Self {
        if family.has_ring() {
            self.around = Cell::Open;
        }
        if family.drawing() == Drawing::OpenCv {
            self.cells.reverse();
        }
        if family.ink() == Ink::WhiteOnBlack {
            self.around = self.around.inverted();
            self.cells = self.cells.into_iter().map(Cell::inverted).collect();
        }
        self
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
