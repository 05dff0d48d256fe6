//! Things where they are in a frame, and the light on them.

use std::f32::consts::FRAC_1_PI;

use glam::{Affine3, DAffine3, DVec3, Vec3};

use crate::geometry::bounds::Bounds;
use crate::light::mean_surface::MeanSurface;
use crate::light::regions::Region;
use crate::light::{Light, irradiance};

use super::distant_light::DistantLight;
use super::thing::{OFFSET_M, Thing};

/// Of so many regions a place that reflects light is asked whether it sees them; places beside each other ask others.
const ASKED_REGIONS: usize = 4;

/// A thing in the world.
pub struct PlacedThing<'a> {
    /// Its number in the scene.
    pub number: usize,
    /// It.
    pub thing: &'a Thing,
    /// Its pose.
    pub world_from_anchor: Affine3,
    /// The inverse.
    pub anchor_from_world: Affine3,
}

/// The things that hide light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Among {
    /// Phantoms alone: as it is in the video.
    Real,
    /// Virtual ones too.
    All,
}

/// What a ray meets.
#[derive(Debug, Clone, Copy)]
pub struct SeenSurface {
    /// Number of the thing.
    pub thing: usize,
    /// Number of its triangle.
    pub triangle: usize,
    /// In the world.
    pub place: Vec3,
    /// Unit length, on the side that is seen.
    pub normal: Vec3,
    /// Back along the ray, unit length.
    pub toward_viewer: Vec3,
    /// Of light from everywhere, all around.
    pub albedo: Vec3,
    /// Along the ray, in units of its direction.
    pub distance: f32,
}

/// All things where they are, and what shines on them.
pub struct PlacedScene<'a> {
    /// Those whose anchors have a pose.
    pub things: Vec<PlacedThing<'a>>,
    /// Broad light.
    pub distant: &'a DistantLight,
    /// Compact lights, in the world.
    pub compact: &'a [Light],
}

impl<'a> PlacedThing<'a> {
    /// A thing whose anchor is there.
    pub fn new(number: usize, thing: &'a Thing, world_from_anchor: &DAffine3) -> Self {
        Self {
            number,
            thing,
            world_from_anchor: world_from_anchor.as_affine3(),
            anchor_from_world: world_from_anchor.inverse().as_affine3(),
        }
    }
}

impl PlacedThing<'_> {
    /// A box around it, in the world.
    pub fn bounds(&self) -> Bounds {
        let corners = self.thing.bounds.corners();
        let placed = corners.map(|corner| {
            self.world_from_anchor
                .transform_point3(corner.as_vec3())
                .as_dvec3()
        });
        Bounds {
            low: placed.into_iter().fold(DVec3::MAX, DVec3::min),
            high: placed.into_iter().fold(DVec3::MIN, DVec3::max),
        }
    }

    /// Number of the first triangle along a ray, and how far off it is.
    fn first_hit(&self, origin: Vec3, direction: Vec3, reach: f32) -> Option<(usize, f32)> {
        let origin = self.anchor_from_world.transform_point3(origin);
        let direction = self.anchor_from_world.transform_vector3(direction);
        let hit = self.thing.caster.first_hit(origin, direction, reach)?;
        Some((hit.triangle, hit.distance))
    }

    /// Number of the disc of its surface where a ray has met it; `None` where that has none.
    pub fn disc_at(&self, seen: &SeenSurface) -> Option<usize> {
        let place = self.anchor_from_world.transform_point3(seen.place);
        let normal = self.anchor_from_world.transform_vector3(seen.normal);
        self.thing.disc_at(seen.triangle, place, normal)
    }

    /// Whether a place with a unit normal, in the world, lies inside of it.
    pub fn surrounds(&self, place: Vec3, normal: Vec3) -> bool {
        let place = self.anchor_from_world.transform_point3(place);
        let normal = self.anchor_from_world.transform_vector3(normal);
        self.thing.surrounds(place, normal)
    }

    /// Whether it hides what lies `reach` along a direction.
    pub fn hides(&self, origin: Vec3, direction: Vec3, reach: f32) -> bool {
        let origin = self.anchor_from_world.transform_point3(origin);
        let direction = self.anchor_from_world.transform_vector3(direction);
        self.thing.caster.is_hidden(origin, direction, reach)
    }
}

impl<'a> PlacedScene<'a> {
    /// Of things with their numbers, of which those are there whose anchors are.
    pub fn new(
        things: impl Iterator<Item = (usize, &'a Thing)>,
        world_from_anchor: &[Option<DAffine3>],
        distant: &'a DistantLight,
        compact: &'a [Light],
    ) -> Self {
        let placed = things.filter_map(|(number, thing)| {
            let pose = world_from_anchor[thing.anchor].as_ref()?;
            Some(PlacedThing::new(number, thing, pose))
        });
        Self {
            things: placed.collect(),
            distant,
            compact,
        }
    }
}

impl PlacedScene<'_> {
    /// How far behind a caster what casts shadows and catches them can be: across all casters.
    pub fn reach_m(&self) -> f32 {
        let casting = self.things.iter().filter(|placed| placed.thing.casts);
        let boxes = casting.map(PlacedThing::bounds);
        let around = boxes.reduce(|one, other| Bounds {
            low: one.low.min(other.low),
            high: one.high.max(other.high),
        });
        around.map_or(0.0, |around| (around.high - around.low).length() as f32)
    }

    /// Where among `things` that of a number is, if it has a pose.
    pub fn position(&self, number: usize) -> Option<usize> {
        self.things
            .iter()
            .position(|placed| placed.number == number)
    }

    /// For each of `count` things, by their numbers, and each region whether what throws no shadow, as the table, leaves
    /// it open from the thing's middle.
    pub fn open_regions(&self, count: usize) -> Vec<bool> {
        let regions = &self.distant.regions;
        let mut open = vec![true; count * regions.len()];
        for own in &self.things {
            let number = own.number;
            let middle = own
                .world_from_anchor
                .transform_point3(own.thing.ball.center);
            let row = &mut open[number * regions.len()..(number + 1) * regions.len()];
            for (open, region) in row.iter_mut().zip(regions) {
                let toward = region.toward.as_vec3();
                // (A sheet of paper on it does not hide the sky from all of a table.)
                let counts = |placed: &PlacedThing<'_>| {
                    let thing = placed.thing;
                    !thing.casts && thing.ball.radius > own.thing.ball.radius
                };
                *open = self.seen(middle, toward, counts).is_none();
            }
        }
        open
    }

    /// What a ray of unit direction meets first of the things that `counts` says yes of.
    pub fn seen(
        &self,
        origin: Vec3,
        direction: Vec3,
        counts: impl Fn(&PlacedThing<'_>) -> bool,
    ) -> Option<SeenSurface> {
        self.seen_within(origin, direction, f32::INFINITY, counts)
    }

    /// The same, no farther than `reach`.
    pub fn seen_within(
        &self,
        origin: Vec3,
        direction: Vec3,
        reach: f32,
        counts: impl Fn(&PlacedThing<'_>) -> bool,
    ) -> Option<SeenSurface> {
        let mut nearest: Option<(usize, usize, f32)> = None;
        for (index, placed) in self.things.iter().enumerate() {
            if !counts(placed) {
                continue;
            }
            let reach = nearest.map_or(reach, |(_, _, distance)| distance);
            if let Some((triangle, distance)) = placed.first_hit(origin, direction, reach) {
                nearest = Some((index, triangle, distance));
            }
        }
        let (index, triangle, distance) = nearest?;
        let placed = &self.things[index];
        let [a, b, c] = placed.thing.triangles[triangle];
        let outward = placed
            .world_from_anchor
            .transform_vector3((b - a).cross(c - a));
        let normal = outward.normalize_or_zero();
        let is_averted = outward.dot(direction) > 0.0;
        Some(SeenSurface {
            thing: index,
            triangle,
            place: origin + direction * distance,
            normal: match is_averted {
                true => -normal,
                false => normal,
            },
            toward_viewer: -direction,
            albedo: placed.thing.surface(triangle).albedo.as_vec3(),
            distance,
        })
    }

    /// What a ray has met.
    pub fn surface(&self, seen: &SeenSurface) -> &MeanSurface {
        self.things[seen.thing].thing.surface(seen.triangle)
    }

    /// Whether something hides what lies `reach` along a direction: what casts shadows, or what is real and casts none, as a
    /// table, which no light comes through from below.
    fn is_hidden(&self, among: Among, origin: Vec3, direction: Vec3, reach: f32) -> bool {
        let counts = |placed: &PlacedThing<'_>| match placed.thing.is_real {
            true => true,
            false => among == Among::All && placed.thing.casts,
        };
        self.is_behind(counts, origin, direction, reach)
    }

    /// Whether one of the things that `counts` says yes of hides what lies `reach` along a direction.
    pub fn is_behind(
        &self,
        counts: impl Fn(&PlacedThing<'_>) -> bool,
        origin: Vec3,
        direction: Vec3,
        reach: f32,
    ) -> bool {
        let mut things = self.things.iter().filter(|placed| counts(placed));
        things.any(|placed| placed.hides(origin, direction, reach))
    }

    /// Whether one of the things that cast shadows and that `counts` says yes of hides what lies `reach` along a direction.
    pub fn is_hidden_by(
        &self,
        counts: impl Fn(&PlacedThing<'_>) -> bool,
        origin: Vec3,
        direction: Vec3,
        reach: f32,
    ) -> bool {
        let casts_and_counts = |placed: &PlacedThing<'_>| placed.thing.casts && counts(placed);
        self.is_behind(casts_and_counts, origin, direction, reach)
    }

    /// Irradiance of a place past things: of compact lights and of all regions.
    pub fn irradiance(&self, among: Among, place: Vec3, normal: Vec3) -> Vec3 {
        let start = place + normal * OFFSET_M;
        let regions = self.distant.regions.iter();
        let broad = regions.filter_map(|region| self.of_region(among, start, normal, region));
        let compact = self.of_compact(among, start, normal);
        let all = broad.chain(compact);
        all.map(|(_, irradiance)| irradiance).sum()
    }

    /// What a surface that a ray met reflects along it; `turn` is the ray's number, and says which regions are asked for.
    pub fn radiance(&self, among: Among, seen: &SeenSurface, turn: usize) -> Vec3 {
        let start = seen.place + seen.normal * OFFSET_M;
        let regions = &self.distant.regions;
        let asked = ASKED_REGIONS.min(regions.len());
        let scale = regions.len() as f32 / asked.max(1) as f32;
        let broad = (0..asked).filter_map(|index| {
            // Each asks for regions that lie far apart in their order, and rays beside each other for others.
            let region = (turn + index * regions.len() / asked) % regions.len();
            let (toward, given) = self.of_region(among, start, seen.normal, &regions[region])?;
            Some((toward, given * scale))
        });
        let arriving = broad.chain(self.of_compact(among, start, seen.normal));
        let surface = self.surface(seen);
        let reflected = arriving.map(|(toward, given)| {
            given * surface.reflected(seen.normal, toward, seen.toward_viewer)
        });
        reflected.sum::<Vec3>() * FRAC_1_PI
    }

    /// The direction of a region and the irradiance of a place of it; `None` where that is none.
    fn of_region(
        &self,
        among: Among,
        start: Vec3,
        normal: Vec3,
        region: &Region,
    ) -> Option<(Vec3, Vec3)> {
        let toward = region.toward.as_vec3();
        let cosine = toward.dot(normal);
        let arrives = cosine > 0.0 && !self.is_hidden(among, start, toward, f32::INFINITY);
        arrives.then(|| (toward, region.irradiance.as_vec3() * cosine))
    }

    /// For each compact light that reaches a place its direction and its irradiance.
    fn of_compact(
        &self,
        among: Among,
        start: Vec3,
        normal: Vec3,
    ) -> impl Iterator<Item = (Vec3, Vec3)> {
        self.compact.iter().filter_map(move |light| {
            let (way, reach) = light.way_from(start.as_dvec3());
            let way = way.as_vec3();
            let arriving = irradiance(light, start.as_dvec3(), normal.as_dvec3());
            let arrives = arriving != DVec3::ZERO && !self.is_hidden(among, start, way, reach);
            arrives.then(|| (way.normalize_or_zero(), arriving.as_vec3()))
        })
    }
}
