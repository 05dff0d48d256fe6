//! Shades straight into the picture, where one light and one sample per pixel leave nothing to add up or average: only
//! pixels that a virtual thing changes are touched, and once.
//! Reads the recorded picture and the stencil (stencil.rs). Writes depth, stencil and the picture.

use super::background::PICTURE_FORMAT;
use super::shader;
use super::stencil::{SHADOW, VIRTUAL_SHADOW};
use super::surfaces::{Sided, Use};
use super::volumes::Volumes;

/// Pipelines and depth buffer of the pass.
pub(super) struct Direct {
    /// Depth of real surfaces.
    pub depth_of_real: Sided,
    /// Depth and all light of virtual surfaces, as if nothing hid it.
    pub light_on_virtual: Sided,
    /// Depth and the ambient light alone.
    pub ambient_on_virtual: Sided,
    /// Real surfaces where virtual things hide the light.
    pub hidden_on_real: Sided,
    /// The ambient light alone on virtual surfaces that lie in more volumes than the stencil's reference says.
    pub shadow_on_virtual: Sided,
    pub volumes: Volumes,
    pub depth_stencil: wgpu::TextureView,
}

impl Direct {
    /// `layout` is that of geometry with the video in group 2. Last come whether any material is glossy and the lens
    /// distorts: what a scene does not have costs nothing.
    pub fn new(
        device: &wgpu::Device,
        layout: &wgpu::PipelineLayout,
        depth_stencil: &wgpu::Texture,
        [glossy, distorts]: [bool; 2],
    ) -> Self {
        let depth_format = depth_stencil.format();
        let module = shader::module(device, "direct", include_str!("../../shaders/direct.wgsl"));
        let build = |vertex: &str, fragment: &str, stencil, stencil_bits, written| {
            let usage = Use {
                vertex,
                fragment,
                writes_depth: stencil == wgpu::CompareFunction::Always,
                stencil,
                stencil_bits,
                marks: (wgpu::StencilOperation::Keep, 0),
                targets: &[Some(wgpu::ColorTargetState {
                    format: PICTURE_FORMAT,
                    blend: None,
                    write_mask: written,
                })],
                constants: &[
                    ("GLOSSY", f64::from(glossy)),
                    ("DISTORTS", f64::from(distorts)),
                ],
            };
            usage.pipelines(device, layout, &module, depth_format, 1)
        };
        let (always, less) = (wgpu::CompareFunction::Always, wgpu::CompareFunction::Less);
        let (all, none) = (wgpu::ColorWrites::ALL, wgpu::ColorWrites::empty());
        Self {
            depth_of_real: build("place_alone", "depth_alone", always, 0, none),
            light_on_virtual: build("place", "light_on_virtual", always, 0, all),
            ambient_on_virtual: build(
                "place_in_ambient_light",
                "ambient_on_virtual",
                always,
                0,
                all,
            ),
            hidden_on_real: build("place", "hidden_on_real", less, VIRTUAL_SHADOW, all),
            shadow_on_virtual: build(
                "place_in_ambient_light",
                "ambient_on_virtual",
                less,
                SHADOW,
                all,
            ),
            volumes: Volumes::new(device, layout, depth_format, 1, &[PICTURE_FORMAT]),
            depth_stencil: depth_stencil.create_view(&Default::default()),
        }
    }
}
