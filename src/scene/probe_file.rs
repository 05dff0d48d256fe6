//! Pictures in linear radiance from files (Radiance HDR, OpenEXR), and light probes from them.

use std::fs;
use std::io::{BufReader, Cursor, ErrorKind};
use std::path::Path;

use exr::prelude::{ReadChannels, ReadLayers};
use glam::Vec3;
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;

use crate::light::probe::Probe;
use crate::light::probe_maps::{Circle, Projection, fitting_width_px, unwrap, world_from_camera};
use crate::light::radiance_picture::{Flaw, Flaws, RadiancePicture};

/// Columns of a probe made of an angular map or a ball.
const MOST_COLUMNS: usize = 4096;
/// Pixels of the largest picture that is read: 32768 x 16384 would take 6 GiB.
const MOST_PIXELS: usize = 16384 * 8192;

choices! {
    /// What a picture of all directions can be.
    pub enum ProbeKind, "kind of probe" {
        /// Twice as wide as high: row 0 looks up (+z), u = (atan2(y, x) + π) / 2π.
        LatitudeLongitude = "latitude-longitude",
        /// Debevec's angular map: the distance from the middle is proportional to the angle from the direction looked along.
        Angular = "angular",
        /// A mirror ball that fills the picture, photographed from afar.
        Ball = "ball",
    }
}

/// Reads a probe of any kind. Angular maps and balls are resampled; their middle looks along +y (a ball's camera did), with
/// +z upward and +x to the right.
///
/// # Errors
/// A message that begins with the path: not there, not a picture in linear radiance, of a shape that the kind cannot
/// have, pixels that are no radiance.
pub fn read(path: &Path, kind: ProbeKind) -> Result<Probe, String> {
    let picture = read_picture(path)?;
    let say = |message: String| format!("{}: {message}", path.display());
    if let Some(flaws) = picture.flaws() {
        return Err(say(format!(
            "{}; a probe's radiance is finite and not negative (gnomon probe {} --kind … --out … mends that)",
            flaws_told(flaws),
            path.display()
        )));
    }
    let size_px @ [width, height] = picture.size_px();
    let circle = Circle::inscribed(size_px);
    let projection = match kind {
        ProbeKind::LatitudeLongitude => {
            if width != 2 * height {
                return Err(say(format!(
                    "{width} x {height} pixels; a latitude-longitude picture is twice as wide as high (is it an angular \
                     map, or a mirror ball?)"
                )));
            }
            return Probe::new(size_px, picture.into_pixels())
                .ok_or_else(|| say("no pixels".to_owned()));
        }
        ProbeKind::Angular => Projection::Angular(circle),
        ProbeKind::Ball => Projection::Ball {
            circle,
            distance_radii: f64::INFINITY,
        },
    };
    if width != height {
        return Err(say(format!(
            "{width} x {height} pixels; an angular map or a mirror ball fills a square picture"
        )));
    }
    let width_px = fitting_width_px(projection, size_px).min(MOST_COLUMNS);
    unwrap(
        &picture,
        projection,
        world_from_camera(0.0, 0.0, 0.0),
        width_px,
    )
    .map(|unwrapped| unwrapped.probe)
    .ok_or_else(|| say(format!("{width} x {height} pixels are too few for a probe")))
}

/// Reads a picture in linear radiance as it is, flaws and all.
///
/// # Errors
/// A message that begins with the path: not there, not Radiance HDR or OpenEXR, cut off, without red, green and blue.
pub fn read_picture(path: &Path) -> Result<RadiancePicture, String> {
    let say = |message: String| format!("{}: {message}", path.display());
    let bytes = fs::read(path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => say("no such file".to_owned()),
        _ => say(error.to_string()),
    })?;
    // By content: a file's name does not always tell.
    let (size_px, pixels) = if bytes.starts_with(b"#?") {
        read_hdr(&bytes)
    } else if bytes.starts_with(&[0x76, 0x2f, 0x31, 0x01]) {
        read_exr(bytes)
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
    RadiancePicture::new(size_px, pixels).ok_or_else(|| say("the picture has no pixels".to_owned()))
}

/// What is wrong with a picture's pixels, in words.
pub fn flaws_told(flaws: Flaws) -> String {
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

type Pixels = ([usize; 2], Vec<Vec3>);

fn read_hdr(bytes: &[u8]) -> Result<Pixels, String> {
    let broken = |error: image::ImageError| format!("broken as Radiance HDR: {error}");
    let decoder = HdrDecoder::new(BufReader::new(bytes)).map_err(broken)?;
    let (width, height) = decoder.dimensions();
    let size_px = checked_size(width as usize, height as usize)?;
    let mut pixels = vec![Vec3::ZERO; size_px[0] * size_px[1]];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut pixels))
        .map_err(broken)?;
    Ok((size_px, pixels))
}

fn read_exr(bytes: Vec<u8>) -> Result<Pixels, String> {
    let broken = |error: exr::error::Error| {
        format!("broken as OpenEXR, or without red, green and blue: {error}")
    };
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .rgb_channels(
            |size_px, _| {
                (
                    size_px.width(),
                    vec![Vec3::ZERO; size_px.width() * size_px.height()],
                )
            },
            |(width, pixels): &mut (usize, Vec<Vec3>),
             place,
             (red, green, blue): (f32, f32, f32)| {
                pixels[place.y() * *width + place.x()] = Vec3::new(red, green, blue);
            },
        )
        .first_valid_layer()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let size = image.layer_data.size;
    let size_px = checked_size(size.width(), size.height())?;
    Ok((size_px, image.layer_data.channel_data.pixels.1))
}

fn checked_size(width: usize, height: usize) -> Result<[usize; 2], String> {
    match width.checked_mul(height) {
        Some(pixels) if pixels <= MOST_PIXELS => Ok([width, height]),
        _ => Err(format!(
            "{width} x {height} pixels are too many; at most {MOST_PIXELS} in all"
        )),
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use exr::prelude::WritableImage;
    use glam::DVec3;
    use image::codecs::hdr::HdrEncoder;

    use super::*;

    /// A file as `gnomon probe` or other programs write it.
    fn written(folder: &Path, name: &str, size_px: [usize; 2], pixels: &[Vec3]) -> PathBuf {
        let path = folder.join(name);
        if name.ends_with(".exr") {
            exr::prelude::Image::from_channels(
                (size_px[0], size_px[1]),
                exr::prelude::SpecificChannels::rgb(|place: exr::prelude::Vec2<usize>| {
                    pixels[place.y() * size_px[0] + place.x()].into()
                }),
            )
            .write()
            .to_file(&path)
            .unwrap();
        } else {
            let pixels: Vec<image::Rgb<f32>> = pixels
                .iter()
                .map(|pixel| image::Rgb(pixel.to_array()))
                .collect();
            HdrEncoder::new(fs::File::create(&path).unwrap())
                .encode(&pixels, size_px[0], size_px[1])
                .unwrap();
        }
        path
    }

    #[test]
    fn latitude_longitude_comes_pixel_by_pixel() {
        let folder = tempfile::tempdir().unwrap();
        // Powers of two: RGBE keeps them to the bit.
        let pixels: Vec<Vec3> = (0..32)
            .map(|index| Vec3::new(1.0, 0.5, 0.25) * f32::exp2((index % 11) as f32 - 3.0))
            .collect();
        for name in ["a.hdr", "a.exr"] {
            let path = written(folder.path(), name, [8, 4], &pixels);
            let probe = read(&path, ProbeKind::LatitudeLongitude).unwrap();
            assert_eq!((probe.size_px(), probe.pixels()), ([8, 4], &pixels[..]));
        }
    }

    #[test]
    fn an_angular_map_and_a_ball_look_along_y() {
        let folder = tempfile::tempdir().unwrap();
        let side = 64;
        // Bright at the right of the middle, dark else: a quarter of the way to an angular map's rim.
        let mut pixels = vec![Vec3::ZERO; side * side];
        for row in 30..34 {
            for column in 46..50 {
                pixels[row * side + column] = Vec3::ONE;
            }
        }
        let path = written(folder.path(), "a.hdr", [side, side], &pixels);
        // Half way to the rim: 90 degrees to the right of forward. On a ball: twice the normal's angle from backward.
        let ball = DVec3::new(
            1.0,
            -(2.0 * 0.5_f64.asin()).cos() / (2.0 * 0.5_f64.asin()).sin(),
            0.0,
        );
        for (kind, direction) in [(ProbeKind::Angular, DVec3::X), (ProbeKind::Ball, ball)] {
            let probe = read(&path, kind).unwrap();
            assert_eq!(probe.radiance(direction), Vec3::ONE, "{kind:?}");
            assert_eq!(probe.radiance(-DVec3::X), Vec3::ZERO, "{kind:?}");
        }
    }

    #[test]
    fn what_is_no_probe_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, size_px: [usize; 2], pixels: &[Vec3]| {
            written(folder.path(), name, size_px, pixels)
        };
        let refused = |path: &Path, kind, words: &[&str]| {
            let text = read(path, kind).unwrap_err();
            for word in words {
                assert!(text.contains(word), "{text:?} lacks {word:?}");
            }
        };
        let kind = ProbeKind::LatitudeLongitude;
        refused(
            &folder.path().join("none.hdr"),
            kind,
            &["none.hdr: no such file"],
        );
        let square = write("square.exr", [4, 4], &[Vec3::ONE; 16]);
        refused(
            &square,
            kind,
            &["square.exr", "4 x 4", "twice as wide as high"],
        );
        let wide = write("wide.exr", [8, 4], &[Vec3::ONE; 32]);
        refused(&wide, ProbeKind::Ball, &["8 x 4", "square"]);
        for (value, word) in [
            (f32::NAN, "not a number"),
            (f32::INFINITY, "infinite"),
            (-0.25, "negative"),
        ] {
            let mut pixels = [Vec3::ONE; 32];
            pixels[11].y = value;
            let path = write("flawed.exr", [8, 4], &pixels);
            refused(&path, kind, &["column 3, row 1", word, "gnomon probe"]);
        }
        let text = folder.path().join("text.hdr");
        fs::write(&text, "nothing of the kind").unwrap();
        refused(&text, kind, &["neither Radiance HDR"]);
        let whole = fs::read(write("whole.hdr", [64, 32], &[Vec3::ONE; 2048])).unwrap();
        let cut = folder.path().join("cut.hdr");
        fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
        refused(&cut, kind, &["cut.hdr: broken as Radiance HDR"]);
        let cut = folder.path().join("cut.exr");
        let whole = fs::read(&wide).unwrap();
        fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
        refused(&cut, kind, &["cut.exr: broken as OpenEXR"]);
        let png = folder.path().join("a.png");
        image::GrayImage::new(8, 4).save(&png).unwrap();
        refused(&png, kind, &["display values", "several exposures"]);
    }
}
