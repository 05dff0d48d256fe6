//! The radiance that patches send out (Gibson et al. 2003, section 3): what the probe saw of them, carried outward to
//! where it came from. What it did not see is taken from what it saw of the same thing close by, or else from the light
//! that falls there.

use std::f32::consts::{PI, TAU};

use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;
use crate::light::{Light, irradiance};

use super::bright_patches::BrightPatches;
use super::carried_light::{Carried, carried_light};
use super::luminance;
use super::patches::{RoomPatch, RoomPatches};
use super::placed_probe::PlacedProbe;
use super::points::points_on;
use super::solid_angle::solid_angle;

/// Points of a patch that are looked for from the probe.
const SAMPLES: usize = 16;
/// Rays of the probe that tell the light of a patch better than those points do.
const ENOUGH_RAYS: u32 = 4;
/// Rays that tell the light of a patch of which next to nothing is seen.
const MANY_RAYS: u32 = 16;
/// From so many times the mean radiance on a patch's light is spread over all of its solid angle, however its rays fell.
const BRIGHT: f32 = 4.0;
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

/// Light that a patch sends out, and what it reflects.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PatchLight {
    /// Linear RGB.
    pub radiance: Vec3,
    /// Diffuse reflectance: as given, or estimated.
    pub albedo: Vec3,
}

/// Light of every patch; `caster` holds the patches' triangles in their order, and `mean` is the probe's mean luminance.
pub fn light_of_room(
    patches: &RoomPatches,
    caster: &RayCaster,
    placed: &PlacedProbe<'_>,
    compact: &[Light],
    mean: f32,
) -> Vec<PatchLight> {
    let carried = carried_light(patches, caster, placed);
    let seen: Vec<Option<Vec3>> = patches
        .patches
        .par_iter()
        .zip(&carried)
        .map(|(patch, carried)| seen_radiance(patches, patch, carried, caster, placed, mean))
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
        if unknown.is_empty() {
            break;
        }
        let gathered = irradiances(patches, caster, &unknown, &radiance, (compact, mean));
        for (&index, irradiance) in unknown.iter().zip(gathered) {
            let albedo = patches.patches[index]
                .albedo
                .unwrap_or(Vec3::splat(USUAL_ALBEDO));
            radiance[index] = Some(albedo / PI * irradiance);
        }
    }
    let all: Vec<usize> = (0..radiance.len()).collect();
    let irradiances = irradiances(patches, caster, &all, &radiance, (compact, mean));
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

/// Radiance of a patch that sends to the probe what came from there; `None` where the probe sees too little of it, or its
/// back.
fn seen_radiance(
    patches: &RoomPatches,
    patch: &RoomPatch,
    carried: &Carried,
    caster: &RayCaster,
    placed: &PlacedProbe<'_>,
    mean: f32,
) -> Option<Vec3> {
    let origin = placed.position_m.as_vec3();
    if patches.normal(patch).dot(origin - patches.center(patch)) <= 0.0 {
        return None;
    }
    let corners = patches.corners(patch);
    let seen: Vec<Vec3> = points_on(corners, SAMPLES)
        .filter(|&point| placed.sees(caster, point))
        .collect();
    let over =
        |solid_angle_sr: f64| (carried.radiance_solid_angle / solid_angle_sr.max(1e-30)).as_vec3();
    let mean_of_rays = over(carried.solid_angle_sr);
    if seen.len() == SAMPLES {
        // All of it is seen: what came from there is what it sends. Where it is dim the mean of its rays does not tell of how
        // they fell.
        let whole = over(solid_angle(corners.map(|corner| corner - origin)));
        if luminance(whole) > BRIGHT * mean {
            return Some(whole);
        }
    }
    let needed = match seen.len() * 4 >= SAMPLES {
        true => ENOUGH_RAYS,
        false => MANY_RAYS,
    };
    if carried.rays >= needed {
        return Some(mean_of_rays);
    }
    let at_points = || {
        let sum: Vec3 = seen.iter().map(|&point| placed.radiance_of(point)).sum();
        sum / seen.len() as f32
    };
    (seen.len() * 4 >= SAMPLES).then(at_points)
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

/// Irradiance at the centres of some patches from what is known: from bright patches one by one, by rays from the others.
fn irradiances(
    patches: &RoomPatches,
    caster: &RayCaster,
    chosen: &[usize],
    radiance: &[Option<Vec3>],
    (compact, mean): (&[Light], f32),
) -> Vec<Vec3> {
    let radiance: Vec<Vec3> = radiance
        .iter()
        .map(|radiance| radiance.unwrap_or_default())
        .collect();
    let bright = BrightPatches::new(patches, &radiance, mean);
    let gathered = |&index: &usize| {
        let patch = &patches.patches[index];
        let normal = patches.normal(patch);
        let start = patches.center(patch) + normal * START_OFFSET_M;
        let arriving = |direction: Vec3| {
            let hit = caster.first_hit(start, direction, f32::INFINITY)?;
            let sender = &patches.patches[hit.triangle];
            (patches.normal(sender).dot(direction) < 0.0 && !bright.has(hit.triangle))
                .then_some(radiance[hit.triangle])
        };
        hemisphere(normal, RAYS).filter_map(arriving).sum::<Vec3>() * (PI / RAYS as f32)
            + bright.irradiance(start, normal, caster)
            + compact_irradiance(compact, start, normal, |way| {
                caster.is_hidden(start, way, REACH)
            })
    };
    chosen.par_iter().map(gathered).collect()
}

/// Part of the way to a lamp within which something hides it: it may lie on a wall.
pub const REACH: f32 = 1.0 - 1e-3;

/// Irradiance from compact lights of a place with a unit normal, where nothing hides them: `is_hidden` is asked of ways to
/// them, very long ones to those from afar.
pub fn compact_irradiance(
    lights: &[Light],
    place: Vec3,
    normal: Vec3,
    is_hidden: impl Fn(Vec3) -> bool,
) -> Vec3 {
    let arriving = |light: &Light| {
        let given = irradiance(light, place.as_dvec3(), normal.as_dvec3()).as_vec3();
        let way = match *light {
            Light::Point { position_m, .. } => (position_m - place.as_dvec3()).as_vec3(),
            Light::Directional { direction, .. } => direction.as_vec3() * -FAR_M,
        };
        match given != Vec3::ZERO && !is_hidden(way) {
            true => given,
            false => Vec3::ZERO,
        }
    };
    lights.iter().map(arriving).sum()
}

/// Light from infinitely far away is looked for up to here, metres: within what stands for the sky.
const FAR_M: f32 = 100.0;

/// The distance off a surface at which rays start, metres.
pub const START_OFFSET_M: f32 = 2e-5;

/// Directions over a unit normal, spread by the cosine (Malley's method on a golden-angle spiral): the same each time.
pub fn hemisphere(normal: Vec3, count: usize) -> impl Iterator<Item = Vec3> {
    let axes = normal.any_orthonormal_pair();
    (0..count).map(move |index| over_hemisphere(normal, axes, [index, count]))
}

/// One of the directions of [`hemisphere`], by its index and their count; `tangents` are two unit vectors across the normal and
/// each other.
pub fn over_hemisphere(
    normal: Vec3,
    (tangent, bitangent): (Vec3, Vec3),
    [index, count]: [usize; 2],
) -> Vec3 {
    let radius = ((index as f32 + 0.5) / count as f32).sqrt();
    let (sine, cosine) = (TAU * (0.618_034 * index as f32).fract()).sin_cos();
    tangent * (radius * cosine)
        + bitangent * (radius * sine)
        + normal * (1.0 - radius * radius).max(0.0).sqrt()
}
