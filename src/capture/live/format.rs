//! Which of a camera's formats is taken.

use std::cmp::Reverse;
use std::fmt;

use crate::scene::{PixelFormat, WantedFormat};

/// A format that a camera has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Offer {
    /// Width and height, pixels.
    pub size_px: [u32; 2],
    /// Pictures per second.
    pub fps: u32,
    /// How the pixels come.
    pub pixels: PixelFormat,
}

impl fmt::Display for Offer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [width, height] = self.size_px;
        write!(
            f,
            "{width} x {height} {} at {} fps",
            self.pixels.name(),
            self.fps
        )
    }
}

/// More pictures than this buy little, and each costs a search for markers.
const ENOUGH_FPS: u32 = 30;
/// Where nothing says the size: markers of some centimetres are found across a table, and a laptop keeps up.
const GOOD_SIZE_PX: [u32; 2] = [1280, 720];

/// The best of `offers` that has all that is wanted: first the rate, up to 30, then the size nearest to 1280 x 720, then
/// pixels that were not compressed, then the least of the rates above.
pub(super) fn choose(offers: &[Offer], wanted: &WantedFormat) -> Option<Offer> {
    let fits = |offer: &&Offer| {
        wanted
            .size_px
            .is_none_or(|size_px| size_px == offer.size_px)
            && wanted.fps.is_none_or(|fps| fps == offer.fps)
            && wanted.pixels.is_none_or(|pixels| pixels == offer.pixels)
    };
    let area = |[width, height]: [u32; 2]| i64::from(width) * i64::from(height);
    let worth = |offer: &&Offer| {
        (
            offer.fps.min(ENOUGH_FPS),
            Reverse((area(offer.size_px) - area(GOOD_SIZE_PX)).abs()),
            quality(offer.pixels),
            Reverse(offer.fps),
        )
    };
    offers.iter().filter(fits).max_by_key(worth).copied()
}

fn quality(pixels: PixelFormat) -> u32 {
    match pixels {
        PixelFormat::Rgb | PixelFormat::Bgr => 4,
        PixelFormat::Yuyv | PixelFormat::Yvyu | PixelFormat::Uyvy => 3,
        PixelFormat::Nv12 | PixelFormat::Yu12 => 2,
        PixelFormat::Mjpeg => 1,
        PixelFormat::Grey | PixelFormat::Y16 => 0,
    }
}

/// What was asked for, in words.
pub(super) fn in_words(wanted: &WantedFormat) -> String {
    let size = wanted
        .size_px
        .map(|[width, height]| format!("{width} x {height}"));
    let pixels = wanted.pixels.map(|pixels| pixels.name().to_owned());
    let fps = wanted.fps.map(|fps| format!("{fps} fps"));
    let parts: Vec<String> = [size, pixels, fps].into_iter().flatten().collect();
    if parts.is_empty() {
        "pictures".to_owned()
    } else {
        parts.join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offer(size_px: [u32; 2], fps: u32, pixels: PixelFormat) -> Offer {
        Offer {
            size_px,
            fps,
            pixels,
        }
    }

    /// What a usual USB 2 webcam offers.
    fn usual() -> Vec<Offer> {
        vec![
            offer([640, 480], 30, PixelFormat::Yuyv),
            offer([640, 480], 15, PixelFormat::Yuyv),
            offer([1280, 720], 10, PixelFormat::Yuyv),
            offer([1920, 1080], 5, PixelFormat::Yuyv),
            offer([640, 480], 30, PixelFormat::Mjpeg),
            offer([1280, 720], 60, PixelFormat::Mjpeg),
            offer([1280, 720], 30, PixelFormat::Mjpeg),
            offer([1920, 1080], 30, PixelFormat::Mjpeg),
        ]
    }

    #[test]
    fn rate_comes_before_size_and_size_before_pixels() {
        let free = choose(&usual(), &WantedFormat::default());
        assert_eq!(free, Some(offer([1280, 720], 30, PixelFormat::Mjpeg)));
        let calibrated = WantedFormat {
            size_px: Some([640, 480]),
            ..WantedFormat::default()
        };
        assert_eq!(
            choose(&usual(), &calibrated),
            Some(offer([640, 480], 30, PixelFormat::Yuyv)),
            "uncompressed where both come at one rate"
        );
    }

    #[test]
    fn what_is_asked_for_is_given_or_nothing() {
        let uncompressed = WantedFormat {
            pixels: Some(PixelFormat::Yuyv),
            size_px: Some([1920, 1080]),
            fps: None,
        };
        assert_eq!(
            choose(&usual(), &uncompressed),
            Some(offer([1920, 1080], 5, PixelFormat::Yuyv))
        );
        let fast = WantedFormat {
            fps: Some(60),
            ..WantedFormat::default()
        };
        assert_eq!(choose(&usual(), &fast).map(|offer| offer.fps), Some(60));
        let never = WantedFormat {
            size_px: Some([800, 600]),
            ..WantedFormat::default()
        };
        assert_eq!(choose(&usual(), &never), None);
        assert_eq!(in_words(&uncompressed), "1920 x 1080 YUYV");
    }
}
