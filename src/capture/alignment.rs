//! How far pictures of one view, each with another exposure, lie from each other.
//!
//! A pixel's rank among all pixels is the same in every exposure that does not cut it off, whatever the camera's curve:
//! ranks are compared, from coarse to fine.

/// Movements of up to about so many pixels of the coarsest picture are found.
const COARSE_REACH_PX: i32 = 4;
/// The coarsest picture's shorter side is at least this.
const COARSEST_PX: usize = 24;
/// Sums of three levels outside may be cut off.
const TELLING: std::ops::RangeInclusive<usize> = 10..=750;
/// Pictures are compared where at least this part of what tells in the first one tells in both.
const LEAST_OVERLAP: f64 = 0.3;

/// Movement (right, down), in whole pixels, that brings a picture (8-bit RGBA) on to another of its size.
pub(super) fn shift_px(fixed: &[u8], moved: &[u8], size_px: [usize; 2]) -> [i32; 2] {
    let mut shift = [0; 2];
    // What one picture alone shows is in its ranks too: once it is known about where they overlap, that alone is ranked.
    for _ in 0..2 {
        let (fixed, overlap_px) = cropped(fixed, size_px, shift);
        let (moved, _) = cropped(moved, size_px, shift.map(|by| -by));
        let rest = Ranks::of(&fixed, overlap_px).shift_px(&Ranks::of(&moved, overlap_px));
        let further = [shift[0] + rest[0], shift[1] + rest[1]];
        let overlaps =
            (further.iter().zip(size_px)).all(|(by, side)| 2 * (by.unsigned_abs() as usize) < side);
        if overlaps {
            shift = further;
        }
    }
    shift
}

/// What remains of a picture where it overlaps one that is moved by a shift; with its size.
fn cropped(rgba: &[u8], [width, height]: [usize; 2], shift: [i32; 2]) -> (Vec<u8>, [usize; 2]) {
    let kept = |by: i32, side: usize| {
        let by_px = by.unsigned_abs() as usize;
        if by > 0 { by_px..side } else { 0..side - by_px }
    };
    let (columns, rows) = (kept(shift[0], width), kept(shift[1], height));
    let size_px = [columns.len(), rows.len()];
    let kept = rows
        .flat_map(|row| &rgba[4 * (row * width + columns.start)..4 * (row * width + columns.end)])
        .copied()
        .collect();
    (kept, size_px)
}

/// Ranks from 0 to 1 and how much each counts, in ever coarser pictures.
struct Ranks {
    pyramid: Vec<PyramidLayer>,
}

struct PyramidLayer {
    size_px: [usize; 2],
    /// Rank times weight, and weight.
    weighted: Vec<[f32; 2]>,
}

impl Ranks {
    /// The ranks of a picture of 8-bit RGBA.
    fn of(rgba: &[u8], size_px: [usize; 2]) -> Self {
        let sums = || {
            rgba.chunks_exact(4).map(|pixel| {
                pixel[..3]
                    .iter()
                    .map(|&level| usize::from(level))
                    .sum::<usize>()
            })
        };
        let mut counts = [0_usize; 766];
        sums().for_each(|sum| counts[sum] += 1);
        let total = (rgba.len() / 4).max(1) as f32;
        let mut below = 0;
        let ranks = counts.map(|count| {
            let middle = below as f32 + 0.5 * count as f32;
            below += count;
            middle / total
        });
        let weighted = sums()
            .map(|sum| match TELLING.contains(&sum) {
                true => [ranks[sum], 1.0],
                false => [0.0, 0.0],
            })
            .collect();
        let mut pyramid = vec![PyramidLayer { size_px, weighted }];
        while let Some(coarser) = pyramid.last().and_then(PyramidLayer::halved) {
            pyramid.push(coarser);
        }
        Self { pyramid }
    }

    /// Movement (right, down) that brings the other picture on to this one, in whole pixels.
    fn shift_px(&self, other: &Self) -> [i32; 2] {
        let mut shift = [0; 2];
        for (depth, (here, there)) in self.pyramid.iter().zip(&other.pyramid).enumerate().rev() {
            let coarsest = depth + 1 == self.pyramid.len();
            let reach = if coarsest { COARSE_REACH_PX } else { 1 };
            let around = [2 * shift[0], 2 * shift[1]];
            let mut best = (f64::INFINITY, around);
            for down in -reach..=reach {
                for right in -reach..=reach {
                    let tried = [around[0] + right, around[1] + down];
                    let off = here.difference(there, tried);
                    if off < best.0 {
                        best = (off, tried);
                    }
                }
            }
            shift = best.1;
        }
        shift
    }
}

impl PyramidLayer {
    fn halved(&self) -> Option<Self> {
        let size_px @ [width, height] = self.size_px.map(|side| side / 2);
        if width.min(height) < COARSEST_PX {
            return None;
        }
        let weighted = (0..width * height)
            .map(|index| {
                let corner = 2 * (index / width) * self.size_px[0] + 2 * (index % width);
                let mut sum = [0.0; 2];
                for beside in [0, 1, self.size_px[0], self.size_px[0] + 1] {
                    let [rank, weight] = self.weighted[corner + beside];
                    sum[0] += 0.25 * rank;
                    sum[1] += 0.25 * weight;
                }
                sum
            })
            .collect();
        Some(Self { size_px, weighted })
    }

    /// 1 less the ranks' correlation where both tell (what a picture shows more than the other shifts and stretches its
    /// ranks); infinite where that is too little.
    fn difference(&self, moved: &Self, shift: [i32; 2]) -> f64 {
        let [width, height] = self.size_px.map(|side| side as i32);
        let mut most = 0.0;
        // Weights, and weighted sums of a, b, a², b², ab.
        let mut sums = [0.0_f64; 6];
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column)))
        {
            let [rank, weight] = self.weighted[(row * width + column) as usize].map(f64::from);
            most += weight;
            let from = [column - shift[0], row - shift[1]];
            let inside = (0..width).contains(&from[0]) && (0..height).contains(&from[1]);
            if weight == 0.0 || !inside {
                continue;
            }
            let other = moved.weighted[(from[1] * width + from[0]) as usize];
            let [other_rank, other_weight] = other.map(f64::from);
            if other_weight > 0.0 {
                let (a, b) = (rank / weight, other_rank / other_weight);
                let terms = [1.0, a, b, a * a, b * b, a * b];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    *sum += weight * other_weight * term;
                }
            }
        }
        let [weights, a, b, aa, bb, ab] = sums;
        let spread = (weights * aa - a * a) * (weights * bb - b * b);
        if weights <= LEAST_OVERLAP * most || spread <= 0.0 {
            return f64::INFINITY;
        }
        1.0 - (weights * ab - a * b) / spread.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A smooth view, seen from a place, through a curve that cuts off.
    fn view([right, down]: [i32; 2], exposure: f64) -> Vec<u8> {
        let mut rgba = Vec::new();
        for (y, x) in (0..150).flat_map(|y| (0..200).map(move |x| (y, x))) {
            let (x, y) = (f64::from(x - right), f64::from(y - down));
            let light =
                (0.02 * x + 0.7 * (0.05 * y).sin() + 0.5 * (0.11 * x - 0.04 * y).cos()).exp();
            let level = (255.0 * (exposure * light).sqrt())
                .round()
                .clamp(0.0, 255.0) as u8;
            rgba.extend([level, level, level, 255]);
        }
        rgba
    }

    #[test]
    fn movements_are_found_across_exposures() {
        let size_px = [200, 150];
        let fixed = view([0, 0], 0.1);
        for (moved, exposure) in [
            ([0, 0], 0.1),
            ([5, -3], 0.02),
            ([-9, 7], 0.4),
            ([21, 14], 0.004),
        ] {
            let found = shift_px(&fixed, &view(moved, exposure), size_px);
            assert_eq!(found, moved.map(|by| -by), "{exposure}");
        }
        let white = vec![255; 4 * 200 * 150];
        assert_eq!(shift_px(&fixed, &white, size_px), [0, 0]);
    }
}
