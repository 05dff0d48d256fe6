//! The passes of a frame, one after the other: recorded, timed and listed by name.

use super::gpu::Gpu;
use super::gpu_clock::{GpuClock, GpuSpan, SpanPart};

/// Passes that are being recorded.
pub(super) struct Passes<'a> {
    pub encoder: wgpu::CommandEncoder,
    clock: Option<&'a GpuClock>,
    names: Vec<&'static str>,
    spans: Vec<GpuSpan>,
}

/// Passes that are recorded.
pub(super) struct RecordedPasses {
    pub encoder: wgpu::CommandEncoder,
    /// Of all passes in their order.
    pub names: Vec<&'static str>,
    /// The spans that were timed.
    pub spans: Vec<GpuSpan>,
}

impl<'a> Passes<'a> {
    /// None so far; without a clock they are not timed.
    pub fn new(gpu: &Gpu, clock: Option<&'a GpuClock>) -> Self {
        Self {
            encoder: gpu.device.create_command_encoder(&Default::default()),
            clock,
            names: Vec::new(),
            spans: Vec::new(),
        }
    }

    /// What is recorded from here on is not timed: a span of the clock is one of passes that come once.
    pub fn stop_clock(&mut self) {
        self.clock = None;
    }

    /// Begins a pass that draws into colour targets, and depth and stencil.
    pub fn begin(
        &mut self,
        name: &'static str,
        part: Option<SpanPart>,
        colors: &[wgpu::RenderPassColorAttachment<'_>],
        depth_stencil: Option<wgpu::RenderPassDepthStencilAttachment<'_>>,
    ) -> wgpu::RenderPass<'_> {
        self.names.push(name);
        let part = part.filter(|_| self.clock.is_some());
        self.spans
            .extend(part.filter(|part| part.begins).map(|part| part.span));
        let colors: Vec<Option<wgpu::RenderPassColorAttachment<'_>>> =
            colors.iter().cloned().map(Some).collect();
        let timed = self.clock.zip(part);
        self.encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(name),
            color_attachments: &colors,
            depth_stencil_attachment: depth_stencil,
            timestamp_writes: timed.and_then(|(clock, part)| clock.writes(part)),
            ..Default::default()
        })
    }

    /// Takes note of work on the GPU that is no pass.
    pub fn note(&mut self, name: &'static str) -> &mut wgpu::CommandEncoder {
        self.names.push(name);
        &mut self.encoder
    }

    /// Ends the recording.
    pub fn finish(self) -> RecordedPasses {
        let Self {
            encoder,
            names,
            spans,
            ..
        } = self;
        RecordedPasses {
            encoder,
            names,
            spans,
        }
    }
}
