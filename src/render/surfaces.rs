//! Draws real and virtual surfaces: depth and ambient light first, then each light where the stencil says so.
//! Reads the stencil (stencil.rs). Writes depth, `reaching` and `change` (see surfaces.wgsl).

use super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT};
use super::gpu::Gpu;
use super::shader;
use super::stencil::{ADDED, REAL_HIDES, SHADOW, VIRTUAL_SHADOW};

/// Pipelines of the pass where several samples or lights are added up.
pub(super) struct Surfaces {
    /// Depth and ambient light of real surfaces.
    pub ambient_on_real: Sided,
    /// Depth and ambient light of virtual surfaces.
    pub ambient_on_virtual: Sided,
    /// A light as it reaches real surfaces in the video.
    pub light_reaching_real: Sided,
    /// A light where virtual things hide it from real surfaces.
    pub light_hidden_from_real: Sided,
    /// A light on virtual surfaces past all casters; the stencil's reference is 0, or 1 for surfaces that lie in no
    /// shadow but perhaps their own.
    pub light_on_virtual: Sided,
}

/// Pipelines for both sides of triangles, for outsides alone and for insides alone.
pub(super) struct Sided {
    pub both: wgpu::RenderPipeline,
    pub outside: wgpu::RenderPipeline,
    pub inside: wgpu::RenderPipeline,
}

impl Sided {
    /// The same, whichever sides can be seen.
    pub fn both(pipeline: wgpu::RenderPipeline) -> Self {
        Self {
            outside: pipeline.clone(),
            inside: pipeline.clone(),
            both: pipeline,
        }
    }
}

/// What a pipeline does besides its shader.
pub(super) struct Use<'a> {
    pub vertex: &'a str,
    pub fragment: &'a str,
    /// The first to draw a surface; all others draw what is there once more.
    pub writes_depth: bool,
    pub stencil: wgpu::CompareFunction,
    pub stencil_bits: u32,
    /// What a drawn sample does to these bits of the stencil.
    pub marks: (wgpu::StencilOperation, u32),
    pub targets: &'a [Option<wgpu::ColorTargetState>],
    /// Of the fragment shader.
    pub constants: &'a [(&'a str, f64)],
}

impl Use<'_> {
    /// The pipelines that draw surface batches so.
    pub fn pipelines(
        &self,
        device: &wgpu::Device,
        layout: &wgpu::PipelineLayout,
        module: &wgpu::ShaderModule,
        depth_format: wgpu::TextureFormat,
        samples: u32,
    ) -> Sided {
        let face = wgpu::StencilFaceState {
            compare: self.stencil,
            pass_op: self.marks.0,
            ..Default::default()
        };
        let build = |cull_mode| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(self.fragment),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module,
                    entry_point: Some(self.vertex),
                    compilation_options: Default::default(),
                    buffers: &[Some(CORNER_LAYOUT), Some(INDIRECT_LAYOUT)],
                },
                primitive: wgpu::PrimitiveState {
                    cull_mode,
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: depth_format,
                    depth_write_enabled: Some(self.writes_depth),
                    depth_compare: Some(match self.writes_depth {
                        true => wgpu::CompareFunction::Greater,
                        false => wgpu::CompareFunction::Equal,
                    }),
                    stencil: wgpu::StencilState {
                        front: face,
                        back: face,
                        read_mask: self.stencil_bits,
                        write_mask: self.marks.1,
                    },
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: samples,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module,
                    entry_point: Some(self.fragment),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: self.constants,
                        ..Default::default()
                    },
                    targets: self.targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Sided {
            both: build(None),
            outside: build(Some(wgpu::Face::Back)),
            inside: build(Some(wgpu::Face::Front)),
        }
    }
}

impl Surfaces {
    pub fn new(gpu: &Gpu, layout: &wgpu::PipelineLayout, samples: u32, glossy: bool) -> Self {
        let device = &gpu.device;
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
        let build = |fragment: &str, stencil, stencil_bits, marks, targets: [bool; 2]| {
            let writes_depth = stencil == wgpu::CompareFunction::Always;
            let target = |written: bool| {
                Some(wgpu::ColorTargetState {
                    format: gpu.light_format,
                    blend: (!writes_depth).then_some(wgpu::BlendState {
                        color: add,
                        alpha: add,
                    }),
                    write_mask: match written {
                        true => wgpu::ColorWrites::ALL,
                        false => wgpu::ColorWrites::empty(),
                    },
                })
            };
            let usage = Use {
                vertex: "place_sampled",
                fragment,
                writes_depth,
                stencil,
                stencil_bits,
                marks,
                targets: &targets.map(target),
                constants: &[
                    ("GLOSSY", f64::from(glossy)),
                    ("MULTISAMPLED", f64::from(samples > 1)),
                ],
            };
            usage.pipelines(device, layout, &module, gpu.depth_format, samples)
        };
        let (always, equal, other) = (
            wgpu::CompareFunction::Always,
            wgpu::CompareFunction::Equal,
            wgpu::CompareFunction::NotEqual,
        );
        // The reference is what the stencil may count at most.
        let at_most = wgpu::CompareFunction::GreaterEqual;
        // Coplanar surfaces land on the same depth, and each sample is to get a light once.
        let nothing = (wgpu::StencilOperation::Keep, 0);
        let added = (wgpu::StencilOperation::Invert, ADDED);
        let taken = (wgpu::StencilOperation::Zero, VIRTUAL_SHADOW);
        let reaching = REAL_HIDES | ADDED;
        let (ambient, light) = (["ambient_on_real", "ambient_on_virtual"], "light_on_real");
        Self {
            ambient_on_real: build(ambient[0], always, 0, nothing, [true, true]),
            ambient_on_virtual: build(ambient[1], always, 0, nothing, [true, true]),
            light_reaching_real: build(light, equal, reaching, added, [true, false]),
            light_hidden_from_real: build(light, other, VIRTUAL_SHADOW, taken, [false, true]),
            light_on_virtual: build("light_on_virtual", at_most, SHADOW, nothing, [false, true]),
        }
    }
}
