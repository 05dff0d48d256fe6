//! Layers for tests and tools, one sample at each pixel's centre: role, depth and shadow bits of the visible surface.
//! Same vertices, same volumes and same counting as the picture. Reads nothing. Writes textures of its own.

use super::anchor_geometry::{CORNER_LAYOUT, Role};
use super::gpu::{Gpu, RenderError};
use super::readback::Readback;
use super::shader;
use super::stencil::{COUNT, MOST_LAYERS, SHADOW};
use super::surfaces::Sided;
use super::volumes::Volumes;

const ROLE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
const BITS_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R8Unorm;

/// Role of a pixel that shows a real thing.
pub const REAL: u8 = 100;
/// Role of a pixel that shows a virtual thing.
pub const VIRTUAL: u8 = 200;
/// Bit of a shadow layer: a real thing hides the light.
pub const REAL_HIDES: u8 = 1;
/// Bit of a shadow layer: a virtual thing hides the light.
pub const VIRTUAL_HIDES: u8 = 2;

/// What is seen at each pixel's centre, rows from the top.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Layers {
    /// 0 none, [`REAL`] or [`VIRTUAL`].
    pub role: Vec<u8>,
    /// Distance along the camera's axis, metres; 0 where there is nothing.
    pub depth_m: Vec<f32>,
    /// For each light [`REAL_HIDES`] and [`VIRTUAL_HIDES`].
    pub shadow: Vec<Vec<u8>>,
    /// Factor on the real part of the pixel's light, linear RGB.
    pub gain: Vec<[f32; 3]>,
}

/// Pipelines and textures of the layers.
pub(super) struct LayerPasses {
    real: Sided,
    seeming: Sided,
    volumes: Volumes,
    mark_real: wgpu::RenderPipeline,
    mark_virtual: wgpu::RenderPipeline,
    /// Where the count is the stencil's reference, and where a batch was kept apart from it.
    mark_counted: [wgpu::RenderPipeline; 2],
    role: wgpu::Texture,
    depth_m: wgpu::Texture,
    bits: wgpu::Texture,
    depth_stencil: wgpu::TextureView,
    role_readback: Readback,
    depth_readback: Readback,
    bits_readback: Readback,
}

/// Draws all surfaces of a role into the pass by a pipeline.
pub(super) type DrawSurfaces<'a> = &'a dyn Fn(&mut wgpu::RenderPass<'_>, &Sided, Role);
/// Counts all volumes of a role's casters for one light.
pub(super) type CountVolumes<'a> = &'a dyn Fn(&mut wgpu::RenderPass<'_>, &Volumes, Role);

impl LayerPasses {
    pub fn new(gpu: &Gpu, layout: &wgpu::PipelineLayout, size_px: [u32; 2]) -> Self {
        let device = &gpu.device;
        let module = shader::module(device, "layers", include_str!("../../shaders/layers.wgsl"));
        let texture = |label, format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d {
                    width: size_px[0],
                    height: size_px[1],
                    depth_or_array_layers: 1,
                },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
                view_formats: &[],
            })
        };
        let copied = wgpu::TextureUsages::COPY_SRC;
        let surface = |entry_point: &str| {
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry_point),
                layout: Some(layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("place"),
                    compilation_options: Default::default(),
                    buffers: &[Some(CORNER_LAYOUT)],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: gpu.depth_format,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets: &[Some(ROLE_FORMAT.into()), Some(DEPTH_FORMAT.into())],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let no_bindings = shader::no_bindings(device);
        let mark = |entry_point: &str, compare, read_mask, src_factor| {
            let shadowed = wgpu::StencilFaceState {
                compare,
                ..Default::default()
            };
            let add = wgpu::BlendComponent {
                src_factor,
                dst_factor: wgpu::BlendFactor::One,
                operation: wgpu::BlendOperation::Add,
            };
            device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&no_bindings),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("whole_picture"),
                    compilation_options: Default::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: gpu.depth_format,
                    depth_write_enabled: Some(false),
                    depth_compare: Some(wgpu::CompareFunction::Always),
                    stencil: wgpu::StencilState {
                        front: shadowed,
                        back: shadowed,
                        read_mask,
                        write_mask: 0,
                    },
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    targets: &[Some(wgpu::ColorTargetState {
                        format: BITS_FORMAT,
                        blend: Some(wgpu::BlendState {
                            color: add,
                            alpha: add,
                        }),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            })
        };
        let in_shadow = |entry_point| {
            let (differs, one) = (wgpu::CompareFunction::NotEqual, wgpu::BlendFactor::One);
            mark(entry_point, differs, SHADOW, one)
        };
        Self {
            real: Sided::both(surface("real")),
            seeming: Sided::both(surface("virtual_thing")),
            volumes: Volumes::new(device, layout, gpu.depth_format, 1, &[BITS_FORMAT]),
            mark_real: in_shadow("in_real_shadow"),
            mark_virtual: in_shadow("in_virtual_shadow"),
            mark_counted: [
                (wgpu::CompareFunction::Equal, COUNT),
                (wgpu::CompareFunction::NotEqual, SHADOW & !COUNT),
            ]
            .map(|(compare, mask)| mark("counted", compare, mask, wgpu::BlendFactor::Constant)),
            depth_stencil: texture(
                "layer depth and stencil",
                gpu.depth_format,
                wgpu::TextureUsages::empty(),
            )
            .create_view(&Default::default()),
            role: texture("role layer", ROLE_FORMAT, copied),
            depth_m: texture("depth layer", DEPTH_FORMAT, copied),
            bits: texture("shadow layer", BITS_FORMAT, copied),
            role_readback: Readback::new(device, size_px, 1),
            depth_readback: Readback::new(device, size_px, 4),
            bits_readback: Readback::new(device, size_px, 1),
        }
    }

    /// Role and depth of the visible surfaces; the depth buffer stays for [`LayerPasses::shadow`].
    pub fn role_and_depth(
        &self,
        gpu: &Gpu,
        draw_surfaces: DrawSurfaces<'_>,
    ) -> Result<(Vec<u8>, Vec<f32>), RenderError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let (role, depth_m) = (
            self.role.create_view(&Default::default()),
            self.depth_m.create_view(&Default::default()),
        );
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("role and depth layers"),
            color_attachments: &[Some(cleared(&role)), Some(cleared(&depth_m))],
            depth_stencil_attachment: Some(self.depth_stencil(wgpu::LoadOp::Clear(0.0))),
            ..Default::default()
        });
        for (role, pipeline) in [(Role::Real, &self.real), (Role::Virtual, &self.seeming)] {
            draw_surfaces(&mut pass, pipeline, role);
        }
        drop(pass);
        self.role_readback.copy_from(&mut encoder, &self.role);
        self.depth_readback.copy_from(&mut encoder, &self.depth_m);
        gpu.queue.submit([encoder.finish()]);
        let depth_m = self.depth_readback.read(gpu)?;
        Ok((
            self.role_readback.read(gpu)?,
            bytemuck::pod_collect_to_vec(&depth_m),
        ))
    }

    /// The shadow bits of the light whose volumes `count_volumes` counts.
    pub fn shadow(
        &self,
        gpu: &Gpu,
        count_volumes: CountVolumes<'_>,
    ) -> Result<Vec<u8>, RenderError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let bits = self.bits.create_view(&Default::default());
        for (role, mark) in [
            (Role::Real, &self.mark_real),
            (Role::Virtual, &self.mark_virtual),
        ] {
            let mut color = cleared(&bits);
            if role == Role::Virtual {
                color.ops.load = wgpu::LoadOp::Load;
            }
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shadow layer"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(self.depth_stencil(wgpu::LoadOp::Load)),
                ..Default::default()
            });
            count_volumes(&mut pass, &self.volumes, role);
            pass.set_pipeline(mark);
            pass.set_stencil_reference(0);
            pass.draw(0..3, 0..1);
        }
        self.bits_readback.copy_from(&mut encoder, &self.bits);
        gpu.queue.submit([encoder.finish()]);
        self.bits_readback.read(gpu)
    }

    /// How many of the volumes that `count_volumes` counts the visible surfaces lie in; those that it counts apart from
    /// the rest are one.
    pub fn counts(
        &self,
        gpu: &Gpu,
        count_volumes: CountVolumes<'_>,
    ) -> Result<Vec<u8>, RenderError> {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        let counts = self.bits.create_view(&Default::default());
        for role in [Role::Real, Role::Virtual] {
            let mut color = cleared(&counts);
            if role == Role::Virtual {
                color.ops.load = wgpu::LoadOp::Load;
            }
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("stencil counts"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(self.depth_stencil(wgpu::LoadOp::Load)),
                ..Default::default()
            });
            count_volumes(&mut pass, &self.volumes, role);
            let [counted, kept] = &self.mark_counted;
            let mut mark = |pipeline, reference: u32, number: u32| {
                let number = f64::from(number) / 255.0;
                pass.set_pipeline(pipeline);
                pass.set_stencil_reference(reference);
                pass.set_blend_constant(wgpu::Color {
                    r: number,
                    g: number,
                    b: number,
                    a: number,
                });
                pass.draw(0..3, 0..1);
            };
            for number in 1..=MOST_LAYERS {
                mark(counted, number, number);
            }
            mark(kept, 0, 1);
        }
        self.bits_readback.copy_from(&mut encoder, &self.bits);
        gpu.queue.submit([encoder.finish()]);
        self.bits_readback.read(gpu)
    }

    /// The stencil starts at 0 in each pass.
    fn depth_stencil(
        &self,
        depth: wgpu::LoadOp<f32>,
    ) -> wgpu::RenderPassDepthStencilAttachment<'_> {
        wgpu::RenderPassDepthStencilAttachment {
            view: &self.depth_stencil,
            depth_ops: Some(wgpu::Operations {
                load: depth,
                store: wgpu::StoreOp::Store,
            }),
            stencil_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(0),
                store: wgpu::StoreOp::Discard,
            }),
        }
    }
}

fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            store: wgpu::StoreOp::Store,
        },
    }
}
