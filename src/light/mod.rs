//! Lights and reflection as plain values; radiance is linear RGB, 1 = display white at the camera's exposure.

pub mod bounce;
pub mod brightest;
pub mod chromaticities;
pub mod compact;
pub mod contrast;
pub mod form_factor;
pub mod harmonics;
pub mod irradiance_records;
pub mod layer_albedo;
pub mod material;
pub mod mean_surface;
pub mod pieces;
pub mod prefiltered;
pub mod probe;
pub mod probe_maps;
pub mod probe_power;
pub mod radiance9;
pub mod radiance_picture;
pub mod regions;
pub mod response;
pub mod texture;

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};

pub use material::Material;
use material::Shading;

/// Linear RGB's parts of luminance (ITU-R BT.709).
pub(crate) const REC_709: DVec3 = DVec3::new(0.2126, 0.7152, 0.0722);

/// A light that shines by itself, in one space (as a rule the world's).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// Light from a place: a point, or what is around it.
    Point {
        /// Its middle, metres.
        position_m: DVec3,
        /// W/sr up to the camera's exposure, linear RGB: of a spot and of a rectangle along the axis, of a sphere as it is from
        /// afar.
        intensity: DVec3,
        /// What shines there.
        shape: Shape,
    },
    /// Light from infinitely far away.
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
        /// Irradiance on a plane across it, W/m² up to the camera's exposure, linear RGB.
        irradiance: DVec3,
        /// Width of the disc that it comes from, radians; 0: it comes from one direction.
        angle_rad: f64,
    },
}

/// What shines at a [`Light::Point`]'s place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shape {
    /// A point, to all sides alike.
    Point,
    /// A point, within a cone.
    Spot {
        /// Unit direction of the axis.
        direction: DVec3,
        /// Angle to the axis up to which the light is whole, radians.
        inner_rad: f64,
        /// Angle to the axis from which on there is none, radians; more than `inner_rad`.
        outer_rad: f64,
    },
    /// A sphere of one radiance.
    Sphere {
        /// Metres.
        radius_m: f64,
    },
    /// One side of a rectangle of one radiance.
    Rect(Rect),
}

/// A rectangle that shines to one side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rect {
    /// Unit direction that it faces.
    pub facing: DVec3,
    /// Unit direction of its width, across `facing`.
    pub along: DVec3,
    /// Width and height, metres.
    pub size_m: DVec2,
}

impl Rect {
    /// A rectangle that faces a unit direction and whose height goes along `up`, but for what of that lies along `facing`; where
    /// all of it does, along y or else x. `size_m`: width and height.
    pub fn upright(facing: DVec3, up: DVec3, size_m: DVec2) -> Self {
        let ups = [up.normalize_or_zero(), DVec3::Y, DVec3::X];
        let sides = ups.map(|up| up.cross(facing));
        let along = sides.iter().find(|side| side.length() > 1e-6);
        Self {
            facing,
            along: along.map_or(DVec3::X, |side| side.normalize()),
            size_m,
        }
    }

    /// Unit direction of its height.
    pub fn up(&self) -> DVec3 {
        self.facing.cross(self.along)
    }

    /// Vectors from its middle to the middles of two of its sides, metres.
    pub fn half_sides_m(&self) -> [DVec3; 2] {
        [
            self.along * (0.5 * self.size_m.x),
            self.up() * (0.5 * self.size_m.y),
        ]
    }
}

impl Light {
    /// A point that shines to all sides; metres, and W/sr in linear RGB.
    pub fn point(position_m: DVec3, intensity: DVec3) -> Self {
        Self::Point {
            position_m,
            intensity,
            shape: Shape::Point,
        }
    }

    /// Light from one direction; a unit vector, and W/m² in linear RGB.
    pub fn directional(direction: DVec3, irradiance: DVec3) -> Self {
        Self::Directional {
            direction,
            irradiance,
            angle_rad: 0.0,
        }
    }

    /// The way from a place to its middle, and how far along it that is.
    pub fn way_from(&self, place_m: DVec3) -> (DVec3, f32) {
        match *self {
            Self::Point { position_m, .. } => (position_m - place_m, 1.0),
            Self::Directional { direction, .. } => (-direction, f32::INFINITY),
        }
    }

    /// The same light in another space, to which a rigid motion leads.
    pub fn moved(self, there_from_here: &DAffine3) -> Self {
        let turned = |way: DVec3| there_from_here.transform_vector3(way);
        match self {
            Self::Point {
                position_m,
                intensity,
                shape,
            } => Self::Point {
                position_m: there_from_here.transform_point3(position_m),
                intensity,
                shape: match shape {
                    Shape::Point | Shape::Sphere { .. } => shape,
                    Shape::Spot {
                        direction,
                        inner_rad,
                        outer_rad,
                    } => Shape::Spot {
                        direction: turned(direction),
                        inner_rad,
                        outer_rad,
                    },
                    Shape::Rect(rect) => Shape::Rect(Rect {
                        facing: turned(rect.facing),
                        along: turned(rect.along),
                        ..rect
                    }),
                },
            },
            Self::Directional {
                direction,
                irradiance,
                angle_rad,
            } => Self::Directional {
                direction: turned(direction),
                irradiance,
                angle_rad,
            },
        }
    }

    /// Whether its shadows have soft edges, however narrow.
    pub fn has_size(&self) -> bool {
        match *self {
            Self::Point { shape, .. } => match shape {
                Shape::Point | Shape::Spot { .. } => false,
                Shape::Sphere { .. } | Shape::Rect(_) => true,
            },
            Self::Directional { angle_rad, .. } => angle_rad > 0.0,
        }
    }
}

/// Irradiance that an unhidden light gives to a point with a unit normal, both in the light's space: exactly, also near a large
/// light, and of the part that is above the horizon.
pub fn irradiance(light: &Light, point: DVec3, normal: DVec3) -> DVec3 {
    match *light {
        Light::Point {
            position_m,
            intensity,
            shape,
        } => {
            let to_light = position_m - point;
            let distance_squared = to_light.length_squared().max(1e-12);
            let to_light = to_light / distance_squared.sqrt();
            let of_point = normal.dot(to_light).max(0.0) / distance_squared;
            intensity
                * match shape {
                    Shape::Point => of_point,
                    Shape::Spot { direction, .. } => {
                        of_point * spot_part(&shape, -to_light.dot(direction))
                    }
                    Shape::Sphere { radius_m } => {
                        let area = PI * radius_m * radius_m;
                        let sine_squared = radius_m * radius_m / distance_squared;
                        form_factor::disc(normal.dot(to_light), sine_squared) / area
                    }
                    Shape::Rect(rect) => {
                        form_factor::rect(&rect, position_m - point, normal)
                            / (rect.size_m.x * rect.size_m.y)
                    }
                }
        }
        Light::Directional {
            direction,
            irradiance,
            angle_rad,
        } => {
            let cosine = -normal.dot(direction);
            irradiance
                * match angle_rad > 0.0 {
                    true => {
                        let sine_squared = (0.5 * angle_rad).sin().powi(2);
                        form_factor::disc(cosine, sine_squared) / (PI * sine_squared)
                    }
                    false => cosine.max(0.0),
                }
        }
    }
}

/// Part of a spot's intensity at an angle to its axis, of which the cosine is given; 1 for what is no spot. As lamps of glTF
/// fall off (KHR_lights_punctual, "Inner and Outer Cone Angles").
pub fn spot_part(shape: &Shape, cosine: f64) -> f64 {
    let Shape::Spot {
        inner_rad,
        outer_rad,
        ..
    } = *shape
    else {
        return 1.0;
    };
    let [scale, offset] = spot_ramp(inner_rad, outer_rad);
    (cosine * scale + offset).clamp(0.0, 1.0).powi(2)
}

/// Factor and summand that make a number from 0 at the outer angle to 1 at the inner of a cosine.
pub fn spot_ramp(inner_rad: f64, outer_rad: f64) -> [f64; 2] {
    let scale = 1.0 / (inner_rad.cos() - outer_rad.cos()).max(1e-6);
    [scale, -outer_rad.cos() * scale]
}

/// The BRDF of a material for unit directions to the light and to the camera, without its pictures; the twin of
/// `reflectance` in shading.wgsl. What is no metal is Lambert under a dielectric GGX layer (Walter et al. 2007, Schlick's
/// Fresnel term, height-correlated Smith term), coupled so that both ways of light are equal and none is made or lost
/// (Kelemen & Szirmay-Kalos 2001: by what the layer mirrors of light from everywhere), or Burley's (2012), as the material says;
/// a metal is the layer alone, in its colour.
pub fn reflectance(material: &Material, normal: DVec3, to_light: DVec3, to_camera: DVec3) -> DVec3 {
    let diffuse = material.albedo / PI;
    let cos_light = normal.dot(to_light);
    let Some(alpha) = material.layer_roughness().filter(|_| cos_light > 0.0) else {
        return diffuse;
    };
    let cos_camera = normal.dot(to_camera).max(1e-3);
    let halfway = (to_light + to_camera).normalize_or_zero();
    let cos_half = normal.dot(halfway).clamp(0.0, 1.0);
    let alpha_squared = alpha * alpha;
    let spread = cos_half * cos_half * (alpha_squared - 1.0) + 1.0;
    let distribution = alpha_squared / (PI * spread * spread);
    let lobe = distribution * layer_visibility(alpha, cos_light, cos_camera);
    let way = to_light.dot(halfway);
    let metal = lobe * (material.albedo + (DVec3::ONE - material.albedo) * grazing(way));
    // What the layer lets in and out again; the mean keeps a white material white.
    let let_through = |cosine| layer_albedo::let_through(alpha, cosine);
    let passed = let_through(Some(cos_light)) * let_through(Some(cos_camera)) / let_through(None);
    let below = match material.shading {
        Shading::Principled => burley(alpha, [cos_light, cos_camera], way),
        Shading::Lit | Shading::Unlit => passed,
    };
    let dielectric = diffuse * below + lobe * fresnel(way);
    dielectric.lerp(metal, material.metallic)
}

/// Times Lambert: what a rough surface throws back of grazing light (Burley 2012, section 5.3).
fn burley(alpha: f64, cosines: [f64; 2], cos_between: f64) -> f64 {
    let at_grazing = 2.0 * alpha.sqrt() * cos_between * cos_between - 0.5;
    let [light, camera] = cosines.map(|cosine| 1.0 + at_grazing * grazing(cosine));
    light * camera
}

/// The mean of `burley` over light from everywhere towards everywhere, with 0.6 as the half angle's squared cosine (the twin of
/// `mean_burley` in layer_albedo.wgsl has it towards one direction).
fn mean_burley(alpha: f64) -> f64 {
    let at_grazing = 1.2 * alpha.sqrt() - 0.5;
    // (Schlick's weight of grazing light is 1/21 on the average over all cosines.)
    (1.0 + at_grazing / 21.0).powi(2)
}

/// Height-correlated Smith term of GGX over four times both cosines.
fn layer_visibility(alpha: f64, cos_light: f64, cos_camera: f64) -> f64 {
    let alpha_squared = alpha * alpha;
    let smith = |cosine: f64| (cosine * cosine * (1.0 - alpha_squared) + alpha_squared).sqrt();
    0.5 / (cos_light * smith(cos_camera) + cos_camera * smith(cos_light))
}

/// What a dielectric of index 1.5 mirrors head-on.
const HEAD_ON: f64 = 0.04;

/// Schlick's approximation for a dielectric of index 1.5.
fn fresnel(cosine: f64) -> f64 {
    HEAD_ON + (1.0 - HEAD_ON) * grazing(cosine)
}

/// Schlick's weight of grazing light.
fn grazing(cosine: f64) -> f64 {
    (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_off_with_the_square_of_distance_and_the_cosine() {
        let lamp = Light::point(DVec3::new(0.0, 0.0, 2.0), DVec3::splat(8.0));
        assert!((irradiance(&lamp, DVec3::ZERO, DVec3::Z).x - 2.0).abs() < 1e-12);
        let tilted = DVec3::new(0.8, 0.0, 0.6);
        assert!((irradiance(&lamp, DVec3::ZERO, tilted).x - 1.2).abs() < 1e-12);
        assert_eq!(irradiance(&lamp, DVec3::ZERO, DVec3::NEG_Z), DVec3::ZERO);
        let sun = Light::directional(DVec3::NEG_Z, DVec3::splat(3.0));
        assert!((irradiance(&sun, DVec3::splat(7.0), tilted).x - 1.8).abs() < 1e-12);
    }

    /// The values are those of Mitsuba's principled material: base colour 0.5, specular 0.5.
    #[test]
    fn a_principled_dielectric_is_that_of_a_path_tracer() {
        for (roughness, cos_light, cos_camera, azimuth, expected) in [
            (1.0, 0.2, 0.6, 0.0, 0.242),
            (1.0, 0.1, 0.9, 0.0, 0.262),
            (1.0, 0.5, 0.9, PI / 2.0, 0.169),
            (0.6, 0.1, 0.3, 0.0, 0.255),
            (0.6, 0.95, 0.6, PI, 0.177),
            (0.3, 0.95, 0.9, 0.0, 0.161),
            (0.3, 0.1, 0.9, PI / 2.0, 0.144),
        ] {
            let material = Material {
                roughness: Some(roughness * roughness),
                shading: Shading::Principled,
                ..Material::matt(DVec3::splat(0.5))
            };
            let at = |cosine: f64, azimuth: f64| {
                let sine = (1.0 - cosine * cosine).sqrt();
                DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine)
            };
            let (to_light, to_camera) = (at(cos_light, azimuth), at(cos_camera, 0.0));
            let found = reflectance(&material, DVec3::Z, to_light, to_camera).x;
            assert!(
                (found - expected).abs() < 0.015 * expected,
                "{roughness} {cos_light} {cos_camera}: {found} {expected}"
            );
        }
    }

    #[test]
    fn no_material_reflects_more_than_arrives_and_light_may_be_turned_round() {
        for alpha in [0.1, 0.3, 1.0] {
            let material = Material {
                roughness: Some(alpha),
                ..Material::matt(DVec3::ONE)
            };
            let at = |polar: f64, azimuth: f64| {
                let (sine, cosine) = polar.sin_cos();
                DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine)
            };
            for camera in [0.1, 0.7, 1.3] {
                let to_camera = at(camera, 0.0);
                let steps = 400;
                let mut reflected = 0.0;
                for i in 0..steps {
                    for j in 0..steps {
                        let polar = (f64::from(i) + 0.5) / f64::from(steps) * PI / 2.0;
                        let to_light =
                            at(polar, (f64::from(j) + 0.5) / f64::from(steps) * 2.0 * PI);
                        let area =
                            polar.sin() * PI / 2.0 / f64::from(steps) * 2.0 * PI / f64::from(steps);
                        reflected += reflectance(&material, DVec3::Z, to_light, to_camera).x
                            * polar.cos()
                            * area;
                    }
                }
                assert!(
                    reflected > 0.5 && reflected < 1.02,
                    "alpha {alpha} camera {camera}: {reflected}"
                );
            }
            let (one, other) = (at(0.4, 0.3), at(1.1, 2.0));
            let forth = reflectance(&material, DVec3::Z, one, other);
            let back = reflectance(&material, DVec3::Z, other, one);
            assert!((forth - back).length() < 1e-12);
        }
    }
}
