//! Soft shadows by shafts: what virtual things hide of a room's light, what they throw back, and the light on them.
//! Reads the room as it was worked out, and poses. Writes `reaching` and `change` (see shafts.wgsl).
//!
//! What depends on where things are in the world is worked out when they move, not when the camera does.

mod casters;
mod corners;
pub(super) mod data;
mod difference;
mod environment;
pub mod kept_rooms;
mod maps;
mod pipelines;
pub mod room;

use bytemuck::Zeroable;
use glam::{DAffine3, Vec3, Vec4};
use rayon::prelude::*;
use wgpu::util::DeviceExt as _;

use crate::geometry::bounds::Bounds;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::{self, PixelRect};
use crate::scene::{ProbeScene, Scene, ShaftSettings};
use crate::shafts::patches::PatchVertex;
use crate::shafts::prepared::Prepared;
use crate::shafts::selection::{Representative, representatives};
use crate::shafts::source_tree::BoxM;
use crate::shafts::surfels::{GroupedSurfels, thrown_back, thrown_on_caster};

use super::anchor_geometry::Role;
use super::gpu::Gpu;
use super::stage::Stage;
use casters::{PlacedCasters, ShaftCasters};
use corners::{Notice, Noticing};
use data::{Frame, Source, packed};
use difference::Given;
use environment::Environment;
use maps::{Maps, Tiling, source};
use pipelines::Pipelines;
use room::Room;

/// Nodes of sources that give receivers less than this part of their light on the average are not cut: less than a level
/// of 255.
const LEAST_WEIGHT: f32 = 1.0 / 2048.0;
/// Penumbras are given room in the maps up to this many radii behind the casters.
const REACH: f32 = 4.0;

/// Sources that light the surfels.
const SOURCES_OF_BOUNCE: usize = 96;
/// Sources nearer to the casters' middle than so many of their radii are among them.
const NEAREST_SOURCE: f32 = 3.0;

/// What shafts need from frame to frame.
pub(super) struct Shafts {
    room: Prepared,
    /// Of the room that `room` was worked out from.
    surfaces_key: u64,
    settings: ShaftSettings,
    casters: ShaftCasters,
    pipelines: Pipelines,
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

/// What the casters hide where they are.
struct Hidden {
    sources: wgpu::Buffer,
    source_count: u32,
    casters: wgpu::Buffer,
    caster_vertices: u32,
    /// Corners of the patches that sources light, and of the parts that something is thrown on.
    corners: wgpu::Buffer,
    corner_count: u32,
    thrown: wgpu::Buffer,
    thrown_count: u32,
    group: wgpu::BindGroup,
    /// Around the virtual things, and around all that notices, if anything does.
    seen: Vec<BoxM>,
    noticing: Option<BoxM>,
    /// What the casters throw back.
    surfels: GroupedSurfels,
    /// Whether the maps show it.
    is_drawn: bool,
}

impl Shafts {
    /// Works the light of the scene's room out, or takes it from where it was kept.
    pub fn new(gpu: &Gpu, scene: &Scene, probe: &ProbeScene, stage: &Stage) -> Self {
        let parts = Room::of(scene, probe);
        let surfaces_key = parts.surfaces_key();
        let room = kept_rooms::ready(&parts, kept_rooms::folder().as_deref()).prepared;
        let device = &gpu.device;
        let buffer = |label, contents: &[u8], usage| {
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        let places: Vec<Vec3> = room
            .patches
            .patches
            .iter()
            .flat_map(|patch| room.patches.corners(patch))
            .collect();
        let settings = scene.shadows.shafts;
        let tiling = Tiling::new(1, settings.map_px, device.limits().max_texture_dimension_2d);
        let glossy = scene.virtuals.iter().any(|object| {
            let mut materials = object.materials.iter();
            materials.any(|material| material.roughness.is_some())
        });
        Self {
            pipelines: Pipelines::new(gpu, &stage.layouts, scene.shadows.samples, glossy),
            maps: Maps::new(device, tiling),
            casters: ShaftCasters::new(scene),
            places: buffer(
                "patches",
                bytemuck::cast_slice(&places),
                wgpu::BufferUsages::VERTEX,
            ),
            place_count: places.len() as u32,
            frame: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("shafts"),
                size: size_of::<Frame>() as u64,
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
            environment: Environment::new(
                device,
                &gpu.queue,
                glossy.then_some((&probe.probe, probe.exposure as f32)),
            ),
            world_from_anchor: Vec::new(),
            hidden: None,
            settings,
            surfaces_key,
            room,
        }
    }

    /// Takes the places of virtual things from another state of its scene. False where the room is another one.
    pub fn follow(&mut self, scene: &Scene) -> bool {
        let Some(probe) = &scene.probe else {
            return false;
        };
        let parts = Room::of(scene, probe);
        if parts.surfaces_key() != self.surfaces_key {
            return false;
        }
        let corners = |bounds: Bounds| [bounds.low, bounds.high].map(|corner| corner.as_vec3());
        let is_held = |bounds| self.room.volume.holds(&BoxM::around(corners(bounds)));
        if !room::virtual_bounds(scene).all(is_held) {
            self.room.gather_volume(&parts.things);
        }
        self.casters.follow(scene);
        self.world_from_anchor.clear();
        true
    }

    /// So many sources at most get a shadow from now on; `None`: all.
    pub fn set_sources(&mut self, sources: Option<u32>) {
        self.settings.sources = sources;
        self.world_from_anchor.clear();
    }

    /// Works out what is hidden where things are now. Returns the pixels that it can change, `None` if none.
    pub fn update(
        &mut self,
        gpu: &Gpu,
        stage: &Stage,
        camera_from_anchor: &[Option<DAffine3>],
        intrinsics: &Intrinsics,
    ) -> Option<PixelRect> {
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
            stage.set_indirect(&gpu.queue, &world_from_anchor, |place, normal| {
                let surfels = self.hidden.iter().flat_map(|hidden| hidden.surfels.all());
                volume.radiance(place).irradiance(normal) + thrown_on_caster(place, normal, surfels)
            });
            self.world_from_anchor = world_from_anchor;
        }
        let hidden = self.hidden.as_ref()?;
        let frame = Frame {
            world_from_camera: glam::DMat4::from(world_from_camera).as_mat4(),
            source_count: hidden.source_count,
            ..Zeroable::zeroed()
        };
        gpu.queue
            .write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let covered = |bounds: &BoxM| {
            let corners = [0, 1, 2, 3, 4, 5, 6, 7].map(|index: usize| {
                let pick = |axis: usize| match index >> axis & 1 {
                    0 => bounds.min[axis],
                    _ => bounds.max[axis],
                };
                Vec3::new(pick(0), pick(1), pick(2)).as_dvec3()
            });
            reach::covered(&corners, &camera_from_world, intrinsics)
        };
        let all = hidden.seen.iter().chain(&hidden.noticing);
        let pixels = all.map(covered).fold(PixelRect::NONE, PixelRect::union);
        (!pixels.is_empty()).then_some(pixels)
    }

    /// Gibson et al. 2003, sections 6.1 and 8: sources that may be hidden, receivers that may notice, n representatives and
    /// what each gives to each receiver.
    fn hide(&mut self, gpu: &Gpu, placed: &PlacedCasters) -> Hidden {
        let room = &self.room;
        let marks = room.mark(&placed.boxes);
        let mut may_be_hidden = marks.sources(&room.sources);
        // Sources among the casters have no shadow map that could show them.
        let among = room.sources_within(placed.ball.center, NEAREST_SOURCE * placed.ball.radius);
        for &source in &among {
            may_be_hidden[source] = false;
        }
        let may_notice = marks.receivers(&room.receivers);
        let noticing: Vec<usize> = (0..may_notice.len())
            .filter(|&patch| may_notice[patch])
            .collect();
        let mut vertices: Vec<u32> = noticing
            .iter()
            .flat_map(|&patch| room.patches.patches[patch].vertices)
            .collect();
        vertices.sort_unstable();
        vertices.dedup();
        // Shadows fall off with the square of the distance, and so does what a source counts for.
        let shares: Vec<(u32, f32)> = vertices
            .iter()
            .map(|&vertex| {
                let place = room.patches.vertices[vertex as usize].position;
                let squared = place.distance_squared(placed.ball.center);
                (vertex, (squared + placed.ball.radius.powi(2)).recip())
            })
            .collect();
        let weighed = room.weighed(&may_be_hidden, &shares);
        let count = self
            .settings
            .sources
            .map_or(usize::MAX, |count| count as usize);
        let mut chosen = representatives(
            &room.sources,
            &weighed,
            count,
            LEAST_WEIGHT,
            placed.ball.center,
        );
        let limit = gpu.device.limits().max_texture_dimension_2d;
        let tiling = Tiling::new(chosen.len(), self.settings.map_px, limit);
        let reach_m = REACH * placed.ball.radius;
        let mut sources: Vec<Source> = Vec::new();
        chosen.retain(|one| {
            let center = placed.ball.center;
            let intensity = room.intensity(one, &may_be_hidden, center)
                * room.let_through(one, &may_be_hidden, center);
            let index = sources.len() as u32;
            let source = source(one, &placed.ball, reach_m, intensity, &tiling, index);
            sources.extend(source);
            source.is_some()
        });
        self.maps.resize(&gpu.device, tiling);

        let vertex_light = vertices
            .iter()
            .map(|&vertex| room.irradiance[vertex as usize]);
        let given = Given {
            light: vertex_light.collect(),
            by_source: given(room, &vertices, &chosen, &may_be_hidden),
            source_count: chosen.len(),
        }
        .in_terms_of(self.settings.difference, room, &vertices);
        let transfers: Vec<[u32; 2]> = given.by_source.into_iter().map(packed).collect();
        let detailed: Vec<(Representative, Vec3)> = representatives(
            &room.sources,
            &weighed,
            SOURCES_OF_BOUNCE,
            LEAST_WEIGHT,
            placed.ball.center,
        )
        .into_iter()
        .map(|one| {
            let center = placed.ball.center;
            let sent = room.intensity(&one, &may_be_hidden, center);
            (one, sent * room.let_through(&one, &may_be_hidden, center))
        })
        .collect();
        let among_m = NEAREST_SOURCE * placed.ball.radius;
        let left = room.left_by(&placed.caster, placed.ball.center, among_m);
        let surfels = placed.lit_surfels(room, &detailed, &left);
        let light = given.light.into_iter();
        let irradiances: Vec<Vec4> = light.map(|light| light.extend(0.0)).collect();
        let refilled: Vec<Option<f32>> = left
            .iter()
            .zip(&room.patches.patches)
            .map(|(left, patch)| {
                let (place, normal) = (room.patches.center(patch), room.patches.normal(patch));
                let before = room.irradiance[patch.vertices[0] as usize].element_sum();
                let seen = || surfels.seen_from(BoxM::around([place]));
                let back = || thrown_back(place, normal, seen()).element_sum();
                left.map(|left| (left + back() / before.max(f32::MIN_POSITIVE)).min(1.0))
            })
            .collect();
        let lost_nearby = lost_nearby(room, &vertices, &surfels, &refilled);
        let Noticing {
            corners,
            thrown,
            lists,
        } = Notice {
            room,
            casters: placed,
            vertices: &vertices,
            sources: &sources,
            transfers: &transfers,
            surfels: &surfels,
            lost_nearby: &lost_nearby,
            difference: self.settings.difference,
        }
        .noticing(&noticing);

        let device = &gpu.device;
        // A binding cannot be empty.
        let buffer = |label, contents: &[u8], usage| {
            let contents = if contents.is_empty() {
                &[0; 256]
            } else {
                contents
            };
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents,
                usage,
            })
        };
        let storage = wgpu::BufferUsages::STORAGE;
        let source_buffer = buffer("sources", bytemuck::cast_slice(&sources), storage);
        let list_buffer = buffer("shadowed by", bytemuck::cast_slice(&lists), storage);
        let irradiances = buffer("irradiances", bytemuck::cast_slice(&irradiances), storage);
        let transfers = buffer("transfers", bytemuck::cast_slice(&transfers), storage);
        let bound = |binding, buffer: &'_ wgpu::Buffer| (binding, buffer.clone());
        let buffers = [
            bound(0, &self.frame),
            bound(1, &source_buffer),
            bound(2, &irradiances),
            bound(3, &transfers),
            bound(4, &list_buffer),
        ];
        let mut entries: Vec<wgpu::BindGroupEntry> = buffers
            .iter()
            .map(|(binding, buffer)| wgpu::BindGroupEntry {
                binding: *binding,
                resource: buffer.as_entire_binding(),
            })
            .collect();
        entries.push(wgpu::BindGroupEntry {
            binding: 5,
            resource: wgpu::BindingResource::TextureView(&self.maps.view),
        });
        entries.push(wgpu::BindGroupEntry {
            binding: 6,
            resource: wgpu::BindingResource::Sampler(&self.sampler),
        });
        entries.extend([
            wgpu::BindGroupEntry {
                binding: 7,
                resource: wgpu::BindingResource::TextureView(&self.environment.view),
            },
            wgpu::BindGroupEntry {
                binding: 8,
                resource: wgpu::BindingResource::Sampler(&self.environment.sampler),
            },
        ]);
        Hidden {
            group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("shafts"),
                layout: &self.pipelines.layout,
                entries: &entries,
            }),
            source_count: sources.len() as u32,
            casters: buffer(
                "shaft casters",
                bytemuck::cast_slice(&placed.triangles),
                wgpu::BufferUsages::VERTEX,
            ),
            caster_vertices: 3 * placed.triangles.len() as u32,
            corners: buffer(
                "noticing patches",
                bytemuck::cast_slice(&corners),
                wgpu::BufferUsages::VERTEX,
            ),
            corner_count: corners.len() as u32,
            thrown: buffer(
                "thrown back",
                bytemuck::cast_slice(&thrown),
                wgpu::BufferUsages::VERTEX,
            ),
            thrown_count: thrown.len() as u32,
            noticing: (!corners.is_empty() || !thrown.is_empty()).then(|| {
                let lit = corners.iter().map(|corner| corner.position);
                BoxM::around(lit.chain(thrown.iter().map(|corner| corner.position)))
            }),
            seen: placed.seen.clone(),
            surfels,
            sources: source_buffer,
            is_drawn: false,
        }
    }

    /// Draws the sources' maps where they are not drawn yet.
    pub fn draw_maps(&mut self, gpu: &Gpu, encoder: &mut wgpu::CommandEncoder) {
        let Some(hidden) = self.hidden.as_mut().filter(|hidden| !hidden.is_drawn) else {
            return;
        };
        self.maps.draw(
            &gpu.device,
            encoder,
            &hidden.sources,
            hidden.source_count,
            (&hidden.casters, hidden.caster_vertices),
        );
        hidden.is_drawn = true;
    }

    /// Draws what is real into depth, what is virtual over it, and the light on both.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, stage: &Stage, within: PixelRect) {
        let Some(hidden) = &self.hidden else {
            return;
        };
        pass.set_bind_group(2, &hidden.group, &[]);
        stage.set_world(pass);
        pass.set_pipeline(&self.pipelines.depth_of_room);
        pass.set_vertex_buffer(0, self.places.slice(..));
        pass.draw(0..self.place_count, 0..1);
        stage.draw_moving_real(pass, &self.pipelines.depth_of_real, within);
        stage.draw_surfaces(
            pass,
            &self.pipelines.light_on_virtual,
            Role::Virtual,
            0,
            within,
        );
        stage.set_world(pass);
        pass.set_pipeline(&self.pipelines.light_on_patch);
        pass.set_vertex_buffer(0, hidden.corners.slice(..));
        pass.draw(0..hidden.corner_count, 0..1);
        pass.set_pipeline(&self.pipelines.thrown_back);
        pass.set_vertex_buffer(0, hidden.thrown.slice(..));
        pass.draw(0..hidden.thrown_count, 0..1);
    }
}

/// For each vertex the irradiance that it loses from patches among the casters: what the casters' surfels cover, and what
/// their shadows took from patches around them.
fn lost_nearby(
    room: &Prepared,
    vertices: &[u32],
    surfels: &GroupedSurfels,
    left: &[Option<f32>],
) -> Vec<Vec3> {
    let hidden = |&vertex: &u32| {
        let PatchVertex { position, normal } = room.patches.vertices[vertex as usize];
        let seen = surfels.seen_from(BoxM::around([position]));
        room.hidden_among(position, normal, seen, left) + room.lost_at(vertex, left)
    };
    vertices.par_iter().map(hidden).collect()
}

/// For each vertex and each representative the irradiance that hidden sources would take.
fn given(
    room: &Prepared,
    vertices: &[u32],
    chosen: &[Representative],
    may_be_hidden: &[bool],
) -> Vec<Vec3> {
    let radiance: Vec<Vec3> = room
        .source_radiance
        .iter()
        .zip(may_be_hidden)
        .map(|(&radiance, &hidden)| match hidden {
            true => radiance * std::f32::consts::PI,
            false => Vec3::ZERO,
        })
        .collect();
    let given = vertices.par_iter().flat_map_iter(|&vertex| {
        let row = room.transfers.row(vertex as usize);
        chosen.iter().map(|one| {
            let sources = one.first as usize..one.last as usize;
            let arriving = row[sources.clone()].iter().zip(&radiance[sources]);
            arriving
                .map(|(&part, &radiance)| radiance * part)
                .sum::<Vec3>()
        })
    });
    given.collect()
}
