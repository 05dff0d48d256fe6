//! Calibrations that name each number by its letter, `fx`, `fy`, `cx`, `cy`, `k1`, …, flat or in tables: RealSense's,
//! ORB-SLAM's (`Camera.fx`), VINS's (`projection_parameters`), NeRF's `transforms.json` (`fl_x`), and what people write themselves.

use serde_json::{Map, Value};

use super::values::{
    LensModel, UncheckedCalibration, distortion, flat_numbers, model_of, normalised, number,
    side_px,
};

/// Letters in the order in which OpenCV has its coefficients.
const COEFFICIENTS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
const FOCAL: [[&str; 3]; 2] = [["fx", "flx", "focalx"], ["fy", "fly", "focaly"]];
const CENTER: [[&str; 3]; 2] = [["cx", "ppx", "principalx"], ["cy", "ppy", "principaly"]];
const SIDES: [[&str; 4]; 2] = [
    ["width", "imagewidth", "w", "cols"],
    ["height", "imageheight", "h", "rows"],
];
const LISTS: [&str; 2] = ["coeffs", "coefficients"];
/// Tables in one another that are looked into.
const MOST_LEVELS: u32 = 3;

/// The camera that a tree's letters describe; `None` where it has none of them.
pub(super) fn camera(tree: &Map<String, Value>) -> Option<Result<UncheckedCalibration, String>> {
    let [flat, letters] = [0, MOST_LEVELS].map(|levels| {
        let mut letters = Vec::new();
        gather(tree, levels, &mut letters);
        letters
    });
    let count = |letters: &Letters<'_>| {
        let is_focal = |(name, _): &&(String, &Value)| FOCAL[0].contains(&name.as_str());
        letters.iter().filter(is_focal).count()
    };
    if count(&flat) > 1 {
        let message = "it has several fx; keep the camera that is meant alone";
        return Some(Err(message.to_owned()));
    }
    // Tables of a camera each are looked at one by one.
    (has_all(&letters) && count(&letters) == 1).then(|| of_letters(tree, &letters))
}

type Letters<'a> = Vec<(String, &'a Value)>;

/// The values of a tree and of the tables in it, by the last part of their keys (`Camera.fx`).
fn gather<'a>(tree: &'a Map<String, Value>, levels: u32, letters: &mut Letters<'a>) {
    for (key, value) in tree {
        let last = key.rsplit('.').next().unwrap_or_default();
        match value {
            Value::Object(inner) if levels > 0 => gather(inner, levels - 1, letters),
            _ => letters.push((normalised(last), value)),
        }
    }
}

fn find<'a>(letters: &Letters<'a>, names: &[&str]) -> Option<&'a Value> {
    let of = |name: &&str| letters.iter().find(|(known, _)| known == name);
    names.iter().find_map(of).map(|(_, value)| *value)
}

fn has_all(letters: &Letters<'_>) -> bool {
    let all = FOCAL.iter().chain(&CENTER);
    all.into_iter().all(|names| find(letters, names).is_some())
}

fn of_letters(
    tree: &Map<String, Value>,
    letters: &Letters<'_>,
) -> Result<UncheckedCalibration, String> {
    let needed = |names: &[&str]| {
        let value = find(letters, names).and_then(number);
        value.ok_or_else(|| format!("{} must be a finite number", names[0]))
    };
    let coefficient = |name: &str| match find(letters, &[name]) {
        None | Some(Value::Null) => Ok(0.0),
        Some(value) => number(value).ok_or_else(|| format!("{name} must be a finite number")),
    };
    let model = lens_model(tree, letters)?;
    let listed = match find(letters, &LISTS)
        .or_else(|| find(letters, &["distcoeffs", "distortion", "dist", "d"]))
    {
        Some(list @ Value::Array(_)) => Some(list.clone()),
        _ => None,
    };
    let names: &[&str] = match model {
        Some(LensModel::Fisheye) => &["k1", "k2", "k3", "k4"],
        _ => &COEFFICIENTS,
    };
    let given = match listed {
        Some(list) => list,
        None => names
            .iter()
            .map(|name| coefficient(name))
            .collect::<Result<Vec<f64>, String>>()?
            .into(),
    };
    let has_any = flat_numbers(&given).is_none_or(|given| given.iter().any(|part| *part != 0.0));
    let model = match model {
        Some(model) => model,
        // RealSense's own formula goes from the picture to the ray; without coefficients it is none.
        None if has_any => {
            return Err("the model 'Inverse Brown Conrady' is not supported with coefficients; without them, or as \
                        plumb_bob, it is"
                .to_owned());
        }
        None => LensModel::ByNumber,
    };
    let side = |names: &[&str]| {
        let side = find(letters, names).map(|value| side_px(value).ok_or(names[0]));
        side.transpose()
            .map_err(|name| format!("{name} must be a whole number of pixels from 1 to 32768"))
    };
    Ok(UncheckedCalibration {
        size_px: side(&SIDES[0])?
            .zip(side(&SIDES[1])?)
            .map(|(width, height)| [width, height]),
        focal_px: [needed(&FOCAL[0])?, needed(&FOCAL[1])?],
        center_px: [needed(&CENTER[0])?, needed(&CENTER[1])?],
        distortion: distortion(model, Some(&given))?,
    })
}

/// The lens's model; `None`: RealSense's inverse one.
fn lens_model(
    tree: &Map<String, Value>,
    letters: &Letters<'_>,
) -> Result<Option<LensModel>, String> {
    let mut named = Map::new();
    for (key, value) in tree {
        let last = key.rsplit('.').next().unwrap_or_default();
        let is_type = matches!(
            normalised(last).as_str(),
            "modeltype" | "cameratype" | "type"
        ) && value.is_string();
        let key = if is_type { "camera_model" } else { last };
        named.insert(key.to_owned(), value.clone());
    }
    let is_inverse = letters.iter().any(|(key, value)| {
        matches!(key.as_str(), "model" | "distortionmodel")
            && value
                .as_str()
                .is_some_and(|name| normalised(name).contains("inversebrown"))
    });
    match is_inverse {
        true => Ok(None),
        false => model_of(&named).map(Some),
    }
}
