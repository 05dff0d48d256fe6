//! Materials of a glTF file: metallic-roughness, and what of the extensions is that in other words.

use std::path::Path;

use glam::DVec3;
use gltf::material::AlphaMode;

use super::file::GltfFile;
use super::specular_glossiness;
use super::textures::{Textures, transform_of};
use crate::light::Material;
use crate::light::material::{Coverage, Maps, Shading};
use crate::scene::error::SceneError;
use crate::scene::raw_model::{GivenMaterial, alpha};

/// Most that one channel of emission may be; what is above would be no number in the picture's sums.
const MOST_EMISSION: f64 = 1e6;

/// A material as surfaces have it. Where the file has none it is white or grey and matt; `is_colored` tells that corners have
/// colours.
pub(super) fn material(
    file: &mut GltfFile<'_>,
    textures: &mut Textures,
    given: &gltf::Material<'_>,
    (is_colored, note_read): (bool, &dyn Fn(&Path)),
) -> Result<GivenMaterial, SceneError> {
    let Some(index) = given.index() else {
        return Ok(GivenMaterial::unknown(is_colored));
    };
    let place = format!("materials[{index}]");
    let mut material = metallic_roughness(file, textures, given, note_read)?;
    if let Some(specular) = given.pbr_specular_glossiness() {
        let given = (&specular, note_read);
        specular_glossiness::convert(file, textures, &mut material, given)?;
    }
    material.coverage = match given.alpha_mode() {
        AlphaMode::Opaque => Coverage::Opaque,
        AlphaMode::Mask => Coverage::Mask {
            cutoff: f64::from(given.alpha_cutoff().unwrap_or(0.5)),
        },
        AlphaMode::Blend => Coverage::Blend,
    };
    material.shading = match given.unlit() {
        true => Shading::Unlit,
        false => Shading::Principled,
    };
    let emission = DVec3::from_array(given.emissive_factor().map(f64::from))
        * f64::from(given.emissive_strength().unwrap_or(1.0));
    material.emission = emission.clamp(DVec3::ZERO, DVec3::splat(MOST_EMISSION));
    if let Some(info) = given.emissive_texture()
        && material.emission != DVec3::ZERO
    {
        let at = (info.tex_coord(), info.extension_value(TRANSFORM));
        let transform = transform_of(&info);
        material.maps.emission = textures.map(
            file,
            &info.texture(),
            (at.0, transform.as_ref().or(at.1)),
            note_read,
        )?;
    }
    if let Some(normal) = given.normal_texture() {
        let at = (normal.tex_coord(), normal.extension_value(TRANSFORM));
        material.maps.normal = textures.map(file, &normal.texture(), at, note_read)?;
        material.maps.normal_scale = f64::from(normal.scale());
    }
    if let Some(occlusion) = given.occlusion_texture() {
        let at = (occlusion.tex_coord(), occlusion.extension_value(TRANSFORM));
        material.maps.occlusion = textures.map(file, &occlusion.texture(), at, note_read)?;
        material.maps.occlusion_strength = f64::from(occlusion.strength()).clamp(0.0, 1.0);
    }
    let numbers = [
        material.albedo.x + material.albedo.y + material.albedo.z,
        material.metallic,
        material.opacity,
        material.maps.normal_scale,
    ];
    match numbers.iter().all(|number| number.is_finite()) {
        true => Ok(GivenMaterial {
            name: given.name().unwrap_or_default().to_owned(),
            material,
            is_given: true,
        }),
        false => Err(file.error(&place, "a factor is not finite")),
    }
}

const TRANSFORM: &str = "KHR_texture_transform";

fn metallic_roughness(
    file: &mut GltfFile<'_>,
    textures: &mut Textures,
    given: &gltf::Material<'_>,
    note_read: &dyn Fn(&Path),
) -> Result<Material, SceneError> {
    let pbr = given.pbr_metallic_roughness();
    let [red, green, blue, opacity] = pbr.base_color_factor().map(f64::from);
    let mut maps = Maps::NONE;
    let mut map = |info: &gltf::texture::Info<'_>| {
        let transform = transform_of(info);
        let at = (info.tex_coord(), transform.as_ref());
        textures.map(file, &info.texture(), at, note_read)
    };
    if let Some(info) = pbr.base_color_texture() {
        maps.color = map(&info)?;
    }
    let metallic = f64::from(pbr.metallic_factor()).clamp(0.0, 1.0);
    if let Some(info) = pbr.metallic_roughness_texture() {
        maps.roughness = map(&info)?;
        maps.metallic = maps.roughness.filter(|_| metallic > 0.0);
    }
    Ok(Material {
        metallic,
        roughness: Some(alpha(f64::from(pbr.roughness_factor()))),
        opacity: opacity.clamp(0.0, 1.0),
        maps,
        ..Material::matt(DVec3::new(red, green, blue).clamp(DVec3::ZERO, DVec3::ONE))
    })
}
