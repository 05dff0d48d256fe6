//! Pipelines of the shafts' pass over the picture.

use super::super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT};
use super::super::gpu::Gpu;
use super::super::pipelines::{
    GroupLayout, PipelineDescription, added, filtered, overwritten, sampler, storage, uniform,
    untouched,
};
use super::super::stencil::{IN_A_SURFACE, depth_stencil_state};
use super::super::surfaces::{Sided, SurfaceKinds};
use super::super::uniforms::GEOMETRY_GROUPS;
use super::data::{PATCH_CORNER_LAYOUT, REFLECTED_CORNER_LAYOUT};

/// Group 2: the frame, the sources, what they give to the vertices, their maps and the environment.
pub(super) const SHAFT_GROUP: GroupLayout = GroupLayout {
    label: "shafts",
    entries: &[
        uniform(0, wgpu::ShaderStages::FRAGMENT, false),
        storage(1, wgpu::ShaderStages::FRAGMENT),
        storage(2, wgpu::ShaderStages::FRAGMENT),
        storage(3, wgpu::ShaderStages::FRAGMENT),
        storage(4, wgpu::ShaderStages::FRAGMENT),
        filtered(5),
        sampler(6),
        filtered(7),
        sampler(8),
    ],
};

/// All groups of the pass.
const SHAFT_GROUPS: [GroupLayout; 3] = [GEOMETRY_GROUPS[0], GEOMETRY_GROUPS[1], SHAFT_GROUP];

/// The pipelines.
pub(super) struct Pipelines {
    /// The room, depth alone.
    pub depth_of_room: wgpu::RenderPipeline,
    /// What is real on moving anchors, depth alone.
    pub depth_of_real: Sided,
    /// The same with the light on it.
    pub light_on_moving: Sided,
    /// Virtual things: depth and light.
    pub light_on_virtual: Sided,
    /// All light of patches, where they are seen.
    pub whole_light_on_patch: wgpu::RenderPipeline,
    /// Patches that sources light, where they are seen.
    pub light_on_patch: wgpu::RenderPipeline,
    /// Adds what virtual things reflect on to patches.
    pub reflected_on_patch: wgpu::RenderPipeline,
}

impl Pipelines {
    pub fn new(gpu: &Gpu, samples: u32, kinds: SurfaceKinds) -> Self {
        let format = gpu.light_format;
        let into_depth = PipelineDescription {
            shader: "shafts.wgsl",
            constants: vec![
                ("GLOSSY", f64::from(kinds.glossy)),
                ("MULTISAMPLED", f64::from(samples > 1)),
            ],
            groups: SHAFT_GROUPS.map(Some).to_vec(),
            depth_stencil: Some(depth_stencil_state(
                gpu.depth_format,
                true,
                wgpu::CompareFunction::Greater,
                wgpu::StencilState::default(),
            )),
            samples,
            ..Default::default()
        };
        let depth_alone = PipelineDescription {
            fragment: "nothing",
            targets: vec![untouched(format), untouched(format)],
            ..into_depth.clone()
        };
        let corners = vec![CORNER_LAYOUT, INDIRECT_LAYOUT];
        let depth_of_patch = depth_stencil_state(
            gpu.depth_format,
            false,
            wgpu::CompareFunction::GreaterEqual,
            wgpu::StencilState::default(),
        );
        let on_patch = PipelineDescription {
            depth_stencil: Some(wgpu::DepthStencilState {
                bias: IN_A_SURFACE,
                ..depth_of_patch
            }),
            ..into_depth.clone()
        };
        Self {
            depth_of_room: gpu.pipeline(&PipelineDescription {
                vertex: "place_depth",
                vertex_buffers: vec![REFLECTED_CORNER_LAYOUT],
                ..depth_alone.clone()
            }),
            depth_of_real: Sided::both(
                gpu,
                &PipelineDescription {
                    vertex: "place",
                    vertex_buffers: corners.clone(),
                    ..depth_alone
                },
            ),
            light_on_moving: Sided::both(
                gpu,
                &PipelineDescription {
                    vertex: "place",
                    fragment: "light_on_moving",
                    vertex_buffers: corners.clone(),
                    targets: vec![overwritten(format), overwritten(format)],
                    ..into_depth.clone()
                },
            ),
            light_on_virtual: Sided::both(
                gpu,
                &kinds.of_virtual(PipelineDescription {
                    vertex: "place_sampled",
                    fragment: "light_on_virtual",
                    vertex_buffers: corners,
                    targets: vec![overwritten(format), overwritten(format)],
                    ..into_depth
                }),
            ),
            whole_light_on_patch: gpu.pipeline(&PipelineDescription {
                vertex: "place_reflected",
                fragment: "whole_light_on_patch",
                vertex_buffers: vec![REFLECTED_CORNER_LAYOUT],
                targets: vec![overwritten(format), overwritten(format)],
                ..on_patch.clone()
            }),
            light_on_patch: gpu.pipeline(&PipelineDescription {
                vertex: "place_patch",
                fragment: "light_on_patch",
                vertex_buffers: vec![PATCH_CORNER_LAYOUT],
                targets: vec![overwritten(format), overwritten(format)],
                ..on_patch.clone()
            }),
            reflected_on_patch: gpu.pipeline(&PipelineDescription {
                vertex: "place_reflected",
                fragment: "reflected_on_patch",
                vertex_buffers: vec![REFLECTED_CORNER_LAYOUT],
                targets: vec![untouched(format), added(format, wgpu::BlendFactor::One)],
                ..on_patch
            }),
        }
    }
}
