//! Spherical harmonics to the second degree (Ramamoorthi & Hanrahan 2001): nine numbers say what light a diffuse surface
//! gets, whichever way it faces, to a percent or so.

use std::f32::consts::PI;

use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Radiance over all directions: coefficients of the real harmonics of degree 0, 1 and 2.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Radiance9(pub [Vec3; 9]);

/// The real harmonics in a unit direction.
pub fn basis(direction: Vec3) -> [f32; 9] {
    let Vec3 { x, y, z } = direction;
    [
        0.282_094_8,
        0.488_602_5 * y,
        0.488_602_5 * z,
        0.488_602_5 * x,
        1.092_548_4 * x * y,
        1.092_548_4 * y * z,
        0.315_391_57 * (3.0 * z * z - 1.0),
        1.092_548_4 * x * z,
        0.546_274_2 * (x * x - y * y),
    ]
}

/// The part that the cosine lobe leaves of each degree.
const COSINE: [f32; 3] = [PI, 2.0 * PI / 3.0, PI / 4.0];

impl Radiance9 {
    /// Adds radiance from a unit direction over a solid angle, steradians.
    pub fn add(&mut self, direction: Vec3, radiance_solid_angle: Vec3) {
        for (coefficient, basis) in self.0.iter_mut().zip(basis(direction)) {
            *coefficient += radiance_solid_angle * basis;
        }
    }

    /// Irradiance of a surface with a unit normal; never negative.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        let degree = [0, 1, 1, 1, 2, 2, 2, 2, 2];
        let parts = self.0.iter().zip(basis(normal)).zip(degree);
        parts
            .map(|((&coefficient, basis), degree)| coefficient * (basis * COSINE[degree]))
            .sum::<Vec3>()
            .max(Vec3::ZERO)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::harmonics::sphere;

    fn of(radiance: impl Fn(Vec3) -> f32) -> Radiance9 {
        let mut sum = Radiance9::default();
        let count = 20_000;
        for direction in sphere(count) {
            let share = 4.0 * PI / count as f32;
            let direction = direction.as_vec3();
            sum.add(direction, Vec3::splat(radiance(direction) * share));
        }
        sum
    }

    #[test]
    fn the_irradiance_of_smooth_surroundings_is_exact() {
        // Radiance 1 + z gives π + 2π/3 to what faces up (∫ cos² over the hemisphere) and π − 2π/3 to what faces down.
        let sky = of(|direction| 1.0 + direction.z);
        for (normal, expected) in [
            (Vec3::Z, PI + 2.0 * PI / 3.0),
            (Vec3::NEG_Z, PI - 2.0 * PI / 3.0),
            (Vec3::X, PI),
        ] {
            let found = sky.irradiance(normal).x;
            assert!((found - expected).abs() < 2e-3, "{found} {expected}");
        }
    }

    #[test]
    fn a_bright_upper_half_gives_its_closed_form_within_the_bands_error() {
        let sky = of(|direction| f32::from(direction.z > 0.0));
        assert!((sky.irradiance(Vec3::Z).x - PI).abs() < 0.1);
        assert!((sky.irradiance(Vec3::X).x - PI / 2.0).abs() < 0.02);
    }
}
