//! Light probes from pictures in linear radiance.

use std::f64::consts::TAU;
use std::path::Path;

use glam::Vec3;

use super::radiance_file::{self, RadianceFile};
use crate::light::probe::Probe;
use crate::light::probe_maps::{Circle, Projection, fitting_width_px, unwrap, world_from_camera};
use crate::light::radiance_picture::RadiancePicture;

/// Columns of a probe made of an angular map or a ball.
const MOST_COLUMNS: usize = 4096;
choices! {
    /// What a picture of all directions can be.
    pub enum ProbeKind, "kind of probe" {
        /// Twice as wide as high: row 0 looks up (+z), u = (atan2(y, x) + π) / 2π.
        LatitudeLongitude = "latitude-longitude",
        /// Twice as wide as high, as one sees it from inside: its middle looks along +y, columns to the right of it farther
        /// to the right.
        Panorama = "panorama",
        /// Debevec's angular map: the distance from the middle is proportional to the angle from the direction looked along.
        Angular = "angular",
        /// A mirror ball that fills the picture, photographed from afar.
        Ball = "ball",
    }
}

/// A probe as its file has it.
#[derive(Debug, Clone)]
pub struct ProbeFile {
    /// What it saw.
    pub probe: Probe,
    /// What was passed over or taken for something else, one sentence each, without the path.
    pub notes: Vec<String>,
}

/// How a file is to be read as a probe.
#[derive(Debug, Clone, Copy)]
pub struct ProbeReading<'a> {
    /// What the picture is.
    pub kind: ProbeKind,
    /// By how much all of it is turned to the left, seen from above, radians.
    pub turn: f64,
    /// Which layer of an OpenEXR file.
    pub layer: Option<&'a str>,
}

impl From<ProbeKind> for ProbeReading<'_> {
    fn from(kind: ProbeKind) -> Self {
        Self {
            kind,
            turn: 0.0,
            layer: None,
        }
    }
}

/// Reads a probe of any kind. Angular maps and balls are resampled; their middle looks along +y (a ball's camera did), with
/// +z upward and +x to the right. Of the other kinds columns are moved, so that no light is lost.
///
/// # Errors
/// A message that begins with the path: not there, not a picture in linear radiance, of a shape that the kind cannot
/// have, no such layer.
pub fn read<'a>(path: &Path, reading: impl Into<ProbeReading<'a>>) -> Result<ProbeFile, String> {
    let ProbeReading { kind, turn, layer } = reading.into();
    let RadianceFile { picture, notes } = radiance_file::read(path, layer)?;
    let say = |message: String| format!("{}: {message}", path.display());
    let size_px @ [width, height] = picture.size_px();
    let circle = Circle::inscribed(size_px);
    let projection = match kind {
        ProbeKind::LatitudeLongitude | ProbeKind::Panorama => {
            if width != 2 * height {
                return Err(say(format!(
                    "{width} x {height} pixels; a picture of latitude and longitude is twice as wide as high (is it an \
                     angular map, or a mirror ball?)"
                )));
            }
            let turned = turned(&picture, kind == ProbeKind::Panorama, turn);
            return Probe::new(size_px, turned)
                .map(|probe| ProbeFile { probe, notes })
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
        world_from_camera(turn, 0.0, 0.0),
        width_px,
    )
    .map(|unwrapped| ProbeFile {
        probe: unwrapped.probe,
        notes,
    })
    .ok_or_else(|| say(format!("{width} x {height} pixels are too few for a probe")))
}

/// Pixels of a probe from a picture of latitude and longitude, turned to the left by an angle. A column that falls between two
/// is shared out between them, so that each row keeps its light.
fn turned(picture: &RadiancePicture, is_panorama: bool, turn: f64) -> Vec<Vec3> {
    let [width, _] = picture.size_px();
    let columns = width as f64 * (turn / TAU).rem_euclid(1.0);
    // A panorama runs the other way, and its middle looks along +y: u = 3/4.
    let columns = match is_panorama {
        true => columns + 0.25 * width as f64,
        false => columns,
    };
    let whole = columns.floor();
    let mut part = (columns - whole) as f32;
    let mut whole = whole as usize;
    // (Turns by whole columns are exact, but for rounding.)
    if !(1e-6..1.0 - 1e-6).contains(&part) {
        whole += part.round() as usize;
        part = 0.0;
    }
    let rows = picture.pixels().chunks(width);
    rows.flat_map(|row| {
        (0..width).map(move |column| {
            // What is now in this column, and what comes after it, was that many columns before.
            let from = |column: usize| {
                let before = (column + 2 * width - whole % width) % width;
                row[if is_panorama {
                    width - 1 - before
                } else {
                    before
                }]
            };
            let here = from(column);
            match part > 0.0 {
                true => here * (1.0 - part) + from(column + width - 1) * part,
                false => here,
            }
        })
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::PathBuf;

    use exr::prelude::WritableImage;
    use glam::{DMat3, DVec3};
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
            let probe = read(&path, ProbeKind::LatitudeLongitude).unwrap().probe;
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
            let probe = read(&path, kind).unwrap().probe;
            assert_eq!(probe.radiance(direction), Vec3::ONE, "{kind:?}");
            assert_eq!(probe.radiance(-DVec3::X), Vec3::ZERO, "{kind:?}");
        }
    }

    #[test]
    fn a_turned_probe_is_the_same_light_from_elsewhere() {
        let folder = tempfile::tempdir().unwrap();
        let [width, height] = [16, 8];
        let pixels: Vec<Vec3> = (0..width * height)
            .map(|index| Vec3::splat(f32::exp2((index * 7 % 13) as f32)))
            .collect();
        let path = written(folder.path(), "a.exr", [width, height], &pixels);
        let turned = |kind, degrees: f64| {
            let reading = ProbeReading {
                turn: degrees.to_radians(),
                ..ProbeReading::from(kind)
            };
            read(&path, reading).unwrap().probe
        };
        let plain = turned(ProbeKind::LatitudeLongitude, 0.0);
        let about_z = |at: DVec3, degrees: f64| DMat3::from_rotation_z(degrees.to_radians()) * at;
        for degrees in [0.0, 22.5, 90.0, -45.0, 720.0 + 67.5] {
            let found = turned(ProbeKind::LatitudeLongitude, degrees);
            let seen = turned(ProbeKind::Panorama, degrees);
            for row in 0..height {
                for column in 0..width {
                    let at = plain.direction(column as f64 + 0.5, row as f64 + 0.5);
                    let expected = plain.radiance(at);
                    assert_eq!(found.radiance(about_z(at, degrees)), expected, "{degrees}");
                    // From inside: as far right of the middle, which looks along +y, as the column is.
                    let right = (column as f64 + 0.5) / width as f64 * 360.0 - 180.0;
                    let level = DVec3::new(0.0, at.truncate().length(), at.z);
                    let place = about_z(level, degrees - right);
                    assert_eq!(
                        seen.radiance(place),
                        pixels[row * width + column],
                        "{degrees}"
                    );
                }
            }
        }
        // Between columns each row keeps its light.
        let between = turned(ProbeKind::Panorama, 7.3);
        for row in 0..height {
            let sum = |pixels: &[Vec3]| {
                pixels[row * width..][..width]
                    .iter()
                    .map(|p| p.x)
                    .sum::<f32>()
            };
            let (found, expected) = (sum(between.pixels()), sum(&pixels));
            assert!(
                (found / expected - 1.0).abs() < 1e-5,
                "{found} for {expected}"
            );
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
        for (value, word) in [(f32::NAN, "not a number"), (-0.25, "negative")] {
            let mut pixels = [Vec3::ONE; 32];
            pixels[11].y = value;
            let path = write("flawed.exr", [8, 4], &pixels);
            // As programs that ring or change primaries leave them: mended, and told.
            let read = read(&path, kind).unwrap();
            let [note] = &read.notes[..] else {
                panic!("{:?}", read.notes)
            };
            assert!(
                note.contains("column 3, row 1") && note.contains(word),
                "{note}"
            );
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
