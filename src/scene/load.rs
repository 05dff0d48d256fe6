//! Reads a scene file from top to bottom; the first mistake ends it.

use std::path::Path;

use toml::de::DeTable;

use super::error::SceneError;
use super::reader::{Document, Table};
use super::{Scene, anchors, lights, objects, probe, settings};

/// What may stand at the outermost level.
const TABLES: [&str; 12] = [
    "camera", "tracking", "board", "marker", "phantom", "virtual", "light", "ambient", "table",
    "shadows", "probe", "room",
];

impl Scene {
    /// Reads a scene file and the meshes that it names. Relative paths in it start at its own folder, or else at that
    /// one's parent.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        let bytes = std::fs::read(path).map_err(|error| {
            SceneError::of_file(path, format!("the scene cannot be read: {error}"))
        })?;
        let text = match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let valid = error.utf8_error().valid_up_to();
                let text = String::from_utf8_lossy(error.as_bytes());
                return Err(SceneError::at(
                    path,
                    &text,
                    valid..valid + 1,
                    "not UTF-8 text, which TOML has to be",
                ));
            }
        };
        Self::parse(path, &text)
    }

    /// Reads a scene from its text; `path` is where it lies, for messages and relative paths.
    pub fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        let document = Document { path, text };
        let tree = DeTable::parse(text).map_err(|error| {
            let span = error.span().unwrap_or(text.len()..text.len());
            document.error(span, format!("not TOML: {}", error.message()))
        })?;
        let root = Table::root(&document, &tree, &TABLES)?;
        let camera = settings::camera(&root)?;
        let tracking = settings::tracking(&root)?;
        let anchors = anchors::anchors(&root, tracking.detector)?;
        let lights = lights::lights(&root)?;
        let ambient_radiance = lights::ambient_radiance(&root)?;
        let probe = probe::probe(&root)?;
        let shadows = settings::shadows(&root, probe.as_ref())?;
        let (phantoms, virtuals) = objects::objects(&root, &anchors)?;
        Ok(Self {
            camera,
            tracking,
            anchors,
            phantoms,
            virtuals,
            lights,
            ambient_radiance,
            probe,
            shadows,
        })
    }
}
