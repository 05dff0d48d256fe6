//! What a thing hides of light from afar from itself, corner by corner, as harmonics (Sloan et al. 2002; Tamura et al. 2005,
//! equations 1 and 11): worked out once, whichever way the thing is turned later.

use std::f64::consts::PI;
use std::hash::{DefaultHasher, Hasher as _};

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::geometry::corner_points::corner_points;
use crate::geometry::mesh::Mesh;
use crate::geometry::ray_caster::RayCaster;
use crate::light::harmonics::{basis, cosine_lobe, count, sphere};

/// Degree of the harmonics of what arrives: 36 of them, as in the paper's section 7.
pub const TRANSFER_DEGREE: usize = 5;
/// Degree of those of visibility: 16, as the paper has them for glossy surfaces.
pub const VISIBILITY_DEGREE: usize = 3;
/// How many harmonics there are of either.
pub const TRANSFERS: usize = count(TRANSFER_DEGREE);
/// See [`TRANSFERS`].
pub const VISIBILITIES: usize = count(VISIBILITY_DEGREE);
/// Rays from a corner, half of them above its surface.
const RAYS: usize = 512;

/// Rays start this part of a thing's size off its surface.
const START_OFFSET: f64 = 1e-4;
/// How far an orientation's axes may be from square, in parts of their length.
const SQUARE: f64 = 1e-9;

/// A corner's self-occlusion, in its thing's own orientation.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SelfOcclusion {
    /// Irradiance of the corner for each harmonic of radiance (π times T of Tamura et al. 2005, equation 1).
    pub transfer: [f32; TRANSFERS],
    /// Whether each direction is open, 1 or 0. Only directions above the surface matter; below it the function goes on as its
    /// own mirror image, so that a corner that nothing hides has no edge in it.
    pub visibility: [f32; VISIBILITIES],
}

/// The orientation and the size that a thing has of its own: what it hides from itself stays the same there however it is moved,
/// turned and scaled evenly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnSpace {
    /// From its file's space.
    pub own_from_object: DMat3,
    /// Turns directions into its anchor's.
    pub anchor_from_own: DMat3,
}

impl OwnSpace {
    /// Of a thing's placement. One that shears has no orientation of its own: it takes its anchor's.
    pub fn new(anchor_from_object: &DAffine3) -> Self {
        let (scale, rotation, _) = anchor_from_object.to_scale_rotation_translation();
        let anchor_from_own = DMat3::from_quat(rotation);
        let linear = anchor_from_object.matrix3;
        let largest = scale.abs().max_element();
        let off = anchor_from_own * DMat3::from_diagonal(scale) - linear;
        let is_square = off.abs_diff_eq(DMat3::ZERO, SQUARE * largest);
        match is_square {
            // (Rounded, so that turns of one thing share it.)
            true => Self {
                own_from_object: DMat3::from_diagonal((scale / largest).as_vec3().as_dvec3()),
                anchor_from_own,
            },
            false => Self {
                own_from_object: linear,
                anchor_from_own: DMat3::IDENTITY,
            },
        }
    }

    /// What all of a mesh's self-occlusion depends on here.
    pub fn key(&self, mesh: &Mesh) -> u64 {
        let mut hasher = DefaultHasher::new();
        for number in self.own_from_object.to_cols_array() {
            hasher.write_u64(number.to_bits());
        }
        hasher.write(bytemuck::cast_slice(&mesh.positions));
        hasher.write(bytemuck::cast_slice(&mesh.triangles));
        for normals in &mesh.corner_normals {
            hasher.write(bytemuck::cast_slice(normals));
        }
        hasher.finish()
    }
}

/// A thing's surface in its own space, at which self-occlusion is worked out.
pub struct OwnSurface {
    /// What all of it depends on.
    pub key: u64,
    /// For each corner of each triangle, those of coarser levels too, its point.
    pub point_of_corner: Vec<usize>,
    points: Vec<(DVec3, DVec3)>,
    caster: RayCaster,
    offset: f64,
}

impl OwnSurface {
    /// Of a thing's mesh and its coarser versions in their order.
    pub fn new<'a>(
        mesh: &'a Mesh,
        coarser: impl Iterator<Item = &'a Mesh>,
        space: &OwnSpace,
    ) -> Self {
        let linear = space.own_from_object;
        let normal_matrix = linear.inverse().transpose();
        let place = |position: Vec3| (linear * position.as_dvec3()).as_vec3();
        let mut corners: Vec<(Vec3, Vec3)> = Vec::new();
        for level in std::iter::once(mesh).chain(coarser) {
            for (triangle, normals) in level.triangles.iter().zip(&level.corner_normals) {
                corners.extend(triangle.iter().zip(normals).map(|(&index, normal)| {
                    let normal = (normal_matrix * normal.as_dvec3()).normalize_or_zero();
                    (place(level.positions[index as usize]), normal.as_vec3())
                }));
            }
        }
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3)
            .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
            .collect();
        let (points, point_of_corner) = corner_points(&corners, &triangles);
        let own: Vec<[Vec3; 3]> = mesh
            .triangles
            .iter()
            .map(|triangle| triangle.map(|index| place(mesh.positions[index as usize])))
            .collect();
        let bounds = Bounds::around(own.iter().flatten().map(|corner| corner.as_dvec3()));
        let size = bounds.map_or(0.0, |bounds| (bounds.high - bounds.low).length());
        Self {
            key: space.key(mesh),
            point_of_corner,
            points,
            caster: RayCaster::new(&own),
            offset: size * START_OFFSET,
        }
    }

    /// What its self-occlusion is kept under: with coarser levels it has other points.
    pub fn kept_as(&self) -> u64 {
        self.key ^ (self.points.len() as u64).rotate_left(32)
    }

    /// How many points there are.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// Works out the self-occlusion of each point by rays, on all cores.
    pub fn self_occlusions(&self) -> Vec<SelfOcclusion> {
        self.self_occlusions_by(RAYS)
    }

    /// The same by another number of rays from each point, half of them above its surface.
    pub fn self_occlusions_by(&self, ray_count: usize) -> Vec<SelfOcclusion> {
        let rays: Vec<(DVec3, Vec<f64>)> = sphere(ray_count)
            .map(|direction| (direction, basis(direction, TRANSFER_DEGREE)))
            .collect();
        let of_point = |&(place, normal): &(DVec3, DVec3)| {
            let start = (place + normal * self.offset).as_vec3();
            occlusion(start, normal, &rays, &self.caster)
        };
        self.points.par_iter().map(of_point).collect()
    }
}

/// What nothing hides, less what the thing does: so the error of the rays is in the hidden part alone.
fn occlusion(
    start: Vec3,
    normal: DVec3,
    rays: &[(DVec3, Vec<f64>)],
    caster: &RayCaster,
) -> SelfOcclusion {
    let mut transfer = [0.0; TRANSFERS];
    let mut visibility = [0.0; VISIBILITIES];
    let values = basis(normal, TRANSFER_DEGREE);
    for l in 0..=TRANSFER_DEGREE {
        let band = l * l..(l + 1) * (l + 1);
        for (sum, value) in transfer[band.clone()].iter_mut().zip(&values[band]) {
            *sum = cosine_lobe(l) * value;
        }
    }
    // The harmonic of degree 0 of a constant 1.
    visibility[0] = (4.0 * PI).sqrt();
    let weight = 4.0 * PI / rays.len() as f64;
    for (direction, values) in rays {
        let up = direction.dot(normal);
        let above = match up > 0.0 {
            true => *direction,
            false => *direction - normal * (2.0 * up),
        };
        if !caster.is_hidden(start, above.as_vec3(), f32::INFINITY) {
            continue;
        }
        for (sum, value) in visibility.iter_mut().zip(values) {
            *sum -= weight * value;
        }
        if up > 0.0 {
            for (sum, value) in transfer.iter_mut().zip(values) {
                *sum -= weight * up * value;
            }
        }
    }
    SelfOcclusion {
        transfer: transfer.map(|sum| sum as f32),
        visibility: visibility.map(|sum| sum as f32),
    }
}

impl SelfOcclusion {
    /// Irradiance of the corner from radiance whose coefficients are in the same space (Tamura et al. 2005, equation 2); never
    /// negative, which a sum of few harmonics may be.
    pub fn irradiance(&self, radiance: &[DVec3; TRANSFERS]) -> Vec3 {
        let parts = self.transfer.iter().zip(radiance);
        let sum: DVec3 = parts
            .map(|(&part, &radiance)| radiance * f64::from(part))
            .sum();
        sum.max(DVec3::ZERO).as_vec3()
    }
}
