//! Puts what lets light through over the picture, layer by layer, the farthest first: its surface as thick as it is opaque, and
//! its shadow as deep as it is opaque where the brightest light passes it; what it hides of other light goes by its mean.
//!
//! A layer is drawn twice as if it were opaque, whatever the technique: its shadow alone, and it with its shadow. Of both as
//! much is taken as there is of it, in linear light (Porter & Duff 1984, "over"). That is what many small opaque grains would
//! give that cover so much of it.
//! Reads the pictures and the opacity. Writes the picture that is shown.

use std::sync::Arc;

use glam::{DMat4, Mat4};

use super::anchor_geometry::Role;
use super::attachments::{cleared, depth_stencil, target, texture};
use super::background::PICTURE_FORMAT;
use super::gpu::Gpu;
use super::gpu_scene::{DrawnLight, GpuScene};
use super::opacity_map::{OpacityMap, SIDE};
use super::passes::Passes;
use super::pipelines::{
    GroupLayout, PipelineDescription, filtered, overwritten, sampler, texels, uniform,
};
use super::surfaces::{Sided, surface_description};
use super::uniforms::{GEOMETRY_GROUPS, LayerOpacity};
use crate::geometry::reach::PixelRect;

const OPACITY_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rg8Unorm;
const PLACES_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The pictures, the opacity, how much the layer takes, and where surfaces are.
const LAYER_GROUP: GroupLayout = GroupLayout {
    label: "translucent layer",
    entries: &[
        texels(0, false),
        texels(1, false),
        texels(2, false),
        texels(3, false),
        texels(4, false),
        uniform(5, wgpu::ShaderStages::FRAGMENT, false),
        texels(6, false),
        filtered(7),
        sampler(8),
    ],
};

/// What a layer takes of the light.
pub(super) struct SeenOpacity {
    /// On the average.
    pub mean: f64,
    /// As the brightest light sees it, and how that leads there from the camera's space.
    pub by_place: Option<(Arc<OpacityMap>, DMat4)>,
}

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
    /// Places of opaque surfaces in the camera's space.
    places: wgpu::TextureView,
    places_of: [Sided; 2],
    opacity_map: wgpu::Texture,
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
            size: size_of::<LayerOpacity>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let places = target(device, "places", size_px, PLACES_FORMAT, 1, read);
        let written = read | wgpu::TextureUsages::COPY_DST;
        let map_px = [SIDE as u32; 2];
        let opacity_map = texture(device, "opacity map", map_px, OPACITY_FORMAT, 1, written);
        let map_view = opacity_map.create_view(&Default::default());
        let map_sampler = gpu.linear_sampler("opacity map");
        let pictures = [&alone, &before, &in_shadow, picture];
        let views = pictures.map(|texture| texture.create_view(&Default::default()));
        let views = views.iter().chain([&opacity]);
        let resources = views.map(wgpu::BindingResource::TextureView);
        let of_virtual =
            |fragment, format| gpu_scene.kinds.of_virtual(surface(gpu, fragment, format));
        let place_of_virtual = of_virtual("place_of_surface", PLACES_FORMAT);
        let place_of_real = surface(gpu, "place_of_surface", PLACES_FORMAT);
        let of_virtual = of_virtual("opacity_of_virtual", OPACITY_FORMAT);
        Self {
            places_of: [&place_of_real, &place_of_virtual].map(|it| Sided::both(gpu, it)),
            of_real: Sided::both(gpu, &surface(gpu, "opaque", OPACITY_FORMAT)),
            of_virtual: Sided::both(gpu, &of_virtual),
            over: gpu.pipeline(&PipelineDescription {
                shader: "translucent.wgsl",
                fragment: "over",
                groups: vec![Some(LAYER_GROUP)],
                targets: vec![overwritten(PICTURE_FORMAT)],
                ..Default::default()
            }),
            group: gpu.bind_group(
                &LAYER_GROUP,
                resources.chain([
                    layer.as_entire_binding(),
                    wgpu::BindingResource::TextureView(&places),
                    wgpu::BindingResource::TextureView(&map_view),
                    wgpu::BindingResource::Sampler(&map_sampler),
                ]),
            ),
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
            places,
            opacity_map,
        }
    }

    /// Takes the picture as it is without any layer, and where its surfaces are.
    pub fn begin(&self, gpu: &Gpu, gpu_scene: &GpuScene, picture: &wgpu::Texture) {
        copy(gpu, picture, &[&self.alone, &self.before]);
        let mut passes = Passes::new(gpu, None);
        let [of_real, of_virtual] = &self.places_of;
        self.draw_surfaces(
            &mut passes,
            gpu_scene,
            ("places", &self.places),
            [of_real, of_virtual],
        );
        gpu.queue.submit([passes.encoder.finish()]);
    }

    /// Draws all surfaces of a frame into a target, real ones and virtual ones by their pipelines.
    fn draw_surfaces(
        &self,
        passes: &mut Passes<'_>,
        gpu_scene: &GpuScene,
        (name, target): (&'static str, &wgpu::TextureView),
        [of_real, of_virtual]: [&Sided; 2],
    ) {
        let depth = Some(depth_stencil(&self.depth_stencil, true, true));
        let mut pass = passes.begin(name, None, &[cleared(target)], depth);
        let size = self.alone.size();
        let whole = PixelRect::whole([size.width, size.height]);
        for (role, pipelines) in [(Role::Real, of_real), (Role::Virtual, of_virtual)] {
            gpu_scene.draw_surfaces(&mut pass, pipelines, role, DrawnLight::Whole(0), whole);
        }
    }

    /// Takes the picture as it is in the shadow of the layer at hand.
    pub fn keep_shadow(&self, gpu: &Gpu, picture: &wgpu::Texture) {
        copy(gpu, picture, &[&self.in_shadow]);
    }

    /// Adds the layer that takes so much of the light and stands in the picture, and alone of all layers in `gpu_scene`.
    pub fn add(&self, gpu: &Gpu, gpu_scene: &GpuScene, opacity: &SeenOpacity) {
        let by_place = opacity.by_place.as_ref();
        let uniform = LayerOpacity {
            map_from_camera: by_place.map_or(Mat4::IDENTITY, |(_, map)| map.as_mat4()),
            mean: opacity.mean as f32,
            has_map: u32::from(by_place.is_some()),
            padding: [0; 2],
        };
        gpu.queue
            .write_buffer(&self.layer, 0, bytemuck::bytes_of(&uniform));
        if let Some((map, _)) = by_place {
            gpu.queue.write_texture(
                self.opacity_map.as_image_copy(),
                bytemuck::cast_slice(&map.texels),
                wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(2 * SIDE as u32),
                    rows_per_image: None,
                },
                self.opacity_map.size(),
            );
        }
        let mut passes = Passes::new(gpu, None);
        let pipelines = [&self.of_real, &self.of_virtual];
        self.draw_surfaces(
            &mut passes,
            gpu_scene,
            ("opacity", &self.opacity),
            pipelines,
        );
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

/// Something of surfaces, and depth.
fn surface(gpu: &Gpu, fragment: &'static str, format: wgpu::TextureFormat) -> PipelineDescription {
    PipelineDescription {
        shader: "translucent.wgsl",
        vertex: "place",
        fragment,
        groups: GEOMETRY_GROUPS.map(Some).to_vec(),
        targets: vec![overwritten(format)],
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
