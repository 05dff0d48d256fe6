//! A light probe: the radiance that arrives at one point from all directions, in world space (z up).

use std::f64::consts::{PI, TAU};

use glam::{DVec3, Vec3};

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
        let [width, _] = self.size_px;
        let pixels = self.radiance.iter().enumerate();
        pixels.map(move |(index, &radiance)| {
            let (column, row) = (index % width, index / width);
            let direction = self.direction(column as f64 + 0.5, row as f64 + 0.5);
            (direction, radiance, self.pixel_solid_angle(row))
        })
    }

    /// Puts another radiance into a pixel.
    pub(super) fn set_pixel(&mut self, index: usize, radiance: Vec3) {
        self.radiance[index] = radiance;
    }

    /// Radiance from the pixel that a direction of any length falls into.
    pub fn radiance(&self, direction: DVec3) -> Vec3 {
        let [width, height] = self.size_px;
        let u = (direction.y.atan2(direction.x) + PI) / TAU;
        let v = (direction.z / direction.length()).clamp(-1.0, 1.0).acos() / PI;
        let pixel = |part: f64, count: usize| ((part * count as f64) as usize).min(count - 1);
        self.radiance[pixel(v, height) * width + pixel(u, width)]
    }

    /// Unit direction of a place in the picture, in pixels from its upper left corner.
    pub fn direction(&self, column: f64, row: f64) -> DVec3 {
        let [width, height] = self.size_px;
        let azimuth = column / width as f64 * TAU - PI;
        let (sine, cosine) = (row / height as f64 * PI).sin_cos();
        DVec3::new(sine * azimuth.cos(), sine * azimuth.sin(), cosine)
    }

    /// Solid angle of each pixel of a row, steradians.
    pub fn pixel_solid_angle(&self, row: usize) -> f64 {
        let [width, height] = self.size_px;
        let cosine = |row: usize| (row as f64 / height as f64 * PI).cos();
        TAU / width as f64 * (cosine(row) - cosine(row + 1))
    }
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
}
