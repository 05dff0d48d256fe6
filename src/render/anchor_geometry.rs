//! The scene's meshes on the GPU. Objects stand still on their anchor, so their vertices are kept in the anchor's
//! space: one matrix per anchor draws all that it carries.

use std::f64::consts::PI;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use wgpu::util::DeviceExt as _;

use crate::geometry::reach::Bounds;
use crate::geometry::shadow_volume::Caster;
use crate::light::bounce::Reflector;
use crate::scene::{Object, Scene};

/// What kind of thing a surface belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Real,
    Virtual,
}

/// A corner of a triangle, as `Corner` in surfaces.wgsl reads it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct Corner {
    position: Vec3,
    normal: Vec3,
    albedo: Vec3,
    /// 0: Lambert alone.
    roughness: f32,
}

/// Vertex layout of [`Corner`].
pub(super) const CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Corner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32],
};

/// Vertex layout of [`SurfaceBatch::indirect`].
pub(super) const INDIRECT_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec3>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![4 => Float32x3],
};

/// All surfaces of one role on one anchor.
pub(super) struct SurfaceBatch {
    pub role: Role,
    pub anchor: usize,
    pub corners: wgpu::Buffer,
    /// For each corner the irradiance that no light gives it.
    pub indirect: wgpu::Buffer,
    pub corner_count: u32,
}

/// One thing that takes light away, in its anchor's space.
pub(super) struct AnchoredCaster {
    pub role: Role,
    pub anchor: usize,
    pub caster: Caster,
}

/// The box around one thing, in its anchor's space.
pub(super) struct Extent {
    pub role: Role,
    pub anchor: usize,
    pub bounds: Bounds,
    pub casts: bool,
}

/// The extents of all things.
pub(super) fn extents(scene: &Scene) -> Vec<Extent> {
    let real = scene.phantoms.iter().map(|object| (Role::Real, object));
    let seeming = scene.virtuals.iter().map(|object| (Role::Virtual, object));
    real.chain(seeming)
        .filter_map(|(role, object)| {
            let points = positions_in_anchor(object)
                .into_iter()
                .map(|point| point.as_dvec3());
            let bounds = Bounds::around(points)?;
            Some(Extent {
                role,
                anchor: object.anchor,
                bounds,
                casts: object.casts,
            })
        })
        .collect()
}

/// Surfaces, the real ones first.
pub(super) fn surface_batches(device: &wgpu::Device, scene: &Scene) -> Vec<SurfaceBatch> {
    let roles = [
        (Role::Real, &scene.phantoms),
        (Role::Virtual, &scene.virtuals),
    ];
    let ambient = (PI * scene.ambient_radiance).as_vec3();
    let mut batches = Vec::new();
    for (role, objects) in roles {
        for anchor in 0..scene.anchors.len() {
            let corners: Vec<Corner> = objects
                .iter()
                .filter(|object| object.anchor == anchor)
                .flat_map(corners)
                .collect();
            if corners.is_empty() {
                continue;
            }
            batches.push(SurfaceBatch {
                role,
                anchor,
                corner_count: corners.len() as u32,
                corners: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("surface corners"),
                    contents: bytemuck::cast_slice(&corners),
                    usage: wgpu::BufferUsages::VERTEX,
                }),
                indirect: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("indirect light"),
                    contents: bytemuck::cast_slice(&vec![ambient; corners.len()]),
                    usage: wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                }),
            });
        }
    }
    batches
}

/// Casters, the real ones first.
pub(super) fn casters(scene: &Scene) -> Vec<AnchoredCaster> {
    let real = scene.phantoms.iter().map(|object| (Role::Real, object));
    let seeming = scene.virtuals.iter().map(|object| (Role::Virtual, object));
    real.chain(seeming)
        .filter(|(_, object)| object.casts)
        .map(|(role, object)| AnchoredCaster {
            role,
            anchor: object.anchor,
            caster: Caster::new(positions_in_anchor(object), object.mesh.triangles.clone()),
        })
        .collect()
}

fn positions_in_anchor(object: &Object) -> Vec<Vec3> {
    let place = |position: &Vec3| {
        object
            .anchor_from_object
            .transform_point3(position.as_dvec3())
            .as_vec3()
    };
    object.mesh.positions.iter().map(place).collect()
}

fn corners(object: &Object) -> Vec<Corner> {
    let positions = positions_in_anchor(object);
    let normal_matrix = object.anchor_from_object.matrix3.inverse().transpose();
    let mesh = &object.mesh;
    mesh.triangles
        .iter()
        .zip(&mesh.corner_normals)
        .zip(&mesh.triangle_materials)
        .flat_map(|((triangle, normals), &material)| {
            let material = object.materials[material as usize];
            [0, 1, 2].map(|corner| Corner {
                position: positions[triangle[corner] as usize],
                normal: (normal_matrix * normals[corner].as_dvec3())
                    .normalize_or_zero()
                    .as_vec3(),
                albedo: material.albedo.as_vec3(),
                roughness: material.roughness.unwrap_or(0.0) as f32,
            })
        })
        .collect()
}

/// The triangles of an object as what light meets there, in its anchor's space.
pub(super) fn reflectors(object: &Object) -> impl Iterator<Item = Reflector> {
    let positions = positions_in_anchor(object);
    let mesh = &object.mesh;
    mesh.triangles
        .iter()
        .zip(&mesh.triangle_materials)
        .map(move |(triangle, &material)| Reflector {
            corners: triangle.map(|index| positions[index as usize]),
            albedo: object.materials[material as usize].albedo,
        })
}

/// Place and normal of each corner of an object's triangles, in its anchor's space; the same order as in a batch.
pub(super) fn corner_places(object: &Object) -> impl Iterator<Item = (Vec3, Vec3)> {
    corners(object)
        .into_iter()
        .map(|corner| (corner.position, corner.normal))
}
