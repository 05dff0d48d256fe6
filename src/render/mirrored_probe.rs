//! Light from all around as glossy virtual surfaces mirror it: a probe as a texture whose levels are lobes of rising roughness,
//! and what a layer mirrors of light from everywhere.

use half::f16;
use wgpu::util::DeviceExt as _;

use crate::light::layer_albedo::LAYER_ALBEDO;
use crate::light::prefiltered::{LEVELS, SHARPEST_PX, prefiltered};
use crate::light::probe::Probe;

/// The texture and how it is read: around in azimuth, to the poles in elevation.
pub(super) struct MirroredProbe {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
}

impl MirroredProbe {
    /// Of a probe's radiance times `exposure`; a black pixel where nothing is glossy.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, glossy: Option<(&Probe, f32)>) -> Self {
        let (width, levels) = match glossy {
            Some(_) => (SHARPEST_PX as u32, LEVELS as u32),
            None => (2, 1),
        };
        let pixels = glossy
            .into_iter()
            .flat_map(|(probe, exposure)| prefiltered(probe, exposure));
        let mut halves: Vec<[f16; 4]> = pixels
            .flat_map(|level| level.pixels().to_vec())
            .map(|pixel| pixel.extend(1.0).to_array().map(f16::from_f32))
            .collect();
        if glossy.is_none() {
            halves = vec![[f16::ZERO; 4]; 2];
        }
        Self {
            view: texture(
                (device, queue),
                "environment",
                ([width, width / 2], levels),
                wgpu::TextureFormat::Rgba16Float,
                bytemuck::cast_slice(&halves),
            ),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("environment"),
                address_mode_u: wgpu::AddressMode::Repeat,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
        }
    }
}

/// What a glossy layer mirrors of light from everywhere, as layer_albedo.wgsl reads it.
pub(super) struct LayerAlbedo {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
}

impl LayerAlbedo {
    /// One entry of nothing where nothing is glossy.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, is_glossy: bool) -> Self {
        let table: &[[f32; 3]] = match is_glossy {
            true => &LAYER_ALBEDO,
            false => &[[0.0; 3]],
        };
        let side = table.len().isqrt() as u32;
        let halves: Vec<[f16; 4]> = table
            .iter()
            .map(|&[factor, summand, mean]| [factor, summand, mean, 0.0].map(f16::from_f32))
            .collect();
        Self {
            view: texture(
                (device, queue),
                "layer albedo",
                ([side; 2], 1),
                wgpu::TextureFormat::Rgba16Float,
                bytemuck::cast_slice(&halves),
            ),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("layer albedo"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
        }
    }
}

/// A texture with its levels, the largest first.
fn texture(
    (device, queue): (&wgpu::Device, &wgpu::Queue),
    label: &str,
    ([width, height], levels): ([u32; 2], u32),
    format: wgpu::TextureFormat,
    texels: &[u8],
) -> wgpu::TextureView {
    let texture = device.create_texture_with_data(
        queue,
        &wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::MipMajor,
        texels,
    );
    texture.create_view(&Default::default())
}
