//! OpenSfM's and OpenDroneMap's cameras (`camera_models.json`, `cameras.json`): a table each, with lengths in units of the picture's
//! longer side and the principal point relative to the picture's middle (opensfm.org/docs/geometry.html, "Normalized Image
//! Coordinates" and "Camera Models").

use serde_json::{Map, Value};

use super::sizes::size_of;
use super::values::{Lens, LensModel, UncheckedCalibration, distortion, number};

/// The longest focal length in these units, of a lens of 6° across. Longer ones are in pixels.
const MOST_FOCAL: f64 = 10.0;

/// Whether a table is a camera of OpenSfM's.
pub(super) fn is_camera(table: &Map<String, Value>) -> bool {
    let focal = table.get("focal").or_else(|| table.get("focal_x"));
    let is_share = focal.is_some_and(is_focal);
    table.get("projection_type").is_some_and(Value::is_string) && is_share
}

/// Whether a focal length is one in these units.
pub(super) fn is_focal(focal: &Value) -> bool {
    number(focal).is_some_and(|focal| focal <= MOST_FOCAL)
}

/// The camera of such a table.
///
/// # Errors
/// A model that is not supported, and numbers that are in no such units.
pub(super) fn camera(table: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    let value = |key: &str, default: Option<f64>| match table.get(key) {
        None => default.ok_or_else(|| format!("{key} is missing")),
        Some(value) => number(value).ok_or_else(|| format!("{key} must be a finite number")),
    };
    let letters = |letters: &[&str]| -> Result<Vec<f64>, String> {
        letters.iter().map(|key| value(key, Some(0.0))).collect()
    };
    let kind = table["projection_type"].as_str().unwrap_or_default();
    let (model, given) = match kind {
        "perspective" | "simple_radial" | "radial" | "brown" => {
            (LensModel::Brown, letters(&["k1", "k2", "p1", "p2", "k3"])?)
        }
        "fisheye" | "fisheye_opencv" => (LensModel::Fisheye, letters(&["k1", "k2", "k3", "k4"])?),
        _ => {
            return Err(format!(
                "projection_type: OpenSfM's model '{kind}' is not supported; perspective, simple_radial, radial, brown, fisheye and \
                 fisheye_opencv are"
            ));
        }
    };
    let focal = match table.contains_key("focal_x") {
        true => [value("focal_x", None)?, value("focal_y", None)?],
        false => [value("focal", None)?; 2],
    };
    let size_px = size_of(table)?.ok_or("OpenSfM's width and height are missing")?;
    let center = [value("c_x", Some(0.0))?, value("c_y", Some(0.0))?];
    let sides = size_px.map(f64::from);
    let unit_px = sides[0].max(sides[1]);
    Ok(UncheckedCalibration {
        size_px: Some(size_px),
        focal_px: focal.map(|focal| unit_px * focal),
        center_px: [0, 1].map(|axis| unit_px * center[axis] + 0.5 * (sides[axis] - 1.0)),
        lens: Lens {
            distortion: distortion(model, &given)?,
            is_said: true,
        },
    })
}
