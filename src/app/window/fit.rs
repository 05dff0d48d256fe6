//! Where in the window the picture is: as large as fits, at its own aspect.

use eframe::egui::{Pos2, Rect, Vec2};
use glam::DVec2;

/// A picture in its place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureFit {
    /// Where it lies, points.
    pub rect: Rect,
    /// Width and height of the picture, pixels.
    pub size_px: [u32; 2],
}

impl PictureFit {
    /// A picture in the middle of an area.
    pub fn within(area: Rect, size_px: [u32; 2]) -> Self {
        let size = Vec2::new(size_px[0].max(1) as f32, size_px[1].max(1) as f32);
        let scale = (area.width() / size.x).min(area.height() / size.y).max(0.0);
        Self {
            rect: Rect::from_center_size(area.center(), size * scale),
            size_px,
        }
    }

    /// Points that a pixel of the picture takes.
    pub fn points_per_px(&self) -> f32 {
        self.rect.width() / self.size_px[0].max(1) as f32
    }

    /// Where a pixel is in the window; an integer coordinate is the pixel's centre.
    pub fn place_of(&self, pixel: DVec2) -> Pos2 {
        let [x, y] = (pixel + 0.5).to_array().map(|side| side as f32);
        self.rect.min + Vec2::new(x, y) * self.points_per_px()
    }

    /// The pixel under a place in the window.
    pub fn pixel(&self, place: Pos2) -> DVec2 {
        let Vec2 { x, y } = (place - self.rect.min) / self.points_per_px().max(f32::MIN_POSITIVE);
        DVec2::new(f64::from(x), f64::from(y)) - 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_keeps_its_aspect_in_any_window() {
        for (width, height) in [(1000.0, 300.0), (300.0, 1000.0), (640.0, 480.0), (1.0, 1.0)] {
            let area = Rect::from_min_size(Pos2::new(20.0, 10.0), Vec2::new(width, height));
            let fit = PictureFit::within(area, [640, 480]);
            assert!((fit.rect.aspect_ratio() - 4.0 / 3.0).abs() < 1e-4);
            assert!(area.expand(1e-3).contains_rect(fit.rect));
            let touches_width = (fit.rect.width() - width).abs() < 1e-3;
            assert!(touches_width || (fit.rect.height() - height).abs() < 1e-3);
            let pixel = DVec2::new(12.25, 400.0);
            assert!((fit.pixel(fit.place_of(pixel)) - pixel).length() < 0.05);
        }
        let none = PictureFit::within(Rect::ZERO, [640, 480]);
        assert!(none.pixel(Pos2::ZERO).is_finite(), "a window made tiny");
    }

    #[test]
    fn the_first_pixels_centre_is_half_a_pixel_in() {
        let area = Rect::from_min_size(Pos2::ZERO, Vec2::new(1280.0, 960.0));
        let fit = PictureFit::within(area, [640, 480]);
        assert_eq!(fit.place_of(DVec2::ZERO), Pos2::new(1.0, 1.0));
        assert_eq!(
            fit.place_of(DVec2::new(639.5, 479.5)),
            Pos2::new(1280.0, 960.0)
        );
    }
}
