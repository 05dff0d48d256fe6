//! On which side of a line in the plane a point lies, without rounding (Shewchuk 1997).

use glam::DVec2;
use robust::{Coord, orient2d};

/// Positive for a point on the left of the way from one point to another, negative on its right, 0 on it; the sign is exact.
pub fn exact_side(from: DVec2, to: DVec2, point: DVec2) -> f64 {
    let [from, to, point] = [from, to, point].map(|DVec2 { x, y }| Coord { x, y });
    orient2d(from, to, point)
}
