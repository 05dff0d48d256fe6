//! Draws real and virtual surfaces: depth and ambient light first, then each light where the stencil says so.
//! Reads the stencil (stencil.rs). Writes depth, `reaching` and `change` (see light_sums.wgsl).

use super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT, LOOK_LAYOUT};
use super::gpu::Gpu;
use super::light_kind::{ByLightKind, LightKind, LightKinds};
use super::materials::MATERIALS_GROUP;
use super::pipelines::{PipelineDescription, added, overwritten, taken_off, untouched};
use super::stencil::{ADDED, REAL_HIDES, SHADOW, VIRTUAL_SHADOW, depth_stencil_state, stencil};
use super::uniforms::GEOMETRY_GROUPS;

/// The light that is there before all lights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum First {
    /// The ambient light, which is drawn with depth.
    Ambient,
    /// What another technique has drawn: of surfaces only depth is drawn.
    DepthAlone,
}

/// Pipelines of the pass where several samples or lights are added up.
pub(super) struct Surfaces {
    /// Depth and ambient light of real surfaces.
    pub ambient_on_real: Sided,
    /// Depth and ambient light of virtual surfaces.
    pub ambient_on_virtual: Sided,
    /// What a light does.
    pub lit: ByLightKind<LitSurfaces>,
}

/// Pipelines that draw what one light gives and loses.
pub(super) struct LitSurfaces {
    /// A light as it reaches real surfaces in the video.
    pub reaching_real: Sided,
    /// A piece of a light that has reached real surfaces, taken off where real things hide it; the stencil's reference says so.
    pub kept_from_real: Sided,
    /// A light where virtual things hide it from real surfaces.
    pub hidden_from_real: Sided,
    /// A light on virtual surfaces past all casters; the stencil's reference is 0, or 1 for surfaces that lie in no
    /// shadow but perhaps their own.
    pub on_virtual: Sided,
}

/// What the materials of virtual surfaces and the lights on them have; what a scene does not have is left out when pipelines are built.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SurfaceKinds {
    /// Whether any has a glossy layer.
    pub glossy: bool,
    /// Of the lights that cast shadow volumes.
    pub lights: LightKinds,
    /// Whether any has pictures, colours at corners, metal or emission (materials.wgsl).
    pub looks: bool,
}

impl SurfaceKinds {
    /// The description of a pipeline as it draws virtual surfaces.
    pub fn of_virtual(self, mut description: PipelineDescription) -> PipelineDescription {
        if self.looks {
            description.flags.push("LOOKS");
            description.vertex_buffers.push(LOOK_LAYOUT);
            description.groups.resize(3, None);
            description.groups.push(Some(MATERIALS_GROUP));
        }
        description
    }
}

/// Pipelines for both sides of triangles, for outsides alone and for insides alone.
pub(super) struct Sided {
    pub both: wgpu::RenderPipeline,
    pub outside: wgpu::RenderPipeline,
    pub inside: wgpu::RenderPipeline,
}

impl Sided {
    /// The pipelines of a description, which says of both sides.
    pub fn new(gpu: &Gpu, both: &PipelineDescription) -> Self {
        let build = |cull_mode| {
            gpu.pipeline(&PipelineDescription {
                cull_mode,
                ..both.clone()
            })
        };
        Self {
            both: build(None),
            outside: build(Some(wgpu::Face::Back)),
            inside: build(Some(wgpu::Face::Front)),
        }
    }

    /// The same pipeline, whichever sides can be seen.
    pub fn both(gpu: &Gpu, both: &PipelineDescription) -> Self {
        let both = gpu.pipeline(both);
        Self {
            outside: both.clone(),
            inside: both.clone(),
            both,
        }
    }
}

/// A pipeline that is the first to draw surfaces, into depth, or draws once more what is there where the stencil says so.
pub(super) fn surface_description(
    gpu: &Gpu,
    stencil: Option<wgpu::StencilState>,
) -> PipelineDescription {
    let is_first = stencil.is_none();
    PipelineDescription {
        vertex_buffers: vec![CORNER_LAYOUT, INDIRECT_LAYOUT],
        depth_stencil: Some(depth_stencil_state(
            gpu.depth_format,
            is_first,
            match is_first {
                true => wgpu::CompareFunction::Greater,
                false => wgpu::CompareFunction::Equal,
            },
            stencil.unwrap_or_default(),
        )),
        ..Default::default()
    }
}

impl Surfaces {
    /// `first` says what the pass begins with.
    pub fn new(gpu: &Gpu, samples: u32, kinds: SurfaceKinds, first: First) -> Self {
        let described =
            |kind: LightKind, fragment, stencil, targets: [wgpu::ColorTargetState; 2]| {
                PipelineDescription {
                    shader: "surfaces.wgsl",
                    vertex: "place_sampled",
                    fragment,
                    constants: vec![
                        ("GLOSSY", f64::from(kinds.glossy)),
                        kind.constant(),
                        ("MULTISAMPLED", f64::from(samples > 1)),
                    ],
                    groups: GEOMETRY_GROUPS.map(Some).to_vec(),
                    targets: targets.to_vec(),
                    samples,
                    ..surface_description(gpu, stencil)
                }
            };
        let build = |kind, fragment, stencil, targets| {
            Sided::new(gpu, &described(kind, fragment, stencil, targets))
        };
        let build_virtual = |kind, fragment, stencil, targets| {
            let description = described(kind, fragment, stencil, targets);
            Sided::new(gpu, &kinds.of_virtual(description))
        };
        let format = gpu.light_format;
        let (added, untouched) = (
            || added(format, wgpu::BlendFactor::One),
            || untouched(format),
        );
        let before = || match first {
            First::Ambient => [overwritten(format), overwritten(format)],
            First::DepthAlone => [untouched(), untouched()],
        };
        let (equal, other) = (
            wgpu::CompareFunction::Equal,
            wgpu::CompareFunction::NotEqual,
        );
        // The reference is what the stencil may count at most.
        let at_most = wgpu::CompareFunction::GreaterEqual;
        // Coplanar surfaces land on the same depth, and each sample is to get a light once.
        let once = (wgpu::StencilOperation::Invert, ADDED);
        let taken = (wgpu::StencilOperation::Zero, VIRTUAL_SHADOW);
        let reaching = stencil(equal, REAL_HIDES | ADDED, once);
        let kept = stencil(equal, REAL_HIDES | ADDED, once);
        let hidden = stencil(other, VIRTUAL_SHADOW, taken);
        let unshadowed = stencil(at_most, SHADOW | ADDED, once);
        let of_kind = |kind| LitSurfaces {
            reaching_real: build(
                kind,
                "light_on_real",
                Some(reaching.clone()),
                [added(), untouched()],
            ),
            kept_from_real: build(
                kind,
                "light_on_real",
                Some(kept.clone()),
                [taken_off(format), untouched()],
            ),
            hidden_from_real: build(
                kind,
                "light_on_real",
                Some(hidden.clone()),
                [untouched(), added()],
            ),
            on_virtual: build_virtual(
                kind,
                "light_on_virtual",
                Some(unshadowed.clone()),
                [untouched(), added()],
            ),
        };
        let any = LightKind::Plain;
        Self {
            ambient_on_real: build(any, "ambient_on_real", None, before()),
            ambient_on_virtual: build_virtual(any, "ambient_on_virtual", None, before()),
            lit: ByLightKind::new(kinds.lights, of_kind),
        }
    }
}
