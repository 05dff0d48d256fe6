//! The points of a surface at which light is worked out: one for all corners that share place and normal.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DVec3, Vec3};

use super::bounds::Bounds;
use super::ray_caster::RayCaster;

/// Part of the way to its triangle's middle at which a corner's surroundings are gathered: a corner that stands on the
/// table would see into it.
const CORNER_INSET: f64 = 0.05;
/// Rays that ask whether a place is buried start this part of the surface's size off it.
const START_OFFSET: f64 = 1e-5;
/// Points in a solid have the light of those outside for so many edges.
const EDGES_INWARDS: usize = 2;
/// Rays around the one along the normal, in turn this far down from it.
const RAYS_BESIDE: usize = 14;
const BESIDE_RAD: [f64; 2] = [0.6, 1.2];

/// One point (place and unit normal) for all corners that share place and normal, and for each corner its point; 0 for
/// corners that are in no triangle. What is buried in a solid that `surface` has around it, as a floor is below a wall that was put on
/// it, has no light of its own: where triangles meet of which some are buried, the point is on one that is not, and a corner in
/// the solid has its place at that of a neighbour outside.
///
/// # Panics
/// If a triangle names a corner that is not there.
pub fn corner_points(
    corners: &[(Vec3, Vec3)],
    triangles: &[[u32; 3]],
    surface: &RayCaster,
) -> (Vec<(DVec3, DVec3)>, Vec<usize>) {
    let bounds = Bounds::around(corners.iter().map(|(place, _)| place.as_dvec3()));
    let size = bounds.map_or(0.0, |bounds| (bounds.high - bounds.low).length());
    let mut point_at: HashMap<[u32; 6], usize> = HashMap::new();
    let mut points: Vec<(DVec3, DVec3)> = Vec::new();
    let mut are_buried: Vec<bool> = Vec::new();
    let mut point_of_corner = vec![0; corners.len()];
    for triangle in triangles {
        let corners = triangle.map(|corner| corners[corner as usize]);
        let places = corners.map(|(place, _)| place.as_dvec3());
        let middle = places.iter().sum::<DVec3>() / 3.0;
        let outward = (places[1] - places[0]).cross(places[2] - places[0]);
        for (&index, (place, normal)) in triangle.iter().zip(corners) {
            let [x, y, z] = place.to_array().map(f32::to_bits);
            let [nx, ny, nz] = normal.to_array().map(f32::to_bits);
            let inset = place.as_dvec3().lerp(middle, CORNER_INSET);
            let normal = normal.as_dvec3();
            let is_buried = || {
                let start = inset + normal * (START_OFFSET * size);
                is_buried(surface, start, normal, outward.dot(normal) < 0.0)
            };
            let next = points.len();
            let point = *point_at.entry([x, y, z, nx, ny, nz]).or_insert(next);
            if point == next {
                points.push((inset, normal));
                are_buried.push(is_buried());
            } else if are_buried[point] && !is_buried() {
                points[point].0 = inset;
                are_buried[point] = false;
            }
            point_of_corner[index as usize] = point;
        }
    }
    let of_points = |triangle: &[u32; 3]| triangle.map(|corner| point_of_corner[corner as usize]);
    for _ in 0..EDGES_INWARDS {
        if are_buried.contains(&true) {
            let joined = triangles.iter().map(of_points);
            dig_out(&mut points, &mut are_buried, joined);
        }
    }
    (points, point_of_corner)
}

/// Gives buried points the places of the nearest that they share an edge with, of those that are not.
fn dig_out(
    points: &mut [(DVec3, DVec3)],
    are_buried: &mut [bool],
    triangles: impl Iterator<Item = [usize; 3]>,
) {
    let mut nearest: HashMap<usize, (f64, DVec3)> = HashMap::new();
    for triangle in triangles {
        for (one, other) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)] {
            let (one, other) = (triangle[one], triangle[other]);
            if !are_buried[one] || are_buried[other] {
                continue;
            }
            let place = points[other].0;
            let away = points[one].0.distance_squared(place);
            let found = nearest.entry(one).or_insert((away, place));
            if away < found.0 {
                *found = (away, place);
            }
        }
    }
    for (point, (_, place)) in nearest {
        points[point].0 = place;
        are_buried[point] = false;
    }
}

/// Whether all that is above a place (a little off its own triangle, with a unit normal) is the inside of a surface: before a sheet
/// some of its other side may be seen, but never that alone. `is_turned`: triangles are wound clockwise seen from where normals point.
pub fn is_buried(surface: &RayCaster, start: DVec3, normal: DVec3, is_turned: bool) -> bool {
    let meets_inside = |direction: DVec3| {
        let side = surface.side_met(start.as_vec3(), direction.as_vec3());
        side.is_some_and(|is_outer| is_outer == is_turned)
    };
    let (right, up) = normal.any_orthonormal_pair();
    let beside = |ray: usize| {
        let around = TAU * ray as f64 / RAYS_BESIDE as f64;
        let down = BESIDE_RAD[ray % BESIDE_RAD.len()];
        let aside = right * around.cos() + up * around.sin();
        normal * down.cos() + aside * down.sin()
    };
    meets_inside(normal) && (0..RAYS_BESIDE).map(beside).all(meets_inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;

    /// A floor, cut along the foot of a wall that stands on it: the strip below the wall is one triangle's width.
    #[test]
    fn points_at_the_foot_of_a_wall_are_before_it() {
        let (mut places, triangles) = cuboid(Vec3::ZERO, Vec3::new(0.1, 1.0, 1.0));
        let floor = places.len() as u32;
        let columns = [-1.0, 0.0, 0.1, 1.1];
        places.extend(
            columns
                .iter()
                .flat_map(|&x| [0.0, 1.0].map(|y| Vec3::new(x, y, 0.0))),
        );
        // What lies below the wall comes first.
        let strips = [1, 0, 2].into_iter().flat_map(|column| {
            let first = floor + 2 * column;
            [[first, first + 2, first + 3], [first, first + 3, first + 1]]
        });
        let strips: Vec<[u32; 3]> = strips.collect();
        for mirrored in [false, true] {
            let side = if mirrored {
                Vec3::new(-1.0, 1.0, 1.0)
            } else {
                Vec3::ONE
            };
            let places: Vec<Vec3> = places.iter().map(|place| *place * side).collect();
            let corners = |triangle: &[u32; 3]| triangle.map(|index| places[index as usize]);
            let all: Vec<_> = triangles.iter().chain(&strips).map(corners).collect();
            let surface = RayCaster::new(&all);
            let with_normals: Vec<_> = places.iter().map(|place| (*place, Vec3::Z)).collect();
            let (points, point_of_corner) = corner_points(&with_normals, &strips, &surface);
            for corner in floor..floor + 8 {
                let (place, _) = points[point_of_corner[corner as usize]];
                let x = place.x * f64::from(side.x);
                assert!(!(0.0..=0.1).contains(&x), "{corner}: {place}");
            }
        }
    }
}
