//! Lights and reflection as plain values; radiance is linear RGB, 1 = display white at the camera's exposure.

use glam::DVec3;

/// A light without extent, in world space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Light {
    /// Radiant intensity (W/sr up to the camera's exposure) from a point in metres.
    Point { position_m: DVec3, intensity: DVec3 },
    /// Irradiance (W/m² up to the camera's exposure) on a plane across the unit direction in which the light travels.
    Directional { direction: DVec3, irradiance: DVec3 },
}

/// How a surface reflects light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Diffuse reflectance, linear RGB in [0, 1].
    pub albedo: DVec3,
    /// Roughness of the GGX layer of a dielectric in (0, 1]; `None`: Lambert alone.
    pub roughness: Option<f64>,
}
