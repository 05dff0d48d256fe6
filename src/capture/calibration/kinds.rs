//! What the trees of calibration files mean: the one place that knows their keys.

use std::borrow::Cow;
use std::collections::HashMap;

use serde_json::{Map, Value};

use super::by_letters;
use super::entries::{entries, entries_with, is_matrix};
use super::lens::{LETTERS, is_of_lens, lens_of, matrix_numbers};
use super::values::{
    Lens, UncheckedCalibration, bad_side, by_number, flat_numbers, is_model_key, normalised,
    side_px,
};

type Named = Vec<(String, UncheckedCalibration)>;

/// Keys that a message shows of a file that is not known.
const LISTED_KEYS: usize = 8;
const OWN_KEYS: [&str; 5] = ["size_px", "focal_px", "center_px", "model", "distortion"];
// Keys are compared in small letters without underscores, hyphens and blanks.
const MATRIX_KEYS: [&str; 8] = [
    "cameramatrix",
    "intrinsic",
    "intrinsics",
    "cameramtx",
    "intrinsicmatrix",
    "cameraintrinsics",
    "k",
    "mtx",
];
const WIDTH_KEYS: [&str; 2] = ["imagewidth", "width"];
const HEIGHT_KEYS: [&str; 2] = ["imageheight", "height"];
const SIZE_KEYS: [&str; 3] = ["resolution", "imagesize", "imgsize"];
/// Tables and lists in one another in which cameras are looked for.
const MOST_LEVELS: u32 = 4;

/// The cameras that a tree describes, each with its name.
pub(super) fn cameras(tree: &Map<String, Value>) -> Result<Named, String> {
    let is_own = tree.keys().any(|key| OWN_KEYS[..3].contains(&key.as_str()));
    if !is_own {
        let found = known_cameras(tree, MOST_LEVELS)?;
        return match found.is_empty() {
            true => Err(no_camera(tree)),
            false => Ok(found),
        };
    }
    Ok(vec![("the camera".to_owned(), of_own(tree)?)])
}

/// What to say of a table that describes no camera.
fn no_camera(tree: &Map<String, Value>) -> String {
    let keys: Vec<&str> = tree.keys().map(String::as_str).take(LISTED_KEYS).collect();
    let more = if tree.len() > LISTED_KEYS {
        ", …"
    } else {
        ""
    };
    format!(
        "no camera is in it: a calibration has {}, or camera_matrix and distortion_coefficients, or intrinsics, or fx, fy, \
         cx, cy; this file has {}{more}",
        OWN_KEYS.join(", "),
        if keys.is_empty() {
            "nothing".to_owned()
        } else {
            keys.join(", ")
        }
    )
}

/// The cameras of other programs' trees, in tables within tables too; none where there is nothing that is known.
fn known_cameras(tree: &Map<String, Value>, levels: u32) -> Result<Named, String> {
    let one = |camera| Ok(vec![("the camera".to_owned(), camera)]);
    if let Some(Value::Object(camera)) = tree.get("camera")
        && camera.get("K").is_some_and(Value::is_object)
    {
        return one(of_session(camera)?);
    }
    if let Some(list) = tree.get("Calibration").and_then(|it| it.get("cameras")) {
        return of_calib_io(list);
    }
    let is_kalibr = |entry: &Value| entry.get("intrinsics").is_some();
    if tree.values().any(is_kalibr) {
        let cameras = tree.iter().filter(|(_, entry)| is_kalibr(entry));
        return cameras
            .map(|(name, entry)| {
                let camera = entry.as_object();
                let camera = camera.map(|camera| of_kalibr(&with_model_of(tree, camera)));
                let camera = camera.unwrap_or_else(|| Err("must be a table".to_owned()));
                Ok((
                    name.clone(),
                    camera.map_err(|why| format!("{name}: {why}"))?,
                ))
            })
            .collect();
    }
    let has_four = |list: &Value| list.as_array().is_some_and(|list| list.len() == 4);
    // A sensor of EuRoC's is a camera of Kalibr's without a name.
    if tree.get("intrinsics").is_some_and(has_four) {
        return one(of_kalibr(tree)?);
    }
    if find(tree, &MATRIX_KEYS).is_some_and(|(_, matrix)| matrix.is_array() || is_matrix(matrix)) {
        return one(of_opencv(tree)?);
    }
    if let Some(camera) = by_letters::camera(tree) {
        return one(camera?);
    }
    of_inner_tables(tree, levels)
}

/// The cameras of tables and of lists of tables within a tree; where they have no size of their own it is the tree's.
fn of_inner_tables(tree: &Map<String, Value>, levels: u32) -> Result<Named, String> {
    let mut found = Vec::new();
    if levels == 0 {
        return Ok(found);
    }
    let size_px = size_of(tree)?;
    let mut look = |name: String, inner: &Map<String, Value>| {
        let cameras = known_cameras(&with_model_of(tree, inner), levels - 1)
            .map_err(|why| format!("{name}: {why}"))?;
        found.extend(cameras.into_iter().map(|(_, camera)| {
            let size_px = camera.size_px.or(size_px);
            (name.clone(), UncheckedCalibration { size_px, ..camera })
        }));
        Ok::<_, String>(())
    };
    for (key, value) in tree {
        match value {
            Value::Object(inner) => look(key.clone(), inner)?,
            Value::Array(list) => {
                let tables = list.iter().enumerate();
                let tables =
                    tables.filter_map(|(number, entry)| Some((number, entry.as_object()?)));
                for (number, inner) in tables {
                    look(format!("{key}[{number}]"), inner)?;
                }
            }
            _ => {}
        }
    }
    Ok(found)
}

/// A table within a tree, with the keys beside it that decide the lens's model where it has none of its own.
fn with_model_of<'a>(
    tree: &Map<String, Value>,
    inner: &'a Map<String, Value>,
) -> Cow<'a, Map<String, Value>> {
    let is_model = |key: &str| is_model_key(&normalised(key));
    let outer = tree
        .iter()
        .filter(|(key, value)| is_model(key) && !value.is_object());
    let mut outer = outer
        .map(|(key, value)| (key.clone(), value.clone()))
        .peekable();
    if outer.peek().is_none() || inner.keys().any(|key| is_model(key)) {
        return Cow::Borrowed(inner);
    }
    let mut all = inner.clone();
    all.extend(outer);
    Cow::Owned(all)
}

/// `size_px = [640, 480]`, `focal_px`, `center_px`, `model = "fisheye"`, `distortion = [k1, k2, p1, p2, k3]`.
fn of_own(tree: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    if let Some(unknown) = tree.keys().find(|key| !OWN_KEYS.contains(&key.as_str())) {
        return Err(format!(
            "unknown key '{unknown}'; a calibration has {}",
            OWN_KEYS.join(", ")
        ));
    }
    let pair = |key| {
        let value = tree
            .get(key)
            .ok_or_else(|| format!("{key} = [x, y] is missing"))?;
        numbers::<2>(value).ok_or_else(|| format!("{key} must be two finite numbers"))
    };
    Ok(UncheckedCalibration {
        size_px: tree.get("size_px").map(size).transpose()?,
        focal_px: pair("focal_px")?,
        center_px: pair("center_px")?,
        lens: lens_of(&entries(tree, 0))?,
    })
}

/// `{size, K: {fx, fy, cx, cy}, dist}`.
fn of_session(camera: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    let entry = |key| {
        let value = camera
            .get("K")
            .and_then(|matrix| matrix.get(key))
            .and_then(Value::as_f64);
        value.ok_or_else(|| format!("camera.K.{key} must be a finite number"))
    };
    Ok(UncheckedCalibration {
        size_px: camera.get("size").map(size).transpose()?,
        focal_px: [entry("fx")?, entry("fy")?],
        center_px: [entry("cx")?, entry("cy")?],
        lens: lens_of(&entries(camera, 0))?,
    })
}

/// What the calibration tools of OpenCV, ROS 1, ROS 2 and PhotonVision write.
fn of_opencv(tree: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    let lens = lens_of(&entries_with(tree, is_of_lens))?;
    refuse_cut_pictures(tree)?;
    let (key, matrix) = find(tree, &MATRIX_KEYS).ok_or("the camera matrix is missing")?;
    let [fx, skew, mut cx, s1, fy, mut cy, mut s2, mut s3, one] = matrix_numbers(key, matrix)?
        .and_then(|numbers| <[f64; 9]>::try_from(numbers).ok())
        .ok_or_else(|| format!("{key} must be a matrix of 3 x 3 finite numbers"))?;
    // Open3D and MATLAB write columns where others write rows. No picture has its centre at its corner.
    if [cx, cy] == [0.0; 2] {
        [cx, cy, s2, s3] = [s2, s3, 0.0, 0.0];
    }
    if [skew, s1, s2, s3] != [0.0; 4] || one != 1.0 {
        return Err(format!("{key} must be [fx 0 cx; 0 fy cy; 0 0 1]"));
    }
    Ok(UncheckedCalibration {
        size_px: size_of(tree)?,
        focal_px: [fx, fy],
        center_px: [cx, cy],
        lens,
    })
}

/// A camera of Kalibr's camchain: `camera_model`, `intrinsics`, `distortion_model`, `distortion_coeffs`, `resolution`.
fn of_kalibr(camera: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    let lens = lens_of(&entries_with(camera, is_of_lens))?;
    let [fx, fy, cx, cy] = camera
        .get("intrinsics")
        .and_then(numbers::<4>)
        .ok_or("intrinsics must be four finite numbers fx, fy, cx, cy")?;
    Ok(UncheckedCalibration {
        size_px: size_of(camera)?,
        focal_px: [fx, fy],
        center_px: [cx, cy],
        lens,
    })
}

/// calib.io's list of cameras, whose parameters are numbers with a state each.
fn of_calib_io(list: &Value) -> Result<Named, String> {
    let list = list
        .as_array()
        .ok_or("Calibration.cameras must be a list")?;
    let kinds = calib_io_kinds(list);
    let cameras = list
        .iter()
        .zip(kinds)
        .enumerate()
        .map(|(k, (entry, kind))| {
            let name = format!("camera {k}");
            let camera = of_calib_io_camera(entry, kind).map_err(|why| format!("{name}: {why}"))?;
            Ok((name, camera))
        });
    cameras.collect()
}

/// The kinds of calib.io's cameras. Its library (cereal) writes a kind's name where it first occurs, with the top bit of its
/// number set, and from then on the number alone.
fn calib_io_kinds(list: &[Value]) -> Vec<&str> {
    const NUMBER: u64 = 0x7fff_ffff;
    let mut names = HashMap::new();
    let mut kinds = Vec::with_capacity(list.len());
    for entry in list {
        let model = &entry["model"];
        let number = model["polymorphic_id"].as_u64().map(|id| id & NUMBER);
        let known = names.get(&number).copied();
        let kind = model["polymorphic_name"]
            .as_str()
            .or(known)
            .unwrap_or("none");
        names.insert(number, kind);
        kinds.push(kind);
    }
    kinds
}

fn of_calib_io_camera(entry: &Value, kind: &str) -> Result<UncheckedCalibration, String> {
    let model = &entry["model"];
    if kind != "libCalib::CameraModelOpenCV" {
        return Err(format!(
            "the camera model '{kind}' is not supported; libCalib::CameraModelOpenCV is"
        ));
    }
    let data = &model["ptr_wrapper"]["data"];
    let parameters = data["parameters"]
        .as_object()
        .ok_or("model.ptr_wrapper.data.parameters is missing")?;
    let value = |name: &str| {
        let value = parameters
            .get(name)
            .map(|entry| entry.get("val").unwrap_or(entry));
        value
            .map(|value| {
                value
                    .as_f64()
                    .ok_or_else(|| format!("{name} must be a number"))
            })
            .transpose()
    };
    let needed = |name: &str| value(name)?.ok_or_else(|| format!("{name} is missing"));
    let known = ["f", "ar", "cx", "cy"];
    let mut names = parameters.keys().map(String::as_str);
    if let Some(other) = names.find(|name| !known.contains(name) && !LETTERS.contains(name))
        && value(other)?.is_none_or(|value| value != 0.0)
    {
        return Err(format!("the parameter '{other}' is not supported"));
    }
    let mut all = [0.0; 14];
    for (coefficient, name) in all.iter_mut().zip(LETTERS) {
        *coefficient = value(name)?.unwrap_or(0.0);
    }
    let focal = needed("f")?;
    let base = &data["CameraModelCRT"]["CameraModelBase"];
    let sides = base.get("imageSize").map(size).transpose()?;
    Ok(UncheckedCalibration {
        size_px: sides,
        focal_px: [focal, focal * value("ar")?.unwrap_or(1.0)],
        center_px: [needed("cx")?, needed("cy")?],
        lens: Lens {
            distortion: by_number(&all)?,
            is_said: true,
        },
    })
}

/// ROS's matrix is that of the whole picture, which these keys cut or shrink.
fn refuse_cut_pictures(tree: &Map<String, Value>) -> Result<(), String> {
    for key in ["binning_x", "binning_y"] {
        if tree
            .get(key)
            .and_then(Value::as_f64)
            .is_some_and(|by| by > 1.0)
        {
            return Err(format!(
                "{key} says that the pictures are smaller than what was calibrated; that is not supported"
            ));
        }
    }
    let offset = |key| tree.get("roi").and_then(|roi| roi.get(key)?.as_f64());
    if [offset("x_offset"), offset("y_offset")]
        .into_iter()
        .flatten()
        .any(|by| by != 0.0)
    {
        return Err(
            "roi says that the pictures are a part of what was calibrated; that is not supported"
                .to_owned(),
        );
    }
    Ok(())
}

fn size_of(tree: &Map<String, Value>) -> Result<Option<[u32; 2]>, String> {
    let side = |keys: &[&str]| {
        let found = find(tree, keys);
        found
            .map(|(key, value)| side_px(value).ok_or_else(|| bad_side(key)))
            .transpose()
    };
    if let (Some(width), Some(height)) = (side(&WIDTH_KEYS)?, side(&HEIGHT_KEYS)?) {
        return Ok(Some([width, height]));
    }
    find(tree, &SIZE_KEYS)
        .map(|(_, value)| size(value))
        .transpose()
}

fn find<'a>(tree: &'a Map<String, Value>, keys: &[&str]) -> Option<(&'a str, &'a Value)> {
    keys.iter().find_map(|wanted| {
        let found = tree.iter().find(|(key, _)| normalised(key) == *wanted);
        found.map(|(key, value)| (key.as_str(), value))
    })
}

/// A matrix is written as `{rows, cols, data}`, or as its numbers alone.
fn data_of(matrix: &Value) -> &Value {
    matrix.get("data").unwrap_or(matrix)
}

/// `[width, height]` or `{width, height}`.
fn size(value: &Value) -> Result<[u32; 2], String> {
    let sides = match data_of(value) {
        Value::Array(sides) if sides.len() == 2 => Some((&sides[0], &sides[1])),
        Value::Object(sides) => sides.get("width").zip(sides.get("height")),
        _ => None,
    };
    let sides = sides.and_then(|(width, height)| Some([side_px(width)?, side_px(height)?]));
    sides.ok_or_else(|| bad_side("the picture size [width, height]"))
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    flat_numbers(value)?.try_into().ok()
}
