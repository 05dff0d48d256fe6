//! The light around where virtual things may be (Greger et al. 1998, Gibson et al. 2003, section 9): radiance in spherical
//! harmonics on a grid, real occluders included; of bright patches what each point sees of them, for a lamp lights a ball with a
//! terminator that few harmonics have not.

use std::f32::consts::PI;

use glam::{UVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;

use super::bounding::Aabb;
use super::bright_patches::BrightPatches;
use super::patches::RoomPatches;
use crate::light::radiance9::{Radiance9, sphere};

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
    bright: BrightPatches,
    /// x fastest; `None` within things.
    gathered: Vec<Option<Gathered>>,
}

/// The light at a point.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Gathered {
    /// Of all but the bright patches.
    rest: Radiance9,
    /// The part that is seen of each bright patch.
    seen: Vec<f32>,
}

impl IrradianceVolume {
    /// Gathers light in a box at points about `spacing_m` apart; `caster` holds the patches' triangles, which send out
    /// `radiance`, the `bright` ones among them.
    pub fn new(
        bounds: Aabb,
        spacing_m: f32,
        patches: &RoomPatches,
        caster: &RayCaster,
        radiance: &[Vec3],
        bright: BrightPatches,
    ) -> Self {
        let points = ((bounds.max - bounds.min) / spacing_m).ceil().as_uvec3() + 1;
        let points = points.clamp(UVec3::splat(2), UVec3::splat(MOST_POINTS));
        let mut volume = Self {
            bounds,
            points,
            bright,
            gathered: Vec::new(),
        };
        volume.gathered = (0..points.element_product())
            .into_par_iter()
            .map(|index| {
                gathered(
                    volume.point(index),
                    patches,
                    caster,
                    radiance,
                    &volume.bright,
                )
            })
            .collect();
        volume
    }

    /// The patches that are told from the others.
    pub fn bright(&self) -> &BrightPatches {
        &self.bright
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

    /// Irradiance of a place with a unit normal, between the points of the grid; beyond it the light of its edge.
    pub fn irradiance(&self, place: Vec3, normal: Vec3) -> Vec3 {
        let around = self.around(place);
        let whole: f32 = around.iter().map(|(_, share)| share).sum();
        if whole <= 0.0 {
            return Vec3::ZERO;
        }
        let mut rest = Radiance9::default();
        for (gathered, share) in &around {
            rest.add_scaled(&gathered.rest, share / whole);
        }
        let mut sent = Vec3::ZERO;
        for (index, bright) in self.bright.patches.iter().enumerate() {
            let seen: f32 = around
                .iter()
                .map(|(gathered, share)| gathered.seen[index] * share)
                .sum();
            if seen > 0.0 {
                sent += bright.radiance * (bright.form_factor(place, normal) * seen / whole);
            }
        }
        rest.irradiance(normal) + sent * PI
    }

    /// The points of the grid around a place, as far as they lie in no thing, and what each of them counts.
    fn around(&self, place: Vec3) -> Vec<(&Gathered, f32)> {
        let size = (self.bounds.max - self.bounds.min).max(Vec3::splat(1e-6));
        let cells = (self.points - 1).as_vec3();
        let at = ((place - self.bounds.min) / size * cells).clamp(Vec3::ZERO, cells);
        let low = at.floor().min(cells - 1.0).max(Vec3::ZERO);
        let part = at - low;
        let corner = |corner: u32| {
            let step = UVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let place = low.as_uvec3() + step;
            let index = (place.z * self.points.y + place.y) * self.points.x + place.x;
            let share: f32 = (0..3)
                .map(|axis| match step[axis] {
                    0 => 1.0 - part[axis],
                    _ => part[axis],
                })
                .product();
            let gathered = self.gathered[index as usize].as_ref()?;
            Some((gathered, share.max(1e-6)))
        };
        (0..8).filter_map(corner).collect()
    }
}

fn gathered(
    point: Vec3,
    patches: &RoomPatches,
    caster: &RayCaster,
    radiance: &[Vec3],
    bright: &BrightPatches,
) -> Option<Gathered> {
    let share = 4.0 * PI / RAYS as f32;
    let mut rest = Radiance9::default();
    let mut backs = 0;
    for direction in sphere(RAYS) {
        let Some(hit) = caster.first_hit(point, direction, f32::INFINITY) else {
            continue;
        };
        let patch = &patches.patches[hit.triangle];
        if patches.normal(patch).dot(direction) > 0.0 {
            backs += 1;
        } else if !bright.has(hit.triangle) {
            rest.add(direction, radiance[hit.triangle] * share);
        }
    }
    (backs as f32 <= MOST_BACKS * RAYS as f32).then(|| Gathered {
        rest,
        seen: bright.seen_from(point, caster),
    })
}
