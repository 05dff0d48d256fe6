//! Bracketed pictures: read, moved on to each other, and the camera's response from them (OpenCV's `photo`).

use std::io::BufReader;
use std::path::{Path, PathBuf};

use exif::{In, Tag, Value};
use opencv::core::{Mat, MatTraitConst, Vec3b, Vec3f, Vector};
use opencv::photo;
use opencv::photo::CalibrateCRFTrait;

use super::alignment::shift_px;
use super::pixels;
use crate::light::response::Response;
use crate::scene::plain_file;

/// The curve is solved for from so many places a side: a square of them, for its matrix grows with their number.
const PLACES_A_SIDE: usize = 11;
/// Weight of the curve's smoothness.
/// OpenCV's 10 follows the noise where exposures are three stops apart.
const SMOOTHNESS: f32 = 50.0;

/// Pictures of one view.
#[derive(Debug, Clone, PartialEq)]
pub struct Bracket {
    /// Width and height of all.
    pub size_px: [usize; 2],
    /// 8-bit RGBA of each, rows from the top.
    pub pictures: Vec<Vec<u8>>,
}

/// A pixel that the curve could be solved from: brightness and detail are sums of levels over all exposures.
#[derive(Clone, Copy)]
struct SamplePlace {
    brightness: u32,
    detail: u32,
    index: usize,
}

/// What can go wrong with bracketed pictures.
#[derive(Debug, thiserror::Error)]
pub enum ExposureError {
    /// A picture that is not there, or that OpenCV cannot decode.
    #[error("{}: {}", path.display(), if path.exists() { "not a picture that can be read" } else { "no such file" })]
    Unreadable {
        /// The picture.
        path: PathBuf,
    },
    /// A picture that has not the first one's size.
    #[error(
        "{}: {} x {} pixels, but {} has {} x {}; all exposures show the same view",
        path.display(), size_px[0], size_px[1], first.display(), first_px[0], first_px[1]
    )]
    OtherSize {
        /// The picture.
        path: PathBuf,
        /// The picture's size.
        size_px: [u32; 2],
        /// The first picture.
        first: PathBuf,
        /// The first picture's size.
        first_px: [u32; 2],
    },
    /// Nothing to solve the curve from.
    #[error(
        "the camera's response cannot be estimated: {reason}; take at least two exposures of one view, two stops apart, or \
         give a response (--response)"
    )]
    NoResponse {
        /// What is missing.
        reason: &'static str,
    },
    /// OpenCV failed where it has no reason to.
    #[error("OpenCV: {0}")]
    OpenCv(#[from] opencv::Error),
}

impl Bracket {
    /// Reads pictures of one size.
    ///
    /// # Errors
    /// The first picture that cannot be read, or has not the size of the first.
    pub fn read(paths: &[PathBuf]) -> Result<Self, ExposureError> {
        let mut size_px = [0; 2];
        let mut pictures = Vec::new();
        for path in paths {
            let picture = pixels::read_picture(path)
                .map_err(|_| ExposureError::Unreadable { path: path.clone() })?
                .bgr;
            let found_px = pixels::size_of(&picture);
            if pictures.is_empty() {
                size_px = found_px;
            } else if found_px != size_px {
                return Err(ExposureError::OtherSize {
                    path: path.clone(),
                    size_px: found_px,
                    first: paths[0].clone(),
                    first_px: size_px,
                });
            }
            pictures.push(pixels::rgba_from_bgr(&picture)?);
        }
        Ok(Self {
            size_px: size_px.map(|side| side as usize),
            pictures,
        })
    }

    /// Moves the pictures by whole pixels on to the `fixed` one; what comes in from outside is black. Returns each one's
    /// movement, right and down.
    pub fn align(&mut self, fixed: usize) -> Vec<[i32; 2]> {
        let [width, height] = self.size_px.map(|side| side as i32);
        let place = self.pictures[fixed].clone();
        let mut shifts_px = Vec::new();
        for picture in &mut self.pictures {
            let moved_px @ [right, down] = shift_px(&place, picture, self.size_px);
            shifts_px.push(moved_px);
            let was = std::mem::replace(picture, vec![0; picture.len()]);
            for (row, column) in
                (0..height).flat_map(|row| (0..width).map(move |column| (row, column)))
            {
                let from = [column - right, row - down];
                if (0..width).contains(&from[0]) && (0..height).contains(&from[1]) {
                    let from = 4 * (from[1] * width + from[0]) as usize;
                    let to = 4 * (row * width + column) as usize;
                    picture[to..to + 4].copy_from_slice(&was[from..from + 4]);
                }
            }
        }
        shifts_px
    }

    /// The camera's response, from even places inside a rectangle (left, top, width, height), by Debevec's method.
    ///
    /// # Errors
    /// [`ExposureError::NoResponse`], or OpenCV's.
    pub fn response(
        &self,
        exposures: &[f64],
        rectangle_px: [usize; 4],
    ) -> Result<Response, ExposureError> {
        if self.pictures.len() < 2 {
            return Err(ExposureError::NoResponse {
                reason: "there is one exposure only",
            });
        }
        let places = self.even_places(rectangle_px);
        if places.len() < PLACES_A_SIDE * PLACES_A_SIDE {
            return Err(ExposureError::NoResponse {
                reason: "the pictures show too little that is neither black nor white",
            });
        }
        let side = PLACES_A_SIDE as i32;
        let mut samples = Vector::<Mat>::new();
        for rgba in &self.pictures {
            let bgr: Vec<Vec3b> = places
                .iter()
                .map(|&index| Vec3b::from([2, 1, 0].map(|channel| self.mean(rgba, index, channel))))
                .collect();
            samples.push(Mat::new_rows_cols_with_data(side, side, &bgr)?.try_clone()?);
        }
        let times: Vector<f32> = exposures.iter().map(|&exposure| exposure as f32).collect();
        let mut calibration = photo::create_calibrate_debevec(side * side, SMOOTHNESS, false)?;
        let mut solved = Mat::default();
        calibration.process(&samples, &mut solved, &times)?;
        let mut exposure_of_level = [[0.0; 3]; 256];
        for (level, exposure) in exposure_of_level.iter_mut().enumerate() {
            let bgr = solved.at::<Vec3f>(level as i32)?;
            *exposure = [bgr[2], bgr[1], bgr[0]].map(f64::from);
        }
        Response::estimated(exposure_of_level).ok_or(ExposureError::NoResponse {
            reason: "the pictures contradict their exposure times (are they in the same order?)",
        })
    }

    /// Places of all brightnesses, of each the one with the least detail: there noise can be averaged away, and a hand
    /// that moved matters least.
    fn even_places(&self, [left, top, width, height]: [usize; 4]) -> Vec<usize> {
        let columns = self.size_px[0];
        let mut places = Vec::new();
        for row in top + 1..(top + height).saturating_sub(1) {
            for column in left + 1..(left + width).saturating_sub(1) {
                let index = row * columns + column;
                let (mut brightness, mut detail, mut tells) = (0, 0, false);
                for rgba in &self.pictures {
                    let level = |index: usize| {
                        rgba[4 * index..4 * index + 3]
                            .iter()
                            .map(|&level| u32::from(level))
                            .sum::<u32>()
                    };
                    let here = level(index);
                    brightness += here;
                    tells |= (24..741).contains(&here);
                    for next in [index - 1, index + 1, index - columns, index + columns] {
                        detail += here.abs_diff(level(next));
                    }
                }
                if tells {
                    places.push(SamplePlace {
                        brightness,
                        detail,
                        index,
                    });
                }
            }
        }
        places.sort_unstable_by_key(|place| (place.brightness, place.index));
        let (Some(darkest), Some(brightest)) = (places.first(), places.last()) else {
            return Vec::new();
        };
        let wanted = PLACES_A_SIDE * PLACES_A_SIDE;
        let flattest =
            |places: &[SamplePlace]| places.iter().min_by_key(|place| place.detail).copied();
        // What is common: as many pixels for each place.
        let common = |count: usize| -> Vec<SamplePlace> {
            (0..count)
                .filter_map(|part| {
                    flattest(
                        &places[part * places.len() / count..(part + 1) * places.len() / count],
                    )
                })
                .collect()
        };
        let mut details: Vec<u32> = common(wanted).iter().map(|place| place.detail).collect();
        details.sort_unstable();
        let flat = 2 * details.get(details.len() / 2).copied().unwrap_or(0);
        // What is rare tells of other levels: half of the places are evenly bright, where those are flat.
        let [low, high] =
            [darkest.brightness, brightest.brightness + 1].map(|level| level as usize);
        let parts = wanted / 2;
        let mut chosen: Vec<SamplePlace> = (0..parts)
            .filter_map(|part| {
                let bound = |part: usize| low + (high - low) * part / parts;
                let start =
                    places.partition_point(|place| (place.brightness as usize) < bound(part));
                let end =
                    places.partition_point(|place| (place.brightness as usize) < bound(part + 1));
                flattest(&places[start..end]).filter(|place| place.detail <= flat)
            })
            .collect();
        chosen.extend(common(wanted - chosen.len()));
        chosen.iter().map(|place| place.index).collect()
    }

    /// The mean of all exposures, grey, one 32-bit float a pixel.
    pub(super) fn mean_grey(&self) -> opencv::Result<Mat> {
        let [width, height] = self.size_px;
        let count = self.pictures.len() as u32;
        let grey: Vec<f32> = (0..width * height)
            .map(|index| {
                let sum: u32 = (self.pictures.iter())
                    .flat_map(|rgba| &rgba[4 * index..4 * index + 3])
                    .map(|&level| u32::from(level))
                    .sum();
                sum as f32 / (3 * count) as f32
            })
            .collect();
        Mat::from_slice(&grey)?
            .reshape(1, height as i32)?
            .try_clone()
    }

    /// The mean level of 3 x 3 pixels.
    fn mean(&self, rgba: &[u8], index: usize, channel: usize) -> u8 {
        let columns = self.size_px[0];
        let rows = [index - columns, index, index + columns];
        let sum: u32 = (rows.into_iter())
            .flat_map(|middle| [middle - 1, middle, middle + 1])
            .map(|index| u32::from(rgba[4 * index + channel]))
            .sum();
        ((sum + 4) / 9) as u8
    }
}

/// How much light a photograph let in, from its EXIF: time, times sensitivity over ISO 100, over the f-number squared;
/// what it does not tell counts as 1. `None` without an exposure time.
pub fn exif_exposure(path: &Path) -> Option<f64> {
    let file = plain_file::open(path).ok()?;
    let exif = exif::Reader::new()
        .read_from_container(&mut BufReader::new(file))
        .ok()?;
    let number = |tag| {
        let field = exif.get_field(tag, In::PRIMARY)?;
        let value = match &field.value {
            Value::Rational(values) => values.first()?.to_f64(),
            value => f64::from(value.get_uint(0)?),
        };
        (value.is_finite() && value > 0.0).then_some(value)
    };
    let iso = number(Tag::PhotographicSensitivity).unwrap_or(100.0);
    let f_number = number(Tag::FNumber).unwrap_or(1.0);
    Some(number(Tag::ExposureTime)? * iso / 100.0 / (f_number * f_number))
}

#[cfg(test)]
mod tests {
    use exif::experimental::Writer;
    use exif::{Field, Rational};

    use super::*;

    #[test]
    fn exif_tells_the_light_that_was_let_in() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.tif");
        let field = |tag, value| Field {
            tag,
            ifd_num: In::PRIMARY,
            value,
        };
        let ratio = |num, denom| Value::Rational(vec![Rational { num, denom }]);
        let time = field(Tag::ExposureTime, ratio(1, 30));
        let others = [
            field(Tag::PhotographicSensitivity, Value::Short(vec![400])),
            field(Tag::FNumber, ratio(28, 10)),
        ];
        let write = |fields: &[&Field]| {
            let mut writer = Writer::new();
            fields.iter().for_each(|field| writer.push_field(field));
            let mut bytes = std::io::Cursor::new(Vec::new());
            writer.write(&mut bytes, false).unwrap();
            std::fs::write(&path, bytes.into_inner()).unwrap();
            exif_exposure(&path)
        };
        assert_eq!(write(&[&time]), Some(1.0 / 30.0));
        let all = write(&[&time, &others[0], &others[1]]).unwrap();
        assert!((all / (4.0 / 30.0 / 2.8 / 2.8) - 1.0).abs() < 1e-12);
        assert_eq!(write(&[&others[0]]), None);
        assert_eq!(write(&[&field(Tag::ExposureTime, ratio(1, 0))]), None);
        assert_eq!(exif_exposure(&folder.path().join("none.jpg")), None);
    }
}
