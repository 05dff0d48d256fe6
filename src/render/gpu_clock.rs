//! What the frame's passes take on the GPU, by its own timestamps.

use super::error::RenderError;
use super::gpu::Gpu;
use super::readback::map_for_reading;

/// The last frame's time on the GPU, milliseconds, without what reflections take; `None` where nothing was drawn or the adapter
/// has no timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GpuTimes {
    /// Surfaces, shadow volumes and light.
    pub shadows_ms: Option<f64>,
    /// Undistortion and composite.
    pub composite_ms: Option<f64>,
}

/// A span of the frame between two timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum GpuSpan {
    Background,
    Light,
    Composite,
}

const SPANS: [GpuSpan; 3] = [GpuSpan::Background, GpuSpan::Light, GpuSpan::Composite];

/// A pass's part of a span.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SpanPart {
    pub span: GpuSpan,
    /// Whether the span begins with it.
    pub begins: bool,
    /// Whether the span ends with it.
    pub ends: bool,
}

impl GpuSpan {
    /// The part of a pass that is the span's only one.
    pub fn whole(self) -> SpanPart {
        self.part(true, true)
    }

    /// The part of one of the span's passes.
    pub fn part(self, begins: bool, ends: bool) -> SpanPart {
        SpanPart {
            span: self,
            begins,
            ends,
        }
    }
}

/// Two timestamps for each span of the frame.
pub(super) struct GpuClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    period_ns: f32,
    drawn: Vec<GpuSpan>,
}

impl GpuClock {
    const STRIDE: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

    pub fn new(device: &wgpu::Device, period_ns: f32) -> Self {
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: Self::STRIDE * SPANS.len() as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * SPANS.len() as u32,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            period_ns,
            drawn: Vec::new(),
        }
    }

    /// The timestamps that a pass writes; `None` if its span neither begins nor ends with it.
    pub fn writes(&self, part: SpanPart) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let SpanPart { span, begins, ends } = part;
        let begin = 2 * span as u32;
        (begins || ends).then(|| wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: begins.then_some(begin),
            end_of_pass_write_index: ends.then_some(begin + 1),
        })
    }

    pub fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder, drawn: &[GpuSpan]) {
        self.drawn = drawn.to_vec();
        for &span in drawn {
            let begin = 2 * span as u32;
            let offset = Self::STRIDE * span as u64;
            encoder.resolve_query_set(&self.queries, begin..begin + 2, &self.resolved, offset);
        }
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, self.readable.size());
    }

    pub fn read(&self, gpu: &Gpu) -> Result<GpuTimes, RenderError> {
        map_for_reading(gpu, &self.readable)?;
        let mapped = self
            .readable
            .slice(..)
            .get_mapped_range()
            .map_err(|error| RenderError::Failed(error.to_string()))?;
        let ticks: Vec<u64> = bytemuck::pod_collect_to_vec(&mapped);
        drop(mapped);
        self.readable.unmap();
        let span_ms = |span: GpuSpan| {
            let begin = span as usize * (Self::STRIDE / 8) as usize;
            let ticks = ticks[begin + 1].saturating_sub(ticks[begin]);
            let drawn = self.drawn.contains(&span);
            drawn.then(|| ticks as f64 * f64::from(self.period_ns) * 1e-6)
        };
        let picture = [GpuSpan::Background, GpuSpan::Composite];
        Ok(GpuTimes {
            shadows_ms: span_ms(GpuSpan::Light),
            composite_ms: picture.into_iter().filter_map(span_ms).reduce(|a, b| a + b),
        })
    }
}
