//! Light from all around as rays meet it: what comes from a direction, and what a surface gets that nothing hides it from.

use glam::{DVec3, Vec3};

use crate::light::probe::Probe;
use crate::light::radiance9::Radiance9;

/// Rows for each root of the rays of a hemisphere: a pixel is about as wide as the rays are apart.
const ROWS_PER_ROOT: f64 = 2.0;
/// Rows at least, and at most.
const ROWS: [usize; 2] = [8, 128];

/// Radiance by direction, as fine as rays can tell.
#[derive(Debug, Clone)]
pub struct Sky {
    /// Means of the probe's pixels, each weighted by its solid angle.
    means: Probe,
    harmonics: Radiance9,
}

impl Sky {
    /// A probe's radiance times `exposure`, for so many rays over each hemisphere.
    pub fn new(probe: &Probe, exposure: f64, rays: usize) -> Self {
        let [width, height] = probe.size_px();
        let [fewest, most] = ROWS;
        let rows = (ROWS_PER_ROOT * (rays as f64).sqrt()) as usize;
        let rows = rows.clamp(fewest, most).min(height);
        let columns = (2 * rows).min(width);
        let mut sums = vec![(DVec3::ZERO, 0.0); rows * columns];
        let mut harmonics = Radiance9::default();
        for (index, pixel) in probe.pixels().iter().enumerate() {
            let (column, row) = (index % width, index / width);
            let solid_angle = probe.pixel_solid_angle(row);
            let radiance = pixel.as_dvec3() * exposure;
            let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
            harmonics.add(direction.as_vec3(), (radiance * solid_angle).as_vec3());
            let (sum, weight) = &mut sums[row * rows / height * columns + column * columns / width];
            *sum += radiance * solid_angle;
            *weight += solid_angle;
        }
        let means = sums.iter();
        let means = means.map(|(sum, weight)| (*sum / weight.max(1e-300)).as_vec3());
        Self {
            means: Probe::new([columns, rows], means.collect()).unwrap_or_default(),
            harmonics,
        }
    }

    /// The same radiance from everywhere.
    pub fn constant(radiance: DVec3) -> Self {
        let pixels = vec![radiance.as_vec3(); 2];
        let mut harmonics = Radiance9::default();
        // (The harmonic of degree 0 over the sphere.)
        harmonics.0[0] = (radiance * (4.0 * std::f64::consts::PI).sqrt()).as_vec3();
        Self {
            means: Probe::new([2, 1], pixels).unwrap_or_default(),
            harmonics,
        }
    }

    /// What comes from a direction of unit length.
    pub fn radiance(&self, direction: Vec3) -> Vec3 {
        self.means.radiance(direction.as_dvec3())
    }

    /// Irradiance of a surface with a unit normal that sees all of it.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        self.harmonics.irradiance(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    /// A gradient with a bright spot.
    fn probe() -> Probe {
        let size_px = [96, 48];
        let black = Probe::new(size_px, vec![Vec3::ZERO; 96 * 48]).expect("pixels");
        let spot = DVec3::new(0.3, -0.5, 0.8).normalize();
        let pixel = |index: usize| {
            let direction = black.direction((index % 96) as f64 + 0.5, (index / 96) as f64 + 0.5);
            let bright = direction.dot(spot).max(0.0).powi(40) * 20.0;
            DVec3::new(1.0 + direction.z, 1.0 - 0.5 * direction.x, bright).as_vec3()
        };
        Probe::new(size_px, (0..96 * 48).map(pixel).collect()).expect("pixels")
    }

    fn power(probe: &Probe) -> DVec3 {
        let [width, _] = probe.size_px();
        let pixels = probe.pixels().iter().enumerate();
        pixels
            .map(|(index, pixel)| pixel.as_dvec3() * probe.pixel_solid_angle(index / width))
            .sum()
    }

    #[test]
    fn means_keep_the_power() {
        for rays in [16, 64, 100, 1024] {
            let sky = Sky::new(&probe(), 2.0, rays);
            let (means, whole) = (power(&sky.means), 2.0 * power(&probe()));
            // (Where rows are no multiple of rows, a mean's weight is not just its pixel's solid angle.)
            assert!(
                means.distance(whole) < 0.03 * whole.length(),
                "{rays}: {means} {whole}"
            );
        }
    }

    #[test]
    fn one_radiance_gives_all_surfaces_pi_times_it() {
        let sky = Sky::constant(DVec3::new(0.5, 1.0, 2.0));
        for way in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)] {
            assert_eq!(sky.radiance(way), Vec3::new(0.5, 1.0, 2.0));
            let found = sky.irradiance(way) / PI;
            assert!(found.distance(Vec3::new(0.5, 1.0, 2.0)) < 1e-5, "{found}");
        }
    }
}
