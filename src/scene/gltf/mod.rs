//! Reads glTF 2.0 (`.glb`, `.gltf`) as one mesh in its rest pose: node trees, skins and morph weights are applied, cameras
//! and lights are passed over. Where an animation is to play, what moves the mesh is read as well. <https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html>

mod accessors;
mod animations;
pub mod copies;
mod extensions;
mod file;
mod lenient;
mod materials;
mod meshopt_views;
mod nodes;
mod primitives;
mod skins;
mod specular_glossiness;
mod tangents;
mod textures;

use std::path::Path;

use super::error::SceneError;
use super::raw_model::{ClipInfo, RawModel, RawMotion};
use crate::geometry::rig::Rig;
use file::GltfFile;
use primitives::Builder;

/// Chooses the animation that plays among those that there are; `None`: none.
pub type ChooseClip<'a> = &'a dyn Fn(&[ClipInfo]) -> Result<Option<usize>, SceneError>;

/// Reads a file's default scene, its own axes and units; `note_read` is told of every file that is looked for besides.
///
/// # Errors
/// What the file lacks or has wrong, with the place in it; what `choose` says.
pub fn read(
    path: &Path,
    bytes: &[u8],
    note_read: &dyn Fn(&Path),
    choose: ChooseClip<'_>,
) -> Result<RawModel, SceneError> {
    if bytes.is_empty() {
        return Err(SceneError::of_file(
            path,
            "the file is empty; a glTF model is expected",
        ));
    }
    let mut file = GltfFile::read(path, bytes, note_read)?;
    let document = file.document.clone();
    let clips = animations::clips(&document);
    let played = choose(&clips)?;
    let clip = played.map(|number| animations::clip(&file, &document, number));
    let clip = clip.transpose()?;
    let nodes = nodes::placed(&file, &document)?;
    let mut builder = Builder::new(clip.is_some());
    for node in &nodes.of_scene {
        if let Some(mesh) = node.mesh() {
            builder.add(&mut file, &nodes, node, &mesh, note_read)?;
        }
    }
    builder.note_passed_over(&mut file);
    if let Some(told) = builder.textures.kept.told() {
        file.note(told);
    }
    if builder.triangles.is_empty() {
        let (kinds, _) = builder.without_surface;
        let message = format!(
            "no triangles{}; a glTF model with a mesh in its scene is expected",
            kinds.told()
        );
        return Err(SceneError::of_file(path, message));
    }
    let mut model = RawModel {
        positions: builder.positions,
        triangles: builder.triangles,
        looks: builder.looks,
        materials: builder.materials,
        textures: builder.textures.kept.into_pictures(),
        motion: clip.zip(builder.moving).map(|(clip, moving)| RawMotion {
            clip,
            rig: Rig {
                tree: nodes.tree,
                surfaces: moving.surfaces,
            },
            together: moving.together,
        }),
        clips,
        ..RawModel::default()
    };
    for note in file.notes {
        model.notes.add_of(path, note);
    }
    Ok(model)
}
