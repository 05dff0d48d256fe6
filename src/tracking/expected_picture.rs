//! What the differences within a picture of a marker are, whatever light lies on it.

use super::printed_marker::{Cell, PrintedMarker};

/// Samples of a cell along each side.
pub(super) const PER_CELL: i32 = 3;
/// Deviations of the blur with which a picture is compared, cells.
const BLURS_CELLS: [f64; 4] = [0.12, 0.25, 0.4, 0.6];
/// The pairs of samples a cell apart that a marker's picture has, and the differences between them by its blur.
pub(super) struct ExpectedPicture {
    /// Samples a side.
    pub across: i32,
    /// The cell in which the first sample lies, in samples from the square's corner.
    pub first: i32,
    pub pairs: Vec<[u32; 2]>,
    /// For each blur.
    pub differences: [Vec<f32>; BLURS_CELLS.len()],
}

impl ExpectedPicture {
    pub fn of(printed: &PrintedMarker) -> Self {
        // Beyond a border the paper may end soon, or hold the black squares of a grid; a ring's codes lie all around it.
        let rim = match printed.rim() > 1 {
            true => PER_CELL * printed.rim(),
            false => 1,
        };
        let (first, across) = (-rim, PER_CELL * printed.side() + 2 * rim);
        let cell_of = |sample: i32| (sample + first).div_euclid(PER_CELL);
        let cell = |x: i32, y: i32| printed.cell(cell_of(x), cell_of(y));
        let is_at_corner = |x: i32, y: i32| {
            let outside = |at: i32| !(0..printed.side()).contains(&cell_of(at));
            printed.rim() <= 1 && outside(x) && outside(y)
        };
        let is_known = |x: i32, y: i32| cell(x, y) != Cell::Open && !is_at_corner(x, y);
        let mut pairs = Vec::new();
        for (x, y) in (0..across).flat_map(|y| (0..across).map(move |x| (x, y))) {
            for (x1, y1) in [(x + PER_CELL, y), (x, y + PER_CELL)] {
                if x1 < across && y1 < across && is_known(x, y) && is_known(x1, y1) {
                    pairs.push([(y * across + x) as u32, (y1 * across + x1) as u32]);
                }
            }
        }
        let whiteness = |x: i32, y: i32| match cell(x, y) {
            Cell::White => 1.0,
            Cell::Black => 0.0,
            Cell::Open => 0.5,
        };
        let sharp: Vec<f64> = (0..across * across)
            .map(|k| whiteness(k % across, k / across))
            .collect();
        let differences = BLURS_CELLS.map(|blur_cells| {
            let blurred = blurred(&sharp, across as usize, blur_cells * f64::from(PER_CELL));
            let difference =
                |pair: &[u32; 2]| (blurred[pair[1] as usize] - blurred[pair[0] as usize]) as f32;
            pairs.iter().map(difference).collect()
        });
        Self {
            across,
            first,
            pairs,
            differences,
        }
    }
}

/// A square picture blurred along rows and columns; its rim goes on as it is.
fn blurred(picture: &[f64], across: usize, deviation: f64) -> Vec<f64> {
    let reach = (3.0 * deviation).ceil() as i64;
    let weight = |step: i64| (-0.5 * (step as f64 / deviation).powi(2)).exp();
    let total: f64 = (-reach..=reach).map(weight).sum();
    let along = |from: &[f64], stride: usize, other: usize| -> Vec<f64> {
        let last = across as i64 - 1;
        let mut to = vec![0.0; from.len()];
        for line in 0..across {
            for place in 0..across {
                let value = |step: i64| {
                    let near = (place as i64 + step).clamp(0, last) as usize;
                    weight(step) * from[line * other + near * stride]
                };
                to[line * other + place * stride] =
                    (-reach..=reach).map(value).sum::<f64>() / total;
            }
        }
        to
    };
    along(&along(picture, 1, across), across, 1)
}
