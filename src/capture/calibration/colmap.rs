//! COLMAP's `cameras.txt`: a camera a line, `CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]`.

use super::values::{CORNER_PX, Lens, UncheckedCalibration};
use crate::geometry::camera::{Distortion, MOST_SIDE_PX};

/// All cameras of a file, each with its name.
pub(super) fn cameras(text: &str) -> Result<Vec<(String, UncheckedCalibration)>, String> {
    let lines = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim()));
    lines
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .map(|(number, line)| camera(line).map_err(|message| format!("line {number}: {message}")))
        .collect()
}

/// What to say of a text file that is not COLMAP's.
fn other_text() -> String {
    "of text files COLMAP's cameras.txt, whose lines are CAMERA_ID MODEL WIDTH HEIGHT PARAMS[], ROS's ost.txt, a matrix of 3 x 3 numbers \
     and KITTI's projections are read; write other programs' numbers as size_px, focal_px, center_px and distortion into a .toml"
        .to_owned()
}

fn camera(line: &str) -> Result<(String, UncheckedCalibration), String> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [id, model, width, height, ref parameters @ ..] = words[..] else {
        return Err(other_text());
    };
    // (SLAM's and KITTI's text files begin with numbers alone.)
    if model.parse::<f64>().is_ok() {
        return Err(other_text());
    }
    let side = |word: &str| {
        let side = word
            .parse::<u32>()
            .ok()
            .filter(|side| (1..=MOST_SIDE_PX).contains(side));
        side.ok_or_else(|| {
            format!("'{word}' must be a side of the picture, 1 to {MOST_SIDE_PX} pixels")
        })
    };
    let numbers: Vec<f64> = parameters
        .iter()
        .map(|word| word.parse().map_err(|_| format!("'{word}' is no number")))
        .collect::<Result<_, _>>()?;
    let wrong = |names: &str| format!("{model} has {names}, not {} numbers", numbers.len());
    let (f, c, distortion) = match (model, &numbers[..]) {
        ("SIMPLE_PINHOLE", &[f, x, y]) => ([f, f], [x, y], Distortion::NONE),
        ("PINHOLE", &[fx, fy, x, y]) => ([fx, fy], [x, y], Distortion::NONE),
        ("SIMPLE_RADIAL", &[f, x, y, k]) => ([f, f], [x, y], brown(k, 0.0, 0.0, 0.0)),
        ("RADIAL", &[f, x, y, k1, k2]) => ([f, f], [x, y], brown(k1, k2, 0.0, 0.0)),
        ("OPENCV", &[fx, fy, x, y, k1, k2, p1, p2]) => ([fx, fy], [x, y], brown(k1, k2, p1, p2)),
        ("SIMPLE_RADIAL_FISHEYE", &[f, x, y, k]) => {
            ([f, f], [x, y], Distortion::Fisheye([k, 0.0, 0.0, 0.0]))
        }
        ("RADIAL_FISHEYE", &[f, x, y, k1, k2]) => {
            ([f, f], [x, y], Distortion::Fisheye([k1, k2, 0.0, 0.0]))
        }
        ("OPENCV_FISHEYE", &[fx, fy, x, y, k1, k2, k3, k4]) => {
            ([fx, fy], [x, y], Distortion::Fisheye([k1, k2, k3, k4]))
        }
        ("FULL_OPENCV", &[fx, fy, x, y, k1, k2, p1, p2, k3, k4, k5, k6]) => {
            let mut all = [0.0; 14];
            all[..8].copy_from_slice(&[k1, k2, p1, p2, k3, k4, k5, k6]);
            ([fx, fy], [x, y], Distortion::Rational(all))
        }
        ("SIMPLE_PINHOLE", _) => return Err(wrong("f, cx, cy")),
        ("PINHOLE", _) => return Err(wrong("fx, fy, cx, cy")),
        ("SIMPLE_RADIAL" | "SIMPLE_RADIAL_FISHEYE", _) => return Err(wrong("f, cx, cy, k")),
        ("RADIAL" | "RADIAL_FISHEYE", _) => return Err(wrong("f, cx, cy, k1, k2")),
        ("OPENCV", _) => return Err(wrong("fx, fy, cx, cy, k1, k2, p1, p2")),
        ("OPENCV_FISHEYE", _) => return Err(wrong("fx, fy, cx, cy, k1, k2, k3, k4")),
        ("FULL_OPENCV", _) => {
            return Err(wrong("fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6"));
        }
        _ => {
            return Err(format!(
                "the camera model '{model}' is not supported; SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, \
                 FULL_OPENCV, OPENCV_FISHEYE, SIMPLE_RADIAL_FISHEYE and RADIAL_FISHEYE are"
            ));
        }
    };
    let calibration = UncheckedCalibration {
        size_px: Some([side(width)?, side(height)?]),
        focal_px: f,
        // COLMAP counts from the picture's corner.
        center_px: c.map(|center| center - CORNER_PX),
        lens: Lens {
            distortion,
            is_said: true,
        },
    };
    Ok((id.to_owned(), calibration))
}

fn brown(k1: f64, k2: f64, p1: f64, p2: f64) -> Distortion {
    Distortion::Polynomial([k1, k2, p1, p2, 0.0])
}
