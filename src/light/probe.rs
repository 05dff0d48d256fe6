//! A light probe: the radiance that arrives at one point from all directions, in world space (z up).

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};
use rayon::prelude::*;

/// Radiance by direction, linear RGB. Latitude-longitude: row 0 looks up (+z), u = (atan2(y, x) + π) / 2π.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Probe {
    size_px: [usize; 2],
    radiance: Vec<Vec3>,
}

impl Probe {
    /// From rows of radiance, the upper one first; `None` without pixels, or where the count does not fit.
    pub fn new(size_px: [usize; 2], radiance: Vec<Vec3>) -> Option<Self> {
        let [width, height] = size_px;
        (width > 0 && radiance.len() == width.checked_mul(height)?)
            .then_some(Self { size_px, radiance })
    }

    /// Of so many pixels, by the radiance from the direction of each one's middle, a unit vector.
    pub fn by_direction(size_px: [usize; 2], radiance: impl Fn(DVec3) -> Vec3 + Sync) -> Self {
        let [width, height] = size_px;
        let pixel = |index: usize| {
            let (column, row) = ((index % width) as f64, (index / width) as f64);
            radiance(direction(column + 0.5, row + 0.5, size_px))
        };
        Self {
            size_px,
            radiance: (0..width * height).into_par_iter().map(pixel).collect(),
        }
    }

    /// Columns and rows.
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// Rows of radiance, the upper one first.
    pub fn pixels(&self) -> &[Vec3] {
        &self.radiance
    }

    /// Each pixel, row by row, as what it sends: the unit direction of its middle, its radiance, its solid angle in steradians.
    pub fn rays(&self) -> impl Iterator<Item = (DVec3, Vec3, f64)> {
        let columns = self.columns();
        (0..self.size_px[1]).flat_map(move |row| self.row(row, Arc::clone(&columns)))
    }

    /// The same of one row of pixels.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn rays_of_row(&self, row: usize) -> impl Iterator<Item = (DVec3, Vec3, f64)> {
        self.row(row, self.columns())
    }

    /// Unit vectors across the vertical towards the columns' middles.
    fn columns(&self) -> Arc<[DVec2]> {
        let [width, _] = self.size_px;
        let columns = (0..width).map(|column| across(column as f64 + 0.5, width));
        columns.collect()
    }

    fn row(&self, row: usize, columns: Arc<[DVec2]>) -> impl Iterator<Item = (DVec3, Vec3, f64)> {
        let [width, height] = self.size_px;
        let (sine, cosine) = upright(row as f64 + 0.5, height);
        let solid_angle = self.pixel_solid_angle(row);
        let pixels = self.radiance[row * width..(row + 1) * width].iter();
        pixels.enumerate().map(move |(column, &radiance)| {
            let direction = (sine * columns[column]).extend(cosine);
            (direction, radiance, solid_angle)
        })
    }

    /// It where it has no more than so many columns and rows, or else the same light in these.
    pub fn at_most(&self, most_px: [usize; 2]) -> Cow<'_, Self> {
        let is_finer = (0..2).any(|axis| self.size_px[axis] > most_px[axis]);
        match is_finer {
            true => Cow::Owned(self.coarser(most_px)),
            false => Cow::Borrowed(self),
        }
    }

    /// It where it has as many columns and rows as this or none, or else the same light in pixels that are parts of its own.
    pub fn at_least(&self, least_px: [usize; 2]) -> Cow<'_, Self> {
        let times = (0..2).map(|axis| least_px[axis].div_ceil(self.size_px[axis].max(1)));
        match times.max().unwrap_or(1) {
            times if times > 1 && !self.radiance.is_empty() => {
                Cow::Owned(self.resampled(self.size_px.map(|side| side * times)))
            }
            _ => Cow::Borrowed(self),
        }
    }

    /// The same light in no more than so many columns and rows.
    pub fn coarser(&self, most_px: [usize; 2]) -> Self {
        self.resampled([0, 1].map(|axis| self.size_px[axis].min(most_px[axis].max(1))))
    }

    /// The same light in so many columns and rows, each pixel the mean over the solid angle that it is of; black where there
    /// are no pixels.
    pub fn resampled(&self, size_px: [usize; 2]) -> Self {
        let [width, height] = size_px;
        let columns = overlaps(self.size_px[0], width, |part| part * TAU);
        let rows = overlaps(self.size_px[1], height, |part| -(part * PI).cos());
        let row = |over: &Vec<(usize, f64)>| {
            let mut above = vec![DVec3::ZERO; self.size_px[0]];
            for &(row, share) in over {
                let pixels = &self.radiance[row * self.size_px[0]..][..self.size_px[0]];
                for (sum, radiance) in above.iter_mut().zip(pixels) {
                    *sum += radiance.as_dvec3() * share;
                }
            }
            let means = columns.iter().map(|over| {
                let parts = over.iter().map(|&(column, share)| above[column] * share);
                parts.sum::<DVec3>().as_vec3()
            });
            means.collect::<Vec<Vec3>>()
        };
        Self {
            size_px,
            radiance: rows.par_iter().flat_map_iter(row).collect(),
        }
    }

    /// All of it so many times as bright.
    #[must_use]
    pub fn exposed(mut self, factor: f32) -> Self {
        for radiance in &mut self.radiance {
            *radiance *= factor;
        }
        self
    }

    /// Puts another radiance into a pixel.
    pub(super) fn set_pixel(&mut self, index: usize, radiance: Vec3) {
        self.radiance[index] = radiance;
    }

    /// Radiance from the pixel that a direction of any length falls into; of no pixels, none.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let [width, height] = self.size_px;
        let u = (direction.y.atan2(direction.x) + PI) / TAU;
        let v = (direction.z / direction.length()).clamp(-1.0, 1.0).acos() / PI;
        let pixel =
            |part: f64, count: usize| ((part * count as f64) as usize).min(count.saturating_sub(1));
        let found = self
            .radiance
            .get(pixel(v, height) * width + pixel(u, width));
        found.copied().unwrap_or_default()
    }

    /// Unit direction of a place in the picture, in pixels from its upper left corner.
    pub fn direction(&self, column: f64, row: f64) -> DVec3 {
        direction(column, row, self.size_px)
    }

    /// Solid angle of each pixel of a row, steradians.
    pub fn pixel_solid_angle(&self, row: usize) -> f64 {
        let [width, height] = self.size_px;
        let cosine = |row: usize| (row as f64 / height as f64 * PI).cos();
        TAU / width as f64 * (cosine(row) - cosine(row + 1))
    }
}

/// For each of `to` equal parts of a line those of its `from` equal parts that it overlaps, with their shares of it, which sum
/// to 1, where the line up to a place (of 0 to 1) measures `measure`, which rises.
fn overlaps(from: usize, to: usize, measure: impl Fn(f64) -> f64) -> Vec<Vec<(usize, f64)>> {
    let part = |index: usize| {
        // In units of a part of both kinds at once, ends are whole numbers.
        let (start, end) = (index * from, (index + 1) * from);
        let between = |a: usize, b: usize| {
            measure(b as f64 / (from * to) as f64) - measure(a as f64 / (from * to) as f64)
        };
        let whole = between(start, end);
        let parts = start / to..end.div_ceil(to);
        let shares = parts.map(|at| {
            let share = between(start.max(at * to), end.min((at + 1) * to)) / whole;
            (at, share)
        });
        shares.collect()
    };
    (0..to).map(part).collect()
}

fn direction(column: f64, row: f64, [width, height]: [usize; 2]) -> DVec3 {
    let (sine, cosine) = upright(row, height);
    (sine * across(column, width)).extend(cosine)
}

/// The unit vector across the vertical towards a place of so many columns.
fn across(column: f64, width: usize) -> DVec2 {
    let azimuth = column / width as f64 * TAU - PI;
    DVec2::new(azimuth.cos(), azimuth.sin())
}

/// Sine and cosine of the angle between the vertical and a place of so many rows.
fn upright(row: f64, height: usize) -> (f64, f64) {
    (row / height as f64 * PI).sin_cos()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_and_pixels_agree_and_the_solid_angles_fill_the_sphere() {
        let size_px = [16, 8];
        let numbered = (0..128).map(|index| Vec3::splat(index as f32)).collect();
        let probe = Probe::new(size_px, numbered).expect("pixels");
        for row in 0..8 {
            for column in 0..16 {
                let direction = probe.direction(column as f64 + 0.5, row as f64 + 0.5);
                let found = probe.radiance(direction * 3.0).x;
                assert_eq!(found, (row * 16 + column) as f32);
            }
        }
        assert!(probe.direction(3.0, 0.0).distance(DVec3::Z) < 1e-12);
        assert!(probe.direction(8.0, 4.0).distance(DVec3::X) < 1e-12);
        let sphere: f64 = (0..8).map(|row| 16.0 * probe.pixel_solid_angle(row)).sum();
        assert!((sphere - 4.0 * PI).abs() < 1e-12);
        assert!(Probe::new([3, 2], vec![Vec3::ZERO; 5]).is_none());
    }

    #[test]
    fn a_coarser_probe_has_the_same_light() {
        let pixel = |index: usize| Vec3::new((index % 7) as f32, (index / 30) as f32, 1.0);
        let probe = Probe::new([30, 18], (0..540).map(pixel).collect()).expect("pixels");
        let sum = |probe: &Probe| -> DVec3 {
            let parts = probe.rays();
            let parts = parts.map(|(_, radiance, angle)| radiance.as_dvec3() * angle);
            parts.sum()
        };
        for (most_px, size_px) in [([10, 6], [10, 6]), ([64, 32], [30, 18]), ([7, 11], [7, 11])] {
            let coarser = probe.coarser(most_px);
            assert_eq!(coarser.size_px(), size_px);
            assert!((sum(&coarser) / sum(&probe) - 1.0).abs().max_element() < 1e-5);
        }
        // Finer too, and a small lamp gets neither brighter nor darker wherever it lies.
        for at in [0, 135, 271, 539] {
            let mut pixels = vec![Vec3::ZERO; 540];
            pixels[at] = Vec3::ONE;
            let lamp = Probe::new([30, 18], pixels).expect("pixels");
            for size_px in [[8, 4], [29, 17], [64, 32], [45, 18]] {
                let resampled = lamp.resampled(size_px);
                assert_eq!(resampled.size_px(), size_px);
                assert!((sum(&resampled) / sum(&lamp) - 1.0).abs().max_element() < 1e-5);
            }
        }
        // What is above stays above: the rows' numbers rise as far below the horizon as they are low above it.
        let halves = probe.coarser([1, 2]);
        let [above, below] = [0, 1].map(|half| halves.pixels()[half].y);
        assert!(
            above < 8.0 && (above + below - 17.0).abs() < 1e-4,
            "{above} {below}"
        );
    }
}
