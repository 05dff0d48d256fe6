//! Picture files by OpenCV, and from its pictures to plain pixels.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use image::{ImageFormat, ImageReader};
use opencv::core::{Mat, MatTraitConst, Vec4b};
use opencv::{imgcodecs, imgproc};

use crate::geometry::camera::MOST_SIDE_PX;
use crate::geometry::quarter_turns::QuarterTurns;
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

/// The colours of a picture file, 8-bit BGR; `None` where OpenCV cannot decode it (it has no better word for it), or its
/// header asks for more pixels than a file of its size has.
pub(super) fn read_picture(path: &Path) -> Option<Mat> {
    read(path, imgcodecs::IMREAD_COLOR)
}

/// The same as the camera's sensor has it: what EXIF says of how it was held is not looked at.
pub(super) fn read_picture_as_taken(path: &Path) -> Option<Mat> {
    read(
        path,
        imgcodecs::IMREAD_COLOR | imgcodecs::IMREAD_IGNORE_ORIENTATION,
    )
}

/// The turn by which a picture as the sensor has it is shown, from its EXIF; a mirrored one counts as not turned.
pub(super) fn turn_when_shown(path: &Path) -> QuarterTurns {
    let orientation = || {
        let file = File::open(path).ok()?;
        let exif = exif::Reader::new()
            .read_from_container(&mut BufReader::new(file))
            .ok()?;
        exif.get_field(exif::Tag::Orientation, exif::In::PRIMARY)?
            .value
            .get_uint(0)
    };
    match orientation() {
        Some(3) => QuarterTurns::HALF,
        Some(6) => QuarterTurns::ONE,
        Some(8) => QuarterTurns::BACK,
        _ => QuarterTurns::NONE,
    }
}

fn read(path: &Path, flags: i32) -> Option<Mat> {
    let file = std::fs::metadata(path)
        .ok()
        .filter(std::fs::Metadata::is_file)?;
    let reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
    let format = reader.format().filter(|format| FORMATS.contains(format))?;
    if format == ImageFormat::Tiff {
        let bytes = plain_file::read(path, MOST_PICTURE).ok()?;
        tiff_header::counts_fit(&bytes).then_some(())?;
    }
    let (width, height) = reader.into_dimensions().ok()?;
    let most = SMALL_PIXELS.max(file.len().saturating_mul(MOST_PIXELS_PER_BYTE));
    if u64::from(width) * u64::from(height) > most || width.max(height) > MOST_SIDE_PX {
        return None;
    }
    imgcodecs::imread(path, flags)
        .ok()
        .filter(|picture| !picture.empty())
}

/// Width and height of a picture's file where one is longer than any that is read.
pub(super) fn too_long(path: &Path) -> Option<[u32; 2]> {
    let reader = ImageReader::open(path).ok()?.with_guessed_format().ok()?;
    let (width, height) = reader.into_dimensions().ok()?;
    (width.max(height) > MOST_SIDE_PX).then_some([width, height])
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
            read_picture(&path).map(|picture| size_of(&picture)),
            Some([8, 4])
        );
        // The size stands in the first chunk, whose checksum is made anew.
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..20].copy_from_slice(&30_000_u32.to_be_bytes());
        bytes[20..24].copy_from_slice(&30_000_u32.to_be_bytes());
        let sum = checksum(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&sum.to_be_bytes());
        std::fs::write(&path, &bytes).unwrap();
        assert_eq!(image::image_dimensions(&path).unwrap(), (30_000, 30_000));
        assert!(read_picture(&path).is_none());
        assert!(read_picture(folder.path()).is_none());
    }

    /// A picture is what its content is, whatever its name.
    #[test]
    fn sizes_are_looked_at_whatever_the_name() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        std::fs::write(&path, b"P6 2 1 255\n123456").unwrap();
        assert_eq!(read_picture(&path).map(|it| size_of(&it)), Some([2, 1]));
        std::fs::write(&path, b"P6 30000 30000 255\n123456").unwrap();
        assert!(read_picture(&path).is_none());
        // Sun's raster files, which OpenCV knows.
        let head = [0x59a6_6a95_u32, 4, 1, 24, 12, 1, 0, 0];
        let mut bytes = head.map(u32::to_be_bytes).concat();
        bytes.extend([9; 12]);
        std::fs::write(&path, &bytes).unwrap();
        assert!(read_picture(&path).is_none());
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
        assert!(read_picture(&path).is_none());
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
