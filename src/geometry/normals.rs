//! Normals made where a mesh has none.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

/// Cosine's slack, so that faces at just the crease angle count as within it whatever the rounding.
const CREASE_SLACK: f64 = 1e-6;
/// Faces around a vertex that are compared one by one; more are first taken together where they face alike.
const MOST_FACES_APART: usize = 256;
/// Steps per unit of the normals that are taken together, less than four degrees apart.
const ALIKE_STEPS: f64 = 32.0;
/// A triangle whose height is below this part of its longest side has no area that single precision can tell.
const NEEDLE: f64 = 1e-7;

/// A triangle's unit normal, outward by its winding; zero if it has no area.
pub fn face_normal(positions: &[Vec3], [a, b, c]: [u32; 3]) -> DVec3 {
    let [a, b, c] = [a, b, c].map(|index| positions[index as usize].as_dvec3());
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let cross = ab.cross(ac);
    let longest_squared = ab
        .length_squared()
        .max(ac.length_squared())
        .max(bc.length_squared());
    if cross.length() <= NEEDLE * longest_squared {
        DVec3::ZERO
    } else {
        cross.normalize_or_zero()
    }
}

/// A unit normal for each corner: the mean over the faces around its vertex whose normals lie within `crease_rad` of
/// its own face's, weighted by their angles there (Thürmer & Wüthrich 1998). 0 gives the face's own normal.
pub fn made_normals(positions: &[Vec3], triangles: &[[u32; 3]], crease_rad: f64) -> Vec<[Vec3; 3]> {
    bent_normals(positions, positions, triangles, crease_rad)
}

/// [`made_normals`] of a surface that is bent: faces that look like one surface at rest go on doing so, wherever the crease
/// angle comes to lie, so that no edge turns sharp in the middle of a movement.
pub fn bent_normals(
    at_rest: &[Vec3],
    positions: &[Vec3],
    triangles: &[[u32; 3]],
    crease_rad: f64,
) -> Vec<[Vec3; 3]> {
    let faces_of = |positions: &[Vec3]| -> Vec<DVec3> {
        let faces = triangles.iter();
        faces
            .map(|&corners| face_normal(positions, corners))
            .collect()
    };
    let faces = faces_of(positions);
    let faces_at_rest = match std::ptr::eq(at_rest, positions) {
        true => faces.clone(),
        false => faces_of(at_rest),
    };
    let mut faces_at: Vec<Vec<FaceAtCorner>> = vec![Vec::new(); positions.len()];
    for (triangle, &corners) in triangles.iter().enumerate() {
        for corner in 0..3 {
            let angle_rad = corner_angle_rad(positions, corners, corner);
            faces_at[corners[corner] as usize].push(FaceAtCorner {
                at_rest: faces_at_rest[triangle],
                weighted: faces[triangle] * angle_rad,
            });
        }
    }
    for around in &mut faces_at {
        if around.len() > MOST_FACES_APART {
            *around = taken_together(around);
        }
    }
    let least_cosine = crease_rad.cos() - CREASE_SLACK;
    let of_corner = |vertex: u32, own: DVec3, own_at_rest: DVec3| {
        let around = faces_at[vertex as usize].iter();
        let mean = |within: &dyn Fn(DVec3) -> bool| {
            around
                .clone()
                .filter(|face| within(face.at_rest))
                .map(|face| face.weighted)
                .sum::<DVec3>()
                .normalize_or_zero()
        };
        let made = match own_at_rest {
            // A needle has no side of its own and takes its surroundings'.
            DVec3::ZERO => mean(&|_| true),
            _ if crease_rad == 0.0 => own,
            _ => mean(&|normal| normal.dot(own_at_rest) >= least_cosine),
        };
        [made, own, DVec3::Z]
            .into_iter()
            .find(|normal| *normal != DVec3::ZERO)
            .unwrap_or(DVec3::Z)
            .as_vec3()
    };
    let of_triangle = |(corners, (&own, &at_rest)): (&[u32; 3], (&DVec3, &DVec3))| {
        corners.map(|vertex| of_corner(vertex, own, at_rest))
    };
    let own = faces.iter().zip(&faces_at_rest);
    triangles.iter().zip(own).map(of_triangle).collect()
}

/// A face at one of its corners.
#[derive(Debug, Clone, Copy)]
struct FaceAtCorner {
    /// Its unit normal at rest, by which it counts for a corner or not.
    at_rest: DVec3,
    /// Its unit normal times its angle there.
    weighted: DVec3,
}

/// Faces with those added up that are nearly alike, so that a vertex with very many of them takes no time that grows with
/// their square.
fn taken_together(faces: &[FaceAtCorner]) -> Vec<FaceAtCorner> {
    let mut sums: HashMap<[i32; 3], FaceAtCorner> = HashMap::new();
    let mut order = Vec::new();
    for face in faces {
        let key = (face.at_rest * ALIKE_STEPS)
            .round()
            .to_array()
            .map(|step| step as i32);
        let sum = sums.entry(key).or_insert_with(|| {
            order.push(key);
            FaceAtCorner {
                at_rest: DVec3::ZERO,
                weighted: DVec3::ZERO,
            }
        });
        sum.at_rest += face.at_rest * face.weighted.length();
        sum.weighted += face.weighted;
    }
    let together = order.into_iter().map(|key| FaceAtCorner {
        at_rest: sums[&key].at_rest.normalize_or_zero(),
        ..sums[&key]
    });
    together.collect()
}

fn corner_angle_rad(positions: &[Vec3], corners: [u32; 3], corner: usize) -> f64 {
    let at = |offset: usize| positions[corners[(corner + offset) % 3] as usize].as_dvec3();
    let (towards_next, towards_last) = (at(1) - at(0), at(2) - at(0));
    towards_next
        .cross(towards_last)
        .length()
        .atan2(towards_next.dot(towards_last))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;

    #[test]
    fn a_cube_stays_flat_below_its_crease_angle() {
        let (positions, triangles) = cuboid(Vec3::NEG_ONE, Vec3::ONE);
        for crease_deg in [0.0_f64, 30.0, 89.0] {
            let normals = made_normals(&positions, &triangles, crease_deg.to_radians());
            for (corners, normals) in triangles.iter().zip(normals) {
                let flat = face_normal(&positions, *corners).as_vec3();
                assert!(
                    normals.iter().all(|normal| (normal - flat).length() < 1e-6),
                    "{crease_deg}"
                );
            }
        }
    }

    #[test]
    fn a_cube_within_its_crease_angle_has_its_diagonals_whatever_way_its_squares_are_cut() {
        let (positions, triangles) = cuboid(Vec3::NEG_ONE, Vec3::ONE);
        let normals = made_normals(&positions, &triangles, 90.0_f64.to_radians());
        for (corners, normals) in triangles.iter().zip(normals) {
            for (&corner, normal) in corners.iter().zip(normals) {
                assert!((normal - positions[corner as usize].normalize()).length() < 1e-6);
            }
        }
    }

    #[test]
    fn a_sphere_has_nearly_its_radii() {
        let (rings, sectors) = (24_u32, 48_u32);
        let mut positions = vec![Vec3::Z];
        for ring in 1..rings {
            let polar = std::f32::consts::PI * ring as f32 / rings as f32;
            positions.extend((0..sectors).map(|sector| {
                let azimuth = std::f32::consts::TAU * sector as f32 / sectors as f32;
                Vec3::new(
                    polar.sin() * azimuth.cos(),
                    polar.sin() * azimuth.sin(),
                    polar.cos(),
                )
            }));
        }
        positions.push(-Vec3::Z);
        let at = |ring: u32, sector: u32| match ring {
            0 => 0,
            _ if ring == rings => (rings - 1) * sectors + 1,
            _ => 1 + (ring - 1) * sectors + sector % sectors,
        };
        let mut triangles = Vec::new();
        for (ring, sector) in
            (0..rings).flat_map(|ring| (0..sectors).map(move |sector| (ring, sector)))
        {
            if ring + 1 < rings {
                triangles.push([
                    at(ring, sector),
                    at(ring + 1, sector),
                    at(ring + 1, sector + 1),
                ]);
            }
            if ring > 0 {
                triangles.push([
                    at(ring, sector),
                    at(ring + 1, sector + 1),
                    at(ring, sector + 1),
                ]);
            }
        }
        let normals = made_normals(&positions, &triangles, 30.0_f64.to_radians());
        for (corners, normals) in triangles.iter().zip(normals) {
            for (&corner, normal) in corners.iter().zip(normals) {
                assert!(
                    normal.angle_between(positions[corner as usize]) < 0.01,
                    "{normal}"
                );
            }
        }
    }

    #[test]
    fn a_fan_of_very_many_faces_has_its_cone_s_axis_at_its_tip() {
        let rim = 20_000_u32;
        let positions: Vec<Vec3> = (0..rim)
            .map(|step| {
                let azimuth_rad = std::f64::consts::TAU * f64::from(step) / f64::from(rim);
                DVec3::new(azimuth_rad.cos(), azimuth_rad.sin(), -0.2).as_vec3()
            })
            .chain([Vec3::ZERO])
            .collect();
        let triangles: Vec<[u32; 3]> = (0..rim).map(|step| [rim, step, (step + 1) % rim]).collect();
        for (normals, corners) in made_normals(&positions, &triangles, 1.0)
            .iter()
            .zip(&triangles)
        {
            assert!(normals[0].angle_between(Vec3::Z) < 1e-3, "{}", normals[0]);
            let flat = face_normal(&positions, *corners).as_vec3();
            assert!(normals[1].angle_between(flat) < 1e-3);
        }
    }

    #[test]
    fn a_needle_takes_the_normal_around_it() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::X * 0.5, Vec3::Y];
        let normals = made_normals(&positions, &[[0, 1, 2], [0, 1, 3]], 0.0);
        assert_eq!(normals[0], [Vec3::Z; 3]);
        assert_eq!(made_normals(&positions, &[[0, 1, 2]], 0.5)[0], [Vec3::Z; 3]);
    }
}
