//! From what a camera sends to 8-bit RGBA.

use opencv::core::{Mat, MatTraitConst, Vec4b};
use opencv::imgproc;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::scene::PixelFormat;

/// How much of a JPEG may be broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Tolerance {
    /// Nothing.
    Strict,
    /// What does not keep the rest from being decoded: some cameras break the rules in every picture.
    Lenient,
}

/// The picture's size and its RGBA; `None` where the bytes are no such picture. `size_px` is the camera's format; a JPEG
/// says its own.
pub(super) fn rgba_of(
    bytes: &[u8],
    pixels: PixelFormat,
    size_px: [u32; 2],
    tolerance: Tolerance,
) -> Option<([u32; 2], Vec<u8>)> {
    let [width, height] = size_px.map(|side| side as usize);
    let area = width * height;
    // What OpenCV is told: channels, the bytes of a picture, its rows, and the conversion.
    let (channels, length, rows, conversion) = match pixels {
        PixelFormat::Mjpeg => return rgba_of_jpeg(bytes, tolerance),
        PixelFormat::Yuyv => (2, area * 2, height, imgproc::COLOR_YUV2RGBA_YUYV),
        PixelFormat::Nv12 => (
            1,
            area * 3 / 2,
            height * 3 / 2,
            imgproc::COLOR_YUV2RGBA_NV12,
        ),
        PixelFormat::Grey => (1, area, height, imgproc::COLOR_GRAY2RGBA),
        PixelFormat::Rgb => (3, area * 3, height, imgproc::COLOR_RGB2RGBA),
        PixelFormat::Bgr => (3, area * 3, height, imgproc::COLOR_BGR2RGBA),
    };
    let bytes = bytes.get(..length).filter(|bytes| !bytes.is_empty())?;
    let rgba = convert(bytes, channels, rows, size_px, conversion);
    // OpenCV refuses what it has no conversion for: odd sides of pictures whose colour comes at half the resolution.
    Some((size_px, rgba.ok()?))
}

fn convert(
    bytes: &[u8],
    channels: i32,
    rows: usize,
    size_px: [u32; 2],
    conversion: i32,
) -> opencv::Result<Vec<u8>> {
    let [width, height] = size_px.map(|side| side as i32);
    let flat = Mat::from_slice(bytes)?;
    let source = flat.reshape(channels, rows as i32)?;
    let mut rgba = vec![0; size_px[0] as usize * size_px[1] as usize * 4];
    let mut target = Mat::new_rows_cols_with_bytes_mut::<Vec4b>(height, width, &mut rgba)?;
    imgproc::cvt_color_def(&source, &mut target, conversion)?;
    drop(target);
    Ok(rgba)
}

fn rgba_of_jpeg(bytes: &[u8], tolerance: Tolerance) -> Option<([u32; 2], Vec<u8>)> {
    // Zeros in place of a lost end are codes like any other; the mark of the end tells.
    if tolerance == Tolerance::Strict && !bytes.windows(2).any(|pair| pair == [0xff, 0xd9]) {
        return None;
    }
    let options = DecoderOptions::default()
        .set_strict_mode(tolerance == Tolerance::Strict)
        .jpeg_set_out_colorspace(ColorSpace::RGBA);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    let rgba = decoder.decode().ok()?;
    let info = decoder.info()?;
    let size_px = [u32::from(info.width), u32::from(info.height)];
    let whole = rgba.len() == size_px[0] as usize * size_px[1] as usize * 4;
    whole.then_some((size_px, rgba))
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::{Mat, Vector};
    use opencv::imgcodecs;

    /// What BT.601 says of a limited-range YCbCr colour, in f64.
    fn rgb_of([y, cb, cr]: [u8; 3]) -> [f64; 3] {
        let y = (f64::from(y) - 16.0) * 255.0 / 219.0;
        let (cb, cr) = (
            (f64::from(cb) - 128.0) * 255.0 / 224.0,
            (f64::from(cr) - 128.0) * 255.0 / 224.0,
        );
        [
            y + 1.402 * cr,
            y - (0.114 * 1.772 * cb + 0.299 * 1.402 * cr) / 0.587,
            y + 1.772 * cb,
        ]
        .map(|channel| channel.clamp(0.0, 255.0))
    }

    const YCBCR: [[u8; 3]; 3] = [[81, 90, 240], [145, 54, 34], [180, 128, 128]];

    #[test]
    fn colours_are_those_of_bt_601() {
        for [y, cb, cr] in YCBCR {
            let expected = rgb_of([y, cb, cr]);
            let yuyv = [y, cb, y, cr].repeat(2 * 2);
            let nv12: Vec<u8> = [vec![y; 4 * 2], [cb, cr].repeat(2)].concat();
            for (bytes, pixels) in [(yuyv, PixelFormat::Yuyv), (nv12, PixelFormat::Nv12)] {
                let (size_px, rgba) = rgba_of(&bytes, pixels, [4, 2], Tolerance::Strict).unwrap();
                assert_eq!((size_px, rgba.len()), ([4, 2], 32));
                for pixel in rgba.chunks_exact(4) {
                    for (found, expected) in pixel.iter().zip(expected) {
                        assert!(
                            (f64::from(*found) - expected).abs() <= 1.5,
                            "{pixels:?}: {pixel:?}, {expected:?}"
                        );
                    }
                    assert_eq!(pixel[3], 255);
                }
            }
        }
    }

    #[test]
    fn pixels_keep_their_places() {
        let rgb: Vec<u8> = (0..3 * 2 * 3).collect();
        let bgr: Vec<u8> = rgb.chunks(3).flat_map(|p| [p[2], p[1], p[0]]).collect();
        let expected: Vec<u8> = rgb
            .chunks(3)
            .flat_map(|p| [p[0], p[1], p[2], 255])
            .collect();
        for (bytes, pixels) in [(rgb, PixelFormat::Rgb), (bgr, PixelFormat::Bgr)] {
            let found = rgba_of(&bytes, pixels, [3, 2], Tolerance::Strict);
            assert_eq!(found, Some(([3, 2], expected.clone())), "{pixels:?}");
        }
        let grey = rgba_of(
            &[7, 9, 11, 13],
            PixelFormat::Grey,
            [1, 4],
            Tolerance::Strict,
        );
        let expected = [7, 9, 11, 13]
            .iter()
            .flat_map(|&g| [g, g, g, 255])
            .collect();
        assert_eq!(grey, Some(([1, 4], expected)));
    }

    #[test]
    fn too_few_bytes_are_no_picture() {
        for (_, pixels) in PixelFormat::BY_NAME {
            for bytes in [&[][..], &[0; 40]] {
                let found = rgba_of(bytes, pixels, [64, 48], Tolerance::Lenient);
                assert_eq!(found, None, "{pixels:?}");
            }
        }
    }

    fn jpeg(seed: u32) -> Vec<u8> {
        let noise: Vec<u8> = (0..64 * 48 * 3)
            .map(|k: u32| (k.wrapping_add(seed).wrapping_mul(2_654_435_761) >> 24) as u8)
            .collect();
        let flat = Mat::from_slice(&noise).unwrap();
        let mut bytes = Vector::new();
        let picture = flat.reshape(3, 48).unwrap();
        imgcodecs::imencode_def(".jpg", &picture, &mut bytes).unwrap();
        bytes.as_slice().to_vec()
    }

    #[test]
    fn a_jpeg_is_decoded_as_another_library_does() {
        let jpeg = jpeg(1);
        let mut padded = jpeg.clone();
        // Drivers hand out the whole of their buffers.
        padded.extend([0; 500]);
        let (size_px, rgba) =
            rgba_of(&padded, PixelFormat::Mjpeg, [64, 48], Tolerance::Strict).unwrap();
        assert_eq!(size_px, [64, 48]);
        let bytes = Vector::<u8>::from_slice(&jpeg);
        let bgr = imgcodecs::imdecode(&bytes, imgcodecs::IMREAD_COLOR).unwrap();
        let reference = crate::capture::pixels::rgba_from_bgr(&bgr).unwrap();
        let worst = rgba
            .iter()
            .zip(&reference)
            .map(|(a, b)| a.abs_diff(*b))
            .max();
        assert!(worst <= Some(4), "{worst:?}");
    }

    #[test]
    fn a_broken_jpeg_is_refused() {
        let whole = jpeg(1);
        let refused = |bytes: &[u8]| {
            rgba_of(bytes, PixelFormat::Mjpeg, [64, 48], Tolerance::Strict).is_none()
        };
        for part in [0, 2, whole.len() / 4, whole.len() / 2, whole.len() - 300] {
            assert!(refused(&whole[..part]), "cut off at {part}");
            let mut zeroed = whole.clone();
            zeroed[part..].fill(0);
            assert!(refused(&zeroed), "zeros from {part}");
        }
        assert!(!refused(&whole));
        let mut lenient = whole[..whole.len() - 300].to_vec();
        lenient.extend([0xff, 0xd9]);
        let found = rgba_of(&lenient, PixelFormat::Mjpeg, [64, 48], Tolerance::Lenient);
        assert!(found.is_some(), "the most of it is there");
    }
}
