//! Soft shadows by shafts: what virtual things hide of a room's light, what they reflect, and the light on them.
//! Reads the room's transport, and poses. Writes the sources' maps, light sums, and then the picture.
//!
//! What depends on where things are in the world is worked out when they move, not when the camera does.

pub(super) mod data;
mod environment;
mod maps;
mod pipelines;

use bytemuck::Zeroable;
use glam::{DAffine3, Vec3};
use wgpu::util::DeviceExt as _;

use crate::geometry::bounds::Bounds;
use crate::geometry::reach::{self, PixelRect};
use crate::scene::{Difference, ProbeScene, Scene, ShaftSettings};
use crate::shafts::bounding::Aabb;
use crate::shafts::casters::{PlacedCasters, ShaftCasters};
use crate::shafts::hidden_light::{HiddenLight, ShadowOptions};
use crate::shafts::room::Room;
use crate::shafts::room_transport::RoomTransport;
use crate::shafts::shadow_atlas::Tiling;
use crate::shafts::surfels::{GroupedSurfels, interreflected_irradiance};

use super::anchor_geometry::Role;
use super::attachments::{cleared, depth_stencil};
use super::background::Background;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::light_sums::{BY_GAIN, CompositeShader, LightSums};
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::surfaces::SurfaceKinds;
use super::technique::{FrameContext, TechniquePasses};
use super::volumes::set_scissor;
use data::ShaftFrame;
use environment::Environment;
use maps::Maps;
use pipelines::{Pipelines, SHAFT_GROUP};

/// The technique that shades a room's light by shafts.
pub(super) struct Shafts {
    room: RoomTransport,
    /// Of the room that `room` is the transport of.
    surfaces_key: u64,
    settings: ShaftSettings,
    casters: ShaftCasters,
    pipelines: Pipelines,
    sums: LightSums,
    maps: Maps,
    /// Places of all patches' corners, three each.
    places: wgpu::Buffer,
    place_count: u32,
    frame: wgpu::Buffer,
    sampler: wgpu::Sampler,
    environment: Environment,
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
    /// `transport` gives the light of the scene's room.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        probe: &ProbeScene,
        background: &Background,
        kinds: SurfaceKinds,
        transport: impl FnOnce(&Room<'_>) -> RoomTransport,
    ) -> Self {
        let parts = scene.room(probe);
        let surfaces_key = parts.surfaces_key();
        let room = transport(&parts);
        let device = &gpu.device;
        let patches = room.patches.patches.iter();
        let places: Vec<Vec3> = patches
            .flat_map(|patch| room.patches.corners(patch))
            .collect();
        let settings = scene.shadows.shafts;
        let samples = scene.shadows.samples;
        let tiling = Tiling::new(1, settings.map_px, device.limits().max_texture_dimension_2d);
        let environment = kinds
            .glossy
            .then_some((&probe.probe, probe.exposure as f32));
        Self {
            pipelines: Pipelines::new(gpu, samples, kinds),
            sums: LightSums::new(gpu, background, samples, composite(settings.difference)),
            maps: Maps::new(gpu, tiling),
            casters: ShaftCasters::new(&scene.occluders()),
            places: buffer(
                gpu,
                "patches",
                bytemuck::cast_slice(&places),
                wgpu::BufferUsages::VERTEX,
            ),
            place_count: places.len() as u32,
            frame: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("shafts"),
                size: size_of::<ShaftFrame>() as u64,
                usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            sampler: device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("shaft maps"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                ..Default::default()
            }),
            environment: Environment::new(device, &gpu.queue, environment),
            world_from_anchor: Vec::new(),
            hidden: None,
            settings,
            surfaces_key,
            room,
        }
    }

    /// Works out what is hidden where things are now. Returns the pixels that it can change, `None` if none.
    fn update(&mut self, gpu: &Gpu, gpu_scene: &GpuScene) -> Option<PixelRect> {
        let camera_from_anchor = gpu_scene.camera_from_anchor();
        let camera_from_world = (*camera_from_anchor.first()?)?;
        let world_from_camera = camera_from_world.inverse();
        let mut world_from_anchor: Vec<Option<DAffine3>> = camera_from_anchor
            .iter()
            .map(|pose| pose.map(|camera_from_anchor| world_from_camera * camera_from_anchor))
            .collect();
        world_from_anchor[0] = Some(DAffine3::IDENTITY);
        if self.world_from_anchor != world_from_anchor {
            self.hidden = self
                .casters
                .place(&world_from_anchor)
                .map(|placed| self.hide(gpu, &placed));
            let volume = &self.room.volume;
            gpu_scene.set_indirect(&gpu.queue, &world_from_anchor, |place, normal| {
                let surfels = self.hidden.iter().flat_map(|hidden| hidden.surfels.all());
                volume.radiance(place).irradiance(normal)
                    + interreflected_irradiance(place, normal, surfels)
            });
            self.world_from_anchor = world_from_anchor;
        }
        let hidden = self.hidden.as_ref()?;
        let frame = ShaftFrame {
            world_from_camera: glam::DMat4::from(world_from_camera).as_mat4(),
            source_count: hidden.source_count,
            ..Zeroable::zeroed()
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
            difference: self.settings.difference,
        };
        let hidden = HiddenLight::new(&self.room, placed, &options);
        self.maps.resize(&gpu.device, hidden.tiling);
        let storage = |label, contents| buffer(gpu, label, contents, wgpu::BufferUsages::STORAGE);
        let vertices = |label, contents| buffer(gpu, label, contents, wgpu::BufferUsages::VERTEX);
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
    fn draw_maps(&mut self, gpu: &Gpu, passes: &mut Passes<'_>) {
        let Some(hidden) = self.hidden.as_mut().filter(|hidden| !hidden.is_drawn) else {
            return;
        };
        self.maps.draw(
            gpu,
            passes,
            &hidden.sources,
            hidden.source_count,
            (&hidden.casters, hidden.caster_vertices),
        );
        hidden.is_drawn = true;
    }

    /// Draws what is real into depth, what is virtual over it, and the light on both.
    fn draw_light(&self, pass: &mut wgpu::RenderPass<'_>, gpu_scene: &GpuScene, within: PixelRect) {
        let Some(hidden) = &self.hidden else {
            return;
        };
        pass.set_bind_group(2, &hidden.group, &[]);
        gpu_scene.set_world(pass);
        pass.set_pipeline(&self.pipelines.depth_of_room);
        pass.set_vertex_buffer(0, self.places.slice(..));
        pass.draw(0..self.place_count, 0..1);
        gpu_scene.draw_moving_real(pass, &self.pipelines.depth_of_real, within);
        gpu_scene.draw_surfaces(
            pass,
            &self.pipelines.light_on_virtual,
            Role::Virtual,
            DrawnLight::Whole(0),
            within,
        );
        gpu_scene.set_world(pass);
        pass.set_pipeline(&self.pipelines.light_on_patch);
        pass.set_vertex_buffer(0, hidden.corners.slice(..));
        pass.draw(0..hidden.corner_count, 0..1);
        pass.set_pipeline(&self.pipelines.reflected_on_patch);
        pass.set_vertex_buffer(0, hidden.reflected.slice(..));
        pass.draw(0..hidden.reflected_count, 0..1);
    }
}

impl TechniquePasses for Shafts {
    /// Takes the places of virtual things. False where the room is another one.
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

    fn set_sources(&mut self, sources: Option<u32>) {
        self.settings.sources = sources;
        self.world_from_anchor.clear();
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        match shown {
            Shown::Bare => None,
            Shown::Composite => self.update(gpu, gpu_scene).map(ScreenBounds::pixels_alone),
        }
    }

    /// Gibson et al. 2003, section 7, in as few passes over the pixels as there are: one.
    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.draw_maps(frame.gpu, passes);
        let mut pass = passes.begin(
            "shafts",
            Some(GpuSpan::Light.whole()),
            &[cleared(&self.sums.reaching), cleared(&self.sums.change)],
            Some(depth_stencil(&self.sums.depth_stencil, true, true)),
        );
        set_scissor(&mut pass, frame.bounds.pixels);
        self.draw_light(&mut pass, frame.gpu_scene, frame.bounds.pixels);
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

/// A buffer of a content that may be empty, which no binding can be.
fn buffer(gpu: &Gpu, label: &str, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
    let contents = match contents.is_empty() {
        true => &[0; 256],
        false => contents,
    };
    gpu.device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents,
            usage,
        })
}
