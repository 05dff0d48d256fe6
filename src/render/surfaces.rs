//! Draws real and virtual surfaces: depth and ambient light first, then each light where the stencil says so.
//! Reads the stencil (stencil.rs). Writes depth, `reaching` and `change` (see light_sums.wgsl).

use super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT};
use super::gpu::Gpu;
use super::pipelines::{PipelineDescription, added, overwritten, untouched};
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
    /// A light as it reaches real surfaces in the video.
    pub light_reaching_real: Sided,
    /// A light where virtual things hide it from real surfaces.
    pub light_hidden_from_real: Sided,
    /// A light on virtual surfaces past all casters; the stencil's reference is 0, or 1 for surfaces that lie in no
    /// shadow but perhaps their own.
    pub light_on_virtual: Sided,
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
    pub fn new(gpu: &Gpu, samples: u32, glossy: bool, first: First) -> Self {
        let build = |fragment, stencil, targets: [wgpu::ColorTargetState; 2]| {
            let description = PipelineDescription {
                shader: "surfaces.wgsl",
                vertex: "place_sampled",
                fragment,
                constants: vec![
                    ("GLOSSY", f64::from(glossy)),
                    ("MULTISAMPLED", f64::from(samples > 1)),
                ],
                groups: GEOMETRY_GROUPS.map(Some).to_vec(),
                targets: targets.to_vec(),
                samples,
                ..surface_description(gpu, stencil)
            };
            Sided::new(gpu, &description)
        };
        let format = gpu.light_format;
        let (added, untouched) = (
            || added(format, wgpu::BlendFactor::One),
            || untouched(format),
        );
        let ambient = |fragment| match first {
            First::Ambient => build(fragment, None, [overwritten(format), overwritten(format)]),
            First::DepthAlone => build(fragment, None, [untouched(), untouched()]),
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
        let nothing = (wgpu::StencilOperation::Keep, 0);
        let reaching = stencil(equal, REAL_HIDES | ADDED, once);
        let hidden = stencil(other, VIRTUAL_SHADOW, taken);
        let unshadowed = stencil(at_most, SHADOW, nothing);
        Self {
            ambient_on_real: ambient("ambient_on_real"),
            ambient_on_virtual: ambient("ambient_on_virtual"),
            light_reaching_real: build("light_on_real", Some(reaching), [added(), untouched()]),
            light_hidden_from_real: build("light_on_real", Some(hidden), [untouched(), added()]),
            light_on_virtual: build("light_on_virtual", Some(unshadowed), [untouched(), added()]),
        }
    }
}
