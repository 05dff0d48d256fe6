//! Pictures of a glTF file, decoded when a material asks for them, each once.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{Affine2, Vec2};
use gltf::texture::{MagFilter, WrappingMode};
use serde_json::Value;

use super::file::GltfFile;
use crate::light::material::{Filter, Map, Wrap};
use crate::light::texture::Texture;
use crate::scene::error::SceneError;
use crate::scene::texture_file;

/// Memory that all pictures of a file may take, bytes.
const MOST_BYTES: usize = 1 << 30;

/// What was decoded so far.
#[derive(Default)]
pub(super) struct Textures {
    pub kept: Vec<Arc<Texture>>,
    /// By the image's number; `None` for one that is passed over.
    index_of_image: HashMap<usize, Option<u32>>,
}

impl Textures {
    /// A texture as a material uses it; `None` where it has no picture that is read. `extension` is its
    /// KHR_texture_transform.
    pub fn map(
        &mut self,
        file: &mut GltfFile<'_>,
        texture: &gltf::Texture<'_>,
        (uv_set, extension): (u32, Option<&Value>),
        note_read: &dyn Fn(&Path),
    ) -> Result<Option<Map>, SceneError> {
        let webp = texture
            .extension_value("EXT_texture_webp")
            .and_then(|webp| webp.get("source")?.as_u64());
        let image = webp
            .map(|image| image as usize)
            .or_else(|| Some(texture.source()?.index()));
        let place = format!("textures[{}]", texture.index());
        let Some(image) = image else {
            file.note(format!(
                "{place} has no picture that is read (PNG, JPEG, WebP) and is left out"
            ));
            return Ok(None);
        };
        let known = self.index_of_image.get(&image).copied();
        let index = match known {
            Some(index) => index,
            None => self.kept_picture(file, &place, image, note_read)?,
        };
        let Some(index) = index else { return Ok(None) };
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
        Ok(Some(Map {
            texture: index,
            uv_set,
            picture_from_corner: transform.picture_from_corner,
            wrap: [wrap(sampler.wrap_s()), wrap(sampler.wrap_t())],
            filter: match sampler.mag_filter() {
                Some(MagFilter::Nearest) => Filter::Pixels,
                Some(MagFilter::Linear) | None => Filter::Smooth,
            },
        }))
    }
}

impl Textures {
    /// Decodes a picture and keeps it; `None` where that is told as not to be used.
    fn kept_picture(
        &mut self,
        file: &mut GltfFile<'_>,
        place: &str,
        image: usize,
        note_read: &dyn Fn(&Path),
    ) -> Result<Option<u32>, SceneError> {
        let Some(decoded) = decoded(file, place, image, note_read)? else {
            self.index_of_image.insert(image, None);
            return Ok(None);
        };
        let bytes: usize = self.kept.iter().map(|texture| texture.bytes()).sum();
        if bytes + decoded.bytes() > MOST_BYTES {
            let message = format!("the pictures take more than {MOST_BYTES} bytes of memory");
            return Err(file.error(place, message));
        }
        let index = self.kept.len() as u32;
        self.kept.push(Arc::new(decoded));
        self.index_of_image.insert(image, Some(index));
        Ok(Some(index))
    }
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
