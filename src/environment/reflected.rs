//! What things reflect on to others (one bounce), as discs on their surfaces and groups of these: virtual things on to real
//! ones, and real ones on to each other, with and without virtual things in the way of the light.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use rayon::prelude::*;

use crate::shafts::light_of_room::hemisphere;
use crate::shafts::surfels::{Surfel, as_one, from_disc, mean_by_area, open_directions};

use super::placed::{Among, OFFSET_M, PlacedScene, PlacedThing};

/// Parts that a group is cut into.
const PARTS: usize = 4;
/// Rays that gather what others reflect on to a disc.
const RAYS: usize = 32;
/// A group is seen as one disc from so many of its radii; environment.wgsl has the same number.
const SEEN_AS_ONE: f32 = 4.0;

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

/// A disc, or a group of neighbours with a disc that stands for all of them where they are seen from afar.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DiscNode {
    /// All as one.
    pub whole: ReflectingDisc,
    /// Around its middle; 0 for a disc.
    pub radius: f32,
    /// Number of the node that comes after all that is in it.
    pub next: u32,
    /// What it is on, its place among the scene's things.
    pub thing: usize,
}

/// The discs of all things as trees: each group, then what is in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct DiscTree {
    /// The nodes.
    pub nodes: Vec<DiscNode>,
}

impl PlacedScene<'_> {
    /// What casting things reflect of all light that reaches them, one bounce of it from others among it.
    pub fn reflecting(&self) -> DiscTree {
        let mut tree = DiscTree::default();
        for (thing, placed) in self.things.iter().enumerate() {
            let surfels = placed.thing.surfels.par_iter();
            let lit = surfels.map(|surfel| self.lit(placed, surfel));
            tree.add(&lit.collect::<Vec<_>>(), thing);
        }
        tree
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
                let counts = |placed: &PlacedThing<'_>| among == Among::All || placed.thing.is_real;
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

impl DiscTree {
    /// Adds discs of a thing, of which neighbours lie beside each other in their order.
    fn add(&mut self, discs: &[ReflectingDisc], thing: usize) {
        match discs {
            [] => {}
            [one] => self.nodes.push(DiscNode {
                whole: *one,
                radius: 0.0,
                next: self.nodes.len() as u32 + 1,
                thing,
            }),
            several => {
                let first = self.nodes.len();
                self.nodes.push(DiscNode {
                    thing,
                    ..DiscNode::around(several)
                });
                for part in several.chunks(several.len().div_ceil(PARTS)) {
                    self.add(part, thing);
                }
                self.nodes[first].next = self.nodes.len() as u32;
            }
        }
    }

    /// Irradiance, with virtual things there, of a place on a thing from its own discs that it faces and that face it, as those
    /// of a hollow do.
    pub fn irradiance_from_itself(&self, thing: usize, place: Vec3, normal: Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let disc = &node.whole;
            let way = disc.surfel.position - place;
            let is_near = way.length_squared() < (SEEN_AS_ONE * node.radius).powi(2);
            match node.thing == thing && is_near {
                true => index += 1,
                false => {
                    if node.thing == thing {
                        sum += disc.with * from_disc(place, normal, &disc.surfel);
                    }
                    index = node.next as usize;
                }
            }
        }
        sum
    }
}

impl DiscNode {
    fn around(discs: &[ReflectingDisc]) -> Self {
        let (surfel, radius) = as_one(discs, |disc| &disc.surfel);
        let mean =
            |of: &dyn Fn(&ReflectingDisc) -> Vec3| mean_by_area(discs, |disc| disc.surfel.area, of);
        Self {
            whole: ReflectingDisc {
                surfel,
                open: discs.iter().fold(0, |open, disc| open | disc.open),
                without: mean(&|disc| disc.without),
                with: mean(&|disc| disc.with),
            },
            radius,
            next: 0,
            thing: 0,
        }
    }
}
