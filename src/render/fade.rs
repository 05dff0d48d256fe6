//! Cross-fades two pictures: what stands on an anchor that is no longer seen goes gently.
//! Reads and writes the picture that is shown.

use super::attachments::{cleared, texture};
use super::background::PICTURE_FORMAT;
use super::gpu::Gpu;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels, uniform};

/// The two pictures and how much is seen of the second.
const FADE_GROUP: GroupLayout = GroupLayout {
    label: "fade",
    entries: &[
        texels(0, false),
        texels(1, false),
        uniform(2, wgpu::ShaderStages::FRAGMENT, false),
    ],
};

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
    pub fn new(gpu: &Gpu, picture: &wgpu::Texture) -> Self {
        let size_px = [picture.width(), picture.height()];
        let texture = |label, usage| {
            let device = &gpu.device;
            texture(device, label, size_px, PICTURE_FORMAT, 1, usage)
        };
        let without = texture(
            "without what fades",
            wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let mixed = texture(
            "faded",
            wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::RENDER_ATTACHMENT,
        );
        let visibility = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("visibility"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let views = [&without, picture].map(|texture| texture.create_view(&Default::default()));
        let [before, after] = [0, 1].map(|index| wgpu::BindingResource::TextureView(&views[index]));
        Self {
            pipeline: gpu.pipeline(&PipelineDescription {
                shader: "fade.wgsl",
                fragment: "fade",
                groups: vec![Some(FADE_GROUP)],
                targets: vec![overwritten(PICTURE_FORMAT)],
                ..Default::default()
            }),
            group: gpu.bind_group(&FADE_GROUP, [before, after, visibility.as_entire_binding()]),
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
        let mut passes = Passes::new(gpu, None);
        let target = self.mixed.create_view(&Default::default());
        let mut pass = passes.begin("fade", None, &[cleared(&target)], None);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        copy(&mut passes.encoder, &self.mixed, picture);
        gpu.queue.submit([passes.encoder.finish()]);
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
