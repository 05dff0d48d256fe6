//! Adds up what several lights or samples give, light by light and sample by sample (Haller et al. 2003, section 3.2): what
//! arrives in the video on real surfaces, and what virtual things take of it; on virtual ones what arrives past all casters.
//! Writes depth, stencil and light sums; then the picture.

use crate::geometry::reach::PixelRect;

use super::anchor_geometry::Role;
use super::attachments::{depth_stencil, loaded};
use super::background::Background;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::GpuScene;
use super::light_sums::{BY_GAIN, LightSums};
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::surfaces::{First, Surfaces};
use super::technique::{FrameContext, TechniquePasses};
use super::uniforms::GEOMETRY_GROUPS;
use super::volumes::{Among, Volumes, set_scissor};

/// The technique that adds several lights or samples of shadow volumes up.
pub(super) struct Accumulated {
    surfaces: Surfaces,
    volumes: Volumes,
    first: First,
    /// Where all is added up.
    pub sums: LightSums,
}

impl Accumulated {
    /// `first` says what is there before the lights.
    pub fn new(
        gpu: &Gpu,
        background: &Background,
        samples: u32,
        glossy: bool,
        first: First,
    ) -> Self {
        Self {
            first,
            surfaces: Surfaces::new(gpu, samples, glossy, first),
            volumes: Volumes::new(gpu, &GEOMETRY_GROUPS, samples, &[gpu.light_format; 2]),
            sums: LightSums::new(gpu, background, samples, BY_GAIN),
        }
    }

    /// Adds up what all lights give and lose; `before` draws what else there is into depth.
    pub fn draw_lights(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        before: impl Fn(&mut wgpu::RenderPass<'_>),
    ) {
        let sums = &self.sums;
        let count = frame.gpu_scene.light_count().max(1);
        let fresh = match self.first {
            First::Ambient => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            First::DepthAlone => wgpu::LoadOp::Load,
        };
        for light in 0..count {
            let (first, last) = (light == 0, light + 1 == count);
            let begins = first && self.first == First::Ambient;
            let load = match first {
                true => fresh,
                false => wgpu::LoadOp::Load,
            };
            let mut pass = passes.begin(
                "light",
                Some(GpuSpan::Light.part(begins, last)),
                &[loaded(&sums.reaching, load), loaded(&sums.change, load)],
                Some(depth_stencil(&sums.depth_stencil, first, last)),
            );
            if first {
                before(&mut pass);
            }
            self.draw_light(&mut pass, frame, light, first);
        }
    }

    /// Draws what one light gives and loses; `is_first` draws the surfaces as well.
    fn draw_light(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &FrameContext<'_>,
        light: usize,
        is_first: bool,
    ) {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let (surfaces, volumes) = (&self.surfaces, &self.volumes);
        set_scissor(pass, pixels);
        if is_first {
            let ambient = [
                (&surfaces.ambient_on_real, Role::Real),
                (&surfaces.ambient_on_virtual, Role::Virtual),
            ];
            for (pipelines, role) in ambient {
                gpu_scene.draw_surfaces(pass, pipelines, role, light, pixels);
            }
        }
        if gpu_scene.light_count() == 0 {
            return;
        }
        if gpu_scene.count_volumes(pass, volumes, Among::All, Role::Real, light, pixels) {
            volumes.keep(pass, Role::Real, pixels);
        }
        gpu_scene.draw_surfaces(
            pass,
            &surfaces.light_reaching_real,
            Role::Real,
            light,
            pixels,
        );
        let lit = Among::LitByReal;
        if gpu_scene.count_volumes(pass, volumes, lit, Role::Virtual, light, pixels) {
            gpu_scene.draw_surfaces(
                pass,
                &surfaces.light_hidden_from_real,
                Role::Real,
                light,
                pixels,
            );
        }
        gpu_scene.draw_virtuals_facing(pass, &surfaces.light_on_virtual, light, pixels);
    }
}

impl TechniquePasses for Accumulated {
    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        gpu_scene.cast_shadows(gpu, shown, PixelRect::NONE)
    }

    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.draw_lights(passes, frame, |_| {});
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
