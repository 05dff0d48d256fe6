//! Pictures that lie on things: PNG, JPEG and WebP, decoded in bounded memory.

use std::io::Cursor;

use image::{ImageReader, Limits};

use crate::light::texture::Texture;

/// The longest side that a picture is kept with; a larger one is scaled down.
pub const LONGEST_SIDE_PX: u32 = 4096;
/// The longest side of a picture that is decoded.
const MOST_SIDE_PX: u32 = 16_384;
/// Memory that decoding may take, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// A decoded picture.
#[derive(Debug)]
pub struct ReadPicture {
    /// As it is kept.
    pub texture: Texture,
    /// Its size in the file where that is not the size in which it is kept, pixels.
    pub scaled_from_px: Option<[u32; 2]>,
}

/// Decodes a picture; its content says what it is, whatever its name.
///
/// # Errors
/// What it is not, or what is wrong with it, as a sentence without its name.
pub fn decode(name: &str, bytes: &[u8]) -> Result<ReadPicture, String> {
    if bytes.starts_with(b"\xabKTX 20\xbb") {
        return Err("KTX2 (Basis Universal) is not read; allowed: PNG, JPEG, WebP".to_owned());
    }
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| error.to_string())?;
    let is_read = matches!(
        reader.format(),
        Some(image::ImageFormat::Png | image::ImageFormat::Jpeg | image::ImageFormat::WebP)
    );
    if !is_read {
        return Err("not a picture that is read; allowed: PNG, JPEG, WebP".to_owned());
    }
    let mut limits = Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let decoded = reader.decode().map_err(|error| error.to_string())?;
    let [width, height] = [decoded.width(), decoded.height()];
    if width == 0 || height == 0 {
        return Err("the picture has no pixels".to_owned());
    }
    let is_large = width.max(height) > LONGEST_SIDE_PX;
    let kept = match is_large {
        true => decoded.resize(
            LONGEST_SIDE_PX,
            LONGEST_SIDE_PX,
            image::imageops::FilterType::Triangle,
        ),
        false => decoded,
    };
    let rgba = kept.into_rgba8();
    Ok(ReadPicture {
        texture: Texture {
            name: name.to_owned(),
            size_px: [rgba.width(), rgba.height()],
            rgba: rgba.into_raw(),
        },
        scaled_from_px: is_large.then_some([width, height]),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, ImageFormat, RgbaImage};

    fn encoded(image: DynamicImage, format: ImageFormat) -> Vec<u8> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn pictures_are_read_by_their_content() {
        let image = RgbaImage::from_fn(3, 2, |x, y| {
            image::Rgba([40 * x as u8, 90 * y as u8, 7, 200])
        });
        let png = encoded(image.clone().into(), ImageFormat::Png);
        let read = decode("a.jpg", &png).unwrap();
        assert_eq!((read.texture.size_px, read.scaled_from_px), ([3, 2], None));
        assert_eq!(read.texture.rgba, image.into_raw());
        let grey = image::GrayImage::from_pixel(5, 4, image::Luma([99]));
        let jpeg = encoded(grey.into(), ImageFormat::Jpeg);
        let read = decode("b", &jpeg).unwrap().texture;
        assert_eq!(read.size_px, [5, 4]);
        assert!(read.rgba[0].abs_diff(99) < 3 && read.rgba[3] == 255);
    }

    #[test]
    fn large_ones_are_scaled_and_others_refused() {
        let wide = image::GrayImage::from_pixel(LONGEST_SIDE_PX * 2, 4, image::Luma([50]));
        let read = decode("wide", &encoded(wide.into(), ImageFormat::Png)).unwrap();
        assert_eq!(read.texture.size_px, [LONGEST_SIDE_PX, 2]);
        assert_eq!(read.scaled_from_px, Some([LONGEST_SIDE_PX * 2, 4]));
        let huge = image::GrayImage::from_pixel(MOST_SIDE_PX + 1, 1, image::Luma([50]));
        assert!(decode("huge", &encoded(huge.into(), ImageFormat::Png)).is_err());
        for bytes in [
            &b""[..],
            b"GIF89a",
            b"\xabKTX 20\xbb\r\n",
            b"\x89PNG\r\n\x1a\n",
        ] {
            assert!(decode("bad", bytes).is_err());
        }
    }
}
