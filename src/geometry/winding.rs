//! How often a surface winds around a point, by the solid angles of its triangles (van Oosterom & Strackee 1983).

use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

/// The sum of the triangles' signed solid angles at a point over 4π: 1 inside a closed mesh that is wound outwards, 0
/// outside it, -1 inside one that is wound inwards, and in between for open ones. On a triangle itself it is between
/// the values of both sides.
pub fn winding_number(
    positions: &[Vec3],
    triangles: impl IntoIterator<Item = [u32; 3]>,
    point: DVec3,
) -> f64 {
    let half_angles: f64 = triangles
        .into_iter()
        .map(|corners| {
            half_solid_angle(corners.map(|index| positions[index as usize].as_dvec3() - point))
        })
        .sum();
    half_angles / TAU
}

/// Half the solid angle of a triangle seen from the origin, positive if it is clockwise from there (its outer side is
/// back-facing): equation 8 of the paper. 0 at a corner, where it is not defined.
fn half_solid_angle([a, b, c]: [DVec3; 3]) -> f64 {
    let (length_a, length_b, length_c) = (a.length(), b.length(), c.length());
    let numerator = a.dot(b.cross(c));
    let denominator = length_a * length_b * length_c
        + a.dot(b) * length_c
        + a.dot(c) * length_b
        + b.dot(c) * length_a;
    numerator.atan2(denominator)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;
    use std::f64::consts::PI;

    #[test]
    fn an_octant_is_an_eighth_of_the_sphere() {
        let octant = half_solid_angle([DVec3::X * 3.0, DVec3::Y, DVec3::Z * 0.2]);
        assert!((octant - PI / 4.0).abs() < 1e-15);
        let turned = half_solid_angle([DVec3::Y, DVec3::X, DVec3::Z]);
        assert!((turned + PI / 4.0).abs() < 1e-15);
    }

    #[test]
    fn a_square_has_its_closed_form() {
        // A square of side 2 seen from a distance h above its centre: 4 asin(1 / (1 + h²)).
        let positions = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(x, y): (f32, f32)| Vec3::new(x, y, 0.0));
        for height in [1e-3, 0.1, 1.0, 7.0] {
            let turns = winding_number(
                &positions,
                [[0, 1, 2], [0, 2, 3]],
                DVec3::new(0.0, 0.0, -height),
            );
            let angle = 4.0 * (1.0 / (1.0 + height * height)).asin();
            assert!((turns - angle / (2.0 * TAU)).abs() < 1e-12, "{height}");
        }
    }

    #[test]
    fn a_cube_is_around_what_lies_in_it() {
        let (positions, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
        let at = |x, y, z| winding_number(&positions, triangles.clone(), DVec3::new(x, y, z));
        for (x, y, z, turns) in [
            (0.5, 0.5, 0.5, 1.0),
            (1e-6, 0.3, 0.999, 1.0),
            (-1e-6, 0.3, 0.999, 0.0),
            (0.5, 0.5, 4.0, 0.0),
            (2.0, 1.0, 1.0, 0.0),
        ] {
            let found = at(x, y, z);
            assert!((found - turns).abs() < 1e-9, "{x} {y} {z}: {found}");
        }
        let inwards = triangles.iter().map(|&[a, b, c]| [a, c, b]);
        let turns = winding_number(&positions, inwards, DVec3::splat(0.5));
        assert!((turns + 1.0).abs() < 1e-12);
        let (at_a_corner, on_a_face) = (at(1.0, 1.0, 1.0), at(0.4, 0.3, 0.0));
        assert!((0.0..=1.0).contains(&at_a_corner) && (-1e-9..=1.0 + 1e-9).contains(&on_a_face));
    }
}
