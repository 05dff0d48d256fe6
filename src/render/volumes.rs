//! Counts, per sample, the shadow volumes that the visible surface lies in (depth-fail stencil; Everitt & Kilgard
//! 2002; the passes are those of Haller, Drab & Hartmann 2003, section 3.2).
//! Reads depth. Writes the stencil.

use glam::Vec4;

use crate::geometry::shadow_volume::{Caster, LightPlace};

use super::shader;

/// The pipeline that counts.
pub(super) fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    depth_format: wgpu::TextureFormat,
    samples: u32,
    color_formats: &[wgpu::TextureFormat],
) -> wgpu::RenderPipeline {
    let module = shader::module(
        device,
        "volumes",
        include_str!("../../shaders/volumes.wgsl"),
    );
    let face = |depth_fail_op| wgpu::StencilFaceState {
        compare: wgpu::CompareFunction::Always,
        fail_op: wgpu::StencilOperation::Keep,
        depth_fail_op,
        pass_op: wgpu::StencilOperation::Keep,
    };
    let untouched: Vec<_> = color_formats
        .iter()
        .map(|&format| {
            Some(wgpu::ColorTargetState {
                format,
                blend: None,
                write_mask: wgpu::ColorWrites::empty(),
            })
        })
        .collect();
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("volumes"),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("place"),
            compilation_options: Default::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Vec4>() as u64,
                step_mode: wgpu::VertexStepMode::Vertex,
                attributes: &wgpu::vertex_attr_array![0 => Float32x4],
            })],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: Some(wgpu::DepthStencilState {
            format: depth_format,
            depth_write_enabled: Some(false),
            // Strict: a lit surface lies at the very depth of its own cap, which then counts as beyond it and
            // cancels the volume's far side. No bias is needed, and none is right.
            depth_compare: Some(wgpu::CompareFunction::Greater),
            stencil: wgpu::StencilState {
                front: face(wgpu::StencilOperation::DecrementWrap),
                back: face(wgpu::StencilOperation::IncrementWrap),
                read_mask: 0xff,
                write_mask: 0xff,
            },
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: samples,
            ..Default::default()
        },
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("count"),
            compilation_options: Default::default(),
            targets: &untouched,
        }),
        multiview_mask: None,
        cache: None,
    })
}

/// The shadow volume of one caster and one light on the GPU, kept while the two stand still to each other.
#[derive(Default)]
pub(super) struct VolumeBuffers {
    light: Option<LightPlace>,
    vertices: Option<wgpu::Buffer>,
    indices: Option<wgpu::Buffer>,
    index_count: u32,
}

impl VolumeBuffers {
    /// Makes the volume anew if the light has moved in the caster's space.
    pub fn update(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        caster: &Caster,
        light: LightPlace,
    ) {
        if self.light == Some(light) {
            return;
        }
        let (vertices, indices) = (caster.volume_vertices(light), caster.volume_indices(light));
        upload(
            device,
            queue,
            &mut self.vertices,
            wgpu::BufferUsages::VERTEX,
            bytemuck::cast_slice(&vertices),
        );
        upload(
            device,
            queue,
            &mut self.indices,
            wgpu::BufferUsages::INDEX,
            bytemuck::cast_slice(&indices),
        );
        self.index_count = indices.len() as u32;
        self.light = Some(light);
    }

    /// Draws the volume with whatever pipeline and view are set.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        if let (Some(vertices), Some(indices)) = (&self.vertices, &self.indices) {
            pass.set_vertex_buffer(0, vertices.slice(..));
            pass.set_index_buffer(indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..self.index_count, 0, 0..1);
        }
    }
}

/// Writes into the buffer, after making a larger one if it is too small.
fn upload(
    device: &wgpu::Device,
    queue: &wgpu::Queue,
    buffer: &mut Option<wgpu::Buffer>,
    usage: wgpu::BufferUsages,
    contents: &[u8],
) {
    let size = contents.len().max(4) as u64;
    if buffer.as_ref().is_none_or(|buffer| buffer.size() < size) {
        *buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("shadow volume"),
            size: size.next_power_of_two(),
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        }));
    }
    if let Some(buffer) = buffer {
        queue.write_buffer(buffer, 0, contents);
    }
}
