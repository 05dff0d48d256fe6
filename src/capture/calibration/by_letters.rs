//! Calibrations that name each number by its letter, `fx`, `fy`, `cx`, `cy`, `k1`, …, flat or in tables: RealSense's,
//! ORB-SLAM's (`Camera.fx`), VINS's (`projection_parameters`), NeRF's `transforms.json` (`fl_x`), and what people write themselves.

use serde_json::{Map, Value};

use super::entries::{Entry, entries, entry};
use super::lens::{lens_by, refuse_skew};
use super::lens_names::LETTERS;
use super::opensfm;
use super::sizes::size_beside;
use super::values::{CORNER_PX, LensModel, UncheckedCalibration, model_of, normalised, number};

const FOCAL: [[&str; 3]; 2] = [["fx", "flx", "focalx"], ["fy", "fly", "focaly"]];
const CENTER: [[&str; 3]; 2] = [["cx", "ppx", "principalx"], ["cy", "ppy", "principaly"]];
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
    // OpenSfM's are in other units.
    let focal = letters.iter().find(|entry| is_focal(entry))?;
    let is_opensfm =
        |entry: &Entry<'_>| entry.table == focal.table && entry.key == "projection_type";
    if focal.key == "focal_x" && opensfm::is_focal(focal.value) && letters.iter().any(is_opensfm) {
        return None;
    }
    // Tables of a camera each are looked at one by one.
    (has_all(&letters) && count(&letters) == 1).then(|| of_letters(&letters, focal))
}

fn is_focal(entry: &Entry<'_>) -> bool {
    FOCAL[0].contains(&entry.name.as_str())
}

fn has_all(letters: &[Entry<'_>]) -> bool {
    let all = FOCAL.iter().chain(&CENTER);
    all.into_iter().all(|names| entry(letters, names).is_some())
}

fn of_letters(letters: &[Entry<'_>], focal: &Entry<'_>) -> Result<UncheckedCalibration, String> {
    // Of a camera for depth and one for colour the numbers beside the focal length are meant.
    let needed = |names: &[&str]| {
        let is_named = |entry: &&Entry<'_>| names.contains(&entry.name.as_str());
        let mut beside = letters.iter().filter(|entry| entry.table == focal.table);
        let found = beside.find(is_named).or_else(|| entry(letters, names));
        let value = found.and_then(|entry| number(entry.value));
        value.ok_or_else(|| format!("{} must be a finite number", names[0]))
    };
    refuse_skew(letters)?;
    let model = lens_model(letters, focal)?;
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
    // NeRF's count from the picture's corner, as COLMAP does whose numbers they are (docs.nerf.studio, "Data conventions").
    let first_px = match focal.name.as_str() {
        "flx" => CORNER_PX,
        _ => 0.0,
    };
    let center_px = [needed(&CENTER[0])?, needed(&CENTER[1])?];
    Ok(UncheckedCalibration {
        size_px: size_beside(letters, focal.table)?,
        focal_px: [needed(&FOCAL[0])?, needed(&FOCAL[1])?],
        center_px: center_px.map(|center| center - first_px),
        lens,
    })
}

/// The lens's model; `None`: RealSense's inverse one.
fn lens_model(letters: &[Entry<'_>], focal: &Entry<'_>) -> Result<Option<LensModel>, String> {
    let is_of_camera = |entry: &&Entry<'_>| {
        is_focal(entry) || entry.is_in_lens || LETTERS.contains(&entry.name.as_str())
    };
    // What other tables name a model is not the lens's: a device's, say.
    let tables: Vec<usize> = letters
        .iter()
        .filter(is_of_camera)
        .map(|entry| entry.table)
        .collect();
    let named = letters
        .iter()
        .filter(|entry| entry.table == 0 || entry.name == "xi" || tables.contains(&entry.table))
        .map(|entry| {
            let is_type = matches!(entry.name.as_str(), "cameratype" | "type")
                && (entry.table == 0 || entry.table == focal.table);
            let name = match is_type && entry.value.is_string() {
                true => "cameramodel",
                false => entry.name.as_str(),
            };
            (entry.key, name, entry.value)
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
