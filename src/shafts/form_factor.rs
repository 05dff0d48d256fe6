//! Form factors from a point with a normal to a triangle, by Lambert's closed form over its edges.

use std::f32::consts::TAU;

use glam::Vec3;

/// Part of the cosine-weighted hemisphere over a point with a unit normal that a triangle covers, nothing between them;
/// whichever way the triangle faces. What lies behind the point's plane is cut off.
pub fn form_factor(point: Vec3, normal: Vec3, corners: [Vec3; 3]) -> f32 {
    let mut clipped = [Vec3::ZERO; 4];
    let count = clip(corners.map(|corner| corner - point), normal, &mut clipped);
    let mut sum = 0.0;
    for index in 0..count {
        let (from, to) = (clipped[index], clipped[(index + 1) % count]);
        let across = from.cross(to);
        let length = across.length();
        if length > 1e-20 {
            sum += normal.dot(across) / length * length.atan2(from.dot(to));
        }
    }
    (sum / TAU).abs()
}

/// The part of a triangle above the plane through the origin; returns its number of corners, up to 4.
fn clip(corners: [Vec3; 3], normal: Vec3, clipped: &mut [Vec3; 4]) -> usize {
    let mut count = 0;
    for index in 0..3 {
        let (from, to) = (corners[index], corners[(index + 1) % 3]);
        let (height, next) = (from.dot(normal), to.dot(normal));
        if height >= 0.0 {
            clipped[count] = from;
            count += 1;
        }
        if (height < 0.0) != (next < 0.0) {
            clipped[count] = from.lerp(to, height / (height - next));
            count += 1;
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    fn square(half: f32, z: f32) -> [[Vec3; 3]; 2] {
        let corner = |x: f32, y: f32| Vec3::new(x * half, y * half, z);
        [
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
            [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        ]
    }

    fn to_square(point: Vec3, normal: Vec3, half: f32, z: f32) -> f32 {
        square(half, z)
            .iter()
            .map(|corners| form_factor(point, normal, *corners))
            .sum()
    }

    #[test]
    fn a_parallel_square_has_the_catalogues_form_factor() {
        // Howell's catalogue B-4, four quarters.
        for (half, height) in [(0.5_f32, 0.4_f32), (2.0, 0.1), (0.01, 3.0)] {
            let ratio = half / height;
            let slant = ratio / (1.0 + ratio * ratio).sqrt();
            let expected = 4.0 / PI * slant * slant.atan();
            let found = to_square(Vec3::ZERO, Vec3::Z, half, height);
            assert!(
                (found / expected - 1.0).abs() < 1e-3,
                "{found} for {expected}"
            );
        }
    }

    #[test]
    fn what_lies_behind_the_horizon_counts_not() {
        // A perpendicular strip, half of it below the horizon of a point at its foot: half of that seen from between.
        let whole = to_square(Vec3::ZERO, Vec3::X, 1e3, 1.0);
        // Upright, the point sees half of an endless ceiling: form factor 1/2.
        assert!((whole - 0.5).abs() < 2e-3, "{whole}");
        assert_eq!(to_square(Vec3::new(0.0, 0.0, 2.0), Vec3::Z, 1.0, 1.0), 0.0);
    }

    #[test]
    fn a_closed_box_fills_the_hemisphere() {
        let mut sum = 0.0;
        let point = Vec3::new(0.3, -0.2, 0.1);
        let normal = Vec3::new(0.36, 0.48, 0.8);
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                for corners in square(1.0, side) {
                    let turned = corners.map(|corner| {
                        let mut parts = corner.to_array();
                        parts.rotate_right(axis);
                        Vec3::from_array(parts)
                    });
                    sum += form_factor(point, normal, turned);
                }
            }
        }
        assert!((sum - 1.0).abs() < 1e-5, "{sum}");
    }
}
