//! Adds up what several lights or samples give, light by light and sample by sample (Haller et al. 2003, section 3.2): what
//! arrives in the video on real surfaces, and what virtual things take of it; on virtual ones what arrives past all casters.
//! Writes depth, stencil and light sums; then the picture.

use crate::geometry::reach::PixelRect;
use crate::scene::Scene;

use super::anchor_geometry::Role;
use super::attachments::{depth_stencil, loaded};
use super::background::Background;
use super::deforming::DeformingThing;
use super::final_gather::FinalGather;
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::light_sums::{BY_GAIN, LightSums};
use super::passes::Passes;
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::surfaces::{First, LitSurfaces, SurfaceKinds, Surfaces};
use super::technique::{FrameContext, TechniquePasses};
use super::uniforms::GEOMETRY_GROUPS;
use super::volumes::{Among, Volumes, set_scissor};

/// The technique that adds several lights or samples of shadow volumes up.
pub(super) struct Accumulated {
    surfaces: Surfaces,
    volumes: Volumes,
    first: First,
    /// What real surfaces get beside the lights, where it is gathered.
    final_gather: Option<Box<FinalGather>>,
    /// Where all is added up.
    pub sums: LightSums,
}

impl Accumulated {
    /// `first` says what is there before the lights.
    pub fn new(
        gpu: &Gpu,
        background: &Background,
        samples: u32,
        kinds: SurfaceKinds,
        first: First,
    ) -> Self {
        Self {
            first,
            final_gather: None,
            surfaces: Surfaces::new(gpu, samples, kinds, first),
            volumes: Volumes::new(gpu, &GEOMETRY_GROUPS, samples, &[gpu.light_format; 2]),
            sums: LightSums::new(gpu, background, samples, BY_GAIN),
        }
    }

    /// The same with what real surfaces get beside the lights.
    pub fn with_final_gather(self, final_gather: Option<FinalGather>) -> Self {
        Self {
            final_gather: final_gather.map(Box::new),
            ..self
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
        let surfaces = &self.surfaces;
        set_scissor(pass, pixels);
        let whole = DrawnLight::Whole(light);
        if is_first {
            let ambient = [
                (&surfaces.ambient_on_real, Role::Real),
                (&surfaces.ambient_on_virtual, Role::Virtual),
            ];
            for (pipelines, role) in ambient {
                gpu_scene.draw_surfaces(pass, pipelines, role, whole, pixels);
                if let (Some(final_gather), Role::Real) = (&self.final_gather, role) {
                    final_gather.draw(pass, gpu_scene);
                }
            }
        }
        let pieces = gpu_scene.pieces_of(light);
        match pieces.len() {
            0 => {}
            1 => self.draw_sharp(pass, frame, pieces.start),
            _ => {
                let lit = surfaces.lit.of(gpu_scene.light_kind(whole));
                gpu_scene.draw_surfaces(pass, &lit.reaching_real, Role::Real, whole, pixels);
                let mut counted = pixels;
                for piece in pieces {
                    counted = self.draw_piece(pass, frame, piece, counted);
                }
            }
        }
    }

    /// Draws a light that is one piece.
    fn draw_sharp(&self, pass: &mut wgpu::RenderPass<'_>, frame: &FrameContext<'_>, piece: usize) {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let (lit, volumes) = (self.lit(frame, piece), &self.volumes);
        let among = Among::All;
        let reached = gpu_scene.count_volumes(pass, volumes, among, Role::Real, piece, pixels);
        if !reached.is_empty() {
            volumes.keep(pass, Role::Real, pixels);
        }
        let drawn = DrawnLight::Piece(piece);
        gpu_scene.draw_surfaces(pass, &lit.reaching_real, Role::Real, drawn, pixels);
        self.draw_taken(pass, frame, piece);
        gpu_scene.draw_virtuals_facing(pass, &lit.on_virtual, piece, pixels);
    }

    /// Draws one of several pieces of a light, of which all has reached the real surfaces already. The stencil is 0 but in the
    /// pixels `counted`; returns where it is not afterwards.
    fn draw_piece(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &FrameContext<'_>,
        piece: usize,
        counted: PixelRect,
    ) -> PixelRect {
        let counted = self.draw_hidden(pass, frame, piece, counted);
        let (on_virtual, pixels) = (&self.lit(frame, piece).on_virtual, frame.bounds.pixels);
        let gpu_scene = frame.gpu_scene;
        gpu_scene.draw_virtuals_facing(pass, on_virtual, piece, pixels);
        counted
    }

    /// The pipelines of a piece.
    fn lit(&self, frame: &FrameContext<'_>, piece: usize) -> &LitSurfaces {
        let kind = frame.gpu_scene.light_kind(DrawnLight::Piece(piece));
        self.surfaces.lit.of(kind)
    }

    /// Draws what is hidden of a piece from real surfaces, which all of it has reached; pixels as in `draw_piece`.
    fn draw_hidden(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &FrameContext<'_>,
        piece: usize,
        counted: PixelRect,
    ) -> PixelRect {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let (lit, volumes) = (self.lit(frame, piece), &self.volumes);
        if !counted.is_empty() {
            volumes.forget(pass, counted);
        }
        let among = Among::All;
        let reached = gpu_scene.count_volumes(pass, volumes, among, Role::Real, piece, pixels);
        if !reached.is_empty() {
            volumes.keep(pass, Role::Real, reached);
            gpu_scene.draw_surfaces(
                pass,
                &lit.kept_from_real,
                Role::Real,
                DrawnLight::HiddenPiece(piece),
                reached,
            );
        }
        reached.union(self.draw_taken(pass, frame, piece))
    }

    /// Draws what virtual things take of a piece from real surfaces; what real ones hide of it is known. Returns where they can.
    fn draw_taken(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        frame: &FrameContext<'_>,
        piece: usize,
    ) -> PixelRect {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let (lit, volumes) = (self.lit(frame, piece), &self.volumes);
        let among = Among::LitByReal;
        let reached = gpu_scene.count_volumes(pass, volumes, among, Role::Virtual, piece, pixels);
        if !reached.is_empty() {
            // (The stencil is 0 elsewhere.)
            set_scissor(pass, reached);
            gpu_scene.draw_surfaces(
                pass,
                &lit.hidden_from_real,
                Role::Real,
                DrawnLight::Piece(piece),
                reached,
            );
        }
        set_scissor(pass, pixels);
        reached
    }
}

impl TechniquePasses for Accumulated {
    fn follow(&mut self, scene: &Scene) -> bool {
        if let Some(final_gather) = &mut self.final_gather {
            final_gather.follow(scene);
        }
        true
    }

    fn deform(&mut self, _gpu: &Gpu, _gpu_scene: &mut GpuScene, things: &[&DeformingThing]) {
        if let Some(final_gather) = &mut self.final_gather {
            final_gather.deform(things);
        }
    }

    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        let gathered = match (shown, &mut self.final_gather) {
            (Shown::Composite, Some(final_gather)) => final_gather.update(gpu, gpu_scene),
            _ => PixelRect::NONE,
        };
        gpu_scene.cast_shadows(gpu, shown, gathered)
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
