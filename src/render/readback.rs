//! Brings a texture's texels back to the processor.

use super::error::RenderError;
use super::gpu::Gpu;

/// A buffer that a texture is copied into and read from.
pub(super) struct Readback {
    buffer: wgpu::Buffer,
    size_px: [u32; 2],
    texel_bytes: u32,
    padded_row_bytes: u32,
}

impl Readback {
    pub fn new(device: &wgpu::Device, size_px: [u32; 2], texel_bytes: u32) -> Self {
        let padded_row_bytes =
            (size_px[0] * texel_bytes).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: u64::from(padded_row_bytes) * u64::from(size_px[1]),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Self {
            buffer,
            size_px,
            texel_bytes,
            padded_row_bytes,
        }
    }

    pub fn copy_from(&self, encoder: &mut wgpu::CommandEncoder, texture: &wgpu::Texture) {
        encoder.copy_texture_to_buffer(
            texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &self.buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(self.padded_row_bytes),
                    rows_per_image: None,
                },
            },
            texture.size(),
        );
    }

    /// Waits for the GPU and returns the texels, rows from the top without padding.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u8>, RenderError> {
        map_for_reading(gpu, &self.buffer)?;
        let row_bytes = (self.size_px[0] * self.texel_bytes) as usize;
        let mapped = self
            .buffer
            .slice(..)
            .get_mapped_range()
            .map_err(|error| RenderError::Failed(error.to_string()))?;
        let mut texels = Vec::with_capacity(row_bytes * self.size_px[1] as usize);
        for row in mapped.chunks(self.padded_row_bytes as usize) {
            texels.extend_from_slice(&row[..row_bytes]);
        }
        drop(mapped);
        self.buffer.unmap();
        Ok(texels)
    }
}

/// Waits for the GPU and maps the whole buffer; the caller unmaps it.
pub(super) fn map_for_reading(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<(), RenderError> {
    gpu.check()?;
    let (sender, receiver) = std::sync::mpsc::channel();
    buffer
        .slice(..)
        .map_async(wgpu::MapMode::Read, move |result| {
            // The receiver lives until the wait below is over.
            let _ = sender.send(result);
        });
    gpu.wait()?;
    // Another thread's wait may have taken our call-back along and be about to make it.
    match receiver.recv() {
        Ok(Ok(())) => Ok(()),
        Ok(Err(error)) => Err(RenderError::Failed(error.to_string())),
        Err(error) => Err(RenderError::Failed(error.to_string())),
    }
}
