//! An environment's broad light on things that move and turn (Tamura et al. 2005): what each thing hides of its regions, by maps.
//! Reads the probe and poses. Writes the things' maps, and light sums.
//!
//! What depends on where things are in the world is worked out when they move, not when the camera does.

mod data;
mod deforming;
mod pipelines;

use glam::{DAffine3, DVec3, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::occlusion_map::OcclusionMap;
use crate::environment::placed::PlacedScene;
use crate::environment::reflected::DiscTree;
use crate::environment::self_occlusion::{SelfOcclusion, TRANSFER_DEGREE, self_occlusions};
use crate::environment::sky::Sky;
use crate::environment::surroundings::LocalLight;
use crate::environment::thing::Thing;
use crate::geometry::bounds::Bounds;
use crate::geometry::ray_caster::RayCaster;
use crate::geometry::reach::{self, PixelRect};
use crate::light::Light;
use crate::light::harmonics::Turn;
use crate::scene::{EnvironmentMethod, Object, ProbeScene, Scene};
use crate::shafts::shadow_atlas::Tiling;

use super::anchor_geometry::Role;
use super::combined::BroadLight;
use super::deforming::DeformingThing;
use super::final_gather::FinalGather;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::indirect::points;
use super::map_atlas::MapAtlas;
use super::mirrored_probe::MirroredProbe;
use super::passes::Passes;
use data::{
    EnvironmentFrame, disc_texels, map_texels, occlusion_corners, receiver_texels, region_texels,
    table,
};
use pipelines::{ENVIRONMENT_GROUP, Pipelines};

/// Rays start this part of a thing's size off its surface.
const START_OFFSET: f64 = 1e-4;

/// Rays from each point of real surfaces for one that the ambient light of lamps gets: here it is all light.
const RAYS_FOR_ONE: usize = 2;
/// Rays at least.
const FEWEST_RAYS: usize = 128;

/// The broad light of a probe.
pub(super) struct Environment {
    distant: DistantLight,
    /// By their numbers in the scene, phantoms first; `None`: not there.
    things: Vec<Option<Thing>>,
    /// Those that have maps, the real ones first.
    casters: Vec<usize>,
    /// Triangles of all casters, each in its anchor's space, and which are whose.
    triangles: wgpu::Buffer,
    ranges: Vec<std::ops::Range<u32>>,
    /// For each batch what its corners hide from themselves; `None` where its light is gathered otherwise.
    occlusions: Vec<Option<BatchOcclusion>>,
    pipelines: Pipelines,
    /// What real surfaces get, where rays tell that.
    final_gather: Option<FinalGather>,
    tiling: Tiling,
    atlas: MapAtlas,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    mirrored: MirroredProbe,
    /// What `placed` was worked out for: where anchors are in the world, and the compact lights.
    placed_for: Option<(Vec<Option<DAffine3>>, Vec<Light>)>,
    placed: Option<Placed>,
}

/// A batch's corners as light from afar meets them.
struct BatchOcclusion {
    anchor: usize,
    points: Vec<(DVec3, DVec3)>,
    occlusions: Vec<SelfOcclusion>,
    point_of_corner: Vec<usize>,
    /// Number of each point's thing.
    thing_of_point: Vec<usize>,
}

/// What depends on where things are.
struct Placed {
    maps: wgpu::Buffer,
    group: wgpu::BindGroup,
    disc_count: u32,
    /// Boxes around all things, in the world.
    bounds: Vec<Bounds>,
    are_maps_drawn: bool,
}

impl Environment {
    /// Works out what the things hide from themselves, which takes a while.
    pub fn new(gpu: &Gpu, scene: &Scene, probe: &ProbeScene, gpu_scene: &mut GpuScene) -> Self {
        let settings = scene.shadows.environment;
        let rest = scene.split_light(probe).rest;
        let distant = DistantLight::new(&rest, probe.exposure, settings.regions as usize);
        let real = scene.real_occluders();
        let virtuals = scene.occluders();
        let things: Vec<Option<Thing>> = real
            .iter()
            .map(|thing| Thing::new(thing, true))
            .chain(virtuals.iter().map(|thing| Thing::new(thing, false)))
            .collect();
        let casters: Vec<usize> = (0..things.len())
            .filter(|&number| things[number].as_ref().is_some_and(|thing| thing.casts))
            .collect();
        let mut triangles: Vec<[Vec3; 3]> = Vec::new();
        let ranges = casters.iter().filter_map(|&number| things[number].as_ref());
        let ranges = ranges
            .map(|thing| {
                let first = 3 * triangles.len() as u32;
                triangles.extend(&thing.triangles);
                first..3 * triangles.len() as u32
            })
            .collect();
        let objects: Vec<&Object> = scene.phantoms.iter().chain(&scene.virtuals).collect();
        let rays = (RAYS_FOR_ONE * scene.shadows.ambient_samples as usize).max(FEWEST_RAYS);
        let final_gather = match settings.method {
            EnvironmentMethod::Rays => FinalGather::new(gpu, scene, rays, |rays| {
                Sky::new(&rest, probe.exposure, rays)
            }),
            EnvironmentMethod::Penumbrae | EnvironmentMethod::Maps => None,
        };
        let occlusions = occlusions(&objects, gpu_scene, final_gather.is_some());
        let buffers: Vec<Option<wgpu::Buffer>> = gpu_scene
            .corners()
            .zip(&occlusions)
            .map(|((_, _, corners), batch)| {
                let batch = batch.as_ref()?;
                let visibility =
                    |corner: usize| batch.occlusions[batch.point_of_corner[corner]].visibility;
                let contents = occlusion_corners(&corners.thing_of, visibility);
                Some(gpu.buffer("self-occlusion", &contents, wgpu::BufferUsages::VERTEX))
            })
            .collect();
        gpu_scene.set_occlusion(buffers.into_iter());
        let count = casters.len() * distant.regions.len();
        let largest_px = gpu.device.limits().max_texture_dimension_2d;
        let tiling = Tiling::new(count, settings.map_px, largest_px);
        let kinds = gpu_scene.kinds;
        let glossy = kinds.glossy.then(|| (rest.as_ref(), probe.exposure as f32));
        Self {
            pipelines: Pipelines::new(gpu, scene.shadows.samples, kinds, settings.method),
            final_gather,
            atlas: MapAtlas::new(gpu, tiling, "occlusion_maps.wgsl"),
            tiling,
            triangles: gpu.buffer(
                "environment's casters",
                bytemuck::cast_slice(&triangles),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            ranges,
            frame: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("environment"),
                size: size_of::<EnvironmentFrame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("occlusion maps"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
            mirrored: MirroredProbe::new(&gpu.device, &gpu.queue, glossy),
            distant,
            things,
            casters,
            occlusions,
            placed_for: None,
            placed: None,
        }
    }

    /// Works out what things hide and reflect where they are.
    fn place(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        world_from_anchor: &[Option<DAffine3>],
        compact: &[Light],
    ) -> Placed {
        let things = self.things.iter().enumerate();
        let things = things.filter_map(|(number, thing)| Some((number, thing.as_ref()?)));
        let scene = PlacedScene::new(things, world_from_anchor, &self.distant, compact);
        let bounds: Vec<Bounds> = scene.things.iter().map(|placed| placed.bounds()).collect();
        let discs = scene.reflecting();
        let lit = self.light_of_corners(&scene, &bounds, &discs, world_from_anchor);
        for (number, irradiances) in lit.iter().enumerate() {
            if let Some(irradiances) = irradiances {
                gpu_scene.write_indirect(&gpu.queue, number, irradiances);
            }
        }
        let maps = self.maps(&scene);
        let regions = &self.distant.regions;
        let open = scene.open_regions(self.things.len());
        let receivers = self.things.iter().zip(open.chunks(regions.len().max(1)));
        let receivers: Vec<[u32; 4]> = receivers
            .flat_map(|(thing, open)| {
                receiver_texels(thing.as_ref(), world_from_anchor, regions, open)
            })
            .collect();
        let flat = |texels: Vec<[[u32; 4]; 5]>| texels.into_flattened();
        let tables = [
            table(
                gpu,
                "regions",
                &regions.iter().flat_map(region_texels).collect::<Vec<_>>(),
            ),
            table(gpu, "maps", &flat(maps.iter().map(map_texels).collect())),
            table(gpu, "receivers", &receivers),
            table(
                gpu,
                "discs",
                &flat(discs.nodes.iter().map(disc_texels).collect()),
            ),
        ];
        let maps = gpu.buffer(
            "occlusion maps",
            bytemuck::cast_slice(&maps),
            wgpu::BufferUsages::STORAGE,
        );
        let tables = tables.iter().map(wgpu::BindingResource::TextureView);
        let frame = [self.frame.as_entire_binding()];
        let rest = [
            wgpu::BindingResource::TextureView(&self.atlas.view),
            wgpu::BindingResource::Sampler(&self.sampler),
            wgpu::BindingResource::TextureView(&self.mirrored.view),
            wgpu::BindingResource::Sampler(&self.mirrored.sampler),
        ];
        let group = gpu.bind_group(
            &ENVIRONMENT_GROUP,
            frame.into_iter().chain(tables).chain(rest),
        );
        Placed {
            maps,
            group,
            disc_count: discs.nodes.len() as u32,
            bounds,
            are_maps_drawn: false,
        }
    }

    /// For each caster and region its map.
    fn maps(&self, scene: &PlacedScene<'_>) -> Vec<OcclusionMap> {
        let reach_m = scene.reach_m();
        let mut maps = Vec::new();
        for &caster in &self.casters {
            let placed = scene.position(caster);
            for region in &self.distant.regions {
                let index = maps.len() as u32;
                maps.push(match placed {
                    Some(placed) => OcclusionMap::new(
                        &scene.things[placed],
                        region,
                        reach_m,
                        (&self.tiling, index),
                        caster as u32,
                    ),
                    None => OcclusionMap::NOWHERE,
                });
            }
        }
        maps
    }

    /// For each batch the irradiance of its corners: on virtual things of all broad light that they do not hide from
    /// themselves, on real ones of what others reflect.
    fn light_of_corners(
        &self,
        scene: &PlacedScene<'_>,
        bounds: &[Bounds],
        discs: &DiscTree,
        world_from_anchor: &[Option<DAffine3>],
    ) -> Vec<Option<Vec<Vec3>>> {
        let lights: Vec<Option<LocalLight>> = (0..scene.things.len())
            .map(|index| {
                let is_wanted = !scene.things[index].thing.is_real || self.final_gather.is_none();
                is_wanted.then(|| LocalLight::new(scene, bounds[index], index))
            })
            .collect();
        let of_batch = |batch: &BatchOcclusion| {
            let Some(pose) = &world_from_anchor[batch.anchor] else {
                return vec![Vec3::ZERO; batch.point_of_corner.len()];
            };
            let turn = Turn::new(pose.matrix3.transpose(), TRANSFER_DEGREE);
            let turned = |light: &Option<LocalLight>| Some(light.as_ref()?.turned(&turn));
            let lights: Vec<Option<LocalLight>> = lights.iter().map(turned).collect();
            let points = batch
                .points
                .iter()
                .zip(&batch.occlusions)
                .zip(&batch.thing_of_point);
            let of_point =
                |((point, occlusion), thing): ((&(DVec3, DVec3), &SelfOcclusion), &usize)| {
                    let Some(index) = scene.position(*thing) else {
                        return Vec3::ZERO;
                    };
                    let Some(light) = &lights[index] else {
                        return Vec3::ZERO;
                    };
                    let place = pose.transform_point3(point.0);
                    let around = occlusion.irradiance(&light.at(place));
                    let of_itself = match scene.things[index].thing.is_real {
                        true => Vec3::ZERO,
                        false => {
                            let normal = pose.transform_vector3(point.1).as_vec3();
                            discs.irradiance_from_itself(index, place.as_vec3(), normal)
                        }
                    };
                    around + of_itself
                };
            let at_points: Vec<Vec3> = points.map(of_point).collect();
            let corners = batch.point_of_corner.iter();
            corners.map(|&point| at_points[point]).collect()
        };
        let batches = self.occlusions.iter();
        batches.map(|batch| batch.as_ref().map(of_batch)).collect()
    }
}

/// For each batch what its corners hide from themselves, but for real ones where their light is gathered; `objects` by their
/// numbers.
fn occlusions(
    objects: &[&Object],
    gpu_scene: &GpuScene,
    is_real_gathered: bool,
) -> Vec<Option<BatchOcclusion>> {
    let casters: Vec<(RayCaster, f64)> = objects
        .iter()
        .map(|object| {
            let positions = object.positions_in_anchor(&object.mesh);
            let triangles = object.mesh.triangles.iter();
            let corners: Vec<[Vec3; 3]> = triangles
                .map(|triangle| triangle.map(|index| positions[index as usize]))
                .collect();
            let size_m = object
                .bounds_in_anchor()
                .map_or(0.0, |bounds| (bounds.high - bounds.low).length());
            (RayCaster::new(&corners), size_m)
        })
        .collect();
    let of_batch =
        |(role, anchor, corners): (Role, usize, &super::anchor_geometry::BatchCorners)| {
            if role == Role::Real && is_real_gathered {
                return None;
            }
            let (points, point_of_corner) = points(&corners.corners.0, &corners.corners.1);
            let mut thing_of_point = vec![0; points.len()];
            for (&point, &thing) in point_of_corner.iter().zip(&corners.thing_of) {
                thing_of_point[point] = thing as usize;
            }
            let occlusions = self_occlusions(&points, |point| {
                let (caster, size_m) = &casters[thing_of_point[point]];
                (caster, size_m * START_OFFSET)
            });
            Some(BatchOcclusion {
                anchor,
                points,
                occlusions,
                point_of_corner,
                thing_of_point,
            })
        };
    gpu_scene.corners().map(of_batch).collect()
}

impl BroadLight for Environment {
    /// Things that are elsewhere on their anchors take a new renderer.
    fn follow(&mut self, _scene: &Scene) -> bool {
        false
    }

    fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        for thing in things {
            self.deform_thing(gpu, gpu_scene, thing);
        }
        if let Some(final_gather) = &mut self.final_gather {
            final_gather.deform(things);
        }
    }

    fn update(&mut self, gpu: &Gpu, gpu_scene: &GpuScene) -> Option<PixelRect> {
        let camera_from_world = (*gpu_scene.camera_from_anchor().first()?)?;
        let world_from_camera = camera_from_world.inverse();
        let world_from_anchor = gpu_scene.world_from_anchor()?;
        let placed_for = (world_from_anchor, gpu_scene.shining());
        if self.placed_for.as_ref() != Some(&placed_for) {
            let (anchors, compact) = &placed_for;
            self.placed = Some(self.place(gpu, gpu_scene, anchors, compact));
            self.placed_for = Some(placed_for);
        }
        let gathered = self.final_gather.as_mut();
        let gathered = gathered.map(|gathered| gathered.update(gpu, gpu_scene));
        let placed = self.placed.as_ref()?;
        let is_real = |&&number: &&usize| {
            self.things[number]
                .as_ref()
                .is_some_and(|thing| thing.is_real)
        };
        let frame = EnvironmentFrame {
            world_from_camera: glam::DMat4::from(world_from_camera).as_mat4(),
            region_count: self.distant.regions.len() as u32,
            caster_count: self.casters.len() as u32,
            real_caster_count: self.casters.iter().filter(is_real).count() as u32,
            disc_count: placed.disc_count,
        };
        gpu.queue
            .write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let has_virtual = self.things.iter().flatten().any(|thing| !thing.is_real);
        let covered = |bounds: &Bounds| {
            reach::covered(
                &bounds.corners(),
                &camera_from_world,
                gpu_scene.intrinsics(),
            )
        };
        let pixels = gathered.unwrap_or_else(|| {
            let pixels = placed.bounds.iter().map(covered);
            pixels.fold(PixelRect::NONE, PixelRect::union)
        });
        (has_virtual && !pixels.is_empty()).then_some(pixels)
    }

    fn draw_maps(&mut self, gpu: &Gpu, passes: &mut Passes<'_>) {
        let Some(placed) = self.placed.as_mut().filter(|placed| !placed.are_maps_drawn) else {
            return;
        };
        let regions = self.distant.regions.len();
        self.atlas.draw(
            gpu,
            passes,
            &placed.maps,
            (self.casters.len() * regions) as u32,
            &self.triangles,
            |tile| self.ranges[tile as usize / regions].clone(),
        );
        placed.are_maps_drawn = true;
    }

    fn draw_all_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        gpu_scene: &GpuScene,
        within: PixelRect,
    ) {
        let Some(placed) = &self.placed else {
            return;
        };
        pass.set_bind_group(2, &placed.group, &[]);
        let pipelines = &self.pipelines;
        let on_real = match &self.final_gather {
            Some(_) => &pipelines.depth_of_real,
            None => &pipelines.light_on_real,
        };
        let whole = DrawnLight::Whole(0);
        gpu_scene.draw_surfaces(pass, on_real, Role::Real, whole, within);
        if let Some(final_gather) = &self.final_gather {
            final_gather.draw(pass, gpu_scene);
        }
        pass.set_bind_group(2, &placed.group, &[]);
        let on_virtual = &pipelines.light_on_virtual;
        gpu_scene.draw_surfaces(pass, on_virtual, Role::Virtual, whole, within);
    }
}
