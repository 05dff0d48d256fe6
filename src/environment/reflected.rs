//! What things reflect on to others (one bounce), as discs on their surfaces and groups of these: virtual things on to real
//! ones, and real ones on to each other, with and without virtual things in the way of the light.

use std::f32::consts::{FRAC_1_PI, PI};

use glam::Vec3;
use rayon::prelude::*;

use crate::shafts::light_of_room::hemisphere;
use crate::shafts::surfels::{Surfel, as_one, from_open_disc, mean_by_area, open_directions};

use super::placed::{Among, PlacedScene, PlacedThing, SeenSurface};
use super::thing::OFFSET_M;

/// Parts that a group is cut into.
const PARTS: usize = 4;
/// Rays that gather what others reflect on to a disc, ...
const RAYS: usize = 32;
/// ... and the irradiance of one for each unit of the radiance that it meets.
const WEIGHT: f32 = PI / RAYS as f32;
/// How often light goes from surface to surface.
const BOUNCES: usize = 3;
/// A group is seen as one disc from so many of its radii: from nearer than by the pixel (environment.wgsl), for what is passed on
/// is little.
const SEEN_AS_ONE: f32 = 2.0;

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
    /// For each thing and each of its discs the part of the radiance that comes of what things reflect.
    passed_on: Vec<Vec<Radiances>>,
}

/// Radiance without virtual things, and with them.
type Radiances = [Vec3; 2];

/// A disc, and what is around it.
struct GatheringDisc {
    surfel: Surfel,
    open: u64,
    /// Radiance of what the lights alone give it.
    of_lights: Radiances,
    /// Irradiance of what the surfaces around it reflect of the lights.
    thrown_back: Radiances,
    /// Those surfaces, as rays have met them.
    around: [Vec<SeenSurface>; 2],
}

impl Among {
    /// Of `[without virtual things, with them]`.
    fn index(self) -> usize {
        match self {
            Self::Real => 0,
            Self::All => 1,
        }
    }
}

impl PlacedScene<'_> {
    /// What casting things reflect of all light that reaches them, also of what they and what throws no shadow reflect on to each
    /// other.
    pub fn reflecting(&self) -> DiscTree {
        let of_thing = |placed: &PlacedThing<'_>| -> Vec<GatheringDisc> {
            let surfels = placed.thing.surfels.par_iter();
            surfels
                .map(|surfel| self.gathering(placed, surfel))
                .collect()
        };
        let discs: Vec<Vec<GatheringDisc>> = self.things.iter().map(of_thing).collect();
        let nothing = discs.iter().map(|discs| vec![[Vec3::ZERO; 2]; discs.len()]);
        let mut tree = DiscTree::new(&discs, nothing.collect());
        for _ in 0..BOUNCES {
            let passed_on = discs.iter().map(|discs| {
                let discs = discs.par_iter();
                discs.map(|disc| disc.passed_on(self, &tree)).collect()
            });
            tree = DiscTree::new(&discs, passed_on.collect());
        }
        tree
    }

    fn gathering(&self, placed: &PlacedThing<'_>, surfel: &Surfel) -> GatheringDisc {
        let surfel = Surfel {
            position: placed.world_from_anchor.transform_point3(surfel.position),
            normal: placed.world_from_anchor.transform_vector3(surfel.normal),
            ..*surfel
        };
        let open = open_directions(&surfel, |start, direction| {
            placed.hides(start, direction, f32::INFINITY)
        });
        let mut disc = GatheringDisc {
            surfel,
            open,
            of_lights: [Vec3::ZERO; 2],
            thrown_back: [Vec3::ZERO; 2],
            around: [Vec::new(), Vec::new()],
        };
        disc.gather(self, Among::All);
        if placed.thing.is_real {
            disc.gather(self, Among::Real);
        }
        disc
    }
}

impl GatheringDisc {
    fn gather(&mut self, scene: &PlacedScene<'_>, among: Among) {
        let Surfel {
            position, normal, ..
        } = self.surfel;
        let start = position + normal * OFFSET_M;
        let counts = |placed: &PlacedThing<'_>| among == Among::All || placed.thing.is_real;
        let which = among.index();
        for (number, direction) in hemisphere(normal, RAYS).enumerate() {
            if let Some(seen) = scene.seen(start, direction, counts) {
                self.thrown_back[which] += scene.radiance(among, &seen, number) * WEIGHT;
                self.around[which].push(seen);
            }
        }
        let arriving = scene.irradiance(among, position, normal);
        self.of_lights[which] = self.surfel.albedo * arriving * FRAC_1_PI;
    }

    /// Radiance of what the surfaces around it reflect, of the lights and of what is in `tree`.
    fn passed_on(&self, scene: &PlacedScene<'_>, tree: &DiscTree) -> Radiances {
        [Among::Real, Among::All].map(|among| {
            let around = self.around[among.index()].iter();
            let further: Vec3 = around.map(|seen| tree.passed_on(scene, among, seen)).sum();
            let arriving = self.thrown_back[among.index()] + further * WEIGHT;
            self.surfel.albedo * arriving * FRAC_1_PI
        })
    }
}

impl DiscTree {
    fn new(discs: &[Vec<GatheringDisc>], passed_on: Vec<Vec<Radiances>>) -> Self {
        let mut tree = Self::default();
        for (thing, (discs, passed_on)) in discs.iter().zip(&passed_on).enumerate() {
            let lit = discs.iter().zip(passed_on).map(|(disc, further)| {
                let [without, with] = [0, 1].map(|which| disc.of_lights[which] + further[which]);
                ReflectingDisc {
                    surfel: disc.surfel,
                    open: disc.open,
                    without,
                    with,
                }
            });
            tree.add(&lit.collect::<Vec<_>>(), thing);
        }
        Self { passed_on, ..tree }
    }

    /// Radiance that a surface which a ray has met reflects of what things reflect on to it.
    pub fn passed_on(&self, scene: &PlacedScene<'_>, among: Among, seen: &SeenSurface) -> Vec3 {
        let placed = &scene.things[seen.thing];
        if placed.thing.casts {
            let disc = placed.disc_at(seen);
            return disc.map_or(Vec3::ZERO, |disc| {
                self.passed_on[seen.thing][disc][among.index()]
            });
        }
        seen.albedo * FRAC_1_PI * self.irradiance(among, seen.place, seen.normal)
    }

    /// Irradiance of a place from all discs.
    fn irradiance(&self, among: Among, place: Vec3, normal: Vec3) -> Vec3 {
        let mut sum = Vec3::ZERO;
        let mut index = 0;
        while let Some(node) = self.nodes.get(index) {
            let ReflectingDisc {
                surfel,
                open,
                without,
                with,
            } = &node.whole;
            let way = surfel.position - place;
            let facing = normal.dot(way);
            let is_near = way.length_squared() < (SEEN_AS_ONE * node.radius).powi(2);
            match is_near && facing >= -node.radius {
                true => index += 1,
                false => {
                    let radiance = [without, with][among.index()];
                    sum += *radiance * from_open_disc(place, normal, surfel, *open);
                    index = node.next as usize;
                }
            }
        }
        sum
    }

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

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::environment::distant_light::DistantLight;
    use crate::environment::thing::tests::thing;
    use crate::geometry::mesh::Mesh;
    use crate::geometry::mesh::tests::welded;
    use crate::light::Light;

    /// A square that faces up.
    fn square(half_m: f32, height_m: f32) -> Mesh {
        let corner = |x: f32, y: f32| Vec3::new(x * half_m, y * half_m, height_m);
        let corners = [
            corner(-1.0, -1.0),
            corner(1.0, -1.0),
            corner(1.0, 1.0),
            corner(-1.0, 1.0),
        ];
        welded(&corners, &[[0, 1, 2], [0, 2, 3]])
    }

    #[test]
    fn the_back_of_a_sheet_passes_on_what_the_floor_below_it_reflects() {
        // A sheet some way above a wide floor that the sun is on: from below it has what the floor has times both albedos.
        let (of_floor, of_sheet, height) = (0.5, 0.8, 10.0);
        let things = [
            thing(&square(400.0, 0.0), of_floor, false),
            thing(&square(1.0, height), of_sheet, false),
        ];
        let sun = Light::directional(DVec3::new(1.0, 0.0, -1.0).normalize(), DVec3::splat(3.0));
        let (distant, compact) = (DistantLight::default(), [sun]);
        let placed = [Some(DAffine3::IDENTITY)];
        let scene = PlacedScene::new(things.iter().enumerate(), &placed, &distant, &compact);
        let discs = scene.reflecting();
        let passed_on = |from: Vec3, along: Vec3| {
            let seen = scene.seen(from, along, |_| true).expect("the sheet");
            assert_eq!(seen.thing, 1);
            f64::from(discs.passed_on(&scene, Among::All, &seen).x)
        };
        let on_floor = 3.0 * 0.5_f64.sqrt();
        let expected = of_sheet * of_floor * on_floor / std::f64::consts::PI;
        let below = passed_on(Vec3::new(0.1, 0.2, 1.0), Vec3::Z);
        assert!((below / expected - 1.0).abs() < 0.05, "{below} {expected}");
        // Its front faces nothing.
        assert_eq!(passed_on(Vec3::new(0.1, 0.2, 20.0), Vec3::NEG_Z), 0.0);
    }
}
