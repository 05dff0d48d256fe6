//! A grey picture as light.

use glam::DVec2;

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
}
