//! What surfaces are made of: metal and dielectric after glTF 2.0 (Appendix B), with the pictures that say it texel by texel.

use glam::{Affine2, DVec3};

/// How a surface reflects, emits and lets through light.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Diffuse reflectance of what is no metal, and a metal's reflectance seen head-on: linear RGB in [0, 1]. It is
    /// multiplied with the corners' colours.
    pub albedo: DVec3,
    /// α of the GGX layer of a dielectric, or of a metal, in (0, 1]; `None`: Lambert alone, or a metal's usual one
    /// ([`Material::layer_roughness`]).
    pub roughness: Option<f64>,
    /// Part that is metal, 0 to 1.
    pub metallic: f64,
    /// Radiance that it sends out by itself, linear RGB.
    pub emission: DVec3,
    /// Part of the light that does not pass, 0 to 1, as `coverage` takes it.
    pub opacity: f64,
    /// What becomes of its opacity.
    pub coverage: Coverage,
    /// What its colour is.
    pub shading: Shading,
    /// Pictures that these numbers are multiplied with.
    pub maps: Maps,
}

/// α of a metal of which nothing says how rough it is: half of it, squared, as programs begin with.
const METAL_ROUGHNESS: f64 = 0.25;

impl Material {
    /// Lambert alone.
    pub const fn matt(albedo: DVec3) -> Self {
        Self {
            albedo,
            roughness: None,
            metallic: 0.0,
            emission: DVec3::ZERO,
            opacity: 1.0,
            coverage: Coverage::Opaque,
            shading: Shading::Lit,
            maps: Maps::NONE,
        }
    }

    /// α of its layer; `None`: it has none. A metal always has one.
    pub fn layer_roughness(&self) -> Option<f64> {
        let of_metal = (self.metallic > 0.0).then_some(METAL_ROUGHNESS);
        self.roughness.or(of_metal)
    }

    /// Whether albedo and roughness alone say how it looks.
    pub fn is_plain(&self) -> bool {
        let plain = Self {
            roughness: self.roughness,
            ..Self::matt(self.albedo)
        };
        *self == plain
    }
}

/// What becomes of a material's opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Coverage {
    /// It is passed over.
    Opaque,
    /// What has at least this opacity is there, the rest is not.
    Mask {
        /// 0 to 1.
        cutoff: f64,
    },
    /// What is behind shines through.
    Blend,
}

/// What a material's colour is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shading {
    /// A reflectance, that light makes visible: Lambert, in the light that the layer lets in and out.
    Lit,
    /// The same of a surface that is rough itself, as models of metal and roughness mean it (Burley 2012, section 5.3): it
    /// throws grazing light back the more the rougher it is.
    Principled,
    /// The radiance itself, whatever the light (KHR_materials_unlit).
    Unlit,
}

/// Pictures that a material's numbers are multiplied with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Maps {
    /// sRGB in RGB: albedo; A: opacity.
    pub color: Option<Map>,
    /// Linear in G: the square root of the roughness.
    pub roughness: Option<Map>,
    /// Linear in B: the part that is metal.
    pub metallic: Option<Map>,
    /// Linear in RGB: the normal in tangent space, from -1 to 1.
    pub normal: Option<Map>,
    /// By which the normal's x and y are multiplied.
    pub normal_scale: f64,
    /// Linear in R: the part of the surroundings' light that arrives.
    pub occlusion: Option<Map>,
    /// How far that is believed, 0 to 1.
    pub occlusion_strength: f64,
    /// sRGB in RGB: emission.
    pub emission: Option<Map>,
}

impl Maps {
    /// No picture.
    pub const NONE: Self = Self {
        color: None,
        roughness: None,
        metallic: None,
        normal: None,
        normal_scale: 1.0,
        occlusion: None,
        occlusion_strength: 1.0,
        emission: None,
    };

    /// Those that there are, each with whether its RGB is sRGB-encoded.
    pub fn used(&self) -> impl Iterator<Item = (Map, Encoding)> {
        [
            (self.color, Encoding::Srgb),
            (self.roughness, Encoding::Linear),
            (self.metallic, Encoding::Linear),
            (self.normal, Encoding::Linear),
            (self.occlusion, Encoding::Linear),
            (self.emission, Encoding::Srgb),
        ]
        .into_iter()
        .filter_map(|(map, encoding)| Some((map?, encoding)))
    }
}

/// What the bytes of a picture's RGB mean; alpha is always linear.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Encoding {
    /// Encoded as sRGB has it (IEC 61966-2-1).
    Srgb,
    /// In proportion.
    Linear,
}

/// How a picture lies on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Map {
    /// Index into the textures that came with the materials.
    pub texture: u32,
    /// Which of the corners' texture coordinates it goes by, 0 or 1.
    pub uv_set: u32,
    /// The picture's coordinates (v downwards, 1 is the whole picture) from the corners'.
    pub picture_from_corner: Affine2,
    /// What is beyond the picture's sides, along u and v.
    pub wrap: [Wrap; 2],
    /// What is between texels.
    pub filter: Filter,
}

impl Map {
    /// A texture as it stands, repeated, by the first texture coordinates.
    pub const fn of(texture: u32) -> Self {
        Self {
            texture,
            uv_set: 0,
            picture_from_corner: Affine2::IDENTITY,
            wrap: [Wrap::Repeat; 2],
            filter: Filter::Smooth,
        }
    }
}

/// What is beyond a picture's sides.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wrap {
    /// The picture again.
    Repeat,
    /// The picture mirrored.
    Mirror,
    /// Its last texels.
    Clamp,
}

/// What is between the texels of a picture that is seen enlarged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// Passes from one into the other.
    Smooth,
    /// Squares of one colour.
    Pixels,
}
