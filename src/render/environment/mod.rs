//! An environment's broad light on things that move and turn (Tamura et al. 2005): what each thing hides of its regions, by maps.
//! Reads the probe and poses. Writes the things' maps, and light sums.
//!
//! What depends on where things are in the world is worked out when they move, not when the camera does. "The world" here is as
//! the probe's light has it: a probe on a marker turns with that, and so does all that is worked out.

mod casting;
mod data;
mod own_light;
mod pipelines;

use glam::{DAffine3, Vec3};

use crate::environment::distant_light::DistantLight;
use crate::environment::glossy::EnvironmentMatrix;
use crate::environment::placed::PlacedScene;
use crate::environment::sky::Sky;
use crate::environment::surroundings::Budget;
use crate::environment::thing::Thing;
use crate::geometry::bounds::Bounds;
use crate::geometry::reach::{self, PixelRect};
use crate::light::Light;
use crate::light::probe::Probe;
use crate::scene::{EnvironmentMethod, EnvironmentSettings, Object, ProbeScene, Scene};

use super::anchor_geometry::Role;
use super::combined::BroadLight;
use super::deforming::DeformingThing;
use super::final_gather::FinalGather;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::known_states::{KnownStates, Standing};
use super::map_atlas::MapDraw;
use super::mirrored_probe::MirroredProbe;
use super::passes::Passes;
use super::precomputation::Precomputation;
use super::tables::table;
use casting::Casting;
use data::{
    EnvironmentFrame, disc_texels, gloss_texels, map_texels, receiver_texels, region_texels,
};
use own_light::OwnLight;
use pipelines::{ENVIRONMENT_GROUP, Pipelines};

/// Rays from each point of real surfaces for one that the ambient light of lamps gets: here it is all light.
const RAYS_FOR_ONE: usize = 2;
/// Rays at least.
const FEWEST_RAYS: usize = 128;

/// The broad light of a probe.
pub(super) struct Environment {
    settings: EnvironmentSettings,
    /// All broad light, linear radiance, and the camera's exposure.
    rest: (Probe, f64),
    /// The node that it turns with.
    anchor: usize,
    distant: DistantLight,
    /// The light as the paper's glossy things take it; `None`: none are drawn its way.
    gloss: Option<EnvironmentMatrix>,
    /// By their numbers in the scene, phantoms first; `None`: not there.
    things: Vec<Option<Thing>>,
    /// Where light is summed up by corners.
    own_light: OwnLight,
    pipelines: Pipelines,
    /// What real surfaces get, where rays tell that.
    final_gather: Option<FinalGather>,
    /// `None`: things have changed.
    casting: Option<Casting>,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    /// Whether any virtual thing is glossy.
    is_glossy: bool,
    /// `None`: light has changed.
    mirrored: Option<MirroredProbe>,
    /// The present state's first.
    placed: KnownStates<Standing, Placed>,
}

/// What depends on where things are.
struct Placed {
    maps: wgpu::Buffer,
    draws: Vec<MapDraw>,
    group: wgpu::BindGroup,
    disc_count: u32,
    /// Boxes around all things, in the world.
    bounds: Vec<Bounds>,
    /// Of the corners of each batch whose light is known so.
    irradiances: Vec<Option<[Vec<Vec3>; 2]>>,
    are_maps_drawn: bool,
}

impl Environment {
    /// What things hide from themselves takes a while to work out; `precomputation` may know it.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        probe: &ProbeScene,
        gpu_scene: &GpuScene,
        precomputation: &dyn Precomputation,
    ) -> Self {
        let settings = scene.shadows.environment;
        let rest = (scene.split_light(probe).rest.into_owned(), probe.exposure);
        let rays = (RAYS_FOR_ONE * scene.shadows.ambient_samples as usize).max(FEWEST_RAYS);
        let final_gather = match settings.method {
            EnvironmentMethod::Rays => {
                FinalGather::new(gpu, scene, rays, |rays| Sky::new(&rest.0, rest.1, rays))
            }
            EnvironmentMethod::Penumbrae | EnvironmentMethod::Maps => None,
        };
        let budget = match scene.moves() {
            true => Budget::MOVING,
            false => Budget::STANDING,
        };
        let kinds = gpu_scene.kinds;
        let is_by_harmonics = kinds.glossy && settings.method == EnvironmentMethod::Maps;
        Self {
            gloss: is_by_harmonics.then(|| EnvironmentMatrix::new(&rest.0, rest.1)),
            distant: DistantLight::new(&rest.0, rest.1, settings.regions as usize),
            rest,
            anchor: probe.anchor,
            things: things(scene),
            own_light: OwnLight::new(
                (&lit_by_corners(scene, final_gather.is_some()), budget),
                gpu_scene,
                precomputation,
            ),
            pipelines: Pipelines::new(gpu, scene.shadows.samples, kinds, &settings),
            final_gather,
            casting: None,
            frame: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("environment"),
                size: size_of::<EnvironmentFrame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            sampler: gpu.linear_sampler("occlusion maps"),
            is_glossy: kinds.glossy,
            mirrored: None,
            settings,
            placed: KnownStates::new(scene.moves()),
        }
    }

    /// Works out what things hide and reflect where they are.
    fn place(
        &self,
        gpu: &Gpu,
        gpu_scene: &GpuScene,
        world_from_anchor: &[Option<DAffine3>],
        compact: &[Light],
        (casting, mirrored): (&Casting, &MirroredProbe),
    ) -> Placed {
        let things = self.things.iter().enumerate();
        let things = things.filter_map(|(number, thing)| Some((number, thing.as_ref()?)));
        let scene = PlacedScene::new(things, world_from_anchor, &self.distant, compact);
        let bounds: Vec<Bounds> = scene.things.iter().map(|placed| placed.bounds()).collect();
        let discs = scene.reflecting();
        let irradiances = self.own_light.irradiances(gpu_scene, &scene, &discs);
        let maps = casting.maps(&scene, &self.distant, self.things.len());
        let (seen_by, draws) = casting.draws(&maps);
        let regions = &self.distant.regions;
        let open = scene.open_regions(self.things.len());
        let receivers = self.things.iter().zip(open.chunks(regions.len().max(1)));
        let receivers: Vec<[u32; 4]> = receivers
            .enumerate()
            .flat_map(|(number, (thing, open))| {
                let anchor_from_own = self.own_light.anchor_from_own(number);
                let thing = thing.as_ref();
                let of_thing = (thing, maps.group_of[number]);
                receiver_texels(of_thing, anchor_from_own, world_from_anchor, regions, open)
            })
            .collect();
        let flat = |texels: Vec<[[u32; 4]; 5]>| texels.into_flattened();
        let tables = [
            table(
                gpu,
                "regions",
                &regions.iter().flat_map(region_texels).collect::<Vec<_>>(),
            ),
            table(
                gpu,
                "maps",
                &flat(maps.all.iter().map(map_texels).collect()),
            ),
            table(gpu, "receivers", &receivers),
            table(
                gpu,
                "discs",
                &flat(discs.nodes.iter().map(disc_texels).collect()),
            ),
        ];
        let gloss = self.gloss_table(gpu, world_from_anchor);
        let maps = gpu.buffer(
            "occlusion maps",
            bytemuck::cast_slice(&seen_by),
            wgpu::BufferUsages::STORAGE,
        );
        let tables = tables.iter().map(wgpu::BindingResource::TextureView);
        let frame = [self.frame.as_entire_binding()];
        let rest = [
            wgpu::BindingResource::TextureView(&casting.atlas.view),
            wgpu::BindingResource::Sampler(&self.sampler),
            wgpu::BindingResource::TextureView(&mirrored.view),
            wgpu::BindingResource::Sampler(&mirrored.sampler),
            wgpu::BindingResource::TextureView(&gloss),
        ];
        let group = gpu.bind_group(
            &ENVIRONMENT_GROUP,
            frame.into_iter().chain(tables).chain(rest),
        );
        Placed {
            maps,
            draws,
            group,
            disc_count: discs.nodes.len() as u32,
            bounds,
            irradiances,
            are_maps_drawn: false,
        }
    }

    /// What the environment makes of each thing's visibility, where that is how gloss is drawn.
    fn gloss_table(&self, gpu: &Gpu, world_from_anchor: &[Option<DAffine3>]) -> wgpu::TextureView {
        let turns = (0..self.things.len()).map(|number| {
            let anchor = self.things[number].as_ref()?.anchor;
            let pose = world_from_anchor[anchor]?;
            Some(pose.matrix3 * self.own_light.anchor_from_own(number))
        });
        let gloss = self.gloss.as_ref();
        let texels = gloss.map_or(Vec::new(), |matrix| gloss_texels(matrix, turns));
        table(gpu, "gloss", &texels)
    }

    /// Places all anew where things or compact lights are elsewhere than before.
    fn follow_poses(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene) -> Option<()> {
        self.own_light.place(gpu, gpu_scene);
        let casting = self.casting.take().unwrap_or_else(|| {
            let region_count = self.distant.regions.len();
            Casting::new(gpu, &self.things, region_count, &self.settings)
        });
        let mirrored = self.mirrored.take().unwrap_or_else(|| {
            let (rest, exposure) = &self.rest;
            let glossy = self.is_glossy.then_some((rest, *exposure as f32));
            MirroredProbe::new(&gpu.device, &gpu.queue, glossy)
        });
        let standing = (gpu_scene.light_from_anchor()?, gpu_scene.shining_in_light());
        let is_as_before = |(before, _): &(Standing, Placed)| *before == standing;
        if !self.placed.last().is_some_and(is_as_before) {
            let made = (&casting, &mirrored);
            let mut placed = self.placed.take(&standing).unwrap_or_else(|| {
                let (anchors, compact) = &standing;
                self.place(gpu, gpu_scene, anchors, compact, made)
            });
            // Corners and maps have but one place, and the state before has it.
            gpu_scene.write_indirect(&gpu.queue, &placed.irradiances);
            placed.are_maps_drawn = false;
            self.placed.keep(standing, placed);
        }
        (self.casting, self.mirrored) = (Some(casting), Some(mirrored));
        Some(())
    }
}

/// A scene's objects by their numbers; `None` where one is not there, or is real and gets its light by rays.
fn lit_by_corners(scene: &Scene, is_real_gathered: bool) -> Vec<Option<&Object>> {
    let real = scene.phantoms.iter();
    let real = real.map(|object| Some(object).filter(|it| it.visible && !is_real_gathered));
    let virtuals = scene.virtuals.iter();
    let virtuals = virtuals.map(|object| Some(object).filter(|it| it.visible));
    real.chain(virtuals).collect()
}

/// Things whose light is worked out at their corners: phantoms only where no rays tell theirs.
pub(super) fn things_lit_by_corners(scene: &Scene) -> impl Iterator<Item = &Object> {
    let is_real_gathered = scene.shadows.environment.method == EnvironmentMethod::Rays;
    lit_by_corners(scene, is_real_gathered)
        .into_iter()
        .flatten()
}

/// They as light from afar meets them.
fn things(scene: &Scene) -> Vec<Option<Thing>> {
    let real = scene.real_occluders();
    let real = real.iter().map(|thing| Thing::new(thing, true));
    let virtuals = scene.occluders();
    let virtuals = virtuals.iter().map(|thing| Thing::new(thing, false));
    real.chain(virtuals).collect()
}

impl BroadLight for Environment {
    /// False where what a thing hides from itself is not known, or there is no probe any more.
    fn follow(&mut self, scene: &Scene) -> bool {
        let Some(probe) = &scene.probe else {
            return false;
        };
        if probe.anchor != self.anchor {
            return false;
        }
        let objects = lit_by_corners(scene, self.final_gather.is_some());
        if !self.own_light.follow(&objects) {
            return false;
        }
        let rest = scene.split_light(probe).rest;
        let (known, exposure) = &self.rest;
        if (known, *exposure) != (rest.as_ref(), probe.exposure) {
            self.rest = (rest.into_owned(), probe.exposure);
            let (rest, exposure) = (&self.rest.0, self.rest.1);
            self.distant = DistantLight::new(rest, exposure, self.settings.regions as usize);
            if let Some(gloss) = &mut self.gloss {
                *gloss = EnvironmentMatrix::new(rest, exposure);
            }
            self.mirrored = None;
            if let Some(final_gather) = &mut self.final_gather {
                final_gather.set_sky(|rays| Sky::new(rest, exposure, rays));
            }
        }
        if let Some(final_gather) = &mut self.final_gather {
            final_gather.follow(scene);
        }
        self.things = things(scene);
        self.casting = None;
        self.placed.clear();
        true
    }

    fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        for deforming in things {
            let object = &deforming.object;
            let is_real = deforming.role == Role::Real;
            let Some(thing) = Thing::new(&object.occluder(), is_real) else {
                continue;
            };
            if let Some(casting) = &self.casting {
                casting.deform(gpu, deforming.number, &thing);
            }
            self.own_light
                .deform(gpu, gpu_scene, deforming.number, object);
            if let Some(known) = self.things.get_mut(deforming.number) {
                *known = Some(thing);
            }
            self.placed.clear();
        }
        if let Some(final_gather) = &mut self.final_gather {
            final_gather.deform(things);
        }
    }

    fn mirrored(&self) -> Option<&MirroredProbe> {
        self.mirrored.as_ref()
    }

    fn update(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene) -> Option<PixelRect> {
        let camera_from_world = gpu_scene.camera_from_light()?;
        let world_from_camera = camera_from_world.inverse();
        self.follow_poses(gpu, gpu_scene)?;
        let gathered = self.final_gather.as_mut();
        let gathered = gathered.map(|gathered| gathered.update(gpu, gpu_scene));
        let ((_, placed), casting) = (self.placed.last()?, self.casting.as_ref()?);
        let is_real = |&&number: &&usize| {
            self.things[number]
                .as_ref()
                .is_some_and(|thing| thing.is_real)
        };
        let frame = EnvironmentFrame {
            world_from_camera: glam::DMat4::from(world_from_camera).as_mat4(),
            region_count: self.distant.regions.len() as u32,
            caster_count: casting.casters.len() as u32,
            real_caster_count: casting.casters.iter().filter(is_real).count() as u32,
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
        let Some((_, placed)) = self
            .placed
            .last_mut()
            .filter(|(_, placed)| !placed.are_maps_drawn)
        else {
            return;
        };
        let Some(casting) = &self.casting else {
            return;
        };
        casting.draw(gpu, passes, &placed.maps, &placed.draws);
        placed.are_maps_drawn = true;
    }

    fn draw_all_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        gpu_scene: &GpuScene,
        within: PixelRect,
    ) {
        let Some((_, placed)) = self.placed.last() else {
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
