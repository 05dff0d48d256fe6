//! Pictures of display values in linear light, with ever coarser levels, for what mirrors them.
//! Reads a picture, and where something virtual is seen. Writes a linear picture's levels.

use super::attachments::cleared;
use super::gpu::Gpu;
use super::mirroring::REFLECTIONS_FORMAT;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, texels};

/// Levels of a picture, the finest among them.
const LEVELS: u32 = 7;

const PICTURE_GROUP: GroupLayout = GroupLayout {
    label: "picture",
    entries: &[texels(0, false)],
};

const REAL_PART_GROUP: GroupLayout = GroupLayout {
    label: "real part of the picture",
    entries: &[texels(0, false), texels(1, false)],
};

/// A picture in linear light.
pub(super) struct LinearPicture {
    pub view: wgpu::TextureView,
    levels: Vec<wgpu::TextureView>,
}

/// What makes them.
pub(super) struct LinearPictures {
    whole: wgpu::RenderPipeline,
    real: wgpu::RenderPipeline,
    halve: wgpu::RenderPipeline,
}

impl LinearPictures {
    pub fn new(gpu: &Gpu) -> Self {
        let fullscreen = |shader, fragment, group| {
            gpu.pipeline(&PipelineDescription {
                shader,
                fragment,
                groups: vec![Some(group)],
                targets: vec![overwritten(REFLECTIONS_FORMAT)],
                ..Default::default()
            })
        };
        Self {
            whole: fullscreen("linear_picture.wgsl", "linear", PICTURE_GROUP),
            real: fullscreen("linear_picture.wgsl", "linear_real", REAL_PART_GROUP),
            halve: fullscreen("shaft_mips.wgsl", "halve", PICTURE_GROUP),
        }
    }

    /// Takes a picture as it is.
    pub fn take(
        &self,
        gpu: &Gpu,
        passes: &mut Passes<'_>,
        picture: &wgpu::TextureView,
        to: &LinearPicture,
    ) {
        let picture = wgpu::BindingResource::TextureView(picture);
        let group = gpu.bind_group(&PICTURE_GROUP, [picture]);
        self.draw(gpu, passes, (&self.whole, group), to);
    }

    /// Takes that part of it which is not virtual (`depths` of reflections.wgsl say what is).
    pub fn take_real(
        &self,
        gpu: &Gpu,
        passes: &mut Passes<'_>,
        [picture, depths]: [&wgpu::TextureView; 2],
        to: &LinearPicture,
    ) {
        let textures = [picture, depths].map(wgpu::BindingResource::TextureView);
        let group = gpu.bind_group(&REAL_PART_GROUP, textures);
        self.draw(gpu, passes, (&self.real, group), to);
    }

    /// Draws the finest level, and the coarser ones from it.
    fn draw(
        &self,
        gpu: &Gpu,
        passes: &mut Passes<'_>,
        finest: (&wgpu::RenderPipeline, wgpu::BindGroup),
        to: &LinearPicture,
    ) {
        let mut drawn = finest;
        for level in &to.levels {
            let (pipeline, group) = drawn;
            let mut pass = passes.begin("linear picture", None, &[cleared(level)], None);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
            drop(pass);
            let finer = wgpu::BindingResource::TextureView(level);
            drawn = (&self.halve, gpu.bind_group(&PICTURE_GROUP, [finer]));
        }
    }
}

impl LinearPicture {
    /// As large as the picture at least, so that each level has half as many texels as the finer one.
    pub fn new(device: &wgpu::Device, label: &str, [width, height]: [u32; 2]) -> Self {
        let coarsest = 1 << (LEVELS - 1);
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: width.next_multiple_of(coarsest),
                height: height.next_multiple_of(coarsest),
                depth_or_array_layers: 1,
            },
            mip_level_count: LEVELS,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: REFLECTIONS_FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let level = |level| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            })
        };
        Self {
            view: texture.create_view(&Default::default()),
            levels: (0..texture.mip_level_count()).map(level).collect(),
        }
    }
}
