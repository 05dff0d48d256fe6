//! Pictures of a glTF file, decoded when a material asks for them, each once.

use std::collections::HashMap;
use std::path::Path;

use glam::{Affine2, Vec2};
use gltf::texture::{MagFilter, WrappingMode};
use serde_json::Value;

use super::file::GltfFile;
use crate::light::material::{Filter, Map, Wrap};
use crate::light::texture::Texture;
use crate::scene::error::SceneError;
use crate::scene::kept_pictures::KeptPictures;
use crate::scene::texture_file;

/// What was decoded so far.
#[derive(Default)]
pub(super) struct Textures {
    pub kept: KeptPictures,
    /// By the image's number; `None` for one that is passed over.
    index_of_image: HashMap<usize, Option<u32>>,
    /// Pictures that were made of others, by all that they were made of.
    pub converted: HashMap<String, Option<[u32; 2]>>,
}

/// Which of a material's texture coordinates a texture lies by, and its KHR_texture_transform.
pub(super) type Laid<'a> = (u32, Option<&'a Value>);

impl Textures {
    /// A texture as a material uses it; `None` where it has no picture that is read.
    pub fn map(
        &mut self,
        file: &mut GltfFile<'_>,
        texture: &gltf::Texture<'_>,
        laid: Laid<'_>,
        note_read: &dyn Fn(&Path),
    ) -> Result<Option<Map>, SceneError> {
        let Some(image) = image_of(file, texture) else {
            return Ok(None);
        };
        let index = match self.index_of_image.get(&image) {
            Some(known) => *known,
            None => {
                let decoded = decoded(file, &place_of(texture), image, note_read)?;
                let index = decoded.map(|picture| self.kept.keep(picture));
                self.index_of_image.insert(image, index);
                index
            }
        };
        Ok(index.map(|index| placed(file, texture, laid, index)))
    }
}

/// A texture's picture, which is not kept; `None` where it has none that is read.
pub(super) fn picture(
    file: &mut GltfFile<'_>,
    texture: &gltf::Texture<'_>,
    note_read: &dyn Fn(&Path),
) -> Result<Option<Texture>, SceneError> {
    match image_of(file, texture) {
        Some(image) => decoded(file, &place_of(texture), image, note_read),
        None => Ok(None),
    }
}

fn place_of(texture: &gltf::Texture<'_>) -> String {
    format!("textures[{}]", texture.index())
}

/// The number of a texture's image; where there is none that is told.
pub(super) fn image_of(file: &mut GltfFile<'_>, texture: &gltf::Texture<'_>) -> Option<usize> {
    let webp = texture
        .extension_value("EXT_texture_webp")
        .and_then(|webp| webp.get("source")?.as_u64());
    let image = webp
        .map(|image| image as usize)
        .or_else(|| Some(texture.source()?.index()));
    if image.is_none() {
        file.note(format!(
            "{} has no picture that is read (PNG, JPEG, WebP) and is left out",
            place_of(texture)
        ));
    }
    image
}

/// A kept picture as a texture lays it.
pub(super) fn placed(
    file: &mut GltfFile<'_>,
    texture: &gltf::Texture<'_>,
    (uv_set, extension): Laid<'_>,
    index: u32,
) -> Map {
    let transform = extension.map(Transform::of).unwrap_or_default();
    let mut uv_set = transform.uv_set.unwrap_or(uv_set);
    if uv_set > 1 {
        file.note(format!(
            "TEXCOORD_{uv_set} is not read; TEXCOORD_0 stands for it"
        ));
        uv_set = 0;
    }
    let sampler = texture.sampler();
    let wrap = |mode| match mode {
        WrappingMode::Repeat => Wrap::Repeat,
        WrappingMode::MirroredRepeat => Wrap::Mirror,
        WrappingMode::ClampToEdge => Wrap::Clamp,
    };
    Map {
        texture: index,
        uv_set,
        picture_from_corner: transform.picture_from_corner,
        wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
        filter: match sampler.mag_filter() {
            Some(MagFilter::Nearest) => Filter::Pixels,
            Some(MagFilter::Linear) | None => Filter::Smooth,
        },
    }
}

/// The transform of a texture's use, which the crate has taken out of the extensions.
pub(super) fn transform_of(info: &gltf::texture::Info<'_>) -> Option<serde_json::Value> {
    let transform = info.texture_transform()?;
    Some(serde_json::json!({
        "offset": transform.offset(),
        "rotation": transform.rotation(),
        "scale": transform.scale(),
        "texCoord": transform.tex_coord(),
    }))
}

/// KHR_texture_transform.
struct Transform {
    picture_from_corner: Affine2,
    uv_set: Option<u32>,
}

impl Default for Transform {
    fn default() -> Self {
        Self {
            picture_from_corner: Affine2::IDENTITY,
            uv_set: None,
        }
    }
}

impl Transform {
    fn of(extension: &Value) -> Self {
        let pair = |name: &str, missing: f32| {
            let number = |index: usize| Some(extension.get(name)?.get(index)?.as_f64()? as f32);
            Vec2::new(number(0).unwrap_or(missing), number(1).unwrap_or(missing))
        };
        let rotation = extension
            .get("rotation")
            .and_then(Value::as_f64)
            .unwrap_or(0.0);
        // Counter-clockwise in coordinates whose v grows downwards.
        let turned = Affine2::from_angle(-rotation as f32);
        let found = Affine2::from_translation(pair("offset", 0.0))
            * turned
            * Affine2::from_scale(pair("scale", 1.0));
        Self {
            picture_from_corner: if found.is_finite() {
                found
            } else {
                Affine2::IDENTITY
            },
            uv_set: extension
                .get("texCoord")
                .and_then(Value::as_u64)
                .map(|set| set as u32),
        }
    }
}

/// A picture; `None` where it is not there or cannot be read, which leaves its surface without it and is told.
fn decoded(
    file: &mut GltfFile<'_>,
    asked_by: &str,
    image: usize,
    note_read: &dyn Fn(&Path),
) -> Result<Option<Texture>, SceneError> {
    let place = format!("images[{image}]");
    let document = file.document.clone();
    let Some(json) = document.as_json().images.get(image) else {
        return Err(file.error(asked_by, format!("there is no {place}")));
    };
    let name = [
        json.name.clone(),
        json.uri.clone().filter(|uri| !uri.starts_with("data:")),
    ];
    let name = name.into_iter().flatten().find(|name| !name.is_empty());
    let name = name.unwrap_or_else(|| place.clone());
    let view = json
        .buffer_view
        .and_then(|view| document.views().nth(view.value()));
    let read = match (view, &json.uri) {
        (Some(view), _) => texture_file::decode(name.clone(), file.view(&place, &view)?, None),
        (None, Some(uri)) => match file.resource(&place, uri, note_read) {
            Ok(bytes) => texture_file::decode(name.clone(), &bytes, format_of_name(uri)),
            Err(error) => {
                file.note(format!("{}; not used", error.message));
                return Ok(None);
            }
        },
        (None, None) => return Err(file.error(&place, "neither bufferView nor uri")),
    };
    match read {
        Ok(texture) => Ok(Some(texture)),
        Err(message) => {
            file.note(format!("{place}: \"{name}\" {message}; not used"));
            Ok(None)
        }
    }
}

/// What a file's name says of it, where its bytes do not tell (TGA).
fn format_of_name(uri: &str) -> Option<image::ImageFormat> {
    let is_data = uri.starts_with("data:");
    (!is_data)
        .then(|| image::ImageFormat::from_path(uri).ok())
        .flatten()
}
