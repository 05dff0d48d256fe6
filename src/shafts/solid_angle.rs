//! The solid angle of a triangle (Van Oosterom & Strackee 1983).

use glam::Vec3;

/// Solid angle of a triangle as the origin sees it, steradians, whichever way it faces.
pub fn solid_angle(corners: [Vec3; 3]) -> f64 {
    let [a, b, c] = corners.map(|corner| corner.as_dvec3().normalize_or_zero());
    // Of differences: a small triangle far away has no digits to lose.
    let volume = a.dot((b - a).cross(c - a));
    let rest = 1.0 + a.dot(b) + b.dot(c) + c.dot(a);
    2.0 * volume.abs().atan2(rest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    #[test]
    fn an_octant_and_a_sliver_have_theirs() {
        let octant = solid_angle([Vec3::X, Vec3::Y * 3.0, Vec3::Z * 0.2]);
        assert!((octant - PI / 2.0).abs() < 1e-9, "{octant}");
        let far = Vec3::new(0.0, 0.0, 100.0);
        let small = solid_angle([far, far + Vec3::X * 0.1, far + Vec3::Y * 0.1]);
        assert!((small / 5e-7 - 1.0).abs() < 1e-3, "{small}");
    }
}
