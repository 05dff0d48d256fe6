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
pub mod radiance_picture;
pub mod regions;
pub mod response;
mod shape;
pub mod srgb;
pub mod texture;

use std::f64::consts::PI;

use glam::{DAffine3, DVec3};

pub use material::Material;
use material::Shading;
pub use shape::{Rect, Shape, ShapeFrame, spot_part, spot_ramp};

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
                shape: shape.moved(there_from_here),
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
            Self::Point { shape, .. } => shape.has_size(),
            Self::Directional { angle_rad, .. } => angle_rad > 0.0,
        }
    }

    /// From its middle to its ends, metres; of distant light as parts of a unit of its way. None of what has no size.
    pub fn half_extents(&self) -> Vec<DVec3> {
        match *self {
            Self::Point { shape, .. } => shape.half_extents_m(),
            Self::Directional { angle_rad: 0.0, .. } => Vec::new(),
            Self::Directional {
                direction,
                angle_rad,
                ..
            } => {
                let (x, y) = direction.any_orthonormal_pair();
                [x, y].map(|way| way * (0.5 * angle_rad).tan()).to_vec()
            }
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
        } => intensity * shape.irradiance_per_intensity(position_m - point, normal),
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
