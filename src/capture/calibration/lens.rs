//! The lens that a camera's entries describe, however they name it (`lens_names.rs`).

use serde_json::{Map, Value};

use super::entries::{Entry, entry, is_matrix};
use super::lens_names::{LETTERS, LISTS, is_coefficients, numbers_of_text};
use super::values::{
    Lens, LensModel, distortion, flat_numbers, is_model_key, model_by_key, model_of, names_a_lens,
    normalised, number,
};

const ALLOWED: &str = "distortion_coefficients, distortion_parameters, distortion, dist_coeffs, dist, D, coeffs, k1 and p1, \
                       radial_distortion and tangential_distortion";
/// PhotonVision's older files have the lens here; others the camera's pose, of more rows.
const PHOTONVISION: &str = "cameraextrinsics";
const FISHEYE_LETTERS: [&str; 4] = ["k1", "k2", "k3", "k4"];
const RADIAL: [&str; 3] = ["k1", "k2", "k3"];
const TANGENTIAL: [&str; 2] = ["p1", "p2"];
/// What the names of coefficients have in them, in whatever words and with whatever slips.
const SIGNS: [&str; 4] = ["dist", "radial", "tangential", "coef"];

/// The lens of a camera's entries.
///
/// # Errors
/// Coefficients that nobody can read, and names that look like coefficients' and are not known: they are never passed over.
pub(super) fn lens_of(entries: &[Entry<'_>]) -> Result<Lens, String> {
    let models = entries
        .iter()
        .map(|entry| (entry.key, entry.name.as_str(), entry.value));
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
        refuse_foreign(entries)?;
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
    let Some(found) = found else {
        return Ok(None);
    };
    let numbers = list(found)?;
    // (A table's `d` may be a distance.)
    let others = entries.iter().filter(|other| {
        LISTS.contains(&other.name.as_str()) && (other.value.is_array() || is_matrix(other.value))
    });
    for other in others {
        if list(other).is_ok_and(|others| !is_same(&numbers, &others)) {
            return Err(contradiction(found.key, other.key));
        }
    }
    Ok(Some(numbers))
}

/// Whether two lists are the same but for zeros at the end.
fn is_same(a: &[f64], b: &[f64]) -> bool {
    let at = |list: &[f64], k: usize| list.get(k).copied().unwrap_or(0.0);
    (0..a.len().max(b.len())).all(|k| at(a, k) == at(b, k))
}

/// What to say of two entries for one thing.
pub(super) fn contradiction(one: &str, other: &str) -> String {
    if one == other {
        return format!("{one} is there twice, with different values; keep the one that is meant");
    }
    format!("{one} and {other} contradict each other; keep the one that is meant")
}

/// The numbers of an entry that is a list, a matrix, or a text of numbers.
fn list(entry: &Entry<'_>) -> Result<Vec<f64>, String> {
    let numbers = match entry.value {
        Value::String(text) => numbers_of_text(text),
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
    let known = letters_of(entries, model)?;
    let has = |letter: &str| known.iter().any(|(known, _)| *known == letter);
    if model == LensModel::ByNumber && has("k4") && !["p1", "p2", "k5", "k6"].into_iter().any(has) {
        return Err(
            "k1, k2, k3 and k4 without p1 and p2 are a fisheye's as a rule, and no model is named; add model = \"fisheye\", or \
             p1 and p2 (0 where there are none)"
                .to_owned(),
        );
    }
    let order: &[&str] = match model {
        LensModel::Fisheye => &FISHEYE_LETTERS,
        _ => &LETTERS,
    };
    let mut beyond = known.iter().filter(|(letter, _)| !order.contains(letter));
    if let Some((letter, value)) = beyond.find(|(_, value)| *value != 0.0) {
        return Err(format!(
            "a fisheye has 4 coefficients k1, k2, k3, k4; there is a {letter} of {value} too"
        ));
    }
    let of = |letter: &&str| known.iter().find(|(known, _)| known == letter);
    let given = order
        .iter()
        .map(|letter| of(letter).map_or(0.0, |(_, value)| *value));
    Ok((!known.is_empty()).then(|| given.collect()))
}

/// The coefficients that are named one by one, each with its letter.
fn letters_of(entries: &[Entry<'_>], model: LensModel) -> Result<Vec<(&'static str, f64)>, String> {
    let radial: &[&str] = match model {
        LensModel::Fisheye => &FISHEYE_LETTERS,
        _ => &RADIAL,
    };
    let mut known: Vec<(&str, f64)> = Vec::new();
    for entry in entries.iter().filter(|entry| !entry.value.is_null()) {
        let mut found: Vec<(&str, f64)> = Vec::new();
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
            found.extend(letters.iter().copied().zip(numbers));
        }
        let is_letter = |letter: &&&str| letter.eq_ignore_ascii_case(&entry.name);
        if let Some(letter) = LETTERS.iter().find(is_letter) {
            let value = number(entry.value);
            found.push((
                letter,
                value.ok_or_else(|| format!("{letter} must be a finite number"))?,
            ));
        }
        for (letter, value) in found {
            match known.iter().find(|(known, _)| *known == letter) {
                Some((_, before)) if *before != value => {
                    return Err(contradiction(letter, entry.key));
                }
                Some(_) => {}
                None => known.push((letter, value)),
            }
        }
    }
    Ok(known)
}

/// Refuses a camera without coefficients that has other models' numbers.
fn refuse_foreign(entries: &[Entry<'_>]) -> Result<(), String> {
    for entry in entries {
        let value = number(entry.value).filter(|value| *value != 0.0);
        let model = match (entry.name.as_str(), value) {
            ("alpha" | "beta", Some(_)) => "the extended unified (EUCM) or the double sphere model",
            // (Else it is the picture's width.)
            ("w", Some(value)) if value.fract() != 0.0 => "the FOV model",
            _ => continue,
        };
        return Err(format!(
            "{} belongs to {model}, which is not supported; plumb_bob (radtan), rational_polynomial and equidistant (fisheye) are",
            entry.key
        ));
    }
    Ok(())
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
        let is_list = entry.value.is_array() || is_matrix(entry.value);
        if is_sign(&entry.name, entry.value) || entry.is_in_lens && is_list {
            return Err(match entry.value.is_null() {
                true => format!("{} is empty", entry.key),
                false => not_understood(entry.key),
            });
        }
    }
    Ok(())
}

/// Whether a name is one of coefficients, in whatever words.
fn is_sign(name: &str, value: &Value) -> bool {
    let is_sign = SIGNS.iter().any(|sign| name.contains(sign));
    is_sign && !name.contains("distance") && !value.is_boolean()
}

fn not_understood(key: &str) -> String {
    format!("{key} is not understood; allowed: {ALLOWED}")
}

/// Refuses a file none of whose cameras has coefficients where something in it speaks of some, wherever it stands, or of a fisheye
/// where none `is_fisheye`.
pub(super) fn refuse_signs(tree: &Map<String, Value>, is_fisheye: bool) -> Result<(), String> {
    for (key, value) in tree {
        let name = normalised(key.rsplit('.').next().unwrap_or_default());
        let names_fisheye = || {
            let model = model_by_key(key, &name, value);
            !is_fisheye && matches!(model, Ok(Some(LensModel::Fisheye)))
        };
        let is_some = match value {
            Value::Array(_) => {
                flat_numbers(value).is_some_and(|all| all.iter().any(|it| *it != 0.0))
            }
            Value::Number(_) => number(value) != Some(0.0),
            Value::String(text) => numbers_of_text(text).is_some(),
            value => is_matrix(value),
        };
        let is_list = !value.is_number() && is_sign(&name, value);
        if is_some && (is_list || is_coefficients(&name, value) || name == "xi") || names_fisheye()
        {
            return Err(format!(
                "{key} speaks of a lens, and does not stand beside the camera's numbers; put it there: {ALLOWED}"
            ));
        }
        match value {
            Value::Object(inner) => refuse_signs(inner, is_fisheye)?,
            Value::Array(list) => {
                let mut tables = list.iter().filter_map(Value::as_object);
                tables.try_for_each(|inner| refuse_signs(inner, is_fisheye))?;
            }
            _ => {}
        }
    }
    Ok(())
}

/// Pixels of a camera here have two sides at right angles.
pub(super) fn refuse_skew(entries: &[Entry<'_>]) -> Result<(), String> {
    let mut skews = entries.iter().filter(|entry| entry.name == "skew");
    match skews.find(|entry| number(entry.value).is_some_and(|skew| skew != 0.0)) {
        Some(skew) => Err(format!(
            "{} must be 0, not {}: pixels that lean are not supported",
            skew.key, skew.value
        )),
        None => Ok(()),
    }
}
