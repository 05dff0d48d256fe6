//! Puts what lets light through over the picture, layer by layer, the farthest first: its surface as thick as it is opaque, and
//! its shadow as deep as it is opaque on the average.
//!
//! A layer is drawn twice as if it were opaque, whatever the technique: its shadow alone, and it with its shadow. Of both as
//! much is taken as there is of it, in linear light (Porter & Duff 1984, "over"). That is what many small opaque grains would
//! give that cover so much of it.
//! Reads the pictures and the opacity. Writes the picture that is shown.

use super::anchor_geometry::Role;
use super::attachments::{cleared, depth_stencil, target, texture};
use super::background::PICTURE_FORMAT;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels, uniform};
use super::surfaces::{Sided, surface_description};
use super::uniforms::GEOMETRY_GROUPS;
use crate::geometry::reach::PixelRect;

const OPACITY_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg8Unorm;

/// The pictures, the opacity, and how much the layer takes.
const LAYER_GROUP: GroupLayout = GroupLayout {
    label: "translucent layer",
    entries: &[
        texels(0, false),
        texels(1, false),
        texels(2, false),
        texels(3, false),
        texels(4, false),
        uniform(5, wgpu::ShaderStages::FRAGMENT, false),
    ],
};

/// Pipelines and pictures of the passes.
pub(super) struct Translucent {
    of_real: Sided,
    of_virtual: Sided,
    over: wgpu::RenderPipeline,
    group: wgpu::BindGroup,
    layer: wgpu::Buffer,
    /// All that is opaque.
    alone: wgpu::Texture,
    /// The same with the layers so far.
    before: wgpu::Texture,
    /// All that is opaque in the shadow of the layer at hand.
    in_shadow: wgpu::Texture,
    mixed: wgpu::Texture,
    opacity: wgpu::TextureView,
    depth_stencil: wgpu::TextureView,
}

impl Translucent {
    /// For the picture that is shown, of a scene whose virtual things are drawn as `kinds` says.
    pub fn new(gpu: &Gpu, gpu_scene: &GpuScene, picture: &wgpu::Texture) -> Self {
        let device = &gpu.device;
        let size_px = [picture.width(), picture.height()];
        let usage = wgpu::TextureUsages::COPY_DST
            | wgpu::TextureUsages::COPY_SRC
            | wgpu::TextureUsages::TEXTURE_BINDING
            | wgpu::TextureUsages::RENDER_ATTACHMENT;
        let kept = |label| texture(device, label, size_px, PICTURE_FORMAT, 1, usage);
        let [alone, before] = ["opaque alone", "before the layer"].map(kept);
        let [in_shadow, mixed] = ["in the layer's shadow", "with the layer"].map(kept);
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let opacity = target(device, "opacity", size_px, OPACITY_FORMAT, 1, read);
        let none = wgpu::TextureUsages::empty();
        let layer = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("layer"),
            size: 16,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let pictures = [&alone, &before, &in_shadow, picture];
        let views = pictures.map(|texture| texture.create_view(&Default::default()));
        let views = views.iter().chain([&opacity]);
        let resources = views.map(wgpu::BindingResource::TextureView);
        let of_virtual = gpu_scene
            .kinds
            .of_virtual(surface(gpu, "opacity_of_virtual"));
        Self {
            of_real: Sided::both(gpu, &surface(gpu, "opaque")),
            of_virtual: Sided::both(gpu, &of_virtual),
            over: gpu.pipeline(&PipelineDescription {
                shader: "translucent.wgsl",
                fragment: "over",
                groups: vec![Some(LAYER_GROUP)],
                targets: vec![overwritten(PICTURE_FORMAT)],
                ..Default::default()
            }),
            group: gpu.bind_group(&LAYER_GROUP, resources.chain([layer.as_entire_binding()])),
            depth_stencil: target(
                device,
                "opacity's depth and stencil",
                size_px,
                gpu.depth_format,
                1,
                none,
            ),
            layer,
            alone,
            before,
            in_shadow,
            mixed,
            opacity,
        }
    }

    /// Takes the picture as it is without any layer.
    pub fn begin(&self, gpu: &Gpu, picture: &wgpu::Texture) {
        copy(gpu, picture, &[&self.alone, &self.before]);
    }

    /// Takes the picture as it is in the shadow of the layer at hand.
    pub fn keep_shadow(&self, gpu: &Gpu, picture: &wgpu::Texture) {
        copy(gpu, picture, &[&self.in_shadow]);
    }

    /// Adds the layer that takes `opacity` of the light on the average and stands in the picture, and alone of all layers in
    /// `gpu_scene`.
    pub fn add(&self, gpu: &Gpu, gpu_scene: &GpuScene, opacity: f64) {
        let uniform = [opacity as f32, 0.0, 0.0, 0.0];
        gpu.queue
            .write_buffer(&self.layer, 0, bytemuck::cast_slice(&uniform));
        let mut passes = Passes::new(gpu, None);
        let mut pass = passes.begin(
            "opacity",
            None,
            &[cleared(&self.opacity)],
            Some(depth_stencil(&self.depth_stencil, true, true)),
        );
        let size = self.alone.size();
        let whole = PixelRect::whole([size.width, size.height]);
        for (role, pipelines) in [
            (Role::Real, &self.of_real),
            (Role::Virtual, &self.of_virtual),
        ] {
            gpu_scene.draw_surfaces(&mut pass, pipelines, role, DrawnLight::Whole(0), whole);
        }
        drop(pass);
        let mixed = self.mixed.create_view(&Default::default());
        let mut pass = passes.begin("translucent", None, &[cleared(&mixed)], None);
        pass.set_pipeline(&self.over);
        pass.set_bind_group(0, &self.group, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        gpu.queue.submit([passes.encoder.finish()]);
        copy(gpu, &self.mixed, &[&self.before]);
    }

    /// Puts the layers into the picture.
    pub fn finish(&self, gpu: &Gpu, picture: &wgpu::Texture) {
        copy(gpu, &self.before, &[picture]);
    }
}

/// Opacity of surfaces, and depth.
fn surface(gpu: &Gpu, fragment: &'static str) -> PipelineDescription {
    PipelineDescription {
        shader: "translucent.wgsl",
        vertex: "place",
        fragment,
        groups: GEOMETRY_GROUPS.map(Some).to_vec(),
        targets: vec![overwritten(OPACITY_FORMAT)],
        ..surface_description(gpu, None)
    }
}

fn copy(gpu: &Gpu, from: &wgpu::Texture, to: &[&wgpu::Texture]) {
    let mut encoder = gpu.device.create_command_encoder(&Default::default());
    for to in to {
        encoder.copy_texture_to_texture(from.as_image_copy(), to.as_image_copy(), from.size());
    }
    gpu.queue.submit([encoder.finish()]);
}
