//! Shades straight into the picture, where one light and one sample per pixel leave nothing to add up or average: only
//! pixels that a virtual thing changes are touched.
//! Reads the recorded picture and the stencil (stencil.rs). Writes depth, stencil and the picture; beside it, for virtual
//! surfaces, what a shadow leaves of them, which is copied into the picture where one falls.

use super::anchor_geometry::Role;
use super::attachments::{kept, loaded, target};
use super::background::{Background, PICTURE_FORMAT, VIDEO_GROUP};
use super::gpu::Gpu;
use super::gpu_clock::GpuSpan;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::light_kind::LightKind;
use super::light_sums::GAIN_FORMAT;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels, untouched};
use super::screen_bounds::ScreenBounds;
use super::shown::Shown;
use super::stencil::{SHADOW, VIRTUAL_SHADOW, depth_stencil_state, stencil};
use super::surfaces::{Sided, SurfaceKinds, surface_description};
use super::technique::{FrameContext, TechniquePasses};
use super::uniforms::GEOMETRY_GROUPS;
use super::volumes::{Among, Volumes, set_scissor};
use crate::geometry::reach::PixelRect;

/// Values of `SEEN` in direct.wgsl.
const IN_OPEN_LIGHT: f64 = 1.0;
const AT_TERMINATOR: f64 = 0.5;

/// Groups 0 to 2 where geometry is drawn over the video.
const OVER_VIDEO_GROUPS: [GroupLayout; 3] = [GEOMETRY_GROUPS[0], GEOMETRY_GROUPS[1], VIDEO_GROUP];

/// Group 3: what a shadow leaves of virtual surfaces.
const AMBIENT_GROUP: GroupLayout = GroupLayout {
    label: "ambient light",
    entries: &[texels(0, false)],
};

/// Pipelines and textures of the two passes.
pub(super) struct Direct {
    /// Empties depth, stencil and `ambient` as far as the scissor reaches: to clear the whole of them took longer than to
    /// draw most things.
    nothing: wgpu::RenderPipeline,
    /// Depth of real surfaces.
    depth_of_real: Sided,
    /// Depth and all light of virtual surfaces, as if nothing hid it.
    light_on_virtual: Sided,
    /// The same where they are turned away from the light, and smooth shading lights them all the same.
    light_at_terminator: Sided,
    /// Depth and the ambient light alone.
    ambient_on_virtual: Sided,
    volumes: Volumes,
    /// Real surfaces where virtual things hide the light.
    hidden_on_real: Sided,
    /// The factor that they then have on the video, for the `gain` layer.
    gain_on_real: Sided,
    /// The ambient light alone where virtual surfaces lie in more volumes than the stencil's reference says: those in the
    /// open (0), and those at the terminator (1), which lie in their own.
    shadow_on_virtual: [wgpu::RenderPipeline; 2],
    /// What they read.
    ambient_group: wgpu::BindGroup,
    /// What a shadow leaves of virtual surfaces, encoded as the picture is.
    ambient: wgpu::TextureView,
    depth_stencil: wgpu::TextureView,
}

impl Direct {
    /// `light` is what the scene's light is.
    pub fn new(gpu: &Gpu, background: &Background, kinds: SurfaceKinds, light: LightKind) -> Self {
        let target =
            |label, format, usage| target(&gpu.device, label, background.size_px, format, 1, usage);
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let ambient = target("ambient light", PICTURE_FORMAT, read);
        let surface = SurfacesOverVideo {
            gpu,
            kinds,
            // What a scene does not have costs nothing.
            constants: vec![
                ("GLOSSY", f64::from(kinds.glossy)),
                light.constant(),
                ("DISTORTS", f64::from(background.distorts)),
            ],
        };
        let format = gpu.depth_format;
        Self {
            nothing: gpu.pipeline(&PipelineDescription {
                shader: "direct.wgsl",
                fragment: "nothing",
                targets: vec![untouched(PICTURE_FORMAT), overwritten(PICTURE_FORMAT)],
                depth_stencil: Some(emptied(format)),
                ..Default::default()
            }),
            depth_of_real: surface.first("place_alone", "depth_alone", None, untouched),
            light_on_virtual: surface.lit(IN_OPEN_LIGHT),
            light_at_terminator: surface.lit(AT_TERMINATOR),
            ambient_on_virtual: surface.first(
                "place_in_ambient_light",
                "ambient_on_virtual",
                None,
                overwritten,
            ),
            volumes: Volumes::new(gpu, &OVER_VIDEO_GROUPS, 1, &[PICTURE_FORMAT]),
            hidden_on_real: surface.hidden("hidden_on_real", PICTURE_FORMAT),
            gain_on_real: surface.hidden("gain_on_real", GAIN_FORMAT),
            shadow_on_virtual: [IN_OPEN_LIGHT, AT_TERMINATOR].map(|seen| {
                gpu.pipeline(&PipelineDescription {
                    shader: "direct.wgsl",
                    fragment: "shadow_on_virtual",
                    constants: vec![("SEEN", seen)],
                    groups: vec![None, None, None, Some(AMBIENT_GROUP)],
                    targets: vec![overwritten(PICTURE_FORMAT)],
                    depth_stencil: Some(in_shadow(format)),
                    ..Default::default()
                })
            }),
            ambient_group: gpu.bind_group(
                &AMBIENT_GROUP,
                [wgpu::BindingResource::TextureView(&ambient)],
            ),
            ambient,
            depth_stencil: target("depth and stencil", format, wgpu::TextureUsages::empty()),
        }
    }

    /// Draws phantoms' depth and lit virtual things.
    fn draw_surfaces(&self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let keep = wgpu::LoadOp::Load;
        let mut pass = passes.begin(
            "surfaces",
            Some(GpuSpan::Light.part(true, false)),
            &[loaded(frame.picture, keep), loaded(&self.ambient, keep)],
            Some(kept(&self.depth_stencil)),
        );
        set_scissor(&mut pass, pixels);
        pass.set_pipeline(&self.nothing);
        pass.draw(0..3, 0..1);
        pass.set_bind_group(2, &frame.background.group, &[]);
        gpu_scene.draw_surfaces(
            &mut pass,
            &self.depth_of_real,
            Role::Real,
            DrawnLight::Whole(0),
            pixels,
        );
        let shading = [
            &self.light_on_virtual,
            &self.light_at_terminator,
            &self.ambient_on_virtual,
        ];
        gpu_scene.draw_virtuals(&mut pass, shading, 0, pixels);
    }

    /// Draws the shadows on them.
    fn draw_shadows(&self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        let (gpu_scene, bounds) = (frame.gpu_scene, frame.bounds);
        let pixels = bounds.pixels;
        let mut pass = passes.begin(
            "shadows",
            Some(GpuSpan::Light.part(false, true)),
            &[loaded(frame.picture, wgpu::LoadOp::Load)],
            Some(kept(&self.depth_stencil)),
        );
        let pass = &mut pass;
        set_scissor(pass, pixels);
        pass.set_bind_group(2, &frame.background.group, &[]);
        let volumes = &self.volumes;
        let by_real = gpu_scene.count_volumes(pass, volumes, Among::All, Role::Real, 0, pixels);
        if !by_real.is_empty() {
            volumes.keep(pass, Role::Real, pixels);
        }
        let lit = Among::LitByReal;
        let by_virtual = gpu_scene.count_volumes(pass, volumes, lit, Role::Virtual, 0, pixels);
        if !by_virtual.is_empty() {
            gpu_scene.draw_surfaces(
                pass,
                &self.hidden_on_real,
                Role::Real,
                DrawnLight::Whole(0),
                pixels,
            );
        }
        if !by_real.union(by_virtual).is_empty() && !bounds.virtuals.is_empty() {
            set_scissor(pass, bounds.virtuals);
            pass.set_bind_group(3, &self.ambient_group, &[]);
            for (own, pipeline) in (0..).zip(&self.shadow_on_virtual) {
                pass.set_pipeline(pipeline);
                pass.set_stencil_reference(own);
                pass.draw(0..3, 0..1);
            }
        }
    }
}

impl TechniquePasses for Direct {
    fn prepare(
        &mut self,
        gpu: &Gpu,
        gpu_scene: &mut GpuScene,
        shown: Shown,
    ) -> Option<ScreenBounds> {
        gpu_scene.cast_shadows(gpu, shown, PixelRect::NONE)
    }

    /// Haller et al. 2003, section 3.2, for one light and one sample: phantoms and lit virtual things into depth; *real
    /// onto real* is counted; *virtual onto real* is counted where the light arrives, and what is counted loses it;
    /// *all onto virtual* is what both have counted there, and leaves what was set aside.
    fn draw(&mut self, passes: &mut Passes<'_>, frame: &FrameContext<'_>) {
        self.draw_surfaces(passes, frame);
        self.draw_shadows(passes, frame);
    }

    fn draw_gain(
        &self,
        passes: &mut Passes<'_>,
        frame: &FrameContext<'_>,
        gain: wgpu::RenderPassColorAttachment<'_>,
    ) {
        let (gpu_scene, pixels) = (frame.gpu_scene, frame.bounds.pixels);
        let mut pass = passes.begin("gain", None, &[gain], Some(kept(&self.depth_stencil)));
        set_scissor(&mut pass, pixels);
        pass.set_bind_group(2, &frame.background.group, &[]);
        gpu_scene.draw_surfaces(
            &mut pass,
            &self.gain_on_real,
            Role::Real,
            DrawnLight::Whole(0),
            pixels,
        );
    }
}

/// The common part of all pipelines that draw surfaces over the video.
struct SurfacesOverVideo<'a> {
    gpu: &'a Gpu,
    kinds: SurfaceKinds,
    constants: Vec<(&'static str, f64)>,
}

impl SurfacesOverVideo<'_> {
    /// Pipelines that draw into depth, and into the picture and `ambient` as `written` says.
    fn first(
        &self,
        vertex: &'static str,
        fragment: &'static str,
        seen: Option<f64>,
        written: fn(wgpu::TextureFormat) -> wgpu::ColorTargetState,
    ) -> Sided {
        let mut constants = self.constants.clone();
        constants.extend(seen.map(|seen| ("SEEN", seen)));
        let description = PipelineDescription {
            vertex,
            fragment,
            constants,
            targets: vec![written(PICTURE_FORMAT), written(PICTURE_FORMAT)],
            ..self.over_video(None)
        };
        let mut description = match fragment {
            "depth_alone" => description,
            _ => self.kinds.of_virtual(description),
        };
        if self.kinds.looks || self.kinds.glossy {
            description.flags.push("LAYERED");
        }
        Sided::new(self.gpu, &description)
    }

    /// Pipelines of virtual surfaces that the light reaches.
    fn lit(&self, seen: f64) -> Sided {
        self.first("place", "light_on_virtual", Some(seen), overwritten)
    }

    /// Pipelines of real surfaces where virtual things hide the light.
    fn hidden(&self, fragment: &'static str, format: wgpu::TextureFormat) -> Sided {
        let nothing = (wgpu::StencilOperation::Keep, 0);
        let counted = stencil(wgpu::CompareFunction::Less, VIRTUAL_SHADOW, nothing);
        let description = PipelineDescription {
            vertex: "place",
            fragment,
            constants: self.constants.clone(),
            targets: vec![overwritten(format)],
            ..self.over_video(Some(counted))
        };
        Sided::new(self.gpu, &description)
    }

    fn over_video(&self, stencil: Option<wgpu::StencilState>) -> PipelineDescription {
        PipelineDescription {
            shader: "direct.wgsl",
            groups: OVER_VIDEO_GROUPS.map(Some).to_vec(),
            ..surface_description(self.gpu, stencil)
        }
    }
}

/// Depth and stencil where a triangle over the whole picture empties both.
fn emptied(format: wgpu::TextureFormat) -> wgpu::DepthStencilState {
    let always = wgpu::CompareFunction::Always;
    let zero = (wgpu::StencilOperation::Zero, u32::MAX);
    depth_stencil_state(format, true, always, stencil(always, SHADOW, zero))
}

/// Depth and stencil where such a triangle is drawn in the shadow alone.
fn in_shadow(format: wgpu::TextureFormat) -> wgpu::DepthStencilState {
    let nothing = (wgpu::StencilOperation::Keep, 0);
    let counted = stencil(wgpu::CompareFunction::Less, SHADOW, nothing);
    depth_stencil_state(format, false, wgpu::CompareFunction::Always, counted)
}
