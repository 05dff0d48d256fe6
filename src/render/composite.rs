//! The composite of video and virtual light where several samples or lights are added up (see composite.wgsl).
//! Reads the recorded picture, `reaching` and `change`. Writes the picture that is shown, or the `gain` layer.

use super::background::{Background, PICTURE_FORMAT};
use super::shader;
use crate::scene::Difference;

/// Format of the gain layer.
pub(super) const GAIN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Pipelines of the pass, and what it reads besides the video.
pub(super) struct Composite {
    pub composite: wgpu::RenderPipeline,
    pub gain: wgpu::RenderPipeline,
    /// Group 0: `reaching` and `change`.
    pub group: wgpu::BindGroup,
}

impl Composite {
    pub fn new(
        device: &wgpu::Device,
        samples: u32,
        difference: Difference,
        background: &Background,
        [reaching, change]: [&wgpu::TextureView; 2],
    ) -> Self {
        let text = include_str!("../../shaders/composite.wgsl");
        let text = if samples == 1 {
            text.replace("texture_multisampled_2d", "texture_2d")
        } else {
            text.to_owned()
        };
        let module = shader::module(device, "composite", &text);
        let texture = |binding| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty: wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable: false },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: samples > 1,
            },
            count: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("composite"),
            entries: &[texture(0), texture(1)],
        });
        let view = |binding, view| wgpu::BindGroupEntry {
            binding,
            resource: wgpu::BindingResource::TextureView(view),
        };
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("composite"),
            layout: &layout,
            entries: &[view(0, reaching), view(1, change)],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("composite"),
            bind_group_layouts: &[Some(&layout), None, Some(&background.layout)],
            immediate_size: 0,
        });
        let constants = [
            ("SAMPLES", f64::from(samples)),
            ("DISTORTS", f64::from(background.distorts)),
            (
                "DIFFERENCE",
                match difference {
                    Difference::Ratio => 0.0,
                    Difference::Subtract => 1.0,
                    Difference::Encoded => 2.0,
                },
            ),
        ];
        let build = |entry_point, format: wgpu::TextureFormat| {
            shader::whole_picture(
                device,
                &pipeline_layout,
                &module,
                entry_point,
                &[Some(format.into())],
                None,
                &constants,
            )
        };
        Self {
            composite: build("composite", PICTURE_FORMAT),
            gain: build("gain", GAIN_FORMAT),
            group,
        }
    }
}
