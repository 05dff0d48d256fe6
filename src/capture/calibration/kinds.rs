//! What the trees of calibration files mean: the one place that knows their keys.

use std::borrow::Cow;
use std::collections::HashMap;

use serde_json::{Map, Value};

use super::by_letters;
use super::entries::{entries, entries_with_lens, is_matrix};
use super::lens::{lens_of, matrix_numbers, refuse_signs, refuse_skew};
use super::lens_names::{LETTERS, is_coefficients};
use super::opensfm;
use super::sizes::{size, size_of, size_of_one};
use super::values::{
    Lens, UncheckedCalibration, by_number, flat_numbers, model_by_key, normalised,
};
use crate::geometry::camera::Distortion;

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
/// Keys as MATLAB writes them; who has two of them follows its conventions.
const MATLAB_KEYS: [&str; 6] = [
    "IntrinsicMatrix",
    "ImageSize",
    "RadialDistortion",
    "TangentialDistortion",
    "FocalLength",
    "PrincipalPoint",
];
/// Tables and lists in one another in which cameras are looked for.
const MOST_LEVELS: u32 = 4;

/// The cameras that a tree describes, each with its name.
pub(super) fn cameras(tree: &Map<String, Value>) -> Result<Named, String> {
    let is_own = tree.keys().any(|key| OWN_KEYS[..3].contains(&key.as_str()));
    if !is_own {
        let found = known_cameras(tree, MOST_LEVELS)?;
        if found.is_empty() {
            return Err(no_camera(tree));
        }
        if found.iter().all(|(_, camera)| !camera.lens.is_said) {
            let mut models = found.iter().map(|(_, camera)| camera.lens.distortion);
            refuse_signs(
                tree,
                models.any(|lens| matches!(lens, Distortion::Fisheye(_))),
            )?;
        }
        return Ok(found);
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
    let is_opensfm = |entry: &Value| entry.as_object().is_some_and(opensfm::is_camera);
    if tree.values().any(is_opensfm) {
        return of_tables(tree, is_opensfm, opensfm::camera);
    }
    if opensfm::is_camera(tree) {
        return one(opensfm::camera(tree)?);
    }
    let is_kalibr = |entry: &Value| entry.get("intrinsics").is_some_and(is_row);
    if tree.values().any(is_kalibr) {
        return of_tables(tree, is_kalibr, |camera| {
            of_kalibr(&with_lens_of(tree, camera))
        });
    }
    if let Some(renamed) = of_mrcal(tree) {
        return one(of_kalibr(&renamed)?);
    }
    // A sensor of EuRoC's is a camera of Kalibr's without a name.
    if tree.get("intrinsics").is_some_and(is_row) {
        return one(of_kalibr(tree)?);
    }
    if let Some(renamed) = of_anipose(tree) {
        return one(of_opencv(&renamed)?);
    }
    let is_numbers = |matrix: &Value| is_matrix(matrix) || is_list_of(matrix, |it| !it.is_object());
    if find(tree, &MATRIX_KEYS).is_some_and(|(_, matrix)| is_numbers(matrix)) {
        return one(of_opencv(tree)?);
    }
    if let Some(camera) = by_letters::camera(tree) {
        return one(camera?);
    }
    of_inner_tables(tree, levels)
}

/// The cameras of the tables of one kind within a tree.
fn of_tables(
    tree: &Map<String, Value>,
    is_one: impl Fn(&Value) -> bool,
    read: impl Fn(&Map<String, Value>) -> Result<UncheckedCalibration, String>,
) -> Result<Named, String> {
    let tables = tree.iter().filter(|(_, entry)| is_one(entry));
    let cameras = tables.map(|(name, entry)| {
        let camera = entry.as_object().ok_or("must be a table".to_owned());
        let camera = camera.and_then(&read);
        Ok((
            name.clone(),
            camera.map_err(|why| format!("{name}: {why}"))?,
        ))
    });
    cameras.collect()
}

/// Whether a value is a list of single numbers that are no matrix of 3 x 3.
fn is_row(value: &Value) -> bool {
    const MATRIX: usize = 9;
    is_list_of(data_of(value), |it| !it.is_object() && !it.is_array())
        && data_of(value)
            .as_array()
            .is_some_and(|list| list.len() != MATRIX)
}

fn is_list_of(value: &Value, is_wanted: impl Fn(&Value) -> bool) -> bool {
    value
        .as_array()
        .is_some_and(|list| list.iter().all(is_wanted))
}

/// The cameras of tables and of lists of tables within a tree; where they have no size of their own it is the tree's.
fn of_inner_tables(tree: &Map<String, Value>, levels: u32) -> Result<Named, String> {
    let mut found = Vec::new();
    if levels == 0 {
        return Ok(found);
    }
    let mut look = |name: String, number: usize, inner: &Map<String, Value>| {
        let cameras = known_cameras(&with_lens_of(tree, inner), levels - 1)
            .map_err(|why| format!("{name}: {why}"))?;
        let size_px = match cameras.iter().all(|(_, camera)| camera.size_px.is_some()) {
            true => None,
            false => size_of_one(tree, number)?,
        };
        found.extend(cameras.into_iter().map(|(_, camera)| {
            let size_px = camera.size_px.or(size_px);
            (name.clone(), UncheckedCalibration { size_px, ..camera })
        }));
        Ok::<_, String>(())
    };
    for (key, value) in tree {
        match value {
            Value::Object(inner) => look(key.clone(), 0, inner)?,
            Value::Array(list) => {
                for (number, entry) in list.iter().enumerate() {
                    // (DepthAI has pairs of a number and a table.)
                    let table = entry.as_object();
                    if let Some(inner) = table.or_else(|| entry.get(1)?.as_object()) {
                        look(format!("{key}[{number}]"), number, inner)?;
                    }
                }
            }
            _ => {}
        }
    }
    Ok(found)
}

/// A table within a tree, with what stands beside it of the lens: the keys that decide its model where it has none of its own,
/// and the coefficients likewise.
fn with_lens_of<'a>(
    tree: &Map<String, Value>,
    inner: &'a Map<String, Value>,
) -> Cow<'a, Map<String, Value>> {
    let names_model = |key: &str, name: &str, value: &Value| {
        !value.is_object() && !matches!(model_by_key(key, name, value), Ok(None))
    };
    let own = entries_with_lens(inner);
    let has_model = own
        .iter()
        .any(|entry| names_model(entry.key, &entry.name, entry.value));
    let has_lens = own
        .iter()
        .any(|entry| is_coefficients(&entry.name, entry.value));
    let is_camera = |value: &Value| {
        let table = value.as_object();
        table.is_some_and(|table| table.contains_key("fx") || find(table, &MATRIX_KEYS).is_some())
    };
    let outer = tree.iter().filter(|(key, value)| {
        let name = normalised(key);
        let is_model = || name == "mirrorparameters" || names_model(key, &name, value);
        let is_missing = !has_model && is_model() || !has_lens && is_coefficients(&name, value);
        is_missing && !is_camera(value) && !inner.contains_key(*key)
    });
    let mut outer = outer
        .map(|(key, value)| (key.clone(), value.clone()))
        .peekable();
    if outer.peek().is_none() {
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
    let entries = entries_with_lens(tree);
    let lens = lens_of(&entries)?;
    refuse_skew(&entries)?;
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
    // MATLAB counts pixels from 1, and its sizes are [rows, columns] (mathworks.com, cameraIntrinsicsToOpenCV, cameraIntrinsics).
    let has = |key: &&&str| tree.contains_key(**key);
    let is_matlab = MATLAB_KEYS.iter().filter(has).count() > 1;
    let first_px = if is_matlab { 1.0 } else { 0.0 };
    let size_px = match tree.get("ImageSize").filter(|_| is_matlab) {
        Some(rows_and_columns) => {
            let [rows, columns] = size(rows_and_columns)?;
            Some([columns, rows])
        }
        None => size_of(tree)?,
    };
    Ok(UncheckedCalibration {
        size_px,
        focal_px: [fx, fy],
        center_px: [cx, cy].map(|center| center - first_px),
        lens,
    })
}

/// A camera of anipose's, which calls its matrix and its size no more than that, under OpenCV's names.
fn of_anipose(tree: &Map<String, Value>) -> Option<Map<String, Value>> {
    let (matrix, size) = (tree.get("matrix")?, tree.get("size")?);
    tree.get("distortions")?;
    let mut renamed = tree.clone();
    renamed.insert("camera_matrix".to_owned(), matrix.clone());
    renamed.insert("image_size".to_owned(), size.clone());
    Some(renamed)
}

/// A camera of mrcal's, whose coefficients follow on the focal lengths and the centre, under Kalibr's names.
fn of_mrcal(tree: &Map<String, Value>) -> Option<Map<String, Value>> {
    let all = tree.get("intrinsics")?.as_array()?;
    let model = tree.get("lensmodel")?.as_str()?;
    let (camera, lens) = all.split_at_checked(4)?;
    if !model.starts_with("LENSMODEL_") {
        return None;
    }
    let mut renamed = tree.clone();
    renamed.insert("intrinsics".to_owned(), camera.into());
    renamed.insert("distortion_coefficients".to_owned(), lens.into());
    Some(renamed)
}

/// A camera of Kalibr's camchain: `camera_model`, `intrinsics`, `distortion_model`, `distortion_coeffs`, `resolution`.
fn of_kalibr(camera: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    let entries = entries_with_lens(camera);
    let lens = lens_of(&entries)?;
    refuse_skew(&entries)?;
    let [fx, fy, cx, cy] = camera
        .get("intrinsics")
        .and_then(|list| numbers::<4>(data_of(list)))
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
    for name in ["binningx", "binningy"] {
        if let Some((key, by)) = find(tree, &[name])
            && by.as_f64().is_some_and(|by| by > 1.0)
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

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    flat_numbers(value)?.try_into().ok()
}
