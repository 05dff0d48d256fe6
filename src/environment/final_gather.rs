//! What real surfaces get beside the lights themselves, without and with virtual things: the ambient light where nothing hides it,
//! and what things reflect of the lights (final gathering: Reichert 1992). Rays tell it at some points of the surfaces, the same
//! rays for both, so that nothing changes where no virtual thing is in the way.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::light::irradiance;
use crate::light::irradiance_records::IrradianceRecords;
use crate::shafts::light_of_room::hemisphere;

use super::placed::{OFFSET_M, PlacedScene, PlacedThing, SeenSurface, way_to};
use super::sky::Sky;

/// Edges of real surfaces are at most this part of a virtual thing's size where they touch it, ...
const NEAR_PART: f32 = 1.0 / 20.0;
/// ... and elsewhere this part of the way to it: what it hides varies over such lengths.
const AWAY_PART: f32 = 0.35;
/// A point of which more of its rays than this part start in a solid is inside of it.
const INSIDE_PART: f32 = 0.5;
/// Points inside of a solid have the light of those outside for so many edges.
const EDGES_INWARDS: usize = 2;
/// Changes below this part of what is gathered are none, so that what nothing touches stays as it is.
const LEAST_CHANGE: f32 = 0.002;

/// Light on a point of a real surface, linear irradiance.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Gathered {
    /// Without virtual things.
    pub reaching: Vec3,
    /// What virtual things take of it; below 0 where they add more.
    pub taken: Vec3,
}

/// How light is gathered.
#[derive(Debug, Clone)]
pub struct Gathering {
    /// What comes from where rays meet nothing.
    pub sky: Sky,
    /// From each point.
    pub rays: usize,
    /// At hardly more points than this; those between have the light of their neighbours.
    pub most_records: usize,
}

/// Points of surfaces, in the world.
#[derive(Debug, Clone, Copy)]
pub struct Points<'a> {
    /// A place and a unit normal each.
    pub points: &'a [(DVec3, DVec3)],
    /// Triangles that join them.
    pub triangles: &'a [[u32; 3]],
    /// How far the surface may lie off the one that rays meet, metres.
    pub error_m: f32,
}

/// The longest edge of a real surface's parts between two places in the world; `virtuals` are the virtual things' boxes.
/// All lengths are `coarser` times as long as where nothing moves.
pub fn longest_edge_m(virtuals: &[Bounds], coarser: f32, from: DVec3, to: DVec3) -> f32 {
    let middle = 0.5 * (from + to);
    let half_m = 0.5 * from.distance(to);
    let of_thing = |thing: &Bounds| {
        let size_m = (thing.high - thing.low).length() as f32;
        // No point of the edge is nearer.
        let away_m = (thing.distance(middle) - half_m).max(0.0) as f32;
        coarser * f32::max(NEAR_PART * size_m, AWAY_PART * away_m)
    };
    virtuals.iter().map(of_thing).fold(f32::INFINITY, f32::min)
}

/// What the rays of one point tell.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct Sample {
    without: Vec3,
    with: Vec3,
    /// Whether it lies inside of a real solid, and inside of any.
    is_inside_real: bool,
    is_inside: bool,
}

impl PlacedScene<'_> {
    /// The light at points of real surfaces.
    pub fn gathered(&self, on: Points<'_>, how: &Gathering) -> Vec<Gathered> {
        let records = IrradianceRecords::new(on.points, how.most_records);
        let offset_m = OFFSET_M + on.error_m;
        let samples: Vec<Sample> = records
            .places
            .par_iter()
            .map(|&(place, normal)| {
                let normal = normal.as_vec3();
                self.sample(place.as_vec3() + normal * offset_m, normal, how)
            })
            .collect();
        let is_own = records.places.len() == on.points.len();
        let at_points = |of: &dyn Fn(&Sample) -> Vec3| {
            records.at_points(&samples.iter().map(of).collect::<Vec<_>>())
        };
        let mut reaching = at_points(&|sample| sample.without);
        let mut with = at_points(&|sample| sample.with);
        if is_own {
            let neighbors = neighbors(on);
            let inside = |of: &dyn Fn(&Sample) -> bool| samples.iter().map(of).collect();
            fill(&mut reaching, inside(&|it| it.is_inside_real), &neighbors);
            fill(&mut with, inside(&|it| it.is_inside), &neighbors);
        }
        let both = reaching.into_iter().zip(with);
        both.map(|(reaching, with)| Gathered {
            reaching,
            taken: seen_change(reaching - with, reaching),
        })
        .collect()
    }

    fn sample(&self, start: Vec3, normal: Vec3, how: &Gathering) -> Sample {
        let mut sample = Sample::default();
        let (mut inside_real, mut inside) = (0, 0);
        for direction in hemisphere(normal, how.rays) {
            let real = self.seen(start, direction, |placed| placed.thing.is_real);
            let reach = real.map_or(f32::INFINITY, |seen| seen.distance);
            let is_virtual = |placed: &PlacedThing<'_>| !placed.thing.is_real && placed.thing.casts;
            let before = self.seen_within(start, direction, reach, is_virtual);
            let [without, behind] = match &real {
                Some(seen) => self.reflected_by(seen, &how.sky),
                None => [how.sky.radiance(direction); 2],
            };
            sample.without += without;
            sample.with += match &before {
                Some(seen) => self.reflected_by(seen, &how.sky)[1],
                None => behind,
            };
            inside_real += usize::from(real.is_some_and(|seen| seen.is_inside));
            inside += usize::from(before.or(real).is_some_and(|seen| seen.is_inside));
        }
        let weight = PI / how.rays.max(1) as f32;
        let most_inside = (INSIDE_PART * how.rays as f32) as usize;
        Sample {
            without: sample.without * weight,
            with: sample.with * weight,
            is_inside_real: inside_real > most_inside,
            is_inside: inside > most_inside,
        }
    }

    /// Radiance that a surface reflects of the lights and of the sky, which it sees all of: without virtual things, and with
    /// them.
    fn reflected_by(&self, seen: &SeenSurface, sky: &Sky) -> [Vec3; 2] {
        let start = seen.place + seen.normal * OFFSET_M;
        let mut arriving = [sky.irradiance(seen.normal); 2];
        for light in self.compact {
            let given = irradiance(light, start.as_dvec3(), seen.normal.as_dvec3()).as_vec3();
            let (way, reach) = way_to(light, start);
            let is_hidden = |is_real: bool| {
                let counts = |placed: &PlacedThing<'_>| placed.thing.is_real == is_real;
                self.is_hidden_by(counts, start, way, reach)
            };
            if given == Vec3::ZERO || is_hidden(true) {
                continue;
            }
            arriving[0] += given;
            if !is_hidden(false) {
                arriving[1] += given;
            }
        }
        arriving.map(|arriving| seen.albedo * arriving * FRAC_1_PI)
    }
}

/// A change without what is too little to be seen.
fn seen_change(change: Vec3, of: Vec3) -> Vec3 {
    let least = LEAST_CHANGE * of;
    change.signum() * (change.abs() - least).max(Vec3::ZERO)
}

/// For each point those that share an edge with it.
fn neighbors(on: Points<'_>) -> Vec<Vec<u32>> {
    let mut neighbors = vec![Vec::new(); on.points.len()];
    // (Points of one place with several normals are each other's border, not their neighbours.)
    for &[a, b, c] in on.triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            neighbors[from as usize].push(to);
            neighbors[to as usize].push(from);
        }
    }
    neighbors
}

/// Gives points inside of solids the mean of their neighbours outside, some edges deep.
fn fill(values: &mut [Vec3], mut is_inside: Vec<bool>, neighbors: &[Vec<u32>]) {
    for _ in 0..EDGES_INWARDS {
        let mut filled: HashMap<usize, Vec3> = HashMap::new();
        for (point, around) in neighbors.iter().enumerate() {
            let outside = around.iter().filter(|&&it| !is_inside[it as usize]);
            let count = outside.clone().count();
            if is_inside[point] && count > 0 {
                let sum: Vec3 = outside.map(|&it| values[it as usize]).sum();
                filled.insert(point, sum / count as f32);
            }
        }
        for (point, value) in filled {
            values[point] = value;
            is_inside[point] = false;
        }
    }
}
