//! The scene's meshes on the GPU. Objects stand still on their anchor, so their vertices are kept in the anchor's
//! space: one matrix per anchor draws all that it carries.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use wgpu::util::DeviceExt as _;

use crate::geometry::bounds::Bounds;
use crate::geometry::shadow_volume::Caster;
use crate::light::bounce::Reflector;
use crate::scene::{Object, Scene};

/// What kind of thing a surface belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Real,
    Virtual,
}

/// A corner of a triangle, as `Corner` in shading.wgsl reads it.
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
    /// What triangles share: corners of the same place, normal and material.
    pub corners: wgpu::Buffer,
    /// For each corner the irradiance that no light gives it.
    pub indirect: wgpu::Buffer,
    pub indices: wgpu::Buffer,
    pub index_count: u32,
}

/// One thing that takes light away, in its anchor's space.
pub(super) struct AnchoredCaster {
    pub role: Role,
    pub anchor: usize,
    pub caster: Caster,
    /// See [`Caster::volume_vertices`].
    pub vertices: wgpu::Buffer,
    /// Where a virtual thing's surface is in its batch.
    pub surface: Option<SurfacePart>,
}

/// The surface of one thing as part of its batch.
pub(super) struct SurfacePart {
    /// Each triangle's corners in the batch.
    pub triangles: Vec<[u32; 3]>,
    /// Its place among the batch's indices.
    pub range: Range<u32>,
    /// Unit normals of each triangle's corners, in the anchor's space, if they light more than the triangles that face
    /// the light.
    pub smooth_normals: Option<Vec<[Vec3; 3]>>,
}

/// The box around one thing, in its anchor's space.
pub(super) struct Extent {
    pub role: Role,
    pub anchor: usize,
    pub bounds: Bounds,
    /// Which caster it is, if it casts.
    pub caster: Option<usize>,
}

/// The extents of all things.
pub(super) fn extents(scene: &Scene) -> Vec<Extent> {
    let mut casters = 0..;
    objects(scene)
        .filter_map(|(role, object)| {
            let caster = object.casts.then(|| casters.next()).flatten();
            let points = positions_in_anchor(object)
                .into_iter()
                .map(|point| point.as_dvec3());
            Some(Extent {
                role,
                anchor: object.anchor,
                bounds: Bounds::around(points)?,
                caster,
            })
        })
        .collect()
}

/// Surfaces, the real ones first.
pub(super) fn surface_batches(device: &wgpu::Device, scene: &Scene) -> Vec<SurfaceBatch> {
    let ambient = (PI * scene.ambient_radiance).as_vec3();
    let buffer = |label, contents: &[u8], usage| {
        device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
    };
    let mut batches = Vec::new();
    for role in [Role::Real, Role::Virtual] {
        for anchor in 0..scene.anchors.len() {
            let mut shared = SharedCorners::default();
            for object in batch(scene, role, anchor) {
                shared.add(object);
            }
            let SharedCorners {
                corners, triangles, ..
            } = shared;
            if triangles.is_empty() {
                continue;
            }
            batches.push(SurfaceBatch {
                role,
                anchor,
                index_count: 3 * triangles.len() as u32,
                corners: buffer(
                    "surface corners",
                    bytemuck::cast_slice(&corners),
                    wgpu::BufferUsages::VERTEX,
                ),
                indirect: buffer(
                    "indirect light",
                    bytemuck::cast_slice(&vec![ambient; corners.len()]),
                    wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
                ),
                indices: buffer(
                    "surface triangles",
                    bytemuck::cast_slice(&triangles),
                    wgpu::BufferUsages::INDEX,
                ),
            });
        }
    }
    batches
}

/// Casters, the real ones first.
pub(super) fn casters(device: &wgpu::Device, scene: &Scene) -> Vec<AnchoredCaster> {
    let mut surfaces = virtual_surfaces(scene);
    objects(scene)
        .filter(|(_, object)| object.casts)
        .map(|(role, object)| {
            let caster = Caster::new(positions_in_anchor(object), object.mesh.triangles.clone());
            AnchoredCaster {
                role,
                anchor: object.anchor,
                vertices: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some("shadow volume"),
                    contents: bytemuck::cast_slice(&caster.volume_vertices()),
                    usage: wgpu::BufferUsages::VERTEX,
                }),
                caster,
                surface: match role {
                    Role::Real => None,
                    Role::Virtual => surfaces.remove(object.name.as_str()),
                },
            }
        })
        .collect()
}

/// All things, the real ones first.
fn objects(scene: &Scene) -> impl Iterator<Item = (Role, &Object)> {
    let real = scene.phantoms.iter().map(|object| (Role::Real, object));
    let seeming = scene.virtuals.iter().map(|object| (Role::Virtual, object));
    real.chain(seeming)
}

/// The things of one batch, in their order in it.
fn batch(scene: &Scene, role: Role, anchor: usize) -> impl Iterator<Item = &Object> {
    objects(scene)
        .filter(move |(found, object)| *found == role && object.anchor == anchor)
        .map(|(_, object)| object)
}

/// Anchor and place in their batches of the virtual things that hide no light.
pub(super) fn virtuals_without_shadow(scene: &Scene) -> Vec<(usize, Range<u32>)> {
    let mut surfaces = virtual_surfaces(scene);
    let virtuals = scene.virtuals.iter().filter(|object| !object.casts);
    virtuals
        .filter_map(|object| Some((object.anchor, surfaces.remove(object.name.as_str())?.range)))
        .collect()
}

/// The surfaces of virtual things, by name.
fn virtual_surfaces(scene: &Scene) -> HashMap<&str, SurfacePart> {
    let mut surfaces = HashMap::new();
    for anchor in 0..scene.anchors.len() {
        let mut shared = SharedCorners::default();
        for object in batch(scene, Role::Virtual, anchor) {
            let first = shared.triangles.len();
            shared.add(object);
            let normals: Vec<Vec3> = corners(object).map(|corner| corner.normal).collect();
            let (corner_normals, _) = normals.as_chunks::<3>();
            let is_smooth = corner_normals.iter().any(|[a, b, c]| a != b || b != c);
            let surface = SurfacePart {
                triangles: shared.triangles[first..].to_vec(),
                range: 3 * first as u32..3 * shared.triangles.len() as u32,
                smooth_normals: is_smooth.then(|| corner_normals.to_vec()),
            };
            surfaces.insert(object.name.as_str(), surface);
        }
    }
    surfaces
}

/// Corners that triangles share, and the triangles.
#[derive(Default)]
struct SharedCorners {
    corners: Vec<Corner>,
    triangles: Vec<[u32; 3]>,
    index_of: HashMap<[u32; 10], u32>,
}

impl SharedCorners {
    fn add(&mut self, object: &Object) {
        let indices: Vec<u32> = corners(object).map(|corner| self.index(corner)).collect();
        self.triangles.extend(indices.as_chunks::<3>().0);
    }

    fn index(&mut self, corner: Corner) -> u32 {
        let next = self.corners.len() as u32;
        let index = *self.index_of.entry(bytemuck::cast(corner)).or_insert(next);
        if index == next {
            self.corners.push(corner);
        }
        index
    }
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

/// Three corners for each triangle.
fn corners(object: &Object) -> impl Iterator<Item = Corner> {
    let positions = positions_in_anchor(object);
    let normal_matrix = object.anchor_from_object.matrix3.inverse().transpose();
    let mesh = &object.mesh;
    mesh.triangles
        .iter()
        .zip(&mesh.corner_normals)
        .zip(&mesh.triangle_materials)
        .flat_map(move |((triangle, normals), &material)| {
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

/// The virtual things of one anchor as their batch has them: place and normal of each shared corner, and the triangles.
pub(super) fn virtual_corners(scene: &Scene, anchor: usize) -> (Vec<(Vec3, Vec3)>, Vec<[u32; 3]>) {
    let mut shared = SharedCorners::default();
    for object in batch(scene, Role::Virtual, anchor) {
        shared.add(object);
    }
    let places = shared.corners.iter();
    let places = places
        .map(|corner| (corner.position, corner.normal))
        .collect();
    (places, shared.triangles)
}
