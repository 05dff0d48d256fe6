//! Calibrations that name each number by its letter, `fx`, `fy`, `cx`, `cy`, `k1`, …, flat or in tables: RealSense's,
//! ORB-SLAM's (`Camera.fx`), VINS's (`projection_parameters`), NeRF's `transforms.json` (`fl_x`), and what people write themselves.

use serde_json::{Map, Value};

use super::entries::{Entry, entries, entry};
use super::lens::{LETTERS, lens_by};
use super::values::{
    LensModel, UncheckedCalibration, bad_side, model_of, normalised, number, side_px,
};

const FOCAL: [[&str; 3]; 2] = [["fx", "flx", "focalx"], ["fy", "fly", "focaly"]];
const CENTER: [[&str; 3]; 2] = [["cx", "ppx", "principalx"], ["cy", "ppy", "principaly"]];
const SIDES: [[&str; 4]; 2] = [
    ["width", "imagewidth", "w", "cols"],
    ["height", "imageheight", "h", "rows"],
];
/// Tables in one another that are looked into.
const MOST_LEVELS: u32 = 3;

/// The camera that a tree's letters describe; `None` where it has none of them.
pub(super) fn camera(tree: &Map<String, Value>) -> Option<Result<UncheckedCalibration, String>> {
    let [flat, letters] = [0, MOST_LEVELS].map(|levels| entries(tree, levels));
    let count = |letters: &[Entry<'_>]| letters.iter().filter(|entry| is_focal(entry)).count();
    if count(&flat) > 1 {
        let message = "it has several fx; keep the camera that is meant alone";
        return Some(Err(message.to_owned()));
    }
    // Tables of a camera each are looked at one by one.
    (has_all(&letters) && count(&letters) == 1).then(|| of_letters(&letters))
}

fn is_focal(entry: &Entry<'_>) -> bool {
    FOCAL[0].contains(&entry.name.as_str())
}

fn has_all(letters: &[Entry<'_>]) -> bool {
    let all = FOCAL.iter().chain(&CENTER);
    all.into_iter().all(|names| entry(letters, names).is_some())
}

fn of_letters(letters: &[Entry<'_>]) -> Result<UncheckedCalibration, String> {
    let needed = |names: &[&str]| {
        let value = entry(letters, names).and_then(|entry| number(entry.value));
        value.ok_or_else(|| format!("{} must be a finite number", names[0]))
    };
    let side = |names: &[&str]| {
        let side = entry(letters, names).map(|entry| side_px(entry.value).ok_or(names[0]));
        side.transpose().map_err(bad_side)
    };
    let model = lens_model(letters)?;
    let lens = lens_by(letters, model.unwrap_or(LensModel::ByNumber))?;
    // RealSense's own formula goes from the picture to the ray; without coefficients it is none.
    if model.is_none()
        && lens
            .distortion
            .coefficients()
            .iter()
            .any(|part| *part != 0.0)
    {
        return Err(
            "the model 'Inverse Brown Conrady' is not supported with coefficients; without them, or as plumb_bob, it is"
                .to_owned(),
        );
    }
    Ok(UncheckedCalibration {
        size_px: side(&SIDES[0])?
            .zip(side(&SIDES[1])?)
            .map(|(width, height)| [width, height]),
        focal_px: [needed(&FOCAL[0])?, needed(&FOCAL[1])?],
        center_px: [needed(&CENTER[0])?, needed(&CENTER[1])?],
        lens,
    })
}

/// The lens's model; `None`: RealSense's inverse one.
fn lens_model(letters: &[Entry<'_>]) -> Result<Option<LensModel>, String> {
    let is_of_lens = |entry: &&Entry<'_>| is_focal(entry) || LETTERS.contains(&entry.name.as_str());
    // What other tables name a model is not the lens's: a device's, say.
    let tables: Vec<usize> = letters
        .iter()
        .filter(is_of_lens)
        .map(|entry| entry.table)
        .collect();
    let named = letters.iter().filter_map(|entry| {
        let is_type = matches!(entry.name.as_str(), "modeltype" | "cameratype" | "type");
        match is_type && entry.value.is_string() {
            true => (entry.table == 0).then_some(("camera_model", entry.value)),
            false => (entry.table == 0 || tables.contains(&entry.table))
                .then_some((entry.key, entry.value)),
        }
    });
    let is_inverse = letters.iter().any(|entry| {
        matches!(entry.name.as_str(), "model" | "distortionmodel")
            && entry
                .value
                .as_str()
                .is_some_and(|name| normalised(name).contains("inversebrown"))
    });
    match is_inverse {
        true => Ok(None),
        false => model_of(named).map(Some),
    }
}
