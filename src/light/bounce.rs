//! The light that reaches a virtual surface from its surroundings: the ambient light where nothing hides it, and what
//! the things around throw back of the lights and of what reaches them from around. A white sheet under a lamp lights what
//! stands on it more than the room does.
//!
//! What stands still is gathered once ([`Surroundings::gather`]): the rays of each point with what they met. What moves
//! then only takes from those rays what it hides ([`Gathering::irradiances`]), frame by frame.

use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::ray_caster::RayCaster;

use super::{Light, irradiance};

/// Rays per point where there are few points; more change no diffuse thing by a level of the display.
const MOST_RAYS: usize = 256;
/// Rays per point of a mesh of any size.
const LEAST_RAYS: usize = 32;
/// Rays start this part of the surroundings' size off the surface, past its own rounding.
const START_OFFSET: f64 = 1e-5;

/// Steps from one ray to the next over the hemisphere of what they end on (Roberts 2018: powers of the plastic number's inverse).
const STEPS_OVER_AN_END: [f64; 2] = [0.754_877_666, 0.569_840_291];

/// What rays that end on a surface take from there beside what the lights give it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FurtherLight {
    /// The ambient light as if nothing hid it, which stands for what hides it and reflects other light.
    Estimated,
    /// The ambient light as far as nothing hides it.
    None,
    /// That, and what is reflected by what hides it.
    Bounce,
}

/// A diffuse triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reflector {
    /// Counter-clockwise seen from outside, metres.
    pub corners: [Vec3; 3],
    /// Diffuse reflectance, linear RGB.
    pub albedo: DVec3,
}

/// Everything that stands still around a virtual thing, itself included, in world space.
pub struct Surroundings {
    reflectors: Vec<Reflector>,
    caster: RayCaster,
    lights: Vec<ShiningLight>,
    ambient_radiance: DVec3,
    further: FurtherLight,
    start_offset_m: f64,
}

/// A light, and the places that it shines from.
#[derive(Clone)]
struct ShiningLight {
    light: Light,
    places: Vec<Light>,
}

impl ShiningLight {
    /// The way to it from a place on which a ray with this number ended, and the part of that at which it is.
    fn way_from(&self, place: DVec3, number: usize) -> (DVec3, f32) {
        // (Not each eighth: of a spiral by the golden angle these lie on one arm.)
        let part = (number as f64 * STEPS_OVER_AN_END[0]).fract();
        let which = (part * self.places.len() as f64) as usize;
        self.places[which].way_from(place)
    }
}

/// A place on a surface that a ray ended on.
struct End {
    /// A little off the surface.
    place: DVec3,
    normal: DVec3,
    albedo: DVec3,
    distance_m: f32,
}

/// Things that move together.
pub struct Mover {
    /// Their triangles, in a space of their own.
    caster: RayCaster,
    center: DVec3,
    albedo: DVec3,
}

impl Mover {
    /// Prepares what may hide or throw back light; `None` without triangles.
    pub fn new(reflectors: &[Reflector]) -> Option<Self> {
        let corners: Vec<_> = reflectors
            .iter()
            .map(|reflector| reflector.corners)
            .collect();
        let share = 1.0 / reflectors.len().max(1) as f64;
        let points = corners.iter().flatten().map(|corner| corner.as_dvec3());
        (!corners.is_empty()).then(|| Self {
            center: points.sum::<DVec3>() * (share / 3.0),
            albedo: reflectors
                .iter()
                .map(|reflector| reflector.albedo)
                .sum::<DVec3>()
                * share,
            caster: RayCaster::new(&corners),
        })
    }

    /// Takes another shape: the same triangles elsewhere, which are of the same colour on the whole.
    pub fn deform(&mut self, corners: &[[Vec3; 3]]) {
        let points = corners.iter().flatten().map(|corner| corner.as_dvec3());
        self.center = points.sum::<DVec3>() / (3 * corners.len().max(1)) as f64;
        self.caster = RayCaster::new(corners);
    }
}

/// The rays of many points, with what they met that stands still.
pub struct Gathering {
    starts: Vec<Vec3>,
    rays_per_point: usize,
    /// `rays_per_point` for each point.
    rays: Vec<GatheredRay>,
    /// For each ray and light the radiance that the light has its end throw back; zero where hidden.
    lit: Vec<Vec3>,
    lights: Vec<ShiningLight>,
    ambient_radiance: DVec3,
}

#[derive(Clone, Copy)]
struct GatheredRay {
    direction: Vec3,
    /// Metres; infinite where it meets nothing.
    distance_m: f32,
    /// Radiance along it that no light gives: the ambient light, or what its end throws back of it.
    unlit: Vec3,
}

impl Surroundings {
    /// Prepares what may hide or throw back light.
    pub fn new(
        reflectors: Vec<Reflector>,
        lights: Vec<Light>,
        ambient_radiance: DVec3,
        further: FurtherLight,
    ) -> Self {
        let corners: Vec<_> = reflectors
            .iter()
            .map(|reflector| reflector.corners)
            .collect();
        let points = || corners.iter().flatten();
        let size = points().copied().fold(Vec3::MIN, Vec3::max)
            - points().copied().fold(Vec3::MAX, Vec3::min);
        Self {
            caster: RayCaster::new(&corners),
            start_offset_m: f64::from(size.max_element().max(1e-3)) * START_OFFSET,
            reflectors,
            lights: lights
                .into_iter()
                .map(|light| ShiningLight {
                    light,
                    places: light.shining_from(),
                })
                .collect(),
            ambient_radiance,
            further,
        }
    }

    /// Rays against all of it.
    pub fn caster(&self) -> &RayCaster {
        &self.caster
    }

    /// Sends rays from points with unit normals, some `budget` in all.
    pub fn gather(&self, places: &[(DVec3, DVec3)], budget: usize) -> Gathering {
        let rays_per_point = (budget / places.len().max(1)).clamp(LEAST_RAYS, MOST_RAYS);
        /// Points that are looked at in one go.
        const CHUNK: usize = 16;
        let shares = places.par_chunks(CHUNK).map(|places| {
            let mut gathered = (Vec::new(), Vec::new());
            for &place in places {
                self.gather_point(place, rays_per_point, &mut gathered);
            }
            gathered
        });
        let (mut rays, mut lit) = (Vec::new(), Vec::new());
        for (share_rays, share_lit) in shares.collect::<Vec<_>>() {
            rays.extend(share_rays);
            lit.extend(share_lit);
        }
        Gathering {
            starts: places
                .iter()
                .map(|&place| self.start(place).as_vec3())
                .collect(),
            rays_per_point,
            rays,
            lit,
            lights: self.lights.clone(),
            ambient_radiance: self.ambient_radiance,
        }
    }

    fn start(&self, (point, normal): (DVec3, DVec3)) -> DVec3 {
        point + normal * self.start_offset_m
    }

    fn gather_point(
        &self,
        place: (DVec3, DVec3),
        count: usize,
        (rays, lit): &mut (Vec<GatheredRay>, Vec<Vec3>),
    ) {
        let (start, normal) = (self.start(place), place.1);
        let (tangent, bitangent) = normal.any_orthonormal_pair();
        for index in 0..count {
            // A golden-angle spiral over the disc, lifted on to the hemisphere (Malley): the same rays each time.
            let radius = ((index as f64 + 0.5) / count as f64).sqrt();
            let angle = TAU * 0.618_033_988_749_895 * index as f64;
            let (sine, cosine) = angle.sin_cos();
            let direction = tangent * (radius * cosine)
                + bitangent * (radius * sine)
                + normal * (1.0 - radius * radius).max(0.0).sqrt();
            rays.push(self.follow(start, direction, index, lit));
        }
    }

    fn follow(
        &self,
        start: DVec3,
        direction: DVec3,
        number: usize,
        lit: &mut Vec<Vec3>,
    ) -> GatheredRay {
        let single = direction.as_vec3();
        let Some(end) = self.end(start, direction) else {
            lit.extend(self.lights.iter().map(|_| Vec3::ZERO));
            let unlit = self.ambient_radiance.as_vec3();
            return GatheredRay {
                direction: single,
                distance_m: f32::INFINITY,
                unlit,
            };
        };
        let lights = self.lights.iter();
        lit.extend(lights.map(|light| {
            let arriving = self.arriving(light, &end, number);
            (end.albedo / PI * arriving).as_vec3()
        }));
        GatheredRay {
            direction: single,
            distance_m: end.distance_m,
            unlit: (end.albedo * self.arriving_from_around(&end, number)).as_vec3(),
        }
    }

    /// What a ray meets first.
    fn end(&self, start: DVec3, direction: DVec3) -> Option<End> {
        let (from, way) = (start.as_vec3(), direction.as_vec3());
        let hit = self.caster.first_hit(from, way, f32::INFINITY)?;
        let Reflector {
            corners: [a, b, c],
            albedo,
        } = self.reflectors[hit.triangle];
        let outward = (b - a).cross(c - a).as_dvec3().normalize_or_zero();
        let normal = if outward.dot(direction) > 0.0 {
            -outward
        } else {
            outward
        };
        Some(End {
            place: start + direction * f64::from(hit.distance) + normal * self.start_offset_m,
            normal,
            albedo,
            distance_m: hit.distance,
        })
    }

    /// Irradiance that a light gives a place.
    fn arriving(&self, light: &ShiningLight, at: &End, number: usize) -> DVec3 {
        let (to_light, reach) = light.way_from(at.place, number);
        let (from, way) = (at.place.as_vec3(), to_light.as_vec3());
        match self.caster.is_hidden(from, way, reach) {
            true => DVec3::ZERO,
            false => irradiance(&light.light, at.place, at.normal),
        }
    }

    /// The mean radiance that reaches a place from around, but for the lights themselves, as a single ray tells it.
    fn arriving_from_around(&self, at: &End, number: usize) -> DVec3 {
        if self.further == FurtherLight::Estimated {
            return self.ambient_radiance;
        }
        let Some(end) = self.end(at.place, from_end(at, number)) else {
            return self.ambient_radiance;
        };
        if self.further == FurtherLight::None {
            return DVec3::ZERO;
        }
        let lights = self.lights.iter();
        let direct: DVec3 = lights.map(|light| self.arriving(light, &end, number)).sum();
        // (Not along the direction that led here.)
        let toward = from_end(&end, number + 1);
        let (from, way) = (end.place.as_vec3(), toward.as_vec3());
        let ambient = match self.caster.is_hidden(from, way, f32::INFINITY) {
            true => DVec3::ZERO,
            false => self.ambient_radiance,
        };
        end.albedo * (direct / PI + ambient)
    }
}

/// A direction over the place that a ray with this number ended on, the more often the straighter.
fn from_end(at: &End, number: usize) -> DVec3 {
    let (tangent, bitangent) = at.normal.any_orthonormal_pair();
    let [part, turn] = STEPS_OVER_AN_END.map(|step| (0.5 + step * number as f64).fract());
    let (sine, cosine) = (TAU * turn).sin_cos();
    let radius = part.sqrt();
    tangent * (radius * cosine) + bitangent * (radius * sine) + at.normal * (1.0 - part).sqrt()
}

impl Gathering {
    /// Irradiance of each point, but for what the lights themselves give it: the cosine-weighted mean of the radiance
    /// that arrives, times π. `movers` come with where they are.
    pub fn irradiances(&self, movers: &[(&Mover, DAffine3)]) -> Vec<Vec3> {
        let placed: Vec<PlacedMover> = movers
            .iter()
            .map(|&(mover, place)| self.place(mover, place))
            .collect();
        let points = (0..self.starts.len()).into_par_iter();
        points
            .map(|point| self.irradiance(point, &placed))
            .collect()
    }

    fn place<'a>(&self, mover: &'a Mover, world_from_mover: DAffine3) -> PlacedMover<'a> {
        let center = world_from_mover.transform_point3(mover.center);
        // Seen from all sides alike, a lit thing shows a quarter of its lit face.
        let lit: DVec3 = self
            .lights
            .iter()
            .map(|ShiningLight { light, .. }| {
                irradiance(light, center, light.way_from(center).0.normalize_or_zero())
            })
            .sum();
        PlacedMover {
            caster: &mover.caster,
            mover_from_world: world_from_mover.inverse().as_affine3(),
            radiance: (mover.albedo * (self.ambient_radiance + lit / (4.0 * PI))).as_vec3(),
        }
    }

    fn irradiance(&self, point: usize, movers: &[PlacedMover<'_>]) -> Vec3 {
        let start = self.starts[point];
        let rays = point * self.rays_per_point..(point + 1) * self.rays_per_point;
        let mut sum = Vec3::ZERO;
        for (number, index) in rays.enumerate() {
            let ray = self.rays[index];
            let blocker = movers
                .iter()
                .find(|m| m.hides(start, ray.direction, ray.distance_m));
            if let Some(blocker) = blocker {
                sum += blocker.radiance;
                continue;
            }
            sum += ray.unlit;
            let count = self.lights.len();
            let lit = &self.lit[index * count..(index + 1) * count];
            for (light, &radiance) in self.lights.iter().zip(lit) {
                if radiance == Vec3::ZERO {
                    continue;
                }
                let end = start + ray.direction * ray.distance_m;
                let (to_light, reach) = light.way_from(end.as_dvec3(), number);
                if !movers
                    .iter()
                    .any(|m| m.hides(end, to_light.as_vec3(), reach))
                {
                    sum += radiance;
                }
            }
        }
        sum * (std::f32::consts::PI / self.rays_per_point as f32)
    }
}

struct PlacedMover<'a> {
    caster: &'a RayCaster,
    mover_from_world: glam::Affine3,
    /// What it throws back, about.
    radiance: Vec3,
}

impl PlacedMover<'_> {
    fn hides(&self, origin: Vec3, direction: Vec3, reach: f32) -> bool {
        let origin = self.mover_from_world.transform_point3(origin);
        let direction = self.mover_from_world.transform_vector3(direction);
        self.caster.is_hidden(origin, direction, reach)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At one point, by the most rays that are sent.
    fn irradiance_at(around: &Surroundings, point: DVec3, normal: DVec3) -> DVec3 {
        let places = vec![(point, normal); 16];
        let all = around.gather(&places, 16 * MOST_RAYS).irradiances(&[]);
        assert!(all.iter().all(|one| *one == all[0]));
        all[0].as_dvec3()
    }

    fn square(half_m: f32, z: f32, albedo: f64) -> [Reflector; 2] {
        let corner = |x: f32, y: f32| Vec3::new(x * half_m, y * half_m, z);
        [
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
            [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        ]
        .map(|corners| Reflector {
            corners,
            albedo: DVec3::splat(albedo),
        })
    }

    #[test]
    fn an_empty_furnace_gives_pi_times_its_radiance() {
        let empty = Surroundings::new(
            Vec::new(),
            Vec::new(),
            DVec3::new(1.0, 2.0, 3.0),
            FurtherLight::Estimated,
        );
        let irradiance = irradiance_at(&empty, DVec3::ZERO, DVec3::new(0.6, 0.0, 0.8));
        assert!((irradiance - PI * DVec3::new(1.0, 2.0, 3.0)).length() < 1e-5);
    }

    #[test]
    fn a_white_table_keeps_the_furnace_white() {
        let table = Surroundings::new(
            square(50.0, 0.0, 1.0).to_vec(),
            Vec::new(),
            DVec3::ONE,
            FurtherLight::Estimated,
        );
        for normal in [DVec3::X, DVec3::Z, DVec3::NEG_Z] {
            let irradiance = irradiance_at(&table, DVec3::new(0.0, 0.0, 0.1), normal);
            assert!(
                (irradiance - PI).abs().max_element() < 1e-5,
                "{normal} {irradiance}"
            );
        }
    }

    #[test]
    fn a_lit_table_lights_what_faces_it_by_its_form_factor() {
        // Distant light of irradiance E straight down on a wide table of albedo a: a surface facing down gets a E, one
        // that stands upright half of it.
        let light = Light::directional(DVec3::NEG_Z, DVec3::splat(2.0));
        let table = Surroundings::new(
            square(500.0, 0.0, 0.5).to_vec(),
            vec![light],
            DVec3::ZERO,
            FurtherLight::Estimated,
        );
        let above = DVec3::new(0.3, 0.2, 0.5);
        let down = irradiance_at(&table, above, DVec3::NEG_Z).x;
        let aside = irradiance_at(&table, above, DVec3::X).x;
        assert!(
            (down - 1.0).abs() < 0.01 && (aside - 0.5).abs() < 0.01,
            "{down} {aside}"
        );
        assert_eq!(irradiance_at(&table, above, DVec3::Z), DVec3::ZERO);
    }

    #[test]
    fn a_square_facing_its_parallel_twin_gets_the_closed_forms_share() {
        // Form factor from a point to a coaxial parallel square of side 2a at distance h (Howell's catalogue B-4, four
        // quarters): F = 4 / π · A/√(1+A²) · atan(A/√(1+A²)) with A = a/h.
        let (half_m, height) = (0.5, 0.4);
        let walls = Surroundings::new(
            square(half_m as f32, height as f32, 0.0).to_vec(),
            Vec::new(),
            DVec3::ONE,
            FurtherLight::Estimated,
        );
        let ratio: f64 = half_m / height;
        let slant = ratio / (1.0 + ratio * ratio).sqrt();
        let hidden = 4.0 / PI * slant * slant.atan();
        // Walls without albedo throw nothing back of the ambient light: what they hide is missing.
        let found = irradiance_at(&walls, DVec3::ZERO, DVec3::Z).x / PI;
        assert!(
            (found - (1.0 - hidden)).abs() < 0.01,
            "{found} {}",
            1.0 - hidden
        );
    }

    #[test]
    fn a_floor_below_a_disc_shines_as_far_as_the_disc_leaves_it_light() {
        // From below a disc's middle a place on the floor, some way aside, sees the disc by Howell's catalogue B-12 (a surface
        // parallel to a disc, off its axis).
        let (radius, height): (f64, f64) = (0.5, 0.3);
        let hidden_at = |aside: f64| {
            let (h, r) = (height / aside, radius / aside);
            let z = 1.0 + h * h + r * r;
            0.5 * (1.0 - (1.0 + h * h - r * r) / (z * z - 4.0 * r * r).sqrt())
        };
        // All of the disc's middle faces the floor: parts of it by the square of the sine.
        let steps = 10_000;
        let light = (0..steps).map(|step| {
            let sine_squared = (f64::from(step) + 0.5) / f64::from(steps);
            let aside = height * (sine_squared / (1.0 - sine_squared)).sqrt();
            1.0 - hidden_at(aside)
        });
        let expected = PI * light.sum::<f64>() / f64::from(steps);
        let corner = |step: u32| {
            let (sine, cosine) = (TAU * f64::from(step) / 256.0).sin_cos();
            DVec3::new(radius * cosine, radius * sine, height).as_vec3()
        };
        let disc = (0..256).map(|step| Reflector {
            corners: [Vec3::Z * height as f32, corner(step), corner(step + 1)],
            albedo: DVec3::ZERO,
        });
        let scene: Vec<Reflector> = disc.chain(square(100.0, 0.0, 1.0)).collect();
        let below = DVec3::new(0.0, 0.0, height - 1e-3);
        let found = |further| {
            let around = Surroundings::new(scene.clone(), Vec::new(), DVec3::ONE, further);
            irradiance_at(&around, below, DVec3::NEG_Z).x
        };
        for further in [FurtherLight::None, FurtherLight::Bounce] {
            let found = found(further);
            assert!(
                (found / expected - 1.0).abs() < 0.03,
                "{further:?}: {found} {expected}"
            );
        }
        // (What hides it counts as bright as what it hides, where nobody looks.)
        assert!((found(FurtherLight::Estimated) - PI).abs() < 1e-4);
    }

    #[test]
    fn light_in_a_hollow_sphere_is_followed_as_far_as_is_said() {
        // From its middle a lamp gives the same everywhere, and what that reflects does so too.
        let (radius, albedo, intensity) = (0.5, 0.6, 2.0);
        let at = |turn: u32, rise: u32| {
            let (sine, cosine) = (TAU * f64::from(turn) / 64.0).sin_cos();
            let (height, aside) = (PI * f64::from(rise) / 32.0).sin_cos();
            (radius * DVec3::new(height * cosine, height * sine, aside)).as_vec3()
        };
        let quads = (0..64).flat_map(|turn| (0..32).map(move |rise| (turn, rise)));
        let sphere = quads.flat_map(|(turn, rise)| {
            let [a, b] = [at(turn, rise), at(turn, rise + 1)];
            let [c, d] = [at(turn + 1, rise + 1), at(turn + 1, rise)];
            [[a, b, c], [a, c, d]].map(|corners| Reflector {
                corners,
                albedo: DVec3::splat(albedo),
            })
        });
        let sphere: Vec<Reflector> = sphere.collect();
        let lamp = Light::point(DVec3::ZERO, DVec3::splat(intensity));
        let first = albedo * intensity / (radius * radius);
        let way = DVec3::new(0.4, -0.5, 0.3).normalize();
        for (further, expected) in [
            (FurtherLight::Estimated, first),
            (FurtherLight::None, first),
            (FurtherLight::Bounce, first * (1.0 + albedo)),
        ] {
            let around = Surroundings::new(sphere.clone(), vec![lamp], DVec3::ZERO, further);
            let found = irradiance_at(&around, way * (radius - 0.01), -way).x;
            assert!(
                (found / expected - 1.0).abs() < 0.02,
                "{further:?}: {found} {expected}"
            );
        }
    }

    #[test]
    fn what_moves_takes_what_it_hides() {
        // The same plate, once as part of the standing surroundings and once as a mover, black both times.
        let light = Light::point(DVec3::new(0.2, 0.1, 2.0), DVec3::splat(3.0));
        let floor = square(2.0, 0.0, 0.8).to_vec();
        let plate = square(0.3, 0.0, 0.0);
        let lift = DAffine3::from_translation(DVec3::new(0.1, 0.0, 0.5));
        let lifted = plate.map(|reflector| Reflector {
            corners: reflector
                .corners
                .map(|c| lift.transform_point3(c.as_dvec3()).as_vec3()),
            ..reflector
        });
        let places = [
            (DVec3::new(-0.4, 0.1, 0.2), DVec3::X),
            (DVec3::new(0.5, 0.0, 0.3), DVec3::Z),
        ];
        let lights = vec![light];
        let standing = Surroundings::new(
            [floor.clone(), lifted.to_vec()].concat(),
            lights.clone(),
            DVec3::ONE,
            FurtherLight::Estimated,
        );
        let expected = standing.gather(&places, 1 << 20).irradiances(&[]);
        let floor_alone = Surroundings::new(floor, lights, DVec3::ONE, FurtherLight::Estimated)
            .gather(&places, 1 << 20);
        let mover = Mover::new(&plate).expect("triangles");
        for (expected, found) in expected
            .iter()
            .zip(floor_alone.irradiances(&[(&mover, lift)]))
        {
            assert!((*expected - found).length() < 1e-3, "{expected} {found}");
        }
        assert!((expected[0] - floor_alone.irradiances(&[])[0]).length() > 0.05);
    }
}
