//! A grey picture as light.

use glam::DVec2;

use crate::capture::linear::linear;

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
        let [width, height] = self.size_px.map(|side| side as usize);
        let corner = place.floor();
        if corner.x < 0.0 || corner.y < 0.0 {
            return None;
        }
        let (x, y) = (corner.x as usize, corner.y as usize);
        if x + 1 >= width || y + 1 >= height {
            return None;
        }
        let share = place - corner;
        let at = |x: usize, y: usize| f64::from(linear(self.levels[y * width + x]));
        let top = at(x, y) * (1.0 - share.x) + at(x + 1, y) * share.x;
        let bottom = at(x, y + 1) * (1.0 - share.x) + at(x + 1, y + 1) * share.x;
        Some(top * (1.0 - share.y) + bottom * share.y)
    }
}
