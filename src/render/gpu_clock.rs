//! What the frame's passes take on the GPU, by its own timestamps.

use super::gpu::{Gpu, RenderError};
use super::readback::map_for_reading;

/// What the last frame cost on the GPU, milliseconds; `None` where nothing was drawn or the adapter has no timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GpuTimes {
    /// Surfaces, shadow volumes and light.
    pub shadows_ms: Option<f64>,
    /// Undistortion and composite.
    pub composite_ms: Option<f64>,
}

/// A part of the frame between two timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Stretch {
    Background,
    Light,
    Composite,
}

const STRETCHES: [Stretch; 3] = [Stretch::Background, Stretch::Light, Stretch::Composite];

/// Two timestamps for each stretch of the frame.
pub(super) struct GpuClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    period_ns: f32,
    drawn: Vec<Stretch>,
}

impl GpuClock {
    const STRIDE: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

    pub fn new(device: &wgpu::Device, period_ns: f32) -> Self {
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: Self::STRIDE * STRETCHES.len() as u64,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * STRETCHES.len() as u32,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            period_ns,
            drawn: Vec::new(),
        }
    }

    /// For a pass of a stretch; `None` if it is neither its first nor its last.
    pub fn pass(
        &self,
        stretch: Stretch,
        first: bool,
        last: bool,
    ) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let begin = 2 * stretch as u32;
        (first || last).then(|| wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(begin),
            end_of_pass_write_index: last.then_some(begin + 1),
        })
    }

    pub fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder, drawn: &[Stretch]) {
        self.drawn = drawn.to_vec();
        for &stretch in drawn {
            let begin = 2 * stretch as u32;
            let offset = Self::STRIDE * stretch as u64;
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
        let stretch_ms = |stretch: Stretch| {
            let begin = stretch as usize * (Self::STRIDE / 8) as usize;
            let ticks = ticks[begin + 1].saturating_sub(ticks[begin]);
            let drawn = self.drawn.contains(&stretch);
            drawn.then(|| ticks as f64 * f64::from(self.period_ns) * 1e-6)
        };
        let picture = [Stretch::Background, Stretch::Composite];
        Ok(GpuTimes {
            shadows_ms: stretch_ms(Stretch::Light),
            composite_ms: picture
                .into_iter()
                .filter_map(stretch_ms)
                .reduce(|a, b| a + b),
        })
    }
}
