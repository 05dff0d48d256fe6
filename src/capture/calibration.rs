//! Calibration files: gnomon's own TOML or JSON, a session's JSON, OpenCV's FileStorage (YAML, XML, JSON) and the YAML
//! of ROS's `camera_info`. All become the same tree of values first, so there is one place that knows the keys.

use std::path::{Path, PathBuf};

use glam::DVec2;
use opencv::core::{
    FileNode, FileNodeTraitConst, FileStorage, FileStorage_MEMORY, FileStorage_READ,
    FileStorageTraitConst,
};
use serde_json::{Map, Value};

use crate::geometry::camera::Intrinsics;
use crate::scene::plain_file;

/// Why a calibration cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The system refuses to read it.
    #[error("{}: {error}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// Not what its extension says.
    #[error("{}: {message}", path.display())]
    Syntax {
        /// The file.
        path: PathBuf,
        /// What is wrong, with line and column where known.
        message: String,
    },
    /// A value that no camera has, or one that is missing.
    #[error("{}: {message}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// What is wrong and what is allowed.
        message: String,
    },
    /// The file holds no picture size, and nothing else tells it.
    #[error(
        "{}: the calibration does not say for which picture size it holds; add size_px = [width, height] \
         (OpenCV: image_width and image_height)",
        path.display()
    )]
    NoSize {
        /// The file.
        path: PathBuf,
    },
    /// The frames are of another size than the calibration.
    #[error(
        "{frames_of} has frames of {} x {} pixels, but its calibration is for {} x {}; calibrate at the recording's size",
        frame_px[0], frame_px[1], calibration_px[0], calibration_px[1]
    )]
    OtherSize {
        /// The recording.
        frames_of: String,
        /// Width and height of its frames.
        frame_px: [u32; 2],
        /// Width and height that the calibration holds for.
        calibration_px: [u32; 2],
    },
}

/// Reads a calibration that says its own picture size.
pub fn load_calibration(path: &Path) -> Result<Intrinsics, CalibrationError> {
    let calibration = read(path)?;
    let size_px = calibration
        .size_px
        .ok_or_else(|| CalibrationError::NoSize {
            path: path.to_owned(),
        })?;
    calibration.into_intrinsics(path, size_px)
}

/// Reads a calibration for frames of a known size: one that says no size is taken to hold for them, one that says
/// another is refused. `frames_of` names the recording in the message.
pub fn load_calibration_for(
    path: &Path,
    frame_px: [u32; 2],
    frames_of: &str,
) -> Result<Intrinsics, CalibrationError> {
    let intrinsics = load_calibration_or_fill(path, frame_px)?;
    check_frame_size(&intrinsics, frame_px, frames_of)?;
    Ok(intrinsics)
}

/// Refuses a calibration that was made at another picture size. `frames_of` names the recording in the message.
pub fn check_frame_size(
    intrinsics: &Intrinsics,
    frame_px: [u32; 2],
    frames_of: &str,
) -> Result<(), CalibrationError> {
    if intrinsics.size_px == frame_px {
        return Ok(());
    }
    Err(CalibrationError::OtherSize {
        frames_of: frames_of.to_owned(),
        frame_px,
        calibration_px: intrinsics.size_px,
    })
}

/// As [`load_calibration`], with a size for files that say none.
pub(super) fn load_calibration_or_fill(
    path: &Path,
    default_px: [u32; 2],
) -> Result<Intrinsics, CalibrationError> {
    let calibration = read(path)?;
    let size_px = calibration.size_px.unwrap_or(default_px);
    calibration.into_intrinsics(path, size_px)
}

/// A calibration in gnomon's own format, which [`load_calibration`] reads from a `.toml` file to the bit.
pub fn calibration_text(intrinsics: &Intrinsics) -> String {
    let Intrinsics {
        size_px: [width, height],
        focal_px,
        center_px,
        distortion: [k1, k2, p1, p2, k3],
    } = intrinsics;
    // `?` writes as many digits as tell the number from its neighbours, and a point in each.
    format!(
        "size_px = [{width}, {height}]\n\
         focal_px = [{:?}, {:?}]\n\
         center_px = [{:?}, {:?}]\n\
         distortion = [{k1:?}, {k2:?}, {p1:?}, {p2:?}, {k3:?}]    # k1, k2, p1, p2, k3\n",
        focal_px.x, focal_px.y, center_px.x, center_px.y
    )
}

/// What a file says, before it is known to make sense.
struct UncheckedCalibration {
    size_px: Option<[u32; 2]>,
    focal_px: [f64; 2],
    center_px: [f64; 2],
    distortion: [f64; 5],
}

impl UncheckedCalibration {
    fn into_intrinsics(
        self,
        path: &Path,
        size_px: [u32; 2],
    ) -> Result<Intrinsics, CalibrationError> {
        let refuse = |message: String| {
            Err(CalibrationError::Value {
                path: path.to_owned(),
                message,
            })
        };
        let Self {
            focal_px,
            center_px,
            distortion,
            ..
        } = self;
        let mut numbers = focal_px.iter().chain(&center_px).chain(&distortion);
        if !numbers.all(|number| number.is_finite()) {
            return refuse(
                "focal lengths, centre and distortion must be finite numbers".to_owned(),
            );
        }
        if size_px.contains(&0) || size_px.iter().any(|&side| side > 32768) {
            return refuse(format!(
                "the picture size {} x {} must be from 1 to 32768",
                size_px[0], size_px[1]
            ));
        }
        if focal_px.iter().any(|&focal| focal <= 0.0) {
            return refuse(format!(
                "the focal lengths {} and {} must be greater than 0",
                focal_px[0], focal_px[1]
            ));
        }
        // A cropped picture may have its centre outside, but not far.
        for (center, side) in center_px.iter().zip(size_px.map(f64::from)) {
            if *center < -0.5 * side || *center > 1.5 * side {
                return refuse(format!(
                    "the principal point ({}, {}) lies far from a picture of {} x {} pixels",
                    center_px[0], center_px[1], size_px[0], size_px[1]
                ));
            }
        }
        Ok(Intrinsics {
            size_px,
            focal_px: DVec2::from_array(focal_px),
            center_px: DVec2::from_array(center_px),
            distortion,
        })
    }
}

fn read(path: &Path) -> Result<UncheckedCalibration, CalibrationError> {
    let text = plain_file::read_text(path).map_err(|error| CalibrationError::Io {
        path: path.to_owned(),
        error,
    })?;
    let extension = path
        .extension()
        .and_then(|extension| extension.to_str())
        .unwrap_or_default()
        .to_ascii_lowercase();
    let tree = match extension.as_str() {
        "toml" => toml::from_str(&text).map_err(|error| error.to_string()),
        "json" => serde_json::from_str(&text).map_err(|error| error.to_string()),
        "yaml" | "yml" => tree_of_file_storage(&as_opencv_yaml(&text)),
        "xml" => tree_of_file_storage(&text),
        _ => Err("a calibration is a .toml, .json, .yaml, .yml or .xml file".to_owned()),
    };
    let tree: Map<String, Value> = tree.map_err(|message| CalibrationError::Syntax {
        path: path.to_owned(),
        message,
    })?;
    calibration_of_tree(&tree).map_err(|message| CalibrationError::Value {
        path: path.to_owned(),
        message,
    })
}

/// OpenCV insists on a first line that plain YAML (ROS) does not have.
fn as_opencv_yaml(text: &str) -> String {
    match text {
        text if text.starts_with("%YAML") => text.to_owned(),
        text if text.starts_with("---") => format!("%YAML:1.0\n{text}"),
        text => format!("%YAML:1.0\n---\n{text}"),
    }
}

const OWN_KEYS: [&str; 4] = ["size_px", "focal_px", "center_px", "distortion"];
const MATRIX_KEYS: [&str; 6] = [
    "camera_matrix",
    "Camera_Matrix",
    "cameraMatrix",
    "camera_Matrix",
    "intrinsic_matrix",
    "K",
];
const DISTORTION_KEYS: [&str; 7] = [
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "dist_coeffs",
    "distortion_coeffs",
    "dist_coeff",
    "D",
];
const WIDTH_KEYS: [&str; 2] = ["image_width", "image_Width"];
const HEIGHT_KEYS: [&str; 2] = ["image_height", "image_Height"];
const MODEL_KEYS: [&str; 2] = ["distortion_model", "fisheye_model"];

fn calibration_of_tree(tree: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    if let Some(Value::Object(camera)) = tree.get("camera") {
        return calibration_of_session(camera);
    }
    if find(tree, &MATRIX_KEYS).is_some() {
        return calibration_of_opencv(tree);
    }
    calibration_of_own(tree)
}

/// `size_px = [640, 480]`, `focal_px`, `center_px`, `distortion = [k1, k2, p1, p2, k3]`.
fn calibration_of_own(tree: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
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
        distortion: tree
            .get("distortion")
            .map_or(Ok([0.0; 5]), five_coefficients)?,
    })
}

/// `{size, K: {fx, fy, cx, cy}, dist}`.
fn calibration_of_session(camera: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
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
        distortion: camera.get("dist").map_or(Ok([0.0; 5]), five_coefficients)?,
    })
}

/// What OpenCV's and ROS's calibration tools write.
fn calibration_of_opencv(tree: &Map<String, Value>) -> Result<UncheckedCalibration, String> {
    if let Some(model) = find(tree, &MODEL_KEYS).and_then(|(_, model)| model.as_str())
        && !matches!(model, "" | "plumb_bob")
    {
        return Err(format!(
            "the distortion model '{model}' is not supported; plumb_bob (five coefficients) is"
        ));
    }
    let (key, matrix) = find(tree, &MATRIX_KEYS).ok_or("the camera matrix is missing")?;
    let [fx, skew, cx, _, fy, cy, _, _, one] = numbers::<9>(data_of(matrix))
        .ok_or_else(|| format!("{key} must be a matrix of 3 x 3 finite numbers"))?;
    if skew != 0.0 || one != 1.0 {
        return Err(format!("{key} must be [fx 0 cx; 0 fy cy; 0 0 1]"));
    }
    let side = |keys: &[&'static str]| {
        find(tree, keys).map(|(key, value)| side_px(value).ok_or_else(|| bad_side(key)))
    };
    let size_px = match (
        side(&WIDTH_KEYS).transpose()?,
        side(&HEIGHT_KEYS).transpose()?,
    ) {
        (Some(width), Some(height)) => Some([width, height]),
        _ => None,
    };
    let distortion = find(tree, &DISTORTION_KEYS).map(|(_, value)| data_of(value));
    Ok(UncheckedCalibration {
        size_px,
        focal_px: [fx, fy],
        center_px: [cx, cy],
        distortion: distortion.map_or(Ok([0.0; 5]), five_coefficients)?,
    })
}

fn find<'a>(
    tree: &'a Map<String, Value>,
    keys: &[&'static str],
) -> Option<(&'static str, &'a Value)> {
    keys.iter()
        .find_map(|key| tree.get(*key).map(|value| (*key, value)))
}

/// A matrix is written as `{rows, cols, data}`, or as its numbers alone.
fn data_of(matrix: &Value) -> &Value {
    matrix.get("data").unwrap_or(matrix)
}

fn size(value: &Value) -> Result<[u32; 2], String> {
    let sides = value.as_array().filter(|sides| sides.len() == 2);
    let sides = sides.and_then(|sides| Some([side_px(&sides[0])?, side_px(&sides[1])?]));
    sides.ok_or_else(|| bad_side("the picture size [width, height]"))
}

fn side_px(value: &Value) -> Option<u32> {
    let side = value.as_f64()?;
    (side.fract() == 0.0 && (1.0..=32768.0).contains(&side)).then_some(side as u32)
}

fn bad_side(what: &str) -> String {
    format!("{what} must be whole numbers of pixels from 1 to 32768")
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    flat_numbers(value)?.try_into().ok()
}

/// The numbers of a list, or of a list of rows.
fn flat_numbers(value: &Value) -> Option<Vec<f64>> {
    let mut found = Vec::new();
    for entry in value.as_array()? {
        match entry {
            Value::Array(row) => found.extend(
                row.iter()
                    .map(Value::as_f64)
                    .collect::<Option<Vec<f64>>>()?,
            ),
            number => found.push(number.as_f64()?),
        }
    }
    Some(found)
}

/// Missing coefficients are 0; the terms past k3 (rational, thin prism, tilted) belong to lenses that are not modelled.
fn five_coefficients(value: &Value) -> Result<[f64; 5], String> {
    let given = flat_numbers(value)
        .ok_or("the distortion must be a list of finite numbers k1, k2, p1, p2, k3")?;
    if let Some(extra) = given
        .iter()
        .skip(5)
        .find(|coefficient| **coefficient != 0.0)
    {
        return Err(format!(
            "the distortion has {} coefficients, {extra} among those after the fifth; only k1, k2, p1, p2, k3 are \
             supported: calibrate without the rational, thin prism or tilted model",
            given.len()
        ));
    }
    let mut coefficients = [0.0; 5];
    for (coefficient, number) in coefficients.iter_mut().zip(given) {
        *coefficient = number;
    }
    Ok(coefficients)
}

/// The entries that a calibration can have, out of OpenCV's own parser.
fn tree_of_file_storage(text: &str) -> Result<Map<String, Value>, String> {
    let storage = FileStorage::new(text, FileStorage_READ | FileStorage_MEMORY, "")
        .map_err(|error| format!("OpenCV cannot read it: {}", error.message.trim()))?;
    let keys = [
        &MATRIX_KEYS[..],
        &DISTORTION_KEYS,
        &WIDTH_KEYS,
        &HEIGHT_KEYS,
        &MODEL_KEYS,
        &OWN_KEYS,
    ]
    .concat();
    let mut tree = Map::new();
    for key in keys {
        let value = storage
            .get_node(key)
            .and_then(|node| value_of_node(&node, 3));
        match value.map_err(|error| format!("{key}: {}", error.message.trim()))? {
            Value::Null => {}
            value => _ = tree.insert(key.to_owned(), value),
        }
    }
    Ok(tree)
}

fn value_of_node(node: &FileNode, depth: u32) -> opencv::Result<Value> {
    if node.is_int()? || node.is_real()? {
        return Ok(Value::from(node.real()?));
    }
    if node.is_string()? {
        return Ok(Value::from(node.string()?));
    }
    if node.is_seq()? && depth > 0 {
        // OpenCV walks to an entry from the start; no calibration has more than a few dozen.
        let length = node.size()?.min(64) as i32;
        return (0..length)
            .map(|index| value_of_node(&node.at(index)?, depth - 1))
            .collect();
    }
    if node.is_map()? && depth > 0 {
        return Ok(Value::from(Map::from_iter([(
            "data".to_owned(),
            value_of_node(&node.get_node("data")?, depth - 1)?,
        )])));
    }
    Ok(Value::Null)
}

#[cfg(test)]
mod tests {
    use super::*;

    const OWN: &str = "size_px = [640, 480]\nfocal_px = [615, 613.0]\ncenter_px = [321.4, 238.2]\ndistortion = [0.08, -0.19, 0.0008, -0.0005, 0.05]\n";

    fn load(name: &str, text: &str) -> Result<Intrinsics, CalibrationError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        load_calibration(&path)
    }

    fn message(name: &str, text: &str) -> String {
        load(name, text).unwrap_err().to_string()
    }

    fn lamp() -> Intrinsics {
        Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::new(615.0, 613.0),
            center_px: DVec2::new(321.4, 238.2),
            distortion: [0.08, -0.19, 0.0008, -0.0005, 0.05],
        }
    }

    #[test]
    fn every_format_gives_the_same_camera() {
        let own_json = r#"{"size_px": [640, 480], "focal_px": [615, 613], "center_px": [321.4, 238.2],
            "distortion": [0.08, -0.19, 0.0008, -0.0005, 0.05]}"#;
        let session = r#"{"about": "a table", "camera": {"size": [640, 480], "fps": 30,
            "K": {"fx": 615.0, "fy": 613.0, "cx": 321.4, "cy": 238.2}, "dist": [0.08, -0.19, 0.0008, -0.0005, 0.05]}}"#;
        let opencv_yaml = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   \
            cols: 3\n   dt: d\n   data: [ 615., 0., 3.214e+02, 0., 613.,\n       238.2, 0., 0., 1. ]\n\
            distortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   \
            data: [ 0.08, -0.19, 0.0008, -0.0005, 0.05 ]\n";
        let opencv_json = r#"{"image_width": 640, "image_height": 480,
            "Camera_Matrix": {"type_id": "opencv-matrix", "rows": 3, "cols": 3, "dt": "d",
                "data": [615.0, 0.0, 321.4, 0.0, 613.0, 238.2, 0.0, 0.0, 1.0]},
            "Distortion_Coefficients": {"type_id": "opencv-matrix", "rows": 1, "cols": 8, "dt": "d",
                "data": [0.08, -0.19, 0.0008, -0.0005, 0.05, 0.0, 0.0, 0.0]}}"#;
        let opencv_xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<image_width>640</image_width>\n\
            <image_height>480</image_height>\n<K type_id=\"opencv-matrix\">\n<rows>3</rows><cols>3</cols><dt>d</dt>\
            <data>615. 0. 321.4 0. 613. 238.2 0. 0. 1.</data></K>\n<distCoeffs type_id=\"opencv-matrix\">\
            <rows>1</rows><cols>5</cols><dt>d</dt><data>0.08 -0.19 0.0008 -0.0005 0.05</data></distCoeffs>\n\
            </opencv_storage>\n";
        let ros = "image_width: 640\nimage_height: 480\ncamera_name: narrow_stereo\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
            data: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\ndistortion_model: plumb_bob\ndistortion_coefficients:\n  \
            rows: 1\n  cols: 5\n  data: [0.08, -0.19, 0.0008, -0.0005, 0.05]\nprojection_matrix:\n  rows: 3\n  cols: 4\n  \
            data: [615, 0, 321.4, 0, 0, 613, 238.2, 0, 0, 0, 1, 0]\n";
        for (name, text) in [
            ("a.toml", OWN),
            ("a.json", own_json),
            ("session.json", session),
            ("a.yml", opencv_yaml),
            ("b.json", opencv_json),
            ("a.xml", opencv_xml),
            ("ros.yaml", ros),
        ] {
            let found = load(name, text).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(found, lamp(), "{name}");
        }
    }

    #[test]
    fn missing_coefficients_are_zero_and_further_ones_refused() {
        let four = OWN.replace(", 0.05]", "]");
        assert_eq!(
            load("a.toml", &four).unwrap().distortion,
            [0.08, -0.19, 0.0008, -0.0005, 0.0]
        );
        let eight = OWN.replace("0.05]", "0.05, 0, 0.3, 0]");
        assert!(
            message("a.toml", &eight).contains("8 coefficients, 0.3 among those after the fifth")
        );
    }

    #[test]
    fn what_no_camera_has_is_refused() {
        for (from, to, expected) in [
            ("615", "0", "greater than 0"),
            ("615", "-615", "greater than 0"),
            ("615", "nan", "finite"),
            ("321.4", "inf", "finite"),
            ("321.4", "3214", "far from"),
            ("640", "0", "whole numbers"),
            ("640", "640.5", "whole numbers"),
            (
                "[615, 613.0]",
                "[615]",
                "focal_px must be two finite numbers",
            ),
            ("focal_px", "focal", "unknown key 'focal'"),
            (
                "focal_px = [615, 613.0]\n",
                "",
                "focal_px = [x, y] is missing",
            ),
            (
                "size_px = [640, 480]\n",
                "",
                "does not say for which picture size",
            ),
            ("center_px = [", "center_px = ", "line 3"),
        ] {
            let text = message("a.toml", &OWN.replace(from, to));
            assert!(
                text.contains(expected) && text.contains("a.toml"),
                "{from} → {to}: {text}"
            );
        }
    }

    /// Photographs' calibrations from OpenCV's tutorials.
    #[test]
    #[cfg_attr(not(has_shared), ignore = "needs ../shared/real")]
    fn opencvs_tutorial_calibrations_are_read() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/real/opencv_tutorial");
        let (charuco, params) = (
            folder.join("tutorial_camera_charuco.yml"),
            folder.join("tutorial_camera_params.yml"),
        );
        let found = load_calibration(&charuco).unwrap();
        assert_eq!(found.size_px, [640, 480]);
        assert_eq!(
            (found.focal_px.x, found.distortion[4]),
            (452.510_722_196_376_7, 2.954_258_940_681_008)
        );
        assert!(matches!(
            load_calibration(&params),
            Err(CalibrationError::NoSize { .. })
        ));
        assert_eq!(
            load_calibration_for(&params, [640, 480], "it")
                .unwrap()
                .center_px
                .y,
            260.908
        );
    }

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        let camera = Intrinsics {
            size_px: [1280, 720],
            focal_px: DVec2::new(2701.1 / 3.0, 901.0),
            center_px: DVec2::new(639.5, -1e-12),
            distortion: [0.1 + 0.2, -0.19, 1.0 / 3e9, 0.0, 5e-324],
        };
        std::fs::write(&path, calibration_text(&camera)).unwrap();
        assert_eq!(load_calibration(&path).unwrap(), camera);
    }

    #[test]
    fn fisheye_and_broken_files_are_refused() {
        let fisheye = "image_width: 640\nimage_height: 480\nK: [615, 0, 321.4, 0, 613, 238.2, 0, 0, 1]\n\
            distortion_model: equidistant\n";
        assert!(message("a.yaml", fisheye).contains("'equidistant' is not supported"));
        assert!(message("a.yaml", "camera_matrix: [1, 2\n\tx: }").contains("a.yaml"));
        assert!(message("a.json", "{").contains("line 1 column"));
        assert!(message("a.txt", OWN).contains("a calibration is a .toml"));
    }

    #[test]
    fn the_frames_size_must_be_the_calibrations() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        std::fs::write(&path, OWN).unwrap();
        assert_eq!(
            load_calibration_for(&path, [640, 480], "lamp").unwrap(),
            lamp()
        );
        let text = load_calibration_for(&path, [1280, 720], "lamp")
            .unwrap_err()
            .to_string();
        assert!(
            text.starts_with(
                "lamp has frames of 1280 x 720 pixels, but its calibration is for 640 x 480"
            ),
            "{text}"
        );
        std::fs::write(&path, OWN.replace("size_px = [640, 480]\n", "")).unwrap();
        assert_eq!(
            load_calibration_for(&path, [1280, 720], "lamp")
                .unwrap()
                .size_px,
            [1280, 720]
        );
    }
}
