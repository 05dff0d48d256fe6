//! What a printed marker looks like: its cells, and the edges between black and white ones, in its anchor's space.

use std::cell::OnceCell;

use glam::{DAffine3, DVec3};

use super::cover::Cover;
use super::expected_picture::ExpectedPicture;
use super::printed_marker::{Cell, PrintedMarker};
use crate::scene::Marker;

/// Rows of cells that an edge knows: the one that it bounds, and one to either side.
pub(super) const ROWS: usize = 3;
/// Columns of cells that an edge knows: two to either side of it.
pub(super) const COLUMNS: usize = 4;

/// A marker as printed, placed in the space of its anchor.
pub(super) struct MarkerTemplate {
    /// Cells a side of the square whose corners are found.
    pub side: i32,
    /// The cells.
    pub printed: PrintedMarker,
    /// What a blurred picture of them is, once one was read.
    pub expected: OnceCell<ExpectedPicture>,
    /// Top left corner of that square, metres.
    corner_m: DVec3,
    /// A step of one cell to the right, metres.
    right_m: DVec3,
    /// A step of one cell down, metres.
    down_m: DVec3,
    /// A unit vector out of its printed side.
    pub normal: DVec3,
    /// Markers of its anchor that may lie between it and a camera that it faces.
    pub covers: Vec<Cover>,
    pub edges: Vec<TemplateEdge>,
}

/// One cell's length of the boundary between a black and a white cell.
pub(super) struct TemplateEdge {
    /// The edge's middle in the anchor's space, metres.
    pub point_m: DVec3,
    /// A step of one cell across it, metres.
    pub across_m: DVec3,
    /// A step of one cell along it, metres.
    pub along_m: DVec3,
    /// Whether a step across goes from black to white.
    pub brightens: bool,
    /// Whiteness (0 or 1) of the cells around, row by row along the edge, columns across it.
    pub around: [[f32; COLUMNS]; ROWS],
}

impl MarkerTemplate {
    /// A marker's template in its anchor's space.
    pub fn new(marker: &Marker, printed: PrintedMarker) -> Self {
        let side = printed.side();
        let DAffine3 {
            matrix3: turn,
            translation: center_m,
        } = marker.anchor_from_marker;
        let half_m = marker.size_m / 2.0;
        let cell_m = marker.size_m / f64::from(side);
        let mut template = Self {
            side,
            printed,
            expected: OnceCell::new(),
            corner_m: center_m + turn * DVec3::new(-half_m, half_m, 0.0),
            right_m: turn * DVec3::new(cell_m, 0.0, 0.0),
            down_m: turn * DVec3::new(0.0, -cell_m, 0.0),
            normal: turn.z_axis,
            covers: Vec::new(),
            edges: Vec::new(),
        };
        let rim = template.printed.rim();
        for line in -rim..=side + rim {
            for row in -rim..side + rim {
                template.edges.extend(template.edge(line, row, false));
                template.edges.extend(template.edge(line, row, true));
            }
        }
        template
    }

    /// Whether a cell is white; `None` where the print says nothing.
    pub fn is_white(&self, column: i32, row: i32) -> Option<bool> {
        match self.printed.cell(column, row) {
            Cell::White => Some(true),
            Cell::Black => Some(false),
            Cell::Open => None,
        }
    }

    /// A place in cells from the square's top left corner, in the anchor's space, metres.
    pub fn point_m(&self, column: f64, row: f64) -> DVec3 {
        self.corner_m + self.right_m * column + self.down_m * row
    }

    /// The middle of the square, metres.
    pub fn center_m(&self) -> DVec3 {
        let middle = 0.5 * f64::from(self.side);
        self.point_m(middle, middle)
    }

    /// Corners of the square: top left, top right, bottom right, bottom left; metres.
    pub fn corners_m(&self) -> [DVec3; 4] {
        let side = f64::from(self.side);
        [(0.0, 0.0), (side, 0.0), (side, side), (0.0, side)]
            .map(|(column, row)| self.point_m(column, row))
    }

    /// The cosine of the angle between the way out of its printed side and the way to the camera; negative where that sees
    /// its back.
    pub fn facing(&self, camera_from_anchor: &DAffine3) -> f64 {
        let center_m = camera_from_anchor.transform_point3(self.center_m());
        let toward_viewer = camera_from_anchor.matrix3 * self.normal;
        -toward_viewer.dot(center_m) / center_m.length()
    }

    /// The edge left of the cell (line, row), or, `level`, above the cell (row, line); `None` between like cells.
    fn edge(&self, line: i32, row: i32, level: bool) -> Option<TemplateEdge> {
        let white = |across: i32, along: i32| match level {
            false => self.is_white(across, along),
            true => self.is_white(along, across),
        };
        let brightens = white(line, row)?;
        if white(line - 1, row)? == brightens {
            return None;
        }
        // What the print leaves open is taken to go on as what is beside it.
        let middle = [!brightens, brightens];
        let around = |r: usize, c: usize| {
            let at = |c: usize| white(line - 2 + c as i32, row - 1 + r as i32);
            let near = if c < 2 { 1 } else { 2 };
            at(c).or(at(near)).unwrap_or(middle[near - 1])
        };
        let (across, along) = (f64::from(line), f64::from(row) + 0.5);
        Some(TemplateEdge {
            point_m: match level {
                false => self.point_m(across, along),
                true => self.point_m(along, across),
            },
            across_m: if level { self.down_m } else { self.right_m },
            along_m: if level { self.right_m } else { self.down_m },
            brightens,
            around: std::array::from_fn(|r| {
                std::array::from_fn(|c| f32::from(u8::from(around(r, c))))
            }),
        })
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec2;

    use super::*;
    use crate::scene::Family;

    /// Three by three cells, the middle one white.
    fn ring(rotation_rad: f64) -> MarkerTemplate {
        let marker = Marker::alone(Family::TAG16H5, 0, 0.3);
        let marker = marker.in_plane(DVec2::new(1.0, 2.0), rotation_rad);
        let cell = |k| if k == 4 { Cell::White } else { Cell::Black };
        MarkerTemplate::new(&marker, PrintedMarker::new(3, (0..9).map(cell).collect()))
    }

    #[test]
    fn every_boundary_between_unlike_cells_is_an_edge_once() {
        let template = ring(0.0);
        // Twelve around the square, four around the white cell.
        assert_eq!(template.edges.len(), 16);
        for edge in &template.edges {
            let step = 0.25 * edge.across_m;
            let white = |point_m: DVec3| {
                let from_corner_m = (point_m - template.corner_m).truncate();
                let cell = (from_corner_m * DVec2::new(10.0, -10.0)).floor();
                template.is_white(cell.x as i32, cell.y as i32).unwrap()
            };
            assert_eq!(white(edge.point_m + step), edge.brightens);
            assert_eq!(white(edge.point_m - step), !edge.brightens);
            let [_, [_, before, after, _], _] = edge.around;
            assert_eq!(
                (before > 0.5, after > 0.5),
                (!edge.brightens, edge.brightens)
            );
        }
    }

    #[test]
    fn corners_turn_with_the_print() {
        let [top_left, _, bottom_right, _] = ring(0.0).corners_m();
        assert!(top_left.distance(DVec3::new(0.85, 2.15, 0.0)) < 1e-12);
        assert!(bottom_right.distance(DVec3::new(1.15, 1.85, 0.0)) < 1e-12);
        let [turned, ..] = ring(std::f64::consts::FRAC_PI_2).corners_m();
        assert!(
            turned.distance(DVec3::new(0.85, 1.85, 0.0)) < 1e-12,
            "{turned}"
        );
        assert!(ring(0.3).center_m().distance(DVec3::new(1.0, 2.0, 0.0)) < 1e-12);
    }
}
