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

const MODEL_KEYS: [&str; 8] = [
    "distortionmodel",
    "distortiontype",
    "cameramodel",
    "lensmodel",
    "lenstype",
    "projectionmodel",
    "projectiontype",
    "model",
];
const FISHEYE_KEYS: [&str; 3] = ["fisheyemodel", "fisheye", "isfisheye"];
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

/// The lens model by all keys that decide it. What is not known is refused, never passed over.
pub(super) fn model_of<'a>(
    entries: impl IntoIterator<Item = (&'a str, &'a Value)>,
) -> Result<LensModel, String> {
    let mut found = LensModel::ByNumber;
    for (key, value) in entries {
        let name = normalised(key.rsplit('.').next().unwrap_or_default());
        let model = if FISHEYE_KEYS.contains(&name.as_str()) {
            match value {
                Value::Null => LensModel::ByNumber,
                value if value.as_bool() == Some(true) || value.as_f64() == Some(1.0) => {
                    LensModel::Fisheye
                }
                value if value.as_bool() == Some(false) || value.as_f64() == Some(0.0) => {
                    LensModel::ByNumber
                }
                other => return Err(format!("{key} must be 0 or 1, not {other}")),
            }
        } else if MODEL_KEYS.contains(&name.as_str()) {
            model_by_name(key, value)?
        } else if name == "xi" && value.as_f64() != Some(0.0) {
            return Err(format!(
                "{key} belongs to the omnidirectional model, which is not supported"
            ));
        } else {
            continue;
        };
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

fn model_by_name(key: &str, value: &Value) -> Result<LensModel, String> {
    let name = match value {
        Value::Null => "",
        Value::String(name) => name,
        other => return Err(format!("{key} must be a name, not {other}")),
    };
    let word = normalised(name);
    // (PhotonVision and mrcal write LENSMODEL_OPENCV8.)
    match word.strip_prefix("lensmodel").unwrap_or(&word) {
        "" | "pinhole" | "perspective" | "rationalpolynomial" | "rational" | "thinprism"
        | "tilted" | "opencv" | "opencv4" | "opencv5" | "opencv8" | "opencv12" | "fullopencv"
        | "simplepinhole" => Ok(LensModel::ByNumber),
        "plumbbob" | "radtan" | "radialtangential" | "brownconrady" | "brown" | "none" => {
            Ok(LensModel::Brown)
        }
        "equidistant" | "equi" | "fisheye" | "kannalabrandt" | "kannalabrandt4"
        | "kannalabrandt8" | "opencvfisheye" => Ok(LensModel::Fisheye),
        _ => Err(format!(
            "{key}: the model '{name}' is not supported; plumb_bob (radtan), rational_polynomial and equidistant \
             (fisheye) are"
        )),
    }
}

pub(super) fn normalised(key: &str) -> String {
    let kept = key
        .chars()
        .filter(|letter| !matches!(letter, '_' | '-' | ' '));
    kept.flat_map(char::to_lowercase).collect()
}

pub(super) fn side_px(value: &Value) -> Option<u32> {
    let side = number(value)?;
    (side.fract() == 0.0 && (1.0..=f64::from(MOST_SIDE_PX)).contains(&side)).then_some(side as u32)
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
