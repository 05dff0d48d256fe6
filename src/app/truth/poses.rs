//! True poses, as a recording's `truth.json` has them.

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use glam::{DAffine3, DMat3, DMat4};
use serde_json::Value;

use crate::scene::{Anchor, plain_file};

/// The places of camera and markers in each frame.
pub struct TruePoses {
    path: String,
    frames: Vec<Value>,
}

impl TruePoses {
    /// Reads `truth.json` of a recording's folder.
    ///
    /// # Errors
    /// It is not there, or is not what a session's is.
    pub fn read(folder: &Path) -> Result<Self> {
        let path = folder.join("truth.json");
        let text = plain_file::read_text(&path)
            .with_context(|| format!("{} cannot be read", path.display()))?;
        let mut truth: Value = serde_json::from_str(&text)
            .with_context(|| format!("{} is not JSON", path.display()))?;
        let frames = truth.get_mut("frames").map(Value::take);
        let Some(Value::Array(frames)) = frames else {
            bail!("{} has no list of \"frames\"", path.display());
        };
        Ok(Self {
            path: path.display().to_string(),
            frames,
        })
    }

    /// `camera_from_anchor` of each anchor in a frame: of the world, which is a board, and of lone markers that move.
    ///
    /// # Errors
    /// The truth does not know the frame, or a marker of an anchor other than the world.
    pub fn camera_from_anchors(&self, frame: u32, anchors: &[Anchor]) -> Result<Vec<DAffine3>> {
        let found = self.frames.get(frame as usize);
        let known = found.with_context(|| format!("{} knows no frame {frame}", self.path))?;
        let camera_from_world = affine(&known["world_to_camera"])
            .with_context(|| format!("{}: frame {frame}: world_to_camera", self.path))?;
        let pose = |(index, anchor): (usize, &Anchor)| {
            if index == 0 {
                return Ok(camera_from_world);
            }
            let id = anchor.markers.first().map_or(0, |marker| marker.id);
            let world_from_marker = affine(&known["markers"][id.to_string()])
                .with_context(|| format!("{}: frame {frame}: marker {id}", self.path))?;
            Ok(camera_from_world * world_from_marker)
        };
        anchors.iter().enumerate().map(pose).collect()
    }
}

/// An affine map from a row-major 4 x 4 matrix.
///
/// # Errors
/// It is no such matrix.
pub fn affine(matrix: &Value) -> Result<DAffine3> {
    let rows: [[f64; 4]; 4] =
        serde_json::from_value(matrix.clone()).context("not a matrix of 4 x 4 numbers")?;
    let transposed = DMat4::from_cols_array_2d(&rows).transpose();
    Ok(DAffine3 {
        matrix3: DMat3::from_mat4(transposed),
        translation: transposed.w_axis.truncate(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_list_of_frames_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        for text in ["3", "[]", "null", "{}", "{\"frames\": 1}"] {
            std::fs::write(folder.path().join("truth.json"), text).unwrap();
            assert!(TruePoses::read(folder.path()).is_err(), "{text}");
        }
    }
}
