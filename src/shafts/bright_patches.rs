//! The patches that outshine the others. Rays to all sides would meet a small one by chance, or not at all, so what they
//! send is worked out patch by patch: form factor times visibility.

use std::f32::consts::PI;

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::geometry::ray_caster::RayCaster;

use super::form_factor::form_factor;
use super::luminance;
use super::patches::RoomPatches;
use super::points::points_on;

/// A patch is bright from so many times the mean radiance of all directions.
const STANDS_OUT: f32 = 4.0;
/// Rays to all of them that tell how much of each is seen, about, ...
const RAYS: usize = 1024;
/// ... and to one at most.
const MOST_RAYS: usize = 4;
/// Patches of less area over squared distance have the form factor of their middle.
const SMALL: f32 = 3e-3;
/// Part of the way to a bright patch within which something hides it.
const REACH: f32 = 1.0 - 1e-4;

/// A bright patch.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct BrightPatch {
    /// Its index.
    pub patch: u32,
    /// Its light.
    pub radiance: Vec3,
    corners: [Vec3; 3],
    center: Vec3,
    /// Unit normal times area.
    area: Vec3,
}

impl BrightPatch {
    /// Part of the cosine-weighted hemisphere over a place that it covers, nothing between them.
    pub fn form_factor(&self, place: Vec3, normal: Vec3) -> f32 {
        let way = self.center - place;
        let squared = way.length_squared();
        let facing = -self.area.dot(way);
        if facing <= 0.0 {
            return 0.0;
        }
        match self.area.length_squared() < (SMALL * squared).powi(2) {
            true => normal.dot(way).max(0.0) * facing / (PI * squared * squared),
            false => form_factor(place, normal, self.corners),
        }
    }

    /// Part of it that a place sees, by so many rays.
    fn seen_from(&self, place: Vec3, rays: usize, caster: &RayCaster) -> f32 {
        if self.area.dot(place - self.center) <= 0.0 {
            return 0.0;
        }
        let seen = points_on(self.corners, rays)
            .filter(|point| !caster.is_hidden(place, *point - place, REACH))
            .count();
        seen as f32 / rays as f32
    }
}

/// Those of a room.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct BrightPatches {
    /// The brightest first.
    pub patches: Vec<BrightPatch>,
    /// For each patch of the room whether it is among them.
    is_bright: Vec<bool>,
}

impl BrightPatches {
    /// Of a room whose patches send out `radiance`, where the mean of all directions is `mean` (luminance).
    pub fn new(room: &RoomPatches, radiance: &[Vec3], mean: f32) -> Self {
        let mut order: Vec<usize> = (0..radiance.len())
            .filter(|&patch| luminance(radiance[patch]) > STANDS_OUT * mean)
            .collect();
        order.sort_by(|&one, &other| {
            luminance(radiance[other]).total_cmp(&luminance(radiance[one]))
        });
        let mut is_bright = vec![false; radiance.len()];
        for &patch in &order {
            is_bright[patch] = true;
        }
        let bright = |index: usize| {
            let patch = &room.patches[index];
            BrightPatch {
                patch: index as u32,
                radiance: radiance[index],
                corners: room.corners(patch),
                center: room.center(patch),
                area: room.normal(patch) * room.area(patch),
            }
        };
        Self {
            patches: order.into_iter().map(bright).collect(),
            is_bright,
        }
    }

    /// Whether a patch is among them.
    pub fn has(&self, patch: usize) -> bool {
        self.is_bright[patch]
    }

    /// The part of each that a place sees.
    pub fn seen_from(&self, place: Vec3, caster: &RayCaster) -> Vec<f32> {
        let rays = self.rays();
        let patches = self.patches.iter();
        patches
            .map(|bright| bright.seen_from(place, rays, caster))
            .collect()
    }

    fn rays(&self) -> usize {
        (RAYS / self.patches.len().max(1)).clamp(1, MOST_RAYS)
    }

    /// Irradiance that they give to a place with a unit normal past what hides them.
    pub fn irradiance(&self, place: Vec3, normal: Vec3, caster: &RayCaster) -> Vec3 {
        let rays = self.rays();
        let sent = |bright: &BrightPatch| {
            let part = bright.form_factor(place, normal);
            match part > 0.0 {
                true => bright.radiance * (part * bright.seen_from(place, rays, caster)),
                false => Vec3::ZERO,
            }
        };
        self.patches.iter().map(sent).sum::<Vec3>() * PI
    }
}
