//! What the shafts' shaders read, each the twin of a WGSL struct.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3};
use half::f16;

/// Twin of `Source` in source.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Source {
    pub map_from_world: Mat4,
    pub position: Vec3,
    pub spread_m: f32,
    pub intensity: Vec3,
    pub focal_texels: f32,
    pub tile_corner: Vec2,
    pub tile_side: Vec2,
    pub near_m: f32,
    pub range_m: f32,
    pub tile_px: f32,
    pub padding: f32,
}

/// Twin of `Frame` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Frame {
    pub world_from_camera: Mat4,
    pub source_count: u32,
    pub surfel_count: u32,
    pub padding: [u32; 2],
}

/// Twin of `Vertex` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct Vertex {
    pub normal: Vec3,
    pub normal_padding: f32,
    pub irradiance: Vec3,
    pub irradiance_padding: f32,
}

/// Twin of `Surfel` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct GpuSurfel {
    pub position: Vec3,
    pub area: f32,
    pub normal: Vec3,
    pub open_low: u32,
    pub radiance: Vec3,
    pub open_high: u32,
}

/// Twin of `PatchCorner` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct PatchCorner {
    pub position: Vec3,
    pub rows: [u32; 3],
}

/// Vertex layout of [`PatchCorner`].
pub(super) const PATCH_CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> =
    wgpu::VertexBufferLayout {
        array_stride: size_of::<PatchCorner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Uint32x3],
    };

/// Vertex layout of places alone.
pub(super) const PLACE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec3>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
};

/// Three halves in two words; what is too large for a half becomes the largest.
pub(super) fn packed(color: Vec3) -> [u32; 2] {
    let half = |value: f32| u32::from(f16::from_f32(value.min(65_504.0)).to_bits());
    [half(color.x) | half(color.y) << 16, half(color.z)]
}
