//! How the environment's passes are built.

use super::super::anchor_geometry::{OCCLUSION_LAYOUT, REFLECTED_LAYOUT};
use super::super::gpu::Gpu;
use super::super::pipelines::{
    GroupLayout, PipelineDescription, filtered, overwritten, sampler, uniform, untouched, words,
};
use super::super::surfaces::{Sided, SurfaceKinds, surface_description};
use super::super::uniforms::GEOMETRY_GROUPS;
use crate::scene::{EnvironmentMethod, EnvironmentSettings};

/// Group 2 of environment.wgsl.
pub(super) const ENVIRONMENT_GROUP: GroupLayout = GroupLayout {
    label: "environment",
    entries: &[
        uniform(0, wgpu::ShaderStages::VERTEX_FRAGMENT, false),
        words(1, wgpu::ShaderStages::FRAGMENT),
        words(2, wgpu::ShaderStages::FRAGMENT),
        words(3, wgpu::ShaderStages::FRAGMENT),
        words(4, wgpu::ShaderStages::FRAGMENT),
        filtered(5),
        sampler(6),
        filtered(7),
        sampler(8),
        words(9, wgpu::ShaderStages::VERTEX),
    ],
};

/// The pipelines.
pub(super) struct Pipelines {
    /// Depth of real surfaces, on which the light is known otherwise.
    pub depth_of_real: Sided,
    /// Depth of real surfaces, the light that reaches them and what virtual things take of it.
    pub light_on_real: Sided,
    /// Depth of virtual surfaces, and their light.
    pub light_on_virtual: Sided,
}

impl Pipelines {
    pub fn new(
        gpu: &Gpu,
        samples: u32,
        kinds: SurfaceKinds,
        settings: &EnvironmentSettings,
    ) -> Self {
        let method = settings.method;
        let format = gpu.light_format;
        let described = |fragment| PipelineDescription {
            shader: "environment.wgsl",
            flags: vec!["OCCLUSION"],
            vertex: "place_sampled",
            fragment,
            constants: vec![
                ("GLOSSY", f64::from(kinds.glossy)),
                ("MULTISAMPLED", f64::from(samples > 1)),
                ("BY_PLANES", f64::from(method == EnvironmentMethod::Maps)),
                ("GROUPED", f64::from(settings.is_grouped())),
            ],
            groups: [GEOMETRY_GROUPS[0], GEOMETRY_GROUPS[1], ENVIRONMENT_GROUP]
                .map(Some)
                .to_vec(),
            targets: vec![overwritten(format), overwritten(format)],
            samples,
            ..surface_description(gpu, None)
        };
        let with_occlusion = |mut description: PipelineDescription| {
            description.vertex_buffers.push(OCCLUSION_LAYOUT);
            description.vertex_buffers.push(REFLECTED_LAYOUT);
            Sided::new(gpu, &description)
        };
        let depth_alone = PipelineDescription {
            shader: "surfaces.wgsl",
            flags: Vec::new(),
            constants: vec![("MULTISAMPLED", f64::from(samples > 1))],
            targets: vec![untouched(format), untouched(format)],
            ..described("ambient_on_real")
        };
        let mut on_virtual = described("light_on_virtual");
        if kinds.glossy && method == EnvironmentMethod::Maps {
            on_virtual.flags.push("HARMONIC_GLOSS");
        }
        Self {
            depth_of_real: Sided::new(gpu, &depth_alone),
            light_on_real: with_occlusion(described("light_on_real")),
            light_on_virtual: with_occlusion(kinds.of_virtual(on_virtual)),
        }
    }
}
