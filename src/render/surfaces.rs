//! Draws real and virtual surfaces: depth and ambient light first, then each light where the stencil says so.
//! Reads the stencil (stencil.rs). Writes depth, `reaching` and `change` (see surfaces.wgsl).

use super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT};
use super::shader;
use super::stencil::{REAL_HIDES, SHADOW, VIRTUAL_SHADOW};

/// Format of `reaching` and `change`.
pub(super) const LIGHT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Pipelines of the pass.
pub(super) struct Surfaces {
    /// Depth of real surfaces, for a scene whose only light needs to be known where it is hidden alone.
    pub depth_of_real: wgpu::RenderPipeline,
    /// Depth and ambient light of real surfaces.
    pub ambient_on_real: wgpu::RenderPipeline,
    /// Depth and ambient light of virtual surfaces.
    pub ambient_on_virtual: wgpu::RenderPipeline,
    /// A light as it reaches real surfaces in the video.
    pub light_reaching_real: wgpu::RenderPipeline,
    /// A light where virtual things hide it from real surfaces.
    pub light_hidden_from_real: wgpu::RenderPipeline,
    /// Both at once, and the ambient light, for the only light of a scene.
    pub only_light_hidden_from_real: wgpu::RenderPipeline,
    /// A light on virtual surfaces past all casters; the stencil's reference is 0, or 1 for surfaces that lie in no
    /// shadow but their own.
    pub light_on_virtual: wgpu::RenderPipeline,
}

/// What a pipeline does besides its shader.
struct Use {
    writes_depth: bool,
    stencil: wgpu::CompareFunction,
    stencil_bits: u32,
    /// Whether it writes `reaching`, and whether `change`.
    targets: [bool; 2],
}

impl Surfaces {
    pub fn new(
        device: &wgpu::Device,
        layout: &wgpu::PipelineLayout,
        depth_format: wgpu::TextureFormat,
        samples: u32,
    ) -> Self {
        let module = shader::module(
            device,
            "surfaces",
            include_str!("../../shaders/surfaces.wgsl"),
        );
        let add = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::One,
            dst_factor: wgpu::BlendFactor::One,
            operation: wgpu::BlendOperation::Add,
        };
        let build = |vertex: &str, fragment: &str, usage: Use| {
            let target = |written: bool| {
                Some(wgpu::ColorTargetState {
                    format: LIGHT_FORMAT,
                    blend: (!usage.writes_depth).then_some(wgpu::BlendState {
                        color: add,
                        alpha: add,
                    }),
                    write_mask: match written {
                        true => wgpu::ColorWrites::ALL,
                        false => wgpu::ColorWrites::empty(),
                    },
                })
            };
            let face = wgpu::StencilFaceState {
                compare: usage.stencil,
                ..Default::default()
            };
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(fragment),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers: &[Some(CORNER_LAYOUT), Some(INDIRECT_LAYOUT)],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: depth_format,
                    depth_write_enabled: Some(usage.writes_depth),
                    depth_compare: Some(match usage.writes_depth {
                        true => wgpu::CompareFunction::Greater,
                        false => wgpu::CompareFunction::Equal,
                    }),
                    stencil: wgpu::StencilState {
                        front: face,
                        back: face,
                        read_mask: usage.stencil_bits,
                        write_mask: 0,
                    },
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: samples,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment),
                    compilation_options: Default::default(),
                    targets: &usage.targets.map(target),
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let first = |targets| Use {
            writes_depth: true,
            stencil: wgpu::CompareFunction::Always,
            stencil_bits: 0,
            targets,
        };
        // The stencil's reference is 0, except for what lies in its own shadow.
        let lit = |stencil, stencil_bits, targets| Use {
            writes_depth: false,
            stencil,
            stencil_bits,
            targets,
        };
        let (equal, other) = (
            wgpu::CompareFunction::Equal,
            wgpu::CompareFunction::NotEqual,
        );
        let hidden = |targets| lit(other, VIRTUAL_SHADOW, targets);
        Self {
            depth_of_real: build("place_alone", "depth_alone", first([false, false])),
            ambient_on_real: build("place", "ambient_on_real", first([true, true])),
            ambient_on_virtual: build("place", "ambient_on_virtual", first([true, true])),
            light_reaching_real: build(
                "place",
                "light_on_real",
                lit(equal, REAL_HIDES, [true, false]),
            ),
            light_hidden_from_real: build("place", "light_on_real", hidden([false, true])),
            only_light_hidden_from_real: build("place", "only_light_hidden", hidden([true, true])),
            light_on_virtual: build(
                "place",
                "light_on_virtual",
                lit(equal, SHADOW, [false, true]),
            ),
        }
    }
}
