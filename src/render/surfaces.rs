//! Draws real and virtual surfaces: depth and ambient light first, then each light where the stencil is 0.
//! Reads the stencil. Writes depth, `before` and `after` (see surfaces.wgsl).

use super::anchor_geometry::{CORNER_LAYOUT, INDIRECT_LAYOUT, Role};
use super::shader;

/// Format of `before` and `after`.
pub(super) const LIGHT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Pipelines of the pass, for real and virtual surfaces each.
pub(super) struct Surfaces {
    ambient_on_real: wgpu::RenderPipeline,
    ambient_on_virtual: wgpu::RenderPipeline,
    light_before: wgpu::RenderPipeline,
    light_after_on_real: wgpu::RenderPipeline,
    light_after_on_virtual: wgpu::RenderPipeline,
}

impl Surfaces {
    pub fn new(
        device: &wgpu::Device,
        layout: &wgpu::PipelineLayout,
        depth_format: wgpu::TextureFormat,
        samples: u32,
    ) -> Self {
        let module = shader::module(
            device,
            "surfaces",
            include_str!("../../shaders/surfaces.wgsl"),
        );
        let add = wgpu::BlendState {
            color: wgpu::BlendComponent {
                src_factor: wgpu::BlendFactor::One,
                dst_factor: wgpu::BlendFactor::One,
                operation: wgpu::BlendOperation::Add,
            },
            alpha: wgpu::BlendComponent {
                src_factor: wgpu::BlendFactor::One,
                dst_factor: wgpu::BlendFactor::One,
                operation: wgpu::BlendOperation::Add,
            },
        };
        let build = |entry_point: &str, ambient: bool, before: bool, after: bool| {
            let target = |written: bool| {
                Some(wgpu::ColorTargetState {
                    format: LIGHT_FORMAT,
                    blend: (!ambient).then_some(add),
                    write_mask: if written {
                        wgpu::ColorWrites::ALL
                    } else {
                        wgpu::ColorWrites::empty()
                    },
                })
            };
            let stencil = wgpu::StencilFaceState {
                compare: if ambient {
                    wgpu::CompareFunction::Always
                } else {
                    wgpu::CompareFunction::Equal
                },
                ..Default::default()
            };
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry_point),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("place"),
                    compilation_options: Default::default(),
                    buffers: &[Some(CORNER_LAYOUT), Some(INDIRECT_LAYOUT)],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: depth_format,
                    depth_write_enabled: Some(ambient),
                    depth_compare: Some(if ambient {
                        wgpu::CompareFunction::Greater
                    } else {
                        wgpu::CompareFunction::Equal
                    }),
                    stencil: wgpu::StencilState {
                        front: stencil,
                        back: stencil,
                        read_mask: 0xff,
                        write_mask: 0,
                    },
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState {
                    count: samples,
                    ..Default::default()
                },
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets: &[target(before), target(after)],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        Self {
            ambient_on_real: build("ambient_on_real", true, true, true),
            ambient_on_virtual: build("ambient_on_virtual", true, true, true),
            light_before: build("light_on_real", false, true, false),
            light_after_on_real: build("light_on_real", false, false, true),
            light_after_on_virtual: build("light_on_virtual", false, false, true),
        }
    }

    /// Depth and ambient light.
    pub fn ambient(&self, role: Role) -> &wgpu::RenderPipeline {
        match role {
            Role::Real => &self.ambient_on_real,
            Role::Virtual => &self.ambient_on_virtual,
        }
    }

    /// A light on real surfaces as if there were no virtual things.
    pub fn light_before(&self) -> &wgpu::RenderPipeline {
        &self.light_before
    }

    /// A light past real and virtual casters.
    pub fn light_after(&self, role: Role) -> &wgpu::RenderPipeline {
        match role {
            Role::Real => &self.light_after_on_real,
            Role::Virtual => &self.light_after_on_virtual,
        }
    }
}
