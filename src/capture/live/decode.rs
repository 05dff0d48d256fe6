//! From what a camera sends to 8-bit RGBA.

use std::borrow::Cow;

use opencv::core::{Mat, MatTraitConst, Vec4b};
use opencv::imgproc;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::standard_tables::with_tables;
use crate::scene::PixelFormat;

/// How much of a JPEG may be broken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tolerance {
    /// Nothing.
    Strict,
    /// What does not keep the rest from being decoded: some cameras break the rules in every picture.
    Lenient,
}

/// A picture as a driver hands it out.
#[derive(Debug, Clone, Copy)]
pub struct RawPicture<'a> {
    /// As they came.
    pub bytes: &'a [u8],
    /// What they are.
    pub pixels: PixelFormat,
    /// The camera's format; a JPEG says its own.
    pub size_px: [u32; 2],
    /// Bytes from a row of the first plane to the next; 0 where rows follow each other.
    pub stride_bytes: usize,
}

/// The picture's size and its RGBA; `None` where the bytes are no such picture.
pub fn rgba_of(picture: RawPicture<'_>, tolerance: Tolerance) -> Option<([u32; 2], Vec<u8>)> {
    let RawPicture {
        bytes,
        pixels,
        size_px,
        ..
    } = picture;
    let rows = size_px[1] as usize;
    // What OpenCV is told: channels, rows, and the conversion.
    let (channels, rows, conversion) = match pixels {
        PixelFormat::Mjpeg => return rgba_of_jpeg(bytes, tolerance),
        PixelFormat::Y16 => {
            let packed = without_padding(picture)?;
            // Full scale is white, to the nearest.
            let eight = |word: &[u8]| {
                let deep = u32::from(u16::from_le_bytes([word[0], word[1]]));
                ((deep * 255 + 32_767) / 65_535) as u8
            };
            let rgba = packed
                .chunks_exact(2)
                .map(eight)
                .flat_map(|grey| [grey, grey, grey, 255]);
            return Some((size_px, rgba.collect()));
        }
        PixelFormat::Yuyv => (2, rows, imgproc::COLOR_YUV2RGBA_YUYV),
        PixelFormat::Yvyu => (2, rows, imgproc::COLOR_YUV2RGBA_YVYU),
        PixelFormat::Uyvy => (2, rows, imgproc::COLOR_YUV2RGBA_UYVY),
        PixelFormat::Nv12 => (1, rows * 3 / 2, imgproc::COLOR_YUV2RGBA_NV12),
        PixelFormat::Yu12 => (1, rows * 3 / 2, imgproc::COLOR_YUV2RGBA_I420),
        PixelFormat::Grey => (1, rows, imgproc::COLOR_GRAY2RGBA),
        PixelFormat::Rgb => (3, rows, imgproc::COLOR_RGB2RGBA),
        PixelFormat::Bgr => (3, rows, imgproc::COLOR_BGR2RGBA),
    };
    // Two pixels share their colour: OpenCV would write the last pair of an odd row beyond its end.
    let pairs = matches!(
        pixels,
        PixelFormat::Yuyv | PixelFormat::Yvyu | PixelFormat::Uyvy
    );
    if pairs && size_px[0] % 2 != 0 {
        return None;
    }
    let packed = without_padding(picture)?;
    let rgba = convert(&packed, channels, rows, size_px, conversion);
    // OpenCV refuses what it has no conversion for: odd sides of pictures whose colour comes at half the resolution.
    Some((size_px, rgba.ok()?))
}

/// The planes of a picture, row after row; `None` where there are fewer bytes than that.
fn without_padding(picture: RawPicture<'_>) -> Option<Cow<'_, [u8]>> {
    let [width, height] = picture.size_px.map(|side| side as usize);
    let row_bytes = match picture.pixels {
        PixelFormat::Mjpeg | PixelFormat::Grey | PixelFormat::Nv12 | PixelFormat::Yu12 => width,
        PixelFormat::Yuyv | PixelFormat::Yvyu | PixelFormat::Uyvy | PixelFormat::Y16 => width * 2,
        PixelFormat::Rgb | PixelFormat::Bgr => width * 3,
    };
    let stride_bytes = picture.stride_bytes.max(row_bytes);
    // Rows, bytes of each, and bytes to the next.
    let planes: &[(usize, usize, usize)] = match picture.pixels {
        PixelFormat::Nv12 => &[(height * 3 / 2, row_bytes, stride_bytes)],
        PixelFormat::Yu12 => &[
            (height, row_bytes, stride_bytes),
            (height / 2 * 2, row_bytes / 2, stride_bytes / 2),
        ],
        _ => &[(height, row_bytes, stride_bytes)],
    };
    let length: usize = planes.iter().map(|(rows, bytes, _)| rows * bytes).sum();
    if length == 0 {
        return None;
    }
    if stride_bytes == row_bytes {
        return picture.bytes.get(..length).map(Cow::from);
    }
    let mut packed = Vec::with_capacity(length);
    let mut begin = 0;
    for &(rows, row_bytes, stride_bytes) in planes {
        for _ in 0..rows {
            packed.extend_from_slice(picture.bytes.get(begin..begin + row_bytes)?);
            begin += stride_bytes;
        }
    }
    Some(packed.into())
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

/// Six blocks of 256 pixels that share their colour take a bit each and more; of a picture most of which is lost some are left.
const MOST_PIXELS_OF_A_BYTE: usize = 512;

/// RGBA of a JPEG and its size.
pub fn rgba_of_jpeg(bytes: &[u8], tolerance: Tolerance) -> Option<([u32; 2], Vec<u8>)> {
    // Zeros in place of a lost end are codes like any other; the mark of the end tells.
    if tolerance == Tolerance::Strict && !bytes.windows(2).any(|pair| pair == [0xff, 0xd9]) {
        return None;
    }
    let options = DecoderOptions::default()
        .set_strict_mode(tolerance == Tolerance::Strict)
        .jpeg_set_out_colorspace(ColorSpace::RGBA);
    let jpeg = with_tables(bytes);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&*jpeg), options);
    decoder.decode_headers().ok()?;
    let info = decoder.info()?;
    let size_px = [u32::from(info.width), u32::from(info.height)];
    // A damaged head may ask for any memory.
    if size_px[0] as usize * size_px[1] as usize / MOST_PIXELS_OF_A_BYTE > bytes.len() {
        return None;
    }
    let rgba = decoder.decode().ok()?;
    let whole = rgba.len() == size_px[0] as usize * size_px[1] as usize * 4;
    whole.then_some((size_px, rgba))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture whose rows follow each other.
    fn rgba_of(
        bytes: &[u8],
        pixels: PixelFormat,
        size_px: [u32; 2],
        tolerance: Tolerance,
    ) -> Option<([u32; 2], Vec<u8>)> {
        let picture = RawPicture {
            bytes,
            pixels,
            size_px,
            stride_bytes: 0,
        };
        super::rgba_of(picture, tolerance)
    }
    use opencv::core::{Mat, Vector};
    use opencv::imgcodecs;

    #[test]
    fn a_damaged_head_takes_no_memory_for_what_cannot_be_there() {
        let grey = Mat::new_rows_cols_with_default(480, 640, opencv::core::CV_8UC3, 127.into());
        let mut jpeg = Vector::new();
        let grey = grey.expect("a picture");
        imgcodecs::imencode(".jpg", &grey, &mut jpeg, &Vector::new()).expect("a JPEG");
        let mut jpeg: Vec<u8> = jpeg.into();
        assert!(rgba_of_jpeg(&jpeg, Tolerance::Strict).is_some());
        let frame = jpeg.windows(2).position(|pair| pair == [0xff, 0xc0]);
        let sides = frame.expect("a frame's head") + 5;
        jpeg[sides..sides + 4].copy_from_slice(&[0x3f, 0xff, 0x3f, 0xff]);
        for tolerance in [Tolerance::Strict, Tolerance::Lenient] {
            assert_eq!(rgba_of_jpeg(&jpeg, tolerance), None);
        }
    }

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
            let yvyu = [y, cr, y, cb].repeat(2 * 2);
            let uyvy = [cb, y, cr, y].repeat(2 * 2);
            let yu12 = [vec![y; 4 * 2], vec![cb; 2], vec![cr; 2]].concat();
            for (bytes, pixels) in [
                (yuyv, PixelFormat::Yuyv),
                (yvyu, PixelFormat::Yvyu),
                (uyvy, PixelFormat::Uyvy),
                (nv12, PixelFormat::Nv12),
                (yu12, PixelFormat::Yu12),
            ] {
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

    /// Found by fuzzing: OpenCV wrote beyond the picture.
    #[test]
    fn half_a_pair_of_pixels_is_no_picture() {
        for pixels in [PixelFormat::Yuyv, PixelFormat::Yvyu, PixelFormat::Uyvy] {
            for width in [1, 7] {
                let bytes = vec![9; 4 * width as usize];
                let found = rgba_of(&bytes, pixels, [width, 2], Tolerance::Lenient);
                assert_eq!(found, None, "{pixels:?}, {width}");
            }
        }
    }

    #[test]
    fn sixteen_bits_of_brightness_are_rounded_to_eight() {
        let deep: [u16; 4] = [0, 0x8000, 0x1234, 0xffff];
        let bytes: Vec<u8> = deep.iter().flat_map(|word| word.to_le_bytes()).collect();
        let (_, rgba) = rgba_of(&bytes, PixelFormat::Y16, [2, 2], Tolerance::Strict).unwrap();
        for (pixel, deep) in rgba.chunks_exact(4).zip(deep) {
            let expected = (f64::from(deep) * 255.0 / 65_535.0).round() as u8;
            assert_eq!(pixel, [expected, expected, expected, 255]);
        }
    }

    /// The picture of rows that a driver has filled up is that of the rows alone, in each format.
    #[test]
    fn padding_of_rows_is_passed_over() {
        let size_px = [6_u32, 4];
        let noise = |k: usize| (k.wrapping_mul(2_654_435_761) >> 7) as u8;
        for (_, pixels) in PixelFormat::BY_NAME {
            let planes: &[(usize, usize)] = match pixels {
                PixelFormat::Mjpeg => continue,
                PixelFormat::Grey => &[(4, 6)],
                PixelFormat::Nv12 => &[(4, 6), (2, 6)],
                PixelFormat::Yu12 => &[(4, 6), (2, 3), (2, 3)],
                PixelFormat::Rgb | PixelFormat::Bgr => &[(4, 18)],
                PixelFormat::Yuyv | PixelFormat::Yvyu | PixelFormat::Uyvy | PixelFormat::Y16 => {
                    &[(4, 12)]
                }
            };
            let padding = 10;
            let (mut plain, mut padded) = (Vec::new(), Vec::new());
            for &(rows, bytes) in planes {
                // A plane of half as many bytes has half the padding.
                let fill = padding * bytes / planes[0].1;
                for _ in 0..rows {
                    let row: Vec<u8> = (0..bytes).map(|k| noise(plain.len() + k)).collect();
                    plain.extend(&row);
                    padded.extend(row);
                    padded.extend(vec![0xee; fill]);
                }
            }
            let expected = rgba_of(&plain, pixels, size_px, Tolerance::Strict);
            assert!(expected.is_some(), "{pixels:?}");
            let picture = RawPicture {
                bytes: &padded,
                pixels,
                size_px,
                stride_bytes: planes[0].1 + padding,
            };
            let found = super::rgba_of(picture, Tolerance::Strict);
            assert_eq!(found, expected, "{pixels:?}");
        }
    }

    #[cfg_attr(not(has_shared), ignore = "needs ../shared")]
    #[test]
    fn webcams_jpegs_without_huffman_tables_are_read() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/cases/camera");
        for name in ["nodht_avi1.jpg", "nodht_bare.jpg", "nodht_jfif.jpg"] {
            let bytes = std::fs::read(format!("{folder}/{name}")).unwrap();
            let (size_px, rgba) =
                rgba_of(&bytes, PixelFormat::Mjpeg, [0, 0], Tolerance::Strict).expect(name);
            let shown = std::process::Command::new("ffmpeg")
                .args(["-v", "error", "-i", &format!("{folder}/{name}")])
                .args(["-pix_fmt", "rgba", "-f", "rawvideo", "-"])
                .output()
                .unwrap()
                .stdout;
            assert_eq!(
                shown.len(),
                (size_px[0] * size_px[1] * 4) as usize,
                "{name}"
            );
            let off: u64 = rgba
                .iter()
                .zip(&shown)
                .map(|(a, b)| u64::from(a.abs_diff(*b)))
                .sum();
            let mean = off as f64 / shown.len() as f64;
            assert!(mean < 2.0, "{name}: {mean} levels off on the average");
        }
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
