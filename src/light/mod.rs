//! Lights and reflection as plain values; radiance is linear RGB, 1 = display white at the camera's exposure.

pub mod bounce;
pub mod brightest;
pub mod chromaticities;
pub mod compact;
pub mod contrast;
pub mod prefiltered;
pub mod probe;
pub mod probe_maps;
pub mod probe_power;
pub mod radiance_picture;
pub mod response;

use std::f64::consts::PI;

use glam::DVec3;

/// A light without extent, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// Radiant intensity (W/sr up to the camera's exposure) from a point in metres.
    Point {
        /// Metres.
        position_m: DVec3,
        /// W/sr, linear RGB.
        intensity: DVec3,
    },
    /// Irradiance (W/m² up to the camera's exposure) on a plane across the unit direction in which the light travels.
    Directional {
        /// Unit direction in which the light travels.
        direction: DVec3,
        /// W/m², linear RGB.
        irradiance: DVec3,
    },
}

/// How a surface reflects light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub albedo: DVec3,
    /// α of the GGX layer of a dielectric in (0, 1]; `None`: Lambert alone.
    pub roughness: Option<f64>,
}

/// Irradiance that an unhidden light gives to a point with a unit normal, both in world space.
pub fn irradiance(light: &Light, point: DVec3, normal: DVec3) -> DVec3 {
    match *light {
        Light::Point {
            position_m,
            intensity,
        } => {
            let to_light = position_m - point;
            let distance_squared = to_light.length_squared().max(1e-12);
            let cosine = normal.dot(to_light) / distance_squared.sqrt();
            intensity * (cosine.max(0.0) / distance_squared)
        }
        Light::Directional {
            direction,
            irradiance,
        } => irradiance * (-normal.dot(direction)).max(0.0),
    }
}

/// The BRDF of a material for unit directions to the light and to the camera; the twin of `reflectance` in
/// shading.wgsl. Lambert under a dielectric GGX layer (Walter et al. 2007, Schlick's Fresnel term, height-correlated
/// Smith term), coupled so that both ways of light are equal and none is made (Ashikhmin & Shirley 2000, section 3).
pub fn reflectance(material: &Material, normal: DVec3, to_light: DVec3, to_camera: DVec3) -> DVec3 {
    let diffuse = material.albedo / PI;
    let cos_light = normal.dot(to_light);
    let Some(alpha) = material.roughness.filter(|_| cos_light > 0.0) else {
        return diffuse;
    };
    let cos_camera = normal.dot(to_camera).max(1e-3);
    let halfway = (to_light + to_camera).normalize_or_zero();
    let cos_half = normal.dot(halfway).clamp(0.0, 1.0);
    let alpha_squared = alpha * alpha;
    let spread = cos_half * cos_half * (alpha_squared - 1.0) + 1.0;
    let distribution = alpha_squared / (PI * spread * spread);
    let smith = |cosine: f64| (cosine * cosine * (1.0 - alpha_squared) + alpha_squared).sqrt();
    let visibility = 0.5 / (cos_light * smith(cos_camera) + cos_camera * smith(cos_light));
    let specular = distribution * visibility * fresnel(to_light.dot(halfway));
    // What the layer lets in and out again; the mean keeps a white material white.
    let let_through =
        (1.0 - fresnel(cos_light)) * (1.0 - fresnel(cos_camera)) / (1.0 - MEAN_FRESNEL);
    diffuse * let_through + specular
}

/// Cosine-weighted mean of [`fresnel`] over the hemisphere: F₀ + (1 − F₀) / 21.
const MEAN_FRESNEL: f64 = 0.04 + 0.96 / 21.0;

/// Schlick's approximation for a dielectric of index 1.5.
fn fresnel(cosine: f64) -> f64 {
    0.04 + 0.96 * (1.0 - cosine.clamp(0.0, 1.0)).powi(5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_falls_off_with_the_square_of_distance_and_the_cosine() {
        let lamp = Light::Point {
            position_m: DVec3::new(0.0, 0.0, 2.0),
            intensity: DVec3::splat(8.0),
        };
        assert!((irradiance(&lamp, DVec3::ZERO, DVec3::Z).x - 2.0).abs() < 1e-12);
        let tilted = DVec3::new(0.8, 0.0, 0.6);
        assert!((irradiance(&lamp, DVec3::ZERO, tilted).x - 1.2).abs() < 1e-12);
        assert_eq!(irradiance(&lamp, DVec3::ZERO, DVec3::NEG_Z), DVec3::ZERO);
        let sun = Light::Directional {
            direction: DVec3::NEG_Z,
            irradiance: DVec3::splat(3.0),
        };
        assert!((irradiance(&sun, DVec3::splat(7.0), tilted).x - 1.8).abs() < 1e-12);
    }

    #[test]
    fn no_material_reflects_more_than_arrives_and_light_may_be_turned_round() {
        for alpha in [0.1, 0.3, 1.0] {
            let material = Material {
                albedo: DVec3::ONE,
                roughness: Some(alpha),
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
