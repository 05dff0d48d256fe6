//! Pictures as numbers that can be taken from each other.

use std::path::Path;

use anyhow::{Context as _, Result};

/// RGB in levels of 255, rows from the top.
#[derive(Debug, Clone)]
pub struct LinearPicture {
    /// Pixels in a row.
    pub width: usize,
    /// All of them.
    pub pixels: Vec<[f64; 3]>,
}

impl LinearPicture {
    /// Reads a picture: 8 bits in levels, 16 bits as factors, of which 32768 is 1.
    ///
    /// # Errors
    /// It is not there, or is no picture.
    pub fn open(path: &Path) -> Result<Self> {
        let read = image::open(path).with_context(|| path.display().to_string())?;
        let width = read.width() as usize;
        // An 8-bit level v reads as 257 v.
        let unit = if read.color().bytes_per_pixel() > 4 {
            32768.0
        } else {
            257.0
        };
        let sixteen = read.to_rgb16().into_raw();
        let pixels = sixteen
            .chunks_exact(3)
            .map(|p| [0, 1, 2].map(|channel| f64::from(p[channel]) / unit));
        Ok(Self {
            width,
            pixels: pixels.collect(),
        })
    }

    /// Takes RGBA bytes for levels.
    pub fn from_rgba(width: usize, rgba: &[u8]) -> Self {
        let pixels = rgba
            .chunks_exact(4)
            .map(|p| [p[0], p[1], p[2]].map(f64::from));
        Self {
            width,
            pixels: pixels.collect(),
        }
    }

    /// The difference of two pictures of one size.
    pub fn minus(&self, other: &Self) -> Self {
        self.with_each(other, |a, b| a - b)
    }

    /// The sum of two pictures of one size.
    pub fn plus(&self, other: &Self) -> Self {
        self.with_each(other, |a, b| a + b)
    }

    /// Each number of it turned into another.
    pub fn map(&self, of: impl Fn(f64) -> f64) -> Self {
        Self {
            width: self.width,
            pixels: self.pixels.iter().map(|pixel| pixel.map(&of)).collect(),
        }
    }

    /// What comes of each number and that of another picture of one size.
    pub fn with_each(&self, other: &Self, of: impl Fn(f64, f64) -> f64) -> Self {
        let pixels = self.pixels.iter().zip(&other.pixels);
        Self {
            width: self.width,
            pixels: pixels
                .map(|(a, b)| std::array::from_fn(|channel| of(a[channel], b[channel])))
                .collect(),
        }
    }

    /// 5 x 5 box filter; the border is mirrored without repeating its pixels.
    pub fn blurred(&self) -> Self {
        let (width, height) = (self.width as i64, (self.pixels.len() / self.width) as i64);
        let mirrored = |at: i64, size: i64| {
            let at = at.abs();
            (if at >= size { 2 * size - 2 - at } else { at }) as usize
        };
        let filter = |source: &[[f64; 3]], across: i64, down: i64| -> Vec<[f64; 3]> {
            let mean = |index: usize| {
                let (x, y) = (index as i64 % width, index as i64 / width);
                let mut sum = [0.0; 3];
                for step in -2..=2 {
                    let (p, q) = (
                        mirrored(x + step * across, width),
                        mirrored(y + step * down, height),
                    );
                    let value = source[q * width as usize + p];
                    (0..3).for_each(|channel| sum[channel] += value[channel] / 5.0);
                }
                sum
            };
            (0..source.len()).map(mean).collect()
        };
        Self {
            width: self.width,
            pixels: filter(&filter(&self.pixels, 1, 0), 0, 1),
        }
    }

    /// Root mean square over the pixels of a mask; `None` where it is empty.
    pub fn rms(&self, mask: &[bool]) -> Option<f64> {
        let squares: Vec<f64> = self
            .pixels
            .iter()
            .zip(mask)
            .filter(|&(_, &inside)| inside)
            .flat_map(|(pixel, _)| pixel.map(|value| value * value))
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}
