//! The light around a thing: what comes from afar, with what stands around it in its place, as harmonics at the corners of a
//! box. The paper has distant light alone; on a table half of all that arrives is thrown back by it.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::light::harmonics::{Turn, basis, sphere};

use super::placed::{Among, PlacedScene, PlacedThing};
use super::self_occlusion::{TRANSFER_DEGREE, TRANSFERS};

/// Rays from each corner of the box.
const RAYS: usize = 256;
/// How far the corners lie within the thing's own box, in parts of its size: those of what stands on a table are above it.
const INSET: f64 = 0.1;

/// Coefficients of radiance.
pub type Radiance = [DVec3; TRANSFERS];

/// Radiance around a thing.
#[derive(Debug, Clone)]
pub struct LocalLight {
    low: DVec3,
    size: DVec3,
    /// x first, then y, then z.
    corners: [Radiance; 8],
}

impl LocalLight {
    /// In world space, around a box in which thing `own` is (its place among `scene.things`): that hides nothing here, for
    /// what it hides from itself is known corner by corner.
    ///
    /// What casts no shadow, as the table, stands in place of the light behind it. What casts some adds what it reflects;
    /// what it hides is drawn in maps, by the pixel. Around a phantom there is only what others reflect, for all the rest of
    /// its light is summed up by the pixel.
    pub fn new(scene: &PlacedScene<'_>, bounds: Bounds, own: usize) -> Self {
        let size = bounds.high - bounds.low;
        let (low, size) = (bounds.low + size * INSET, size * (1.0 - 2.0 * INSET));
        let mut corners = [[DVec3::ZERO; TRANSFERS]; 8];
        corners
            .par_iter_mut()
            .enumerate()
            .for_each(|(index, corner)| {
                let part = |bit: usize| (index >> bit & 1) as f64;
                let place = low + size * DVec3::new(part(0), part(1), part(2));
                *corner = radiance_at(scene, place.as_vec3(), own);
            });
        Self { low, size, corners }
    }

    /// The same in directions of an anchor, which `turn` makes of the world's; places stay those of the world.
    pub fn turned(&self, turn: &Turn) -> Self {
        Self {
            corners: self.corners.map(|corner| turn.turned(&corner)),
            ..*self
        }
    }

    /// At a place in the world, between the corners of the box.
    pub fn at(&self, place: DVec3) -> Radiance {
        let part = (place - self.low) / self.size.max(DVec3::splat(1e-9));
        let part = part.clamp(DVec3::ZERO, DVec3::ONE);
        let mut sums = [DVec3::ZERO; TRANSFERS];
        for (index, corner) in self.corners.iter().enumerate() {
            let along = |bit: usize, part: f64| match index >> bit & 1 {
                0 => 1.0 - part,
                _ => part,
            };
            let weight = along(0, part.x) * along(1, part.y) * along(2, part.z);
            for (sum, radiance) in sums.iter_mut().zip(corner) {
                *sum += *radiance * weight;
            }
        }
        sums
    }
}

fn radiance_at(scene: &PlacedScene<'_>, place: Vec3, own: usize) -> Radiance {
    let number_of_own = scene.things[own].number;
    let own = scene.things[own].thing;
    let mut sums = [DVec3::ZERO; TRANSFERS];
    if !own.is_real {
        sums.copy_from_slice(&scene.distant.harmonics);
    }
    let among = match own.is_real {
        true => Among::Real,
        false => Among::All,
    };
    let weight = 4.0 * PI / RAYS as f64;
    for (number, direction) in sphere(RAYS).enumerate() {
        // What casters reflect on to real things is added by the pixel.
        let counts = |placed: &PlacedThing<'_>| {
            placed.number != number_of_own && !(placed.thing.casts && own.is_real)
        };
        let Some(seen) = scene.seen(place, direction.as_vec3(), counts) else {
            continue;
        };
        let values = basis(direction, TRANSFER_DEGREE);
        let mut added = scene.radiance(among, &seen, number).as_dvec3();
        if !own.is_real && !scene.things[seen.thing].thing.casts {
            let parts = scene.distant.harmonics.iter().zip(&values);
            let behind: DVec3 = parts.map(|(&part, &value)| part * value).sum();
            added -= behind.max(DVec3::ZERO);
        }
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += added * (weight * value);
        }
    }
    sums
}
