//! The scene's meshes on the GPU, each with its levels of detail. Objects stand still on their anchor, so their vertices
//! are kept in the anchor's space: one matrix per anchor draws all that it carries.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use wgpu::util::DeviceExt as _;

use crate::geometry::bounds::Bounds;
use crate::geometry::coincidence::may_coincide;
use crate::geometry::levels::{Level, levels};
use crate::geometry::mesh::Mesh;
use crate::geometry::outline_scale::largest_scale;
use crate::geometry::shadow_volume::Caster;
use crate::geometry::solid::holes;
use crate::scene::{Object, Scene, Shortcut};

/// The kind of model that a surface belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Real,
    Virtual,
}

/// A corner of a triangle, as `SurfaceCorner` in shading.wgsl reads it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct SurfaceCorner {
    position: Vec3,
    normal: Vec3,
    albedo: Vec3,
    /// 0: Lambert alone.
    roughness: f32,
}

/// Vertex layout of [`SurfaceCorner`].
pub(super) const CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<SurfaceCorner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4],
};

/// Vertex layout of [`SurfaceBatch::indirect`].
pub(super) const INDIRECT_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec3>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![3 => Float32x3],
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
}

/// One thing, in its anchor's space.
pub(super) struct AnchoredModel {
    pub role: Role,
    pub anchor: usize,
    /// Where two surfaces are in one place, one is to be seen: a virtual thing before a real one, and of virtual ones that
    /// of the larger number, the later in the scene. `None`: it is real, or in no place where another is.
    pub tie: Option<usize>,
    /// Around the mesh itself; its coarser levels lie within.
    pub bounds: Bounds,
    /// The mesh itself, then ever coarser ones.
    pub levels: Vec<ModelLevel>,
    pub casts: bool,
    /// Triangles that stand for it where others' shadows fall on it.
    pub receivers: Vec<[DVec3; 3]>,
}

/// A thing in one level of detail.
pub(super) struct ModelLevel {
    /// Its triangles among the batch's indices.
    pub range: Range<u32>,
    /// How far outlines are off at most and on the average, metres in the anchor's space.
    pub max_error_m: f64,
    pub mean_error_m: f64,
    /// Of the triangles that bend smoothly into one another, metres in the anchor's space; 0 for the mesh itself.
    pub largest_facet_m: f64,
    /// Triangles in the anchor's space over the holes through which alone its inside is seen from outside; `None` if it
    /// bounds no solid even so.
    pub holes: Option<Vec<[DVec3; 3]>>,
    pub caster: Option<LevelCaster>,
}

/// A caster of shadows: a model in one level of detail.
pub(super) struct LevelCaster {
    pub caster: Caster,
    /// See [`Caster::volume_vertices`].
    pub vertices: wgpu::Buffer,
    /// Each triangle's corners in the batch.
    pub surface_triangles: Vec<[u32; 3]>,
    /// Unit normals of each triangle's corners, in the anchor's space, if they are smooth.
    pub smooth_normals: Option<Vec<[Vec3; 3]>>,
}

/// Corners of a virtual batch (place and unit normal, in its anchor's space) and the triangles that join them.
pub(super) type VirtualCorners = (Vec<(Vec3, Vec3)>, Vec<[u32; 3]>);

/// Everything that stands on anchors.
pub(super) struct AnchorGeometry {
    pub batches: Vec<SurfaceBatch>,
    /// The real ones first.
    pub things: Vec<AnchoredModel>,
    /// For each virtual batch its anchor and corners.
    pub virtual_corners: Vec<(usize, VirtualCorners)>,
}

/// Coarser versions of meshes, which take long to make: each with the mesh that it is of.
#[derive(Default)]
pub(super) struct KnownLevels(Vec<(Mesh, Vec<Level>)>);

impl KnownLevels {
    /// The coarser versions of a mesh, made where they are not known.
    fn of(&mut self, mesh: &Mesh) -> &[Level] {
        let known = self.0.iter().position(|(known, _)| known == mesh);
        let index = known.unwrap_or_else(|| {
            self.0.push((mesh.clone(), levels(mesh)));
            self.0.len() - 1
        });
        &self.0[index].1
    }
}

impl AnchorGeometry {
    pub fn new(device: &wgpu::Device, scene: &Scene, known: &mut KnownLevels) -> Self {
        let ambient = (PI * scene.ambient_radiance).as_vec3();
        let mut geometry = Self {
            batches: Vec::new(),
            things: Vec::new(),
            virtual_corners: Vec::new(),
        };
        for (role, objects) in [
            (Role::Real, &scene.phantoms),
            (Role::Virtual, &scene.virtuals),
        ] {
            for anchor in 0..scene.node_count() {
                let mut shared = SharedCorners::default();
                let there = objects
                    .iter()
                    .enumerate()
                    .filter(|(_, object)| object.visible && object.anchor == anchor);
                for (index, object) in there {
                    let ties = role == Role::Virtual && ties(scene, index);
                    let tie = ties.then_some(index);
                    let coarsest_px = scene.shadows.max_silhouette_error_px;
                    let with_levels =
                        coarsest_px > 0.0 && !scene.shadows.without.has(Shortcut::Levels);
                    let coarser = match with_levels {
                        true => known.of(&object.mesh),
                        false => &[],
                    };
                    let thing = thing(device, (role, tie), object, coarser, &mut shared);
                    geometry.things.extend(thing);
                }
                if shared.triangles.is_empty() {
                    continue;
                }
                geometry
                    .batches
                    .push(shared.batch(device, role, anchor, ambient));
                if role == Role::Virtual {
                    let places = shared.corners.iter();
                    let places = places.map(|corner| (corner.position, corner.normal));
                    let corners = (places.collect(), shared.triangles);
                    geometry.virtual_corners.push((anchor, corners));
                }
            }
        }
        geometry
    }
}

/// Whether a virtual object may lie in the surface of a real one, or of a virtual one before it in the scene; where those
/// of other anchors will be is not known. All others keep their depth: what is nearer by a hair also shades what lies in
/// one plane with it, as far as a light at a hair above that plane throws the hair.
fn ties(scene: &Scene, index: usize) -> bool {
    let object = &scene.virtuals[index];
    let own = triangles_in_anchor(object);
    let others = scene.phantoms.iter().chain(&scene.virtuals[..index]);
    others.filter(|other| other.visible).any(|other| {
        other.anchor != object.anchor
            || may_coincide(&own, &triangles_in_anchor(other), IN_ONE_PLACE_M)
    })
}

/// Surfaces that are this near to each other, metres, may be drawn at the same depth.
const IN_ONE_PLACE_M: f64 = 1e-5;

/// An object's triangles where the GPU has them.
fn triangles_in_anchor(object: &Object) -> Vec<[DVec3; 3]> {
    let positions = object.positions_in_anchor(&object.mesh);
    let corner = |index: u32| positions[index as usize].as_dvec3();
    let triangles = object.mesh.triangles.iter();
    triangles.map(|triangle| triangle.map(corner)).collect()
}

/// Puts an object's levels among its batch's corners; `None` without triangles.
fn thing(
    device: &wgpu::Device,
    (role, tie): (Role, Option<usize>),
    object: &Object,
    coarser: &[Level],
    shared: &mut SharedCorners,
) -> Option<AnchoredModel> {
    let scale = largest_scale(&object.anchor_from_object);
    let itself = (&object.mesh, [0.0; 3]);
    let coarser = coarser.iter().map(|level| {
        let lengths_m = [level.max_error_m, level.mean_error_m, level.largest_facet_m];
        (&level.mesh, lengths_m)
    });
    let in_anchor =
        |corners: [DVec3; 3]| corners.map(|p| object.anchor_from_object.transform_point3(p));
    let mut receivers = Vec::new();
    let levels = std::iter::once(itself)
        .chain(coarser)
        .map(|(mesh, lengths_m)| {
            let [max_error_m, mean_error_m, largest_facet_m] =
                lengths_m.map(|length_m| length_m * scale);
            let positions = object.positions_in_anchor(mesh);
            let corner = |index: u32| positions[index as usize].as_dvec3();
            receivers = mesh.triangles.iter().map(|t| t.map(corner)).collect();
            let first = shared.triangles.len();
            let corners = corners(object, mesh);
            shared.add(&corners);
            let of_casting = || {
                let caster = Caster::new(positions, mesh.triangles.clone());
                LevelCaster {
                    vertices: device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                        label: Some("shadow volume"),
                        contents: bytemuck::cast_slice(&caster.volume_vertices()),
                        usage: wgpu::BufferUsages::VERTEX,
                    }),
                    caster,
                    surface_triangles: shared.triangles[first..].to_vec(),
                    smooth_normals: smooth_normals(&corners),
                }
            };
            ModelLevel {
                holes: holes(mesh).map(|holes| holes.into_iter().map(in_anchor).collect()),
                caster: object.casts.then(of_casting),
                range: 3 * first as u32..3 * shared.triangles.len() as u32,
                max_error_m,
                mean_error_m,
                largest_facet_m,
            }
        })
        .collect();
    let positions = object.positions_in_anchor(&object.mesh);
    Some(AnchoredModel {
        role,
        tie,
        anchor: object.anchor,
        bounds: Bounds::around(positions.iter().map(|position| position.as_dvec3()))?,
        levels,
        casts: object.casts,
        receivers,
    })
}

/// Corners that triangles share, and the triangles.
#[derive(Default)]
struct SharedCorners {
    corners: Vec<SurfaceCorner>,
    triangles: Vec<[u32; 3]>,
    index_of: HashMap<[u32; 10], u32>,
}

impl SharedCorners {
    /// Adds triangles, three corners each.
    fn add(&mut self, corners: &[SurfaceCorner]) {
        let indices: Vec<u32> = corners.iter().map(|corner| self.index(*corner)).collect();
        self.triangles.extend(indices.as_chunks::<3>().0);
    }

    fn index(&mut self, corner: SurfaceCorner) -> u32 {
        let next = self.corners.len() as u32;
        let index = *self.index_of.entry(bytemuck::cast(corner)).or_insert(next);
        if index == next {
            self.corners.push(corner);
        }
        index
    }

    fn batch(
        &self,
        device: &wgpu::Device,
        role: Role,
        anchor: usize,
        ambient: Vec3,
    ) -> SurfaceBatch {
        let buffer = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        SurfaceBatch {
            role,
            anchor,
            corners: buffer(
                "surface corners",
                bytemuck::cast_slice(&self.corners),
                wgpu::BufferUsages::VERTEX,
            ),
            indirect: buffer(
                "indirect light",
                bytemuck::cast_slice(&vec![ambient; self.corners.len()]),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            indices: buffer(
                "surface triangles",
                bytemuck::cast_slice(&self.triangles),
                wgpu::BufferUsages::INDEX,
            ),
        }
    }
}

/// Three corners for each triangle.
fn corners(object: &Object, mesh: &Mesh) -> Vec<SurfaceCorner> {
    let positions = object.positions_in_anchor(mesh);
    let normal_matrix = object.anchor_from_object.matrix3.inverse().transpose();
    mesh.triangles
        .iter()
        .zip(&mesh.corner_normals)
        .zip(&mesh.triangle_materials)
        .flat_map(|((triangle, normals), &material)| {
            let material = object.materials[material as usize];
            [0, 1, 2].map(|corner| SurfaceCorner {
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

/// The normals of triangles' corners unless each triangle has but one.
fn smooth_normals(corners: &[SurfaceCorner]) -> Option<Vec<[Vec3; 3]>> {
    let (triangles, _) = corners.as_chunks::<3>();
    let normals = || {
        triangles
            .iter()
            .map(|corners| corners.map(|corner| corner.normal))
    };
    normals()
        .any(|[a, b, c]| a != b || b != c)
        .then(|| normals().collect())
}
