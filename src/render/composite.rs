//! The composite of video and virtual light (see composite.wgsl).
//! Reads the recorded picture, `before` and `after`. Writes the picture that is shown, or the `gain` layer.

use super::shader;
use super::uniforms::uniform_entry;

/// Format of the picture that is shown: sRGB-encoded bytes, encoded by the shader so that untouched pixels pass as
/// they came.
pub(super) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
/// Format of the gain layer.
pub(super) const GAIN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Pipelines of the pass.
pub(super) struct Composite {
    pub composite: wgpu::RenderPipeline,
    pub bare: wgpu::RenderPipeline,
    pub gain: wgpu::RenderPipeline,
    pub layout: wgpu::BindGroupLayout,
}

impl Composite {
    pub fn new(device: &wgpu::Device, samples: u32) -> Self {
        let text = include_str!("../../shaders/composite.wgsl");
        let text = if samples == 1 {
            text.replace("texture_multisampled_2d", "texture_2d")
        } else {
            text.to_owned()
        };
        let module = shader::module(device, "composite", &text);
        let texture = |binding, multisampled| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("composite"),
            entries: &[
                uniform_entry(0, false),
                texture(1, false),
                texture(2, samples > 1),
                texture(3, samples > 1),
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("composite"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let build = |entry_point: &str, format: wgpu::TextureFormat| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("whole_picture"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: None,
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &[("SAMPLES", f64::from(samples))],
                        ..Default::default()
                    },
                    targets: &[Some(format.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Self {
            composite: build("composite", PICTURE_FORMAT),
            bare: build("bare", PICTURE_FORMAT),
            gain: build("gain", GAIN_FORMAT),
            layout,
        }
    }
}
