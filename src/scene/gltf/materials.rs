//! Materials of a glTF file: metallic-roughness, and what of the extensions is that in other words.

use std::path::Path;

use glam::DVec3;
use gltf::material::{AlphaMode, PbrSpecularGlossiness};

use super::file::GltfFile;
use super::textures::Textures;
use crate::light::Material;
use crate::light::material::{Coverage, Maps, Shading};
use crate::scene::error::SceneError;
use crate::scene::raw_model::{GivenMaterial, LEAST_ROUGHNESS};

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
        specular_glossiness(file, textures, &mut material, (&specular, note_read))?;
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

/// The transform of a texture's use, which the crate has taken out of the extensions.
fn transform_of(info: &gltf::texture::Info<'_>) -> Option<serde_json::Value> {
    let transform = info.texture_transform()?;
    Some(serde_json::json!({
        "offset": transform.offset(),
        "rotation": transform.rotation(),
        "scale": transform.scale(),
        "texCoord": transform.tex_coord(),
    }))
}

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

/// GGX's α of a file's roughness, which is its root.
fn alpha(roughness: f64) -> f64 {
    (roughness * roughness).clamp(LEAST_ROUGHNESS, 1.0)
}

/// Says specular and glossiness as metal and roughness, as far as that goes: the split that Khronos's own converter makes
/// (KHR_materials_pbrSpecularGlossiness, appendix).
fn specular_glossiness(
    file: &mut GltfFile<'_>,
    textures: &mut Textures,
    material: &mut Material,
    (given, note_read): (&PbrSpecularGlossiness<'_>, &dyn Fn(&Path)),
) -> Result<(), SceneError> {
    /// Of a dielectric.
    const F0: f64 = 0.04;
    let [red, green, blue, opacity] = given.diffuse_factor().map(f64::from);
    let diffuse = DVec3::new(red, green, blue).clamp(DVec3::ZERO, DVec3::ONE);
    let specular = DVec3::from_array(given.specular_factor().map(f64::from));
    let specular = specular.clamp(DVec3::ZERO, DVec3::ONE);
    let brightness = |color: DVec3| (color * color).dot(DVec3::new(0.299, 0.587, 0.114)).sqrt();
    let left = 1.0 - specular.max_element();
    let (of_diffuse, of_specular) = (brightness(diffuse), brightness(specular));
    let metallic = match of_specular < F0 {
        true => 0.0,
        false => {
            let b = of_diffuse * left / (1.0 - F0) + of_specular - 2.0 * F0;
            let c = F0 - of_specular;
            ((-b + (b * b - 4.0 * F0 * c).max(0.0).sqrt()) / (2.0 * F0)).clamp(0.0, 1.0)
        }
    };
    let from_diffuse = diffuse * left / (1.0 - F0) / (1.0 - metallic).max(1e-6);
    let from_specular = (specular - F0 * (1.0 - metallic)) / metallic.max(1e-6);
    let albedo = from_diffuse.lerp(from_specular, metallic * metallic);
    material.albedo = albedo.clamp(DVec3::ZERO, DVec3::ONE);
    material.metallic = metallic;
    material.opacity = opacity.clamp(0.0, 1.0);
    material.roughness = Some(alpha(1.0 - f64::from(given.glossiness_factor())));
    material.maps.color = None;
    material.maps.roughness = None;
    material.maps.metallic = None;
    if let Some(info) = given.diffuse_texture() {
        let transform = transform_of(&info);
        let at = (info.tex_coord(), transform.as_ref());
        material.maps.color = textures.map(file, &info.texture(), at, note_read)?;
    }
    if given.specular_glossiness_texture().is_some() {
        file.note("specularGlossinessTexture is passed over; its factors stand for it".to_owned());
    }
    Ok(())
}
