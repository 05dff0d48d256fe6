//! Maps of casters as lights see them: a tile each in one atlas, averaged in coarser levels.
//! Reads the casters' triangles and how they are seen. Writes the atlas.

use std::ops::Range;

use glam::Vec3;

use crate::shafts::shadow_atlas::Tiling;

use super::attachments::{cleared, target};
use super::gpu::Gpu;
use super::passes::Passes;
use super::pipelines::{GroupLayout, PipelineDescription, overwritten, storage, texels};
use super::stencil::depth_stencil_state;

/// Format of the maps: whether there is a caster, how far off, and that squared.
const MAP_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// How each tile sees the casters.
const SOURCES_GROUP: GroupLayout = GroupLayout {
    label: "maps",
    entries: &[storage(0, wgpu::ShaderStages::VERTEX)],
};

/// Vertex layout of places alone.
const PLACE_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec3>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
};

/// The next finer level.
const FINER_GROUP: GroupLayout = GroupLayout {
    label: "map mips",
    entries: &[texels(0, false)],
};

/// Triangles that are drawn into a tile.
#[derive(Clone)]
pub(super) struct MapDraw {
    pub tile: u32,
    /// Number of how it sees them.
    pub seen_by: u32,
    /// Their corners.
    pub corners: Range<u32>,
}

/// The atlas, and how it is drawn.
pub(super) struct MapAtlas {
    tiling: Tiling,
    atlas: wgpu::Texture,
    depth: wgpu::TextureView,
    pub view: wgpu::TextureView,
    cast: wgpu::RenderPipeline,
    halve: wgpu::RenderPipeline,
}

impl MapAtlas {
    /// `shader` has `see` and `seen`: a caster's corner in the tile of an instance's number, and what is written there.
    pub fn new(gpu: &Gpu, tiling: Tiling, shader: &'static str) -> Self {
        let (atlas, depth) = textures(&gpu.device, &tiling);
        Self {
            tiling,
            view: atlas.create_view(&Default::default()),
            atlas,
            depth,
            cast: gpu.pipeline(&PipelineDescription {
                shader,
                vertex: "see",
                fragment: "seen",
                groups: vec![Some(SOURCES_GROUP)],
                vertex_buffers: vec![PLACE_LAYOUT],
                targets: vec![overwritten(MAP_FORMAT)],
                depth_stencil: Some(depth_stencil_state(
                    DEPTH_FORMAT,
                    true,
                    wgpu::CompareFunction::Less,
                    wgpu::StencilState::default(),
                )),
                ..Default::default()
            }),
            halve: gpu.pipeline(&PipelineDescription {
                shader: "shaft_mips.wgsl",
                fragment: "halve",
                groups: vec![Some(FINER_GROUP)],
                targets: vec![overwritten(MAP_FORMAT)],
                ..Default::default()
            }),
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

    /// Draws the casters' triangles into tiles.
    pub fn draw(
        &self,
        gpu: &Gpu,
        passes: &mut Passes<'_>,
        seen_by: &wgpu::Buffer,
        casters: &wgpu::Buffer,
        draws: impl Iterator<Item = MapDraw>,
    ) {
        let level = |level| {
            self.atlas.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: level,
                mip_level_count: Some(1),
                ..Default::default()
            })
        };
        let finest = level(0);
        let depth = wgpu::RenderPassDepthStencilAttachment {
            view: &self.depth,
            depth_ops: Some(wgpu::Operations {
                load: wgpu::LoadOp::Clear(1.0),
                store: wgpu::StoreOp::Discard,
            }),
            stencil_ops: None,
        };
        let mut pass = passes.begin("maps", None, &[cleared(&finest)], Some(depth));
        let group = gpu.bind_group(&SOURCES_GROUP, [seen_by.as_entire_binding()]);
        pass.set_pipeline(&self.cast);
        pass.set_bind_group(0, &group, &[]);
        pass.set_vertex_buffer(0, casters.slice(..));
        let side = self.tiling.tile_px;
        for draw in draws {
            let [x, y] = self.tiling.corner_px(draw.tile);
            pass.set_viewport(x as f32, y as f32, side as f32, side as f32, 0.0, 1.0);
            pass.set_scissor_rect(x, y, side, side);
            pass.draw(draw.corners, draw.seen_by..draw.seen_by + 1);
        }
        drop(pass);
        for coarser in 1..self.tiling.levels() {
            let finer = level(coarser - 1);
            let finer = wgpu::BindingResource::TextureView(&finer);
            let group = gpu.bind_group(&FINER_GROUP, [finer]);
            let target = level(coarser);
            let mut pass = passes.begin("map mips", None, &[cleared(&target)], None);
            pass.set_pipeline(&self.halve);
            pass.set_bind_group(0, &group, &[]);
            pass.draw(0..3, 0..1);
        }
    }
}

fn textures(device: &wgpu::Device, tiling: &Tiling) -> (wgpu::Texture, wgpu::TextureView) {
    let [width, height] = tiling.size_px();
    let atlas = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("maps"),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: tiling.levels(),
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: MAP_FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    let unread = wgpu::TextureUsages::empty();
    let size_px = [width, height];
    let depth = target(device, "maps' depth", size_px, DEPTH_FORMAT, 1, unread);
    (atlas, depth)
}
