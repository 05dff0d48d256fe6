//! Pictures as light.

use std::ops::{Add, Mul};
use std::sync::LazyLock;

use glam::{DVec2, DVec3};

use super::Frame;
use crate::light::srgb::linear_from_srgb;

/// Linear light of each level.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|level| linear_from_srgb(level as f64 / 255.0) as f32));

/// Linear light of an sRGB level, 0 to 1.
pub fn linear(level: u8) -> f32 {
    LINEAR[usize::from(level)]
}

/// A value between four pixels' centres, of a picture whose pixels have values by their index; `None` outside the picture.
#[inline]
pub fn between_pixels<T>(
    size_px: [u32; 2],
    place_px: DVec2,
    value: impl Fn(usize) -> T,
) -> Option<T>
where
    T: Add<Output = T> + Mul<f64, Output = T>,
{
    let [width, height] = size_px.map(|side| side as usize);
    let corner = place_px.floor();
    if !(corner.x >= 0.0 && corner.y >= 0.0) {
        return None;
    }
    let (x, y) = (corner.x as usize, corner.y as usize);
    if x + 1 >= width || y + 1 >= height {
        return None;
    }
    let share = place_px - corner;
    let first = y * width + x;
    let top = value(first) * (1.0 - share.x) + value(first + 1) * share.x;
    let bottom = value(first + width) * (1.0 - share.x) + value(first + width + 1) * share.x;
    Some(top * (1.0 - share.y) + bottom * share.y)
}

impl Frame {
    /// Linear RGB between four pixels' centres; `None` outside the picture.
    pub fn linear_rgb(&self, place_px: DVec2) -> Option<DVec3> {
        between_pixels(self.size_px, place_px, |pixel| {
            DVec3::from_array([0, 1, 2].map(|c| f64::from(linear(self.rgba[4 * pixel + c]))))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn light_is_read_between_pixels_and_nowhere_else() {
        let levels = [0, 255, 188, 10];
        let frame = Frame {
            index: 0,
            time_secs: 0.0,
            size_px: [2, 2],
            rgba: levels.into_iter().flat_map(|v| [v, v, 0, 255]).collect(),
        };
        let half = frame.linear_rgb(DVec2::new(0.5, 0.0)).unwrap();
        assert!((half - DVec3::new(0.5, 0.5, 0.0)).length() < 1e-9);
        // Level 188 is just under half of the light.
        let low = frame.linear_rgb(DVec2::new(0.0, 0.999_999)).unwrap().x;
        assert!((low - 0.502_886).abs() < 1e-5, "{low}");
        for outside in [DVec2::new(-0.1, 0.0), DVec2::new(1.0, 0.0), DVec2::NAN] {
            assert_eq!(frame.linear_rgb(outside), None);
        }
    }
}
