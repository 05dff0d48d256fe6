//! Rays against the scene's things on the GPU: a tree of boxes for each thing, in its own space, and where things and lights are
//! in a frame, as tables that ray_trees.wgsl reads.

use glam::{DAffine3, Vec3, Vec4};

use crate::geometry::ray_caster::{BoxContent, RayCaster};
use crate::light::Light;
use crate::scene::{Object, Scene};
use crate::shafts::casters::Occluder;

use super::anchor_geometry::Role;
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::light_kind::LightKind;
use super::tables::{most_texels, table, with_word, words};
use super::uniforms::CameraLight;

/// Texels of a node, and of a triangle.
const NODE_TEXELS: usize = 2;
const TRIANGLE_TEXELS: usize = 3;
/// Texels of a thing in a frame: `first_hit` of ray_trees.wgsl.
const THING_TEXELS: usize = 4;
/// What has more triangles than this is simplified.
const MOST_TRIANGLES: usize = 65_536;

/// What a thing is: the words `IS_REAL`, `IS_SOLID` and `CASTS` of ray_trees.wgsl.
const IS_REAL: u32 = 1;
const IS_SOLID: u32 = 2;
const CASTS: u32 = 4;

/// A thing that rays may meet.
struct TracedThing {
    caster: RayCaster,
    /// In the thing's own space, each with its albedo, as the caster has them.
    triangles: Vec<([Vec3; 3], Vec3)>,
    what: u32,
    visible: bool,
    anchor: usize,
    anchor_from_object: DAffine3,
}

/// The trees of all things, the real ones first.
pub(super) struct RayTrees {
    things: Vec<TracedThing>,
    /// Of each thing the number of its first node in the table.
    roots: Vec<u32>,
    /// `None`: a thing has changed its shape.
    table: Option<wgpu::TextureView>,
    most_triangles: usize,
}

/// Things and lights where they are in a frame.
pub(super) struct PlacedTrees {
    pub table: wgpu::TextureView,
    pub thing_count: u32,
    pub light_count: u32,
}

impl TracedThing {
    fn new(object: &Object, role: Role, most_triangles: usize) -> Self {
        let occluder = object.occluder();
        let triangles = triangles(&occluder, most_triangles);
        let is_solid = object.animation.is_none()
            && crate::geometry::solid::holes(&object.mesh).is_some_and(|holes| holes.is_empty());
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let corners: Vec<[Vec3; 3]> = triangles.iter().map(|(corners, _)| *corners).collect();
        Self {
            caster: RayCaster::new(&corners),
            triangles,
            what: flag(role == Role::Real, IS_REAL)
                | flag(is_solid, IS_SOLID)
                | flag(object.casts, CASTS),
            visible: object.visible,
            anchor: object.anchor,
            anchor_from_object: object.anchor_from_object,
        }
    }

    /// Appends its nodes, which count from `first_node`, and its triangles, which begin at a texel of the whole table.
    fn write(
        &self,
        (first_node, first_triangle): (usize, usize),
        nodes: &mut Vec<[u32; 4]>,
        triangles: &mut Vec<[u32; 4]>,
    ) {
        for node in self.caster.boxes() {
            let (first, count) = match node.content {
                BoxContent::Boxes(first) => (first_node + first, 0),
                BoxContent::Triangles { first, count } => {
                    (first_triangle + TRIANGLE_TEXELS * first, count)
                }
            };
            nodes.push(with_word(node.low, first as u32));
            nodes.push(with_word(node.high, count as u32));
        }
        for index in self.caster.triangle_order() {
            let ([a, b, c], albedo) = self.triangles[index];
            triangles.push(words(a.extend(albedo.x)));
            triangles.push(words((b - a).extend(albedo.y)));
            triangles.push(words((c - a).extend(albedo.z)));
        }
    }
}

/// What rays meet of a thing, in its own space.
fn triangles(occluder: &Occluder<'_>, most: usize) -> Vec<([Vec3; 3], Vec3)> {
    match occluder.mesh.triangles.len() > most {
        true => occluder.simplified(),
        false => occluder.whole(),
    }
}

impl RayTrees {
    /// Of all of a scene's things.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Self {
        let things: Vec<(&Object, Role)> = objects(scene).collect();
        // (A tree has fewer than two nodes for each triangle.)
        let texels = 2 * NODE_TEXELS + TRIANGLE_TEXELS;
        let fitting = most_texels(gpu) / texels / things.len().max(1);
        let most_triangles = MOST_TRIANGLES.min(fitting);
        let things = things.into_iter();
        Self {
            things: things
                .map(|(object, role)| TracedThing::new(object, role, most_triangles))
                .collect(),
            roots: Vec::new(),
            table: None,
            most_triangles,
        }
    }

    /// Takes another state of the same things: elsewhere, shown or hidden.
    pub fn follow(&mut self, scene: &Scene) {
        for (thing, (object, _)) in self.things.iter_mut().zip(objects(scene)) {
            thing.visible = object.visible;
            thing.anchor_from_object = object.anchor_from_object;
        }
    }

    /// Takes note of a thing that has another shape now.
    pub fn deform(&mut self, deforming: &DeformingThing) {
        if let Some(thing) = self.things.get_mut(deforming.number) {
            *thing = TracedThing::new(&deforming.object, deforming.role, self.most_triangles);
            self.table = None;
        }
    }

    /// The trees, as they are now.
    pub fn table(&mut self, gpu: &Gpu) -> &wgpu::TextureView {
        let (things, roots) = (&self.things, &mut self.roots);
        self.table.get_or_insert_with(|| {
            let of_things = things.iter().map(|thing| thing.caster.boxes().len());
            let node_count: usize = of_things.sum();
            let (mut nodes, mut triangles) = (Vec::new(), Vec::new());
            roots.clear();
            for thing in things {
                let first_node = nodes.len() / NODE_TEXELS;
                let first_triangle = NODE_TEXELS * node_count + triangles.len();
                roots.push(first_node as u32);
                thing.write((first_node, first_triangle), &mut nodes, &mut triangles);
            }
            nodes.append(&mut triangles);
            table(gpu, "ray trees", &nodes)
        })
    }

    /// The things that are there but for those on a node that is not seen, and the lights (world space), of a frame whose trees
    /// were asked for.
    pub fn placed(
        &self,
        gpu: &Gpu,
        camera_from_anchor: &[Option<DAffine3>],
        unseen: Option<usize>,
        (lights, camera_from_world): (&[Light], &DAffine3),
    ) -> PlacedTrees {
        let mut texels = Vec::new();
        for (thing, &root) in self.things.iter().zip(&self.roots) {
            let pose = camera_from_anchor.get(thing.anchor).copied().flatten();
            let is_there = thing.visible && unseen != Some(thing.anchor);
            let Some(pose) = pose.filter(|_| is_there && !thing.triangles.is_empty()) else {
                continue;
            };
            let own_from_camera = (pose * thing.anchor_from_object).inverse();
            let rows = own_from_camera.matrix3.transpose();
            let shift = own_from_camera.translation;
            texels.extend([
                words(rows.x_axis.extend(shift.x).as_vec4()),
                words(rows.y_axis.extend(shift.y).as_vec4()),
                words(rows.z_axis.extend(shift.z).as_vec4()),
                [root, thing.what, 0, 0],
            ]);
        }
        let thing_count = texels.len() / THING_TEXELS;
        texels.extend(lights.iter().flat_map(|light| {
            let kind = LightKind::of(light).number();
            let light = CameraLight::new(light, camera_from_world);
            let axis: Vec4 = light.axis_in_camera.with_w(kind as f32);
            [
                light.place_in_camera,
                light.power,
                axis,
                light.half_width,
                light.half_height,
            ]
            .map(words)
        }));
        PlacedTrees {
            table: table(gpu, "placed things", &texels),
            thing_count: thing_count as u32,
            light_count: lights.len() as u32,
        }
    }
}

fn objects(scene: &Scene) -> impl Iterator<Item = (&Object, Role)> {
    let real = scene.phantoms.iter().map(|object| (object, Role::Real));
    let virtuals = scene.virtuals.iter();
    real.chain(virtuals.map(|object| (object, Role::Virtual)))
}
