//! Where several lights or samples are added up before the composite: targets and pipelines.

use super::background::{Background, extent};
use super::composite::Composite;
use super::gpu::Gpu;
use super::surfaces::{LIGHT_FORMAT, Surfaces};
use super::volumes::Volumes;

/// The targets that lights add to, and the pipelines that do it.
pub(super) struct Accumulation {
    pub surfaces: Surfaces,
    pub volumes: Volumes,
    pub composite: Composite,
    /// See surfaces.wgsl.
    pub reaching: wgpu::TextureView,
    pub change: wgpu::TextureView,
    pub depth_stencil: wgpu::TextureView,
}

impl Accumulation {
    pub fn new(
        gpu: &Gpu,
        layout: &wgpu::PipelineLayout,
        background: &Background,
        samples: u32,
        glossy: bool,
    ) -> Self {
        let device = &gpu.device;
        let target = |label, format, usage| {
            device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: extent(background.size_px),
                    mip_level_count: 1,
                    sample_count: samples,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                    view_formats: &[],
                })
                .create_view(&Default::default())
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let reaching = target("reaching", LIGHT_FORMAT, read);
        let change = target("change", LIGHT_FORMAT, read);
        Self {
            surfaces: Surfaces::new(device, layout, gpu.depth_format, samples, glossy),
            volumes: Volumes::new(
                device,
                layout,
                gpu.depth_format,
                samples,
                &[LIGHT_FORMAT, LIGHT_FORMAT],
            ),
            composite: Composite::new(device, samples, background, [&reaching, &change]),
            depth_stencil: target(
                "depth and stencil",
                gpu.depth_format,
                wgpu::TextureUsages::empty(),
            ),
            reaching,
            change,
        }
    }
}
