//! What things reflect on to others (one bounce), as discs on their surfaces and groups of these: virtual things on to real ones,
//! and real ones on to each other, with and without virtual things in the way of the light.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use rayon::prelude::*;

use crate::shafts::light_of_room::hemisphere;
use crate::shafts::surfels::{Surfel, from_disc, open_directions};

use super::placed::{Among, OFFSET_M, PlacedScene, PlacedThing};

/// Neighbours in a group.
pub const GROUP: usize = 8;
/// Rays that gather what others reflect on to a disc.
const RAYS: usize = 32;
/// A group is seen as one disc from so many of its radii; environment.wgsl has the same number.
const SEEN_AS_ONE: f32 = 5.0;

/// A disc that reflects light on to real surfaces.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReflectingDisc {
    /// In the world.
    pub surfel: Surfel,
    /// A bit for each cell of the octahedron's map of directions in which its thing does not hide it.
    pub open: u64,
    /// Radiance without virtual things; none where it is virtual.
    pub without: Vec3,
    /// Radiance with them.
    pub with: Vec3,
}

/// Neighbours, and a disc that stands for all of them where they are seen from afar.
#[derive(Debug, Clone, PartialEq)]
pub struct DiscGroup {
    /// All as one.
    pub whole: ReflectingDisc,
    /// Around its middle.
    pub radius: f32,
    /// Up to [`GROUP`] of them.
    pub discs: Vec<ReflectingDisc>,
    /// What they are on, its place among the scene's things.
    pub thing: usize,
}

impl PlacedScene<'_> {
    /// What casting things reflect of all light that reaches them, one bounce of it from others among it.
    pub fn reflecting(&self) -> Vec<DiscGroup> {
        let of_thing = |(thing, placed): (usize, &PlacedThing<'_>)| {
            let surfels = placed.thing.surfels.par_iter();
            let discs: Vec<ReflectingDisc> = surfels.map(|surfel| self.lit(placed, surfel)).collect();
            let groups = discs.chunks(GROUP);
            groups.map(|discs| DiscGroup::new(discs, thing)).collect::<Vec<_>>()
        };
        self.things.iter().enumerate().flat_map(of_thing).collect()
    }

    fn lit(&self, placed: &PlacedThing<'_>, surfel: &Surfel) -> ReflectingDisc {
        let surfel = Surfel {
            position: placed.world_from_anchor.transform_point3(surfel.position),
            normal: placed.world_from_anchor.transform_vector3(surfel.normal),
            ..*surfel
        };
        let start = surfel.position + surfel.normal * OFFSET_M;
        let radiance = |among: Among| {
            let thrown_back = |(number, direction): (usize, Vec3)| {
                let counts = |thing: &super::thing::Thing| among == Among::All || thing.is_real;
                let seen = self.seen(start, direction, counts)?;
                Some(self.radiance(among, &seen, number))
            };
            let directions = hemisphere(surfel.normal, RAYS).enumerate();
            let thrown_back: Vec3 = directions.filter_map(thrown_back).sum();
            let arriving = self.irradiance(among, surfel.position, surfel.normal)
                + thrown_back * (PI / RAYS as f32);
            surfel.albedo * arriving * FRAC_1_PI
        };
        let with = radiance(Among::All);
        ReflectingDisc {
            surfel,
            open: open_directions(&surfel, |start, direction| {
                placed.hides(start, direction, f32::INFINITY)
            }),
            without: match placed.thing.is_real {
                true => radiance(Among::Real),
                false => Vec3::ZERO,
            },
            with,
        }
    }
}

impl DiscGroup {
    fn new(discs: &[ReflectingDisc], thing: usize) -> Self {
        let area: f32 = discs.iter().map(|disc| disc.surfel.area).sum();
        let mean = |of: &dyn Fn(&ReflectingDisc) -> Vec3| {
            let sum: Vec3 = discs.iter().map(|disc| of(disc) * disc.surfel.area).sum();
            sum / area.max(f32::MIN_POSITIVE)
        };
        let position = mean(&|disc| disc.surfel.position);
        let normal = mean(&|disc| disc.surfel.normal);
        let farthest = discs
            .iter()
            .map(|disc| disc.surfel.position.distance(position))
            .fold(0.0, f32::max);
        Self {
            whole: ReflectingDisc {
                surfel: Surfel {
                    position,
                    normal: normal.normalize_or_zero(),
                    // Discs that look apart show less of themselves.
                    area: area * normal.length(),
                    albedo: mean(&|disc| disc.surfel.albedo),
                },
                open: discs.iter().fold(0, |open, disc| open | disc.open),
                without: mean(&|disc| disc.without),
                with: mean(&|disc| disc.with),
            },
            radius: farthest + (area / discs.len().max(1) as f32 / PI).sqrt(),
            discs: discs.to_vec(),
            thing,
        }
    }

    /// Irradiance, with virtual things there, of a place on the thing itself: from the discs that it faces and that face it, as those of
    /// a hollow do.
    pub fn irradiance(&self, place: Vec3, normal: Vec3) -> Vec3 {
        let distance = place.distance(self.whole.surfel.position);
        match distance > SEEN_AS_ONE * self.radius {
            true => self.whole.with * from_disc(place, normal, &self.whole.surfel),
            false => {
                let discs = self.discs.iter();
                discs.map(|disc| disc.with * from_disc(place, normal, &disc.surfel)).sum()
            }
        }
    }
}
