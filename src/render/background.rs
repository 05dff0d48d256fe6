//! The video alone: copied, or undistorted at the same camera matrix K.
//! Reads the recorded picture. Writes the picture that is shown.

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::PixelRect;

use super::attachments::{loaded, texture};
use super::error::RenderError;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels, uniform};
use super::uniforms::{Lens, UniformRow};
use super::volumes::set_scissor;

/// Format of the pictures: sRGB-encoded bytes, encoded by the shaders so that untouched pixels pass as they came.
pub(super) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// Group 2 of every shader that includes video.wgsl.
pub(super) const VIDEO_GROUP: GroupLayout = GroupLayout {
    label: "video",
    entries: &[
        uniform(0, wgpu::ShaderStages::VERTEX_FRAGMENT, false),
        texels(1, false),
    ],
};

/// The recorded picture and the lens through which it was seen.
pub(super) struct Background {
    recorded: wgpu::Texture,
    pub size_px: [u32; 2],
    /// Whether the lens does.
    pub distorts: bool,
    pipeline: wgpu::RenderPipeline,
    /// What [`VIDEO_GROUP`] lays out.
    pub group: wgpu::BindGroup,
}

impl Background {
    pub fn new(gpu: &Gpu, intrinsics: &Intrinsics) -> Self {
        let recorded = texture(
            &gpu.device,
            "recorded picture",
            intrinsics.size_px,
            PICTURE_FORMAT,
            1,
            wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_DST
                | wgpu::TextureUsages::COPY_SRC,
        );
        let distorts = intrinsics.distortion.distorts();
        let lens = UniformRow::new::<Lens>(&gpu.device, "lens", 1);
        lens.write(&gpu.queue, 0, &Lens::new(intrinsics));
        let view = recorded.create_view(&Default::default());
        let video = wgpu::BindingResource::TextureView(&view);
        Self {
            pipeline: gpu.pipeline(&PipelineDescription {
                shader: "background.wgsl",
                fragment: "background",
                constants: vec![("DISTORTS", f64::from(distorts))],
                groups: vec![None, None, Some(VIDEO_GROUP)],
                targets: vec![overwritten(PICTURE_FORMAT)],
                ..Default::default()
            }),
            group: gpu.bind_group(&VIDEO_GROUP, [lens.binding(), video]),
            recorded,
            size_px: intrinsics.size_px,
            distorts,
        }
    }

    /// Takes the recorded picture to the GPU.
    ///
    /// # Errors
    /// A frame of another size than the camera's calibration.
    pub fn upload(&self, gpu: &Gpu, frame: &Frame) -> Result<(), RenderError> {
        if frame.size_px != self.size_px {
            return Err(RenderError::FrameSize {
                found: frame.size_px,
                expected: self.size_px,
            });
        }
        gpu.queue.write_texture(
            self.recorded.as_image_copy(),
            &frame.rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * frame.size_px[0]),
                rows_per_image: None,
            },
            self.recorded.size(),
        );
        gpu.check()
    }

    /// Fills the picture with the video where it is not yet (`stale`). A perfect lens needs no shader.
    pub fn draw(&self, passes: &mut Passes<'_>, picture: &wgpu::Texture, stale: PixelRect) {
        if stale.is_empty() {
            return;
        }
        if !self.distorts {
            let [x, y] = stale.low;
            let origin = wgpu::Origin3d { x, y, z: 0 };
            passes.note("background").copy_texture_to_texture(
                wgpu::TexelCopyTextureInfo {
                    origin,
                    ..self.recorded.as_image_copy()
                },
                wgpu::TexelCopyTextureInfo {
                    origin,
                    ..picture.as_image_copy()
                },
                wgpu::Extent3d {
                    width: stale.high[0] - x,
                    height: stale.high[1] - y,
                    depth_or_array_layers: 1,
                },
            );
            return;
        }
        let view = picture.create_view(&Default::default());
        let colors = [loaded(&view, wgpu::LoadOp::Load)];
        let mut pass = passes.begin(
            "background",
            Some(GpuSpan::Background.whole()),
            &colors,
            None,
        );
        set_scissor(&mut pass, stale);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(2, &self.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
