//! Soft shadows by shafts: what virtual things hide of a room's light, what they reflect, and the light on them.
//! Reads the room's transport, and poses. Writes the sources' maps, light sums, and then the picture.
//!
//! What depends on where things are in the world is worked out when they move, not when the camera does.

pub(super) mod data;
mod pictured;
mod pipelines;

use glam::{DAffine3, DVec3, Vec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::reach::{self, PixelRect};
use crate::scene::{Difference, Object, ProbeScene, Scene, ShaftSettings};
use crate::shafts::bounding::Aabb;
use crate::shafts::casters::{PlacedCasters, ShaftCasters};
use crate::shafts::difference::Terms;
use crate::shafts::hidden_light::{HiddenLight, ShadowOptions};
use crate::shafts::patches::RoomPatch;
use crate::shafts::receiver_patches::ReflectedCorner;
use crate::shafts::room_transport::RoomTransport;
use crate::shafts::shadow_atlas::Tiling;
use crate::shafts::surfels::{GroupedSurfels, interreflected_irradiance};

use super::anchor_geometry::Role;
use super::attachments::{cleared, depth_stencil};
use super::background::Background;
use super::combined::BroadLight;
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::light_sums::{BY_GAIN, CompositeShader, LightSums};
use super::map_atlas::{MapAtlas, MapDraw};
use super::mirrored_probe::MirroredProbe;
use super::passes::Passes;
use super::precomputation::Precomputation;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::surfaces::SurfaceKinds;
use super::technique::{FrameContext, TechniquePasses};
use super::volumes::set_scissor;
use data::ShaftFrame;
use pictured::Pictured;
use pipelines::{Pipelines, SHAFT_GROUP};

/// The technique that shades all of a room's light by shafts.
pub(super) struct ShaftsAlone {
    shafts: Shafts,
    /// The real things whose pictures count: where radiance is taken away, and there are some.
    pictured: Option<Pictured>,
    sums: LightSums,
}

/// A room's broad light.
pub(super) struct Shafts {
    room: RoomTransport,
    /// Of the room that `room` is the transport of.
    surfaces_key: u64,
    settings: ShaftSettings,
    /// For each standing phantom whether a picture says what it reflects.
    is_pictured: Vec<bool>,
    casters: ShaftCasters,
    pipelines: Pipelines,
    maps: MapAtlas,
    /// Corners of all patches and their irradiance without virtual things, three each: the phantoms' and the table's first.
    places: wgpu::Buffer,
    place_count: u32,
    /// Those of the room's parts alone begin here.
    first_of_room: u32,
    /// Mean irradiance where things stand, for what moves.
    moving_irradiance: Vec3,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    environment: MirroredProbe,
    /// Where the casters' anchors were when `hidden` was worked out.
    world_from_anchor: Vec<Option<DAffine3>>,
    hidden: Option<Hidden>,
}

/// The light that the casters hide where they are, on the GPU.
struct Hidden {
    sources: wgpu::Buffer,
    source_count: u32,
    casters: wgpu::Buffer,
    caster_vertices: u32,
    /// Corners of the patches that sources light, and of the parts that casters reflect light on to.
    corners: wgpu::Buffer,
    corner_count: u32,
    reflected: wgpu::Buffer,
    reflected_count: u32,
    group: wgpu::BindGroup,
    /// The boxes around the virtual things, and around all that receives shadow or reflected light.
    changed: Vec<Aabb>,
    /// What the casters reflect.
    surfels: GroupedSurfels,
    /// Whether the maps show it.
    is_drawn: bool,
}

impl Shafts {
    /// `precomputation` gives the light of the scene's room.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        probe: &ProbeScene,
        kinds: SurfaceKinds,
        precomputation: &dyn Precomputation,
    ) -> Self {
        let parts = scene.room(probe);
        let surfaces_key = parts.surfaces_key();
        let room = precomputation.transport(&parts);
        let device = &gpu.device;
        let standing = parts.standing;
        let is_standing = |patch: &&RoomPatch| patch.piece < standing;
        let patches = || room.patches.patches.iter();
        let ordered = patches()
            .filter(is_standing)
            .chain(patches().filter(|it| !is_standing(it)));
        let places: Vec<ReflectedCorner> = ordered
            .flat_map(|patch| patch.vertices)
            .map(|vertex| ReflectedCorner {
                position: room.patches.vertices[vertex as usize].position,
                irradiance: room.irradiance[vertex as usize],
            })
            .collect();
        let first_of_room = 3 * patches().filter(is_standing).count() as u32;
        let settings = scene.shadows.shafts;
        let samples = scene.shadows.samples;
        let tiling = Tiling::new(1, settings.map_px, device.limits().max_texture_dimension_2d);
        let environment = kinds
            .glossy
            .then_some((parts.probe.probe.as_ref(), parts.probe.exposure));
        Self {
            pipelines: Pipelines::new(gpu, samples, kinds),
            maps: MapAtlas::new(gpu, tiling, "shaft_maps.wgsl"),
            casters: ShaftCasters::new(&scene.occluders()),
            places: gpu.buffer(
                "patches",
                bytemuck::cast_slice(&places),
                wgpu::BufferUsages::VERTEX,
            ),
            place_count: places.len() as u32,
            first_of_room,
            moving_irradiance: mean_irradiance(&room, &parts.things),
            frame: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("shafts"),
                size: size_of::<ShaftFrame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            sampler: gpu.linear_sampler("shaft maps"),
            environment: MirroredProbe::new(device, &gpu.queue, environment),
            world_from_anchor: Vec::new(),
            hidden: None,
            is_pictured: scene.standing_phantoms().map(Object::is_pictured).collect(),
            settings,
            surfaces_key,
            room,
        }
    }

    /// Works out what is hidden where things are now. Returns the pixels that it can change, `None` if none.
    pub fn update(&mut self, gpu: &Gpu, gpu_scene: &GpuScene) -> Option<PixelRect> {
        let camera_from_world = (*gpu_scene.camera_from_anchor().first()?)?;
        let world_from_camera = camera_from_world.inverse();
        let world_from_anchor = gpu_scene.world_from_anchor()?;
        if self.world_from_anchor != world_from_anchor {
            self.hidden = self
                .casters
                .place(&world_from_anchor)
                .map(|placed| self.hide(gpu, &placed));
            let volume = &self.room.volume;
            gpu_scene.set_indirect(&gpu.queue, &world_from_anchor, |place, normal| {
                let surfels = self.hidden.iter().flat_map(|hidden| hidden.surfels.all());
                volume.irradiance(place, normal) + interreflected_irradiance(place, normal, surfels)
            });
            self.world_from_anchor = world_from_anchor;
        }
        let hidden = self.hidden.as_ref()?;
        let frame = ShaftFrame {
            world_from_camera: glam::DMat4::from(world_from_camera).as_mat4(),
            source_count: hidden.source_count,
            moving_irradiance: self.moving_irradiance,
        };
        gpu.queue
            .write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let covered = |bounds: &Aabb| {
            let corners = bounds.corners().map(|corner| corner.as_dvec3());
            reach::covered(&corners, &camera_from_world, gpu_scene.intrinsics())
        };
        let changed = hidden.changed.iter().map(covered);
        let pixels = changed.fold(PixelRect::NONE, PixelRect::union);
        (!pixels.is_empty()).then_some(pixels)
    }

    /// Works out what the casters hide, and takes it to the GPU.
    fn hide(&mut self, gpu: &Gpu, placed: &PlacedCasters) -> Hidden {
        let options = ShadowOptions {
            sources: self.settings.sources,
            map_px: self.settings.map_px,
            largest_atlas_px: gpu.device.limits().max_texture_dimension_2d,
            terms: Terms {
                difference: self.settings.difference,
                pictured: &self.is_pictured,
            },
        };
        let hidden = HiddenLight::new(&self.room, placed, &options);
        self.maps.resize(&gpu.device, hidden.tiling);
        let storage = |label, contents| gpu.buffer(label, contents, wgpu::BufferUsages::STORAGE);
        let vertices = |label, contents| gpu.buffer(label, contents, wgpu::BufferUsages::VERTEX);
        let receivers = &hidden.receivers;
        let sources = storage("sources", bytemuck::cast_slice(&hidden.sources));
        let buffers = [
            &self.frame,
            &sources,
            &storage("irradiances", bytemuck::cast_slice(&hidden.light)),
            &storage("transfers", bytemuck::cast_slice(&hidden.transfers)),
            &storage("shadowed by", bytemuck::cast_slice(&receivers.lists)),
        ];
        let seen = placed.seen.iter().copied();
        Hidden {
            group: self.group(gpu, buffers),
            source_count: hidden.sources.len() as u32,
            sources,
            casters: vertices("shaft casters", bytemuck::cast_slice(&placed.triangles)),
            caster_vertices: 3 * placed.triangles.len() as u32,
            corners: vertices("receivers", bytemuck::cast_slice(&receivers.corners)),
            corner_count: receivers.corners.len() as u32,
            reflected: vertices("reflected", bytemuck::cast_slice(&receivers.reflected)),
            reflected_count: receivers.reflected.len() as u32,
            changed: seen.chain(receivers.bounds()).collect(),
            surfels: hidden.surfels,
            is_drawn: false,
        }
    }

    /// Group 2 of shafts.wgsl; the buffers are those of the first bindings.
    fn group(&self, gpu: &Gpu, buffers: [&wgpu::Buffer; 5]) -> wgpu::BindGroup {
        let buffers = buffers.map(|buffer| buffer.as_entire_binding());
        let textures = [
            wgpu::BindingResource::TextureView(&self.maps.view),
            wgpu::BindingResource::Sampler(&self.sampler),
            wgpu::BindingResource::TextureView(&self.environment.view),
            wgpu::BindingResource::Sampler(&self.environment.sampler),
        ];
        gpu.bind_group(&SHAFT_GROUP, buffers.into_iter().chain(textures))
    }

    /// Draws the sources' maps where they are not drawn yet.
    pub fn draw_maps(&mut self, gpu: &Gpu, passes: &mut Passes<'_>) {
        let Some(hidden) = self.hidden.as_mut().filter(|hidden| !hidden.is_drawn) else {
            return;
        };
        self.maps.draw(
            gpu,
            passes,
            &hidden.sources,
            &hidden.casters,
            (0..hidden.source_count).map(|source| MapDraw {
                tile: source,
                seen_by: source,
                corners: 0..hidden.caster_vertices,
            }),
        );
        hidden.is_drawn = true;
    }

    /// Draws what is real into depth, what is virtual over it, and the light on both; where other lights are added to it, on
    /// all that is real.
    fn draw_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        gpu_scene: &GpuScene,
        within: PixelRect,
        receivers: Receivers,
    ) {
        let Some(hidden) = &self.hidden else {
            return;
        };
        pass.set_bind_group(2, &hidden.group, &[]);
        gpu_scene.set_world(pass);
        pass.set_pipeline(&self.pipelines.depth_of_room);
        pass.set_vertex_buffer(0, self.places.slice(..));
        pass.draw(0..self.place_count, 0..1);
        let moving = match receivers {
            Receivers::Shadowed => &self.pipelines.depth_of_real,
            Receivers::All => &self.pipelines.light_on_moving,
        };
        gpu_scene.draw_moving_real(pass, moving, within);
        gpu_scene.draw_surfaces(
            pass,
            &self.pipelines.light_on_virtual,
            Role::Virtual,
            DrawnLight::Whole(0),
            within,
        );
        gpu_scene.set_world(pass);
        if receivers == Receivers::All {
            pass.set_pipeline(&self.pipelines.whole_light_on_patch);
            pass.set_vertex_buffer(0, self.places.slice(..));
            pass.draw(0..self.place_count, 0..1);
        }
        pass.set_pipeline(&self.pipelines.light_on_patch);
        pass.set_vertex_buffer(0, hidden.corners.slice(..));
        pass.draw(0..hidden.corner_count, 0..1);
        pass.set_pipeline(&self.pipelines.reflected_on_patch);
        pass.set_vertex_buffer(0, hidden.reflected.slice(..));
        pass.draw(0..hidden.reflected_count, 0..1);
    }

    /// Draws the room's own parts, which no other pass knows, into depth.
    pub fn draw_depth_of_room(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene) {
        let Some(hidden) = &self.hidden else {
            return;
        };
        pass.set_bind_group(2, &hidden.group, &[]);
        gpu_scene.set_world(pass);
        pass.set_pipeline(&self.pipelines.depth_of_room);
        pass.set_vertex_buffer(0, self.places.slice(..));
        pass.draw(self.first_of_room..self.place_count, 0..1);
    }
}

impl BroadLight for Shafts {
    /// False where the room is another one.
    fn follow(&mut self, scene: &Scene) -> bool {
        let Some(probe) = &scene.probe else {
            return false;
        };
        let parts = scene.room(probe);
        if parts.surfaces_key() != self.surfaces_key {
            return false;
        }
        let corners = |bounds: Bounds| [bounds.low, bounds.high].map(|corner| corner.as_vec3());
        let is_held = |bounds| self.room.volume.holds(&Aabb::around(corners(bounds)));
        if !scene.virtual_bounds().all(is_held) {
            self.room.gather_volume(&parts.things);
        }
        self.casters.follow(&scene.occluders());
        self.world_from_anchor.clear();
        true
    }

    fn deform(&mut self, _gpu: &Gpu, _gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        // (Of real things only light from afar on what stands still is known; what moves is drawn as it is.)
        let is_virtual = |thing: &&&DeformingThing| thing.role == Role::Virtual;
        for DeformingThing { index, object, .. } in things.iter().filter(is_virtual) {
            self.casters.deform(*index, &object.occluder());
        }
        self.world_from_anchor.clear();
    }

    fn set_sources(&mut self, sources: Option<u32>) {
        self.settings.sources = sources;
        self.world_from_anchor.clear();
    }

    fn mirrored(&self) -> Option<&MirroredProbe> {
        Some(&self.environment)
    }

    fn update(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene) -> Option<PixelRect> {
        self.update(gpu, gpu_scene)
    }

    fn draw_maps(&mut self, gpu: &Gpu, passes: &mut Passes<'_>) {
        self.draw_maps(gpu, passes);
    }

    fn draw_all_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        gpu_scene: &GpuScene,
        within: PixelRect,
    ) {
        self.draw_light(pass, gpu_scene, within, Receivers::All);
    }

    fn draw_own_depth(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene) {
        self.draw_depth_of_room(pass, gpu_scene);
    }
}

/// The real surfaces whose light is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Receivers {
    /// Those that may get a shadow of the room's light.
    Shadowed,
    /// All.
    All,
}

impl ShaftsAlone {
    /// Around a room's light.
    pub fn new(gpu: &Gpu, scene: &Scene, background: &Background, shafts: Shafts) -> Self {
        let difference = scene.shadows.shafts.difference;
        let counts = difference == Difference::Subtract;
        let shader = composite(difference);
        Self {
            pictured: counts.then(|| Pictured::new(gpu, scene)).flatten(),
            sums: LightSums::new(gpu, background, scene.shadows.samples, shader),
            shafts,
        }
    }
}

impl TechniquePasses for ShaftsAlone {
    fn follow(&mut self, scene: &Scene) -> bool {
        self.shafts.follow(scene)
    }

    fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        self.shafts.deform(gpu, gpu_scene, things);
    }

    fn set_sources(&mut self, sources: Option<u32>) {
        self.shafts.set_sources(sources);
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        match shown {
            Shown::Bare => None,
            Shown::Composite => {
                let pixels = self.shafts.update(gpu, gpu_scene);
                pixels.map(ScreenBounds::pixels_alone)
            }
        }
    }

    fn mirrored(&self) -> Option<&MirroredProbe> {
        self.shafts.mirrored()
    }

    /// Gibson et al. 2003, section 7, in as few passes over the pixels as there are: one.
    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.shafts.draw_maps(frame.gpu, passes);
        let mut pass = passes.begin(
            "shafts",
            Some(GpuSpan::Light.whole()),
            &[cleared(&self.sums.reaching), cleared(&self.sums.change)],
            Some(depth_stencil(&self.sums.depth_stencil, true, true)),
        );
        set_scissor(&mut pass, frame.bounds.pixels);
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        self.shafts
            .draw_light(&mut pass, gpu_scene, pixels, Receivers::Shadowed);
        if let Some(pictured) = &self.pictured {
            pictured.multiply(&mut pass, gpu_scene);
        }
        drop(pass);
        self.sums.composite(passes, frame);
    }

    fn draw_gain(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        gain: wgpu::RenderPassColorAttachment<'_>,
    ) {
        self.sums.draw_gain(passes, frame, gain);
    }
}

/// Mean irradiance of a place amid things, over all normals.
fn mean_irradiance(room: &RoomTransport, things: &[Bounds]) -> Vec3 {
    let places = things.iter().map(|bounds| (bounds.low + bounds.high) / 2.0);
    let middle = places.sum::<DVec3>() / things.len().max(1) as f64;
    let sides = [
        Vec3::X,
        Vec3::Y,
        Vec3::Z,
        Vec3::NEG_X,
        Vec3::NEG_Y,
        Vec3::NEG_Z,
    ];
    let of_side = |normal| room.volume.irradiance(middle.as_vec3(), normal);
    sides.into_iter().map(of_side).sum::<Vec3>() / 6.0
}

/// The shader that takes light out of the video.
fn composite(difference: Difference) -> CompositeShader {
    let shader = "difference.wgsl";
    match difference {
        Difference::Ratio => BY_GAIN,
        Difference::Subtract => CompositeShader { shader, flag: None },
        Difference::Encoded => CompositeShader {
            shader,
            flag: Some("ENCODED"),
        },
    }
}
