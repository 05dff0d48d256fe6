//! What a marker's print looks like: its cells, and the edges between black and white ones, in its anchor's plane.

use glam::DVec2;

use crate::scene::Marker;

/// Rows of cells that an edge knows: the one that it bounds, and one to either side.
pub(super) const ROWS: usize = 3;
/// Columns of cells that an edge knows: two to either side of it.
pub(super) const COLUMNS: usize = 4;

/// A marker's print, placed in the plane of its anchor.
pub(super) struct Print {
    /// Cells a side of the black square.
    pub side: i32,
    /// White cells of the black square, rows from the top.
    white: Vec<bool>,
    /// Top left corner of the black square, metres.
    corner_m: DVec2,
    /// A step of one cell to the right, metres.
    right_m: DVec2,
    /// A step of one cell down, metres.
    down_m: DVec2,
    pub edges: Vec<Edge>,
}

/// One cell's length of the boundary between a black and a white cell.
pub(super) struct Edge {
    /// Its middle in the anchor's plane, metres.
    pub point_m: DVec2,
    /// A step of one cell across it, metres.
    pub across_m: DVec2,
    /// A step of one cell along it, metres.
    pub along_m: DVec2,
    /// Whether a step across goes from black to white.
    pub brightens: bool,
    /// Whiteness (0 or 1) of the cells around, row by row along the edge, columns across it.
    pub around: [[f32; COLUMNS]; ROWS],
}

impl Print {
    /// `white` are the cells of the black square, rows from the top, its border included; their number is a square.
    pub fn new(marker: &Marker, white: Vec<bool>) -> Self {
        let side = white.len().isqrt();
        let turn = DVec2::from_angle(marker.rotation_rad);
        let half_m = marker.size_m / 2.0;
        let cell_m = marker.size_m / side as f64;
        let mut print = Self {
            side: side as i32,
            white,
            corner_m: marker.center_m + turn.rotate(DVec2::new(-half_m, half_m)),
            right_m: turn.rotate(DVec2::new(cell_m, 0.0)),
            down_m: turn.rotate(DVec2::new(0.0, -cell_m)),
            edges: Vec::new(),
        };
        for line in 0..=print.side {
            for row in 0..print.side {
                print.edges.extend(print.edge(line, row, false));
                print.edges.extend(print.edge(line, row, true));
            }
        }
        print
    }

    /// Whether a cell is white; all around the black square is.
    pub fn is_white(&self, column: i32, row: i32) -> bool {
        let inside = (0..self.side).contains(&column) && (0..self.side).contains(&row);
        !inside || self.white[(row * self.side + column) as usize]
    }

    /// A place in cells from the black square's top left corner, in the anchor's plane, metres.
    pub fn point_m(&self, column: f64, row: f64) -> DVec2 {
        self.corner_m + self.right_m * column + self.down_m * row
    }

    /// The middle of the black square, metres.
    pub fn center_m(&self) -> DVec2 {
        let middle = 0.5 * f64::from(self.side);
        self.point_m(middle, middle)
    }

    /// Corners of the black square: top left, top right, bottom right, bottom left; metres.
    pub fn corners_m(&self) -> [DVec2; 4] {
        let side = f64::from(self.side);
        [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
            .map(|(column, row)| self.point_m(column, row))
    }

    /// The edge left of the cell (line, row), or, `level`, above the cell (row, line); `None` between like cells.
    fn edge(&self, line: i32, row: i32, level: bool) -> Option<Edge> {
        let white = |across: i32, along: i32| match level {
            false => self.is_white(across, along),
            true => self.is_white(along, across),
        };
        let brightens = white(line, row);
        if white(line - 1, row) == brightens {
            return None;
        }
        let (across, along) = (f64::from(line), f64::from(row) + 0.5);
        Some(Edge {
            point_m: match level {
                false => self.point_m(across, along),
                true => self.point_m(along, across),
            },
            across_m: if level { self.down_m } else { self.right_m },
            along_m: if level { self.right_m } else { self.down_m },
            brightens,
            around: std::array::from_fn(|r| {
                std::array::from_fn(|c| {
                    let is_white = white(line - 2 + c as i32, row - 1 + r as i32);
                    f32::from(u8::from(is_white))
                })
            }),
        })
    }
}
