//! What all techniques have in common: the steps in which each draws its part of a frame.

use super::background::Background;
use super::deforming::DeformingThing;
use super::gpu::Gpu;
use super::gpu_scene::GpuScene;
use super::mirrored_probe::MirroredProbe;
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use crate::scene::Scene;

/// A frame that is being drawn.
#[derive(Clone, Copy)]
pub(super) struct FrameContext<'a> {
    pub gpu: &'a Gpu,
    pub gpu_scene: &'a GpuScene,
    pub background: &'a Background,
    /// The picture that is shown, with the video in it.
    pub picture: &'a wgpu::TextureView,
    /// What of it can change.
    pub bounds: &'a ScreenBounds,
}

/// A technique's steps through a frame, in their order.
pub(super) trait TechniquePasses {
    /// Draws another state of its scene from now on. False where that takes a new renderer.
    fn follow(&mut self, _scene: &Scene) -> bool {
        true
    }

    /// Takes note of things that have another shape now, which `gpu_scene` knows.
    fn deform(&mut self, _gpu: &Gpu, _gpu_scene: &mut GpuScene, _things: &[&DeformingThing]) {}

    /// So many sources of broad light at most get a shadow from now on; `None`: all.
    fn set_sources(&mut self, _sources: Option<u32>) {}

    /// Works out what the frame needs, whose poses `gpu_scene` has. Returns what of the picture can change; `None` if nothing.
    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds>;

    /// What glossy things mirror where they mirror nothing that stands around them; `None`: the ambient light.
    fn mirrored(&self) -> Option<&MirroredProbe> {
        None
    }

    /// Draws virtual things and shadows over the video.
    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>);

    /// Draws the factor that the frame, which was drawn last, has put on the video; `gain` is white at first.
    fn draw_gain(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        gain: wgpu::RenderPassColorAttachment<'_>,
    );
}
