//! What stands where in a frame: the scene's surfaces, casters and lights on the GPU, and how passes draw them.

mod deforming;
mod drawing;
mod spaces;

pub(super) use spaces::world_from;

use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine3, Vec3};
use rayon::prelude::*;

use crate::geometry::camera::Intrinsics;
use crate::geometry::mesh::Mesh;
use crate::geometry::reach::PixelRect;
use crate::geometry::subdivide::Corner;
use crate::light::Light;
use crate::light::pieces::Onlooking;
use crate::scene::{Scene, SceneLight, ShadowSettings, Shortcut};

use super::anchor_geometry::{
    AnchorGeometry, AnchoredModel, BatchCorners, Corners, ModelLevel, OcclusionCorners, Role,
    SurfaceBatch,
};
use super::attachments::texture;
use super::casters::Casters;
use super::detail::{casters, chosen_levels, widest_penumbra_px};
use super::gpu::Gpu;
use super::indirect::Indirect;
use super::insides::{Insides, insides};
use super::known_levels::KnownLevels;
use super::light_kind::LightKind;
use super::light_piece::LitBy;
use super::lights::Lights;
use super::materials::{materials_group, needs_looks};
use super::mirrored_probe::LayerAlbedo;
use super::mirroring::{REFLECTIONS_FORMAT, are_followed};
use super::screen_bounds::{ScreenBounds, screen_bounds};
use super::shown::Shown;
use super::surfaces::SurfaceKinds;
use super::uniforms::{AnchorView, UniformRow, VIEW_GROUP};

/// The light in group 1 while surfaces are drawn.
#[derive(Debug, Clone, Copy)]
pub(super) enum DrawnLight {
    /// All of a light.
    Whole(usize),
    /// A piece of one.
    Piece(usize),
    /// A piece where real things hide it: the stencil's reference says that.
    HiddenPiece(usize),
}

/// A thing in its level of detail.
pub(super) struct DrawnModel<'a> {
    /// Number of the thing, and of its level.
    pub number: usize,
    pub level: usize,
    pub anchor: usize,
    drawn: &'a ModelLevel,
    batch: &'a Corners,
}

impl DrawnModel<'_> {
    /// How far its surface may lie off the finest level's, metres.
    pub fn error_m(&self) -> f32 {
        self.drawn.max_error_m as f32
    }

    /// Three for each triangle.
    pub fn corner_count(&self) -> usize {
        self.drawn.range.len()
    }

    /// Its triangles, in the anchor's space.
    pub fn triangles(&self) -> Vec<[Corner; 3]> {
        let (corners, triangles) = self.batch;
        let (first, last) = (self.drawn.range.start / 3, self.drawn.range.end / 3);
        let triangles = triangles[first as usize..last as usize].iter();
        let corner = |index: u32| corners[index as usize];
        triangles.map(|triangle| triangle.map(corner)).collect()
    }
}

/// The scene as the present frame has it.
pub(super) struct GpuScene {
    intrinsics: Intrinsics,
    /// Those that cast shadow volumes.
    lights: Lights,
    /// What the virtual things' materials and the lights have.
    pub kinds: SurfaceKinds,
    /// The materials, where there are such as need it.
    materials: Option<wgpu::BindGroup>,
    batches: Vec<SurfaceBatch>,
    things: Vec<AnchoredModel>,
    /// For each thing the level that is drawn.
    levels: Vec<usize>,
    max_silhouette_error_px: f64,
    shadows: ShadowSettings,
    /// For each thing where its inside can be seen.
    insides: Vec<Insides>,
    casters: Casters,
    /// Of shadow volumes alone.
    indirect: Option<Indirect>,
    /// The camera as what stands on each anchor meets it, and after that as each virtual thing does.
    views: UniformRow,
    view_group: wgpu::BindGroup,
    /// What glossy surfaces mirror; one texel where no rays are followed for that.
    reflections: wgpu::Texture,
    camera_from_anchor: Vec<Option<DAffine3>>,
    /// Where things stand and which are there: phantoms, then virtual ones.
    standing: Vec<(DAffine3, bool)>,
    known_levels: KnownLevels,
    /// What stands on this node casts shadows, but is not seen.
    unseen: Option<usize>,
    /// The node that light from afar turns with.
    light_anchor: usize,
}

impl GpuScene {
    /// Meshes that have another in `known_levels` are drawn as that.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        intrinsics: Intrinsics,
        lit_by: LitBy,
        mut known_levels: KnownLevels,
    ) -> Self {
        let device = &gpu.device;
        let lights = scene.outlined_lights();
        let view_count = scene.node_count() + scene.virtuals.len();
        let views = UniformRow::new::<AnchorView>(device, "views", view_count);
        let AnchorGeometry { batches, things } = AnchorGeometry::new(gpu, scene, &mut known_levels);
        let looks = scene.virtuals.iter().any(needs_looks);
        let glossy = scene.virtuals.iter().any(|object| {
            let mut materials = object.materials.iter();
            materials.any(|material| material.layer_roughness().is_some())
        });
        let layer_albedo = LayerAlbedo::new(device, &gpu.queue, glossy);
        let reflections = texture(
            device,
            "reflections",
            if are_followed(scene) {
                intrinsics.size_px
            } else {
                [1; 2]
            },
            REFLECTIONS_FORMAT,
            1,
            wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::COPY_DST,
        );
        let light_kinds = lights.iter().map(|light| LightKind::of(&light.light));
        let light_kinds = light_kinds.collect();
        Self {
            standing: standing(scene),
            unseen: None,
            light_anchor: scene.probe.as_ref().map_or(0, |probe| probe.anchor),
            known_levels,
            casters: Casters::new(gpu, things.len(), &scene.shadows),
            indirect: match lit_by {
                LitBy::Lights => {
                    world_virtuals(&batches).and_then(|corners| Indirect::new(scene, corners))
                }
                LitBy::Room => None,
            },
            max_silhouette_error_px: scene.shadows.max_silhouette_error_px,
            shadows: scene.shadows,
            levels: vec![0; things.len()],
            insides: vec![Insides::Anywhere; things.len()],
            batches,
            things,
            view_group: gpu.bind_group(
                &VIEW_GROUP,
                [
                    views.binding(),
                    wgpu::BindingResource::TextureView(&layer_albedo.view),
                    wgpu::BindingResource::Sampler(&layer_albedo.sampler),
                    wgpu::BindingResource::TextureView(
                        &reflections.create_view(&Default::default()),
                    ),
                ],
            ),
            reflections,
            camera_from_anchor: vec![None; scene.node_count()],
            lights: Lights::new(gpu, lights),
            kinds: SurfaceKinds {
                glossy,
                lights: light_kinds,
                looks,
            },
            materials: looks.then(|| materials_group(gpu, &scene.virtuals)),
            intrinsics,
            views,
        }
    }

    /// Takes another state of the same scene: lights otherwise, things elsewhere, shown or hidden. What surroundings
    /// reflect stays as it was gathered, where the same corners are there to get it. `lights` are those that cast shadow volumes.
    pub fn follow(&mut self, gpu: &Gpu, scene: &Scene, lights: Vec<SceneLight>) {
        self.lights.follow(lights);
        let standing = standing(scene);
        if self.standing == standing {
            return;
        }
        let AnchorGeometry { batches, things } =
            AnchorGeometry::new(gpu, scene, &mut self.known_levels);
        self.casters = Casters::new(gpu, things.len(), &scene.shadows);
        self.indirect = self
            .indirect
            .take()
            .zip(world_virtuals(&batches))
            .and_then(|(gathered, corners)| gathered.for_corners(corners));
        self.levels = vec![0; things.len()];
        self.insides = vec![Insides::Anywhere; things.len()];
        self.batches = batches;
        self.things = things;
        self.standing = standing;
    }

    /// Outlines may be off by so much from now on, pixels.
    pub fn set_detail(&mut self, max_silhouette_error_px: f64) {
        self.max_silhouette_error_px = max_silhouette_error_px;
    }

    /// What stands on a node casts shadows from now on, but is not seen.
    pub fn set_unseen(&mut self, node: Option<usize>) {
        self.unseen = node;
        self.casters.set_unseen(node);
    }

    /// The node on which all casts shadows, but is not seen.
    pub fn unseen(&self) -> Option<usize> {
        self.unseen
    }

    /// What surfaces' shaders read of what they mirror (layer_albedo.wgsl).
    pub fn reflections(&self) -> &wgpu::Texture {
        &self.reflections
    }

    /// Number of lights.
    pub fn light_count(&self) -> usize {
        self.lights.count()
    }

    /// The pieces of a light, of which each casts its shadows.
    pub fn pieces_of(&self, light: usize) -> Range<usize> {
        self.lights.pieces_of(light)
    }

    /// Triangles of the levels that the present frame's things are drawn in.
    pub fn triangles(&self) -> usize {
        let chosen = self.things.iter().zip(&self.levels);
        chosen
            .map(|(thing, &level)| thing.levels[level].range.len() / 3)
            .sum()
    }

    /// Places what stands on the anchors.
    pub fn place(&mut self, gpu: &Gpu, camera_from_anchor: &[Option<DAffine3>]) {
        let queue = &gpu.queue;
        self.camera_from_anchor = camera_from_anchor.to_vec();
        for (anchor, pose) in camera_from_anchor.iter().enumerate() {
            if let Some(camera_from_anchor) = pose {
                let view = AnchorView::new(&self.intrinsics, camera_from_anchor);
                self.views.write(queue, anchor, &view);
            }
        }
        for thing in &self.things {
            if let (Some(tie), Some(pose)) = (thing.tie, camera_from_anchor[thing.anchor]) {
                let view = AnchorView::new(&self.intrinsics, &pose).winning_ties(tie);
                self.views.write(queue, self.view_of(thing), &view);
            }
        }
        let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
            return;
        };
        let world_from_anchor = self.world_from_anchor().unwrap_or_default();
        let world_virtuals = self
            .batch(Role::Virtual, 0)
            .map(|batch| batch.indirect.clone());
        if let (Some(indirect), Some(buffer)) = (&mut self.indirect, world_virtuals) {
            indirect.update(queue, &buffer, &world_from_anchor);
        }
        self.choose_levels(camera_from_anchor);
        self.cut_lights(gpu, &camera_from_world);
        let placed = self.things.iter().zip(&self.levels);
        self.insides = placed
            .map(|(thing, &level)| {
                let Some(camera_from_anchor) = camera_from_anchor[thing.anchor] else {
                    return Insides::Unseen;
                };
                // (Of what is not seen no surface lies before its volume's caps.)
                let is_unseen = self.unseen == Some(thing.anchor);
                if is_unseen || self.shadows.without.has(Shortcut::Insides) {
                    return Insides::Anywhere;
                }
                match insides(thing, level, &camera_from_anchor, &self.intrinsics) {
                    // Mesa's software driver cuts rectangles between the samples of a pixel.
                    Insides::Within(_) if self.shadows.samples > 1 => Insides::Anywhere,
                    insides => insides,
                }
            })
            .collect();
    }

    /// Cuts the lights of some size into as many pieces as their shadows need.
    fn cut_lights(&mut self, gpu: &Gpu, camera_from_world: &DAffine3) {
        let most = self.shadows.light_samples as usize;
        let pieces = |light: &Light| {
            let (things, poses) = (&self.things, &self.camera_from_anchor);
            let width_px = match light.has_size() {
                true => widest_penumbra_px(things, light, poses, &self.intrinsics),
                false => 0.0,
            };
            if width_px <= 1.0 {
                return vec![*light];
            }
            let casters = casters(things, poses);
            let onlooking = casters.map(|casters| Onlooking::of(light, &casters));
            let count = (2 * (0.5 * width_px).ceil() as usize).min(most);
            light.pieces(count, onlooking.unwrap_or(Onlooking::ALL_AROUND))
        };
        self.lights.cut(gpu, camera_from_world, pieces);
    }

    /// Chooses the levels of detail of a frame, which go by those of the frame before it.
    pub fn choose_levels(&mut self, camera_from_anchor: &[Option<DAffine3>]) {
        let before = match self.shadows.without.has(Shortcut::Kept) {
            true => vec![0; self.levels.len()],
            false => std::mem::take(&mut self.levels),
        };
        self.lights.place(camera_from_anchor);
        self.levels = chosen_levels(
            &self.things,
            &self.lights.shining(),
            camera_from_anchor,
            &self.intrinsics,
            self.max_silhouette_error_px,
            &before,
        );
    }

    /// Gives the virtual things' corners the irradiance that a function of place and unit normal (world space) says.
    pub fn set_indirect(
        &self,
        queue: &wgpu::Queue,
        world_from_anchor: &[Option<DAffine3>],
        irradiance: impl Fn(Vec3, Vec3) -> Vec3 + Sync,
    ) {
        let batches = self.batches.iter();
        for batch in batches.filter(|batch| batch.role == Role::Virtual) {
            let Some(pose) = world_from_anchor[batch.anchor] else {
                continue;
            };
            let (corners, _) = &batch.places.corners;
            let pose = pose.as_affine3();
            let of_corner = |&(place, normal): &(Vec3, Vec3)| {
                irradiance(pose.transform_point3(place), pose.transform_vector3(normal))
            };
            let arriving: Vec<_> = corners.par_iter().map(of_corner).collect();
            queue.write_buffer(&batch.indirect, 0, bytemuck::cast_slice(&arriving));
        }
    }

    /// What a thing's mesh is drawn as, the finest first.
    pub fn drawn_meshes<'a>(&'a self, mesh: &'a Arc<Mesh>) -> impl Iterator<Item = &'a Mesh> {
        self.known_levels.drawn(mesh)
    }

    /// All batches' corners as values: what they are of, their anchor, and they.
    pub fn corners(&self) -> impl Iterator<Item = (Role, usize, &BatchCorners)> {
        let batches = self.batches.iter();
        batches.map(|batch| (batch.role, batch.anchor, &batch.places))
    }

    /// Gives each batch, in their order, what its corners hide from themselves.
    pub fn set_occlusion(&mut self, occlusions: impl Iterator<Item = Option<OcclusionCorners>>) {
        for (batch, occlusion) in self.batches.iter_mut().zip(occlusions) {
            batch.occlusion = occlusion;
        }
    }

    /// Gives the corners of batches, in their order, their irradiance, and the part of it that is of what things reflect, or on phantoms
    /// what virtual things take of it.
    pub fn write_indirect(&self, queue: &wgpu::Queue, values: &[Option<[Vec<Vec3>; 2]>]) {
        for (batch, values) in self.batches.iter().zip(values) {
            let Some([irradiances, reflected]) = values else {
                continue;
            };
            queue.write_buffer(&batch.indirect, 0, bytemuck::cast_slice(irradiances));
            if let Some(occlusion) = &batch.occlusion {
                queue.write_buffer(&occlusion.reflected, 0, bytemuck::cast_slice(reflected));
            }
        }
    }

    /// The real things as the frame has them.
    pub fn drawn_real(&self) -> impl Iterator<Item = DrawnModel<'_>> {
        self.placed_things(Role::Real)
            .map(|(batch, number, thing)| {
                let level = self.levels[number];
                DrawnModel {
                    number,
                    level,
                    anchor: thing.anchor,
                    drawn: &thing.levels[level],
                    batch: &batch.places.corners,
                }
            })
    }

    /// The camera.
    pub fn intrinsics(&self) -> &Intrinsics {
        &self.intrinsics
    }

    /// Makes the shadow volumes that the picture shows. Returns where the placed things and their shadows can be; `None`
    /// where nothing is placed; what changes `besides` is among them.
    pub fn cast_shadows(
        &mut self,
        gpu: &Gpu,
        shown: Shown,
        besides: PixelRect,
    ) -> Option<ScreenBounds> {
        let mut bounds = screen_bounds(
            &self.things,
            self.lights.pieces(),
            &self.camera_from_anchor,
            &self.intrinsics,
            self.shadows.without,
        )?;
        bounds.pixels = bounds.pixels.union(besides);
        if shown == Shown::Composite && !bounds.pixels.is_empty() {
            self.cast(gpu, &bounds, bounds.pixels);
        }
        Some(bounds)
    }

    /// Makes the shadow volumes that reach the pixels `within`.
    pub fn cast(&mut self, gpu: &Gpu, bounds: &ScreenBounds, within: PixelRect) {
        self.casters
            .reserve(gpu, self.things.len(), self.lights.slot_count());
        self.casters.update(
            gpu,
            (&self.things, &self.levels),
            self.lights.pieces(),
            &self.camera_from_anchor,
            &self.intrinsics,
            (bounds, within),
        );
    }

    /// What a light is that is drawn.
    pub fn light_kind(&self, light: DrawnLight) -> LightKind {
        match light {
            DrawnLight::Whole(light) => self.lights.kind_of_whole(light),
            DrawnLight::Piece(piece) | DrawnLight::HiddenPiece(piece) => {
                self.lights.kind_of_piece(piece)
            }
        }
    }

    /// The batches of a role whose anchor has a pose, in a world that has one.
    fn placed(&self, role: Role) -> impl Iterator<Item = &SurfaceBatch> {
        let has_pose = |anchor: usize| self.camera_from_anchor[anchor].is_some();
        let is_seen = move |anchor: usize| has_pose(anchor) && self.unseen != Some(anchor);
        let batches = self.batches.iter();
        batches.filter(move |b| b.role == role && has_pose(0) && is_seen(b.anchor))
    }

    /// What a role has on an anchor.
    fn batch(&self, role: Role, anchor: usize) -> Option<&SurfaceBatch> {
        let mut batches = self.batches.iter();
        batches.find(|batch| (batch.role, batch.anchor) == (role, anchor))
    }

    /// The things of a role that are placed, each with its batch and its number.
    fn placed_things(
        &self,
        role: Role,
    ) -> impl Iterator<Item = (&SurfaceBatch, usize, &AnchoredModel)> {
        self.placed(role).flat_map(|batch| {
            let things = self.of_batch(batch);
            things.map(move |(number, thing)| (batch, number, thing))
        })
    }

    /// The things of a batch, with their numbers.
    fn of_batch(&self, batch: &SurfaceBatch) -> impl Iterator<Item = (usize, &AnchoredModel)> {
        let kind = (batch.role, batch.anchor);
        let things = self.things.iter().enumerate();
        things.filter(move |(_, thing)| (thing.role, thing.anchor) == kind)
    }

    /// The slot of a piece.
    fn slot(&self, piece: usize) -> usize {
        self.lights
            .pieces()
            .get(piece)
            .map_or(0, |piece| piece.slot)
    }

    /// Where in `views` a thing's is.
    fn view_of(&self, thing: &AnchoredModel) -> usize {
        match thing.tie {
            None => thing.anchor,
            Some(tie) => self.camera_from_anchor.len() + tie,
        }
    }
}

/// The corners of the virtual things that stand in the world.
fn world_virtuals(batches: &[SurfaceBatch]) -> Option<&Corners> {
    let mut batches = batches.iter();
    let found = batches.find(|batch| (batch.role, batch.anchor) == (Role::Virtual, 0));
    found.map(|batch| &batch.places.corners)
}

/// Where a scene's things stand, and which are there.
fn standing(scene: &Scene) -> Vec<(DAffine3, bool)> {
    let things = scene.phantoms.iter().chain(&scene.virtuals);
    let standing = things.map(|thing| (thing.anchor_from_object, thing.visible));
    standing.collect()
}
