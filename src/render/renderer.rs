//! The frame from top to bottom: recorded picture, surfaces, shadow volumes light by light, composite.

mod read_back;

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::PixelRect;
use crate::light::Material;
use crate::scene::{Object, Scene, ShadowSettings, Shortcut, Shortcuts, Technique};
use crate::shafts::room::Room;
use crate::shafts::room_transport::RoomTransport;

use super::accumulation::{Accumulation, Targets};
use super::anchor_geometry::Role;
use super::attachments::{depth_stencil, kept, loaded};
use super::background::{Background, PICTURE_FORMAT, extent};
use super::direct::Direct;
use super::fade::{self, Fade};
use super::governed::{Governed, Setting};
use super::gpu::{Gpu, RenderError};
use super::gpu_clock::{GpuClock, GpuTimes, Stretch};
use super::layers::LayerPasses;
use super::readback::Readback;
use super::shafts::Shafts;
use super::stage::Stage;
use super::touched::Touched;
use super::volumes::{Among, set_scissor};

/// What a frame shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shown {
    /// The video with the virtual things.
    Composite,
    /// The undistorted video alone.
    Bare,
}

/// Draws the frames of one scene through one camera.
pub struct Renderer {
    gpu: Arc<Gpu>,
    size_px: [u32; 2],
    intrinsics: Intrinsics,
    without: Shortcuts,
    stage: Stage,
    background: Background,
    geometry_layout: wgpu::PipelineLayout,
    /// Where nothing has to be added up or averaged.
    direct: Option<Direct>,
    /// Where it has.
    accumulation: Option<Accumulation>,
    /// Keeps to the scene's frame budget.
    governed: Option<Governed>,
    /// Where the light comes from a room, with the targets that it is added to.
    shafts: Option<(Shafts, Targets)>,
    picture: wgpu::Texture,
    picture_readback: Readback,
    clock: Option<GpuClock>,
    /// Made when something fades for the first time.
    fade: Option<Fade>,
    layer_passes: Option<LayerPasses>,
    /// What the frame that was drawn last showed.
    shown: Shown,
    /// What things and their shadows could reach in that frame; `None` where nothing was placed.
    touched: Option<Touched>,
    /// Where the picture is not that of the video.
    stale: PixelRect,
    made_for: Shape,
}

/// What of a scene a renderer cannot change.
#[derive(PartialEq)]
struct Shape {
    technique: Technique,
    shadows: ShadowSettings,
    lights: usize,
    ambient_radiance: DVec3,
    anchors: usize,
    /// Of each thing its name, its anchor, its mesh's triangles and whether it casts.
    things: Vec<(String, usize, usize, bool)>,
    materials: Vec<Material>,
}

impl Shape {
    fn of(scene: &Scene) -> Self {
        let things = || scene.phantoms.iter().chain(&scene.virtuals);
        let shape = |thing: &Object| {
            let triangles = thing.mesh.triangles.len();
            (thing.name.clone(), thing.anchor, triangles, thing.casts)
        };
        Self {
            technique: scene.chosen_technique().0,
            shadows: scene.shadows,
            lights: scene.lights.len(),
            ambient_radiance: scene.ambient_radiance,
            anchors: scene.anchors.len(),
            things: things().map(shape).collect(),
            materials: things().flat_map(|thing| thing.materials.clone()).collect(),
        }
    }
}

impl Renderer {
    /// Prepares all that does not change from frame to frame; the light of a room is worked out, which takes seconds.
    ///
    /// # Errors
    /// A picture larger than the adapter can hold, or a device that failed.
    pub fn new(gpu: Arc<Gpu>, scene: &Scene, intrinsics: Intrinsics) -> Result<Self, RenderError> {
        Self::with_transport(gpu, scene, intrinsics, |room| room.transport())
    }

    /// The same, where the light of a room comes from somebody who may know it already.
    ///
    /// # Errors
    /// A picture larger than the adapter can hold, or a device that failed.
    pub fn with_transport(
        gpu: Arc<Gpu>,
        scene: &Scene,
        intrinsics: Intrinsics,
        transport: impl FnOnce(&Room<'_>) -> RoomTransport,
    ) -> Result<Self, RenderError> {
        let device = &gpu.device;
        let size_px = intrinsics.size_px;
        let [width, height] = size_px;
        let limit = device.limits().max_texture_dimension_2d;
        if width.max(height) > limit {
            return Err(RenderError::TooLarge {
                width,
                height,
                limit,
            });
        }
        let stage = Stage::new(&gpu, scene, intrinsics);
        let background = Background::new(&gpu, &intrinsics);
        let [view, light] = &stage.layouts;
        let geometry_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("geometry"),
            bind_group_layouts: &[Some(view), Some(light)],
            immediate_size: 0,
        });
        let samples = scene.shadows.samples;
        let glossy = scene.virtuals.iter().any(|object| {
            let mut materials = object.materials.iter();
            materials.any(|material| material.roughness.is_some())
        });
        let is_shafts = scene.chosen_technique().0 == Technique::Shafts;
        let room = scene.probe.as_ref().filter(|_| is_shafts);
        let shafts = room.map(|probe| {
            let difference = scene.shadows.shafts.difference;
            let targets = Targets::new(&gpu, &background, samples, difference);
            (Shafts::new(&gpu, scene, probe, &stage, transport), targets)
        });
        let without = scene.shadows.without;
        let is_direct = samples == 1
            && scene.lights.len() == 1
            && shafts.is_none()
            && !without.has(Shortcut::Direct);
        Ok(Self {
            direct: is_direct.then(|| Direct::new(&gpu, &stage.layouts, &background, glossy)),
            accumulation: (!is_direct && shafts.is_none())
                .then(|| Accumulation::new(&gpu, &geometry_layout, &background, samples, glossy)),
            governed: Governed::new(scene),
            shafts,
            picture: device.create_texture(&wgpu::TextureDescriptor {
                label: Some("picture"),
                size: extent(size_px),
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format: PICTURE_FORMAT,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST
                    | wgpu::TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            }),
            picture_readback: Readback::new(device, size_px, 4),
            clock: gpu
                .timestamp_period_ns
                .map(|period_ns| GpuClock::new(device, period_ns)),
            fade: None,
            layer_passes: None,
            shown: Shown::Bare,
            touched: None,
            stale: PixelRect::whole(size_px),
            made_for: Shape::of(scene),
            size_px,
            intrinsics,
            without,
            stage,
            background,
            geometry_layout,
            gpu,
        })
    }

    /// Draws another state of its scene from now on, without delay: lights that shine otherwise, things that stand
    /// elsewhere, are shown or hidden. Light that surroundings throw back is not gathered anew. False where more has
    /// changed: that takes a new renderer.
    pub fn follow(&mut self, scene: &Scene) -> bool {
        let same_room = |(shafts, _): &mut (Shafts, Targets)| shafts.follow(scene);
        let follows =
            self.made_for == Shape::of(scene) && self.shafts.as_mut().is_none_or(same_room);
        if follows {
            self.stage.follow(&self.gpu, scene);
            self.stale = PixelRect::whole(self.size_px);
        }
        follows
    }

    /// Takes note of what the last frame took to draw, milliseconds: a scene with a frame budget is drawn with fewer
    /// sources, or coarser outlines, where that keeps to it.
    pub fn spent(&mut self, frame_ms: f64) {
        let Some(governed) = &mut self.governed else {
            return;
        };
        if governed.spent(frame_ms) {
            match governed.setting() {
                Setting::Sources(sources) => {
                    if let Some((shafts, _)) = &mut self.shafts {
                        shafts.set_sources(sources);
                    }
                }
                Setting::SilhouettesPx(error_px) => self.stage.set_detail(error_px),
            }
        }
    }

    /// What the scene's frame budget has led to; `None` without one.
    pub fn governed(&self) -> Option<&Governed> {
        self.governed.as_ref()
    }

    /// Puts other pixels (as [`Renderer::read_picture`] gives them) in the place of the picture, until the next one is
    /// drawn.
    pub fn replace_picture(&mut self, rgba: &[u8]) {
        self.gpu.queue.write_texture(
            self.picture.as_image_copy(),
            rgba,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * self.size_px[0]),
                rows_per_image: None,
            },
            self.picture.size(),
        );
        self.stale = PixelRect::whole(self.size_px);
    }

    /// Takes the recorded picture to the GPU.
    ///
    /// # Errors
    /// A frame of another size than the camera's calibration.
    pub fn upload(&mut self, frame: &Frame) -> Result<(), RenderError> {
        self.stale = PixelRect::whole(self.size_px);
        self.background.upload(&self.gpu, frame)
    }

    /// As [`draw`](Self::draw), where of what stands on each anchor only a part is to be seen, 0 to 1: things that come
    /// or go are drawn over a picture without them.
    pub fn draw_fading(
        &mut self,
        camera_from_anchor: &[Option<DAffine3>],
        visibility: &[f64],
        shown: Shown,
    ) {
        let seen_at_least = |least: f64| -> Vec<Option<DAffine3>> {
            let anchors = camera_from_anchor.iter().zip(visibility);
            anchors
                .map(|(pose, &visibility)| pose.filter(|_| visibility >= least))
                .collect()
        };
        let fading = fade::steps(visibility)
            .into_iter()
            .filter(|&part| part < 1.0);
        self.draw(&seen_at_least(1.0), shown);
        for part in fading {
            let fade = self
                .fade
                .take()
                .unwrap_or_else(|| Fade::new(&self.gpu.device, &self.picture));
            fade.keep(&self.gpu, &self.picture);
            self.draw(&seen_at_least(part), shown);
            fade.mix(&self.gpu, &self.picture, part);
            self.stale = PixelRect::whole(self.size_px);
            self.fade = Some(fade);
        }
    }

    /// Draws the uploaded picture with what stands on the anchors, whose poses come in the scene's order. Without
    /// the world's pose nobody knows where the light comes from, and the video is shown alone.
    pub fn draw(&mut self, camera_from_anchor: &[Option<DAffine3>], shown: Shown) {
        self.shown = shown;
        self.stage.place(&self.gpu, camera_from_anchor);
        self.touched = match &mut self.shafts {
            None => self.stage.touched(),
            Some(_) if shown == Shown::Bare => None,
            Some((shafts, _)) => {
                let pixels =
                    shafts.update(&self.gpu, &self.stage, camera_from_anchor, &self.intrinsics);
                pixels.map(Touched::pixels_alone)
            }
        };
        let touched = match shown {
            Shown::Bare => None,
            Shown::Composite => self.touched.as_ref(),
        };
        let touched = touched.filter(|touched| !touched.pixels.is_empty());
        if let (Some(touched), None) = (touched, &self.shafts) {
            self.stage.cast(&self.gpu, touched, touched.pixels);
        }
        if self.without.has(Shortcut::Kept) {
            self.stale = PixelRect::whole(self.size_px);
        }

        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        let mut drawn = Vec::new();
        if let Some((shafts, _)) = &mut self.shafts {
            shafts.draw_maps(&self.gpu, &mut encoder);
        }
        if self
            .background
            .draw(&mut encoder, &self.picture, self.stale, self.clock.as_ref())
        {
            drawn.push(Stretch::Background);
        }
        self.stale = PixelRect::NONE;
        if let Some(touched) = touched {
            self.stale = touched.pixels;
            drawn.push(Stretch::Light);
            if let Some(direct) = &self.direct {
                self.draw_direct(&mut encoder, direct, touched);
            } else if let Some((shafts, targets)) = &self.shafts {
                let (stage, pixels) = (&self.stage, touched.pixels);
                draw_shafts(
                    &mut encoder,
                    shafts,
                    targets,
                    stage,
                    pixels,
                    self.clock.as_ref(),
                );
                self.composite(&mut encoder, targets, pixels);
                drawn.push(Stretch::Composite);
            } else if let Some(accumulation) = &self.accumulation {
                self.accumulate(&mut encoder, accumulation, touched.pixels);
                self.composite(&mut encoder, &accumulation.targets, touched.pixels);
                drawn.push(Stretch::Composite);
            }
        }
        if let Some(clock) = &mut self.clock {
            clock.resolve(&mut encoder, &drawn);
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// Takes note of a frame that is not drawn, so that the next one is what it would be after it.
    pub fn pass_over(&mut self, camera_from_anchor: &[Option<DAffine3>]) {
        self.stage.choose_levels(camera_from_anchor);
    }

    /// The picture that is drawn: sRGB-encoded bytes, whatever the format says. It stays the same texture.
    pub fn picture(&self) -> &wgpu::Texture {
        &self.picture
    }

    /// Triangles of the things that were drawn last, in the levels of detail that were chosen for them.
    pub fn triangles(&self) -> usize {
        self.stage.triangles()
    }

    /// Waits until the picture is drawn, so that drawing and reading back can be timed apart.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn wait(&self) -> Result<(), RenderError> {
        self.gpu
            .device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| RenderError::Failed(error.to_string()))?;
        self.gpu.check()
    }

    /// Waits for the drawn picture: sRGB-encoded RGBA, rows from the top.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn read_picture(&self) -> Result<Vec<u8>, RenderError> {
        let mut encoder = self.gpu.device.create_command_encoder(&Default::default());
        self.picture_readback.copy_from(&mut encoder, &self.picture);
        self.gpu.queue.submit([encoder.finish()]);
        self.picture_readback.read(&self.gpu)
    }

    /// What the last picture cost; to be asked after it was read.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn gpu_times(&self) -> Result<GpuTimes, RenderError> {
        self.clock
            .as_ref()
            .map_or(Ok(GpuTimes::default()), |clock| clock.read(&self.gpu))
    }

    /// Haller et al. 2003, section 3.2, for one light and one sample: phantoms and lit virtual things into depth; *real
    /// onto real* is counted; *virtual onto real* is counted where the light arrives, and what is counted loses it;
    /// *all onto virtual* is what both have counted there, and leaves what was set aside.
    fn draw_direct(&self, encoder: &mut wgpu::CommandEncoder, direct: &Direct, touched: &Touched) {
        let stage = &self.stage;
        let picture = self.picture.create_view(&Default::default());
        let clock = |first, last| {
            let clock = self.clock.as_ref();
            clock.and_then(|clock| clock.pass(Stretch::Light, first, last))
        };
        let keep = wgpu::LoadOp::Load;
        let mut surfaces = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surfaces"),
            color_attachments: &[
                Some(loaded(&picture, keep)),
                Some(loaded(&direct.ambient, keep)),
            ],
            depth_stencil_attachment: Some(kept(&direct.depth_stencil)),
            timestamp_writes: clock(true, false),
            ..Default::default()
        });
        set_scissor(&mut surfaces, touched.pixels);
        surfaces.set_pipeline(&direct.nothing);
        surfaces.draw(0..3, 0..1);
        surfaces.set_bind_group(2, &self.background.group, &[]);
        stage.draw_surfaces(
            &mut surfaces,
            &direct.depth_of_real,
            Role::Real,
            0,
            touched.pixels,
        );
        let shading = [
            &direct.light_on_virtual,
            &direct.light_at_terminator,
            &direct.ambient_on_virtual,
        ];
        stage.draw_virtuals(&mut surfaces, shading, 0, touched.pixels);
        drop(surfaces);

        let mut shadows = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadows"),
            color_attachments: &[Some(loaded(&picture, keep))],
            depth_stencil_attachment: Some(kept(&direct.depth_stencil)),
            timestamp_writes: clock(false, true),
            ..Default::default()
        });
        let pass = &mut shadows;
        set_scissor(pass, touched.pixels);
        pass.set_bind_group(2, &self.background.group, &[]);
        let volumes = &direct.volumes;
        let by_real = stage.count_volumes(pass, volumes, Among::All, Role::Real, 0, touched.pixels);
        if by_real {
            volumes.keep(pass, Role::Real, touched.pixels);
        }
        let lit = Among::LitByReal;
        let by_virtual = stage.count_volumes(pass, volumes, lit, Role::Virtual, 0, touched.pixels);
        if by_virtual {
            stage.draw_surfaces(pass, &direct.hidden_on_real, Role::Real, 0, touched.pixels);
        }
        if (by_real || by_virtual) && !touched.virtuals.is_empty() {
            set_scissor(pass, touched.virtuals);
            pass.set_bind_group(3, &direct.ambient_group, &[]);
            for (own, pipeline) in (0..).zip(&direct.shadow_on_virtual) {
                pass.set_pipeline(pipeline);
                pass.set_stencil_reference(own);
                pass.draw(0..3, 0..1);
            }
        }
    }

    /// The same light by light and sample by sample: what arrives in the video is added up on real surfaces, and what
    /// virtual things take of it; on virtual ones what arrives past all casters.
    fn accumulate(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        accumulation: &Accumulation,
        touched: PixelRect,
    ) {
        let stage = &self.stage;
        let (surfaces, volumes) = (&accumulation.surfaces, &accumulation.volumes);
        let passes = stage.light_count().max(1);
        for light in 0..passes {
            let (first, last) = (light == 0, light + 1 == passes);
            let load = match first {
                true => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
                false => wgpu::LoadOp::Load,
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("light"),
                color_attachments: &[
                    Some(loaded(&accumulation.targets.reaching, load)),
                    Some(loaded(&accumulation.targets.change, load)),
                ],
                depth_stencil_attachment: Some(depth_stencil(
                    &accumulation.targets.depth_stencil,
                    first,
                    last,
                )),
                timestamp_writes: self
                    .clock
                    .as_ref()
                    .and_then(|clock| clock.pass(Stretch::Light, first, last)),
                ..Default::default()
            });
            set_scissor(&mut pass, touched);
            if first {
                stage.draw_surfaces(
                    &mut pass,
                    &surfaces.ambient_on_real,
                    Role::Real,
                    light,
                    touched,
                );
                stage.draw_surfaces(
                    &mut pass,
                    &surfaces.ambient_on_virtual,
                    Role::Virtual,
                    light,
                    touched,
                );
            }
            if stage.light_count() == 0 {
                continue;
            }
            if stage.count_volumes(&mut pass, volumes, Among::All, Role::Real, light, touched) {
                volumes.keep(&mut pass, Role::Real, touched);
            }
            stage.draw_surfaces(
                &mut pass,
                &surfaces.light_reaching_real,
                Role::Real,
                light,
                touched,
            );
            let lit = Among::LitByReal;
            if stage.count_volumes(&mut pass, volumes, lit, Role::Virtual, light, touched) {
                stage.draw_surfaces(
                    &mut pass,
                    &surfaces.light_hidden_from_real,
                    Role::Real,
                    light,
                    touched,
                );
            }
            stage.draw_virtuals_facing(&mut pass, &surfaces.light_on_virtual, light, touched);
        }
    }

    /// Video and virtual light together, where virtual things reach.
    fn composite(&self, encoder: &mut wgpu::CommandEncoder, targets: &Targets, touched: PixelRect) {
        let picture = self.picture.create_view(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("composite"),
            color_attachments: &[Some(loaded(&picture, wgpu::LoadOp::Load))],
            timestamp_writes: self
                .clock
                .as_ref()
                .and_then(|clock| clock.pass(Stretch::Composite, true, true)),
            ..Default::default()
        });
        set_scissor(&mut pass, touched);
        pass.set_pipeline(&targets.composite.composite);
        pass.set_bind_group(0, &targets.composite.group, &[]);
        pass.set_bind_group(2, &self.background.group, &[]);
        pass.draw(0..3, 0..1);
    }
}

/// Gibson et al. 2003, section 7, in as few passes over the pixels as there are: one.
fn draw_shafts(
    encoder: &mut wgpu::CommandEncoder,
    shafts: &Shafts,
    targets: &Targets,
    stage: &Stage,
    pixels: PixelRect,
    clock: Option<&GpuClock>,
) {
    let clear = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
    let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("shafts"),
        color_attachments: &[
            Some(loaded(&targets.reaching, clear)),
            Some(loaded(&targets.change, clear)),
        ],
        depth_stencil_attachment: Some(depth_stencil(&targets.depth_stencil, true, true)),
        timestamp_writes: clock.and_then(|clock| clock.pass(Stretch::Light, true, true)),
        ..Default::default()
    });
    set_scissor(&mut pass, pixels);
    shafts.draw(&mut pass, stage, pixels);
}
