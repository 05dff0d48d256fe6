//! Where light is added up before the composite: targets, and the pipelines of shadow volumes that do it.

use super::background::{Background, extent};
use super::composite::Composite;
use super::gpu::Gpu;
use super::surfaces::Surfaces;
use super::volumes::Volumes;
use crate::scene::Difference;

/// The targets that light is added to, and the composite that reads them.
pub(super) struct Targets {
    pub composite: Composite,
    /// See surfaces.wgsl.
    pub reaching: wgpu::TextureView,
    pub change: wgpu::TextureView,
    pub depth_stencil: wgpu::TextureView,
}

impl Targets {
    pub fn new(gpu: &Gpu, background: &Background, samples: u32, difference: Difference) -> Self {
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
        let reaching = target("reaching", gpu.light_format, read);
        let change = target("change", gpu.light_format, read);
        Self {
            composite: Composite::new(
                device,
                samples,
                difference,
                background,
                [&reaching, &change],
            ),
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

/// Where several lights or samples of shadow volumes are added up.
pub(super) struct Accumulation {
    pub surfaces: Surfaces,
    pub volumes: Volumes,
    pub targets: Targets,
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
        Self {
            surfaces: Surfaces::new(gpu, layout, samples, glossy),
            volumes: Volumes::new(
                device,
                layout,
                gpu.depth_format,
                samples,
                &[gpu.light_format; 2],
            ),
            targets: Targets::new(gpu, background, samples, Difference::Ratio),
        }
    }
}
