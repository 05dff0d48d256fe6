//! Pictures in linear radiance from files (Radiance HDR, OpenEXR), as their headers say.

mod exr;
mod hdr;

use std::io::ErrorKind;
use std::path::Path;

use glam::Vec3;

use super::in_its_place::in_place_of;
use super::plain_file::{self, MOST_PICTURE};
use crate::light::radiance_picture::{Flaw, Flaws, RadiancePicture};

/// Pixels of the largest picture that is read: 32768 x 16384 would take 6 GiB.
const MOST_PIXELS: usize = 16384 * 8192;
/// No file is too small for so many pixels: a constant sky takes next to nothing.
const SMALL_PIXELS: usize = 4 << 20;
/// What a byte of a larger picture holds at most; runs of Radiance HDR hold 16.
const MOST_PIXELS_PER_BYTE: usize = 16;
/// The largest half: what was brighter became infinite in files of halves, of which most are.
const LARGEST_HALF: f32 = 65504.0;

/// A picture as its file has it, and what there is to know of that.
#[derive(Debug, Clone)]
pub struct RadianceFile {
    /// In linear sRGB; every channel is finite and not negative.
    pub picture: RadiancePicture,
    /// What was passed over or taken for something else, one sentence each, without the path.
    pub notes: Vec<String>,
}

/// What the readers of both formats give.
#[derive(Debug)]
struct Pixels {
    size_px: [usize; 2],
    /// Linear sRGB, the upper row first.
    pixels: Vec<Vec3>,
    notes: Vec<String>,
}

/// Reads a picture in linear radiance: exposures, colours and windows are those that its header tells. An infinite channel is
/// taken as the largest finite one, or as the largest half where that is more.
///
/// `layer` picks one of an OpenEXR file with several, by its name or the part of the names of its channels before the last
/// dot.
///
/// # Errors
/// A message that begins with the path: not there, not Radiance HDR or OpenEXR, cut off, without red, green and blue, of
/// more pixels than any probe has, or several layers of which none was picked.
pub fn read(path: &Path, layer: Option<&str>) -> Result<RadianceFile, String> {
    let say = |message: String| format!("{}: {message}", path.display());
    let bytes = plain_file::read(path, MOST_PICTURE).map_err(|error| match error.kind() {
        ErrorKind::NotFound => say("no such file".to_owned()),
        _ => say(error.to_string()),
    })?;
    // By content: a file's name does not always tell.
    let mut read = if bytes.starts_with(b"#?") {
        match layer {
            Some(_) => Err("Radiance HDR has no layers".to_owned()),
            None => hdr::read(&bytes),
        }
    } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        exr::read(bytes, layer)
    } else if let Some(what) = in_place_of(&bytes) {
        Err(what.to_owned())
    } else if image::guess_format(&bytes).is_ok() {
        Err(
            "a picture of display values, which is cut off where light is brightest; a probe is Radiance HDR (.hdr) or \
             OpenEXR (.exr), and gnomon probe makes one of several exposures"
                .to_owned(),
        )
    } else {
        Err("neither Radiance HDR (.hdr) nor OpenEXR (.exr)".to_owned())
    }
    .map_err(say)?;
    read.notes.extend(make_finite(&mut read.pixels));
    let mut picture = RadiancePicture::new(read.size_px, read.pixels)
        .ok_or_else(|| say("the picture has no pixels".to_owned()))?;
    if let Some(flaws) = picture.flaws() {
        read.notes.push(format!(
            "{}; taken as black where negative, else as the mean of the pixels beside it",
            flaws_told(flaws)
        ));
        picture = picture.mended();
    }
    Ok(RadianceFile {
        picture,
        notes: read.notes,
    })
}

/// What is wrong with a picture's pixels, in words.
fn flaws_told(flaws: Flaws) -> String {
    let [column, row] = flaws.first_px;
    let what = match flaws.first {
        Flaw::NotANumber => "is not a number",
        Flaw::Infinite => "is infinite",
        Flaw::Negative => "is negative",
    };
    match flaws.count {
        1 => format!("the pixel in column {column}, row {row} (from 0) {what}"),
        count => format!(
            "{count} pixels are no radiance, the first one in column {column}, row {row} (from 0): it {what}"
        ),
    }
}

/// Puts the largest finite channel, but no less than the largest half, in the place of infinite ones, and tells of it.
fn make_finite(pixels: &mut [Vec3]) -> Option<String> {
    let is_infinite = |pixel: &&Vec3| pixel.to_array().contains(&f32::INFINITY);
    let count = pixels.iter().filter(is_infinite).count();
    if count == 0 {
        return None;
    }
    let channels = bytemuck::cast_slice_mut::<Vec3, f32>(pixels);
    let finite = channels
        .iter()
        .copied()
        .filter(|channel| channel.is_finite());
    let largest = finite.fold(LARGEST_HALF, f32::max);
    for channel in channels
        .iter_mut()
        .filter(|channel| **channel == f32::INFINITY)
    {
        *channel = largest;
    }
    Some(match count {
        1 => format!("an infinite pixel is taken as {largest}: its light may have been more"),
        _ => format!(
            "{count} infinite pixels are taken as {largest}: their light may have been more"
        ),
    })
}

/// A size that a file of so many bytes may have, before anything is allocated.
fn checked_size(width: usize, height: usize, length: usize) -> Result<[usize; 2], String> {
    match width.checked_mul(height) {
        Some(pixels) if pixels > MOST_PIXELS => Err(format!(
            "{width} x {height} pixels are too many; at most {MOST_PIXELS} in all"
        )),
        Some(pixels) if pixels <= SMALL_PIXELS.max(length.saturating_mul(MOST_PIXELS_PER_BYTE)) => {
            Ok([width, height])
        }
        Some(_) => Err(format!(
            "cut off, or not what its header says: {length} bytes hardly hold {width} x {height} pixels"
        )),
        None => Err("more pixels than can be counted".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_infinite_is_as_bright_as_can_be_told() {
        let mut pixels = [Vec3::ONE, Vec3::new(1.0, f32::INFINITY, 2.0)];
        assert!(
            make_finite(&mut pixels)
                .unwrap()
                .starts_with("an infinite pixel")
        );
        assert_eq!(pixels[1], Vec3::new(1.0, 65504.0, 2.0));
        let mut pixels = [Vec3::splat(1e6), Vec3::INFINITY];
        make_finite(&mut pixels).unwrap();
        assert_eq!(pixels[1], Vec3::splat(1e6));
        assert_eq!(make_finite(&mut pixels), None);
    }
}
