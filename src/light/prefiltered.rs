//! A probe's light as rough surfaces mirror it: for each direction the mean over a GGX lobe about it (Karis 2013, the first of
//! his two sums), rougher from level to level.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DMat3, DVec3, Vec3};

use super::probe::Probe;

/// Columns of the sharpest level; rows are half as many, and each level has half of the one before.
pub const SHARPEST_PX: usize = 128;
/// The last level is as rough as can be.
pub const LEVELS: usize = 5;
/// Directions in a lobe of the second level; each further one, wider and with fewer pixels, has twice as many.
const SAMPLES: usize = 256;

/// The GGX α that a level is for: the square of what rises evenly.
pub fn roughness_of(level: usize) -> f64 {
    (level as f64 / (LEVELS - 1) as f64).powi(2)
}

/// All levels, of the probe's radiance times `exposure`.
pub fn prefiltered(probe: &Probe, exposure: f32) -> Vec<Probe> {
    let of_width = |width: usize| probe.resampled([width, width / 2]).exposed(exposure);
    // Lobes are wide: what they are drawn from need not be sharp, and a lamp in it is never missed.
    let softer = of_width(SHARPEST_PX / 2);
    let rough = (1..LEVELS).map(|level| {
        let size_px = [SHARPEST_PX >> level, (SHARPEST_PX / 2) >> level];
        let lobe = lobe(roughness_of(level), SAMPLES << level);
        Probe::by_direction(size_px, |axis| mean_over(&softer, axis, &lobe))
    });
    std::iter::once(of_width(SHARPEST_PX))
        .chain(rough)
        .collect()
}

/// A probe's mean over a lobe about an axis.
fn mean_over(probe: &Probe, axis: DVec3, lobe: &[(DVec3, f32)]) -> Vec3 {
    let (right, down) = axis.any_orthonormal_pair();
    let turned = DMat3::from_cols(right, down, axis);
    let parts = lobe
        .iter()
        .map(|&(way, share)| probe.radiance(turned * way) * share);
    parts.sum()
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
            for pixel in level.pixels() {
                assert!(
                    (*pixel / (color * 3.0) - 1.0).abs().max_element() < 1e-4,
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
            let parts = level.rays();
            let sum: DVec3 = parts
                .map(|(direction, radiance, angle)| direction * f64::from(radiance.x) * angle)
                .sum();
            let length = sum.length();
            assert!(sum.dot(lamp) / length > 0.98, "{:?}", level.size_px());
            let brightest = level.pixels().iter().map(|pixel| f64::from(pixel.x));
            let brightest = brightest.fold(0.0, f64::max);
            assert!(brightest < before, "{:?}", level.size_px());
            before = brightest;
        }
    }
}
