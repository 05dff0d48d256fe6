//! Calibration files: gnomon's own TOML or JSON, a session's JSON, OpenCV's FileStorage (YAML, XML, JSON), ROS's
//! `CameraInfo` and `ost.txt`, Kalibr's camchain and EuRoC's sensors, PhotonVision's and calib.io's JSON, whatever names
//! `fx`, `fy`, `cx`, `cy` (RealSense, ORB-SLAM, VINS, NeRF), OpenSfM's cameras (`opensfm.rs`), NumPy's arrays (`numpy.rs`), COLMAP's
//! `cameras.txt`. All but the last become the same tree of values first (`tree.rs`), so there is one place that knows the keys
//! (`kinds.rs`; `lens.rs` for the lens's; `sizes.rs` for the picture's size; `by_letters.rs` for the letters).

mod by_letters;
mod colmap;
mod entries;
mod kinds;
mod lens;
mod lens_names;
mod numpy;
mod opensfm;
mod ost;
mod sizes;
mod tree;
mod values;

use std::path::{Path, PathBuf};

use glam::DVec2;

use self::values::{Lens, UncheckedCalibration};
use crate::geometry::camera::{Distortion, Intrinsics, MOST_SIDE_PX};
use crate::scene::in_its_place::in_place_of;
use crate::scene::obj::text::decoded;
use crate::scene::plain_file::{self, MOST_TEXT};

/// Why a calibration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The system refuses to read it.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// Not what its extension says.
    #[error("{}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column where known.
        message: String,
    },
    /// A value that no camera has, or one that is missing.
    #[error("{}: {message}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// The file holds no picture size, and nothing else tells it.
    #[error(
        "{}: the calibration does not say for which picture size it holds; add size_px = [width, height] \
         (OpenCV: image_width and image_height)",
        path.display()
    )]
    NoSize {
        /// The file.
        path: PathBuf,
    },
    /// The file holds no picture size, and its principal point tells that it is not that of the frames.
    #[error(
        "{}: the calibration does not say for which picture size it holds, and with its principal point at ({:.0}, {:.0}) that is \
         hardly {} x {} pixels, as the frames have; add size_px = [width, height] (OpenCV: image_width and image_height)",
        path.display(), center_px.x, center_px.y, frame_px[0], frame_px[1]
    )]
    UnlikelySize {
        /// The file.
        path: PathBuf,
        /// Its principal point.
        center_px: DVec2,
        /// Width and height of the frames.
        frame_px: [u32; 2],
    },
    /// The frames are of another size than the calibration.
    #[error(
        "{frames_of} has frames of {} x {} pixels, but its calibration is for {} x {}; calibrate at the recording's size",
        frame_px[0], frame_px[1], calibration_px[0], calibration_px[1]
    )]
    OtherSize {
        /// The recording.
        frames_of: String,
        /// Width and height of its frames.
        frame_px: [u32; 2],
        /// Width and height that the calibration holds for.
        calibration_px: [u32; 2],
    },
}

/// Reads a calibration that says its own picture size.
pub fn load_calibration(path: &Path) -> Result<Intrinsics, CalibrationError> {
    let calibration = read(path, None)?;
    let size_px = calibration
        .size_px
        .ok_or_else(|| CalibrationError::NoSize {
            path: path.to_owned(),
        })?;
    calibration.into_intrinsics(path, size_px)
}

/// What a calibration does not say and had to be assumed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Assumed {
    /// The picture's size: that of the frames.
    Size,
    /// The lens: one that distorts nothing.
    NoDistortion,
}

impl Assumed {
    /// What to say of it, where the frames of a recording have a size.
    pub fn told(self, path: &Path, frame_px: [u32; 2], frames_of: &str) -> String {
        let (path, [width, height]) = (path.display(), frame_px);
        match self {
            Self::Size => format!(
                "{path} does not say for which picture size it holds; taken to be {width} x {height}, as {frames_of} has"
            ),
            Self::NoDistortion => {
                format!("{path} has no distortion in it; the lens is taken to have none")
            }
        }
    }
}

/// As [`load_calibration`], for frames of a known size, which tells the camera that is meant where the file holds several. A file
/// without a size, such as examples of OpenCV's write, is taken to hold for them where its principal point lies near their
/// middle. What was assumed stands beside the calibration.
pub fn load_calibration_among(
    path: &Path,
    frame_px: [u32; 2],
) -> Result<(Intrinsics, Vec<Assumed>), CalibrationError> {
    // Half of the difference between two usual sizes is more, what lenses are off is less.
    const FARTHEST_OFF: f64 = 0.1;
    let calibration = read(path, Some(frame_px))?;
    let is_assumed = calibration.size_px.is_none();
    let assumed = [
        is_assumed.then_some(Assumed::Size),
        (!calibration.lens.is_said).then_some(Assumed::NoDistortion),
    ];
    let size_px = calibration.size_px.unwrap_or(frame_px);
    let intrinsics = calibration.into_intrinsics(path, size_px)?;
    let sides = DVec2::from_array(frame_px.map(f64::from));
    let off = (intrinsics.center_px - 0.5 * (sides - 1.0)) / sides;
    if is_assumed && off.abs().max_element() > FARTHEST_OFF {
        return Err(CalibrationError::UnlikelySize {
            path: path.to_owned(),
            center_px: intrinsics.center_px,
            frame_px,
        });
    }
    Ok((intrinsics, assumed.into_iter().flatten().collect()))
}

/// Reads a calibration for frames of a known size: one that says no size is taken to hold for them, one that says
/// another is refused. `frames_of` names the recording in the message.
pub fn load_calibration_for(
    path: &Path,
    frame_px: [u32; 2],
    frames_of: &str,
) -> Result<Intrinsics, CalibrationError> {
    let intrinsics = load_calibration_or_fill(path, frame_px)?;
    check_frame_size(&intrinsics, frame_px, frames_of)?;
    Ok(intrinsics)
}

/// Refuses a calibration that was made at another picture size. `frames_of` names the recording in the message.
pub fn check_frame_size(
    intrinsics: &Intrinsics,
    frame_px: [u32; 2],
    frames_of: &str,
) -> Result<(), CalibrationError> {
    if intrinsics.size_px == frame_px {
        return Ok(());
    }
    Err(CalibrationError::OtherSize {
        frames_of: frames_of.to_owned(),
        frame_px,
        calibration_px: intrinsics.size_px,
    })
}

/// As [`load_calibration`], with a size for files that say none.
pub(super) fn load_calibration_or_fill(
    path: &Path,
    default_px: [u32; 2],
) -> Result<Intrinsics, CalibrationError> {
    let calibration = read(path, Some(default_px))?;
    let size_px = calibration.size_px.unwrap_or(default_px);
    calibration.into_intrinsics(path, size_px)
}

/// A calibration in gnomon's own format, which [`load_calibration`] reads from a `.toml` file to the bit.
pub fn calibration_text(intrinsics: &Intrinsics) -> String {
    let Intrinsics {
        size_px: [width, height],
        focal_px,
        center_px,
        distortion,
    } = intrinsics;
    let (model, names) = match distortion {
        Distortion::Polynomial(_) => ("", "k1, k2, p1, p2, k3"),
        Distortion::Rational(_) => ("", "k1, k2, p1, p2, k3 to k6, s1 to s4, tilt about x and y"),
        Distortion::Fisheye(_) => ("model = \"fisheye\"\n", "k1, k2, k3, k4"),
    };
    let coefficients = distortion.coefficients();
    // `?` writes as many digits as tell the number from its neighbours, and a point in each.
    format!(
        "size_px = [{width}, {height}]\n\
         focal_px = [{:?}, {:?}]\n\
         center_px = [{:?}, {:?}]\n\
         {model}distortion = {coefficients:?}    # {names}\n",
        focal_px.x, focal_px.y, center_px.x, center_px.y
    )
}

impl UncheckedCalibration {
    fn into_intrinsics(
        self,
        path: &Path,
        size_px: [u32; 2],
    ) -> Result<Intrinsics, CalibrationError> {
        let refuse = |message: String| {
            Err(CalibrationError::Value {
                path: path.to_owned(),
                message,
            })
        };
        let Self {
            focal_px,
            center_px,
            lens: Lens { distortion, .. },
            ..
        } = self;
        let mut numbers = focal_px
            .iter()
            .chain(&center_px)
            .chain(distortion.coefficients());
        if !numbers.all(|number| number.is_finite()) {
            return refuse(
                "focal lengths, centre and distortion must be finite numbers".to_owned(),
            );
        }
        if size_px.contains(&0) || size_px.iter().any(|&side| side > MOST_SIDE_PX) {
            return refuse(format!(
                "the picture size {} x {} must be from 1 to {MOST_SIDE_PX}",
                size_px[0], size_px[1]
            ));
        }
        if focal_px.iter().any(|&focal| focal <= 0.0) {
            return refuse(format!(
                "the focal lengths {} and {} must be greater than 0",
                focal_px[0], focal_px[1]
            ));
        }
        if let Some(looks) = other_units(focal_px, center_px, size_px) {
            return refuse(format!(
                "the focal lengths {} and {} and the principal point ({}, {}) must be in pixels of a picture of {} x {}; {looks}",
                focal_px[0], focal_px[1], center_px[0], center_px[1], size_px[0], size_px[1]
            ));
        }
        // A cropped picture may have its centre outside, but not far.
        for (center, side) in center_px.iter().zip(size_px.map(f64::from)) {
            if *center < -0.5 * side || *center > 1.5 * side {
                return refuse(format!(
                    "the principal point ({}, {}) lies far from a picture of {} x {} pixels",
                    center_px[0], center_px[1], size_px[0], size_px[1]
                ));
            }
        }
        Ok(Intrinsics {
            size_px,
            focal_px: DVec2::from_array(focal_px),
            center_px: DVec2::from_array(center_px),
            distortion,
        })
    }
}

/// What lengths look like that are in no pixels; `None`: they may be.
fn other_units(focal_px: [f64; 2], center_px: [f64; 2], size_px: [u32; 2]) -> Option<&'static str> {
    // The widest fisheyes, 220° across a tenth of the picture's longer side, have less than half of it.
    const LEAST_FOCAL: f64 = 0.1;
    const MOST_SHARE: f64 = 1.0;
    /// Longer than a lens of 10° across in shares of a side.
    const MOST_FOCAL_SHARE: f64 = 6.0;
    let longer_px = f64::from(size_px[0].max(size_px[1]));
    let is_short = focal_px
        .iter()
        .any(|&focal| focal < LEAST_FOCAL * longer_px);
    let is_share = center_px.iter().all(|center| center.abs() <= MOST_SHARE);
    let are_shares = is_share && focal_px.iter().all(|&focal| focal < MOST_FOCAL_SHARE);
    match (is_short, is_share) {
        (true, _) if are_shares => Some(
            "they look normalised: multiply x by the width and y by the height, or both by what they are shares of",
        ),
        (true, _) => Some(
            "they look like millimetres: divide them by the side of a pixel, as the sensor's width by the picture's",
        ),
        (false, true) => {
            Some("the principal point looks normalised, or relative to the picture's middle")
        }
        (false, false) => None,
    }
}

/// What a calibration is written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Language {
    Toml,
    Json,
    Yaml,
    Xml,
    /// ROS's `ost.txt`.
    Ost,
    /// A matrix or several, as text.
    Matrices,
    /// NumPy's arrays.
    Arrays,
    /// COLMAP's `cameras.txt`.
    Colmap,
}

impl Language {
    /// By a file's extension, and where that says nothing by its text.
    fn of(extension: &str, text: &str) -> Option<Self> {
        let begins = |start: &str| text.trim_start().starts_with(start);
        match extension {
            "toml" => return Some(Self::Toml),
            "json" => return Some(Self::Json),
            "yaml" | "yml" => return Some(Self::Yaml),
            "xml" => return Some(Self::Xml),
            _ => {}
        }
        if begins("{") {
            Some(Self::Json)
        } else if begins("<") {
            Some(Self::Xml)
        } else if ost::is_ost(text) {
            Some(Self::Ost)
        } else if numpy::tree_of_text(text).is_some() {
            Some(Self::Matrices)
        } else if extension == "txt" && !begins("%YAML") {
            Some(Self::Colmap)
        } else {
            tree::of_yaml(text).is_ok().then_some(Self::Yaml)
        }
    }
}

fn read(path: &Path, frame_px: Option<[u32; 2]>) -> Result<UncheckedCalibration, CalibrationError> {
    let bytes = plain_file::read(path, MOST_TEXT).map_err(|error| CalibrationError::Io {
        path: path.to_owned(),
        error,
    })?;
    let syntax = |message| CalibrationError::Syntax {
        path: path.to_owned(),
        message,
    };
    let value = |message| CalibrationError::Value {
        path: path.to_owned(),
        message,
    };
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default()
        .to_ascii_lowercase();
    let is_numpy = numpy::is_numpy(&extension, &bytes);
    // (An archive is what an array's file is.)
    if let Some(what) = in_place_of(&bytes).filter(|_| !is_numpy) {
        return Err(syntax(format!("{what}; a calibration is expected")));
    }
    if bytes.starts_with(b"\x80") {
        let message = "a pickle of Python's, which is a program and is not run: write its matrices by numpy.savez";
        return Err(syntax(message.to_owned()));
    }
    // Windows' editors begin a file with a byte order mark, and some still write no UTF-8.
    let text = decoded(&bytes);
    let language = match text.contains('\0') {
        _ if is_numpy => Some(Language::Arrays),
        true => None,
        false => Language::of(&extension, &text),
    };
    let tree = match language {
        Some(Language::Toml) => tree::of_toml(&text),
        Some(Language::Json) => tree::of_json(&text),
        Some(Language::Yaml) => tree::of_yaml(&text),
        Some(Language::Xml) => tree::of_xml(&text),
        Some(Language::Ost) => ost::tree(&text),
        Some(Language::Matrices) => {
            numpy::tree_of_text(&text).ok_or_else(|| "no matrix of 3 x 3 numbers".to_owned())
        }
        Some(Language::Arrays) => numpy::tree(&bytes),
        Some(Language::Colmap) => {
            let cameras = colmap::cameras(&text).map_err(value)?;
            return only_camera(cameras, frame_px).map_err(value);
        }
        None => Err(
            "a calibration is a .toml, .json, .yaml, .yml, .xml or .npz file, ROS's ost.txt or COLMAP's cameras.txt"
                .to_owned(),
        ),
    };
    let tree = tree.map_err(syntax)?;
    let cameras = kinds::cameras(&tree).map_err(value)?;
    only_camera(cameras, frame_px).map_err(value)
}

/// The camera that is meant: the only one there is, or the only one with the frames' size.
fn only_camera(
    mut cameras: Vec<(String, UncheckedCalibration)>,
    frame_px: Option<[u32; 2]>,
) -> Result<UncheckedCalibration, String> {
    let names: Vec<String> = cameras.iter().map(|(name, _)| name.clone()).collect();
    if let Some(frame_px) = frame_px
        && cameras.len() > 1
    {
        cameras.retain(|(_, camera)| camera.size_px.is_none_or(|size_px| size_px == frame_px));
    }
    let is_one = cameras.windows(2).all(|pair| pair[0].1 == pair[1].1);
    match cameras.pop() {
        Some((_, camera)) if is_one => Ok(camera),
        _ if names.is_empty() => Err("there is no camera in it".to_owned()),
        _ => Err(format!(
            "it holds {} cameras ({}), and their sizes do not tell which is meant; keep that one alone",
            names.len(),
            names.join(", ")
        )),
    }
}

#[cfg(test)]
mod numpy_tests;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_lens;
#[cfg(test)]
mod tests_units;
