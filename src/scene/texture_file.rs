//! Pictures that lie on surfaces, from files.

use std::io::Cursor;
use std::path::Path;

use image::imageops::FilterType;
use image::{ColorType, DynamicImage, ImageBuffer, ImageFormat, ImageReader, Rgba};

use super::in_its_place::in_place_of;
use super::plain_file::{self, MOST_PICTURE};
use super::tiff_header;
use crate::light::srgb::srgb_from_linear;
use crate::light::texture::Texture;

/// What is read.
const ALLOWED: &str = "PNG, JPEG, WebP, TGA, BMP, TIFF, GIF, DDS (DXT1, DXT3, DXT5), PNM, HDR";
/// What is read of DDS.
const DDS_KINDS: &str = "DXT1, DXT3, DXT5 (BC1 to BC3)";
/// Longest side of a picture that is read, pixels.
const MOST_SIDE_PX: u32 = 16384;
/// Longest side of a picture that is kept; a larger one is scaled down.
const KEPT_SIDE_PX: u32 = 4096;
/// Pixels that a picture of any size in bytes may have, and those that it may have for each byte: a file of a megabyte must not
/// cost hundreds.
const SMALL_PIXELS: u64 = 4096 * 4096;
const MOST_PIXELS_PER_BYTE: u64 = 16;
/// Memory that decoding may take, bytes.
const MOST_BYTES: u64 = 1 << 30;

/// Reads a picture's file by its content, or where that does not tell (TGA) by its name.
///
/// # Errors
/// What is wrong with it, as it goes on after its name.
pub fn read(path: &Path) -> Result<Texture, String> {
    let bytes =
        plain_file::read(path, MOST_PICTURE).map_err(|error| format!("cannot be read: {error}"))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    decode(name.into_owned(), &bytes, ImageFormat::from_path(path).ok())
}

/// Decodes a picture of eight or sixteen bits, no side of it longer than 4096 texels when it is kept; `format` is what it is where its bytes do not tell.
///
/// # Errors
/// As [`read`] has them.
pub fn decode(name: String, bytes: &[u8], format: Option<ImageFormat>) -> Result<Texture, String> {
    if bytes.starts_with(b"\xabKTX 20\xbb") {
        return Err(format!(
            "is KTX2 (Basis Universal), which is not read; allowed: {ALLOWED}"
        ));
    }
    if let Some(what) = in_place_of(bytes) {
        return Err(format!("is {what}"));
    }
    if !tiff_header::counts_fit(bytes) {
        return Err(
            "cannot be read: an entry of its directory has more values than the file has bytes"
                .to_owned(),
        );
    }
    let failed = |error: &dyn std::fmt::Display| match error.to_string() {
        said if bytes.starts_with(b"DDS ") => {
            format!("cannot be read: {said}; allowed of DDS: {DDS_KINDS}")
        }
        said if said.contains("not supported") || said.contains("could not be determined") => {
            format!("cannot be read: {said}; allowed: {ALLOWED}")
        }
        said => format!("cannot be read: {said}"),
    };
    let reader = || {
        let mut reader = ImageReader::new(Cursor::new(bytes)).with_guessed_format()?;
        if let (None, Some(format)) = (reader.format(), format) {
            reader.set_format(format);
        }
        Ok::<_, std::io::Error>(reader)
    };
    let sized = reader().map_err(|error| failed(&error))?;
    let (width, height) = sized.into_dimensions().map_err(|error| failed(&error))?;
    let most = SMALL_PIXELS.max(bytes.len() as u64 * MOST_PIXELS_PER_BYTE);
    if u64::from(width) * u64::from(height) > most {
        return Err(format!(
            "cannot be read: it says that it has {width} x {height} pixels, in {} bytes; at most {most} are read in so few",
            bytes.len()
        ));
    }
    let mut reader = reader().map_err(|error| failed(&error))?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    limits.max_alloc = Some(MOST_BYTES);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| failed(&error))?;
    let picture = match picture.width().max(picture.height()) > KEPT_SIDE_PX {
        true => picture.resize(KEPT_SIDE_PX, KEPT_SIDE_PX, FilterType::Triangle),
        false => picture,
    };
    let picture = match picture.color() {
        ColorType::Rgb32F | ColorType::Rgba32F => in_srgb(picture),
        _ => picture,
    };
    let rgba = picture.into_rgba8();
    Ok(Texture {
        name,
        size_px: [rgba.width(), rgba.height()],
        rgba: rgba.into_raw(),
    })
}

/// A picture in another size, at least 1 each way.
pub fn resized(texture: &Texture, [width, height]: [u32; 2]) -> Texture {
    let [from_width, from_height] = texture.size_px;
    let texels: Option<ImageBuffer<Rgba<u8>, &[u8]>> =
        ImageBuffer::from_raw(from_width, from_height, &texture.rgba);
    match texels {
        Some(texels) => Texture {
            name: texture.name.clone(),
            size_px: [width, height],
            rgba: image::imageops::resize(&texels, width, height, FilterType::Triangle).into_raw(),
        },
        None => texture.clone(),
    }
}

/// Colours as all other pictures have them, of one whose numbers are in proportion to light (Radiance HDR).
fn in_srgb(picture: DynamicImage) -> DynamicImage {
    let mut rgba = picture.into_rgba32f();
    for pixel in rgba.pixels_mut() {
        for channel in &mut pixel.0[..3] {
            *channel = srgb_from_linear(f64::from(*channel)) as f32;
        }
    }
    DynamicImage::ImageRgba32F(rgba)
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
        let read = decode("a.jpg".to_owned(), &png, None).unwrap();
        assert_eq!(read.size_px, [3, 2]);
        assert_eq!(read.rgba, image.into_raw());
        // Linear light, whose half is 188 of 255 by sRGB's curve.
        let half = image::Rgb32FImage::from_pixel(3, 2, image::Rgb([0.5, 0.0, 2.0]));
        let read = decode(
            "a".to_owned(),
            &encoded(half.into(), ImageFormat::Hdr),
            None,
        )
        .unwrap();
        assert_eq!(read.rgba[..4], [188, 0, 255, 255]);
        let plain = RgbaImage::from_pixel(3, 2, image::Rgba([255, 0, 0, 255]));
        let gif = encoded(plain.clone().into(), ImageFormat::Gif);
        assert_eq!(
            decode("a".to_owned(), &gif, None).unwrap().rgba,
            plain.into_raw()
        );
        let grey = image::GrayImage::from_pixel(5, 4, image::Luma([99]));
        let jpeg = encoded(grey.into(), ImageFormat::Jpeg);
        let read = decode("b".to_owned(), &jpeg, None).unwrap();
        assert_eq!(read.size_px, [5, 4]);
        assert!(read.rgba[0].abs_diff(99) < 3 && read.rgba[3] == 255);
    }

    /// The head of a lossless WebP (14 bits for each side less one), as fuzzing found one.
    #[test]
    fn a_small_file_that_says_it_is_huge_is_refused() {
        let side = 16_000_u32;
        let mut bytes = b"RIFF\x4c\0\0\0WEBPVP8L\x3f\0\0\0\x2f".to_vec();
        bytes.extend(((side - 1) | (side - 1) << 14).to_le_bytes());
        bytes.extend([0; 64]);
        let error = decode("a.webp".to_owned(), &bytes, None).unwrap_err();
        assert!(
            error.contains("16000 x 16000 pixels, in 89 bytes"),
            "{error}"
        );
    }

    #[test]
    fn large_ones_are_scaled_and_others_refused() {
        let wide = image::GrayImage::from_pixel(KEPT_SIDE_PX * 2, 4, image::Luma([50]));
        let read = decode(
            "wide".to_owned(),
            &encoded(wide.into(), ImageFormat::Png),
            None,
        )
        .unwrap();
        assert_eq!(read.size_px, [KEPT_SIDE_PX, 2]);
        let huge = image::GrayImage::from_pixel(MOST_SIDE_PX + 1, 1, image::Luma([50]));
        assert!(
            decode(
                "huge".to_owned(),
                &encoded(huge.into(), ImageFormat::Png),
                None
            )
            .is_err()
        );
        for bytes in [
            &b""[..],
            b"GIF89a",
            b"\xabKTX 20\xbb\r\n",
            b"\x89PNG\r\n\x1a\n",
        ] {
            assert!(decode("bad".to_owned(), bytes, None).is_err());
        }
    }

    /// One of plain bytes, as GIMP writes it where no compression is chosen.
    #[test]
    fn of_dds_it_is_said_which_kinds_are_read() {
        let mut bytes = b"DDS ".to_vec();
        let head: [u32; 31] = std::array::from_fn(|word| match word {
            0 => 124,
            1 => 0x100f,
            2 | 3 => 2,
            18 => 32,
            19 => 0x40,
            21 => 24,
            26 => 0x1000,
            _ => 0,
        });
        bytes.extend(head.iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend([99; 12]);
        let error = decode("a.dds".to_owned(), &bytes, None).unwrap_err();
        assert!(
            error.ends_with("allowed of DDS: DXT1, DXT3, DXT5 (BC1 to BC3)"),
            "{error}"
        );
    }
}
