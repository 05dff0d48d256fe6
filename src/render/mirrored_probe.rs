//! The probe as glossy virtual surfaces mirror it: a texture whose levels are lobes of rising roughness.

use half::f16;
use wgpu::util::DeviceExt as _;

use crate::light::layer_albedo::LAYER_ALBEDO;
use crate::light::prefiltered::{LEVELS, SHARPEST_PX, prefiltered};
use crate::light::probe::Probe;

/// The texture and how it is read: around in azimuth, to the poles in elevation.
pub(super) struct MirroredProbe {
    pub view: wgpu::TextureView,
    pub sampler: wgpu::Sampler,
    /// What a layer mirrors of light from everywhere.
    pub layer_albedo: wgpu::TextureView,
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
            .flat_map(|level| level.pixels)
            .map(|pixel| pixel.extend(1.0).to_array().map(f16::from_f32))
            .collect();
        if glossy.is_none() {
            halves = vec![[f16::ZERO; 4]; 2];
        }
        let layer: &[[f32; 2]] = match glossy {
            Some(_) => &LAYER_ALBEDO,
            None => &[[0.0; 2]],
        };
        let side = layer.len().isqrt() as u32;
        let layer: Vec<[f16; 2]> = layer.iter().map(|entry| entry.map(f16::from_f32)).collect();
        let texture = |label, [width, height]: [u32; 2], levels, format, halves: &[u8]| {
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
                halves,
            );
            texture.create_view(&Default::default())
        };
        Self {
            view: texture(
                "environment",
                [width, width / 2],
                levels,
                wgpu::TextureFormat::Rgba16Float,
                bytemuck::cast_slice(&halves),
            ),
            layer_albedo: texture(
                "layer albedo",
                [side; 2],
                1,
                wgpu::TextureFormat::Rg16Float,
                bytemuck::cast_slice(&layer),
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
