//! Picture files by OpenCV, and from its pictures to plain pixels.

use std::fs::File;
use std::io::{BufReader, Cursor};
use std::path::Path;

use image::{ImageFormat, ImageReader};
use opencv::core::{self, Mat, MatTraitConst, Vec4b};
use opencv::{imgcodecs, imgproc};

use super::{jpeg_end, several_pictures};
use crate::geometry::camera::MOST_SIDE_PX;
use crate::geometry::quarter_turns::QuarterTurns;
use crate::scene::in_its_place::in_place_of;
use crate::scene::plain_file::{self, MOST_PICTURE};
use crate::scene::tiff_header;

/// No file is too small for a picture of so many pixels.
const SMALL_PIXELS: u64 = 32 << 20;
/// What a byte of a larger one holds at most: in photographs it is about one.
const MOST_PIXELS_PER_BYTE: u64 = 32;
/// What is given to OpenCV, told by its content: of others it would take the size on their word.
const FORMATS: [ImageFormat; 6] = [
    ImageFormat::Png,
    ImageFormat::Jpeg,
    ImageFormat::Bmp,
    ImageFormat::Tiff,
    ImageFormat::WebP,
    ImageFormat::Pnm,
];

/// A picture file that was read.
pub(super) struct Picture {
    /// Its colours, 8-bit.
    pub bgr: Mat,
    /// Whether its file ends before it does, and what is missing was guessed.
    pub is_cut_off: bool,
    /// How many pictures its file holds.
    pub of: u32,
}

/// Why a picture file is not read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Unread {
    /// It cannot be decoded (OpenCV has no better word for it).
    Undecodable,
    /// It is of a kind that is not read: which, and what to do.
    OtherKind(&'static str),
    /// Its header asks for more pixels than a file of its size has, which are these at most.
    TooManyPixels(u64),
    /// A side of its width and height is longer than any that is read.
    TooLong([u32; 2]),
}

/// The picture as it is shown: turned as its EXIF says, whatever its kind.
pub(super) fn read_picture(path: &Path) -> Result<Picture, Unread> {
    let mut picture = read_picture_as_taken(path)?;
    let shown = as_shown(&picture.bgr, orientation(path));
    picture.bgr = shown.map_err(|_| Unread::Undecodable)?;
    Ok(picture)
}

/// The turn by which a picture as the sensor has it is shown, from its EXIF; a mirrored one counts as not turned.
pub(super) fn turn_when_shown(path: &Path) -> QuarterTurns {
    match orientation(path) {
        3 => QuarterTurns::HALF,
        6 => QuarterTurns::ONE,
        8 => QuarterTurns::BACK,
        _ => QuarterTurns::NONE,
    }
}

/// EXIF's number of how the camera was held; 1 is as it is shown.
fn orientation(path: &Path) -> u32 {
    let said = || {
        let file = File::open(path).ok()?;
        let exif = exif::Reader::new()
            .continue_on_error(true)
            .read_from_container(&mut BufReader::new(file))
            .or_else(|error| error.distill_partial_result(|_| ()))
            .ok()?;
        exif.get_field(exif::Tag::Orientation, exif::In::PRIMARY)?
            .value
            .get_uint(0)
    };
    said().unwrap_or(1)
}

/// A picture of the sensor as it is shown (CIPA DC-008, Exif 2.32, 4.6.4: the tag Orientation).
fn as_shown(sensor: &Mat, orientation: u32) -> opencv::Result<Mat> {
    let mut shown = Mat::default();
    match orientation {
        2 => core::flip(sensor, &mut shown, 1)?,
        3 => core::flip(sensor, &mut shown, -1)?,
        4 => core::flip(sensor, &mut shown, 0)?,
        5 => core::transpose(sensor, &mut shown)?,
        6 => core::rotate(sensor, &mut shown, core::ROTATE_90_CLOCKWISE)?,
        7 => {
            let turned = as_shown(sensor, 3)?;
            core::transpose(&turned, &mut shown)?;
        }
        8 => core::rotate(sensor, &mut shown, core::ROTATE_90_COUNTERCLOCKWISE)?,
        _ => return Ok(sensor.clone()),
    }
    Ok(shown)
}

/// The picture as the camera's sensor has it: what EXIF says of how it was held is not looked at.
pub(super) fn read_picture_as_taken(path: &Path) -> Result<Picture, Unread> {
    let mut bytes = plain_file::read(path, MOST_PICTURE).map_err(|_| Unread::Undecodable)?;
    if several_pictures::is_animated_webp(&bytes) {
        return Err(Unread::OtherKind(
            "an animated WebP: its frames have to be saved as PNG or as a video first",
        ));
    }
    let format = format_within_bounds(&bytes)?;
    if format == ImageFormat::Tiff {
        // OpenCV turns these, though told not to.
        tiff_header::forget_orientation(&mut bytes);
    }
    let flags = imgcodecs::IMREAD_COLOR | imgcodecs::IMREAD_IGNORE_ORIENTATION;
    let bgr = Mat::from_slice(&bytes).and_then(|bytes| imgcodecs::imdecode(&bytes, flags));
    Ok(Picture {
        bgr: bgr
            .ok()
            .filter(|picture| !picture.empty())
            .ok_or(Unread::Undecodable)?,
        is_cut_off: format == ImageFormat::Jpeg && jpeg_end::is_cut_off(&bytes),
        of: several_pictures::count(format, &bytes),
    })
}

/// The format of a file that may be decoded.
fn format_within_bounds(bytes: &[u8]) -> Result<ImageFormat, Unread> {
    let dimensions = || {
        let reader = ImageReader::new(Cursor::new(bytes))
            .with_guessed_format()
            .ok()?;
        let format = reader.format().filter(|format| FORMATS.contains(format))?;
        let is_honest = format != ImageFormat::Tiff || tiff_header::counts_fit(bytes);
        is_honest.then_some(())?;
        Some((format, reader.into_dimensions().ok()?))
    };
    let (format, (width, height)) = dimensions().ok_or_else(|| {
        let what = in_place_of(bytes);
        what.map_or(Unread::Undecodable, Unread::OtherKind)
    })?;
    let most = SMALL_PIXELS.max((bytes.len() as u64).saturating_mul(MOST_PIXELS_PER_BYTE));
    if u64::from(width) * u64::from(height) > most {
        return Err(Unread::TooManyPixels(most));
    }
    if width.max(height) > MOST_SIDE_PX {
        return Err(Unread::TooLong([width, height]));
    }
    Ok(format)
}

/// Width and height of a picture.
pub(super) fn size_of(picture: &Mat) -> [u32; 2] {
    [picture.cols().unsigned_abs(), picture.rows().unsigned_abs()]
}

/// 8-bit RGBA of an 8-bit BGR picture.
pub(super) fn rgba_from_bgr(bgr: &Mat) -> opencv::Result<Vec<u8>> {
    let mut rgba = vec![0; bgr.total() * 4];
    let mut target = Mat::new_rows_cols_with_bytes_mut::<Vec4b>(bgr.rows(), bgr.cols(), &mut rgba)?;
    imgproc::cvt_color_def(bgr, &mut target, imgproc::COLOR_BGR2RGBA)?;
    drop(target);
    Ok(rgba)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::FrameSource;

    #[test]
    fn a_picture_with_a_side_past_the_most_is_refused_by_its_size() {
        let folder = tempfile::tempdir().unwrap();
        let open = |width: u32, height: u32| {
            let path = folder.path().join("a.png");
            image::GrayImage::new(width, height).save(&path).unwrap();
            FrameSource::open(&path.display().to_string())
        };
        assert_eq!(open(32_767, 2).unwrap().size_px(), [32_767, 2]);
        for [width, height] in [[32_768, 2], [2, 40_000]] {
            let said = open(width, height).err().unwrap().to_string();
            let size = format!("pictures of {width} x {height} pixels; a side has at most 32767");
            assert!(said.contains(&size), "{said}");
        }
    }

    #[test]
    fn a_small_file_with_a_huge_header_is_no_picture() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        image::GrayImage::new(8, 4).save(&path).unwrap();
        assert_eq!(
            read_picture(&path).map(|picture| size_of(&picture.bgr)),
            Ok([8, 4])
        );
        // The size stands in the first chunk, whose checksum is made anew.
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..20].copy_from_slice(&30_000_u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&30_000_u32.to_be_bytes());
        let sum = checksum(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&sum.to_be_bytes());
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(image::image_dimensions(&path).unwrap(), (30_000, 30_000));
        let refused = read_picture(&path).err();
        assert_eq!(refused, Some(Unread::TooManyPixels(SMALL_PIXELS)));
        assert!(read_picture(folder.path()).is_err());
    }

    /// A picture is what its content is, whatever its name.
    #[test]
    fn sizes_are_looked_at_whatever_the_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, b"P6 2 1 255\n123456").unwrap();
        assert_eq!(read_picture(&path).map(|it| size_of(&it.bgr)), Ok([2, 1]));
        std::fs::write(&path, b"P6 30000 30000 255\n123456").unwrap();
        assert!(read_picture(&path).is_err());
        // Sun's raster files, which OpenCV knows.
        let head = [0x59a6_6a95_u32, 4, 1, 24, 12, 1, 0, 0];
        let mut bytes = head.map(u32::to_be_bytes).concat();
        bytes.extend([9; 12]);
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_picture(&path).is_err());
        // TIFF: width, height, 8 bits, not compressed, one strip.
        let mut bytes = b"II*\0\x08\0\0\0\x08\0".to_vec();
        let entries = [
            (256, 60_000),
            (257, 60_000),
            (258, 8),
            (259, 1),
            (262, 1),
            (273, 8),
            (278, 60_000),
            (279, 9),
        ];
        for (tag, value) in entries {
            bytes.extend(u16::to_le_bytes(tag));
            bytes.extend([4, 0, 1, 0, 0, 0]);
            bytes.extend(u32::to_le_bytes(value));
        }
        bytes.extend([0; 4]);
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_picture(&path).is_err());
    }

    /// A dot at the sensor's top left, and where it is shown: EXIF in the TIFF itself, and in the chunk of a WebP.
    #[test]
    fn pictures_are_turned_as_they_are_shown_whatever_their_kind() {
        let folder = tempfile::tempdir().unwrap();
        let mut sensor = image::RgbImage::new(40, 24);
        (0..64).for_each(|k| sensor.put_pixel(k % 8, k / 8, image::Rgb([255; 3])));
        let corners = [
            [0, 0],
            [39, 0],
            [39, 23],
            [0, 23],
            [0, 0],
            [23, 0],
            [23, 39],
            [0, 39],
        ];
        for (orientation, corner) in (1..=8).zip(corners) {
            for (name, format) in [("a.tif", ImageFormat::Tiff), ("a.webp", ImageFormat::WebP)] {
                let mut bytes = Cursor::new(Vec::new());
                sensor.write_to(&mut bytes, format).unwrap();
                let bytes = with_orientation(bytes.into_inner(), format, orientation);
                let path = folder.path().join(name);
                std::fs::write(&path, bytes).unwrap();
                let shown = read_picture(&path).unwrap().bgr;
                let taken = read_picture_as_taken(&path).unwrap().bgr;
                assert_eq!(size_of(&taken), [40, 24], "{name} {orientation}");
                assert!(is_light(&taken, [0, 0]), "{name} {orientation}");
                let size_px = if orientation < 5 { [40, 24] } else { [24, 40] };
                assert_eq!(size_of(&shown), size_px, "{name} {orientation}");
                assert!(is_light(&shown, corner), "{name} {orientation}");
            }
        }
    }

    fn is_light(bgr: &Mat, [x, y]: [i32; 2]) -> bool {
        bgr.at_2d::<opencv::core::Vec3b>(y, x).unwrap()[0] > 128
    }

    /// The same file with EXIF's tag of how the camera was held.
    fn with_orientation(mut bytes: Vec<u8>, format: ImageFormat, orientation: u8) -> Vec<u8> {
        if format == ImageFormat::Tiff {
            // Its directory goes to the end, with one entry more: tags increase.
            let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap());
            let old = number(4) as usize;
            let count = usize::from(bytes[old]) + 256 * usize::from(bytes[old + 1]);
            let entries: Vec<&[u8]> = bytes[old + 2..].chunks(12).take(count).collect();
            let tag = |entry: &[u8]| u16::from_le_bytes([entry[0], entry[1]]);
            let added = [0x12, 0x01, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0];
            let (below, above): (Vec<&[u8]>, Vec<&[u8]>) =
                entries.iter().partition(|entry| tag(entry) < 0x112);
            let entries = [below.concat(), added.to_vec(), above.concat()].concat();
            let count = ((count + 1) as u16).to_le_bytes();
            let directory = [&count[..], &entries, &[0; 4]].concat();
            let place = (bytes.len() as u32).to_le_bytes();
            bytes[4..8].copy_from_slice(&place);
            bytes.extend(directory);
            return bytes;
        }
        let tiff = b"II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0";
        let exif = [&tiff[..], &[orientation, 0, 0, 0, 0, 0, 0, 0]].concat();
        let chunk = |name: &[u8], content: &[u8]| {
            let length = (content.len() as u32).to_le_bytes();
            [name, &length, content].concat()
        };
        // RIFF, its length and WEBP come first; the head says that there is EXIF, and the size less 1.
        let head = chunk(b"VP8X", &[8, 0, 0, 0, 39, 0, 0, 23, 0, 0]);
        let content = [b"WEBP", &head[..], &bytes[12..], &chunk(b"EXIF", &exif)].concat();
        chunk(b"RIFF", &content)
    }

    /// CRC-32 as PNG has it (ISO 3309).
    fn checksum(bytes: &[u8]) -> u32 {
        let step = |sum: u32, byte: &u8| {
            (0..8).fold(sum ^ u32::from(*byte), |sum, _| match sum & 1 {
                1 => sum >> 1 ^ 0xedb8_8320,
                _ => sum >> 1,
            })
        };
        !bytes.iter().fold(!0, step)
    }
}
