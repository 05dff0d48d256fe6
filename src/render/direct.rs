//! Shades straight into the picture, where one light and one sample per pixel leave nothing to add up or average: only
//! pixels that a virtual thing changes are touched.
//! Reads the recorded picture and the stencil (stencil.rs). Writes depth, stencil and the picture; beside it, for virtual
//! surfaces, what a shadow leaves of them, which is copied into the picture where one falls.

use super::background::{Background, PICTURE_FORMAT, extent};
use super::composite::GAIN_FORMAT;
use super::gpu::Gpu;
use super::shader;
use super::stencil::{SHADOW, VIRTUAL_SHADOW};
use super::surfaces::{Sided, Use};
use super::volumes::Volumes;

/// Values of `SEEN` in direct.wgsl.
const IN_OPEN_LIGHT: f64 = 1.0;
const AT_TERMINATOR: f64 = 0.5;

/// Pipelines and textures of the two passes.
pub(super) struct Direct {
    /// Empties depth, stencil and `ambient` as far as the scissor reaches: to clear the whole of them took longer than to
    /// draw most things.
    pub nothing: wgpu::RenderPipeline,
    /// Depth of real surfaces.
    pub depth_of_real: Sided,
    /// Depth and all light of virtual surfaces, as if nothing hid it.
    pub light_on_virtual: Sided,
    /// The same where they are turned away from the light, and smooth shading lights them all the same.
    pub light_at_terminator: Sided,
    /// Depth and the ambient light alone.
    pub ambient_on_virtual: Sided,
    pub volumes: Volumes,
    /// Real surfaces where virtual things hide the light.
    pub hidden_on_real: Sided,
    /// The factor that they then have on the video, for the `gain` layer.
    pub gain_on_real: Sided,
    /// The ambient light alone where virtual surfaces lie in more volumes than the stencil's reference says: those in the
    /// open (0), and those at the terminator (1), which lie in their own.
    pub shadow_on_virtual: [wgpu::RenderPipeline; 2],
    /// What they read, in group 3.
    pub ambient_group: wgpu::BindGroup,
    /// What a shadow leaves of virtual surfaces, encoded as the picture is.
    pub ambient: wgpu::TextureView,
    pub depth_stencil: wgpu::TextureView,
}

impl Direct {
    /// `layouts` are those of groups 0 and 1 where geometry is drawn.
    pub fn new(
        gpu: &Gpu,
        [view, light]: &[wgpu::BindGroupLayout; 2],
        background: &Background,
        glossy: bool,
    ) -> Self {
        let device = &gpu.device;
        let texture = |label, format, usage| {
            device
                .create_texture(&wgpu::TextureDescriptor {
                    label: Some(label),
                    size: extent(background.size_px),
                    mip_level_count: 1,
                    sample_count: 1,
                    dimension: wgpu::TextureDimension::D2,
                    format,
                    usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                    view_formats: &[],
                })
                .create_view(&Default::default())
        };
        let ambient = texture(
            "ambient light",
            PICTURE_FORMAT,
            wgpu::TextureUsages::TEXTURE_BINDING,
        );
        let ambient_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("ambient light"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::FRAGMENT,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Float { filterable: false },
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let layout = |label, groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(label),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let geometry = layout(
            "geometry over video",
            &[Some(view), Some(light), Some(&background.layout)],
        );
        let module = shader::module(device, "direct", include_str!("../../shaders/direct.wgsl"));
        // What a scene does not have costs nothing.
        let constants = [
            ("GLOSSY", f64::from(glossy)),
            ("DISTORTS", f64::from(background.distorts)),
        ];
        let target = |format, write_mask| {
            Some(wgpu::ColorTargetState {
                format,
                blend: None,
                write_mask,
            })
        };
        let targets =
            |written| [PICTURE_FORMAT, PICTURE_FORMAT].map(|format| target(format, written));
        let (all, none) = (wgpu::ColorWrites::ALL, wgpu::ColorWrites::empty());

        let surface = |vertex, fragment, constants: &[_], written| {
            let usage = Use {
                vertex,
                fragment,
                writes_depth: true,
                stencil: wgpu::CompareFunction::Always,
                stencil_bits: 0,
                marks: (wgpu::StencilOperation::Keep, 0),
                targets: &targets(written),
                constants,
            };
            usage.pipelines(device, &geometry, &module, gpu.depth_format, 1)
        };
        let lit = |seen| {
            let constants = [constants[0], ("SEEN", seen)];
            surface("place", "light_on_virtual", &constants, all)
        };
        let hidden = |fragment, format| {
            let usage = Use {
                vertex: "place",
                fragment,
                writes_depth: false,
                stencil: wgpu::CompareFunction::Less,
                stencil_bits: VIRTUAL_SHADOW,
                marks: (wgpu::StencilOperation::Keep, 0),
                targets: &[target(format, all)],
                constants: &constants,
            };
            usage.pipelines(device, &geometry, &module, gpu.depth_format, 1)
        };
        let over_all = |layout, fragment, constants: &[_], targets: &[_], depth_stencil| {
            shader::whole_picture(
                device,
                layout,
                &module,
                fragment,
                targets,
                Some(depth_stencil),
                constants,
            )
        };
        let depth_format = gpu.depth_format;
        let shadow_layout = layout("ambient light", &[None, None, None, Some(&ambient_layout)]);
        let shadow = |seen| {
            over_all(
                &shadow_layout,
                "shadow_on_virtual",
                &[("SEEN", seen)],
                &[target(PICTURE_FORMAT, all)],
                whole(depth_format, wgpu::CompareFunction::Less, None),
            )
        };
        Self {
            nothing: over_all(
                &shader::no_bindings(device),
                "nothing",
                &[],
                &[target(PICTURE_FORMAT, none), target(PICTURE_FORMAT, all)],
                whole(
                    depth_format,
                    wgpu::CompareFunction::Always,
                    Some(wgpu::StencilOperation::Zero),
                ),
            ),
            depth_of_real: surface("place_alone", "depth_alone", &constants, none),
            light_on_virtual: lit(IN_OPEN_LIGHT),
            light_at_terminator: lit(AT_TERMINATOR),
            ambient_on_virtual: surface(
                "place_in_ambient_light",
                "ambient_on_virtual",
                &constants,
                all,
            ),
            volumes: Volumes::new(device, &geometry, depth_format, 1, &[PICTURE_FORMAT]),
            hidden_on_real: hidden("hidden_on_real", PICTURE_FORMAT),
            gain_on_real: hidden("gain_on_real", GAIN_FORMAT),
            shadow_on_virtual: [shadow(IN_OPEN_LIGHT), shadow(AT_TERMINATOR)],
            ambient_group: device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("ambient light"),
                layout: &ambient_layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&ambient),
                }],
            }),
            ambient,
            depth_stencil: texture(
                "depth and stencil",
                depth_format,
                wgpu::TextureUsages::empty(),
            ),
        }
    }
}

/// What a triangle over the whole picture does with depth and stencil: draw where the stencil says so, or empty both by an
/// operation.
fn whole(
    format: wgpu::TextureFormat,
    stencil: wgpu::CompareFunction,
    empties: Option<wgpu::StencilOperation>,
) -> wgpu::DepthStencilState {
    let face = wgpu::StencilFaceState {
        compare: stencil,
        pass_op: empties.unwrap_or(wgpu::StencilOperation::Keep),
        ..Default::default()
    };
    wgpu::DepthStencilState {
        format,
        depth_write_enabled: Some(empties.is_some()),
        depth_compare: Some(wgpu::CompareFunction::Always),
        stencil: wgpu::StencilState {
            front: face,
            back: face,
            read_mask: SHADOW,
            write_mask: if empties.is_some() { u32::MAX } else { 0 },
        },
        bias: wgpu::DepthBiasState::default(),
    }
}
