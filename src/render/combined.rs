//! Compact and broad light in one picture: shafts draw what a room's broad light gives and loses, and shadow volumes add the
//! compact lights to the same sums, so that of what reaches a pixel all terms are known.
//! Writes the sources' maps, light sums, depth and stencil, and then the picture.

use crate::geometry::reach::PixelRect;
use crate::scene::Scene;

use super::accumulated::Accumulated;
use super::attachments::{cleared, depth_stencil};
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::GpuScene;
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shafts::{Receivers, Shafts};
use super::shown::Shown;
use super::technique::{FrameContext, TechniquePasses};
use super::volumes::set_scissor;

/// The technique that draws both.
pub(super) struct Combined {
    compact: Accumulated,
    broad: Shafts,
}

impl Combined {
    /// Of lights that draw only depth before they are added to what is there.
    pub fn new(compact: Accumulated, broad: Shafts) -> Self {
        Self { compact, broad }
    }
}

impl TechniquePasses for Combined {
    fn follow(&mut self, scene: &Scene) -> bool {
        self.broad.follow(scene)
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

    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.broad.draw_maps(frame.gpu, passes);
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let sums = &self.compact.sums;
        let mut pass = passes.begin(
            "shafts",
            Some(GpuSpan::Light.part(true, false)),
            &[cleared(&sums.reaching), cleared(&sums.change)],
            Some(depth_stencil(&sums.depth_stencil, true, true)),
        );
        set_scissor(&mut pass, pixels);
        self.broad
            .draw_light(&mut pass, gpu_scene, pixels, Receivers::All);
        drop(pass);
        self.compact.draw_lights(passes, frame, |pass| {
            self.broad.draw_depth_of_room(pass, gpu_scene);
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
