//! `albedo_texture`: a picture that the scene itself lays on a thing.

use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};

use super::error::SceneError;
use super::mesh_file::LoadedMesh;
use super::named_files::FileKind;
use super::reader::Value;
use super::shapes::ShapeKind;
use super::texture_file;
use crate::geometry::mesh::{CornerLook, Mesh};
use crate::light::Material;
use crate::light::material::{Map, Wrap};
use crate::light::texture::Texture;

/// What a picture is laid on.
pub struct Laid<'a> {
    shape: ShapeKind,
    mesh: &'a mut Mesh,
    materials: &'a mut [Material],
    textures: &'a mut Vec<Arc<Texture>>,
}

impl<'a> Laid<'a> {
    /// A thing of a shape, as it was read.
    pub fn on(shape: ShapeKind, loaded: &'a mut LoadedMesh) -> Self {
        Self {
            shape,
            mesh: Arc::make_mut(&mut loaded.mesh),
            materials: &mut loaded.materials,
            textures: &mut loaded.textures,
        }
    }

    /// Has a picture say the colour of all of it, in the place of what its file says; `is_white`: by the picture alone.
    ///
    /// # Errors
    /// A file that is not there or is no picture; a shape on which nothing says where the picture lies.
    pub fn lay(self, picture: &Value, is_white: bool) -> Result<(), SceneError> {
        let path = picture.existing_path(FileKind::Picture)?;
        let texture = read(picture, &path)?;
        let mut map = Map::of(self.textures.len() as u32);
        if self.shape == ShapeKind::Rectangle {
            // (Nothing of one edge bleeds into the other.)
            map.wrap = [Wrap::Clamp; 2];
            spread_over(self.mesh);
        } else if !has_coordinates(self.mesh) {
            let what = match self.shape {
                ShapeKind::Mesh => "the mesh has no texture coordinates".to_owned(),
                other => format!("a {} has no texture coordinates", other.name()),
            };
            return Err(picture.error(format!(
                "{what}; allowed: the table, rect_m, and meshes with texture coordinates"
            )));
        }
        self.textures.push(texture);
        for material in self.materials {
            material.maps.color = Some(map);
            if is_white {
                material.albedo = DVec3::ONE;
            }
        }
        for look in &mut self.mesh.looks {
            look.color = Vec3::ONE.extend(look.color.w);
        }
        Ok(())
    }
}

/// The picture of a file; where models are kept it is read once.
fn read(value: &Value, path: &Path) -> Result<Arc<Texture>, SceneError> {
    let read = || {
        let texture = texture_file::read(path);
        texture.map_err(|message| {
            value.error_without_value(format!("albedo_texture: {} {message}", path.display()))
        })
    };
    let Some(kept) = value.models() else {
        return read().map(Arc::new);
    };
    if let Some((texture, _)) = kept.get::<Texture>(path, PICTURE) {
        return Ok(texture);
    }
    kept.keep(path, PICTURE, || Ok((read()?, Vec::new())))
}

/// How a picture that is kept was read.
const PICTURE: &str = "picture";

fn has_coordinates(mesh: &Mesh) -> bool {
    let first = mesh.looks.first().map(|look| look.uv);
    mesh.looks.iter().any(|look| Some(look.uv) != first)
}

/// Lays the whole of a picture over a flat mesh, its upper edge towards +y.
fn spread_over(mesh: &mut Mesh) {
    let places = || mesh.positions.iter().map(|place| place.truncate());
    let low = places().fold(Vec2::MAX, Vec2::min);
    let high = places().fold(Vec2::MIN, Vec2::max);
    let looks = places().map(|place| {
        let part = (place - low) / (high - low);
        CornerLook {
            uv: [Vec2::new(part.x, 1.0 - part.y); 2],
            ..CornerLook::default()
        }
    });
    mesh.looks = looks.collect();
    mesh.corner_looks.clone_from(&mesh.triangles);
}
