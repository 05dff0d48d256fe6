//! Layers for tests and tools, one sample at each pixel's centre: role, depth and shadow bits of the visible surface.
//! Same vertices, same volumes and same counting as the picture. Reads nothing. Writes textures of its own.

use super::anchor_geometry::{CORNER_LAYOUT, Role};
use super::attachments::{cleared, loaded, target, texture};
use super::error::RenderError;
use super::gpu::Gpu;
use super::passes::Passes;
use super::pipelines::{PipelineDescription, added, overwritten};
use super::readback::Readback;
use super::stencil::{COUNT, MOST_LAYERS, SHADOW, depth_stencil_state, stencil};
use super::surfaces::{Sided, surface_description};
use super::uniforms::GEOMETRY_GROUPS;
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

/// A picture's layers: what is seen at each pixel's centre, rows from the top.
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
    pub fn new(gpu: &Gpu, size_px: [u32; 2]) -> Self {
        let device = &gpu.device;
        let copied = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC;
        let texture = |label, format| texture(device, label, size_px, format, 1, copied);
        let surface = |fragment| Sided::both(gpu, &surface(gpu, fragment));
        let mark = |fragment, compare, read, factor| {
            gpu.pipeline(&mark(gpu, fragment, compare, read, factor))
        };
        let in_shadow = |fragment| {
            let (differs, one) = (wgpu::CompareFunction::NotEqual, wgpu::BlendFactor::One);
            mark(fragment, differs, SHADOW, one)
        };
        Self {
            real: surface("real"),
            seeming: surface("virtual_thing"),
            volumes: Volumes::new(gpu, &GEOMETRY_GROUPS, 1, &[BITS_FORMAT]),
            mark_real: in_shadow("in_real_shadow"),
            mark_virtual: in_shadow("in_virtual_shadow"),
            mark_counted: [
                (wgpu::CompareFunction::Equal, COUNT),
                (wgpu::CompareFunction::NotEqual, SHADOW & !COUNT),
            ]
            .map(|(compare, read)| mark("counted", compare, read, wgpu::BlendFactor::Constant)),
            depth_stencil: target(
                device,
                "layer depth and stencil",
                size_px,
                gpu.depth_format,
                1,
                wgpu::TextureUsages::empty(),
            ),
            role: texture("role layer", ROLE_FORMAT),
            depth_m: texture("depth layer", DEPTH_FORMAT),
            bits: texture("shadow layer", BITS_FORMAT),
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
        let mut passes = Passes::new(gpu, None);
        let (role, depth_m) = (
            self.role.create_view(&Default::default()),
            self.depth_m.create_view(&Default::default()),
        );
        let mut pass = passes.begin(
            "role and depth layers",
            None,
            &[cleared(&role), cleared(&depth_m)],
            Some(self.depth_stencil(wgpu::LoadOp::Clear(0.0))),
        );
        for (role, pipeline) in [(Role::Real, &self.real), (Role::Virtual, &self.seeming)] {
            draw_surfaces(&mut pass, pipeline, role);
        }
        drop(pass);
        self.role_readback
            .copy_from(&mut passes.encoder, &self.role);
        self.depth_readback
            .copy_from(&mut passes.encoder, &self.depth_m);
        gpu.queue.submit([passes.encoder.finish()]);
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
        self.bits(gpu, "shadow layer", count_volumes, &|pass, role| {
            pass.set_pipeline(match role {
                Role::Real => &self.mark_real,
                Role::Virtual => &self.mark_virtual,
            });
            pass.set_stencil_reference(0);
            pass.draw(0..3, 0..1);
        })
    }

    /// How many of the volumes that `count_volumes` counts the visible surfaces lie in; those that it counts apart from
    /// the rest are one.
    pub fn counts(
        &self,
        gpu: &Gpu,
        count_volumes: CountVolumes<'_>,
    ) -> Result<Vec<u8>, RenderError> {
        let [counted, kept] = &self.mark_counted;
        self.bits(gpu, "stencil counts", count_volumes, &|pass, _| {
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
        })
    }

    /// What `mark` draws after each role's volumes are counted.
    fn bits(
        &self,
        gpu: &Gpu,
        name: &'static str,
        count_volumes: CountVolumes<'_>,
        mark: &dyn Fn(&mut wgpu::RenderPass<'_>, Role),
    ) -> Result<Vec<u8>, RenderError> {
        let mut passes = Passes::new(gpu, None);
        let bits = self.bits.create_view(&Default::default());
        for role in [Role::Real, Role::Virtual] {
            let color = match role {
                Role::Real => cleared(&bits),
                Role::Virtual => loaded(&bits, wgpu::LoadOp::Load),
            };
            let depth_stencil = self.depth_stencil(wgpu::LoadOp::Load);
            let mut pass = passes.begin(name, None, &[color], Some(depth_stencil));
            count_volumes(&mut pass, &self.volumes, role);
            mark(&mut pass, role);
        }
        self.bits_readback
            .copy_from(&mut passes.encoder, &self.bits);
        gpu.queue.submit([passes.encoder.finish()]);
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

/// Role and depth of surfaces.
fn surface(gpu: &Gpu, fragment: &'static str) -> PipelineDescription {
    PipelineDescription {
        shader: "layers.wgsl",
        vertex: "place",
        fragment,
        groups: GEOMETRY_GROUPS.map(Some).to_vec(),
        vertex_buffers: vec![CORNER_LAYOUT],
        targets: vec![overwritten(ROLE_FORMAT), overwritten(DEPTH_FORMAT)],
        ..surface_description(gpu, None)
    }
}

/// What is added to the bits where the stencil says so.
fn mark(
    gpu: &Gpu,
    fragment: &'static str,
    compare: wgpu::CompareFunction,
    read: u32,
    factor: wgpu::BlendFactor,
) -> PipelineDescription {
    PipelineDescription {
        shader: "layers.wgsl",
        fragment,
        targets: vec![added(BITS_FORMAT, factor)],
        depth_stencil: Some(depth_stencil_state(
            gpu.depth_format,
            false,
            wgpu::CompareFunction::Always,
            stencil(compare, read, (wgpu::StencilOperation::Keep, 0)),
        )),
        ..Default::default()
    }
}
