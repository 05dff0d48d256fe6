//! The power that comes from parts of a probe, without looking at each pixel: a summed-area table (Crow 1984).

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::REC_709;
use super::probe::Probe;

/// Luminous power of a probe's directions, summed up over its rows and columns.
pub struct ProbePower {
    size_px: [usize; 2],
    /// Power above and left of each corner of pixels, row by row.
    sums: Vec<f64>,
}

impl ProbePower {
    /// Sums a probe up by its luminance (Rec. 709).
    pub fn new(probe: &Probe) -> Self {
        let [width, height] = probe.size_px();
        let mut sums = vec![0.0; (width + 1) * (height + 1)];
        for row in 0..height {
            let solid_angle = probe.pixel_solid_angle(row);
            let mut left = 0.0;
            for column in 0..width {
                let pixel = probe.pixels()[row * width + column].as_dvec3();
                left += pixel.dot(REC_709) * solid_angle;
                let above = sums[row * (width + 1) + column + 1];
                sums[(row + 1) * (width + 1) + column + 1] = above + left;
            }
        }
        Self {
            size_px: [width, height],
            sums,
        }
    }

    /// Power from all directions: the integral of radiance over the sphere.
    pub fn whole(&self) -> f64 {
        self.sums[self.sums.len() - 1]
    }

    /// Mean radiance of all directions.
    pub fn mean(&self) -> f64 {
        self.whole() / (4.0 * PI)
    }

    /// Mean radiance of the smallest rectangle in latitude and longitude around a cone: a direction of any length but zero
    /// and a half angle in radians.
    pub fn mean_around(&self, direction: DVec3, half_angle: f64) -> f64 {
        let polar = direction.z.atan2(direction.truncate().length());
        let polar = PI / 2.0 - polar;
        let (low, high) = (
            (polar - half_angle).max(0.0),
            (polar + half_angle).clamp(1e-9, PI),
        );
        let reaches_pole = polar - half_angle <= 0.0 || polar + half_angle >= PI;
        let half_width = match reaches_pole {
            true => PI,
            false => (half_angle.sin() / polar.sin()).clamp(-1.0, 1.0).asin(),
        };
        let middle = direction.y.atan2(direction.x) + PI;
        let part = |azimuth: f64, polar: f64| self.before(azimuth / TAU, polar);
        let (first, last) = (middle - half_width, middle + half_width);
        let power = part(last, high) - part(first, high) - part(last, low) + part(first, low);
        let solid_angle = 2.0 * half_width * (low.cos() - high.cos());
        (power / solid_angle.max(1e-30)).max(0.0)
    }

    /// Power above a polar angle and left of an azimuth, in turns; it goes on around.
    fn before(&self, turns: f64, polar: f64) -> f64 {
        let [width, height] = self.size_px;
        let row = (polar / PI * height as f64).clamp(0.0, height as f64);
        let upper = (row as usize).min(height - 1);
        let cosine = |row: usize| (row as f64 / height as f64 * PI).cos();
        // Within a row power grows as its solid angle does.
        let down = (cosine(upper) - polar.cos()) / (cosine(upper) - cosine(upper + 1));
        let at = |column: usize| {
            let [above, below] =
                [upper, upper + 1].map(|row| self.sums[row * (width + 1) + column]);
            above + (below - above) * down.clamp(0.0, 1.0)
        };
        let (around, column) = (turns.floor(), (turns - turns.floor()) * width as f64);
        let left = (column as usize).min(width - 1);
        let across = column - left as f64;
        around * at(width) + at(left) + (at(left + 1) - at(left)) * across
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn an_even_probe_has_its_radiance_around_every_direction() {
        let power = ProbePower::new(&Probe::new([64, 32], vec![Vec3::splat(2.5); 2048]).unwrap());
        assert!((power.mean() - 2.5).abs() < 1e-6);
        for direction in [
            DVec3::X,
            DVec3::NEG_X,
            DVec3::Z,
            DVec3::new(0.3, -0.9, -2.0),
        ] {
            for half_angle in [1e-4, 0.01, 0.3, 1.4] {
                let mean = power.mean_around(direction, half_angle);
                assert!(
                    (mean - 2.5).abs() < 1e-5,
                    "{direction} {half_angle}: {mean}"
                );
            }
        }
    }

    #[test]
    fn a_pixel_s_power_is_found_wherever_a_cone_holds_it() {
        let mut pixels = vec![Vec3::ZERO; 64 * 32];
        pixels[12 * 64] = Vec3::ONE;
        let probe = Probe::new([64, 32], pixels).unwrap();
        let power = ProbePower::new(&probe);
        let solid_angle = probe.pixel_solid_angle(12);
        // The first column lies where the azimuth ends and begins.
        let middle = probe.direction(0.5, 12.5);
        let wide: f64 = 0.2;
        let polar = middle.z.acos();
        let width = 2.0 * (wide.sin() / polar.sin()).asin();
        let rectangle = width * ((polar - wide).cos() - (polar + wide).cos());
        let found = power.mean_around(middle, wide) * rectangle;
        assert!(
            (found / solid_angle - 1.0).abs() < 1e-6,
            "{found} {solid_angle}"
        );
        assert!(power.mean_around(-middle, wide) < 1e-9);
        assert!((power.mean_around(middle, 0.01) - 1.0).abs() < 1e-5);
    }
}
