//! MTL materials as the renderer knows materials.

use std::path::{Path, PathBuf};

use glam::{Affine2, DVec3, Mat2, Vec2};

use super::super::kept_pictures::KeptPictures;
use super::super::notes::Notes;
use super::super::raw_model::{DEFAULT_ALBEDO, GivenMaterial, LEAST_ROUGHNESS};
use super::super::texture_file;
use super::files::named_file;
use super::mtl::{MapRole, MtlMap, MtlMaterial};
use crate::light::Material;
use crate::light::material::{Coverage, Map, Shading, Wrap};
use crate::light::texture::Texture;

/// Makes materials of what MTL files say, and reads each picture once.
#[derive(Debug, Default)]
pub struct Converter {
    /// What the materials' maps name.
    pub pictures: KeptPictures,
    /// Where each of them comes from.
    keys: Vec<PictureKey>,
    /// What could not be read.
    unread: Vec<PathBuf>,
}

/// The file of a picture, and the file that its opacity comes from.
type PictureKey = (PathBuf, Option<PathBuf>);

/// Where a library is, and its text.
type Library<'a> = (&'a Path, &'a str);

impl Converter {
    /// The material that an MTL file describes. Its gloss comes from `Pr` (squared, as is usual) or else from `Ns`, unless
    /// `Ks` is black: roughness² = 2 / (Ns + 2), which gives Blinn's lobe and GGX's the same width.
    pub fn material(
        &mut self,
        mtl: MtlMaterial,
        library: Library,
        notes: &mut Notes,
        note_read: &dyn Fn(&Path),
    ) -> GivenMaterial {
        let mut material = Material::matt(DVec3::splat(DEFAULT_ALBEDO));
        let is_given = mtl.diffuse.is_some();
        if let Some(diffuse) = mtl.diffuse {
            material.albedo = DVec3::from_array(diffuse);
        }
        material.metallic = mtl.metallic.unwrap_or(0.0);
        material.emission = DVec3::from_array(mtl.emission.unwrap_or_default());
        material.roughness = roughness(&mtl);
        if mtl.roughness.is_some() || mtl.metallic.is_some() {
            material.shading = Shading::Principled;
        }
        if let Some(opacity) = mtl.opacity.filter(|opacity| *opacity < 1.0) {
            material.opacity = opacity;
            material.coverage = Coverage::Blend;
            if opacity == 0.0 {
                let message = format!("\"{}\" lets all light through: it is not seen", mtl.name);
                notes.add_at(library.0, library.1, mtl.opacity_at, message);
            }
        }
        let mut has_picture = false;
        for map in &mtl.maps {
            let found = self.map(map, &mtl, library, notes, note_read);
            if let Some(found) = found {
                has_picture |= map.role == MapRole::Diffuse;
                set_map(&mut material, map, &mtl, found);
            }
        }
        if let Some(color) = material.maps.color
            && let Some((at, message)) = self.cover(&mut material, color, &mtl)
        {
            notes.add_at(library.0, library.1, at, message);
        }
        GivenMaterial {
            name: mtl.name,
            material,
            is_given: is_given || has_picture,
        }
    }

    /// The picture of a map where it is there and of use.
    fn map(
        &mut self,
        map: &MtlMap,
        mtl: &MtlMaterial,
        (library, text): Library,
        notes: &mut Notes,
        note_read: &dyn Fn(&Path),
    ) -> Option<Map> {
        let folder = library.parent().unwrap_or(Path::new(""));
        let written = text.get(map.at..).unwrap_or_default();
        let keyword = written.split_whitespace().next().unwrap_or_default();
        let Some(path) = named_file(folder, &map.file) else {
            note_read(&folder.join(&map.file));
            let message = format!("{keyword}: no such file as \"{}\"; not used", map.file);
            notes.add_at(library, text, map.at, message);
            return None;
        };
        note_read(&path);
        // Opacity lies in the colours' picture.
        let has_colors = mtl.maps.iter().any(|map| map.role == MapRole::Diffuse);
        if map.role == MapRole::Opacity && has_colors {
            return None;
        }
        let opacity = mtl.maps.iter().find(|map| map.role == MapRole::Opacity);
        let opacity = opacity
            .filter(|_| matches!(map.role, MapRole::Diffuse | MapRole::Opacity))
            .and_then(|opacity| named_file(folder, &opacity.file))
            // (Exporters that name the colours' picture here mean its alpha.)
            .filter(|opacity| map.role == MapRole::Opacity || *opacity != path);
        let texture = match self.texture(&path, opacity.as_deref(), map.role) {
            Ok(texture) => texture?,
            Err(message) => {
                let message = format!("{keyword}: {} {message}; not used", path.display());
                notes.add_at(library, text, map.at, message);
                return None;
            }
        };
        if map.role == MapRole::Bump && !is_of_normals(self.pictures.picture(texture)) {
            let message =
                format!("{keyword}: a picture of heights is not used; allowed: of normals");
            notes.add_at(library, text, map.at, message);
            return None;
        }
        Some(placed(map, texture))
    }

    /// The index of a picture, which is read unless it is known; `None` where it was found unreadable before.
    fn texture(
        &mut self,
        path: &Path,
        opacity: Option<&Path>,
        role: MapRole,
    ) -> Result<Option<u32>, String> {
        let key = (path.to_owned(), opacity.map(Path::to_owned));
        if let Some(known) = self.keys.iter().position(|known| *known == key) {
            return Ok(Some(known as u32));
        }
        if self.unread.iter().any(|unread| unread == path) {
            return Ok(None);
        }
        let read = |path: &Path| texture_file::read(path);
        let texture = read(path).and_then(|texture| match opacity {
            Some(opacity) => Ok(with_opacity(texture, &read(opacity)?, role)),
            None => Ok(texture),
        });
        match texture {
            Ok(texture) => {
                self.keys.push(key);
                Ok(Some(self.pictures.keep(texture)))
            }
            Err(message) => {
                self.unread.push(path.to_owned());
                Err(message)
            }
        }
    }

    /// How a material is covered whose picture has opacity: alpha counts only where `map_d` says so. What there is to say of that,
    /// and the byte of the library's text.
    fn cover(
        &self,
        material: &mut Material,
        color: Map,
        mtl: &MtlMaterial,
    ) -> Option<(usize, String)> {
        let of_role = |role| mtl.maps.iter().find(|map| map.role == role);
        let opacity = of_role(MapRole::Opacity)?;
        let texture = self.pictures.picture(color.texture);
        let alphas = || texture.rgba.iter().skip(3).step_by(4);
        if alphas().all(|alpha| *alpha == 255) {
            let is_same = of_role(MapRole::Diffuse).is_some_and(|map| map.file == opacity.file);
            let message = "map_d: the picture of the colours, which has no alpha; taken for opaque";
            return is_same.then(|| (opacity.at, message.to_owned()));
        }
        if material.coverage == Coverage::Blend {
            return None;
        }
        let between = alphas().filter(|alpha| (16..240).contains(*alpha)).count();
        // A picture of leaves has edges alone between what is there and what is not.
        material.coverage = match between * 10 < alphas().count() {
            true => Coverage::Mask { cutoff: 0.5 },
            false => Coverage::Blend,
        };
        None
    }
}

fn roughness(mtl: &MtlMaterial) -> Option<f64> {
    let is_shiny = mtl
        .specular
        .is_none_or(|specular| specular.iter().any(|part| *part > 0.0));
    let of_shininess = mtl
        .shininess
        .filter(|_| is_shiny)
        .map(|shininess| (2.0 / (shininess + 2.0)).sqrt());
    let roughness = mtl.roughness.map(|roughness| roughness * roughness);
    let roughness = roughness.or(of_shininess);
    roughness.map(|roughness| roughness.clamp(LEAST_ROUGHNESS, 1.0))
}

/// Without a number of its own a picture says all.
fn set_map(material: &mut Material, written: &MtlMap, mtl: &MtlMaterial, map: Map) {
    let maps = &mut material.maps;
    match written.role {
        MapRole::Diffuse | MapRole::Opacity => {
            maps.color = Some(map);
            // Some programs write black beside a picture, and mean the picture.
            let is_black = mtl.diffuse.is_none_or(|diffuse| diffuse == [0.0; 3]);
            if written.role == MapRole::Diffuse && is_black {
                material.albedo = DVec3::ONE;
            }
        }
        MapRole::Roughness => {
            maps.roughness = Some(map);
            material.shading = Shading::Principled;
            if mtl.roughness.is_none_or(|roughness| roughness == 0.0) {
                material.roughness = Some(1.0);
            }
        }
        MapRole::Metallic => {
            maps.metallic = Some(map);
            material.shading = Shading::Principled;
            if mtl.metallic.is_none_or(|metallic| metallic == 0.0) {
                material.metallic = 1.0;
            }
        }
        MapRole::Normal | MapRole::Bump => {
            maps.normal = Some(map);
            maps.normal_scale = written.multiplier;
        }
        MapRole::Emission => {
            maps.emission = Some(map);
            if mtl.emission.is_none_or(|emission| emission == [0.0; 3]) {
                material.emission = DVec3::ONE;
            }
        }
        MapRole::Occlusion => maps.occlusion = Some(map),
    }
}

/// A picture as `-s` and `-o` lay it: they count v upwards, corners and pictures downwards.
fn placed(map: &MtlMap, texture: u32) -> Map {
    let [scale_u, scale_v] = map.scale.map(|part| part as f32);
    let [offset_u, offset_v] = map.offset.map(|part| part as f32);
    let wrap = if map.is_clamped {
        Wrap::Clamp
    } else {
        Wrap::Repeat
    };
    Map {
        picture_from_corner: Affine2::from_mat2_translation(
            Mat2::from_diagonal(Vec2::new(scale_u, scale_v)),
            Vec2::new(offset_u, 1.0 - scale_v - offset_v),
        ),
        wrap: [wrap; 2],
        ..Map::of(texture)
    }
}

/// Whether a picture is of normals rather than heights: it is bluish, since most of them point outwards.
fn is_of_normals(texture: &Texture) -> bool {
    let mut sums = [0_u64; 3];
    for texel in texture.rgba.chunks_exact(4) {
        for (sum, part) in sums.iter_mut().zip(texel) {
            *sum += u64::from(*part);
        }
    }
    let texels = (texture.rgba.len() / 4).max(1) as u64;
    let [red, green, blue] = sums.map(|sum| sum / texels);
    blue > 160 && blue > red + 32 && blue > green + 32
}

/// A picture with the opacity that another one's grey gives, or its alpha where that says something. Of a picture that is of
/// opacity alone the colours are white.
fn with_opacity(mut texture: Texture, opacity: &Texture, role: MapRole) -> Texture {
    let has_alpha = opacity.rgba.chunks_exact(4).any(|texel| texel[3] < 255);
    let [width, height] = texture.size_px;
    let [from_width, from_height] = opacity.size_px.map(u64::from);
    for row in 0..height {
        for column in 0..width {
            let from_column = u64::from(column) * from_width / u64::from(width);
            let from_row = u64::from(row) * from_height / u64::from(height);
            let from = 4 * (from_row * from_width + from_column) as usize;
            let to = 4 * (row as usize * width as usize + column as usize);
            let alpha = match has_alpha {
                true => opacity.rgba[from + 3],
                false => {
                    let sum: u32 = opacity.rgba[from..from + 3]
                        .iter()
                        .copied()
                        .map(u32::from)
                        .sum();
                    (sum / 3) as u8
                }
            };
            if role == MapRole::Opacity {
                texture.rgba[to..to + 3].fill(255);
            }
            texture.rgba[to + 3] = alpha;
        }
    }
    texture
}
