//! Reads a scene file from top to bottom; the first mistake ends it.

use std::path::{Path, PathBuf};

use toml::de::DeTable;

use super::error::SceneError;
use super::model_cache::ModelCache;
use super::named_files::NamedFile;
use super::plain_file::{self, MOST_TEXT};
use super::reader::{Document, Table};
use super::{
    Scene, anchors, camera, format, lights, not_a_scene, objects, probe, shadows, tracking,
};

/// What reading a scene's text gave.
#[derive(Debug)]
pub struct Reading {
    /// The scene, or its first mistake.
    pub scene: Result<Scene, SceneError>,
    /// Every other file or folder that was read, or looked for and not there: a change of any may give something else.
    pub files: Vec<PathBuf>,
    /// The files that the text names, in its order.
    pub named: Vec<NamedFile>,
}

impl Scene {
    /// Reads a scene file and the meshes that it names. Relative paths in it start at its own folder, or else at that
    /// one's parent.
    pub fn load(path: &Path) -> Result<Self, SceneError> {
        Self::parse(path, &Self::read_text(path)?)
    }

    /// The text of a scene file.
    pub fn read_text(path: &Path) -> Result<String, SceneError> {
        if let Some(found) = not_a_scene::what_else(path) {
            return Err(SceneError::of_file(path, found));
        }
        let bytes = plain_file::read(path, MOST_TEXT).map_err(|error| {
            SceneError::of_file(path, format!("the scene cannot be read: {error}"))
        })?;
        if is_utf16(&bytes) {
            let message = "UTF-16 text; TOML has to be UTF-8: save it so";
            return Err(SceneError::of_file(path, message.to_owned()));
        }
        String::from_utf8(bytes).map_err(|error| {
            let valid = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(error.as_bytes());
            SceneError::at(
                path,
                &text,
                valid..valid + 1,
                "not UTF-8 text, which TOML has to be",
            )
        })
    }

    /// Reads a scene from its text; `path` is where it lies, for messages and relative paths.
    pub fn parse(path: &Path, text: &str) -> Result<Self, SceneError> {
        Self::read(path, text).scene
    }

    /// Reads a scene from its text as [`Scene::parse`] does, and tells which other files it depends on.
    pub fn read(path: &Path, text: &str) -> Reading {
        Self::read_from(Document::new(path, text, None))
    }

    /// The same, where models that were read before are in `models`, or are put there.
    pub fn read_with(path: &Path, text: &str, models: &ModelCache) -> Reading {
        Self::read_from(Document::new(path, text, Some(models)))
    }

    fn read_from(document: Document) -> Reading {
        let scene = Self::from_document(&document);
        let (files, named) = document.files();
        Reading {
            scene,
            files,
            named,
        }
    }

    fn from_document(document: &Document) -> Result<Self, SceneError> {
        let text = document.text;
        let tree = DeTable::parse(text).map_err(|error| {
            let span = error.span().unwrap_or(text.len()..text.len());
            let hint = number_hint(text, span.start);
            document.error(span, format!("not TOML: {}{hint}", error.message()))
        })?;
        let root = Table::root(document, &tree, &format::section_names())?;
        let camera = camera::camera(&root)?;
        let tracking = tracking::tracking(&root)?;
        let anchors = anchors::anchors(&root, tracking.detector)?;
        let lights = lights::lights(&root, &anchors)?;
        let (ambient_radiance, bounces) = lights::ambient(&root)?;
        let probe = probe::probe(&root, &anchors)?;
        let shadows = shadows::shadows(&root, probe.as_ref())?;
        let (phantoms, virtuals) = objects::objects(&root, &anchors)?;
        Ok(Self {
            camera,
            tracking,
            anchors,
            phantoms,
            virtuals,
            lights,
            ambient_radiance,
            bounces,
            probe,
            shadows,
        })
    }
}

/// Whether a text begins as one of two bytes a character does: with their byte order mark, or with a zero in every second byte.
fn is_utf16(bytes: &[u8]) -> bool {
    let zeros = |first: usize| bytes.len() >= 4 && bytes[first] == 0 && bytes[first + 2] == 0;
    bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) || zeros(0) || zeros(1)
}

/// What to write for a number that begins or ends with its point, where a place in a text is in one; nothing elsewhere.
fn number_hint(text: &str, at: usize) -> &'static str {
    let is_digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
    // (Not every place that is told begins a character.)
    let Some((before, after)) = text.split_at_checked(at) else {
        return "";
    };
    let begins = after.starts_with('.') && is_digit(after.chars().nth(1));
    let ends = before.ends_with('.') && is_digit(before.chars().rev().nth(1));
    match begins || ends {
        true => "; a number has digits before and after its point, as in 0.5",
        false => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_within_a_character_is_no_number() {
        assert_eq!(number_hint("x = é", 5), "");
        assert_ne!(number_hint("x = .5", 4), "");
    }
}
