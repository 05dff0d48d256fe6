//! The sources' shadow maps: a tile each in one atlas, averaged in coarser levels.
//! Reads the casters' triangles and the sources. Writes the atlas.

use crate::shafts::shadow_atlas::Tiling;

use super::super::shader;
use super::data::PLACE_LAYOUT;

/// Whether there is a caster, how far off, and that squared.
const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
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
