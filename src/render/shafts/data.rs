//! What the shafts' shaders read, each the twin of a WGSL struct.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec2, Vec3};
use half::f16;

/// Twin of `Source` in source.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Source {
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

impl Source {
    /// Whether casters may hide the source from a triangle: whether it meets what the map shows.
    pub fn may_shade(&self, corners: [Vec3; 3]) -> bool {
        let placed = corners.map(|corner| self.map_from_world * corner.extend(1.0));
        if placed.iter().all(|corner| corner.w <= self.near_m) {
            return false;
        }
        // A triangle that reaches behind the source has no bounds in the map.
        if placed.iter().any(|corner| corner.w <= 1e-6) {
            return true;
        }
        let in_tile = placed.map(|corner| Vec2::new(corner.x, corner.y) / corner.w);
        let low = in_tile.into_iter().fold(Vec2::MAX, Vec2::min);
        let high = in_tile.into_iter().fold(Vec2::MIN, Vec2::max);
        low.cmple(Vec2::ONE).all() && high.cmpge(Vec2::ZERO).all()
    }
}

/// Twin of `Frame` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct Frame {
    pub world_from_camera: Mat4,
    pub source_count: u32,
    pub padding_1: u32,
    pub padding_2: u32,
    pub padding_3: u32,
}

/// Twin of `PatchCorner` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct PatchCorner {
    pub position: Vec3,
    pub rows: [u32; 3],
    pub weights: [f32; 2],
    pub list: [u32; 2],
}

/// Twin of `ThrownCorner` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct ThrownCorner {
    pub position: Vec3,
    pub irradiance: Vec3,
}

/// Vertex layout of [`ThrownCorner`].
pub(super) const THROWN_CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> =
    wgpu::VertexBufferLayout {
        array_stride: size_of::<ThrownCorner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3],
    };

/// Vertex layout of [`PatchCorner`].
pub(super) const PATCH_CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> =
    wgpu::VertexBufferLayout {
        array_stride: size_of::<PatchCorner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![
            0 => Float32x3, 1 => Uint32x3, 2 => Float32x2, 3 => Uint32x2
        ],
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
