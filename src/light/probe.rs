//! A light probe: the radiance that arrives at one point from all directions, in world space (z up).

use std::borrow::Cow;
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

use glam::{DVec2, DVec3, Vec3};

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

    /// The same radiance from everywhere.
    pub fn of_one_radiance(radiance: Vec3) -> Self {
        Self {
            size_px: [1, 1],
            radiance: vec![radiance],
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

    /// The same light in no more than so many columns and rows, each pixel the mean of what lies in it.
    pub fn coarser(&self, most_px: [usize; 2]) -> Self {
        let size_px = [0, 1].map(|axis| self.size_px[axis].min(most_px[axis].max(1)));
        let mut sums = vec![(Vec3::ZERO, 0.0_f32); size_px[0] * size_px[1]];
        for (index, (_, radiance, solid_angle)) in self.rays().enumerate() {
            let place = [index % self.size_px[0], index / self.size_px[0]];
            let [column, row] = [0, 1].map(|axis| place[axis] * size_px[axis] / self.size_px[axis]);
            let (sum, whole) = &mut sums[row * size_px[0] + column];
            *sum += radiance * solid_angle as f32;
            *whole += solid_angle as f32;
        }
        let means = sums.into_iter().map(|(sum, whole)| sum / whole);
        Self {
            size_px,
            radiance: means.collect(),
        }
    }

    /// Makes all of it so many times as bright.
    pub fn scale(&mut self, factor: f32) {
        self.radiance
            .iter_mut()
            .for_each(|radiance| *radiance *= factor);
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
        let [width, height] = self.size_px;
        let (sine, cosine) = upright(row, height);
        (sine * across(column, width)).extend(cosine)
    }

    /// Solid angle of each pixel of a row, steradians.
    pub fn pixel_solid_angle(&self, row: usize) -> f64 {
        let [width, height] = self.size_px;
        let cosine = |row: usize| (row as f64 / height as f64 * PI).cos();
        TAU / width as f64 * (cosine(row) - cosine(row + 1))
    }
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
        for (most_px, size_px) in [([10, 6], [10, 6]), ([64, 32], [30, 18])] {
            let coarser = probe.coarser(most_px);
            assert_eq!(coarser.size_px(), size_px);
            assert!((sum(&coarser) / sum(&probe) - 1.0).abs().max_element() < 1e-5);
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
