//! What real surfaces get beside the lights themselves, without and with virtual things: the ambient light where nothing hides it,
//! and what things reflect of the lights (final gathering: Reichert 1992). Rays tell it at some points of the surfaces, the same
//! rays for both, so that nothing changes where no virtual thing is in the way.

use std::collections::HashMap;
use std::f32::consts::{FRAC_1_PI, PI};

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::bounds::Bounds;
use crate::light::bounce::FurtherLight;
use crate::light::irradiance_records::IrradianceRecords;
use crate::light::{Light, irradiance};
use crate::shafts::light_of_room::{hemisphere, over_hemisphere};

use super::placed::{PlacedScene, PlacedThing, SeenSurface};
use super::sky::Sky;
use super::thing::OFFSET_M;

/// Edges of real surfaces are at most this part of a virtual thing's size where they touch it, ...
const NEAR_PART: f32 = 1.0 / 20.0;
/// ... and elsewhere this part of the way to it: what it hides varies over such lengths.
const AWAY_PART: f32 = 0.25;
/// Directions over the place that a ray ends at, ...
const DIRECTIONS_OF_AN_END: usize = 64;
/// ... of which each ray takes so many, ...
const RAYS_OF_AN_END: usize = 2;
/// ... and the next ray those that are so many on: no divisor of the others.
const DIRECTIONS_APART: usize = 37;
/// As finely as so many rays over an end's hemisphere would, those of neighbouring ends together tell what lies around it.
const SPOT_OF_AN_END: usize = 16;
/// Of the sky an end asks for so many sources: a sun that has a fifth of all power is then met nearly as often as it should be.
const SOURCES_OF_AN_END: usize = 4;
/// Steps from one ray to the next through the power of all sources that its end asks for, and that the surface asks for which
/// that end sees: parts that no small number of steps makes whole (Roberts 2018: the plastic number's).
const STEPS_THROUGH_POWER: [f64; 2] = [0.754_877_666, 0.569_840_291];
/// Points inside of a solid have the light of those outside for so many edges.
const EDGES_INWARDS: usize = 2;
/// Changes below the first of these parts of all light at a point are none, so that what nothing touches stays as it is; from
/// the second on they are whole. (A level of a display is more than either.)
const SEEN_CHANGE: [f32; 2] = [0.002, 0.004];

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
pub struct Gathering<'a> {
    /// What comes from where rays meet nothing.
    pub sky: &'a Sky,
    /// From each record.
    pub rays: usize,
    /// What goes on being reflected.
    pub further: FurtherLight,
    /// Of each compact light of the scene the places that it shines from, so that each ray's end sees one of them.
    pub shining_from: Vec<Vec<Light>>,
}

/// Points of a surface that get light, and where it is gathered for them.
#[derive(Debug, Clone)]
pub struct GatherPoints {
    records: IrradianceRecords,
    /// For each point those that share an edge with it; none where several share a record.
    neighbors: Vec<Vec<u32>>,
    /// How far off the surface rays start, metres.
    offset_m: f32,
}

impl GatherPoints {
    /// Points (a place and a unit normal each, in a space of their own) that `triangles` join, on a surface that may lie
    /// `error_m` off the one that rays meet; with hardly more records than `most_records`.
    pub fn new(
        points: &[(DVec3, DVec3)],
        triangles: &[[u32; 3]],
        error_m: f32,
        most_records: usize,
    ) -> Self {
        let records = IrradianceRecords::new(points, most_records);
        let neighbors = match records.places.len() == points.len() {
            true => neighbors(points.len(), triangles),
            false => Vec::new(),
        };
        Self {
            records,
            neighbors,
            offset_m: OFFSET_M + error_m,
        }
    }
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
    /// Of the lights themselves, without virtual things.
    direct: Vec3,
    /// Whether it lies inside of a real solid, and inside of any.
    is_inside_real: bool,
    is_inside: bool,
}

impl PlacedScene<'_> {
    /// The light at points of real surfaces, whose space has the pose `world_from_points`.
    pub fn gathered(
        &self,
        on: &GatherPoints,
        world_from_points: &DAffine3,
        how: &Gathering<'_>,
    ) -> Vec<Gathered> {
        let records = &on.records;
        let places = records.places.par_iter();
        let samples: Vec<Sample> = places
            .map(|&(place, normal)| {
                let place = world_from_points.transform_point3(place).as_vec3();
                let normal = world_from_points.transform_vector3(normal).as_vec3();
                self.sample(place + normal * on.offset_m, normal, how)
            })
            .collect();
        let at_points = |of: &dyn Fn(&Sample) -> Vec3| {
            records.at_points(&samples.iter().map(of).collect::<Vec<_>>())
        };
        let mut reaching = at_points(&|sample| sample.without);
        let mut with = at_points(&|sample| sample.with);
        let direct = at_points(&|sample| sample.direct);
        let inside = |of: &dyn Fn(&Sample) -> bool| samples.iter().map(of).collect();
        let neighbors = &on.neighbors;
        fill(&mut reaching, inside(&|it| it.is_inside_real), neighbors);
        fill(&mut with, inside(&|it| it.is_inside), neighbors);
        let all = reaching.into_iter().zip(with).zip(direct);
        all.map(|((reaching, with), direct)| Gathered {
            reaching,
            taken: seen_change(reaching - with, reaching + direct),
        })
        .collect()
    }

    fn sample(&self, start: Vec3, normal: Vec3, how: &Gathering<'_>) -> Sample {
        let rays = how.sky.rays(how.rays);
        let [mut without, mut with] = [Vec3::ZERO; 2];
        for (number, direction) in hemisphere(normal, rays).enumerate() {
            let [real, before] = self.met(start, direction);
            let [of_real, behind] = match &real {
                Some(seen) => self.reflected_by(seen, how, number),
                None => [how.sky.radiance; 2],
            };
            without += of_real;
            with += match &before {
                Some(seen) => self.reflected_by(seen, how, number)[1],
                None => behind,
            };
        }
        // (What few rays find hidden of the sky may be more than there is.)
        let weight = PI / rays.max(1) as f32;
        let [without, with] = [without, with].map(|light| light.max(Vec3::ZERO));
        let [of_sky, left_of_sky] = self.of_sources(start, normal, how.sky);
        let is_inside = |counts: fn(&PlacedThing<'_>) -> bool| {
            let mut things = self.things.iter().filter(|placed| counts(placed));
            things.any(|placed| placed.surrounds(start, normal))
        };
        let is_inside_real = is_inside(is_real);
        Sample {
            without: without * weight + of_sky,
            with: with * weight + left_of_sky,
            direct: self.direct(start, normal, how, (0, 0.0), |_| Vec3::ONE)[0],
            is_inside_real,
            is_inside: is_inside_real || is_inside(is_virtual_caster),
        }
    }

    /// What a ray meets that is real, and what it meets of virtual casters before it.
    fn met(&self, start: Vec3, direction: Vec3) -> [Option<SeenSurface>; 2] {
        let real = self.seen(start, direction, is_real);
        let reach = real.as_ref().map_or(f32::INFINITY, |seen| seen.distance);
        let before = self.seen_within(start, direction, reach, is_virtual_caster);
        [real, before]
    }

    /// Irradiance of a place of the sky's single directions: without virtual things, and with them.
    fn of_sources(&self, start: Vec3, normal: Vec3, sky: &Sky) -> [Vec3; 2] {
        let mut sums = [Vec3::ZERO; 2];
        for source in &sky.sources {
            let toward = source.toward.as_vec3();
            let cosine = toward.dot(normal);
            let is_hidden = |counts: fn(&PlacedThing<'_>) -> bool| {
                self.is_behind(counts, start, toward, f32::INFINITY)
            };
            if cosine <= 0.0 || is_hidden(is_real) {
                continue;
            }
            let given = source.irradiance.as_vec3() * cosine;
            sums[0] += given;
            if !is_hidden(is_virtual_caster) {
                sums[1] += given;
            }
        }
        sums
    }

    /// Radiance that a surface reflects of the lights and of what is around it: without virtual things, and with them.
    fn reflected_by(&self, seen: &SeenSurface, how: &Gathering<'_>, number: usize) -> [Vec3; 2] {
        let start = seen.place + seen.normal * OFFSET_M;
        let rays = how.sky.rays(how.rays);
        let direct = self.direct_reflected(start, seen, how, (number, rays));
        let around = self.around(start, seen.normal, how, number);
        [0, 1].map(|with| (direct[with] + seen.albedo * around[with]) * FRAC_1_PI)
    }

    /// Irradiance of a place that a ray with this number came to, but for the lights themselves: without virtual things, and with
    /// them.
    fn around(&self, start: Vec3, normal: Vec3, how: &Gathering<'_>, number: usize) -> [Vec3; 2] {
        let of_sky = how.sky.irradiance(normal);
        if how.further == FurtherLight::Estimated {
            return [of_sky; 2];
        }
        let of_surface = |seen: &SeenSurface| {
            if how.further == FurtherLight::None {
                return [Vec3::ZERO; 2];
            }
            let start = seen.place + seen.normal * OFFSET_M;
            let direct = self.direct_reflected(start, seen, how, (number, SPOT_OF_AN_END));
            let of_sky = self.left_of_sky(start, seen.normal, how.sky, number);
            [0, 1].map(|with| direct[with] + seen.albedo * of_sky[with])
        };
        let axes = normal.any_orthonormal_pair();
        // Neighbouring rays look elsewhere.
        let first = number * DIRECTIONS_APART;
        // What rays meet is there in place of the sky behind it: few rays tell that better than the sky where they meet nothing.
        let behind = PI * how.sky.radiance;
        let mut changes = [Vec3::ZERO; 2];
        for ray in 0..RAYS_OF_AN_END {
            let turn = first + ray * DIRECTIONS_OF_AN_END / RAYS_OF_AN_END;
            let which = [turn % DIRECTIONS_OF_AN_END, DIRECTIONS_OF_AN_END];
            let direction = over_hemisphere(normal, axes, which);
            let change = |seen: &SeenSurface| of_surface(seen).map(|given| given - behind);
            let [real, before] = self.met(start, direction);
            let [without, of_real] = real.as_ref().map_or([Vec3::ZERO; 2], change);
            changes[0] += without;
            changes[1] += before.as_ref().map_or(of_real, |seen| change(seen)[1]);
        }
        let part = (number as f64 * STEPS_THROUGH_POWER[0]).fract();
        let hidden = self.hidden_of_sources(start, normal, how.sky, (part, SOURCES_OF_AN_END));
        [0, 1].map(|with| of_sky + changes[with] / RAYS_OF_AN_END as f32 - hidden[with])
    }

    /// Irradiance of a place that is hidden of the sky's single directions, as `count` of them tell that are evenly spread over their
    /// power from a part of it on: without virtual things, and with them. (By power, for rays in all directions alike miss a sun or
    /// meet nothing else.)
    fn hidden_of_sources(
        &self,
        start: Vec3,
        normal: Vec3,
        sky: &Sky,
        (part, count): (f64, usize),
    ) -> [Vec3; 2] {
        let mut hidden = [Vec3::ZERO; 2];
        for turn in 0..count {
            let Some((source, stands_for)) = sky.source_at((part + turn as f64) / count as f64)
            else {
                continue;
            };
            let toward = source.toward.as_vec3();
            let cosine = toward.dot(normal);
            let is_hidden = |counts: fn(&PlacedThing<'_>) -> bool| {
                self.is_behind(counts, start, toward, f32::INFINITY)
            };
            if cosine <= 0.0 {
                continue;
            }
            let given = source.irradiance.as_vec3() * (cosine * stands_for / count as f32);
            if is_hidden(is_real) {
                hidden[0] += given;
                hidden[1] += given;
            } else if is_hidden(is_virtual_caster) {
                hidden[1] += given;
            }
        }
        hidden
    }

    /// Irradiance of a place of the sky and, where something hides it, of the sky's light that this reflects, as a single ray tells
    /// it: without virtual things, and with them.
    fn left_of_sky(&self, start: Vec3, normal: Vec3, sky: &Sky, turn: usize) -> [Vec3; 2] {
        let which = [
            turn * DIRECTIONS_APART % DIRECTIONS_OF_AN_END,
            DIRECTIONS_OF_AN_END,
        ];
        let direction = over_hemisphere(normal, normal.any_orthonormal_pair(), which);
        let behind = PI * sky.radiance;
        let [real, before] = self.met(start, direction);
        let part = (turn as f64 * STEPS_THROUGH_POWER[1]).fract();
        let [without, with] = self.hidden_of_sources(start, normal, sky, (part, 1));
        let of_sky = sky.irradiance(normal);
        [(real, without), (before.or(real), with)].map(|(met, hidden)| match met {
            Some(seen) => of_sky - hidden + seen.albedo * sky.irradiance(seen.normal) - behind,
            None => of_sky - hidden,
        })
    }

    /// What a surface reflects of the lights themselves along the ray that met it, one of so many over a hemisphere, π times its
    /// radiance.
    fn direct_reflected(
        &self,
        start: Vec3,
        seen: &SeenSurface,
        how: &Gathering<'_>,
        (turn, rays): (usize, usize),
    ) -> [Vec3; 2] {
        let surface = self.surface(seen);
        let reach_m = seen.distance / (rays.max(1) as f32).sqrt();
        self.direct(start, seen.normal, how, (turn, reach_m), |toward| {
            surface.reflected(seen.normal, toward, seen.toward_viewer)
        })
    }

    /// Irradiance of a place of the lights themselves, without virtual things and with them, as that of their places whose turn
    /// it is sees it; times what `part` is for a unit direction to a light. The place stands for all within `reach_m` of it: a lamp
    /// that is nearer lights them less than it does the place, on the average as much as from the edge, for few of many rays meet
    /// the spot below a lamp and none of them tells how small it is.
    fn direct(
        &self,
        start: Vec3,
        normal: Vec3,
        how: &Gathering<'_>,
        (turn, reach_m): (usize, f32),
        part: impl Fn(Vec3) -> Vec3,
    ) -> [Vec3; 2] {
        let mut arriving = [Vec3::ZERO; 2];
        for (light, places) in self.compact.iter().zip(&how.shining_from) {
            let given = irradiance(light, start.as_dvec3(), normal.as_dvec3()).as_vec3();
            let (way, reach) = places[turn % places.len()].way_from(start.as_dvec3());
            let way = way.as_vec3();
            let is_hidden = |is_real: bool| {
                let counts = |placed: &PlacedThing<'_>| placed.thing.is_real == is_real;
                self.is_hidden_by(counts, start, way, reach)
            };
            if given == Vec3::ZERO || is_hidden(true) {
                continue;
            }
            // (The mean over a disc below a lamp: its flux from there is 2 π of its intensity where the disc is wide.)
            let mean = match reach.is_finite() {
                true => (2.0 * way.length_squared() / reach_m.powi(2)).min(1.0),
                false => 1.0,
            };
            let given = given * part(way.normalize_or_zero()) * mean;
            arriving[0] += given;
            if !is_hidden(false) {
                arriving[1] += given;
            }
        }
        arriving
    }
}

fn is_real(placed: &PlacedThing<'_>) -> bool {
    placed.thing.is_real
}

fn is_virtual_caster(placed: &PlacedThing<'_>) -> bool {
    !placed.thing.is_real && placed.thing.casts
}

/// A change, faded out where it is too little to be seen.
fn seen_change(change: Vec3, of: Vec3) -> Vec3 {
    let [none, whole] = SEEN_CHANGE;
    let part = (change.abs() / of.max(Vec3::splat(1e-9)) - none) / (whole - none);
    change * part.clamp(Vec3::ZERO, Vec3::ONE)
}

/// For each point those that share an edge with it. (Points of one place with several normals are each other's border.)
fn neighbors(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut neighbors = vec![Vec::new(); count];
    for &[a, b, c] in triangles {
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
