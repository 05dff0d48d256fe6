//! The scene's meshes on the GPU, each with its levels of detail. Objects stand still on their anchor, so their vertices
//! are kept in the anchor's space: one matrix per anchor draws all that it carries.

use std::collections::HashMap;
use std::f64::consts::PI;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};

use crate::geometry::bounds::Bounds;
use crate::geometry::coincidence::{IN_ONE_PLACE_M, may_coincide};
use crate::geometry::levels::Level;
use crate::geometry::mesh::{CornerLook, HeldCorner, HeldNormal, Mesh};
use crate::geometry::outline_scale::largest_scale;
use crate::geometry::shadow_volume::Caster;
use crate::geometry::solid::holes;
use crate::scene::{Object, Scene};

use super::gpu::Gpu;
use super::known_levels::KnownLevels;
use super::materials::needs_looks;

/// The kind of model that a surface belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    Real,
    Virtual,
}

/// A corner of a triangle, as `SurfaceCorner` in shading.wgsl reads it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct SurfaceCorner {
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

/// What a corner has where any material of the scene's virtual things needs more, as `SurfaceCorner` in shading.wgsl reads it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct CornerOfMaterial {
    uv: [f32; 4],
    color: [f32; 4],
    tangent: [f32; 4],
    /// Number of the material among all of the virtual things'.
    material: u32,
}

/// Vertex layout of [`CornerOfMaterial`].
pub(super) const LOOK_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<CornerOfMaterial>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![4 => Float32x4, 5 => Float32x4, 6 => Float32x4, 7 => Uint32],
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
    /// For each corner a [`CornerOfMaterial`], where the scene needs them.
    pub looks: Option<wgpu::Buffer>,
    /// Where a technique gives it.
    pub occlusion: Option<OcclusionCorners>,
    /// The same corners as values.
    pub places: BatchCorners,
}

/// A batch's corners, in its anchor's space.
pub(super) struct BatchCorners {
    /// Place and unit normal of each, and the triangles that join them.
    pub corners: Corners,
    /// For each corner the number of its thing, phantoms first.
    pub thing_of: Vec<u32>,
}

/// What is known of light from afar at each corner of a batch.
pub(super) struct OcclusionCorners {
    /// Its self-occlusion ([`OCCLUSION_LAYOUT`]).
    pub own: wgpu::Buffer,
    /// The part of its irradiance that is of what things reflect; on phantoms what virtual things take of that ([`REFLECTED_LAYOUT`]).
    pub reflected: wgpu::Buffer,
}

/// Vertex layout of [`OcclusionCorners::reflected`].
pub(super) const REFLECTED_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: 12,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![13 => Float32x3],
};

/// Vertex layout of [`OcclusionCorners::own`]: visibility in 16 harmonics, and the number of the thing.
pub(super) const OCCLUSION_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: 68,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![
        8 => Float32x4, 9 => Float32x4, 10 => Float32x4, 11 => Float32x4, 12 => Uint32
    ],
};

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

/// Corners of a batch (place and unit normal, in its anchor's space) and the triangles that join them.
pub(super) type Corners = (Vec<(Vec3, Vec3)>, Vec<[u32; 3]>);

/// Everything that stands on anchors.
pub(super) struct AnchorGeometry {
    pub batches: Vec<SurfaceBatch>,
    /// The real ones first.
    pub things: Vec<AnchoredModel>,
}

impl AnchorGeometry {
    pub fn new(gpu: &Gpu, scene: &Scene, known: &mut KnownLevels) -> Self {
        let ambient = (PI * scene.ambient_radiance).as_vec3();
        let mut geometry = Self {
            batches: Vec::new(),
            things: Vec::new(),
        };
        let things = scene.phantoms.iter().chain(&scene.virtuals);
        let surfaces: Vec<_> = things.map(triangles_in_anchor).collect();
        let needs_looks = scene.virtuals.iter().any(needs_looks);
        for (role, objects) in [
            (Role::Real, &scene.phantoms),
            (Role::Virtual, &scene.virtuals),
        ] {
            for anchor in 0..scene.node_count() {
                let mut shared = SharedCorners {
                    looks: (needs_looks && role == Role::Virtual).then(Vec::new),
                    ..SharedCorners::default()
                };
                let there = objects
                    .iter()
                    .enumerate()
                    .filter(|(_, object)| object.visible && object.anchor == anchor);
                for (index, object) in there {
                    let ties = role == Role::Virtual && ties(scene, &surfaces, index);
                    let tie = ties.then_some(index);
                    let drawn = known.of(scene, object);
                    let before = objects.iter().take(index);
                    shared.first_material =
                        before.map(|object| object.materials.len() as u32).sum();
                    shared.thing = match role {
                        Role::Real => index,
                        Role::Virtual => scene.phantoms.len() + index,
                    } as u32;
                    let thing = thing(gpu, (role, tie), object, drawn, &mut shared);
                    geometry.things.extend(thing);
                }
                if shared.triangles.is_empty() {
                    continue;
                }
                geometry
                    .batches
                    .push(shared.batch(gpu, role, anchor, ambient));
            }
        }
        geometry
    }
}

/// Whether a virtual object may lie in the surface of a real one, or of a virtual one before it in the scene; where those
/// of other anchors will be is not known. All others keep their depth: what is nearer by a hair also shades what lies in
/// one plane with it, as far as a light at a hair above that plane throws the hair.
///
/// `surfaces` has the triangles of each phantom, then of each virtual object, in its anchor.
fn ties(scene: &Scene, surfaces: &[Vec<[DVec3; 3]>], index: usize) -> bool {
    let object = &scene.virtuals[index];
    let own = &surfaces[scene.phantoms.len() + index];
    let others = scene.phantoms.iter().chain(&scene.virtuals[..index]);
    let mut others = others.zip(surfaces).filter(|(other, _)| other.visible);
    others.any(|(other, triangles)| {
        other.anchor != object.anchor || may_coincide(own, triangles, IN_ONE_PLACE_M)
    })
}

/// An object's triangles where the GPU has them.
fn triangles_in_anchor(object: &Object) -> Vec<[DVec3; 3]> {
    let positions = object.positions_in_anchor(&object.mesh);
    let corner = |index: u32| positions[index as usize].as_dvec3();
    let triangles = object.mesh.triangles.iter();
    triangles.map(|triangle| triangle.map(corner)).collect()
}

/// Puts an object's levels among its batch's corners; `None` without triangles.
fn thing(
    gpu: &Gpu,
    (role, tie): (Role, Option<usize>),
    object: &Object,
    (mesh, coarser): (&Mesh, &[Level]),
    shared: &mut SharedCorners,
) -> Option<AnchoredModel> {
    let scale = largest_scale(&object.anchor_from_object);
    let itself = (mesh, [0.0; 3]);
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
            shared.add(object, mesh, &corners);
            let of_casting = || {
                let caster = Caster::new(positions, mesh.triangles.clone());
                LevelCaster {
                    vertices: gpu.buffer(
                        "shadow volume",
                        bytemuck::cast_slice(&caster.volume_vertices()),
                        CHANGING,
                    ),
                    caster,
                    surface_triangles: shared.triangles[first..].to_vec(),
                    smooth_normals: smooth_normals(&corners),
                }
            };
            // (What changes its shape may pass through itself, now or then: its inside is reckoned with everywhere.)
            let holes = object.animation.is_none().then(|| holes(mesh)).flatten();
            ModelLevel {
                holes: holes.map(|holes| holes.into_iter().map(in_anchor).collect()),
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

/// What corners are told apart by: thing, place, normal and material, what else a corner has, and what moves it.
type CornerKey = (u32, [u32; 10], [u32; 13], [u32; 7]);

/// Corners that triangles share, and the triangles.
#[derive(Default)]
struct SharedCorners {
    corners: Vec<SurfaceCorner>,
    triangles: Vec<[u32; 3]>,
    index_of: HashMap<CornerKey, u32>,
    /// For each corner the number of its thing.
    thing_of: Vec<u32>,
    /// Number of the thing at hand, phantoms first.
    thing: u32,
    /// What corners have besides, where any virtual thing needs it.
    looks: Option<Vec<CornerOfMaterial>>,
    /// Number of the first material of the thing at hand.
    first_material: u32,
}

impl SharedCorners {
    /// Adds triangles, three corners each.
    fn add(&mut self, object: &Object, mesh: &Mesh, corners: &[SurfaceCorner]) {
        let with_looks = self.looks.is_some();
        let first_material = self.first_material;
        let look = |number: usize| match with_looks {
            true => corner_of_material(object, mesh, (number / 3, number % 3), first_material),
            false => CornerOfMaterial::zeroed(),
        };
        let numbered = corners.iter().enumerate();
        let indices: Vec<u32> = numbered
            .map(|(number, corner)| self.index(*corner, look(number), moved_by(mesh, number)))
            .collect();
        self.triangles.extend(indices.as_chunks::<3>().0);
    }

    fn index(&mut self, corner: SurfaceCorner, look: CornerOfMaterial, moved_by: [u32; 7]) -> u32 {
        let next = self.corners.len() as u32;
        let (corner_key, look_key) = (bytemuck::cast(corner), bytemuck::cast(look));
        let key = (self.thing, corner_key, look_key, moved_by);
        let index = *self.index_of.entry(key).or_insert(next);
        if index == next {
            self.corners.push(corner);
            self.thing_of.push(self.thing);
            self.looks.iter_mut().for_each(|looks| looks.push(look));
        }
        index
    }

    fn batch(self, gpu: &Gpu, role: Role, anchor: usize, ambient: Vec3) -> SurfaceBatch {
        let buffer = |label, contents: &[u8], usage| gpu.buffer(label, contents, usage);
        let places = self.corners.iter();
        let places = places.map(|corner| (corner.position, corner.normal));
        SurfaceBatch {
            role,
            anchor,
            occlusion: None,
            places: BatchCorners {
                corners: (places.collect(), self.triangles.clone()),
                thing_of: self.thing_of,
            },
            corners: buffer(
                "surface corners",
                bytemuck::cast_slice(&self.corners),
                CHANGING,
            ),
            indirect: buffer(
                "indirect light",
                bytemuck::cast_slice(&vec![ambient; self.corners.len()]),
                CHANGING,
            ),
            looks: self.looks.as_ref().map(|looks| {
                let contents = bytemuck::cast_slice(looks);
                buffer("surface looks", contents, CHANGING)
            }),
            indices: buffer(
                "surface triangles",
                bytemuck::cast_slice(&self.triangles),
                wgpu::BufferUsages::INDEX,
            ),
        }
    }
}

/// Vertices that may be written again.
pub(super) const CHANGING: wgpu::BufferUsages =
    wgpu::BufferUsages::VERTEX.union(wgpu::BufferUsages::COPY_DST);

/// What a corner of a mesh that changes its shape follows, so written that corners which may part have different ones.
fn moved_by(mesh: &Mesh, number: usize) -> [u32; 7] {
    let Some(held) = mesh.held.get(number / 3) else {
        return [0; 7];
    };
    let HeldCorner { point, normal } = held[number % 3];
    let [a, b, c] = point.vertices;
    let [x, y, z] = point.weights.map(f32::to_bits);
    // A normal of the faces around it is this triangle's alone.
    let by_triangle = match normal {
        HeldNormal::OfFaces => number as u32 + 1,
        HeldNormal::OfRig | HeldNormal::OfRigTurned => 0,
    };
    [a, b, c, x, y, z, by_triangle]
}

impl SurfaceBatch {
    /// Takes the shape that its thing has now, which has it for itself.
    pub fn deform(
        &mut self,
        queue: &wgpu::Queue,
        (object, deformed): (&Object, &[SurfaceCorner]),
        first_material: u32,
    ) {
        let (places, triangles) = &mut self.places.corners;
        let mut shared = vec![SurfaceCorner::zeroed(); places.len()];
        let indices = triangles.as_flattened();
        for (&index, corner) in indices.iter().zip(deformed) {
            shared[index as usize] = *corner;
            places[index as usize] = (corner.position, corner.normal);
        }
        queue.write_buffer(&self.corners, 0, bytemuck::cast_slice(&shared));
        let has_tangents = || {
            object
                .mesh
                .looks
                .iter()
                .any(|look| look.tangent != Vec4::ZERO)
        };
        if let Some(looks) = self.looks.as_ref().filter(|_| has_tangents()) {
            let mut turned = vec![CornerOfMaterial::zeroed(); places.len()];
            for (number, &index) in indices.iter().enumerate() {
                let corner = (number / 3, number % 3);
                turned[index as usize] =
                    corner_of_material(object, &object.mesh, corner, first_material);
            }
            queue.write_buffer(looks, 0, bytemuck::cast_slice(&turned));
        }
    }
}

impl AnchoredModel {
    /// Takes the shape that its object has now; it has one level of detail.
    pub fn deform(&mut self, queue: &wgpu::Queue, (object, deformed): (&Object, &[SurfaceCorner])) {
        let mesh = &object.mesh;
        let positions = object.positions_in_anchor(mesh);
        let place = |index: u32| positions[index as usize].as_dvec3();
        self.receivers.clear();
        let triangles = mesh.triangles.iter();
        self.receivers
            .extend(triangles.map(|triangle| triangle.map(place)));
        let around = Bounds::around(positions.iter().map(|position| position.as_dvec3()));
        self.bounds = around.unwrap_or(self.bounds);
        if let Some(caster) = self
            .levels
            .first_mut()
            .and_then(|level| level.caster.as_mut())
        {
            caster.smooth_normals = smooth_normals(deformed);
            caster.caster.set_positions(positions);
            let vertices = caster.caster.volume_vertices();
            queue.write_buffer(&caster.vertices, 0, bytemuck::cast_slice(&vertices));
        }
    }
}

/// What a corner of a triangle has for its material.
pub(super) fn corner_of_material(
    object: &Object,
    mesh: &Mesh,
    (triangle, corner): (usize, usize),
    first_material: u32,
) -> CornerOfMaterial {
    let look = mesh.corner_looks.get(triangle);
    let look = look.map_or(CornerLook::default(), |corners| {
        mesh.looks[corners[corner] as usize]
    });
    let [first, second] = look.uv;
    let tangent = object
        .anchor_from_object
        .transform_vector3(look.tangent.truncate().as_dvec3())
        .normalize_or_zero()
        .as_vec3();
    let mirrored = object.anchor_from_object.matrix3.determinant() < 0.0;
    let side = if mirrored {
        -look.tangent.w
    } else {
        look.tangent.w
    };
    CornerOfMaterial {
        uv: [first.x, first.y, second.x, second.y],
        color: look.color.to_array(),
        tangent: tangent.extend(side).to_array(),
        material: first_material + mesh.triangle_materials[triangle],
    }
}

/// Three corners for each triangle.
pub(super) fn corners(object: &Object, mesh: &Mesh) -> Vec<SurfaceCorner> {
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
                roughness: material.layer_roughness().unwrap_or(0.0) as f32,
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
