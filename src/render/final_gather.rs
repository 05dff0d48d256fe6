//! The ambient light and what things reflect on real surfaces, gathered by rays (environment::final_gather) at the corners of small
//! triangles that lie in them. Reads poses. Writes `reaching` and `change` (light_sums.wgsl) where depth has the surfaces already.
//!
//! It is gathered anew when a thing or a light moves in the world, not when the camera does.

use std::collections::BTreeMap;

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::final_gather::{Gathered, Gathering, Points, longest_edge_m};
use crate::environment::placed::{PlacedScene, PlacedThing};
use crate::environment::sky::Sky;
use crate::environment::thing::Thing;
use crate::geometry::bounds::Bounds;
use crate::geometry::reach::{self, PixelRect};
use crate::geometry::subdivide::{Corner, subdivided};
use crate::light::Light;
use crate::scene::Scene;

use super::gpu::Gpu;
use super::gpu_scene::{DrawnModel, GpuScene};
use super::indirect::points;
use super::pipelines::{PipelineDescription, overwritten};
use super::stencil::{IN_A_SURFACE, depth_stencil_state};
use super::uniforms::VIEW_GROUP;

/// Points on a surface where nothing moves: gathered once.
const STANDING_RECORDS: usize = 8192;
/// Points where things move, how much longer the edges between them are, and the part of all rays that each sends: gathered in
/// every frame.
const MOVING_RECORDS: usize = 2048;
const MOVING_COARSER: f32 = 2.0;
const MOVING_PART: usize = 4;
/// A real surface has hardly more parts.
const MOST_PARTS: usize = 20_000;

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
    /// None: the ambient light is gathered by the same rays.
    distant: DistantLight,
    how: Gathering,
    /// See [`longest_edge_m`].
    coarser: f32,
    pipeline: wgpu::RenderPipeline,
    /// What `on_models` was gathered for: where anchors are in the world, and the lights.
    gathered_for: Option<(Vec<Option<DAffine3>>, Vec<Light>)>,
    /// By the numbers of a thing and of its level of detail.
    on_models: BTreeMap<(usize, usize), OnModel>,
    /// Those of the present frame.
    drawn: Vec<(usize, usize)>,
}

/// What was gathered on a real thing in one level of detail.
struct OnModel {
    anchor: usize,
    corners: wgpu::Buffer,
    count: u32,
    /// Around what virtual things change, in the anchor's space; `None`: nothing.
    changed: Option<Bounds>,
}

impl FinalGather {
    /// The ambient light of a scene and what its lights have things reflect; `None` where it is not to be gathered.
    pub fn of_ambient(gpu: &Gpu, scene: &Scene) -> Option<Self> {
        let sky = |_| Sky::constant(scene.ambient_radiance);
        Self::new(gpu, scene, scene.shadows.ambient_samples as usize, sky)
    }

    /// By so many rays from each point, where nothing moves; `sky` is made for as many. `None` where there is nothing real or
    /// nothing virtual.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        rays: usize,
        sky: impl FnOnce(usize) -> Sky,
    ) -> Option<Self> {
        let (real, virtuals) = (scene.real_occluders(), scene.occluders());
        let real = real.iter().filter_map(|thing| Thing::whole(thing, true));
        let virtuals = virtuals
            .iter()
            .filter_map(|thing| Thing::whole(thing, false));
        let things: Vec<Thing> = real.chain(virtuals).collect();
        let is_seen = |is_real: bool| things.iter().any(|thing| thing.is_real == is_real);
        if rays == 0 || !is_seen(true) || !is_seen(false) {
            return None;
        }
        let (rays, most_records, coarser) = match scene.node_count() {
            1 => (rays, STANDING_RECORDS, 1.0),
            _ => (rays.div_ceil(MOVING_PART), MOVING_RECORDS, MOVING_COARSER),
        };
        let format = gpu.light_format;
        let on_surface = depth_stencil_state(
            gpu.depth_format,
            false,
            wgpu::CompareFunction::GreaterEqual,
            wgpu::StencilState::default(),
        );
        Some(Self {
            things,
            distant: DistantLight::default(),
            how: Gathering {
                sky: sky(rays),
                rays,
                most_records,
            },
            coarser,
            pipeline: gpu.pipeline(&PipelineDescription {
                shader: "final_gather.wgsl",
                vertex: "place_gathered",
                fragment: "gathered_on_real",
                constants: vec![("MULTISAMPLED", f64::from(scene.shadows.samples > 1))],
                groups: vec![Some(VIEW_GROUP)],
                vertex_buffers: vec![GATHERED_LAYOUT],
                depth_stencil: Some(wgpu::DepthStencilState {
                    bias: IN_A_SURFACE,
                    ..on_surface
                }),
                targets: vec![overwritten(format), overwritten(format)],
                samples: scene.shadows.samples,
                ..Default::default()
            }),
            gathered_for: None,
            on_models: BTreeMap::new(),
            drawn: Vec::new(),
        })
    }

    /// Gathers what the frame needs and is not known. Returns the pixels that virtual things can change.
    pub fn update(&mut self, gpu: &Gpu, gpu_scene: &GpuScene) -> PixelRect {
        self.drawn.clear();
        let Some(world_from_anchor) = gpu_scene.world_from_anchor() else {
            return PixelRect::NONE;
        };
        let gathered_for = (world_from_anchor, gpu_scene.shining());
        if self.gathered_for.as_ref() != Some(&gathered_for) {
            self.on_models.clear();
        }
        let (world_from_anchor, lights) = &gathered_for;
        let mut scene = PlacedScene {
            things: Vec::new(),
            distant: &self.distant,
            compact: lights,
        };
        for (number, thing) in self.things.iter().enumerate() {
            if let Some(pose) = &world_from_anchor[thing.anchor] {
                scene.things.push(PlacedThing::new(number, thing, pose));
            }
        }
        let virtuals = scene.things.iter().filter(|placed| !placed.thing.is_real);
        let virtuals: Vec<Bounds> = virtuals.map(PlacedThing::bounds).collect();
        let mut pixels = PixelRect::NONE;
        for model in gpu_scene.drawn_real() {
            let Some(pose) = world_from_anchor[model.anchor] else {
                continue;
            };
            let key = (model.number, model.level);
            let on_model = self.on_models.entry(key).or_insert_with(|| {
                on_model(
                    gpu,
                    &scene,
                    &virtuals,
                    &model,
                    &pose,
                    (&self.how, self.coarser),
                )
            });
            self.drawn.push(key);
            let camera_from_anchor = gpu_scene.camera_from_anchor()[model.anchor];
            let changed = on_model.changed.zip(camera_from_anchor);
            let changed = changed.map(|(bounds, camera_from_anchor)| {
                let corners = bounds.corners();
                reach::covered(&corners, &camera_from_anchor, gpu_scene.intrinsics())
            });
            pixels = pixels.union(changed.unwrap_or(PixelRect::NONE));
        }
        self.gathered_for = Some(gathered_for);
        pixels
    }

    /// Draws what was gathered where the surfaces are.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene) {
        pass.set_pipeline(&self.pipeline);
        for on_model in self.drawn.iter().filter_map(|key| self.on_models.get(key)) {
            gpu_scene.set_anchor(pass, on_model.anchor);
            pass.set_vertex_buffer(0, on_model.corners.slice(..));
            pass.draw(0..on_model.count, 0..1);
        }
    }
}

fn on_model(
    gpu: &Gpu,
    scene: &PlacedScene<'_>,
    virtuals: &[Bounds],
    model: &DrawnModel,
    world_from_anchor: &DAffine3,
    (how, coarser): (&Gathering, f32),
) -> OnModel {
    let in_world = |place: Vec3| world_from_anchor.transform_point3(place.as_dvec3());
    let longest_m =
        |from: Vec3, to: Vec3| longest_edge_m(virtuals, coarser, in_world(from), in_world(to));
    let parts = subdivided(model.triangles.clone(), longest_m, MOST_PARTS);
    let corners: Vec<Corner> = parts.into_flattened();
    let triangles: Vec<[u32; 3]> = (0..corners.len() as u32 / 3)
        .map(|triangle| [0, 1, 2].map(|corner| 3 * triangle + corner))
        .collect();
    let (points, point_of_corner) = points(&corners, &triangles);
    let in_world: Vec<(DVec3, DVec3)> = points
        .iter()
        .map(|&(place, normal)| {
            let normal = world_from_anchor.transform_vector3(normal);
            (world_from_anchor.transform_point3(place), normal)
        })
        .collect();
    let of_points = |triangle: &[u32; 3]| triangle.map(|it| point_of_corner[it as usize] as u32);
    let joined: Vec<[u32; 3]> = triangles.iter().map(of_points).collect();
    let on = Points {
        points: &in_world,
        triangles: &joined,
        error_m: model.error_m,
    };
    let at_points = scene.gathered(on, how);
    let changes = |triangle: &&[u32; 3]| {
        let mut corners = triangle.iter();
        corners.any(|&point| at_points[point as usize].taken != Vec3::ZERO)
    };
    let changed = joined.iter().filter(changes).flatten();
    let changed = Bounds::around(changed.map(|&point| points[point as usize].0));
    let corners = corners.iter().zip(&point_of_corner);
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
    OnModel {
        anchor: model.anchor,
        count: corners.len() as u32,
        corners: gpu.buffer(
            "gathered light",
            bytemuck::cast_slice(&corners),
            wgpu::BufferUsages::VERTEX,
        ),
        changed,
    }
}
