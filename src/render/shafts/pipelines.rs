//! Pipelines of the shafts' pass over the picture.

use super::super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT};
use super::super::gpu::Gpu;
use super::super::shader;
use super::super::surfaces::Sided;
use super::data::{PATCH_CORNER_LAYOUT, PLACE_LAYOUT, REFLECTED_CORNER_LAYOUT};

const SUM: wgpu::BlendComponent = wgpu::BlendComponent {
    src_factor: wgpu::BlendFactor::One,
    dst_factor: wgpu::BlendFactor::One,
    operation: wgpu::BlendOperation::Add,
};

/// The pipelines, and the layout of their group 2.
pub(super) struct Pipelines {
    pub layout: wgpu::BindGroupLayout,
    /// The room, depth alone.
    pub depth_of_room: wgpu::RenderPipeline,
    /// What is real on moving anchors, depth alone.
    pub depth_of_real: Sided,
    /// Virtual things: depth and light.
    pub light_on_virtual: Sided,
    /// Patches that sources light, where they are seen.
    pub light_on_patch: wgpu::RenderPipeline,
    /// Adds what virtual things reflect on to patches.
    pub reflected_on_patch: wgpu::RenderPipeline,
}

impl Pipelines {
    pub fn new(
        gpu: &Gpu,
        [view, light]: &[wgpu::BindGroupLayout; 2],
        samples: u32,
        glossy: bool,
    ) -> Self {
        let device = &gpu.device;
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let storage = || buffer(wgpu::BufferBindingType::Storage { read_only: true });
        let texture = || wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: true },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let sampler = || wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("shafts"),
            entries: &[
                entry(0, buffer(wgpu::BufferBindingType::Uniform)),
                entry(1, storage()),
                entry(2, storage()),
                entry(3, storage()),
                entry(4, storage()),
                entry(5, texture()),
                entry(6, sampler()),
                entry(7, texture()),
                entry(8, sampler()),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("shafts"),
            bind_group_layouts: &[Some(view), Some(light), Some(&layout)],
            immediate_size: 0,
        });
        let module = shader::module(
            device,
            "shafts",
            include_str!("../../../shaders/shafts.wgsl"),
        );
        let build = |vertex: &str,
                     buffers: &[Option<wgpu::VertexBufferLayout<'static>>],
                     fragment: Option<&str>,
                     writes_depth: bool,
                     adds: bool,
                     bias: wgpu::DepthBiasState| {
            let targets = [gpu.light_format; 2].map(|format| {
                Some(wgpu::ColorTargetState {
                    format,
                    blend: adds.then_some(wgpu::BlendState {
                        color: SUM,
                        alpha: SUM,
                    }),
                    write_mask: match fragment {
                        Some(_) => wgpu::ColorWrites::ALL,
                        None => wgpu::ColorWrites::empty(),
                    },
                })
            });
            let [reaching, change] = targets;
            // What is added leaves `reaching` as it is.
            let left_alone = |target| wgpu::ColorTargetState {
                blend: None,
                write_mask: wgpu::ColorWrites::empty(),
                ..target
            };
            let reaching = match adds {
                true => reaching.map(left_alone),
                false => reaching,
            };
            let targets = [reaching, change];
            let constants = [
                ("GLOSSY", f64::from(glossy)),
                ("MULTISAMPLED", f64::from(samples > 1)),
            ];
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(fragment.unwrap_or(vertex)),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(vertex),
                    compilation_options: Default::default(),
                    buffers,
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: gpu.depth_format,
                    depth_write_enabled: Some(writes_depth),
                    depth_compare: Some(match writes_depth {
                        true => wgpu::CompareFunction::Greater,
                        false => wgpu::CompareFunction::GreaterEqual,
                    }),
                    stencil: wgpu::StencilState::default(),
                    bias,
                }),
                multisample: wgpu::MultisampleState {
                    count: samples,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(fragment.unwrap_or("nothing")),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &constants,
                        ..Default::default()
                    },
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        // What is reflected is cut finer than where depth comes from, and lands on it but for rounding.
        let flush = wgpu::DepthBiasState::default();
        let nearer = wgpu::DepthBiasState {
            constant: 16,
            slope_scale: 0.01,
            clamp: 0.0,
        };
        let corners = [Some(CORNER_LAYOUT), Some(INDIRECT_LAYOUT)];
        Self {
            depth_of_room: build(
                "place_depth",
                &[Some(PLACE_LAYOUT)],
                None,
                true,
                false,
                flush,
            ),
            depth_of_real: Sided::both(build("place", &corners, None, true, false, flush)),
            light_on_virtual: Sided::both(build(
                "place_sampled",
                &corners,
                Some("light_on_virtual"),
                true,
                false,
                flush,
            )),
            light_on_patch: build(
                "place_patch",
                &[Some(PATCH_CORNER_LAYOUT)],
                Some("light_on_patch"),
                false,
                false,
                nearer,
            ),
            reflected_on_patch: build(
                "place_reflected",
                &[Some(REFLECTED_CORNER_LAYOUT)],
                Some("reflected_on_patch"),
                false,
                true,
                nearer,
            ),
            layout,
        }
    }
}
