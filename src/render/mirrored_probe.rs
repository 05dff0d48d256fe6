//! The probe as glossy virtual surfaces mirror it: a texture whose levels are lobes of rising roughness.

use half::f16;
use wgpu::util::DeviceExt as _;

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
            .flat_map(|level| level.pixels)
            .map(|pixel| pixel.extend(1.0).to_array().map(f16::from_f32))
            .collect();
        if glossy.is_none() {
            halves = vec![[f16::ZERO; 4]; 2];
        }
        let texture = device.create_texture_with_data(
            queue,
            &wgpu::TextureDescriptor {
                label: Some("environment"),
                size: wgpu::Extent3d {
                    width,
                    height: width / 2,
                    depth_or_array_layers: 1,
                },
                mip_level_count: levels,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: wgpu::TextureFormat::Rgba16Float,
                usage: wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            },
            wgpu::util::TextureDataOrder::MipMajor,
            bytemuck::cast_slice(&halves),
        );
        Self {
            view: texture.create_view(&Default::default()),
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
