//! A grey picture as light.

use glam::DVec2;
use opencv::core::Mat;
use opencv::imgproc;

use super::TrackingError;
use crate::capture::Frame;
use crate::capture::linear::{between_pixels, linear};

/// An 8-bit grey picture, rows from the top without padding.
#[derive(Clone, Copy)]
pub(super) struct Grey<'a> {
    pub levels: &'a [u8],
    pub size_px: [u32; 2],
}

impl<'a> Grey<'a> {
    /// The levels of a row.
    pub(super) fn row(&self, y: u32) -> &'a [u8] {
        let width = self.size_px[0] as usize;
        &self.levels[y as usize * width..][..width]
    }

    /// Linear light between four pixels' centres; `None` outside the picture.
    pub(super) fn light(&self, place: DVec2) -> Option<f64> {
        between_pixels(self.size_px, place, |pixel| {
            f64::from(linear(self.levels[pixel]))
        })
    }

    /// The grey level between four pixels' centres; `None` outside the picture.
    pub(super) fn level(&self, place: DVec2) -> Option<f32> {
        let [width, height] = self.size_px;
        let (x, y) = (place.x.floor(), place.y.floor());
        let inside =
            x >= 0.0 && y >= 0.0 && x + 1.0 < f64::from(width) && y + 1.0 < f64::from(height);
        if !inside {
            return None;
        }
        let start = y as usize * width as usize + x as usize;
        let at = |index: usize| f32::from(self.levels[index]);
        let (right, down) = ((place.x - x) as f32, (place.y - y) as f32);
        let upper = at(start) + right * (at(start + 1) - at(start));
        let below = start + width as usize;
        let lower = at(below) + right * (at(below + 1) - at(below));
        Some(upper + down * (lower - upper))
    }
}

/// The grey levels of a frame as detectors want them: rows from the top, no padding.
///
/// # Errors
/// The frame's bytes do not make up its size.
pub fn grey_from_rgba(frame: &Frame, grey: &mut Vec<u8>) -> Result<(), TrackingError> {
    let [width, height] = frame.size_px;
    let wrong_size = || TrackingError::PictureSize {
        bytes: frame.rgba.len(),
        size_px: frame.size_px,
    };
    let pixels = width as usize * height as usize;
    if frame.rgba.len() != 4 * pixels {
        return Err(wrong_size());
    }
    grey.resize(pixels, 0);
    if pixels == 0 {
        return Ok(());
    }
    let rows = i32::try_from(height).map_err(|_| wrong_size())?;
    let columns = i32::try_from(width).map_err(|_| wrong_size())?;
    let rgba = Mat::new_rows_cols_with_bytes::<opencv::core::Vec4b>(rows, columns, &frame.rgba)?;
    let mut target = Mat::new_rows_cols_with_data_mut(rows, columns, grey.as_mut_slice())?;
    imgproc::cvt_color_def(&rgba, &mut target, imgproc::COLOR_RGBA2GRAY)?;
    Ok(())
}
