//! A page as pixels: the share of a pixel that is black makes its level. Small print is left out: an SVG or a PDF has it.

use super::page::{Page, Rect};

/// Width, height and grey levels, rows from the top.
pub fn raster(page: &Page, dpi: f64) -> ([u32; 2], Vec<u8>) {
    let pixels_per_mm = dpi / 25.4;
    let size_px = page.size_mm.map(|mm| (mm * pixels_per_mm).round() as u32);
    let [width, height] = size_px.map(|side| side as usize);
    let mut black = vec![0.0_f32; width * height];
    for shape in &page.blacks {
        add(&mut black, width, &shape.outline, pixels_per_mm, 1.0);
        for hole in &shape.holes {
            add(&mut black, width, hole, pixels_per_mm, -1.0);
        }
    }
    let level = |black: f32| (255.0 * (1.0 - black.clamp(0.0, 1.0))).round() as u8;
    (size_px, black.into_iter().map(level).collect())
}

/// Adds the area that a rectangle covers of each pixel.
fn add(black: &mut [f32], width: usize, rect: &Rect, pixels_per_mm: f64, sign: f32) {
    let height = black.len() / width.max(1);
    let range = |axis: usize, most: usize| {
        let low = (rect.at[axis] * pixels_per_mm).clamp(0.0, most as f64);
        let high = ((rect.at[axis] + rect.size[axis]) * pixels_per_mm).clamp(0.0, most as f64);
        (low, high)
    };
    let ((left, right), (top, bottom)) = (range(0, width), range(1, height));
    let covered = |pixel: usize, low: f64, high: f64| {
        let (from, to) = (low.max(pixel as f64), high.min(pixel as f64 + 1.0));
        (to - from).max(0.0) as f32
    };
    for y in top as usize..(bottom.ceil() as usize).min(height) {
        let share = sign * covered(y, top, bottom);
        for x in left as usize..(right.ceil() as usize).min(width) {
            black[y * width + x] += share * covered(x, left, right);
        }
    }
}
