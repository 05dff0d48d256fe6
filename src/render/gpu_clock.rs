//! What the frame's passes take on the GPU, by its own timestamps.

use super::gpu::{Gpu, RenderError};
use super::readback::map_for_reading;

/// What the last frame cost on the GPU, milliseconds; `None` where the adapter has no timestamps.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct GpuTimes {
    /// Surfaces, shadow volumes and light.
    pub shadows_ms: Option<f64>,
    /// Undistortion and composite.
    pub composite_ms: Option<f64>,
}

/// Timestamps at the ends of the frame's two stretches: light (0, 1) and composite (2, 3).
pub(super) struct GpuClock {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readable: wgpu::Buffer,
    period_ns: f32,
    light_drawn: bool,
}

impl GpuClock {
    const BYTES: u64 = 4 * 8;

    pub fn new(device: &wgpu::Device, period_ns: f32) -> Self {
        let buffer = |usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: Self::BYTES,
                usage,
                mapped_at_creation: false,
            })
        };
        Self {
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 4,
            }),
            resolved: buffer(wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC),
            readable: buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            period_ns,
            light_drawn: false,
        }
    }

    pub fn light(&self, first: bool, last: bool) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: first.then_some(0),
            end_of_pass_write_index: last.then_some(1),
        }
    }

    pub fn composite(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2),
            end_of_pass_write_index: Some(3),
        }
    }

    pub fn resolve(&mut self, encoder: &mut wgpu::CommandEncoder, light_drawn: bool) {
        self.light_drawn = light_drawn;
        let first = if light_drawn { 0 } else { 2 };
        encoder.resolve_query_set(&self.queries, first..4, &self.resolved, 0);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readable, 0, Self::BYTES);
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
        let stretch_ms = |begin: usize| {
            let ticks = ticks[begin + 1].saturating_sub(ticks[begin]);
            Some(ticks as f64 * f64::from(self.period_ns) * 1e-6)
        };
        Ok(if self.light_drawn {
            GpuTimes {
                shadows_ms: stretch_ms(0),
                composite_ms: stretch_ms(2),
            }
        } else {
            GpuTimes {
                shadows_ms: None,
                composite_ms: stretch_ms(0),
            }
        })
    }
}
