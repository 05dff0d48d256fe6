//! The sources' shadow maps: a tile each in one atlas, averaged in coarser levels.
//! Reads the casters' triangles and the sources. Writes the atlas.

use glam::{Mat4, Vec2, Vec3, Vec4};

use crate::shafts::selection::Representative;

use super::super::shader;
use super::data::{PLACE_LAYOUT, Source};

/// Whether there is a caster, how far off, and that squared.
const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Side of the largest atlas, pixels: 171 MiB with its levels and 64 of depth.
const LARGEST_ATLAS_PX: u32 = 4096;
/// Penumbras reach at most this many times the casters' size beyond their outline in a map.
const WIDEST_MARGIN: f32 = 2.0;

/// Tiles of one side in an atlas.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Tiling {
    pub tile_px: u32,
    columns: u32,
    rows: u32,
}

impl Tiling {
    /// Room for `count` tiles of `tile_px`, smaller ones where they would not fit.
    pub fn new(count: usize, tile_px: u32, largest_texture_px: u32) -> Self {
        let largest = LARGEST_ATLAS_PX.min(largest_texture_px);
        let count = count.max(1) as u32;
        let mut tile_px = tile_px.min(largest);
        while tile_px > 1 && (largest / tile_px).pow(2) < count {
            tile_px /= 2;
        }
        let columns = count.isqrt().max(count.div_ceil(largest / tile_px));
        let columns = columns.next_power_of_two().min(largest / tile_px);
        Self {
            tile_px,
            columns,
            rows: count.div_ceil(columns),
        }
    }

    fn size_px(&self) -> [u32; 2] {
        [self.columns * self.tile_px, self.rows * self.tile_px]
    }

    fn corner_px(&self, index: u32) -> [u32; 2] {
        [index % self.columns, index / self.columns].map(|place| place * self.tile_px)
    }

    /// Levels in which a tile has at least a texel.
    pub fn levels(&self) -> u32 {
        self.tile_px.ilog2() + 1
    }
}

/// A ball around all casters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    pub center: Vec3,
    pub radius: f32,
}

/// A source as the shaders read it; `None` where it lies among the casters. `reach_m` is how far behind the casters'
/// middle receivers can be.
pub(super) fn source(
    chosen: &Representative,
    casters: &Ball,
    reach_m: f32,
    intensity: Vec3,
    tiling: &Tiling,
    index: u32,
) -> Option<Source> {
    let way = casters.center - chosen.position;
    let distance = way.length();
    if distance <= casters.radius * 1.1 {
        return None;
    }
    let axis = way / distance;
    let across = chosen.spread.x_axis.x + chosen.spread.y_axis.y + chosen.spread.z_axis.z
        - axis.dot(chosen.spread * axis);
    let spread_m = (across.max(0.0) / 2.0).sqrt();
    // Two standard deviations of the widest penumbra, as it lies in the casters' plane.
    let margin = 2.0 * spread_m * reach_m / (distance + reach_m);
    let radius = casters.radius + margin.min(WIDEST_MARGIN * casters.radius);
    // The ball's outline is a little wider than the ball.
    let tangent = radius / (distance * distance - casters.radius * casters.radius).sqrt();
    let (right, down) = axis.any_orthonormal_pair();
    let row = |direction: Vec3| direction.extend(-direction.dot(chosen.position));
    let depth = row(axis);
    let [u, v] = [right, down].map(|direction| row(direction) / (2.0 * tangent) + depth * 0.5);
    let near_m = distance - casters.radius;
    let [width, height] = tiling.size_px().map(|side| side as f32);
    let [x, y] = tiling.corner_px(index).map(|place| place as f32);
    let side = tiling.tile_px as f32;
    Some(Source {
        map_from_world: Mat4::from_cols(u, v, Vec4::ZERO, depth).transpose(),
        position: chosen.position,
        spread_m,
        intensity,
        focal_texels: side / (2.0 * tangent),
        tile_corner: Vec2::new(x / width, y / height),
        tile_side: Vec2::new(side / width, side / height),
        near_m,
        range_m: 2.0 * casters.radius,
        tile_px: side,
        padding: 0.0,
    })
}

/// The atlas, and how it is drawn.
pub(super) struct Maps {
    tiling: Tiling,
    atlas: wgpu::Texture,
    depth: wgpu::TextureView,
    pub view: wgpu::TextureView,
    cast: wgpu::RenderPipeline,
    halve: wgpu::RenderPipeline,
    halve_layout: wgpu::BindGroupLayout,
    sources_layout: wgpu::BindGroupLayout,
}

impl Maps {
    pub fn new(device: &wgpu::Device, tiling: Tiling) -> Self {
        let sources_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("shaft maps"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::VERTEX,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only: true },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            }],
        });
        let halve_layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("shaft mips"),
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
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("shaft maps"),
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let module = shader::module(
            device,
            "shaft maps",
            include_str!("../../../shaders/shaft_maps.wgsl"),
        );
        let cast = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("shaft maps"),
            layout: Some(&layout(&[Some(&sources_layout)])),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("see"),
                compilation_options: Default::default(),
                buffers: &[Some(PLACE_LAYOUT)],
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH_FORMAT,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("seen"),
                compilation_options: Default::default(),
                targets: &[Some(MAP_FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let module = shader::module(
            device,
            "shaft mips",
            include_str!("../../../shaders/shaft_mips.wgsl"),
        );
        let halve = shader::whole_picture(
            device,
            &layout(&[Some(&halve_layout)]),
            &module,
            "halve",
            &[Some(MAP_FORMAT.into())],
            None,
            &[],
        );
        let (atlas, depth) = textures(device, &tiling);
        Self {
            tiling,
            view: atlas.create_view(&Default::default()),
            atlas,
            depth,
            cast,
            halve,
            halve_layout,
            sources_layout,
        }
    }

    /// Makes room for another tiling. Returns whether the atlas is a new one.
    pub fn resize(&mut self, device: &wgpu::Device, tiling: Tiling) -> bool {
        if self.tiling == tiling {
            return false;
        }
        self.tiling = tiling;
        (self.atlas, self.depth) = textures(device, &tiling);
        self.view = self.atlas.create_view(&Default::default());
        true
    }

    /// Draws the casters' triangles as each of `count` sources sees them.
    pub fn draw(
        &self,
        device: &wgpu::Device,
        encoder: &mut wgpu::CommandEncoder,
        sources: &wgpu::Buffer,
        count: u32,
        casters: (&wgpu::Buffer, u32),
    ) {
        let level = |level| {
            self.atlas.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            })
        };
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shaft maps"),
            layout: &self.sources_layout,
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: sources.as_entire_binding(),
            }],
        });
        let finest = level(0);
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shaft maps"),
            color_attachments: &[Some(cleared(&finest))],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.cast);
        pass.set_bind_group(0, &group, &[]);
        pass.set_vertex_buffer(0, casters.0.slice(..));
        let side = self.tiling.tile_px;
        for index in 0..count {
            let [x, y] = self.tiling.corner_px(index);
            pass.set_viewport(x as f32, y as f32, side as f32, side as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, side, side);
            pass.draw(0..casters.1, index..index + 1);
        }
        drop(pass);
        for coarser in 1..self.tiling.levels() {
            let finer = level(coarser - 1);
            let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some("shaft mips"),
                layout: &self.halve_layout,
                entries: &[wgpu::BindGroupEntry {
                    binding: 0,
                    resource: wgpu::BindingResource::TextureView(&finer),
                }],
            });
            let target = level(coarser);
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shaft mips"),
                color_attachments: &[Some(cleared(&target))],
                ..Default::default()
            });
            pass.set_pipeline(&self.halve);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
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

fn textures(device: &wgpu::Device, tiling: &Tiling) -> (wgpu::Texture, wgpu::TextureView) {
    let [width, height] = tiling.size_px();
    let texture = |label, format, levels, usage| {
        device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width,
                height,
                depth_or_array_layers: 1,
            },
            mip_level_count: levels,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | usage,
            view_formats: &[],
        })
    };
    let atlas = texture(
        "shaft maps",
        MAP_FORMAT,
        tiling.levels(),
        wgpu::TextureUsages::TEXTURE_BINDING,
    );
    let depth = texture(
        "shaft maps' depth",
        DEPTH_FORMAT,
        1,
        wgpu::TextureUsages::empty(),
    );
    (atlas, depth.create_view(&Default::default()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Mat3;

    #[test]
    fn tiles_lie_apart_within_the_atlas() {
        for count in [1, 2, 10, 50, 64, 65, 300, 1000, 4096] {
            let tiling = Tiling::new(count, 256, 16_384);
            let [width, height] = tiling.size_px();
            assert!(width.max(height) <= LARGEST_ATLAS_PX, "{tiling:?}");
            let corners: std::collections::HashSet<_> = (0..count as u32)
                .map(|index| tiling.corner_px(index))
                .collect();
            assert_eq!(corners.len(), count);
            for [x, y] in corners {
                assert!(x + tiling.tile_px <= width && y + tiling.tile_px <= height);
            }
            assert_eq!(tiling.tile_px == 256, count <= 256);
        }
    }

    #[test]
    fn casters_lie_within_their_tile_and_its_depths() {
        let chosen = Representative {
            first: 0,
            last: 1,
            position: Vec3::new(1.0, -2.0, 1.5),
            spread: Mat3::from_diagonal(Vec3::new(0.04, 0.01, 0.0)),
            weight: 1.0,
        };
        let casters = Ball {
            center: Vec3::new(0.1, 0.0, 0.05),
            radius: 0.2,
        };
        let tiling = Tiling::new(4, 128, 4096);
        let source = source(&chosen, &casters, 0.3, Vec3::ONE, &tiling, 3).expect("outside");
        for direction in crate::shafts::surfels::cell_directions() {
            let point = casters.center + direction * casters.radius;
            let placed = source.map_from_world * point.extend(1.0);
            let (u, v) = (placed.x / placed.w, placed.y / placed.w);
            assert!(
                (0.0..=1.0).contains(&u) && (0.0..=1.0).contains(&v),
                "{u} {v}"
            );
            let part = (placed.w - source.near_m) / source.range_m;
            assert!((-1e-5..=1.0 + 1e-5).contains(&part), "{part}");
        }
        let among = Representative {
            position: casters.center + Vec3::X * 0.15,
            ..chosen
        };
        assert!(super::source(&among, &casters, 0.3, Vec3::ONE, &tiling, 0).is_none());
    }
}
