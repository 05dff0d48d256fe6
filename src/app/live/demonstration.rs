//! First use: a scene made from one marker that was seen, kept in a folder of its own until somebody saves it.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::app::files::anchor_block;
use crate::app::files::output_error::OutputError;
use crate::app::files::picture_files::{write_first, write_text};
use crate::scene::{CameraSettings, Family, Marker};

/// The thing that is put on the marker; it lies beside the scene's file.
const MESH_NAME: &str = "torus.obj";
const MESH: &str = include_str!("../../../models/torus.obj");
/// Name of the scene's file until it is saved.
const SCENE_NAME: &str = "scene.toml";
/// Largest extent of the mesh across its axis, metres.
const MESH_SIZE_M: f64 = 0.076;

/// A scene that nobody has saved yet.
pub struct Demonstration {
    folder: TempDir,
}

impl Demonstration {
    /// Makes a scene of a marker of tag36h11, by its number and the side of its black square.
    ///
    /// # Errors
    /// A folder for temporary files that cannot be written.
    pub fn make(camera: &CameraSettings, id: u32, size_m: f64) -> Result<Self, OutputError> {
        let no_folder = |error| OutputError::Io {
            path: std::env::temp_dir(),
            error,
        };
        let folder = tempfile::Builder::new()
            .prefix("gnomon-")
            .tempdir()
            .map_err(no_folder)?;
        write_text(&folder.path().join(MESH_NAME), MESH)?;
        let text = scene_text(camera, id, size_m);
        write_text(&folder.path().join(SCENE_NAME), &text)?;
        Ok(Self { folder })
    }

    /// Leaves its folder where it is, also when the program ends: its file.
    pub fn keep(&mut self) -> PathBuf {
        self.folder.disable_cleanup(true);
        self.path()
    }

    /// Its file.
    pub fn path(&self) -> PathBuf {
        self.folder.path().join(SCENE_NAME)
    }
}

/// Writes a demonstration's text, as it was edited, where a person wants it, and its thing beside it. Neither may be
/// there already.
///
/// # Errors
/// A file that is there, or cannot be written.
pub fn save(text: &str, path: &Path) -> Result<(), OutputError> {
    let mesh = path.with_file_name(MESH_NAME);
    let is_there = std::fs::read_to_string(&mesh).is_ok_and(|it| it == MESH);
    if !is_there {
        write_first(&mesh, MESH.as_bytes())?;
    }
    let written = write_first(path, text.as_bytes());
    if written.is_err() && !is_there {
        // Nothing is left of what was not done.
        _ = std::fs::remove_file(&mesh);
    }
    written
}

fn scene_text(camera: &CameraSettings, id: u32, size_m: f64) -> String {
    let quoted = |text: &str| toml::Value::from(text).to_string();
    let absolute = |path: &Path| {
        let path = path.canonicalize().unwrap_or_else(|_| path.to_owned());
        quoted(&path.to_string_lossy())
    };
    let source = match crate::capture::live::is_live(&camera.source) {
        true => quoted(&camera.source),
        false => absolute(Path::new(&camera.source)),
    };
    let mut text = format!(
        "# Made by gnomon live from a marker that it saw.\n\n[camera]\nsource = {source}\n"
    );
    if let Some(calibration) = &camera.calibration {
        text += &format!("calibration = {}\n", absolute(calibration));
    }
    if camera.mirror {
        text += "mirror = true\n";
    }
    let marker = Marker::alone(Family::TAG36H11, id, size_m);
    let scale = 1.2 * size_m / MESH_SIZE_M;
    let table_m = 12.0 * size_m;
    let [x, y, z] = [-4.0, 3.0, 7.0].map(|side| side * size_m);
    // As bright on the table as display white is.
    let intensity = 2.0 * (x * x + y * y + z * z);
    text += "\n";
    text += &anchor_block::marker("table", &marker);
    text += &format!(
        "\n[table]                        # catches shadows\nrect_m = [{:.4}, {:.4}, {table_m:.4}, {table_m:.4}]\n\n\
         [[virtual]]\nname = \"torus\"\nmesh = \"{MESH_NAME}\"\nposition_m = [0.0, 0.0, {:.4}]\n\
         rotation_deg = [90.0, 0.0, 35.0]\nscale = {scale:.4}\nmaterial = {{ albedo = [0.75, 0.16, 0.12] }}\n\n\
         [[light]]                      # drag it in the window until the shadow falls as the real ones do\n\
         kind = \"point\"\nposition_m = [{x:.4}, {y:.4}, {z:.4}]\nintensity = {intensity:.4}\n\n\
         [ambient]\nradiance = [0.1, 0.1, 0.1]\n",
        -table_m,
        -table_m,
        0.5 * MESH_SIZE_M * scale,
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn it_is_a_scene_and_stays_one_where_it_is_saved() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let lamp = root.join("recordings/lamp");
        for source in ["webcam:0", lamp.to_str().unwrap()] {
            let camera = CameraSettings {
                source: source.to_owned(),
                mirror: true,
                ..CameraSettings::default()
            };
            let demonstration = Demonstration::make(&camera, 17, 0.04).unwrap();
            let scene = Scene::load(&demonstration.path()).unwrap();
            assert_eq!(scene.camera.source, source);
            assert!(scene.camera.mirror);
            assert_eq!(scene.anchors[0].markers[0].id, 17);
            let bottom = scene.virtuals[0]
                .mesh
                .positions
                .iter()
                .map(|p| {
                    let at = scene.virtuals[0]
                        .anchor_from_object
                        .transform_point3(p.as_dvec3());
                    at.z
                })
                .fold(f64::INFINITY, f64::min);
            assert!(bottom.abs() < 1e-4, "it stands on the table: {bottom}");

            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("mine.toml");
            let text = std::fs::read_to_string(demonstration.path()).unwrap();
            save(&text, &path).unwrap();
            drop(demonstration);
            assert_eq!(Scene::load(&path).unwrap().virtuals.len(), 1);
            assert!(save(&text, &path).is_err(), "nothing is written over");
        }
    }
}
