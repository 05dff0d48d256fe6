//! KHR_materials_pbrSpecularGlossiness said as metal and roughness, as Khronos's own converter does (the extension's appendix):
//! by the factors, or texel by texel where pictures say it.

use std::path::Path;

use glam::DVec3;
use gltf::material::PbrSpecularGlossiness;

use super::file::GltfFile;
use super::textures::{Textures, image_of, picture, placed, transform_of};
use crate::light::Material;
use crate::light::material::Map;
use crate::light::srgb::{linear_from_srgb, srgb_from_linear};
use crate::light::texture::Texture;
use crate::scene::error::SceneError;
use crate::scene::raw_model::alpha;
use crate::scene::texture_file::resized;

/// Head-on reflectance of a dielectric.
const F0: f64 = 0.04;

/// What the extension multiplies its pictures with.
#[derive(Debug)]
struct Factors {
    diffuse: DVec3,
    specular: DVec3,
    glossiness: f64,
}

/// A picture that the extension asks for.
struct Asked<'a> {
    texture: gltf::Texture<'a>,
    image: Option<usize>,
    /// How it lies; the number of its picture counts for nothing.
    map: Map,
}

/// The picture of diffuse, and that of specular and glossiness.
type AskedPictures<'a> = [Option<Asked<'a>>; 2];

/// Has specular and glossiness say what a material is made of, whatever it was before.
pub(super) fn convert(
    file: &mut GltfFile<'_>,
    textures: &mut Textures,
    material: &mut Material,
    (given, note_read): (&PbrSpecularGlossiness<'_>, &dyn Fn(&Path)),
) -> Result<(), SceneError> {
    let [red, green, blue, opacity] = given.diffuse_factor().map(f64::from);
    let part = |color: DVec3| color.clamp(DVec3::ZERO, DVec3::ONE);
    let factors = Factors {
        diffuse: part(DVec3::new(red, green, blue)),
        specular: part(DVec3::from_array(given.specular_factor().map(f64::from))),
        glossiness: f64::from(given.glossiness_factor()).clamp(0.0, 1.0),
    };
    (material.albedo, material.metallic) = split(factors.diffuse, factors.specular);
    material.opacity = opacity.clamp(0.0, 1.0);
    material.roughness = Some(alpha(1.0 - factors.glossiness));
    material.maps.color = None;
    material.maps.roughness = None;
    material.maps.metallic = None;
    let diffuse = given.diffuse_texture();
    let layer = given.specular_glossiness_texture();
    // A dielectric all over takes its diffuse picture as it is.
    if let (Some(info), None) = (&diffuse, &layer)
        && brightness(factors.specular) < F0
    {
        let transform = transform_of(info);
        let laid = (info.tex_coord(), transform.as_ref());
        material.maps.color = textures.map(file, &info.texture(), laid, note_read)?;
        return Ok(());
    }
    let asked = [diffuse, layer].map(|info| info.map(|info| asked(file, &info)));
    let Some(map) = asked.iter().flatten().map(|asked| asked.map).next() else {
        return Ok(());
    };
    let Some([color, layer]) = converted(file, textures, (&asked, note_read), &factors)? else {
        return Ok(());
    };
    let of = |texture: u32| Some(Map { texture, ..map });
    material.albedo = DVec3::ONE;
    (material.metallic, material.roughness) = (1.0, Some(1.0));
    material.maps.color = of(color);
    (material.maps.roughness, material.maps.metallic) = (of(layer), of(layer));
    Ok(())
}

fn asked<'a>(file: &mut GltfFile<'_>, info: &gltf::texture::Info<'a>) -> Asked<'a> {
    let (texture, transform) = (info.texture(), transform_of(info));
    let laid = (info.tex_coord(), transform.as_ref());
    Asked {
        image: image_of(file, &texture),
        map: placed(file, &texture, laid, 0),
        texture,
    }
}

/// The pictures of base colour and of roughness and metal that are made of those of diffuse and of specular and glossiness; `None`
/// where neither of these can be read. The same are made once.
fn converted(
    file: &mut GltfFile<'_>,
    textures: &mut Textures,
    (asked, note_read): (&AskedPictures<'_>, &dyn Fn(&Path)),
    factors: &Factors,
) -> Result<Option<[u32; 2]>, SceneError> {
    let lies_otherwise = match asked {
        [Some(diffuse), Some(layer)] => diffuse.map != layer.map,
        _ => false,
    };
    let images = asked.each_ref().map(|asked| asked.as_ref()?.image);
    let key = format!("{:?}", (images, factors, lies_otherwise));
    if let Some(known) = textures.converted.get(&key) {
        return Ok(*known);
    }
    let mut read = [None, None];
    for (read, asked) in read.iter_mut().zip(asked) {
        if let Some(asked) = asked {
            *read = picture(file, &asked.texture, note_read)?;
        }
    }
    if lies_otherwise && let [Some(_), Some(layer)] = &mut read {
        *layer = resized(layer, [1, 1]);
        let note =
            "specularGlossinessTexture lies otherwise than diffuseTexture; its mean stands for it";
        file.note(note.to_owned());
    }
    let numbers = match read {
        [None, None] => None,
        [diffuse, layer] => {
            let made = made(
                [diffuse.unwrap_or_else(white), layer.unwrap_or_else(white)],
                factors,
            );
            Some(made.map(|picture| textures.kept.keep(picture)))
        }
    };
    textures.converted.insert(key, numbers);
    Ok(numbers)
}

/// A texel that multiplies by 1.
fn white() -> Texture {
    Texture {
        name: String::new(),
        size_px: [1, 1],
        rgba: vec![255; 4],
    }
}

/// Base colour (sRGB, with the diffuse picture's alpha), and roughness in G with metal in B, texel by texel, as wide and as high
/// as the larger of both.
fn made([diffuse, layer]: [Texture; 2], factors: &Factors) -> [Texture; 2] {
    let size_px = [0, 1].map(|side| diffuse.size_px[side].max(layer.size_px[side]));
    let as_large = |picture: Texture| match picture.size_px == size_px {
        true => picture,
        false => resized(&picture, size_px),
    };
    let (mut diffuse, mut layer) = (as_large(diffuse), as_large(layer));
    let linear: [f64; 256] = std::array::from_fn(|byte| linear_from_srgb(byte as f64 / 255.0));
    let color =
        |texel: &[u8]| DVec3::from_array([0, 1, 2].map(|part| linear[usize::from(texel[part])]));
    let byte = |part: f64| (part * 255.0).round() as u8;
    let texels = diffuse
        .rgba
        .chunks_exact_mut(4)
        .zip(layer.rgba.chunks_exact_mut(4));
    for (of_diffuse, of_layer) in texels {
        let (albedo, metallic) = split(
            color(of_diffuse) * factors.diffuse,
            color(of_layer) * factors.specular,
        );
        let glossiness = f64::from(of_layer[3]) / 255.0 * factors.glossiness;
        let albedo = albedo.to_array().map(|part| byte(srgb_from_linear(part)));
        of_diffuse[..3].copy_from_slice(&albedo);
        of_layer.copy_from_slice(&[255, byte(1.0 - glossiness), byte(metallic), 255]);
    }
    [diffuse, layer]
}

/// How bright a colour looks, linear.
fn brightness(color: DVec3) -> f64 {
    (color * color).dot(DVec3::new(0.299, 0.587, 0.114)).sqrt()
}

/// The base colour and the part of metal of what reflects so much.
fn split(diffuse: DVec3, specular: DVec3) -> (DVec3, f64) {
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
    (albedo.clamp(DVec3::ZERO, DVec3::ONE), metallic)
}
