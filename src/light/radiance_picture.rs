//! A picture in linear radiance, of any projection.

use glam::{DVec2, Vec3};

/// Rows of linear RGB radiance, the upper one first.
#[derive(Debug, Clone, PartialEq)]
pub struct RadiancePicture {
    size_px: [usize; 2],
    pixels: Vec<Vec3>,
}

/// Why a pixel's value is no radiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Flaw {
    /// Not a number.
    NotANumber,
    /// An infinite channel.
    Infinite,
    /// A channel below zero.
    Negative,
}

/// The flaws of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flaws {
    /// Column and row of the first one.
    pub first_px: [usize; 2],
    /// What is wrong with it.
    pub first: Flaw,
    /// How many pixels have one.
    pub count: usize,
}

impl RadiancePicture {
    /// `None` without pixels, or where the count does not fit.
    pub fn new(size_px: [usize; 2], pixels: Vec<Vec3>) -> Option<Self> {
        let [width, height] = size_px;
        (width > 0 && height > 0 && pixels.len() == width.checked_mul(height)?)
            .then_some(Self { size_px, pixels })
    }

    /// Columns and rows.
    pub fn size_px(&self) -> [usize; 2] {
        self.size_px
    }

    /// Rows, the upper one first.
    pub fn pixels(&self) -> &[Vec3] {
        &self.pixels
    }

    /// The rows, the upper one first.
    pub fn into_pixels(self) -> Vec<Vec3> {
        self.pixels
    }

    /// Radiance between the pixels' centres, linearly; `place_px` counts from the upper left corner of the picture (a
    /// pixel's centre is at .5). Only pixels that `counts` says yes to are taken; `None` where there is none.
    pub fn between(
        &self,
        place_px: DVec2,
        wraps: bool,
        counts: impl Fn(DVec2) -> bool,
    ) -> Option<Vec3> {
        let [width, height] = self.size_px.map(|side| side as i64);
        let corner = (place_px - 0.5).floor();
        let part = (place_px - 0.5 - corner).as_vec2();
        let mut sum = Vec3::ZERO;
        let mut weights = 0.0;
        for (down, weight_y) in [(0, 1.0 - part.y), (1, part.y)] {
            let row = (corner.y as i64 + down).clamp(0, height - 1);
            for (right, weight_x) in [(0, 1.0 - part.x), (1, part.x)] {
                let column = corner.x as i64 + right;
                let column = match wraps {
                    true => column.rem_euclid(width),
                    false => column.clamp(0, width - 1),
                };
                let weight = weight_x * weight_y;
                if weight > 0.0 && counts(DVec2::new(column as f64 + 0.5, row as f64 + 0.5)) {
                    sum += weight * self.pixels[(row * width + column) as usize];
                    weights += weight;
                }
            }
        }
        (weights > 0.0).then(|| sum / weights)
    }

    /// Pixels that are no radiance; `None` where all are.
    pub fn flaws(&self) -> Option<Flaws> {
        let mut flawed = self
            .pixels
            .iter()
            .enumerate()
            .filter_map(|(index, pixel)| Some((index, flaw(*pixel)?)));
        let (index, first) = flawed.next()?;
        Some(Flaws {
            first_px: [index % self.size_px[0], index / self.size_px[0]],
            first,
            count: 1 + flawed.count(),
        })
    }

    /// Takes channels below zero (filters that ring leave some) as zero, and pixels that are infinite or not a number as
    /// the mean of the sound ones next to them, or as black.
    pub fn mended(mut self) -> Self {
        for pixel in &mut self.pixels {
            if flaw(*pixel) == Some(Flaw::Negative) {
                *pixel = pixel.max(Vec3::ZERO);
            }
        }
        let [width, height] = self.size_px;
        let mended: Vec<(usize, Vec3)> = (0..self.pixels.len())
            .filter(|&index| flaw(self.pixels[index]).is_some())
            .map(|index| {
                let (column, row) = (index % width, index / width);
                let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
                let sound: Vec<Vec3> = near(row, height)
                    .flat_map(|row| near(column, width).map(move |column| row * width + column))
                    .map(|index| self.pixels[index])
                    .filter(|pixel| flaw(*pixel).is_none())
                    .collect();
                (
                    index,
                    sound.iter().sum::<Vec3>() / sound.len().max(1) as f32,
                )
            })
            .collect();
        for (index, pixel) in mended {
            self.pixels[index] = pixel;
        }
        self
    }
}

fn flaw(pixel: Vec3) -> Option<Flaw> {
    if pixel.is_nan() {
        Some(Flaw::NotANumber)
    } else if !pixel.is_finite() {
        Some(Flaw::Infinite)
    } else if pixel.min_element() < 0.0 {
        Some(Flaw::Negative)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(values: [f32; 6]) -> RadiancePicture {
        let pixels = values.map(Vec3::splat).to_vec();
        RadiancePicture::new([3, 2], pixels).unwrap()
    }

    #[test]
    fn between_centres_it_is_linear() {
        let ramp = picture([0.0, 1.0, 2.0, 10.0, 11.0, 12.0]);
        let at = |x, y, wraps| {
            ramp.between(DVec2::new(x, y), wraps, |_| true)
                .map(|value| value.x)
        };
        assert_eq!(at(1.5, 0.5, false), Some(1.0));
        assert_eq!(at(1.75, 0.75, false), Some(1.25 + 2.5));
        assert_eq!(at(3.0, 0.5, false), Some(2.0));
        assert_eq!(at(3.0, 0.5, true), Some(1.0));
        assert_eq!(at(0.0, 1.5, true), Some(11.0));
        let left = |place: DVec2| place.x < 2.0;
        let place = DVec2::new(2.2, 0.5);
        assert_eq!(ramp.between(place, false, left), Some(Vec3::ONE));
        assert_eq!(ramp.between(place, false, |_| false), None);
        assert!(RadiancePicture::new([3, 2], vec![Vec3::ZERO; 5]).is_none());
    }

    #[test]
    fn flaws_are_found_and_mended() {
        assert_eq!(picture([0.0; 6]).flaws(), None);
        let flawed = picture([1.0, 3.0, 2.0, 4.0, f32::NAN, -1.0]);
        let expected = Flaws {
            first_px: [1, 1],
            first: Flaw::NotANumber,
            count: 2,
        };
        assert_eq!(flawed.flaws(), Some(expected));
        assert_eq!(flawed.mended(), picture([1.0, 3.0, 2.0, 4.0, 2.0, 0.0]));
        let black = picture([f32::INFINITY; 6]).mended();
        assert_eq!(black, picture([0.0; 6]));
    }
}
