//! A sheet of small pictures that tells a whole replay at a glance.

use std::path::Path;

use image::RgbaImage;

use crate::app::files::output_error::OutputError;
use crate::app::files::picture_files;

const SHEET_WIDTH_PX: u32 = 1600;
const GAP_PX: u32 = 4;
const BACKGROUND: [u8; 4] = [255; 4];

/// A sheet of evenly spaced frames of a replay, whose length need not be known.
pub struct ContactSheet {
    columns: u32,
    most_cells: usize,
    /// Every how many frames one is kept; doubles when there are more than twice `most_cells`.
    stride: u32,
    seen: u32,
    cells: Vec<RgbaImage>,
}

impl ContactSheet {
    /// A sheet of at most `columns` by `rows` frames.
    pub fn new(columns: u32, rows: u32) -> Self {
        let (columns, rows) = (columns.max(1), rows.max(1));
        Self {
            columns,
            most_cells: (columns * rows) as usize,
            stride: 1,
            seen: 0,
            cells: Vec::new(),
        }
    }

    /// Shows the sheet a frame of 8-bit RGBA; it keeps a small copy if it wants it.
    pub fn push(&mut self, size_px: [u32; 2], rgba: &[u8]) {
        let wanted = self.seen.is_multiple_of(self.stride);
        self.seen += 1;
        if !wanted {
            return;
        }
        let Some(frame) =
            image::ImageBuffer::<image::Rgba<u8>, &[u8]>::from_raw(size_px[0], size_px[1], rgba)
        else {
            return;
        };
        // Twice as many as there is room for are kept, so that the final choice among them is fine enough.
        if self.cells.len() == 2 * self.most_cells {
            let mut position = 0;
            self.cells.retain(|_| {
                position += 1;
                position % 2 == 1
            });
            self.stride *= 2;
        }
        let width = self.cell_width_px();
        let height =
            (u64::from(width) * u64::from(size_px[1]) / u64::from(size_px[0].max(1))).max(1) as u32;
        self.cells
            .push(image::imageops::thumbnail(&frame, width, height));
    }

    /// Writes the sheet as a PNG; without any frame it writes nothing.
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        let chosen = self.chosen();
        let Some(height) = chosen.iter().map(|cell| cell.height()).max() else {
            return Ok(());
        };
        let width = self.cell_width_px();
        let columns = self.columns.min(chosen.len() as u32);
        let rows = (chosen.len() as u32).div_ceil(columns);
        let size_px = [
            columns * (width + GAP_PX) + GAP_PX,
            rows * (height + GAP_PX) + GAP_PX,
        ];
        let mut sheet = RgbaImage::from_pixel(size_px[0], size_px[1], image::Rgba(BACKGROUND));
        for (position, cell) in (0..).zip(chosen) {
            let x = GAP_PX + position % columns * (width + GAP_PX);
            let y = GAP_PX + position / columns * (height + GAP_PX);
            image::imageops::replace(&mut sheet, cell, i64::from(x), i64::from(y));
        }
        picture_files::write_rgb_png(path, size_px, sheet.as_raw())
    }

    /// Evenly spaced among the kept ones, the first and the last with them.
    fn chosen(&self) -> Vec<&RgbaImage> {
        let (kept, most) = (self.cells.len(), self.most_cells);
        if kept <= most {
            return self.cells.iter().collect();
        }
        (0..most)
            .map(|cell| &self.cells[cell * (kept - 1) / most.saturating_sub(1).max(1)])
            .collect()
    }

    fn cell_width_px(&self) -> u32 {
        (SHEET_WIDTH_PX.saturating_sub(GAP_PX) / self.columns)
            .saturating_sub(GAP_PX)
            .max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_evenly_spaced_whatever_their_number() {
        for frames in [1_u32, 2, 11, 12, 13, 24, 25, 120, 1000] {
            let mut sheet = ContactSheet::new(4, 3);
            for index in 0..frames {
                let rgba = [(index >> 8) as u8, index as u8, 0, 255].repeat(8 * 6);
                sheet.push([8, 6], &rgba);
            }
            let found: Vec<u32> = sheet
                .chosen()
                .iter()
                .map(|cell| {
                    u32::from(cell.get_pixel(0, 0)[0]) << 8 | u32::from(cell.get_pixel(0, 0)[1])
                })
                .collect();
            assert_eq!(found.len(), frames.min(12) as usize, "{frames}: {found:?}");
            assert_eq!(found[0], 0);
            let spacing = f64::from(frames) / 12.0;
            for pair in found.windows(2) {
                let step = f64::from(pair[1] - pair[0]);
                assert!(
                    step >= 1.0 && step <= 2.0 * spacing.max(1.0),
                    "{frames}: {found:?}"
                );
            }
            assert!(
                f64::from(frames - 1 - found[found.len() - 1]) <= spacing,
                "{frames}: {found:?}"
            );
        }
    }

    #[test]
    fn the_sheet_is_one_png() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sheet.png");
        let mut sheet = ContactSheet::new(4, 3);
        sheet.write(&path).unwrap();
        assert!(!path.exists());
        for _ in 0..5 {
            sheet.push([640, 480], &[10, 20, 30, 255].repeat(640 * 480));
        }
        sheet.write(&path).unwrap();
        let picture = image::open(&path).unwrap().into_rgb8();
        assert_eq!(picture.dimensions(), (1600, 2 * 296 + 12));
        assert_eq!(picture.get_pixel(200, 100).0, [10, 20, 30]);
        assert_eq!(picture.get_pixel(1500, 400).0, [255, 255, 255]);
    }
}
