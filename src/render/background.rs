//! The video alone: copied, or undistorted at the same camera matrix K.
//! Reads the recorded picture. Writes the picture that is shown.

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::PixelRect;

use super::gpu::{Gpu, RenderError};
use super::gpu_clock::{GpuClock, Stretch};
use super::shader;
use super::uniforms::{Lens, UniformRow, uniform_entry};
use super::volumes::set_scissor;

/// Format of the pictures: sRGB-encoded bytes, encoded by the shaders so that untouched pixels pass as they came.
pub(super) const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;

/// The recorded picture and the lens through which it was seen.
pub(super) struct Background {
    recorded: wgpu::Texture,
    pub size_px: [u32; 2],
    /// Whether the lens does.
    pub distorts: bool,
    pipeline: wgpu::RenderPipeline,
    /// Layout of [`Background::group`].
    pub layout: wgpu::BindGroupLayout,
    /// Group 2 of every shader that includes video.wgsl.
    pub group: wgpu::BindGroup,
}

impl Background {
    pub fn new(gpu: &Gpu, intrinsics: &Intrinsics) -> Self {
        let device = &gpu.device;
        let recorded = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("recorded picture"),
            size: extent(intrinsics.size_px),
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: PICTURE_FORMAT,
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_DST
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let distorts = intrinsics.distortion != [0.0; 5];
        let lens = UniformRow::new::<Lens>(device, "lens", 1);
        lens.write(&gpu.queue, 0, &Lens::new(intrinsics));
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("video"),
            entries: &[
                uniform_entry(0, false),
                wgpu::BindGroupLayoutEntry {
                    binding: 1,
                    visibility: wgpu::ShaderStages::FRAGMENT,
                    ty: wgpu::BindingType::Texture {
                        sample_type: wgpu::TextureSampleType::Float { filterable: false },
                        view_dimension: wgpu::TextureViewDimension::D2,
                        multisampled: false,
                    },
                    count: None,
                },
            ],
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("video"),
            layout: &layout,
            entries: &[
                wgpu::BindGroupEntry {
                    binding: 0,
                    resource: lens.binding(),
                },
                wgpu::BindGroupEntry {
                    binding: 1,
                    resource: wgpu::BindingResource::TextureView(
                        &recorded.create_view(&Default::default()),
                    ),
                },
            ],
        });
        let module = shader::module(
            device,
            "background",
            include_str!("../../shaders/background.wgsl"),
        );
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("background"),
            bind_group_layouts: &[None, None, Some(&layout)],
            immediate_size: 0,
        });
        Self {
            pipeline: shader::whole_picture(
                device,
                &pipeline_layout,
                &module,
                "background",
                &[Some(PICTURE_FORMAT.into())],
                None,
                &[("DISTORTS", f64::from(distorts))],
            ),
            recorded,
            size_px: intrinsics.size_px,
            distorts,
            layout,
            group,
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

    /// Fills the picture with the video where it is not yet (`stale`). A perfect lens needs no shader. Returns whether a
    /// pass was drawn.
    pub fn draw(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        picture: &wgpu::Texture,
        stale: PixelRect,
        clock: Option<&GpuClock>,
    ) -> bool {
        if stale.is_empty() {
            return false;
        }
        if !self.distorts {
            let [x, y] = stale.low;
            let origin = wgpu::Origin3d { x, y, z: 0 };
            encoder.copy_texture_to_texture(
                wgpu::TexelCopyTextureInfo {
                    origin,
                    ..self.recorded.as_image_copy()
                },
                wgpu::TexelCopyTextureInfo {
                    origin,
                    ..picture.as_image_copy()
                },
                extent([stale.high[0] - x, stale.high[1] - y]),
            );
            return false;
        }
        let view = picture.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("background"),
            color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                view: &view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Load,
                    store: wgpu::StoreOp::Store,
                },
            })],
            timestamp_writes: clock.and_then(|clock| clock.pass(Stretch::Background, true, true)),
            ..Default::default()
        });
        set_scissor(&mut pass, stale);
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(2, &self.group, &[]);
        pass.draw(0..3, 0..1);
        true
    }
}

/// A picture's size as wgpu wants it.
pub(super) fn extent([width, height]: [u32; 2]) -> wgpu::Extent3d {
    wgpu::Extent3d {
        width,
        height,
        depth_or_array_layers: 1,
    }
}
