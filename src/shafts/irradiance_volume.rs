//! The light around where virtual things may be (Greger et al. 1998, Gibson et al. 2003, section 9): radiance in spherical
//! harmonics on a grid, real occluders included.

use std::f32::consts::PI;

use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;

use super::bounding::Aabb;
use super::harmonics::{Radiance9, sphere};
use super::patches::RoomPatches;

/// Rays from each point of the grid.
const RAYS: usize = 1024;
/// Points of the grid along one axis at most.
const MOST_POINTS: u32 = 16;
/// Part of the rays that may meet backs of patches; a point where more do lies within something.
const MOST_BACKS: f32 = 0.25;

/// The grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IrradianceVolume {
    bounds: Aabb,
    points: UVec3,
    /// x fastest; `None` within things.
    radiance: Vec<Option<Radiance9>>,
}

impl IrradianceVolume {
    /// Gathers light in a box at points about `spacing_m` apart; `caster` holds the patches' triangles, which send out
    /// `radiance`.
    pub fn new(
        bounds: Aabb,
        spacing_m: f32,
        patches: &RoomPatches,
        caster: &RayCaster,
        radiance: &[Vec3],
    ) -> Self {
        let points = ((bounds.max - bounds.min) / spacing_m).ceil().as_uvec3() + 1;
        let points = points.clamp(UVec3::splat(2), UVec3::splat(MOST_POINTS));
        let mut volume = Self {
            bounds,
            points,
            radiance: Vec::new(),
        };
        volume.radiance = (0..points.element_product())
            .into_par_iter()
            .map(|index| gathered(volume.point(index), patches, caster, radiance))
            .collect();
        volume
    }

    fn point(&self, index: u32) -> Vec3 {
        let place = UVec3::new(
            index % self.points.x,
            index / self.points.x % self.points.y,
            index / (self.points.x * self.points.y),
        );
        self.bounds.min
            + (self.bounds.max - self.bounds.min) * place.as_vec3() / (self.points - 1).as_vec3()
    }

    /// Whether all of a box lies within.
    pub fn holds(&self, bounds: &Aabb) -> bool {
        let holds = |corner: Vec3| {
            self.bounds.min.cmple(corner).all() && self.bounds.max.cmpge(corner).all()
        };
        holds(bounds.min) && holds(bounds.max)
    }

    /// Radiance around a place, between the points of the grid; beyond it that of its edge.
    pub fn radiance(&self, place: Vec3) -> Radiance9 {
        let size = (self.bounds.max - self.bounds.min).max(Vec3::splat(1e-6));
        let cells = (self.points - 1).as_vec3();
        let at = ((place - self.bounds.min) / size * cells).clamp(Vec3::ZERO, cells);
        let low = at.floor().min(cells - 1.0).max(Vec3::ZERO);
        let part = at - low;
        let mut sum = Radiance9::default();
        let mut weight = 0.0;
        for corner in 0..8_u32 {
            let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let place = low.as_uvec3() + step;
            let index = (place.z * self.points.y + place.y) * self.points.x + place.x;
            let share: f32 = (0..3)
                .map(|axis| match step[axis] {
                    0 => 1.0 - part[axis],
                    _ => part[axis],
                })
                .product();
            if let Some(radiance) = &self.radiance[index as usize] {
                sum.add_scaled(radiance, share.max(1e-6));
                weight += share.max(1e-6);
            }
        }
        let mut mean = Radiance9::default();
        if weight > 0.0 {
            mean.add_scaled(&sum, weight.recip());
        }
        mean
    }
}

fn gathered(
    point: Vec3,
    patches: &RoomPatches,
    caster: &RayCaster,
    radiance: &[Vec3],
) -> Option<Radiance9> {
    let share = 4.0 * PI / RAYS as f32;
    let mut sum = Radiance9::default();
    let mut backs = 0;
    for direction in sphere(RAYS) {
        let Some(hit) = caster.first_hit(point, direction, f32::INFINITY) else {
            continue;
        };
        let patch = &patches.patches[hit.triangle];
        if patches.normal(patch).dot(direction) > 0.0 {
            backs += 1;
        } else {
            sum.add(direction, radiance[hit.triangle] * share);
        }
    }
    (backs as f32 <= MOST_BACKS * RAYS as f32).then_some(sum)
}
