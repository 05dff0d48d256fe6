//! Cross-fades two pictures: what stands on an anchor that is no longer seen goes gently.
//! Reads and writes the picture that is shown.

use super::background::PICTURE_FORMAT;
use super::gpu::Gpu;
use super::shader;

/// Pipeline and pictures of the pass.
pub(super) struct Fade {
    pipeline: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    visibility: wgpu::Buffer,
    /// The picture without what is fading.
    without: wgpu::Texture,
    mixed: wgpu::Texture,
}

impl Fade {
    /// For the picture that is shown.
    pub fn new(device: &wgpu::Device, picture: &wgpu::Texture) -> Self {
        let module = shader::module(device, "fade", include_str!("../../shaders/fade.wgsl"));
        let texture = |label, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: picture.size(),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: PICTURE_FORMAT,
                usage,
                view_formats: &[],
            })
        };
        let without = texture(
            "without what fades",
            wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let mixed = texture(
            "faded",
            wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::RENDER_ATTACHMENT,
        );
        let visibility = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("visibility"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let entry = |binding, ty| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::FRAGMENT,
            ty,
            count: None,
        };
        let read = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable: false },
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("fade"),
            entries: &[entry(0, read), entry(1, read), entry(2, uniform)],
        });
        let views = [&without, picture].map(|texture| texture.create_view(&Default::default()));
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("fade"),
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&views[0]),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(&views[1]),
                },
                wgpu::BindGroupEntry {
                    binding: 2,
                    resource: visibility.as_entire_binding(),
                },
            ],
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("fade"),
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        Self {
            pipeline: shader::whole_picture(
                device,
                &pipeline_layout,
                &module,
                "fade",
                &[Some(PICTURE_FORMAT.into())],
                None,
                &[],
            ),
            group,
            visibility,
            without,
            mixed,
        }
    }

    /// Keeps the picture as it is without what is drawn next.
    pub fn keep(&self, gpu: &Gpu, picture: &wgpu::Texture) {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        copy(&mut encoder, picture, &self.without);
        gpu.queue.submit([encoder.finish()]);
    }

    /// Leaves of what was drawn since as much as is to be seen, 0 to 1.
    pub fn mix(&self, gpu: &Gpu, picture: &wgpu::Texture, visibility: f64) {
        let uniform = [visibility as f32, 0.0, 0.0, 0.0];
        gpu.queue
            .write_buffer(&self.visibility, 0, bytemuck::cast_slice(&uniform));
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let target = self.mixed.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("fade"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &target,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations::default(),
            })],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        copy(&mut encoder, &self.mixed, picture);
        gpu.queue.submit([encoder.finish()]);
    }
}

fn copy(encoder: &mut wgpu::CommandEncoder, from: &wgpu::Texture, to: &wgpu::Texture) {
    encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
}

/// How much of what stands on each anchor is to be seen (0 to 1), from most to least and each but once, without those
/// that are not seen at all.
pub(super) fn steps(visibility: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = visibility
        .iter()
        .copied()
        .filter(|&visibility| visibility > 0.0)
        .collect();
    steps.sort_by(|a, b| b.total_cmp(a));
    steps.dedup();
    steps
}
