//! What the shafts' shaders read from frame to frame, and the layouts of their vertices.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

use crate::shafts::receiver_patches::{PatchCorner, ReflectedCorner};

/// A frame's part of group 2: the twin of `ShaftFrame` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ShaftFrame {
    pub world_from_camera: Mat4,
    pub moving_irradiance: Vec3,
    pub source_count: u32,
}

/// Vertex layout of [`ReflectedCorner`].
pub(super) const REFLECTED_CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> =
    wgpu::VertexBufferLayout {
        array_stride: size_of::<ReflectedCorner>() as u64,
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
