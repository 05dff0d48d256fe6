//! What the numbers and names of calibration files mean, whatever keys they stand behind.

use serde_json::Value;

use crate::geometry::camera::{Distortion, MOST_SIDE_PX};

/// What a file says, before it is known to make sense.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct UncheckedCalibration {
    pub size_px: Option<[u32; 2]>,
    pub focal_px: [f64; 2],
    pub center_px: [f64; 2],
    pub lens: Lens,
}

/// A lens, and whether the file says how it distorts; where it does not, it is taken not to.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lens {
    pub distortion: Distortion,
    pub is_said: bool,
}

/// Where those who count from the picture's corner have the first pixel's centre.
pub(super) const CORNER_PX: f64 = 0.5;

/// Which formula a file's coefficients belong to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LensModel {
    /// Told by the number of the coefficients, as OpenCV does.
    ByNumber,
    /// Five at most.
    Brown,
    /// Four.
    Fisheye,
}

/// Keys whose value is the name of a model, and nothing else.
const MODEL_KEYS: [&str; 13] = [
    "distortionmodel",
    "distortiontype",
    "distmodel",
    "cameramodel",
    "cammodel",
    "calibrationmodel",
    "calibmodel",
    "lensmodel",
    "lenstype",
    "projectionmodel",
    "projectiontype",
    "modeltype",
    "model",
];
/// What other keys end in whose value may name a model: `type: fisheye`, but also `type: usb`.
const MODEL_ENDINGS: [&str; 4] = ["model", "type", "projection", "lens"];
const FISHEYE_KEYS: [&str; 4] = ["fisheyemodel", "fisheye", "isfisheye", "usefisheye"];
/// Models that nobody here computes, by what their names have in them. (OmniVision makes sensors.)
const FOREIGN_PARTS: [&str; 14] = [
    "fisheye",
    "kannala",
    "equidist",
    "omnidir",
    "eucm",
    "doublesphere",
    "unified",
    "ftheta",
    "stereographic",
    "equisolid",
    "equirect",
    "spherical",
    "panoram",
    "scaramuzza",
];
const FOREIGN_NAMES: [&str; 6] = ["omni", "ds", "mei", "ucm", "fov", "ocam"];
/// Numbers that OpenCV's coefficients come in.
const COUNTS: [usize; 5] = [4, 5, 8, 12, 14];

/// Whether a key (as keys are compared) decides which formula coefficients belong to.
pub(super) fn is_model_key(name: &str) -> bool {
    MODEL_KEYS.contains(&name) || FISHEYE_KEYS.contains(&name)
}

/// Whether a key of the lens's model has a value that wants coefficients.
pub(super) fn names_a_lens(model: &Value) -> bool {
    let name = model.as_str().map(normalised).unwrap_or_default();
    !matches!(
        name.as_str(),
        "" | "none" | "pinhole" | "perspective" | "simplepinhole"
    )
}

/// The lens model by all entries (key, name as keys are compared, value) that decide it. What is not known is refused, never
/// passed over.
pub(super) fn model_of<'a>(
    entries: impl IntoIterator<Item = (&'a str, &'a str, &'a Value)>,
) -> Result<LensModel, String> {
    let mut found = LensModel::ByNumber;
    for (key, name, value) in entries {
        let model = model_by_key(key, name, value)?.unwrap_or(LensModel::ByNumber);
        match (found, model) {
            (_, LensModel::ByNumber) => {}
            (LensModel::ByNumber, _) => found = model,
            (before, now) if before != now => {
                return Err(format!(
                    "{key} contradicts the other keys of the lens's model"
                ));
            }
            _ => {}
        }
    }
    Ok(found)
}

/// What one entry says of the lens's model; `None`: nothing.
pub(super) fn model_by_key(
    key: &str,
    name: &str,
    value: &Value,
) -> Result<Option<LensModel>, String> {
    let omnidirectional = || {
        Err(format!(
            "{key} belongs to the omnidirectional model, which is not supported"
        ))
    };
    match value {
        Value::Null => Ok(None),
        _ if name == "mirrorparameters" => omnidirectional(),
        _ if name == "xi" => match value.as_f64() {
            Some(0.0) => Ok(None),
            _ => omnidirectional(),
        },
        _ if name.contains("fisheye") => match value.as_bool().or_else(|| truth(value)) {
            Some(true) => Ok(Some(LensModel::Fisheye)),
            Some(false) => Ok(Some(LensModel::ByNumber)),
            None if FISHEYE_KEYS.contains(&name) => {
                Err(format!("{key} must be 0 or 1, not {value}"))
            }
            None => Ok(None),
        },
        _ if MODEL_KEYS.contains(&name) => model_by_name(key, value).map(Some),
        // DepthAI's CameraModel.
        Value::Number(number) if name == "cameratype" => match number.as_f64() {
            Some(0.0) => Ok(Some(LensModel::ByNumber)),
            Some(1.0) => Ok(Some(LensModel::Fisheye)),
            _ => Err(format!(
                "{key} must be 0 (perspective) or 1 (fisheye), not {number}"
            )),
        },
        Value::String(word) if MODEL_ENDINGS.iter().any(|ending| name.ends_with(ending)) => {
            model_by_word(key, word)
        }
        _ => Ok(None),
    }
}

fn truth(value: &Value) -> Option<bool> {
    match value.as_f64()? {
        0.0 => Some(false),
        1.0 => Some(true),
        _ => None,
    }
}

/// The model that a word names which may be about something else.
fn model_by_word(key: &str, word: &str) -> Result<Option<LensModel>, String> {
    let name = normalised(word);
    let is_foreign = FOREIGN_NAMES.contains(&name.as_str())
        || FOREIGN_PARTS.iter().any(|part| name.contains(part));
    match known_model(&name) {
        None if is_foreign => Err(unsupported_model(key, word)),
        _ if matches!(name.as_str(), "" | "none") => Ok(None),
        known => Ok(known),
    }
}

fn model_by_name(key: &str, value: &Value) -> Result<LensModel, String> {
    let Value::String(name) = value else {
        return Err(format!("{key} must be a name, not {value}"));
    };
    known_model(&normalised(name)).ok_or_else(|| unsupported_model(key, name))
}

fn unsupported_model(key: &str, name: &str) -> String {
    format!(
        "{key}: the model '{name}' is not supported; plumb_bob (radtan), rational_polynomial and equidistant \
         (fisheye) are"
    )
}

/// The model of a name, as keys are compared.
fn known_model(name: &str) -> Option<LensModel> {
    // (PhotonVision and mrcal write LENSMODEL_OPENCV8.)
    match name.strip_prefix("lensmodel").unwrap_or(name) {
        "" | "pinhole" | "perspective" | "rationalpolynomial" | "rational" | "thinprism"
        | "tilted" | "opencv" | "opencv4" | "opencv5" | "opencv8" | "opencv12" | "fullopencv"
        | "simplepinhole" | "pinholeradtan8" => Some(LensModel::ByNumber),
        "plumbbob" | "radtan" | "radialtangential" | "brownconrady" | "brown" | "none" => {
            Some(LensModel::Brown)
        }
        "equidistant" | "equi" | "fisheye" | "kannalabrandt" | "kannalabrandt4"
        | "kannalabrandt8" | "kb4" | "opencvfisheye" => Some(LensModel::Fisheye),
        _ => None,
    }
}

pub(super) fn normalised(key: &str) -> String {
    let kept = key
        .chars()
        .filter(|letter| !matches!(letter, '_' | '-' | ' '));
    kept.flat_map(char::to_lowercase).collect()
}

pub(super) fn bad_side(what: &str) -> String {
    format!("{what} must be whole numbers of pixels from 1 to {MOST_SIDE_PX}")
}

/// A finite number, in quotes too.
pub(super) fn number(value: &Value) -> Option<f64> {
    let written = || value.as_str()?.trim().parse().ok();
    value
        .as_f64()
        .or_else(written)
        .filter(|number| number.is_finite())
}

/// The numbers of a list, or of a list of rows.
pub(super) fn flat_numbers(value: &Value) -> Option<Vec<f64>> {
    let mut found = Vec::new();
    for entry in value.as_array()? {
        match entry {
            Value::Array(row) => {
                found.extend(row.iter().map(number).collect::<Option<Vec<f64>>>()?)
            }
            one => found.push(number(one)?),
        }
    }
    Some(found)
}

/// The distortion of a model by its coefficients; none are 0.
///
/// # Errors
/// A number of them that the model does not have.
pub(super) fn distortion(model: LensModel, given: &[f64]) -> Result<Distortion, String> {
    let past = |most: usize| given.iter().skip(most).find(|number| **number != 0.0);
    let is_some = past(0).is_some();
    match model {
        LensModel::Fisheye => {
            if let Some(extra) = past(4) {
                return Err(format!(
                    "a fisheye has 4 coefficients k1, k2, k3, k4; {extra} is among those after them"
                ));
            }
            if is_some && given.len() < 4 {
                return Err(format!(
                    "a fisheye has 4 coefficients k1, k2, k3, k4, not {}",
                    given.len()
                ));
            }
            let mut four = [0.0; 4];
            four.iter_mut()
                .zip(given)
                .for_each(|(to, from)| *to = *from);
            Ok(Distortion::Fisheye(four))
        }
        LensModel::Brown if past(5).is_some() => Err(format!(
            "plumb_bob has 5 coefficients k1, k2, p1, p2, k3, not {}; name the model rational_polynomial",
            given.len()
        )),
        LensModel::Brown | LensModel::ByNumber => by_number(given),
    }
}

/// OpenCV's order; coefficients that are left out at the end are 0.
pub(super) fn by_number(given: &[f64]) -> Result<Distortion, String> {
    if given.iter().any(|number| *number != 0.0) && !COUNTS.contains(&given.len()) {
        return Err(format!(
            "the distortion has {} coefficients; 4, 5, 8, 12 or 14 are supported",
            given.len()
        ));
    }
    let mut all = [0.0; 14];
    all.iter_mut().zip(given).for_each(|(to, from)| *to = *from);
    let [k1, k2, p1, p2, k3, rest @ ..] = all;
    Ok(if rest == [0.0; 9] {
        Distortion::Polynomial([k1, k2, p1, p2, k3])
    } else {
        Distortion::Rational(all)
    })
}
