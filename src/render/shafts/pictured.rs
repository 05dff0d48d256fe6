//! Real things whose pictures say what they reflect: of the radiance that they lose, as of a surface that reflects all, the
//! part that they do. Reads depth and the pictures. Multiplies `change` (light_sums.wgsl).

use glam::Vec3;

use super::super::anchor_geometry::{LOOK_LAYOUT, corner_of_material};
use super::super::gpu::Gpu;
use super::super::gpu_scene::GpuScene;
use super::super::materials::{MATERIALS_GROUP, materials_group};
use super::super::pipelines::{PipelineDescription, multiplied, untouched};
use super::super::stencil::{ADDED, IN_A_SURFACE, depth_stencil_state, stencil};
use super::super::uniforms::GEOMETRY_GROUPS;
use crate::scene::Scene;

/// Vertex layout of places alone.
const PLACE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec3>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
};

/// The standing phantoms that have pictures, on the GPU.
pub(super) struct Pictured {
    /// Three corners for each triangle, in the world.
    places: wgpu::Buffer,
    looks: wgpu::Buffer,
    count: u32,
    materials: wgpu::BindGroup,
    pipeline: wgpu::RenderPipeline,
}

impl Pictured {
    /// Those of a scene; `None` without any.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Option<Self> {
        let things = || {
            scene
                .standing_phantoms()
                .filter(|object| object.is_pictured())
        };
        let (mut places, mut looks, mut first) = (Vec::new(), Vec::new(), 0);
        for object in things() {
            let mesh = &object.mesh;
            let positions = object.positions_in_anchor(mesh);
            for (number, triangle) in mesh.triangles.iter().enumerate() {
                places.extend(triangle.map(|index| positions[index as usize]));
                let corner = |corner| corner_of_material(object, mesh, (number, corner), first);
                looks.extend([0, 1, 2].map(corner));
            }
            first += object.materials.len() as u32;
        }
        let count = places.len() as u32;
        let vertices = |label, contents| gpu.buffer(label, contents, wgpu::BufferUsages::VERTEX);
        (count > 0).then(|| Self {
            places: vertices("pictured places", bytemuck::cast_slice(&places)),
            looks: vertices("pictured looks", bytemuck::cast_slice(&looks)),
            count,
            materials: materials_group(gpu, things()),
            pipeline: pipeline(gpu, scene.shadows.samples),
        })
    }

    /// Multiplies what all of them lose, where they are seen.
    pub fn multiply(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene) {
        gpu_scene.set_world(pass);
        pass.set_pipeline(&self.pipeline);
        pass.set_stencil_reference(0);
        pass.set_bind_group(3, &self.materials, &[]);
        pass.set_vertex_buffer(0, self.places.slice(..));
        pass.set_vertex_buffer(1, self.looks.slice(..));
        pass.draw(0..self.count, 0..1);
    }
}

fn pipeline(gpu: &Gpu, samples: u32) -> wgpu::RenderPipeline {
    let format = gpu.light_format;
    // Where surfaces coincide, one of them counts.
    let once = stencil(
        wgpu::CompareFunction::Equal,
        ADDED,
        (wgpu::StencilOperation::Invert, ADDED),
    );
    let seen = wgpu::CompareFunction::GreaterEqual;
    let seen = depth_stencil_state(gpu.depth_format, false, seen, once);
    gpu.pipeline(&PipelineDescription {
        shader: "real_albedo.wgsl",
        flags: vec!["LOOKS"],
        vertex: "place_pictured",
        fragment: "albedo_of_real",
        constants: vec![("MULTISAMPLED", f64::from(samples > 1))],
        groups: vec![
            Some(GEOMETRY_GROUPS[0]),
            Some(GEOMETRY_GROUPS[1]),
            None,
            Some(MATERIALS_GROUP),
        ],
        vertex_buffers: vec![PLACE_LAYOUT, LOOK_LAYOUT],
        targets: vec![untouched(format), multiplied(format)],
        depth_stencil: Some(wgpu::DepthStencilState {
            bias: IN_A_SURFACE,
            ..seen
        }),
        samples,
        ..Default::default()
    })
}
