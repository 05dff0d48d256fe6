//! A probe's light as rough surfaces mirror it: for each direction the mean over a GGX lobe about it (Karis 2013, the first of
//! his two sums), rougher from level to level.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DMat3, DVec3, Vec3};
use rayon::prelude::*;

use super::probe::Probe;

/// Columns of the sharpest level; rows are half as many, and each level has half of the one before.
pub const SHARPEST_PX: usize = 128;
/// The last level is as rough as can be.
pub const LEVELS: usize = 5;
/// Directions in a lobe of the second level; each further one, wider and with fewer pixels, has twice as many.
const SAMPLES: usize = 256;

/// A level: latitude-longitude as a probe, rows from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct PrefilteredLevel {
    /// Columns and rows.
    pub size_px: [usize; 2],
    /// Radiance, linear RGB.
    pub pixels: Vec<Vec3>,
}

/// The GGX α that a level is for: the square of what rises evenly.
pub fn roughness_of(level: usize) -> f64 {
    (level as f64 / (LEVELS - 1) as f64).powi(2)
}

/// All levels, of the probe's radiance times `exposure`.
pub fn prefiltered(probe: &Probe, exposure: f32) -> Vec<PrefilteredLevel> {
    let sharpest = shrunk(probe, [SHARPEST_PX, SHARPEST_PX / 2], exposure);
    let whole = |level: &PrefilteredLevel| Probe::new(level.size_px, level.pixels.clone());
    // Lobes are wide: what they are drawn from need not be sharp, and a lamp in it is never missed.
    let softer = whole(&shrunk(probe, [SHARPEST_PX / 2, SHARPEST_PX / 4], exposure));
    let rough = (1..LEVELS).filter_map(|level| {
        let size_px = [SHARPEST_PX >> level, (SHARPEST_PX / 2) >> level];
        let lobe = lobe(roughness_of(level), SAMPLES << level);
        Some(filtered(softer.as_ref()?, size_px, &lobe))
    });
    let rough: Vec<PrefilteredLevel> = rough.collect();
    [vec![sharpest], rough].concat()
}

/// The mean radiance over each pixel of a smaller picture, times `exposure`.
pub fn shrunk(probe: &Probe, size_px: [usize; 2], exposure: f32) -> PrefilteredLevel {
    let [width, height] = size_px;
    let [columns, rows] = probe.size_px();
    // At least a sample in each of the probe's pixels.
    let steps = [columns.div_ceil(width), rows.div_ceil(height)];
    let mean = |pixel: usize| {
        let (mut sum, mut weight) = (Vec3::ZERO, 0.0);
        for down in 0..steps[1] {
            let row = (pixel / width) as f64 + (down as f64 + 0.5) / steps[1] as f64;
            let share = (row / height as f64 * PI).sin() as f32;
            for right in 0..steps[0] {
                let column = (pixel % width) as f64 + (right as f64 + 0.5) / steps[0] as f64;
                sum += probe.radiance(direction(column, row, size_px)) * share;
                weight += share;
            }
        }
        sum * (exposure / weight)
    };
    PrefilteredLevel {
        size_px,
        pixels: (0..width * height).map(mean).collect(),
    }
}

/// As [`Probe::direction`], of a picture of any size.
fn direction(column: f64, row: f64, [width, height]: [usize; 2]) -> DVec3 {
    let azimuth = column / width as f64 * TAU - PI;
    let (sine, cosine) = (row / height as f64 * PI).sin_cos();
    DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine)
}

fn filtered(probe: &Probe, size_px: [usize; 2], lobe: &[(DVec3, f32)]) -> PrefilteredLevel {
    let [width, height] = size_px;
    let mean = |pixel: usize| {
        let (column, row) = ((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
        let axis = direction(column, row, size_px);
        let (right, down) = axis.any_orthonormal_pair();
        let turned = DMat3::from_cols(right, down, axis);
        let parts = lobe
            .iter()
            .map(|&(way, share)| probe.radiance(turned * way) * share);
        parts.sum::<Vec3>()
    };
    PrefilteredLevel {
        size_px,
        pixels: (0..width * height).into_par_iter().map(mean).collect(),
    }
}

/// Directions that light comes from, mirrored along +z at microfacets of a surface that is seen from +z, and their
/// shares, which sum to 1.
fn lobe(alpha: f64, count: usize) -> Vec<(DVec3, f32)> {
    let ways = (0..count).map(|index| {
        let part = (index as f64 + 0.5) / count as f64;
        let azimuth = index as f64 * PI * (3.0 - 5.0_f64.sqrt());
        // Normals of microfacets as GGX spreads them (Walter et al. 2007, eq. 35).
        let tilt = (alpha * (part / (1.0 - part)).sqrt()).atan().min(FRAC_PI_2);
        let (sine, cosine) = (2.0 * tilt).sin_cos();
        let (across, along) = azimuth.sin_cos();
        DVec3::new(sine * along, sine * across, cosine)
    });
    let weighed: Vec<(DVec3, f64)> = ways.map(|way| (way, way.z.max(0.0))).collect();
    let sum: f64 = weighed.iter().map(|(_, weight)| weight).sum();
    weighed
        .into_iter()
        .map(|(way, weight)| (way, (weight / sum) as f32))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_that_is_the_same_all_around_stays_it() {
        let color = Vec3::new(0.5, 1.0, 2.0);
        let probe = Probe::new([64, 32], vec![color; 64 * 32]).unwrap();
        let levels = prefiltered(&probe, 3.0);
        assert_eq!(levels.len(), LEVELS);
        for level in levels {
            assert_eq!(level.pixels.len(), level.size_px[0] * level.size_px[1]);
            for pixel in level.pixels {
                assert!(
                    (pixel / (color * 3.0) - 1.0).abs().max_element() < 1e-4,
                    "{pixel}"
                );
            }
        }
    }

    #[test]
    fn a_lamp_widens_with_roughness_where_it_is() {
        // 2 x 2 pixels of 256 x 128 towards +x, a little above the horizon.
        let mut pixels = vec![Vec3::ZERO; 256 * 128];
        for (row, column) in [(60, 128), (60, 129), (61, 128), (61, 129)] {
            pixels[row * 256 + column] = Vec3::splat(1000.0);
        }
        let probe = Probe::new([256, 128], pixels).unwrap();
        let lamp = probe.direction(129.0, 61.0);
        let mut before = f64::INFINITY;
        for level in prefiltered(&probe, 1.0) {
            let [width, _] = level.size_px;
            let mut sum = DVec3::ZERO;
            for (index, pixel) in level.pixels.iter().enumerate() {
                let (column, row) = ((index % width) as f64 + 0.5, (index / width) as f64 + 0.5);
                let sine = (row / level.size_px[1] as f64 * PI).sin();
                sum += direction(column, row, level.size_px) * f64::from(pixel.x) * sine;
            }
            let length = sum.length();
            assert!(sum.dot(lamp) / length > 0.98, "{:?}", level.size_px);
            let brightest = level.pixels.iter().map(|pixel| f64::from(pixel.x));
            let brightest = brightest.fold(0.0, f64::max);
            assert!(brightest < before, "{:?}", level.size_px);
            before = brightest;
        }
    }
}
