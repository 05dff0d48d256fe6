//! Which parts of the picture the views' corners cover.

use glam::DVec2;

/// A grid over the picture with the number of views that have a corner in each cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Coverage {
    /// Columns of cells.
    pub columns: usize,
    /// Rows of cells.
    pub rows: usize,
    /// Views by cell, rows from the top.
    pub views: Vec<u32>,
    size_px: [u32; 2],
}

/// Cells along the picture's longer side.
const ALONG: f64 = 8.0;

/// The nine parts of a picture, rows from the top.
const PARTS: [&str; 9] = [
    "top left",
    "top",
    "top right",
    "left",
    "middle",
    "right",
    "bottom left",
    "bottom",
    "bottom right",
];

impl Coverage {
    pub(super) fn new(size_px: [u32; 2]) -> Self {
        let [width, height] = size_px.map(f64::from);
        let cell_px = width.max(height) / ALONG;
        let cells = |side: f64| (side / cell_px).round().max(3.0) as usize;
        let (columns, rows) = (cells(width), cells(height));
        Self {
            columns,
            rows,
            views: vec![0; columns * rows],
            size_px,
        }
    }

    /// Adds the corners of a view.
    pub(super) fn add(&mut self, corners_px: impl Iterator<Item = DVec2>) {
        for cell in self.cells_of(corners_px) {
            self.views[cell] += 1;
        }
    }

    /// How many cells a view would be the first in.
    pub(super) fn fresh(&self, corners_px: impl Iterator<Item = DVec2>) -> usize {
        let cells = self.cells_of(corners_px);
        cells
            .into_iter()
            .filter(|&cell| self.views[cell] == 0)
            .count()
    }

    /// The part of all cells that have a corner.
    pub fn share(&self) -> f64 {
        let covered = self.views.iter().filter(|&&views| views > 0).count();
        covered as f64 / self.views.len() as f64
    }

    /// The parts of the picture (corners, sides, middle) most cells of which have no corner yet.
    pub fn missing_parts(&self) -> Vec<&'static str> {
        let mut empty = [0_usize; 9];
        let mut all = [0_usize; 9];
        for (cell, &views) in self.views.iter().enumerate() {
            let third = |place: usize, count: usize| (3 * (2 * place + 1)) / (2 * count);
            let part = third(cell / self.columns, self.rows) * 3
                + third(cell % self.columns, self.columns);
            all[part] += 1;
            empty[part] += usize::from(views == 0);
        }
        (0..PARTS.len())
            .filter(|&part| 2 * empty[part] > all[part])
            .map(|part| PARTS[part])
            .collect()
    }

    /// The cells that some pixels lie in, each once.
    fn cells_of(&self, corners_px: impl Iterator<Item = DVec2>) -> Vec<usize> {
        let [width, height] = self.size_px.map(f64::from);
        let mut cells: Vec<usize> = corners_px
            .filter_map(|pixel| {
                // The picture begins half a pixel before the first one's centre.
                let column = ((pixel.x + 0.5) / width * self.columns as f64).floor();
                let row = ((pixel.y + 0.5) / height * self.rows as f64).floor();
                let inside = (0.0..self.columns as f64).contains(&column)
                    && (0.0..self.rows as f64).contains(&row);
                inside.then_some(row as usize * self.columns + column as usize)
            })
            .collect();
        cells.sort_unstable();
        cells.dedup();
        cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_missing_until_a_view_reaches_them() {
        let mut coverage = Coverage::new([640, 480]);
        assert_eq!((coverage.columns, coverage.rows), (8, 6));
        assert_eq!(coverage.missing_parts(), PARTS);
        // A corner in the middle of each cell but those at the right.
        let corners =
            (0..36).map(|k| DVec2::new(f64::from(k % 6) + 0.5, f64::from(k / 6) + 0.5) * 80.0);
        assert_eq!(coverage.fresh(corners.clone()), 36);
        coverage.add(corners.clone().chain(corners.clone()));
        assert_eq!(coverage.fresh(corners), 0);
        assert_eq!(coverage.views.iter().sum::<u32>(), 36);
        assert!((coverage.share() - 0.75).abs() < 1e-12);
        assert_eq!(
            coverage.missing_parts(),
            ["top right", "right", "bottom right"]
        );
        coverage.add([DVec2::new(639.4, 479.4), DVec2::new(639.6, 0.0)].into_iter());
        assert_eq!(coverage.views.iter().sum::<u32>(), 37);
    }
}
