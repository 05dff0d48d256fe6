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

use glam::{DMat4, DVec3};

use super::error::SceneError;
use super::mesh_file::{LoadedMesh, Normals, Up};
use crate::geometry::mesh::{Mesh, RawLooks};
use crate::light::material::{Coverage, Material};
use file::GltfFile;
use primitives::Builder;

/// Whether bytes may be a glTF file: binary, or JSON.
pub fn is_gltf(path: &Path, bytes: &[u8]) -> bool {
    let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
    bytes.starts_with(b"glTF") || extension == "gltf" || extension == "glb"
}

/// Reads a file's default scene; `note_read` is told of every file that is looked for besides.
///
/// # Errors
/// What the file lacks or has wrong, with the place in it.
pub(super) fn load(
    path: &Path,
    bytes: &[u8],
    (normals, up): (Normals, Up),
    note_read: &dyn Fn(&Path),
) -> Result<LoadedMesh, SceneError> {
    if bytes.is_empty() {
        return Err(SceneError::of_file(
            path,
            "the file is empty; a glTF model is expected",
        ));
    }
    let mut file = GltfFile::read(path, bytes, note_read)?;
    let document = file.document.clone();
    let nodes = nodes::placed(&file, &document)?;
    let mut builder = Builder::new(normals);
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
    let file_up = match up {
        Up::Y => DMat4::from_cols(
            DVec3::X.extend(0.0),
            DVec3::Z.extend(0.0),
            DVec3::NEG_Y.extend(0.0),
            DVec3::ZERO.extend(1.0),
        ),
        Up::Z => DMat4::IDENTITY,
    };
    builder.turn(file_up);
    let looks = match builder.needs_looks {
        true => builder.looks,
        false => RawLooks::default(),
    };
    let crease_rad = match normals {
        Normals::Flat => 0.0,
        Normals::GivenOrMade { crease_rad } => crease_rad,
    };
    let (mesh, report) =
        Mesh::weld_with_looks(&builder.positions, &builder.triangles, &looks, crease_rad);
    if mesh.triangles.is_empty() {
        return Err(SceneError::of_file(path, "no triangle has an area"));
    }
    note_coverage(&mut file, &builder.materials, normals);
    Ok(LoadedMesh {
        mesh,
        report,
        is_given: builder.is_given,
        materials: builder.materials,
        textures: builder.textures.kept,
        notes: file.notes,
    })
}

/// Tells what becomes of materials that are not opaque.
fn note_coverage(file: &mut GltfFile<'_>, materials: &[Material], normals: Normals) {
    let is_blended = |material: &Material| material.coverage == Coverage::Blend;
    let is_masked = |material: &Material| matches!(material.coverage, Coverage::Mask { .. });
    let is_phantom = normals == Normals::Flat;
    if materials.iter().any(is_blended) {
        file.note(
            match is_phantom {
                true => {
                    "what is half transparent hides as if it were opaque: a phantom is there or not"
                }
                false => {
                    "what is half transparent is drawn, and casts its shadow, as if it were opaque"
                }
            }
            .to_owned(),
        );
    }
    if materials.iter().any(is_masked) {
        file.note(
            match is_phantom {
                true => {
                    "alphaMode MASK is passed over: a phantom is there with its whole triangles"
                }
                false => {
                    "what alphaMode MASK cuts out still casts the shadow of its whole triangles"
                }
            }
            .to_owned(),
        );
    }
}
