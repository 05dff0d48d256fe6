//! The points of a surface at which light is worked out: one for all corners that share place and normal.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Part of the way to its triangle's middle at which a corner's surroundings are gathered: a corner that stands on the
/// table would see into it.
const CORNER_INSET: f64 = 0.05;

/// One point (place and unit normal) for all corners that share place and normal, and for each corner its point; 0 for
/// corners that are in no triangle.
///
/// # Panics
/// If a triangle names a corner that is not there.
pub fn corner_points(
    corners: &[(Vec3, Vec3)],
    triangles: &[[u32; 3]],
) -> (Vec<(DVec3, DVec3)>, Vec<usize>) {
    let mut point_at: HashMap<[u32; 6], usize> = HashMap::new();
    let mut points = Vec::new();
    let mut point_of_corner = vec![0; corners.len()];
    for triangle in triangles {
        let corners = triangle.map(|corner| corners[corner as usize]);
        let middle = corners
            .iter()
            .map(|(place, _)| place.as_dvec3())
            .sum::<DVec3>()
            / 3.0;
        for (&index, (place, normal)) in triangle.iter().zip(corners) {
            let [x, y, z] = place.to_array().map(f32::to_bits);
            let [nx, ny, nz] = normal.to_array().map(f32::to_bits);
            let point = *point_at.entry([x, y, z, nx, ny, nz]).or_insert_with(|| {
                points.push((
                    place.as_dvec3().lerp(middle, CORNER_INSET),
                    normal.as_dvec3(),
                ));
                points.len() - 1
            });
            point_of_corner[index as usize] = point;
        }
    }
    (points, point_of_corner)
}
