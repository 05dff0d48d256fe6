//! Reads glTF 2.0 (`.glb`, `.gltf`) as one mesh in its rest pose: node trees, skins and morph weights are applied, cameras
//! and lights are passed over. <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>

mod accessors;
pub mod copies;
mod extensions;
mod file;
mod materials;
mod nodes;
mod primitives;
mod skins;
mod tangents;
mod textures;

use std::path::Path;

use super::error::SceneError;
use super::raw_model::RawModel;
use file::GltfFile;
use primitives::Builder;

/// Reads a file's default scene, its own axes and units; `note_read` is told of every file that is looked for besides.
///
/// # Errors
/// What the file lacks or has wrong, with the place in it.
pub fn read(path: &Path, bytes: &[u8], note_read: &dyn Fn(&Path)) -> Result<RawModel, SceneError> {
    if bytes.is_empty() {
        return Err(SceneError::of_file(
            path,
            "the file is empty; a glTF model is expected",
        ));
    }
    let mut file = GltfFile::read(path, bytes, note_read)?;
    let document = file.document.clone();
    let nodes = nodes::placed(&file, &document)?;
    let mut builder = Builder::default();
    for placed in &nodes.of_scene {
        if let Some(mesh) = placed.mesh() {
            builder.add(&mut file, &nodes, placed, &mesh, note_read)?;
        }
    }
    builder.note_passed_over(&mut file);
    if builder.triangles.is_empty() {
        return Err(SceneError::of_file(
            path,
            "no triangles; a glTF model with a mesh in its scene is expected",
        ));
    }
    let mut model = RawModel {
        positions: builder.positions,
        triangles: builder.triangles,
        looks: builder.looks,
        materials: builder.materials,
        textures: builder.textures.kept,
        ..RawModel::default()
    };
    for note in file.notes {
        model.notes.add_of(path, note);
    }
    Ok(model)
}
