//! The ambient light and what things reflect on real surfaces, gathered by rays (environment::final_gather) at the corners of small
//! triangles that lie in them. Reads poses. Writes `reaching` and `change` (light_sums.wgsl) where depth has the surfaces already.
//!
//! It is gathered anew when a thing or a light moves in the world, not when the camera does: more coarsely then, and finely
//! again as soon as all stands still.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::final_gather::{GatherPoints, Gathered, Gathering, longest_edge_m};
use crate::environment::placed::{PlacedScene, PlacedThing};
use crate::environment::sky::Sky;
use crate::environment::thing::Thing;
use crate::geometry::bounds::Bounds;
use crate::geometry::corner_points::corner_points;
use crate::geometry::ray_caster::RayCaster;
use crate::geometry::reach::{self, PixelRect};
use crate::geometry::subdivide::{Corner, subdivided};
use crate::light::Light;
use crate::light::bounce::FurtherLight;
use crate::scene::Scene;

use super::anchor_geometry::Role;
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnModel, GpuScene};
use super::known_states::{KnownStates, Standing, differ_in_presence};
use super::pipelines::{PipelineDescription, overwritten};
use super::stencil::{IN_A_SURFACE, depth_stencil_state};
use super::uniforms::VIEW_GROUP;

/// A real surface has hardly more parts.
const MOST_PARTS: usize = 20_000;

/// How finely light is gathered.
struct Fineness {
    /// At so many points of a surface, hardly more.
    records: usize,
    /// So many times as long edges of parts (see [`longest_edge_m`]).
    coarser: f32,
    /// One ray for so many that the scene asks for.
    rays_for_one: usize,
}

/// Where all stands still: gathered once.
const FINE: Fineness = Fineness {
    records: 8192,
    coarser: 1.0,
    rays_for_one: 1,
};
/// Where something moves: gathered in every frame.
const COARSE: Fineness = Fineness {
    records: 2048,
    coarser: 2.0,
    rays_for_one: 3,
};

/// A corner of a part, as `GatheredCorner` in final_gather.wgsl reads it.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct GatheredCorner {
    position: Vec3,
    reaching: Vec3,
    taken: Vec3,
}

/// Vertex layout of [`GatheredCorner`].
const GATHERED_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<GatheredCorner>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3],
};

/// The gathered light of a scene's real surfaces.
pub(super) struct FinalGather {
    things: Vec<Thing>,
    /// None: light from afar is gathered by the same rays.
    distant: DistantLight,
    sky: Sky,
    /// That the scene asks for.
    rays: usize,
    further: FurtherLight,
    pipeline: wgpu::RenderPipeline,
    /// Whether things can move to each other without an edit.
    moves: bool,
    /// The present state's first.
    gathered: KnownStates<Standing, GatheredState>,
    /// Whether nothing was changed since what is known was gathered finely, or the first time.
    is_settled: bool,
    /// Surfaces that are in small parts as they are.
    known: BTreeMap<PartsFor, Parts>,
    /// Those of the present frame.
    drawn: Vec<(usize, usize)>,
}

/// What was gathered in one state.
struct GatheredState {
    is_fine: bool,
    /// By the numbers of a thing and of its level of detail.
    on_models: BTreeMap<(usize, usize), OnModel>,
}

/// What was gathered on a real thing in one level of detail.
struct OnModel {
    anchor: usize,
    corners: wgpu::Buffer,
    count: u32,
    /// Around what virtual things change, in the anchor's space; `None`: nothing.
    changed: Option<Bounds>,
}

/// The numbers of a thing and of its level of detail, whether light is gathered finely, and which things are there: parts are fine
/// near virtual ones.
type PartsFor = (usize, usize, bool, Vec<usize>);

/// A surface in small parts, in its anchor's space.
struct Parts {
    /// Three for each part.
    corners: Vec<Corner>,
    point_of_corner: Vec<usize>,
    points: GatherPoints,
}

impl FinalGather {
    /// The ambient light of a scene and what its lights have things reflect; `None` where it is not to be gathered.
    pub fn of_ambient(gpu: &Gpu, scene: &Scene) -> Option<Self> {
        let rays = scene.shadows.ambient_samples as usize;
        let sky = |_| Sky::constant(scene.ambient_radiance);
        match rays {
            0 => None,
            _ => Self::new(gpu, scene, rays, sky),
        }
    }

    /// By so many rays from each point, where nothing moves; `sky` makes one for so many rays. `None` where there is nothing
    /// real or nothing virtual.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        rays: usize,
        sky: impl FnOnce(usize) -> Sky,
    ) -> Option<Self> {
        if scene.phantoms.is_empty() || scene.virtuals.is_empty() {
            return None;
        }
        let format = gpu.light_format;
        let on_surface = depth_stencil_state(
            gpu.depth_format,
            false,
            wgpu::CompareFunction::GreaterEqual,
            wgpu::StencilState::default(),
        );
        let samples = scene.shadows.samples;
        let moves = scene.moves();
        Some(Self {
            things: things(scene),
            distant: DistantLight::default(),
            sky: sky(rays_of_sky(rays, moves)),
            rays,
            further: scene.further_light(),
            pipeline: gpu.pipeline(&PipelineDescription {
                shader: "final_gather.wgsl",
                vertex: "place_gathered",
                fragment: "gathered_on_real",
                constants: vec![("MULTISAMPLED", f64::from(samples > 1))],
                groups: vec![Some(VIEW_GROUP)],
                vertex_buffers: vec![GATHERED_LAYOUT],
                depth_stencil: Some(wgpu::DepthStencilState {
                    bias: IN_A_SURFACE,
                    ..on_surface
                }),
                targets: vec![overwritten(format), overwritten(format)],
                samples,
                ..Default::default()
            }),
            moves,
            gathered: KnownStates::new(moves),
            is_settled: !moves,
            known: BTreeMap::new(),
            drawn: Vec::new(),
        })
    }

    /// Takes other light from afar; `sky` makes one for so many rays.
    pub fn set_sky(&mut self, sky: impl FnOnce(usize) -> Sky) {
        self.sky = sky(rays_of_sky(self.rays, self.moves));
        self.forget_light();
    }

    /// Takes another state of its scene: things elsewhere, shown or hidden.
    pub fn follow(&mut self, scene: &Scene) {
        self.things = things(scene);
        self.known.clear();
        self.forget_light();
    }

    /// What was gathered is of no use any more.
    fn forget_light(&mut self) {
        self.gathered.clear();
        self.is_settled = false;
    }

    /// Takes the shapes that things have now.
    pub fn deform(&mut self, things: &[&DeformingThing]) {
        for DeformingThing { role, object, .. } in things {
            let is_real = *role == Role::Real;
            let is_it =
                |thing: &&mut Thing| (thing.is_real, thing.anchor) == (is_real, object.anchor);
            let deformed = Thing::whole(&object.occluder(), is_real);
            if let Some((thing, deformed)) = self.things.iter_mut().find(is_it).zip(deformed) {
                *thing = deformed;
            }
            if is_real {
                self.known.clear();
            }
        }
        self.forget_light();
    }

    /// Gathers what the frame needs and is not known. Returns the pixels that virtual things can change.
    pub fn update(&mut self, gpu: &Gpu, gpu_scene: &GpuScene) -> PixelRect {
        self.drawn.clear();
        let Some(world_from_anchor) = gpu_scene.light_from_anchor() else {
            return PixelRect::NONE;
        };
        let standing = (world_from_anchor, gpu_scene.shining_in_light());
        let mut gathered = self.gathered_for(&standing);
        let models: Vec<DrawnModel<'_>> = gpu_scene.drawn_real().collect();
        let is_known = |model: &&DrawnModel<'_>| gathered.on_models.contains_key(&key(model));
        if !models.iter().all(|model| is_known(&model)) {
            self.gather(gpu, &models, &standing, &mut gathered);
        }
        let mut pixels = PixelRect::NONE;
        for model in &models {
            let Some(on_model) = gathered.on_models.get(&key(model)) else {
                continue;
            };
            self.drawn.push(key(model));
            let camera_from_anchor = gpu_scene.camera_from_anchor()[model.anchor];
            let changed = on_model.changed.zip(camera_from_anchor);
            let changed = changed.map(|(bounds, camera_from_anchor)| {
                let corners = bounds.corners();
                reach::covered(&corners, &camera_from_anchor, gpu_scene.intrinsics())
            });
            pixels = pixels.union(changed.unwrap_or(PixelRect::NONE));
        }
        self.gathered.keep(standing, gathered);
        pixels
    }

    /// Gathers on the models that are not known yet.
    fn gather(
        &mut self,
        gpu: &Gpu,
        models: &[DrawnModel<'_>],
        (world_from_anchor, lights): &Standing,
        GatheredState { is_fine, on_models }: &mut GatheredState,
    ) {
        let things = self.things.iter().enumerate();
        let scene = PlacedScene::new(things, world_from_anchor, &self.distant, lights);
        let virtuals = scene.things.iter().filter(|placed| !placed.thing.is_real);
        let virtuals: Vec<Bounds> = virtuals.map(PlacedThing::bounds).collect();
        let there: Vec<usize> = scene.things.iter().map(|placed| placed.number).collect();
        let fineness = match is_fine {
            true => FINE,
            false => COARSE,
        };
        let how = Gathering {
            sky: &self.sky,
            rays: self.rays.div_ceil(fineness.rays_for_one),
            further: self.further,
            shining_from: lights.iter().map(Light::shining_from).collect(),
        };
        for model in models {
            let Some(pose) = world_from_anchor[model.anchor] else {
                continue;
            };
            on_models.entry(key(model)).or_insert_with(|| {
                let known = (model.number, model.level, *is_fine, there.clone());
                let parts = self.known.remove(&known);
                let parts = parts.unwrap_or_else(|| Parts::new(model, &virtuals, &pose, &fineness));
                let on_model = OnModel::new(gpu, &scene, &parts, model, &pose, &how);
                if parts.corners.len() == model.corner_count() {
                    self.known.insert(known, parts);
                }
                on_model
            });
        }
    }

    /// What is known of a state. What stands is gathered finely at once, if nobody changes it: else coarsely, and finely when it is
    /// asked for once more.
    fn gathered_for(&mut self, standing: &Standing) -> GatheredState {
        let is_fine = match self.gathered.take(standing) {
            // (Where things move a frame is the same whichever frame was before it.)
            Some(known) if known.is_fine || self.moves => return known,
            Some(_) => true,
            None => {
                let is_of_same = |(other, known): &(Standing, GatheredState)| {
                    known.is_fine && differ_in_presence(other, standing)
                };
                self.is_settled || self.gathered.iter().any(is_of_same)
            }
        };
        self.is_settled = false;
        GatheredState {
            is_fine,
            on_models: BTreeMap::new(),
        }
    }

    /// Draws what was gathered where the surfaces are.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene) {
        let Some((_, gathered)) = self.gathered.last() else {
            return;
        };
        pass.set_pipeline(&self.pipeline);
        for key in &self.drawn {
            let Some(on_model) = gathered.on_models.get(key) else {
                continue;
            };
            gpu_scene.set_anchor(pass, on_model.anchor);
            pass.set_vertex_buffer(0, on_model.corners.slice(..));
            pass.draw(0..on_model.count, 0..1);
        }
    }
}

/// For how many rays light from afar is taken apart, of so many that the scene asks for.
fn rays_of_sky(rays: usize, moves: bool) -> usize {
    match moves {
        true => rays.div_ceil(COARSE.rays_for_one),
        false => rays,
    }
}

/// What `on_models` knows a model by.
fn key(model: &DrawnModel<'_>) -> (usize, usize) {
    (model.number, model.level)
}

/// All things that are there.
fn things(scene: &Scene) -> Vec<Thing> {
    let real = scene.real_occluders();
    let real = real.iter().filter_map(|thing| Thing::whole(thing, true));
    let virtuals = scene.occluders();
    let virtuals = virtuals.iter();
    let virtuals = virtuals.filter_map(|thing| Thing::whole(thing, false));
    real.chain(virtuals).collect()
}

impl Parts {
    fn new(
        model: &DrawnModel<'_>,
        virtuals: &[Bounds],
        world_from_anchor: &DAffine3,
        fineness: &Fineness,
    ) -> Self {
        let in_world = |place: Vec3| world_from_anchor.transform_point3(place.as_dvec3());
        let longest_m = |from: Vec3, to: Vec3| {
            longest_edge_m(virtuals, fineness.coarser, in_world(from), in_world(to))
        };
        let triangles = model.triangles();
        let places = triangles.iter().map(|it| it.map(|(place, _)| place));
        let surface = RayCaster::new(&places.collect::<Vec<_>>());
        let parts = subdivided(triangles, longest_m, MOST_PARTS);
        let corners: Vec<Corner> = parts.into_flattened();
        let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3)
            .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
            .collect();
        let (points, point_of_corner): (Vec<(DVec3, DVec3)>, Vec<usize>) =
            corner_points(&corners, &triangles, &surface);
        let of_points =
            |triangle: &[u32; 3]| triangle.map(|it| point_of_corner[it as usize] as u32);
        let joined: Vec<[u32; 3]> = triangles.iter().map(of_points).collect();
        Self {
            corners,
            points: GatherPoints::new(&points, &joined, model.error_m(), fineness.records),
            point_of_corner,
        }
    }
}

impl OnModel {
    fn new(
        gpu: &Gpu,
        scene: &PlacedScene<'_>,
        parts: &Parts,
        model: &DrawnModel<'_>,
        world_from_anchor: &DAffine3,
        how: &Gathering,
    ) -> Self {
        let at_points = scene.gathered(&parts.points, world_from_anchor, how);
        let corners = parts.corners.iter().zip(&parts.point_of_corner);
        let corners: Vec<GatheredCorner> = corners
            .map(|(&(position, _), &point)| {
                let Gathered { reaching, taken } = at_points[point];
                GatheredCorner {
                    position,
                    reaching,
                    taken,
                }
            })
            .collect();
        let (triangles, _) = corners.as_chunks::<3>();
        let changes = |triangle: &&[GatheredCorner; 3]| {
            let mut corners = triangle.iter();
            corners.any(|corner| corner.taken != Vec3::ZERO)
        };
        let changed = triangles.iter().filter(changes).flatten();
        Self {
            anchor: model.anchor,
            count: corners.len() as u32,
            changed: Bounds::around(changed.map(|corner| corner.position.as_dvec3())),
            corners: gpu.buffer(
                "gathered light",
                bytemuck::cast_slice(&corners),
                wgpu::BufferUsages::VERTEX,
            ),
        }
    }
}
