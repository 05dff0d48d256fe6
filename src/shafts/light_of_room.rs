//! The radiance that patches send out (Gibson et al. 2003, section 3): what the probe saw of them, carried outward to
//! where it came from. What it did not see is taken from what it saw of the same thing close by, or else from the light
//! that falls there.

use std::f32::consts::{PI, TAU};

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;
use crate::light::probe::Probe;

use super::patches::{RoomPatch, RoomPatches};
use super::points::points_on;

/// Points of a patch that are looked for from the probe.
const SAMPLES: usize = 16;
/// Seen patches of the same thing that speak for one that is not.
const NEIGHBOURS: usize = 6;
/// Rays that gather the light of a patch of which nothing is known.
const RAYS: usize = 256;
/// Passes of that: each carries light once more between such patches.
const PASSES: usize = 3;
/// Reflectance of what gives none and whose light tells none.
const USUAL_ALBEDO: f32 = 0.5;
/// Most that paint reflects; what sends out more shines by itself.
const MOST_ALBEDO: f32 = 0.95;

/// A probe, and where it was taken.
#[derive(Clone, Copy)]
pub struct PlacedProbe<'a> {
    /// Radiance by direction.
    pub probe: &'a Probe,
    /// Where it was taken, metres.
    pub position_m: DVec3,
    /// Display white over the probe's unit of radiance.
    pub exposure: f32,
}

impl PlacedProbe<'_> {
    /// Radiance of a place that the probe sees.
    pub fn radiance_of(&self, place: Vec3) -> Vec3 {
        self.probe.radiance(place.as_dvec3() - self.position_m) * self.exposure
    }

    fn sees(&self, caster: &RayCaster, place: Vec3) -> bool {
        let origin = self.position_m.as_vec3();
        !caster.is_hidden(origin, place - origin, 1.0 - 1e-4)
    }
}

/// Light that a patch sends out, and what it reflects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PatchLight {
    /// Linear RGB.
    pub radiance: Vec3,
    /// Diffuse reflectance: as given, or estimated.
    pub albedo: Vec3,
}

/// Light of every patch; `caster` holds the patches' triangles in their order.
pub fn light_of_room(
    patches: &RoomPatches,
    caster: &RayCaster,
    placed: PlacedProbe<'_>,
) -> Vec<PatchLight> {
    let seen: Vec<Option<Vec3>> = patches
        .patches
        .iter()
        .map(|patch| seen_radiance(patches, patch, caster, placed))
        .collect();
    let mut radiance: Vec<Option<Vec3>> = patches
        .patches
        .iter()
        .zip(&seen)
        .map(|(patch, seen_here)| seen_here.or_else(|| of_neighbours(patches, patch, &seen)))
        .collect();
    let unknown: Vec<usize> = (0..radiance.len())
        .filter(|&index| radiance[index].is_none())
        .collect();
    for _ in 0..PASSES {
        let gathered = irradiances(patches, caster, &unknown, &radiance);
        for (&index, irradiance) in unknown.iter().zip(gathered) {
            let albedo = patches.patches[index]
                .albedo
                .unwrap_or(Vec3::splat(USUAL_ALBEDO));
            radiance[index] = Some(albedo / PI * irradiance);
        }
        if unknown.is_empty() {
            break;
        }
    }
    let all: Vec<usize> = (0..radiance.len()).collect();
    let irradiances = irradiances(patches, caster, &all, &radiance);
    let light = |((patch, radiance), irradiance): ((&RoomPatch, &Option<Vec3>), Vec3)| {
        let radiance = radiance.unwrap_or(Vec3::ZERO);
        let reflected = radiance * PI / irradiance.max(Vec3::splat(1e-9));
        let shines = reflected.max_element() > MOST_ALBEDO;
        let estimate = if shines { Vec3::ZERO } else { reflected };
        PatchLight {
            radiance,
            albedo: patch.albedo.unwrap_or(estimate),
        }
    };
    let known = patches.patches.iter().zip(&radiance);
    known.zip(irradiances).map(light).collect()
}

/// Mean of what the probe sees of a patch; `None` where it sees less than a quarter of it, or its back.
fn seen_radiance(
    patches: &RoomPatches,
    patch: &RoomPatch,
    caster: &RayCaster,
    placed: PlacedProbe<'_>,
) -> Option<Vec3> {
    let to_probe = placed.position_m.as_vec3() - patches.center(patch);
    if patches.normal(patch).dot(to_probe) <= 0.0 {
        return None;
    }
    let seen: Vec<Vec3> = points_on(patches.corners(patch), SAMPLES)
        .filter(|&point| placed.sees(caster, point))
        .map(|point| placed.radiance_of(point))
        .collect();
    (seen.len() * 4 >= SAMPLES).then(|| seen.iter().sum::<Vec3>() / seen.len() as f32)
}

/// Mean of the nearest seen patches of the same thing that face the same way, the nearer ones weighing more.
fn of_neighbours(patches: &RoomPatches, patch: &RoomPatch, seen: &[Option<Vec3>]) -> Option<Vec3> {
    let (center, normal) = (patches.center(patch), patches.normal(patch));
    let mut near: Vec<(f32, Vec3)> = patches
        .patches
        .iter()
        .zip(seen)
        .filter(|(other, _)| other.piece == patch.piece && patches.normal(other).dot(normal) > 0.9)
        .filter_map(|(other, seen)| {
            Some((patches.center(other).distance_squared(center), (*seen)?))
        })
        .collect();
    near.sort_by(|one, other| one.0.total_cmp(&other.0));
    near.truncate(NEIGHBOURS);
    let weight: f32 = near.iter().map(|(distance, _)| distance.recip()).sum();
    let sum: Vec3 = near.iter().map(|(distance, seen)| *seen / *distance).sum();
    (!near.is_empty()).then(|| sum / weight)
}

/// Irradiance at the centres of some patches, by rays to what is known.
fn irradiances(
    patches: &RoomPatches,
    caster: &RayCaster,
    chosen: &[usize],
    radiance: &[Option<Vec3>],
) -> Vec<Vec3> {
    let irradiance = |&index: &usize| {
        let patch = &patches.patches[index];
        let normal = patches.normal(patch);
        let start = patches.center(patch) + normal * START_OFFSET_M;
        let arriving = |direction: Vec3| {
            let hit = caster.first_hit(start, direction, f32::INFINITY)?;
            let sender = &patches.patches[hit.triangle];
            (patches.normal(sender).dot(direction) < 0.0)
                .then_some(radiance[hit.triangle].unwrap_or(Vec3::ZERO))
        };
        hemisphere(normal, RAYS).filter_map(arriving).sum::<Vec3>() * (PI / RAYS as f32)
    };
    chosen.par_iter().map(irradiance).collect()
}

/// The distance off a surface at which rays start, metres.
pub const START_OFFSET_M: f32 = 2e-5;

/// Directions over a unit normal, spread by the cosine (Malley's method on a golden-angle spiral): the same each time.
pub fn hemisphere(normal: Vec3, count: usize) -> impl Iterator<Item = Vec3> {
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    (0..count).map(move |index| {
        let radius = ((index as f32 + 0.5) / count as f32).sqrt();
        let (sine, cosine) = (TAU * (0.618_034 * index as f32).fract()).sin_cos();
        tangent * (radius * cosine)
            + bitangent * (radius * sine)
            + normal * (1.0 - radius * radius).max(0.0).sqrt()
    })
}
