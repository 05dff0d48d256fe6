//! The light that a thing's surface gets from what stands around it, in place of the light from afar behind that, as rays find it
//! at some places of the surface. The paper has distant light alone; on a table half of all that arrives is thrown back by it.

use std::f32::consts::PI;

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use crate::light::irradiance_records::IrradianceRecords;
use crate::shafts::casters::COARSE_PART;
use crate::shafts::light_of_room::hemisphere;

use super::placed::{Among, PlacedScene, PlacedThing};
use super::reflected::DiscTree;

/// Places start this part of the way to their thing's middle, along the surface: a foot on the table would see below it.
const INSET: f32 = 0.02;
/// Rays from each place at least, and at most.
const RAYS_OF_A_PLACE: [usize; 2] = [32, 256];

/// How many rays there are for a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Budget {
    /// Places on its surface, hardly more than these.
    pub places: usize,
    /// From all of them together, about.
    pub rays: usize,
}

impl Budget {
    /// Where nothing moves by itself.
    pub const STANDING: Self = Self {
        places: 1024,
        rays: 49_152,
    };
    /// Where it is worked out in each frame.
    pub const MOVING: Self = Self {
        places: 256,
        rays: 8192,
    };
}

/// Irradiance of a place.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Around {
    /// Of what things reflect.
    pub reflected: Vec3,
    /// Of a virtual thing: of the light from afar that what casts no shadow keeps from it.
    pub kept_off: Vec3,
    /// Of a phantom: of what is reflected that virtual things take.
    pub taken: Vec3,
}

/// What reaches points of thing `own` (its place among `scene.things`) that `records` are of, in a space of pose
/// `world_from_points`.
///
/// What casts no shadow, as the table, stands in place of the light behind it. What casts some adds what it reflects; what it
/// hides is drawn in maps, by the pixel, and what the thing itself hides is known corner by corner. A phantom gets what casts no
/// shadow reflects alone, for all the rest of its light is summed up by the pixel.
pub fn around(
    scene: &PlacedScene<'_>,
    discs: &DiscTree,
    own: usize,
    (records, world_from_points): (&IrradianceRecords, &DAffine3),
    budget: Budget,
) -> Vec<Around> {
    let [fewest, most] = RAYS_OF_A_PLACE;
    let rays = (budget.rays / records.places.len().max(1)).clamp(fewest, most);
    let bounds = scene.things[own].bounds();
    let middle = (0.5 * (bounds.low + bounds.high)).as_vec3();
    let offset_m = (COARSE_PART * (bounds.high - bounds.low).length()) as f32;
    let at_place = |&(place, normal): &(DVec3, DVec3)| {
        let place = world_from_points.transform_point3(place).as_vec3();
        let normal = world_from_points.transform_vector3(normal).as_vec3();
        let normal = normal.normalize_or_zero();
        let inwards = (middle - place).reject_from_normalized(normal);
        // What was sunk into a table gets the light of where it comes out of it: nobody sees it below.
        let is_table = |placed: &PlacedThing<'_>| placed.thing.is_real && !placed.thing.casts;
        let table = scene.seen_within(place, inwards, 1.0 - INSET, is_table);
        let out = table.map_or(0.0, |seen| seen.distance);
        let start = place + (out + INSET) * inwards + normal * offset_m;
        around_place(scene, discs, own, (start, normal), rays)
    };
    let at_records: Vec<Around> = records.places.par_iter().map(at_place).collect();
    let at_points = |of: fn(&Around) -> Vec3| {
        let values: Vec<Vec3> = at_records.iter().map(of).collect();
        records.at_points(&values)
    };
    let reflected = at_points(|around| around.reflected).into_iter();
    let kept_off = at_points(|around| around.kept_off);
    let taken = at_points(|around| around.taken);
    let all = reflected.zip(kept_off).zip(taken);
    all.map(|((reflected, kept_off), taken)| Around {
        reflected,
        kept_off,
        taken,
    })
    .collect()
}

fn around_place(
    scene: &PlacedScene<'_>,
    discs: &DiscTree,
    own: usize,
    (start, normal): (Vec3, Vec3),
    rays: usize,
) -> Around {
    let is_real = scene.things[own].thing.is_real;
    let own = scene.things[own].number;
    let counts = |placed: &PlacedThing<'_>| !is_real || !placed.thing.casts && placed.number != own;
    let weight = PI / rays.max(1) as f32;
    let mut around = Around::default();
    for (number, direction) in hemisphere(normal, rays).enumerate() {
        let Some(seen) = scene.seen(start, direction, counts) else {
            continue;
        };
        let reflected = |among: Among| {
            let of_lights = scene.radiance(among, &seen, number);
            (of_lights + discs.passed_on(scene, among, &seen)) * weight
        };
        if is_real {
            let without = reflected(Among::Real);
            let hides = |placed: &PlacedThing<'_>| !placed.thing.is_real;
            let with = match scene.is_hidden_by(hides, start, direction, seen.distance) {
                true => Vec3::ZERO,
                false => reflected(Among::All),
            };
            around.reflected += without;
            around.taken += without - with;
            continue;
        }
        around.reflected += reflected(Among::All);
        if !scene.things[seen.thing].thing.casts {
            around.kept_off += scene.distant.coarse.radiance(direction.as_dvec3()) * weight;
        }
    }
    around
}
