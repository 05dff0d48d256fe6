//! The frame from top to bottom: recorded picture, surfaces, shadow volumes light by light, composite.

mod chosen_technique;
mod layering;
mod read_back;

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::PixelRect;
use crate::light::Material;
use crate::light::texture::Texture;
use crate::scene::{
    Bounces, Object, Scene, SceneLight, ShadowSettings, ShadowTechnique, Shortcut, Shortcuts,
};

use super::attachments::texture;
use super::background::{Background, PICTURE_FORMAT};
use super::deforming::{DeformingThing, deforming};
use super::error::RenderError;
use super::fade::{self, Fade};
use super::gpu::Gpu;
use super::gpu_clock::{GpuClock, GpuTimes};
use super::gpu_scene::GpuScene;
use super::layered_scene::{LayeredScene, TranslucentLayer};
use super::layers::LayerPasses;
use super::light_kind::LightKind;
use super::passes::{Passes, RecordedPasses};
use super::precomputation::{Afresh, Precomputation};
use super::quality_controller::{QualityController, Setting};
use super::readback::Readback;
use super::reflections::Reflections;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::technique::{FrameContext, TechniquePasses};
use super::translucent::Translucent;
use chosen_technique::ChosenTechnique;

/// Draws the frames of one scene through one camera.
pub struct Renderer {
    gpu: Arc<Gpu>,
    size_px: [u32; 2],
    without: Shortcuts,
    gpu_scene: GpuScene,
    background: Background,
    technique: ChosenTechnique,
    /// Where anything shows what it mirrors.
    reflections: Option<Reflections>,
    /// Keeps to the scene's frame budget, if it has one.
    quality_controller: Option<QualityController>,
    picture: wgpu::Texture,
    picture_readback: Readback,
    clock: Option<GpuClock>,
    /// Made when something fades for the first time.
    fade: Option<Fade>,
    layer_passes: Option<LayerPasses>,
    /// What lets light through.
    layers: Vec<TranslucentLayer>,
    /// Made when any of it is drawn for the first time.
    translucent: Option<Translucent>,
    /// Where all else stood in the last frame, if any of it was in it.
    opaque_nodes: Option<Vec<Option<DAffine3>>>,
    /// What the frame that was drawn last showed.
    shown: Shown,
    /// What things and their shadows could reach in that frame; `None` where nothing was placed.
    bounds: Option<ScreenBounds>,
    /// The names of that frame's passes.
    pass_names: Vec<&'static str>,
    /// Where the picture is not that of the video.
    stale: PixelRect,
    /// What changes its shape, and the time for which it has the shape that it has.
    deforming: Vec<DeformingThing>,
    time_s: f64,
    made_for: Shape,
}

/// The part of a scene that a renderer cannot change.
#[derive(PartialEq)]
struct Shape {
    technique: ShadowTechnique,
    shadows: ShadowSettings,
    /// Of each light what it stands on, whether it has a size and what it is.
    lights: Vec<(usize, bool, LightKind)>,
    ambient_radiance: DVec3,
    bounces: Bounces,
    nodes: usize,
    /// Of each thing its name, its anchor, its mesh's triangles and whether it casts.
    things: Vec<(String, usize, usize, bool)>,
    /// Of each thing which animation plays, how fast and whether again and again.
    animations: Vec<Option<(usize, f64, bool)>>,
    materials: Vec<Material>,
    textures: Vec<Arc<Texture>>,
}

impl Shape {
    /// `lights` are those that cast shadow volumes.
    fn of(scene: &Scene, lights: &[SceneLight]) -> Self {
        let things = || scene.phantoms.iter().chain(&scene.virtuals);
        let kind = |SceneLight { anchor, light }: &SceneLight| {
            (*anchor, light.has_size(), LightKind::of(light))
        };
        let shape = |thing: &Object| {
            let triangles = thing.mesh.triangles.len();
            (thing.name.clone(), thing.anchor, triangles, thing.casts)
        };
        Self {
            technique: scene.chosen_technique().0,
            shadows: scene.shadows,
            lights: lights.iter().map(kind).collect(),
            ambient_radiance: scene.ambient_radiance,
            bounces: scene.bounces,
            nodes: scene.node_count(),
            things: things().map(shape).collect(),
            animations: things()
                .map(|thing| {
                    let animation = thing.animation.as_ref()?;
                    Some((animation.number, animation.speed, animation.loops))
                })
                .collect(),
            materials: things().flat_map(|thing| thing.materials.clone()).collect(),
            textures: things().flat_map(|thing| thing.textures.clone()).collect(),
        }
    }
}

impl Renderer {
    /// Prepares all that does not change from frame to frame; the light of a room, and what things hide of an environment from
    /// themselves, are worked out, which takes seconds.
    ///
    /// # Errors
    /// A picture larger than the adapter can hold, or a device that failed.
    pub fn new(gpu: Arc<Gpu>, scene: &Scene, intrinsics: Intrinsics) -> Result<Self, RenderError> {
        Self::with_precomputation(gpu, scene, intrinsics, &Afresh)
    }

    /// The same, where what takes long comes from somebody who may know it already.
    ///
    /// # Errors
    /// A picture larger than the adapter can hold, or a device that failed.
    pub fn with_precomputation(
        gpu: Arc<Gpu>,
        scene: &Scene,
        intrinsics: Intrinsics,
        precomputation: &dyn Precomputation,
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
        let background = Background::new(&gpu, &intrinsics);
        let shaped = scene.shaped_at(0.0);
        let LayeredScene { scene, layers } = LayeredScene::new(&shaped);
        let scene = scene.as_ref();
        let known = ChosenTechnique::known_levels(scene, precomputation);
        // What nobody waits for any more shows nothing.
        let nothing = (!precomputation.goes_on()).then(|| scene.without_things());
        let scene = nothing.as_ref().unwrap_or(scene);
        let (technique, gpu_scene) =
            ChosenTechnique::new(&gpu, scene, intrinsics, &background, known, precomputation);
        let made_for = Shape::of(scene, &scene.outlined_lights());
        Ok(Self {
            technique,
            reflections: Reflections::new(&gpu, scene, &gpu_scene),
            quality_controller: QualityController::new(scene, made_for.technique),
            picture: texture(
                device,
                "picture",
                size_px,
                PICTURE_FORMAT,
                1,
                wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::COPY_SRC
                    | wgpu::TextureUsages::COPY_DST
                    | wgpu::TextureUsages::TEXTURE_BINDING,
            ),
            picture_readback: Readback::new(device, size_px, 4),
            clock: gpu
                .timestamp_period_ns
                .map(|period_ns| GpuClock::new(device, period_ns)),
            fade: None,
            layer_passes: None,
            layers,
            translucent: None,
            opaque_nodes: None,
            shown: Shown::Bare,
            bounds: None,
            pass_names: Vec::new(),
            stale: PixelRect::whole(size_px),
            deforming: deforming(scene),
            time_s: 0.0,
            made_for,
            size_px,
            without: scene.shadows.without,
            gpu_scene,
            background,
            gpu,
        })
    }

    /// Draws another state of its scene from now on, without delay: lights that shine otherwise, things that stand
    /// elsewhere, are shown or hidden. Light that surroundings reflect is not gathered anew. False where more has
    /// changed: that takes a new renderer.
    pub fn follow(&mut self, scene: &Scene) -> bool {
        let shaped = scene.shaped_at(self.time_s);
        let LayeredScene { scene, layers } = LayeredScene::new(&shaped);
        let scene = scene.as_ref();
        let lights = scene.outlined_lights();
        let follows =
            self.made_for == Shape::of(scene, &lights) && self.technique.passes_mut().follow(scene);
        if follows {
            self.gpu_scene.follow(&self.gpu, scene, lights);
            if let Some(reflections) = &mut self.reflections {
                reflections.follow(scene);
            }
            self.layers = layers;
            self.deforming = deforming(scene);
            self.deform(|_| true);
            self.stale = PixelRect::whole(self.size_px);
        }
        follows
    }

    /// Gives the things that change it the shape that they have at a frame's time, seconds since the recording's first frame:
    /// what is drawn from now on is drawn so. Before the first call it is that of time 0.
    pub fn set_time(&mut self, time_s: f64) {
        self.time_s = time_s;
        self.deform(|thing| thing.object.take_shape(time_s));
    }

    /// Takes the shapes of those things of which `changes` says that they have another one.
    fn deform(&mut self, mut changes: impl FnMut(&mut DeformingThing) -> bool) {
        for thing in &mut self.deforming {
            if !changes(thing) {
                continue;
            }
            thing.is_news = true;
            self.gpu_scene.deform(&self.gpu, thing);
            let mut layers = self.layers.iter_mut();
            if let Some(layer) = layers.find(|layer| layer.node == thing.object.anchor) {
                layer.deform(&thing.object);
            }
        }
    }

    /// Tells the technique of shapes that it does not know, as late as it can be: a frame that is passed over takes no more
    /// than what the choice of levels needs.
    fn tell_of_shapes(&mut self) {
        let things = self.deforming.iter_mut();
        let news: Vec<&DeformingThing> = things
            .filter_map(|thing| std::mem::take(&mut thing.is_news).then_some(&*thing))
            .collect();
        if !news.is_empty() {
            let technique = self.technique.passes_mut();
            technique.deform(&self.gpu, &mut self.gpu_scene, &news);
            if let Some(reflections) = &mut self.reflections {
                reflections.deform(&news);
            }
        }
    }

    /// Takes note of what the last frame took to draw, milliseconds: a scene with a frame budget is drawn with fewer
    /// sources, or coarser outlines, where that keeps to it.
    pub fn spent(&mut self, frame_ms: f64) {
        let Some(controller) = &mut self.quality_controller else {
            return;
        };
        if controller.spent(frame_ms) {
            match controller.setting() {
                Setting::Sources(sources) => self.technique.passes_mut().set_sources(sources),
                Setting::SilhouettesPx(error_px) => self.gpu_scene.set_detail(error_px),
            }
        }
    }

    /// What the scene's frame budget has led to; `None` without one.
    pub fn quality_controller(&self) -> Option<&QualityController> {
        self.quality_controller.as_ref()
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
                .unwrap_or_else(|| Fade::new(&self.gpu, &self.picture));
            fade.keep(&self.gpu, &self.picture);
            self.draw(&seen_at_least(part), shown);
            fade.mix(&self.gpu, &self.picture, part);
            self.stale = PixelRect::whole(self.size_px);
            self.fade = Some(fade);
        }
    }

    /// Draws the uploaded picture with what stands on the nodes, layers too; one that is not there has no pose.
    fn draw_once(&mut self, camera_from_anchor: &[Option<DAffine3>], shown: Shown) {
        self.shown = shown;
        self.tell_of_shapes();
        self.gpu_scene.place(&self.gpu, camera_from_anchor);
        let technique = self.technique.passes_mut();
        self.bounds = technique.prepare(&self.gpu, &mut self.gpu_scene, shown);
        if self.without.has(Shortcut::Kept) {
            self.stale = PixelRect::whole(self.size_px);
        }
        let mut passes = Passes::new(&self.gpu, self.clock.as_ref());
        self.background.draw(&mut passes, &self.picture, self.stale);
        self.stale = PixelRect::NONE;
        let picture = self.picture.create_view(&Default::default());
        let bounds = self.bounds.as_ref().filter(|_| shown == Shown::Composite);
        if let Some(bounds) = bounds.filter(|bounds| !bounds.pixels.is_empty()) {
            self.stale = bounds.pixels;
            let frame = FrameContext {
                gpu: &self.gpu,
                gpu_scene: &self.gpu_scene,
                background: &self.background,
                picture: &picture,
                bounds,
            };
            match &mut self.reflections {
                Some(reflections) => draw_mirroring(technique, reflections, &mut passes, &frame),
                None => technique.draw(&mut passes, &frame),
            }
        }
        let RecordedPasses {
            mut encoder,
            names,
            spans,
        } = passes.finish();
        self.pass_names = names;
        if let Some(clock) = &mut self.clock {
            clock.resolve(&mut encoder, &spans);
        }
        self.gpu.queue.submit([encoder.finish()]);
    }

    /// The names of the passes of the frame that was drawn last, in their order.
    pub fn passes(&self) -> &[&'static str] {
        &self.pass_names
    }

    /// Takes note of a frame that is not drawn, so that the next one is what it would be after it.
    pub fn pass_over(&mut self, camera_from_anchor: &[Option<DAffine3>]) {
        let nodes = self.without_layers(camera_from_anchor);
        self.gpu_scene.choose_levels(&nodes);
    }

    /// The picture that is drawn: sRGB-encoded bytes, whatever the format says. It stays the same texture.
    pub fn picture(&self) -> &wgpu::Texture {
        &self.picture
    }

    /// Triangles of the things that were drawn last, in the levels of detail that were chosen for them.
    pub fn triangles(&self) -> usize {
        self.gpu_scene.triangles()
    }

    /// Waits until the picture is drawn, so that drawing and reading back can be timed apart.
    ///
    /// # Errors
    /// The device failed since it was opened.
    pub fn wait(&self) -> Result<(), RenderError> {
        self.gpu.wait()
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
}

/// Draws a frame without reflections, and then what mirrors it once more.
fn draw_mirroring(
    technique: &mut dyn TechniquePasses,
    reflections: &mut Reflections,
    passes: &mut Passes<'_>,
    frame: &FrameContext<'_>,
) {
    let mirroring = reflections.begin(passes, frame);
    technique.draw(passes, frame);
    if mirroring.is_empty() {
        return;
    }
    passes.stop_clock();
    reflections.draw(passes, frame, mirroring, technique.mirrored());
    let bounds = frame.bounds.only(mirroring);
    let again = FrameContext {
        bounds: &bounds,
        ..*frame
    };
    technique.draw(passes, &again);
}
