//! A scene that goes with a recording: it plays the recording's own folder, and its meshes lie there too.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};
use toml_edit::{DocumentMut, Item, value};

/// The name of the scene in its folder.
pub const SCENE_NAME: &str = "scene.toml";

/// Copies a scene file into a session's folder with all that it names. The session carries the calibration itself, and
/// its frames come as they were turned and chosen.
///
/// # Errors
/// A file that cannot be read or written.
pub fn copy_scene(scene: &Path, session: &Path) -> Result<()> {
    let text = std::fs::read_to_string(scene)
        .with_context(|| format!("{}: the scene cannot be read", scene.display()))?;
    let mut document: DocumentMut = text
        .parse()
        .with_context(|| format!("{}: not TOML", scene.display()))?;
    if let Some(camera) = document.get_mut("camera").and_then(Item::as_table_like_mut) {
        camera.insert("source", value("."));
        for key in ["calibration", "mirror", "size_px", "fps", "format"] {
            camera.remove(key);
        }
    }
    let mut copied: BTreeMap<PathBuf, String> = BTreeMap::new();
    for kind in ["phantom", "virtual"] {
        for thing in things_of(&mut document, kind) {
            let Some(written) = thing.as_str().map(str::to_owned) else {
                continue;
            };
            let number = copied.len() + 1;
            let place = match copied.entry(resolved(scene, &written)) {
                std::collections::btree_map::Entry::Occupied(known) => known.get().clone(),
                std::collections::btree_map::Entry::Vacant(new) => {
                    let place = copy_mesh(new.key(), session, number)?;
                    new.insert(place).clone()
                }
            };
            *thing = value(place);
        }
    }
    let path = session.join(SCENE_NAME);
    std::fs::write(&path, document.to_string())
        .with_context(|| format!("{}: cannot be written", path.display()))
}

/// The `mesh` of each thing of a kind.
fn things_of<'a>(document: &'a mut DocumentMut, kind: &str) -> Vec<&'a mut Item> {
    let Some(Item::ArrayOfTables(things)) = document.get_mut(kind) else {
        return Vec::new();
    };
    things
        .iter_mut()
        .filter_map(|thing| thing.get_mut("mesh"))
        .collect()
}

/// A path of a scene starts at the scene's folder, or else at that one's parent.
fn resolved(scene: &Path, written: &str) -> PathBuf {
    let scene = std::path::absolute(scene).unwrap_or_else(|_| scene.to_owned());
    let mut tried = scene
        .ancestors()
        .skip(1)
        .take(2)
        .map(|folder| folder.join(written));
    tried
        .find(|path| path.exists())
        .unwrap_or_else(|| PathBuf::from(written))
}

/// Copies a mesh with its materials into a folder of its own; its path from the session.
fn copy_mesh(mesh: &Path, session: &Path, number: usize) -> Result<String> {
    let name = mesh.file_name().unwrap_or_default().to_string_lossy();
    let place = format!("models/{number}/{name}");
    let copy = |from: &Path, to: &Path| -> Result<()> {
        let failed = || format!("{}: cannot be copied to {}", from.display(), to.display());
        std::fs::create_dir_all(to.parent().unwrap_or(session)).with_context(failed)?;
        std::fs::copy(from, to).with_context(failed)?;
        Ok(())
    };
    let target = session.join(&place);
    copy(mesh, &target)?;
    let text = std::fs::read(mesh)?;
    for line in String::from_utf8_lossy(&text).lines() {
        let Some(library) = line.trim().strip_prefix("mtllib ") else {
            continue;
        };
        let from = mesh.with_file_name(library.trim());
        // A mesh whose materials are missing has the usual ones; so does its copy.
        if from.is_file() {
            copy(&from, &target.with_file_name(library.trim()))?;
        }
    }
    Ok(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn a_copied_scene_is_the_same_but_for_its_camera() {
        let folder = tempfile::tempdir().unwrap();
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let original = root.join("config/lamp.toml");
        copy_scene(&original, folder.path()).unwrap();
        let (copy, original_scene) = (
            Scene::load(&folder.path().join(SCENE_NAME)).unwrap(),
            Scene::load(&original).unwrap(),
        );
        let source = Path::new(&copy.camera.source).canonicalize().unwrap();
        assert_eq!(source, folder.path().canonicalize().unwrap());
        assert!(!copy.phantoms.is_empty() && !copy.virtuals.is_empty());
        assert_eq!(
            format!("{:?}", copy.phantoms),
            format!("{:?}", original_scene.phantoms)
        );
        assert_eq!(
            format!("{:?}", copy.virtuals),
            format!("{:?}", original_scene.virtuals)
        );
        assert_eq!(
            format!("{:?}", copy.anchors),
            format!("{:?}", original_scene.anchors)
        );
        let text = std::fs::read_to_string(folder.path().join(SCENE_NAME)).unwrap();
        assert!(text.contains("# the mean of its wood"), "comments stay");
    }

    #[test]
    fn what_holds_for_the_camera_alone_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("a.toml");
        let text = "[camera]\nsource = \"webcam:0\"\nmirror = true\nsize_px = [640, 480]\nfps = 30\nformat = \"YUYV\"\n\
                    [[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n";
        std::fs::write(&scene, text).unwrap();
        let session = tempfile::tempdir().unwrap();
        copy_scene(&scene, session.path()).unwrap();
        let copy = Scene::load(&session.path().join(SCENE_NAME)).unwrap();
        assert!(!copy.camera.mirror);
        assert_eq!(copy.camera.wanted, crate::scene::WantedFormat::default());
    }
}
