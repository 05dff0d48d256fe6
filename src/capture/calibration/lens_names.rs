//! What the entries and tables of a lens are called in other programs' files: the one list of the names of coefficients.

use serde_json::{Map, Value};

use super::values::{normalised, number};

/// Names of all coefficients, as keys are compared.
pub(super) const LISTS: [&str; 27] = [
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
/// Letters in the order in which OpenCV has its coefficients.
pub(super) const LETTERS: [&str; 14] = [
    "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tauX", "tauY",
];
/// Tables that have a lens's entries among others.
const LENS_TABLES: [&str; 3] = ["lens", "lensparameters", "mirrorparameters"];
/// Names of all coefficients within a table such as `distortion`, and of the model.
const LISTS_WITHIN: [&str; 4] = ["parameters", "params", "values", "vector"];
const MODELS_WITHIN: [&str; 2] = ["type", "model"];
/// Whether a table of this name (as keys are compared) holds a lens's coefficients or model.
pub(super) fn is_of_lens(name: &str) -> bool {
    LISTS.contains(&name) || LENS_TABLES.contains(&name)
}

/// What the name of an entry of a lens's table means: `parameters` of `distortion` are coefficients, and its `type` is the model.
pub(super) fn name_in_lens(table_name: &str, table: &Map<String, Value>, name: String) -> String {
    let has_coefficients = || {
        let mut entries = table.iter();
        entries.any(|(key, value)| is_coefficients(&normalised(key), value))
    };
    let is_distortion = LISTS.contains(&table_name);
    match name.as_str() {
        within if is_distortion && LISTS_WITHIN.contains(&within) => {
            "distortionparameters".to_owned()
        }
        within if MODELS_WITHIN.contains(&within) && (is_distortion || has_coefficients()) => {
            "distortionmodel".to_owned()
        }
        // (What a maker calls a lens.)
        "model" => "product model".to_owned(),
        _ => name,
    }
}

/// Whether something of this name (as keys are compared) is a lens's coefficients, or a table of them.
pub(super) fn is_coefficients(name: &str, value: &Value) -> bool {
    let is_letter = LETTERS
        .iter()
        .any(|letter| letter.eq_ignore_ascii_case(name));
    let is_list = LISTS.contains(&name)
        || ["radial", "tangential"]
            .iter()
            .any(|start| name.starts_with(start));
    match value {
        Value::Object(_) => is_of_lens(name),
        Value::Number(_) => is_letter,
        Value::String(text) => (is_letter || is_list) && numbers_of_text(text).is_some(),
        Value::Array(_) => is_list,
        _ => false,
    }
}

/// The numbers of a text that is a list of them, in whatever brackets.
pub(super) fn numbers_of_text(text: &str) -> Option<Vec<f64>> {
    let words = text.split(|c: char| c.is_whitespace() || ",;[]()".contains(c));
    let words = words.filter(|word| !word.is_empty());
    let numbers: Option<Vec<f64>> = words.map(|word| number(&Value::from(word))).collect();
    numbers.filter(|numbers| !numbers.is_empty())
}
