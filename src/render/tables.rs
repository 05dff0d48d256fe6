//! Tables: textures of words, four a texel, that fragments read at any place (tables.wgsl).

use glam::{Vec3, Vec4};
use wgpu::util::DeviceExt as _;

use super::gpu::Gpu;

/// Texels in a row of a table: `TABLE_WIDTH` in tables.wgsl.
const TABLE_WIDTH: usize = 1024;

/// A texture of so many texels at least, in rows of [`TABLE_WIDTH`].
pub(super) fn table(gpu: &Gpu, label: &str, texels: &[[u32; 4]]) -> wgpu::TextureView {
    let rows = texels.len().div_ceil(TABLE_WIDTH).max(1);
    let mut padded = texels.to_vec();
    padded.resize(rows * TABLE_WIDTH, [0; 4]);
    let texture = gpu.device.create_texture_with_data(
        &gpu.queue,
        &wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: TABLE_WIDTH as u32,
                height: rows as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        },
        wgpu::util::TextureDataOrder::LayerMajor,
        bytemuck::cast_slice(&padded),
    );
    texture.create_view(&Default::default())
}

/// The number of texels that a table can have at most.
pub(super) fn most_texels(gpu: &Gpu) -> usize {
    TABLE_WIDTH * gpu.device.limits().max_texture_dimension_2d as usize
}

/// A texel of four numbers.
pub(super) fn words(values: Vec4) -> [u32; 4] {
    values.to_array().map(f32::to_bits)
}

/// A texel of three numbers and a word.
pub(super) fn with_word(values: Vec3, word: u32) -> [u32; 4] {
    let [x, y, z] = values.to_array().map(f32::to_bits);
    [x, y, z, word]
}
