//! Rays against the scene's things on the GPU: a tree of boxes for each thing, in its own space, as a table that ray_trees.wgsl
//! reads, and where things are in a frame.

use glam::{DAffine3, Vec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::camera::Intrinsics;
use crate::geometry::ray_caster::{BoxContent, RayCaster};
use crate::geometry::reach::{self, PixelRect};
use crate::geometry::solid::holes;
use crate::scene::{Object, Scene};
use crate::shafts::casters::Occluder;

use super::anchor_geometry::Role;
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::mirroring::mirrors;
use super::tables::{most_texels, table, with_word, words};
use super::uniforms::TracedThing;

/// Texels of a node, and of a triangle.
const NODE_TEXELS: usize = 2;
const TRIANGLE_TEXELS: usize = 3;
/// Bits of a place in a stack's word: `PLACE_BITS` of ray_trees.wgsl.
const PLACE_BITS: u32 = 24;
/// What has more triangles than this is simplified.
const MOST_TRIANGLES: usize = 65_536;

/// What a thing is: the words `IS_REAL`, `IS_SOLID` and `CASTS` of ray_trees.wgsl.
const IS_REAL: u32 = 1;
const IS_SOLID: u32 = 2;
const CASTS: u32 = 4;

/// A thing that rays may meet.
struct TreedThing {
    caster: RayCaster,
    /// In the thing's own space, each with its albedo, as the caster has them.
    triangles: Vec<([Vec3; 3], Vec3)>,
    what: u32,
    /// Whether it shows what it mirrors.
    mirrors: bool,
    /// Around it, in its own space; `None` without triangles.
    bounds: Option<Bounds>,
    visible: bool,
    anchor: usize,
    anchor_from_object: DAffine3,
}

/// The trees of all things, the real ones first.
pub(super) struct RayTrees {
    things: Vec<TreedThing>,
    /// Of each thing the word with which a stack begins.
    roots: Vec<u32>,
    /// `None`: a thing has changed its shape.
    table: Option<wgpu::TextureView>,
    /// So many triangles of a thing have a place in the table.
    fitting: usize,
}

impl TreedThing {
    fn new(object: &Object, role: Role, fitting: usize) -> Self {
        let occluder = object.occluder();
        let triangles = triangles(&occluder, fitting);
        let is_solid =
            object.animation.is_none() && holes(&object.mesh).is_some_and(|holes| holes.is_empty());
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        let corners: Vec<[Vec3; 3]> = triangles.iter().map(|(corners, _)| *corners).collect();
        Self {
            caster: RayCaster::new(&corners),
            triangles,
            what: flag(role == Role::Real, IS_REAL)
                | flag(is_solid, IS_SOLID)
                | flag(object.casts, CASTS),
            mirrors: role == Role::Virtual && mirrors(object),
            bounds: Bounds::around(corners.iter().flatten().map(|corner| corner.as_dvec3())),
            visible: object.visible,
            anchor: object.anchor,
            anchor_from_object: object.anchor_from_object,
        }
    }

    /// Where it is in the camera's space, if it is there and seen.
    fn camera_from_own(
        &self,
        camera_from_anchor: &[Option<DAffine3>],
        unseen: Option<usize>,
    ) -> Option<DAffine3> {
        let pose = camera_from_anchor.get(self.anchor).copied().flatten()?;
        let is_there = self.visible && unseen != Some(self.anchor) && self.bounds.is_some();
        is_there.then(|| pose * self.anchor_from_object)
    }

    /// The word with which a stack begins, where its nodes and triangles begin there.
    fn root(&self, begins: (usize, usize)) -> u32 {
        let root = self.caster.boxes().next();
        root.map_or(0, |root| {
            let (first, count) = content(root.content, begins);
            (first | count << PLACE_BITS) as u32
        })
    }

    /// Appends its nodes, which count from `first_node`, and its triangles, which begin at a texel of the whole table.
    fn write(
        &self,
        (first_node, first_triangle): (usize, usize),
        nodes: &mut Vec<[u32; 4]>,
        triangles: &mut Vec<[u32; 4]>,
    ) {
        for node in self.caster.boxes() {
            let (first, count) = content(node.content, (first_node, first_triangle));
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

/// Where what is in a box begins (a node's number, a triangle's texel), and how many triangles these are.
fn content(content: BoxContent, (first_node, first_triangle): (usize, usize)) -> (usize, usize) {
    match content {
        BoxContent::Boxes(first) => (first_node + first, 0),
        BoxContent::Triangles { first, count } => (first_triangle + TRIANGLE_TEXELS * first, count),
    }
}

/// What rays meet of a thing, in its own space; nothing of what has no place even simplified.
fn triangles(occluder: &Occluder<'_>, fitting: usize) -> Vec<([Vec3; 3], Vec3)> {
    let mut triangles = match occluder.mesh.triangles.len() > MOST_TRIANGLES.min(fitting) {
        true => occluder.simplified(),
        false => occluder.whole(),
    };
    if triangles.len() > fitting {
        triangles.clear();
    }
    occluder.with_albedos(&triangles)
}

impl RayTrees {
    /// Of all of a scene's things.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Self {
        let things: Vec<(&Object, Role)> = objects(scene).collect();
        // (A tree has fewer than two nodes for each triangle.)
        let texels = 2 * NODE_TEXELS + TRIANGLE_TEXELS;
        let most_texels = most_texels(gpu).min(1 << PLACE_BITS);
        let fitting = most_texels / texels / things.len().max(1);
        let things = things.into_iter();
        Self {
            things: things
                .map(|(object, role)| TreedThing::new(object, role, fitting))
                .collect(),
            roots: Vec::new(),
            table: None,
            fitting,
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
            *thing = TreedThing::new(&deforming.object, deforming.role, self.fitting);
            self.table = None;
        }
    }

    /// Where in the picture things can be that show what they mirror.
    pub fn mirroring_pixels(
        &self,
        camera_from_anchor: &[Option<DAffine3>],
        unseen: Option<usize>,
        intrinsics: &Intrinsics,
    ) -> PixelRect {
        let mirroring = self.things.iter().filter(|thing| thing.mirrors);
        let places = mirroring.filter_map(|thing| {
            let camera_from_own = thing.camera_from_own(camera_from_anchor, unseen)?;
            let corners = thing.bounds?.corners();
            Some(reach::covered(&corners, &camera_from_own, intrinsics))
        });
        places.fold(PixelRect::NONE, PixelRect::union)
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
                roots.push(thing.root((first_node, first_triangle)));
                thing.write((first_node, first_triangle), &mut nodes, &mut triangles);
            }
            nodes.append(&mut triangles);
            table(gpu, "ray trees", &nodes)
        })
    }

    /// The things that are there but for those on a node that is not seen, of a frame whose trees were asked for.
    pub fn placed(
        &self,
        camera_from_anchor: &[Option<DAffine3>],
        unseen: Option<usize>,
    ) -> Vec<TracedThing> {
        let things = self.things.iter().zip(&self.roots);
        let placed = things.filter_map(|(thing, &root)| {
            let camera_from_own = thing.camera_from_own(camera_from_anchor, unseen)?;
            let own_from_camera = camera_from_own.inverse();
            let rows = own_from_camera.matrix3.transpose();
            let shift = own_from_camera.translation;
            let bounds = thing.bounds?;
            Some(TracedThing {
                own_from_camera: [
                    rows.x_axis.extend(shift.x).as_vec4(),
                    rows.y_axis.extend(shift.y).as_vec4(),
                    rows.z_axis.extend(shift.z).as_vec4(),
                ],
                low: bounds.low.as_vec3(),
                what: thing.what,
                high: bounds.high.as_vec3(),
                root,
            })
        });
        placed.collect()
    }
}

fn objects(scene: &Scene) -> impl Iterator<Item = (&Object, Role)> {
    let real = scene.phantoms.iter().map(|object| (object, Role::Real));
    let virtuals = scene.virtuals.iter();
    real.chain(virtuals.map(|object| (object, Role::Virtual)))
}
