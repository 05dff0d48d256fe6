//! What the benches share: times told as median, p10 and p90, and rows for a file.
#![allow(dead_code)] // Each bench uses its own part.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use glam::Vec3;
use gnomon::app::chart::peers_table::mesh;
use gnomon::geometry::mesh::Mesh;

/// A folder beside the project's, with the peers and their models; a clone alone has none.
pub fn shared_folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared")
}

/// The triangles of an OBJ file, its normals made anew.
pub fn read_obj(path: &Path) -> Result<Mesh> {
    let options = tobj::LoadOptions {
        triangulate: true,
        ..Default::default()
    };
    let (models, _) = tobj::load_obj(path, &options).with_context(|| path.display().to_string())?;
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for model in models {
        let first = positions.len() as u32;
        positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        triangles.extend(
            model
                .mesh
                .indices
                .chunks_exact(3)
                .map(|corners| [0, 1, 2].map(|corner| first + corners[corner])),
        );
    }
    Ok(mesh(&positions, triangles))
}

/// What many frames took, milliseconds.
#[derive(Debug, Clone, Copy)]
pub struct Times {
    pub median_ms: f64,
    pub p10_ms: f64,
    pub p90_ms: f64,
}

impl Times {
    /// Of at least one frame.
    pub fn of(mut frames_ms: Vec<f64>) -> Self {
        frames_ms.sort_by(f64::total_cmp);
        let at = |tenths: usize| frames_ms[frames_ms.len() * tenths / 10];
        Self {
            median_ms: at(5),
            p10_ms: at(1),
            p90_ms: at(9),
        }
    }
}

/// How many frames, off the command line.
///
/// # Errors
/// Anything but a whole number above zero.
pub fn at_least_one(written: &str) -> Result<usize, String> {
    match written.parse() {
        Ok(frames) if frames > 0 => Ok(frames),
        _ => Err("allowed: 1, 2, …".to_owned()),
    }
}

/// Rows for a file, where one is asked for.
pub struct Csv {
    path: Option<PathBuf>,
    text: String,
}

impl Csv {
    pub fn new(path: Option<PathBuf>, header: &str) -> Self {
        Self {
            path,
            text: format!("{header}\n"),
        }
    }

    pub fn row(&mut self, fields: &[&dyn std::fmt::Display]) {
        for (index, field) in fields.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = write!(self.text, "{}{field}", if index == 0 { "" } else { "," });
        }
        self.text.push('\n');
    }

    pub fn finish(self) -> Result<()> {
        match self.path {
            Some(path) => {
                std::fs::write(&path, self.text).with_context(|| path.display().to_string())
            }
            None => Ok(()),
        }
    }
}
