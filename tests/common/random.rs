//! Repeatable random numbers, and meshes and scenes of all kinds made from them.

use std::f64::consts::TAU;

use glam::{DAffine3, DQuat, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::Light;

use super::shapes::{self, Soup};
use super::{Stage, Thing, lamp, look_with_up, sun};

/// A sequence that its seed determines (splitmix64; Steele, Lea & Flood 2014).
#[derive(Debug, Clone)]
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x2545_f491_4f6c_dd1d))
    }

    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    pub fn chance(&mut self, share: f64) -> bool {
        self.between(0.0, 1.0) < share
    }

    /// Each coordinate between -1 and 1.
    pub fn vector(&mut self) -> Vec3 {
        self.vector_wide().as_vec3()
    }

    pub fn vector_wide(&mut self) -> DVec3 {
        DVec3::from_array(std::array::from_fn(|_| self.between(-1.0, 1.0)))
    }

    /// All directions alike.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let vector = self.vector_wide();
            if (1e-3..1.0).contains(&vector.length()) {
                return vector.normalize();
            }
        }
    }

    /// A closed mesh of about unit size.
    pub fn closed_mesh(&mut self) -> Soup {
        match self.below(8) {
            0..=2 => self.simple_mesh(),
            3 => {
                let count = 2 + self.below(3);
                (0..count).fold(Soup::default(), |union, _| {
                    let by = (self.vector() * 0.6).to_array();
                    union.and(self.simple_mesh().moved(by))
                })
            }
            4 => {
                let shape = self.simple_mesh();
                let count = 2 + self.below(4);
                (0..count).fold(Soup::default(), |nest, index| {
                    nest.and(shape.clone().scaled(1.0 - 0.17 * index as f32))
                })
            }
            5 => {
                let thin = self.between(0.003, 0.1) as f32;
                shapes::cuboid([-1.0, -thin, -thin], [1.0, thin, thin])
            }
            6 => self.displaced_sphere(0.2, 1.3),
            _ => {
                // Inside out as a whole.
                self.simple_mesh().flipped(|_| true)
            }
        }
    }

    /// One closed surface of about unit size; it may pass through itself.
    fn simple_mesh(&mut self) -> Soup {
        match self.below(4) {
            0 => self.displaced_sphere(0.6, 1.0),
            1 => {
                let jitter = self.between(0.0, 0.4) as f32;
                let low = [-0.7, -0.5, -0.8];
                shapes::cuboid(low, low.map(|side: f32| -side))
                    .map(|corner| corner + self.vector() * jitter)
            }
            2 => {
                let (radius, tube) = (self.between(0.3, 0.8), self.between(0.1, 0.4));
                let (around, across) = (3 + self.below(12), 3 + self.below(6));
                shapes::torus(radius as f32, tube as f32, around as u32, across as u32)
            }
            _ => {
                let corners = (0..4).map(|_| self.vector()).collect();
                Soup::new(corners, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
            }
        }
    }

    fn displaced_sphere(&mut self, low: f64, high: f64) -> Soup {
        let (rings, sectors) = (3 + self.below(6), 3 + self.below(9));
        let ball = shapes::sphere(1.0, rings as u32, sectors as u32);
        let displaced = ball.map(|towards| towards * self.between(low, high) as f32);
        Soup {
            normals: None,
            ..displaced
        }
    }

    /// A mesh of about unit size that bounds nothing, or not as its triangles say.
    pub fn broken_mesh(&mut self) -> Soup {
        let share = self.between(0.05, 0.6);
        match self.below(9) {
            0 => {
                let count = 1 + self.below(40);
                let size = self.between(0.2, 1.0) as f32;
                let triangles = (0..count as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]);
                let corners = (0..count).flat_map(|_| {
                    let middle = self.vector() * (1.0 - 0.5 * size);
                    [0; 3].map(|_| middle + self.vector() * size)
                });
                Soup::new(corners.collect(), triangles.collect())
            }
            1 => {
                let mesh = self.closed_mesh();
                let kept = self.below(mesh.triangles.len());
                mesh.without(|index| index != kept && self.chance(share))
            }
            2 => self.closed_mesh().flipped(|_| self.chance(share)),
            3 => {
                let reversed = self.chance(0.5);
                self.closed_mesh().doubled(|_| self.chance(share), reversed)
            }
            4 => {
                let steps = 6 + self.below(30);
                shapes::moebius(0.7, self.between(0.05, 0.3) as f32, steps as u32)
            }
            5 => {
                let mut mesh = self.closed_mesh();
                for _ in 0..1 + self.below(5) {
                    let [a, b, _] = mesh.triangles[self.below(mesh.triangles.len())];
                    let tip = mesh.positions.len() as u32;
                    mesh.positions.push(self.vector());
                    mesh.triangles.push([a, b, tip]);
                }
                mesh
            }
            6 => self.closed_mesh().unwelded(&mut Random(self.0), 0.0),
            7 => {
                // An open sheet of bumps.
                let sides = 1 + self.below(5) as u32;
                let mut sheet = Soup::default();
                for index in 0..(sides + 1) * (sides + 1) {
                    let [x, y] = [index % (sides + 1), index / (sides + 1)]
                        .map(|step| 2.0 * step as f32 / sides as f32 - 1.0);
                    let height = self.between(-0.3, 0.3) as f32;
                    sheet.positions.push(Vec3::new(x, y, height));
                }
                for index in 0..sides * sides {
                    let a = index / sides * (sides + 1) + index % sides;
                    let [b, c, d] = [a + 1, a + sides + 1, a + sides + 2];
                    sheet.triangles.extend([[a, b, d], [a, d, c]]);
                }
                sheet
            }
            _ => {
                // Triangles without area, of two corners and of three in a line.
                let mut mesh = self.closed_mesh();
                for index in 0..mesh.triangles.len() {
                    let [a, b, _] = mesh.triangles[index];
                    if self.chance(share) {
                        let middle = mesh.positions.len() as u32;
                        let [from, to] = [a, b].map(|corner| mesh.positions[corner as usize]);
                        mesh.positions.push((from + to) * 0.5);
                        mesh.triangles.push([a, middle, b]);
                    } else {
                        mesh.triangles.push([a, b, a]);
                    }
                }
                mesh
            }
        }
    }
}

/// A small scene of random things, some broken where `broken`, under one to three lights; all its places; and a lens.
pub fn random_stage(random: &mut Random, broken: bool) -> (Stage, Vec<DVec3>, Intrinsics) {
    let pose = |random: &mut Random| {
        let turn = DQuat::from_axis_angle(random.direction(), random.between(0.0, TAU));
        let place = random.vector_wide() * DVec3::new(0.15, 0.15, 0.1) + DVec3::Z * 0.1;
        DAffine3::from_rotation_translation(turn, place)
    };
    let mut places = Vec::new();
    let mut thing = |random: &mut Random| {
        let soup = if broken && random.chance(0.7) {
            random.broken_mesh()
        } else {
            random.closed_mesh()
        };
        let size = random.between(0.02, 0.12);
        let mut scale = DVec3::splat(size);
        if random.chance(0.3) {
            scale *= DVec3::new(random.between(0.3, 1.0), 1.0, random.between(0.3, 1.5));
        }
        if random.chance(0.2) {
            scale.y = -scale.y;
        }
        let anchor_from_thing = pose(random);
        let placed = anchor_from_thing * DAffine3::from_scale(scale);
        let middle = std::iter::once(DVec3::ZERO);
        let corners = soup.positions.iter().map(|position| position.as_dvec3());
        places.extend(middle.chain(corners).map(|p| placed.transform_point3(p)));
        let thing = Thing::made(soup)
            .placed(anchor_from_thing)
            .scaled(scale)
            .faceted();
        if random.chance(0.1) {
            thing.without_shadow()
        } else {
            thing
        }
    };
    let ground = match random.below(3) {
        0 => Thing::made(shapes::rectangle([-0.4, -0.4], [0.4, 0.4])),
        1 => Thing::made(shapes::cuboid([-0.4, -0.4, -0.05], [0.4, 0.4, 0.0])),
        _ => Thing::made(shapes::rectangle([-0.4, -0.4], [0.4, 0.4])).without_shadow(),
    };
    let mut phantoms = vec![ground];
    let (real, seeming) = (random.below(3), 1 + random.below(2));
    phantoms.extend((0..real).map(|_| thing(random)));
    let virtuals: Vec<Thing> = (0..seeming).map(|_| thing(random)).collect();
    let lights = (0..1 + random.below(3))
        .map(|_| random_light(random, &places))
        .collect();
    // The card's pose is one more rounding between light and caster.
    let world_from_card = DAffine3::from_rotation_translation(
        DQuat::from_rotation_z(random.between(0.0, 0.5)),
        random.vector_wide() * 0.02,
    );
    let ambient = DVec3::splat(random.between(0.02, 0.2));
    let mut stage = Stage::new(&phantoms, &virtuals, Some(world_from_card), lights, ambient);
    stage.scene.shadows.samples = if random.chance(0.5) { 4 } else { 1 };
    let size_px = [72, 54];
    let intrinsics = Intrinsics {
        size_px,
        focal_px: DVec2::splat(random.between(35.0, 130.0)),
        center_px: DVec2::new(random.between(30.0, 42.0), random.between(22.0, 32.0)),
        distortion: Distortion::NONE,
    };
    (stage, places, intrinsics)
}

fn random_light(random: &mut Random, places: &[DVec3]) -> Light {
    let near = |random: &mut Random, reach_m: f64| {
        places[random.below(places.len())] + random.direction() * random.between(0.004, reach_m)
    };
    let position_m = match random.below(8) {
        0 => near(random, 0.03),
        1 => near(random, 0.15),
        // In the middle of a thing, or at least of its hull.
        2 => near(random, 0.006),
        // Just above the ground.
        3 => {
            random.vector_wide() * DVec3::new(0.6, 0.6, 0.0)
                + DVec3::Z * random.between(0.003, 0.03)
        }
        4 => random.vector_wide() * DVec3::new(0.4, 0.4, 0.1) + DVec3::Z * 0.5,
        5 => random.direction() * random.between(0.5, 20.0),
        6 => return sun(random.direction().to_array(), [1.0; 3]),
        _ => {
            let slope = [random.between(-1.0, 1.0), random.between(-1.0, 1.0), -1.0];
            let straight = [0.0, 0.0, -1.0];
            return sun(if random.chance(0.3) { straight } else { slope }, [1.0; 3]);
        }
    };
    // As bright everywhere as one that is half a metre away, or half precision would end.
    let power = position_m.length_squared().max(0.01);
    lamp(position_m.to_array(), [power; 3])
}

pub fn random_camera(random: &mut Random, places: &[DVec3], lights: &[Light]) -> DAffine3 {
    let place = |random: &mut Random| places[random.below(places.len())];
    let (target, light) = (place(random), lights[random.below(lights.len())]);
    let towards_light = match light {
        Light::Point { position_m, .. } => position_m - target,
        Light::Directional { direction, .. } => -direction,
    };
    let (eye, target) = match random.below(7) {
        0 | 1 => {
            let side = random.direction() * random.between(0.3, 0.9);
            (DVec3::new(side.x, side.y, side.z.abs()), target * 0.5)
        }
        // Close to a thing, or in its hull.
        2 => (
            target + random.direction() * random.between(0.002, 0.1),
            place(random),
        ),
        // In its shadow, wherever that way looks.
        3 => {
            let eye = target - towards_light.normalize() * random.between(0.01, 0.3);
            (eye, eye + random.direction())
        }
        // From its shadow into the light.
        4 => {
            let eye = target - towards_light.normalize() * random.between(0.02, 0.2);
            (eye, eye + towards_light + random.vector_wide() * 0.1)
        }
        // From the light.
        5 => (target + towards_light, target),
        // On the ground.
        _ => {
            let eye = random.vector_wide() * DVec3::new(0.4, 0.4, 0.0) + DVec3::Z * 0.01;
            (eye, target)
        }
    };
    look_with_up(eye, target, random.direction())
}
