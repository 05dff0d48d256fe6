//! Materials of things on the GPU, with their pictures. Reads the scene. Writes the group that materials.wgsl reads.
//!
//! Pictures lie in stacks whose layers have one size, three for sRGB and three for numbers: so surfaces of all materials are
//! drawn in one go, as they are without pictures.

use bytemuck::{Pod, Zeroable};
use glam::DVec4;

use super::gpu::Gpu;
use super::pipelines::{GroupLayout, filtered_array, sampler, storage};
use crate::light::material::{Coverage, Encoding, Filter, Map, Material, Shading, Wrap};
use crate::light::srgb::{linear_from_srgb, srgb_from_linear};
use crate::light::texture::Texture;
use crate::scene::Object;

/// Group 3 of every shader that includes materials.wgsl.
pub(super) const MATERIALS_GROUP: GroupLayout = GroupLayout {
    label: "materials",
    entries: &[
        storage(0, wgpu::ShaderStages::FRAGMENT),
        filtered_array(1),
        filtered_array(2),
        filtered_array(3),
        filtered_array(4),
        filtered_array(5),
        filtered_array(6),
        sampler(7),
        sampler(8),
    ],
};

/// Stacks of each encoding, by the longest side of their pictures, texels.
const STACKS_PX: [u32; 3] = [256, 1024, u32::MAX];
/// What has less opacity than this is not drawn, of what is half transparent.
const CLEAR: f32 = 0.004;

/// How a picture lies on a surface: the twin of `MapOnGpu` in materials.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct MapOnGpu {
    pub linear: [f32; 4],
    pub offset: [f32; 2],
    pub place: u32,
    pub size: u32,
}

/// A material: the twin of `MaterialOnGpu` in materials.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub(super) struct MaterialOnGpu {
    pub albedo: [f32; 3],
    pub roughness: f32,
    pub emission: [f32; 3],
    pub metallic: f32,
    pub opacity: f32,
    pub cutoff: f32,
    pub normal_scale: f32,
    pub occlusion_strength: f32,
    pub shading: u32,
    pub translucent: u32,
    pub padding_2: u32,
    pub padding_3: u32,
    pub maps: [MapOnGpu; 6],
}

/// Whether a thing's corners need more than a colour and a roughness.
pub(super) fn needs_looks(object: &Object) -> bool {
    !object.mesh.looks.is_empty() || object.materials.iter().any(|material| !material.is_plain())
}

/// The group of all materials of some things, in their order.
pub(super) fn materials_group<'a>(
    gpu: &Gpu,
    things: impl IntoIterator<Item = &'a Object>,
) -> wgpu::BindGroup {
    let mut stacks: [[Stack<'_>; 3]; 2] = Default::default();
    let mut materials: Vec<MaterialOnGpu> = Vec::new();
    for object in things {
        for material in &object.materials {
            materials.push(on_gpu(material, object, &mut stacks));
        }
    }
    let [srgb, linear] = &stacks;
    let views: Vec<wgpu::TextureView> = [(srgb, Encoding::Srgb), (linear, Encoding::Linear)]
        .into_iter()
        .flat_map(|(stacks, encoding)| stacks.iter().map(move |stack| (stack, encoding)))
        .map(|(stack, encoding)| stack.on_gpu(gpu, encoding))
        .collect();
    if materials.is_empty() {
        materials.push(MaterialOnGpu::zeroed());
    }
    let buffer = gpu.buffer(
        "materials",
        bytemuck::cast_slice(&materials),
        wgpu::BufferUsages::STORAGE,
    );
    let samplers = [wgpu::AddressMode::Repeat, wgpu::AddressMode::ClampToEdge].map(|mode| {
        gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("pictures"),
            address_mode_u: mode,
            address_mode_v: mode,
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        })
    });
    let pictures = views.iter().map(wgpu::BindingResource::TextureView);
    let samplers = samplers.iter().map(wgpu::BindingResource::Sampler);
    let resources = std::iter::once(buffer.as_entire_binding());
    gpu.bind_group(&MATERIALS_GROUP, resources.chain(pictures).chain(samplers))
}

fn on_gpu<'a>(
    material: &Material,
    object: &'a Object,
    stacks: &mut [[Stack<'a>; 3]; 2],
) -> MaterialOnGpu {
    let maps = &material.maps;
    let mut map = |map: Option<Map>, encoding: Encoding| {
        let texture = map.and_then(|map| Some((map, object.textures.get(map.texture as usize)?)));
        texture.map_or(MapOnGpu::zeroed(), |(map, texture)| {
            let of_encoding = &mut stacks[usize::from(encoding == Encoding::Linear)];
            let longest = texture.size_px[0].max(texture.size_px[1]);
            let number = STACKS_PX
                .iter()
                .position(|&most| longest <= most)
                .unwrap_or(2);
            let layer = of_encoding[number].layer(texture);
            placed(&map, texture, number as u32, layer)
        })
    };
    MaterialOnGpu {
        albedo: material.albedo.as_vec3().to_array(),
        roughness: material.layer_roughness().unwrap_or(0.0) as f32,
        emission: material.emission.as_vec3().to_array(),
        metallic: material.metallic as f32,
        opacity: match material.coverage {
            Coverage::Opaque => 1.0,
            Coverage::Mask { .. } | Coverage::Blend => material.opacity as f32,
        },
        cutoff: match material.coverage {
            Coverage::Opaque => -1.0,
            Coverage::Mask { cutoff } => cutoff as f32,
            Coverage::Blend => CLEAR,
        },
        normal_scale: maps.normal_scale as f32,
        occlusion_strength: maps.occlusion_strength as f32,
        shading: match material.shading {
            Shading::Lit => 0,
            Shading::Unlit => 1,
            Shading::Principled => 2,
        },
        translucent: u32::from(material.coverage == Coverage::Blend),
        maps: [
            map(maps.color, Encoding::Srgb),
            map(maps.emission, Encoding::Srgb),
            map(maps.roughness, Encoding::Linear),
            map(maps.metallic, Encoding::Linear),
            map(maps.normal, Encoding::Linear),
            map(maps.occlusion, Encoding::Linear),
        ],
        ..MaterialOnGpu::zeroed()
    }
}

fn placed(map: &Map, texture: &Texture, stack: u32, layer: u32) -> MapOnGpu {
    let [u, v] = map.wrap.map(|wrap| match wrap {
        Wrap::Repeat => 0,
        Wrap::Clamp => 1,
        Wrap::Mirror => 2,
    });
    let squares = u32::from(map.filter == Filter::Pixels);
    let transform = map.picture_from_corner;
    MapOnGpu {
        linear: transform.matrix2.to_cols_array(),
        offset: transform.translation.to_array(),
        place: 1
            | stack << 1
            | (map.uv_set & 1) << 3
            | u << 4
            | v << 6
            | squares << 8
            | layer << 16,
        size: texture.size_px[0] | texture.size_px[1] << 16,
    }
}

/// Pictures of one size.
#[derive(Default)]
struct Stack<'a> {
    pictures: Vec<&'a Texture>,
}

impl<'a> Stack<'a> {
    /// The layer of a picture.
    fn layer(&mut self, texture: &'a Texture) -> u32 {
        let known = self
            .pictures
            .iter()
            .position(|known| std::ptr::eq(*known, texture));
        let layer = known.unwrap_or_else(|| {
            self.pictures.push(texture);
            self.pictures.len() - 1
        });
        layer as u32
    }

    fn on_gpu(&self, gpu: &Gpu, encoding: Encoding) -> wgpu::TextureView {
        let limits = gpu.device.limits();
        let side = |axis: usize| {
            let longest = self
                .pictures
                .iter()
                .map(|picture| picture.size_px[axis])
                .max();
            let side = longest.unwrap_or(1).next_power_of_two();
            side.min(limits.max_texture_dimension_2d)
        };
        let size_px = [side(0), side(1)];
        let layers = self.pictures.len().max(1) as u32;
        let levels = size_px[0].max(size_px[1]).ilog2() + 1;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("pictures"),
            size: wgpu::Extent3d {
                width: size_px[0],
                height: size_px[1],
                depth_or_array_layers: layers.min(limits.max_texture_array_layers),
            },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: match encoding {
                Encoding::Srgb => wgpu::TextureFormat::Rgba8UnormSrgb,
                Encoding::Linear => wgpu::TextureFormat::Rgba8Unorm,
            },
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let there = self
            .pictures
            .iter()
            .take(limits.max_texture_array_layers as usize);
        for (layer, picture) in (0..).zip(there) {
            let mut level = Level::of(picture, size_px, encoding);
            for number in 0..levels {
                if number > 0 {
                    level = level.halved();
                }
                write(gpu, &texture, (layer, number), &level, encoding);
            }
        }
        texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        })
    }
}

/// A picture in linear numbers, in one of its sizes.
struct Level {
    size_px: [u32; 2],
    texels: Vec<[f32; 4]>,
}

impl Level {
    /// A picture stretched to a size.
    fn of(picture: &Texture, size_px: [u32; 2], encoding: Encoding) -> Self {
        let of_byte: Vec<f32> = (0..=255)
            .map(|byte| match encoding {
                Encoding::Srgb => linear_from_srgb(f64::from(byte) / 255.0) as f32,
                Encoding::Linear => byte as f32 / 255.0,
            })
            .collect();
        let texels = match picture.size_px == size_px {
            true => picture
                .rgba
                .as_chunks::<4>()
                .0
                .iter()
                .map(|&[r, g, b, a]| {
                    let [r, g, b] = [r, g, b].map(|byte| of_byte[usize::from(byte)]);
                    [r, g, b, f32::from(a) / 255.0]
                })
                .collect(),
            false => stretched(picture, size_px, encoding),
        };
        Self { size_px, texels }
    }

    /// Half as large along each side that is longer than 1; colours count by their opacity.
    fn halved(&self) -> Self {
        let [width, height] = self.size_px;
        let size_px = [(width / 2).max(1), (height / 2).max(1)];
        let mut texels = Vec::with_capacity((size_px[0] * size_px[1]) as usize);
        for row in 0..size_px[1] {
            for column in 0..size_px[0] {
                let (mut sum, mut plain, mut opacity) = ([0.0; 3], [0.0; 3], 0.0);
                for (down, right) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
                    let at = [
                        (2 * column + right).min(width - 1),
                        (2 * row + down).min(height - 1),
                    ];
                    let [r, g, b, a] = self.texels[(at[1] * width + at[0]) as usize];
                    for (channel, value) in [r, g, b].into_iter().enumerate() {
                        sum[channel] += value * a;
                        plain[channel] += value / 4.0;
                    }
                    opacity += a;
                }
                let [r, g, b] = match opacity > 0.0 {
                    true => sum.map(|channel| channel / opacity),
                    false => plain,
                };
                texels.push([r, g, b, opacity / 4.0]);
            }
        }
        Self { size_px, texels }
    }
}

/// A picture of another size, from the texels around each place. Layers of a stack differ by few sizes, so little is lost.
fn stretched(picture: &Texture, size_px: [u32; 2], encoding: Encoding) -> Vec<[f32; 4]> {
    let map = Map {
        wrap: [Wrap::Clamp; 2],
        ..Map::of(0)
    };
    let place = |index: u32, count: u32| (index as f32 + 0.5) / count as f32;
    (0..size_px[1])
        .flat_map(|row| (0..size_px[0]).map(move |column| [column, row]))
        .map(|[column, row]| {
            let uv = glam::Vec2::new(place(column, size_px[0]), place(row, size_px[1]));
            let texel: DVec4 = picture.sample(&map, uv, encoding);
            texel.as_vec4().to_array()
        })
        .collect()
}

fn write(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    (layer, number): (u32, u32),
    level: &Level,
    encoding: Encoding,
) {
    let byte = |value: f32| (value * 255.0 + 0.5) as u8;
    let encoded = |value: f32| match encoding {
        Encoding::Linear => byte(value),
        Encoding::Srgb => byte(srgb_from_linear(f64::from(value)) as f32),
    };
    let bytes: Vec<u8> = level
        .texels
        .iter()
        .flat_map(|&[r, g, b, a]| [encoded(r), encoded(g), encoded(b), byte(a)])
        .collect();
    let [width, height] = level.size_px;
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: number,
            origin: wgpu::Origin3d {
                z: layer,
                ..wgpu::Origin3d::ZERO
            },
            aspect: wgpu::TextureAspect::All,
        },
        &bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * width),
            rows_per_image: Some(height),
        },
        wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
    );
}
