//! The lens that a camera's entries describe, however they name it: the one list of the names of coefficients.

use serde_json::Value;

use super::entries::{Entry, entry, is_matrix};
use super::values::{
    Lens, LensModel, distortion, flat_numbers, is_model_key, model_of, names_a_lens, number,
};

/// Names of all coefficients, as keys are compared.
const LISTS: [&str; 27] = [
    "distortioncoefficients",
    "distortioncoefficient",
    "distortioncoeffs",
    "distortioncoeff",
    "distortioncoefs",
    "distortioncoef",
    "distcoefficients",
    "distcoeffs",
    "distcoeff",
    "distcoefs",
    "distcoef",
    "distortionparameters",
    "distortionparams",
    "distparameters",
    "distparams",
    "distortionvector",
    "distortionvec",
    "distvector",
    "distvec",
    "distortions",
    "distortion",
    "lensdistortion",
    "dist",
    "d",
    "coeffs",
    "coefficients",
    "coefs",
];
const ALLOWED: &str = "distortion_coefficients, distortion_parameters, distortion, dist_coeffs, dist, D, coeffs, k1 and p1, \
                       radial_distortion and tangential_distortion";
/// PhotonVision's older files have the lens here; others the camera's pose, of more rows.
const PHOTONVISION: &str = "cameraextrinsics";
/// Letters in the order in which OpenCV has its coefficients.
pub(super) const LETTERS: [&str; 14] = [
    "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY",
];
const FISHEYE_LETTERS: [&str; 4] = ["k1", "k2", "k3", "k4"];
const RADIAL: [&str; 3] = ["k1", "k2", "k3"];
const TANGENTIAL: [&str; 2] = ["p1", "p2"];
/// What the names of coefficients have in them, in whatever words and with whatever slips.
const SIGNS: [&str; 4] = ["dist", "radial", "tangential", "coef"];

/// Whether a table of this name (as keys are compared) holds a lens's coefficients.
pub(super) fn is_of_lens(name: &str) -> bool {
    LISTS.contains(&name)
}

/// The lens of a camera's entries.
///
/// # Errors
/// Coefficients that nobody can read, and names that look like coefficients' and are not known: they are never passed over.
pub(super) fn lens_of(entries: &[Entry<'_>]) -> Result<Lens, String> {
    let models = entries.iter().map(|entry| (entry.key, entry.value));
    lens_by(entries, model_of(models)?)
}

/// The same where the model is known already.
pub(super) fn lens_by(entries: &[Entry<'_>], model: LensModel) -> Result<Lens, String> {
    let given = match listed(entries)? {
        Some(given) => Some(given),
        None => by_letters(entries, model)?,
    };
    let is_said = given.is_some();
    if !is_said {
        refuse_unread(entries)?;
    }
    Ok(Lens {
        distortion: distortion(model, &given.unwrap_or_default())?,
        is_said,
    })
}

/// Coefficients that stand together.
fn listed(entries: &[Entry<'_>]) -> Result<Option<Vec<f64>>, String> {
    let is_one = |value: &Value, side: &str| value.get(side).and_then(number) == Some(1.0);
    let is_row = |value: &Value| is_one(value, "rows") || is_one(value, "cols");
    let found = entry(entries, &LISTS)
        .or_else(|| entry(entries, &[PHOTONVISION]).filter(|entry| is_row(entry.value)))
        .filter(|entry| !entry.value.is_null());
    found.map(|entry| list(entry)).transpose()
}

/// The numbers of an entry that is a list, a matrix, or a text of numbers.
fn list(entry: &Entry<'_>) -> Result<Vec<f64>, String> {
    let numbers = match entry.value {
        Value::String(text) => {
            let words = text.split(|c: char| c.is_whitespace() || ",;[]()".contains(c));
            let words = words.filter(|word| !word.is_empty());
            let numbers: Option<Vec<f64>> = words.map(|word| number(&Value::from(word))).collect();
            numbers.filter(|numbers| !numbers.is_empty())
        }
        value => matrix_numbers(entry.key, value)?,
    };
    numbers.ok_or_else(|| {
        format!(
            "{} must be a list of finite numbers k1, k2, p1, p2, k3",
            entry.key
        )
    })
}

/// The numbers of a list or of a matrix `{rows, cols, data}`; `None` where it has others than finite ones.
///
/// # Errors
/// A matrix with more or fewer numbers than its rows and columns say.
pub(super) fn matrix_numbers(key: &str, value: &Value) -> Result<Option<Vec<f64>>, String> {
    if !is_matrix(value) {
        return Ok(flat_numbers(value));
    }
    let Some(numbers) = flat_numbers(&value["data"]) else {
        return Ok(None);
    };
    // OpenCV's `dt` begins with how many numbers an entry has, where that is not one.
    let channels = value.get("dt").and_then(Value::as_str).and_then(|kind| {
        let digits = kind.trim_end_matches(|c: char| !c.is_ascii_digit());
        digits.parse::<f64>().ok()
    });
    let sides = value
        .get("rows")
        .and_then(number)
        .zip(value.get("cols").and_then(number));
    match sides {
        Some((rows, columns))
            if rows * columns * channels.unwrap_or(1.0) != numbers.len() as f64 =>
        {
            Err(format!(
                "{key} must have the {rows} x {columns} numbers that it says it has, not {}",
                numbers.len()
            ))
        }
        _ => Ok(Some(numbers)),
    }
}

/// Coefficients that have a key each, or stand in a list of radial and one of tangential ones; `None` where there are none.
fn by_letters(entries: &[Entry<'_>], model: LensModel) -> Result<Option<Vec<f64>>, String> {
    let radial: &[&str] = match model {
        LensModel::Fisheye => &FISHEYE_LETTERS,
        _ => &RADIAL,
    };
    let mut known: Vec<(&str, f64)> = Vec::new();
    for entry in entries.iter().filter(|entry| !entry.value.is_null()) {
        for (start, letters) in [("radial", radial), ("tangential", &TANGENTIAL)] {
            if !entry.name.starts_with(start) || entry.value.is_boolean() {
                continue;
            }
            let numbers = list(entry)?;
            if numbers.len() > letters.len() {
                return Err(format!(
                    "{} must have at most {} numbers, not {}",
                    entry.key,
                    letters.len(),
                    numbers.len()
                ));
            }
            known.extend(letters.iter().copied().zip(numbers));
        }
        let is_letter = |letter: &&&str| letter.eq_ignore_ascii_case(&entry.name);
        if let Some(letter) = LETTERS.iter().find(is_letter) {
            let value = number(entry.value);
            known.push((
                letter,
                value.ok_or_else(|| format!("{letter} must be a finite number"))?,
            ));
        }
    }
    let order: &[&str] = match model {
        LensModel::Fisheye => &FISHEYE_LETTERS,
        _ => &LETTERS,
    };
    let of = |letter: &&str| known.iter().find(|(known, _)| known == letter);
    let given = order
        .iter()
        .map(|letter| of(letter).map_or(0.0, |(_, value)| *value));
    Ok((!known.is_empty()).then(|| given.collect()))
}

/// Refuses a camera without coefficients beside whose numbers something speaks of some.
fn refuse_unread(entries: &[Entry<'_>]) -> Result<(), String> {
    for entry in entries {
        if is_model_key(&entry.name) {
            // (`camera_model: OPENCV` may go without.)
            if entry.name.starts_with("distortion") && names_a_lens(entry.value) {
                let key = entry.key;
                return Err(format!(
                    "{key} names a lens whose coefficients are missing; allowed: {ALLOWED}"
                ));
            }
            continue;
        }
        let is_sign = SIGNS.iter().any(|sign| entry.name.contains(sign));
        if is_sign && !entry.name.contains("distance") && !entry.value.is_boolean() {
            return Err(match entry.value.is_null() {
                true => format!("{} is empty", entry.key),
                false => format!("{} is not understood; allowed: {ALLOWED}", entry.key),
            });
        }
    }
    Ok(())
}
