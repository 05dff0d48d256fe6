//! Compact and broad light in one picture: shafts, or the environment, draw what broad light gives and loses, and shadow volumes
//! add the compact lights to the same sums, so that of what reaches a pixel all terms are known.
//! Writes the broad light's maps, light sums, depth and stencil, and then the picture.

use crate::geometry::reach::PixelRect;
use crate::scene::Scene;

use super::accumulated::Accumulated;
use super::attachments::{cleared, depth_stencil};
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::GpuScene;
use super::mirrored_probe::MirroredProbe;
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::technique::{FrameContext, TechniquePasses};
use super::volumes::set_scissor;

/// What draws broad light into sums that others add to.
pub(super) trait BroadLight: Send {
    /// Takes another state of its scene. False where that takes a new renderer.
    fn follow(&mut self, scene: &Scene) -> bool;

    /// Takes note of things that have another shape now, which `gpu_scene` knows.
    fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, things: &[&DeformingThing]);

    /// So many sources at most get a shadow from now on; `None`: all.
    fn set_sources(&mut self, _sources: Option<u32>) {}

    /// Works out what is hidden where things are now. Returns the pixels that it can change, `None` if none.
    fn update(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene) -> Option<PixelRect>;

    /// What glossy things mirror of it.
    fn mirrored(&self) -> Option<&MirroredProbe>;

    /// Draws its maps where they are not drawn yet.
    fn draw_maps(&mut self, gpu: &Gpu, passes: &mut Passes<'_>);

    /// Draws what is real into depth, what is virtual over it, and the light on all of both.
    fn draw_all_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        gpu_scene: &GpuScene,
        within: PixelRect,
    );

    /// Draws what it alone knows into depth.
    fn draw_own_depth(&self, _pass: &mut wgpu::RenderPass<'_>, _gpu_scene: &GpuScene) {}
}

/// The technique that draws both.
pub(super) struct Combined {
    compact: Accumulated,
    broad: Box<dyn BroadLight>,
}

impl Combined {
    /// Of lights that draw only depth before they are added to what is there.
    pub fn new(compact: Accumulated, broad: Box<dyn BroadLight>) -> Self {
        Self { compact, broad }
    }
}

impl TechniquePasses for Combined {
    fn follow(&mut self, scene: &Scene) -> bool {
        self.broad.follow(scene)
    }

    fn deform(&mut self, gpu: &Gpu, gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        self.broad.deform(gpu, gpu_scene, things);
    }

    fn set_sources(&mut self, sources: Option<u32>) {
        self.broad.set_sources(sources);
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        let broad = match shown {
            Shown::Bare => None,
            Shown::Composite => self.broad.update(gpu, gpu_scene),
        };
        gpu_scene.cast_shadows(gpu, shown, broad.unwrap_or(PixelRect::NONE))
    }

    fn mirrored(&self) -> Option<&MirroredProbe> {
        self.broad.mirrored()
    }

    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.broad.draw_maps(frame.gpu, passes);
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let sums = &self.compact.sums;
        let mut pass = passes.begin(
            "broad light",
            Some(GpuSpan::Light.part(true, false)),
            &[cleared(&sums.reaching), cleared(&sums.change)],
            Some(depth_stencil(&sums.depth_stencil, true, true)),
        );
        set_scissor(&mut pass, pixels);
        self.broad.draw_all_light(&mut pass, gpu_scene, pixels);
        drop(pass);
        self.compact.draw_lights(passes, frame, |pass| {
            self.broad.draw_own_depth(pass, gpu_scene);
        });
        sums.composite(passes, frame);
    }

    fn draw_gain(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        gain: wgpu::RenderPassColorAttachment<'_>,
    ) {
        self.compact.sums.draw_gain(passes, frame, gain);
    }
}
