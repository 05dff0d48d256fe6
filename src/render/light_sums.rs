//! The targets that light is added up in, and the composite of video and virtual light that reads them.
//! Reads the recorded picture, `reaching` and `change`. Writes the picture that is shown, or the `gain` layer.

use super::attachments::{loaded, target};
use super::background::{Background, PICTURE_FORMAT, VIDEO_GROUP};
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels};
use super::technique::FrameContext;
use super::volumes::set_scissor;

/// Format of the gain layer.
pub(super) const GAIN_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// Group 0 of shaders that include pixel_sums.wgsl, with one sample per pixel.
const SINGLE_SAMPLE_GROUP: GroupLayout = GroupLayout {
    label: "light sums",
    entries: &[texels(0, false), texels(1, false)],
};

/// The same with several samples per pixel.
const MULTISAMPLED_GROUP: GroupLayout = GroupLayout {
    label: "multisampled light sums",
    entries: &[texels(0, true), texels(1, true)],
};

/// A shader that composites, and the flags that it is built with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct CompositeShader {
    pub shader: &'static str,
    pub flag: Option<&'static str>,
}

/// `video · gain + added`.
pub(super) const BY_GAIN: CompositeShader = CompositeShader {
    shader: "composite.wgsl",
    flag: None,
};

/// The targets that light is added to, and the pipelines that composite them.
pub(super) struct LightSums {
    /// See light_sums.wgsl.
    pub reaching: wgpu::TextureView,
    pub change: wgpu::TextureView,
    pub depth_stencil: wgpu::TextureView,
    composite: wgpu::RenderPipeline,
    gain: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
}

impl LightSums {
    pub fn new(
        gpu: &Gpu,
        background: &Background,
        samples: u32,
        composite: CompositeShader,
    ) -> Self {
        let target = |label, format, usage| {
            target(
                &gpu.device,
                label,
                background.size_px,
                format,
                samples,
                usage,
            )
        };
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let reaching = target("reaching", gpu.light_format, read);
        let change = target("change", gpu.light_format, read);
        let (group, multisampled) = match samples {
            1 => (SINGLE_SAMPLE_GROUP, None),
            _ => (MULTISAMPLED_GROUP, Some("MULTISAMPLED")),
        };
        let build = |fragment, format| {
            gpu.pipeline(&PipelineDescription {
                shader: composite.shader,
                flags: composite.flag.into_iter().chain(multisampled).collect(),
                fragment,
                constants: vec![
                    ("SAMPLES", f64::from(samples)),
                    ("DISTORTS", f64::from(background.distorts)),
                ],
                groups: vec![Some(group), None, Some(VIDEO_GROUP)],
                targets: vec![overwritten(format)],
                ..Default::default()
            })
        };
        Self {
            composite: build("composite", PICTURE_FORMAT),
            gain: build("gain", GAIN_FORMAT),
            group: gpu.bind_group(
                &group,
                [&reaching, &change].map(wgpu::BindingResource::TextureView),
            ),
            depth_stencil: target(
                "depth and stencil",
                gpu.depth_format,
                wgpu::TextureUsages::empty(),
            ),
            reaching,
            change,
        }
    }

    /// Draws video and virtual light together, where virtual things reach.
    pub fn composite(&self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        let colors = [loaded(frame.picture, wgpu::LoadOp::Load)];
        let part = GpuSpan::Composite.whole();
        let mut pass = passes.begin("composite", Some(part), &colors, None);
        self.draw(&mut pass, &self.composite, frame);
    }

    /// Draws the factor that is put on the video.
    pub fn draw_gain(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        gain: wgpu::RenderPassColorAttachment<'_>,
    ) {
        let mut pass = passes.begin("gain", None, &[gain], None);
        self.draw(&mut pass, &self.gain, frame);
    }

    fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        pipeline: &wgpu::RenderPipeline,
        frame: &FrameContext<'_>,
    ) {
        set_scissor(pass, frame.bounds.pixels);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, &self.group, &[]);
        pass.set_bind_group(2, &frame.background.group, &[]);
        pass.draw(0..3, 0..1);
    }
}
