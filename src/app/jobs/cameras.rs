//! Cameras: what the system has, with the formats that each offers.

use std::fmt::Write as _;

use crate::capture::live::{ListedCamera, LiveError, Offer, list_cameras};

/// The list as text: a line a camera, then its formats.
///
/// # Errors
/// There is none, or the system does not tell.
pub fn cameras() -> Result<String, LiveError> {
    Ok(list_cameras()?.iter().map(text_of).collect())
}

fn text_of(camera: &ListedCamera) -> String {
    let mut text = format!("webcam:{}  {}\n", camera.number, camera.name);
    match &camera.offers {
        Err(error) => {
            _ = writeln!(text, "  {error}");
        }
        Ok(offers) if offers.is_empty() => text += "  no format that gnomon reads\n",
        Ok(offers) => {
            for group in offers.chunk_by(|a, b| (a.pixels, a.size_px) == (b.pixels, b.size_px)) {
                text += &line_of(group);
            }
        }
    }
    text
}

/// All rates of one size and pixel format on a line.
fn line_of(group: &[Offer]) -> String {
    let Some(Offer {
        size_px: [width, height],
        pixels,
        ..
    }) = group.first()
    else {
        return String::new();
    };
    let rates: Vec<String> = group.iter().map(|offer| offer.fps.to_string()).collect();
    format!(
        "  {:6} {width} x {height} at {} fps\n",
        pixels.name(),
        rates.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::PixelFormat;

    #[test]
    fn rates_share_a_line() {
        let offer = |size_px, fps, pixels| Offer {
            size_px,
            fps,
            pixels,
        };
        let camera = ListedCamera {
            number: 2,
            name: "C920".to_owned(),
            offers: Ok(vec![
                offer([640, 480], 15, PixelFormat::Mjpeg),
                offer([640, 480], 30, PixelFormat::Mjpeg),
                offer([640, 480], 30, PixelFormat::Yuyv),
            ]),
        };
        assert_eq!(
            text_of(&camera),
            "webcam:2  C920\n  MJPEG  640 x 480 at 15, 30 fps\n  YUYV   640 x 480 at 30 fps\n"
        );
    }
}
