//! What a thing hides of light from afar from itself, corner by corner, as harmonics (Sloan et al. 2002; Tamura et al. 2005,
//! equations 1 and 11): worked out once, whichever way the thing is turned later.

use std::f64::consts::PI;
use std::hash::{DefaultHasher, Hasher as _};
use std::sync::atomic::{AtomicUsize, Ordering};

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DMat3, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::geometry::corner_points::{corner_points, is_buried};
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
/// Points that are worked out at a stretch.
const CHUNK: usize = 32;

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

    /// The size of a mesh here: of the box around it, from corner to corner.
    pub fn size(&self, mesh: &Mesh) -> f64 {
        let places = mesh.positions.iter();
        let bounds = Bounds::around(places.map(|&position| self.place(position).as_dvec3()));
        bounds.map_or(0.0, |bounds| (bounds.high - bounds.low).length())
    }

    /// A place of the file's space in the own one.
    pub fn place(&self, position: Vec3) -> Vec3 {
        (self.own_from_object * position.as_dvec3()).as_vec3()
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
    rays: OwnRays,
}

/// Rays from a thing's surface against itself, in its own space.
pub(super) struct OwnRays {
    caster: RayCaster,
    offset: f64,
}

impl OwnSurface {
    /// Of a thing's mesh, and the meshes that it is drawn as, in their order.
    pub fn new<'a>(mesh: &Mesh, drawn: impl Iterator<Item = &'a Mesh>, space: &OwnSpace) -> Self {
        let linear = space.own_from_object;
        let normal_matrix = linear.inverse().transpose();
        let mut corners: Vec<(Vec3, Vec3)> = Vec::new();
        for level in drawn {
            for (triangle, normals) in level.triangles.iter().zip(&level.corner_normals) {
                corners.extend(triangle.iter().zip(normals).map(|(&index, normal)| {
                    let normal = (normal_matrix * normal.as_dvec3()).normalize_or_zero();
                    (
                        space.place(level.positions[index as usize]),
                        normal.as_vec3(),
                    )
                }));
            }
        }
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3)
            .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
            .collect();
        let rays = OwnRays::new(mesh, space);
        let (points, point_of_corner) = corner_points(&corners, &triangles, &rays.caster);
        Self {
            key: space.key(mesh),
            point_of_corner,
            points,
            rays,
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

    /// The same, as long as `goes_on` says yes, which is told how many points are done; `None` where it said no.
    pub fn self_occlusions_while(
        &self,
        goes_on: &(dyn Fn(usize) -> bool + Sync),
    ) -> Option<Vec<SelfOcclusion>> {
        let rays = directions(RAYS);
        let done = AtomicUsize::new(0);
        let of_chunk = |points: &[(DVec3, DVec3)]| {
            let before = done.fetch_add(points.len(), Ordering::Relaxed);
            goes_on(before).then(|| self.of_points(points, &rays))
        };
        let chunks = self.points.par_chunks(CHUNK).map(of_chunk);
        let chunks: Option<Vec<Vec<SelfOcclusion>>> = chunks.collect();
        Some(chunks?.into_iter().flatten().collect())
    }

    /// The same by another number of rays from each point, half of them above its surface.
    pub fn self_occlusions_by(&self, ray_count: usize) -> Vec<SelfOcclusion> {
        let rays = directions(ray_count);
        let chunks = self.points.par_chunks(CHUNK);
        chunks
            .flat_map_iter(|points| self.of_points(points, &rays))
            .collect()
    }

    fn of_points(
        &self,
        points: &[(DVec3, DVec3)],
        rays: &[(DVec3, Vec<f64>)],
    ) -> Vec<SelfOcclusion> {
        let of_point = |&(place, normal): &(DVec3, DVec3)| self.rays.occlusion(place, normal, rays);
        points.iter().map(of_point).collect()
    }
}

/// So many directions, each with its harmonics.
pub(super) fn directions(count: usize) -> Vec<(DVec3, Vec<f64>)> {
    let directions = sphere(count);
    directions
        .map(|direction| (direction, basis(direction, TRANSFER_DEGREE)))
        .collect()
}

impl OwnRays {
    /// Of a thing's mesh.
    pub fn new(mesh: &Mesh, space: &OwnSpace) -> Self {
        let place = |index: u32| space.place(mesh.positions[index as usize]);
        let triangles = mesh.triangles.iter().map(|triangle| triangle.map(place));
        let own: Vec<[Vec3; 3]> = triangles.collect();
        Self {
            caster: RayCaster::new(&own),
            offset: space.size(mesh) * START_OFFSET,
        }
    }

    /// Whether a place with a unit normal lies in a solid; `is_turned`: its triangle is wound the other way around the normal.
    pub fn is_buried(&self, place: DVec3, normal: DVec3, is_turned: bool) -> bool {
        is_buried(
            &self.caster,
            place + normal * self.offset,
            normal,
            is_turned,
        )
    }

    /// The self-occlusion of a place with a unit normal, by rays in directions with their harmonics.
    pub fn occlusion(
        &self,
        place: DVec3,
        normal: DVec3,
        rays: &[(DVec3, Vec<f64>)],
    ) -> SelfOcclusion {
        let start = (place + normal * self.offset).as_vec3();
        occlusion(start, normal, rays, &self.caster)
    }
}

/// The transfer of a unit normal above which all is open.
pub fn open_transfer(normal: DVec3) -> [f64; TRANSFERS] {
    let mut transfer = [0.0; TRANSFERS];
    let values = basis(normal, TRANSFER_DEGREE);
    for l in 0..=TRANSFER_DEGREE {
        let band = l * l..(l + 1) * (l + 1);
        for (sum, value) in transfer[band.clone()].iter_mut().zip(&values[band]) {
            *sum = cosine_lobe(l) * value;
        }
    }
    transfer
}

/// What nothing hides, less what the thing does: so the error of the rays is in the hidden part alone.
fn occlusion(
    start: Vec3,
    normal: DVec3,
    rays: &[(DVec3, Vec<f64>)],
    caster: &RayCaster,
) -> SelfOcclusion {
    let mut transfer = open_transfer(normal);
    let mut visibility = [0.0; VISIBILITIES];
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
    /// Irradiance of the corner from radiance whose coefficients are in the same space (Tamura et al. 2005, equation 2), with what
    /// they do not tell of an open corner's; never negative, which a sum of few harmonics may be.
    pub fn irradiance(&self, radiance: &[DVec3; TRANSFERS], beyond_harmonics: Vec3) -> Vec3 {
        let parts = self.transfer.iter().zip(radiance);
        let sum: DVec3 = parts
            .map(|(&part, &radiance)| radiance * f64::from(part))
            .sum();
        (sum.as_vec3() + beyond_harmonics * self.open_part()).max(Vec3::ZERO)
    }

    /// The part of light from everywhere that arrives.
    fn open_part(&self) -> f32 {
        // (All of it: the cosine lobe's degree 0 times the harmonic of that.)
        let all = cosine_lobe(0) / (4.0 * PI).sqrt();
        (self.transfer[0] / all as f32).clamp(0.0, 1.0)
    }
}
