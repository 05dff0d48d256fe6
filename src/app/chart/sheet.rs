//! Sheets of pictures: parts of frames, enlarged, in rows with a label above each.

use anyhow::Result;
use plotters::prelude::DrawingBackend;

use super::canvas::{ChartCanvas, Drawing, INK, PIXELS_PER_UNIT, TextAnchor, bitmap};
use crate::app::truth::LinearPicture;

/// Each pixel is drawn as a square of so many, as a rule.
pub const ENLARGED: usize = 2;
/// Around what the virtual things change, pixels.
const MARGIN_PX: usize = 16;
/// Changes of fewer levels are none.
const CHANGED_LEVELS: f64 = 2.0;

const GAP: f64 = 12.0;
const HEAD: f64 = 66.0;
const LABEL: f64 = 26.0;

/// A part of a picture, rows from the top.
pub struct Cell {
    /// Written above it.
    pub label: String,
    size_px: [usize; 2],
    rgb: Vec<[u8; 3]>,
}

/// Rows of cells.
pub struct Sheet {
    /// At its top.
    pub title: &'static str,
    /// How to read it.
    pub reading: &'static str,
    /// Each pixel is drawn as a square of so many.
    pub enlarged: usize,
    /// From the top.
    pub rows: Vec<Vec<Cell>>,
}

/// A rectangle of pixels: from, to (exclusive).
pub struct SheetPart {
    from: [usize; 2],
    to: [usize; 2],
}

/// What a change touches, with some room.
pub fn changed_part(change: &LinearPicture) -> Option<SheetPart> {
    let (width, height) = (change.width, change.pixels.len() / change.width);
    let changed = change
        .pixels
        .iter()
        .enumerate()
        .filter(|(_, pixel)| pixel.iter().any(|level| level.abs() > CHANGED_LEVELS));
    let places = changed.map(|(index, _)| [index % width, index / width]);
    let around = places.fold(None, |part: Option<SheetPart>, place| {
        let mut part = part.unwrap_or(SheetPart {
            from: place,
            to: place,
        });
        part.from = [0, 1].map(|axis| part.from[axis].min(place[axis]));
        part.to = [0, 1].map(|axis| part.to[axis].max(place[axis]));
        Some(part)
    })?;
    Some(SheetPart {
        from: around.from.map(|low| low.saturating_sub(MARGIN_PX)),
        to: [
            (around.to[0] + MARGIN_PX).min(width),
            (around.to[1] + MARGIN_PX).min(height),
        ],
    })
}

impl SheetPart {
    /// What all of two parts lie in.
    pub fn union(self, other: &Self) -> Self {
        Self {
            from: [0, 1].map(|axis| self.from[axis].min(other.from[axis])),
            to: [0, 1].map(|axis| self.to[axis].max(other.to[axis])),
        }
    }

    /// That part of a picture, its levels changed.
    pub fn cut(&self, label: String, picture: &LinearPicture, level: impl Fn(f64) -> f64) -> Cell {
        let byte = |value: f64| level(value).round().clamp(0.0, 255.0) as u8;
        let rows = self.from[1]..self.to[1];
        let pixels = rows.flat_map(|y| (self.from[0]..self.to[0]).map(move |x| (x, y)));
        Cell {
            label,
            size_px: [self.to[0] - self.from[0], self.to[1] - self.from[1]],
            rgb: pixels
                .map(|(x, y)| picture.pixels[y * picture.width + x].map(byte))
                .collect(),
        }
    }
}

impl Cell {
    /// Width and height on the sheet, in its units.
    fn size(&self, enlarged: usize) -> [f64; 2] {
        self.size_px
            .map(|px| (px * enlarged) as f64 / PIXELS_PER_UNIT)
    }
}

impl Sheet {
    /// Each cell with the upper left corner of its picture.
    fn placed(&self) -> Vec<([f64; 2], &Cell)> {
        let mut placed = Vec::new();
        let mut y = HEAD;
        for row in &self.rows {
            let labelled = row.iter().any(|cell| !cell.label.is_empty());
            y += if labelled { LABEL } else { 0.0 };
            let mut x = GAP;
            for cell in row {
                placed.push(([x, y], cell));
                x += cell.size(self.enlarged)[0] + GAP;
            }
            y += row
                .iter()
                .map(|cell| cell.size(self.enlarged)[1])
                .fold(0.0, f64::max)
                + GAP;
        }
        placed
    }

    /// Width and height, and the pixels (RGBA).
    ///
    /// # Errors
    /// A picture that cannot be drawn.
    pub fn paint(&self) -> Result<([u32; 2], Vec<u8>)> {
        let (size_px, mut rgba) = bitmap(self)?;
        for (corner, cell) in self.placed() {
            let [left, top] = corner.map(|at| (at * PIXELS_PER_UNIT).round() as usize);
            let [width, height] = cell.size_px.map(|px| px * self.enlarged);
            for (row, column) in (0..height).flat_map(|row| (0..width).map(move |c| (row, c))) {
                let pixel =
                    cell.rgb[row / self.enlarged * cell.size_px[0] + column / self.enlarged];
                let at = 4 * ((top + row) * size_px[0] as usize + left + column);
                rgba[at..at + 3].copy_from_slice(&pixel);
            }
        }
        Ok((size_px, rgba))
    }
}

impl Drawing for Sheet {
    fn size(&self) -> [f64; 2] {
        let ends = self.placed().into_iter().map(|([x, y], cell)| {
            let [width, height] = cell.size(self.enlarged);
            [x + width, y + height]
        });
        let far = ends.fold([0.0_f64; 2], |far, end| {
            [far[0].max(end[0]), far[1].max(end[1])]
        });
        far.map(|end| (end + GAP).ceil())
    }

    fn draw<B: DrawingBackend>(&self, canvas: &ChartCanvas<'_, B>) -> Result<()> {
        canvas.text(self.title, [GAP, 24.0], 22.0, INK, TextAnchor::Start)?;
        canvas.text(self.reading, [GAP, 50.0], 15.5, INK, TextAnchor::Start)?;
        for ([x, y], cell) in self.placed() {
            let above = [x, y - LABEL / 2.0];
            canvas.text(&cell.label, above, 15.5, INK, TextAnchor::Start)?;
        }
        Ok(())
    }
}
