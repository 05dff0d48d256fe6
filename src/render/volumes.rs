//! Counts, per sample, the shadow volumes that the visible surface lies in (depth-pass and depth-fail stencil; Everitt
//! & Kilgard 2002; the passes are those of Haller, Drab & Hartmann 2003, section 3.2).
//! Reads depth. Writes the stencil (stencil.rs).

use std::ops::Range;

use glam::Vec4;

use crate::geometry::counting::Counting;
use crate::geometry::reach::PixelRect;
use crate::geometry::shadow_volume::{Caster, Casting, LightPlace, Silhouette};

use super::anchor_geometry::Role;
use super::gpu::Gpu;
use super::insides::Insides;
use super::pipelines::{GroupLayout, PipelineDescription, untouched};
use super::stencil::{self, COUNT, MOST_LAYERS, REAL_HIDES, depth_stencil_state};

/// The surfaces on which volumes are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Among {
    /// On all surfaces.
    All,
    /// Where no real thing hides the light already.
    LitByReal,
}

/// The pipelines that count, and those that keep what a batch has counted.
pub(super) struct Volumes {
    among_all: Counters,
    among_lit: Counters,
    keep_real: wgpu::RenderPipeline,
    keep_virtual: wgpu::RenderPipeline,
    forget: wgpu::RenderPipeline,
}

struct Counters {
    /// Sides in front of the surface.
    depth_pass: wgpu::RenderPipeline,
    /// Sides behind it.
    depth_fail: wgpu::RenderPipeline,
    /// Caps behind it: as they are wound, and turned over.
    caps: [Caps; 2],
}

struct Caps {
    /// Where the camera may see either side of them.
    seen: wgpu::RenderPipeline,
    /// Where the caster is a solid that the camera sees from outside: the caps that face it,
    facing: wgpu::RenderPipeline,
    /// and those that do not. They lie behind what is seen, whatever rounding makes of their depth along the rim, where
    /// the surface draws its outside alone.
    back_facing: wgpu::RenderPipeline,
    /// These where holes may show them.
    back_facing_seen: wgpu::RenderPipeline,
}

/// Vertex layout of volumes' corners.
const VOLUME_CORNER_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vec4>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x4],
};

/// Strict: a lit surface lies at the very depth of its own cap, which then counts as not in front. No bias is needed, and
/// none is right.
const IN_FRONT: wgpu::CompareFunction = wgpu::CompareFunction::Greater;

impl Counters {
    /// `counting` is all that they have in common.
    fn new(gpu: &Gpu, counting: &PipelineDescription, among: Among) -> Self {
        let counter = |depth_compare, cull_mode, stencil| {
            gpu.pipeline(&PipelineDescription {
                depth_stencil: Some(depth_stencil_state(
                    gpu.depth_format,
                    false,
                    depth_compare,
                    stencil,
                )),
                cull_mode,
                ..counting.clone()
            })
        };
        let caps = |turned| {
            let cap = |compare, cull_mode| {
                counter(
                    compare,
                    cull_mode,
                    count(among, Counting::DepthFail, turned),
                )
            };
            let (back, front) = (Some(wgpu::Face::Back), Some(wgpu::Face::Front));
            Caps {
                seen: cap(IN_FRONT, None),
                facing: cap(IN_FRONT, back),
                back_facing: cap(wgpu::CompareFunction::Never, front),
                back_facing_seen: cap(IN_FRONT, front),
            }
        };
        let sides = |counting| counter(IN_FRONT, None, count(among, counting, false));
        Self {
            depth_pass: sides(Counting::DepthPass),
            depth_fail: sides(Counting::DepthFail),
            caps: [false, true].map(caps),
        }
    }

    fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        groups: [&wgpu::BindGroup; 2],
        counted: &CountedVolume<'_>,
        part: &DrawnPart,
    ) {
        pass.set_stencil_reference(0);
        set_scissor(pass, counted.scissor);
        let ([view_group, light_group], [of_sides, of_caps]) = (groups, counted.views);
        pass.set_bind_group(0, view_group, &[of_sides]);
        pass.set_bind_group(1, light_group, &[counted.light]);
        pass.set_vertex_buffer(0, counted.vertices.slice(..));
        let [sides, outward, turned] = part.ends;
        match counted.counting {
            Counting::DepthPass => {
                pass.set_pipeline(&self.depth_pass);
                part.indices.draw(pass, 0..sides);
            }
            Counting::DepthFail => {
                pass.set_pipeline(&self.depth_fail);
                part.indices.draw(pass, 0..sides);
                pass.set_bind_group(0, view_group, &[of_caps]);
                let ranges = [sides..outward, outward..turned];
                for (caps, range) in self.caps.iter().zip(ranges) {
                    caps.draw(pass, counted, &part.indices, range);
                }
            }
        }
    }
}

impl Caps {
    fn draw(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        counted: &CountedVolume<'_>,
        indices: &IndexBuffer,
        range: Range<u32>,
    ) {
        let mut draw = |pipeline, pixels: PixelRect| {
            if !pixels.is_empty() {
                set_scissor(pass, pixels);
                pass.set_pipeline(pipeline);
                indices.draw(pass, range.clone());
            }
        };
        let all = counted.scissor;
        match counted.insides {
            Insides::Anywhere => draw(&self.seen, all),
            Insides::Unseen => {
                draw(&self.facing, all);
                draw(&self.back_facing, all);
            }
            Insides::Within(pixels) => {
                draw(&self.facing, all);
                draw(&self.back_facing_seen, all.intersection(pixels));
                for beside in all.without(pixels) {
                    draw(&self.back_facing, beside);
                }
                set_scissor(pass, all);
            }
        }
    }
}

/// What sides of volumes do to the stencil, those in front of the surface or those that are not; `turned` ones are wound the
/// other way.
fn count(among: Among, counting: Counting, turned: bool) -> wgpu::StencilState {
    // Counts what lies in front or what does not: entering and leaving change sides.
    let face = |in_front, otherwise| wgpu::StencilFaceState {
        compare: match among {
            Among::All => wgpu::CompareFunction::Always,
            Among::LitByReal => wgpu::CompareFunction::Equal,
        },
        fail_op: wgpu::StencilOperation::Keep,
        pass_op: match counting {
            Counting::DepthPass => in_front,
            Counting::DepthFail => wgpu::StencilOperation::Keep,
        },
        depth_fail_op: match counting {
            Counting::DepthPass => wgpu::StencilOperation::Keep,
            Counting::DepthFail => otherwise,
        },
    };
    let mut more = wgpu::StencilOperation::IncrementWrap;
    let mut less = wgpu::StencilOperation::DecrementWrap;
    if turned {
        std::mem::swap(&mut more, &mut less);
    }
    wgpu::StencilState {
        front: face(more, less),
        back: face(less, more),
        read_mask: REAL_HIDES,
        write_mask: COUNT,
    }
}

/// One volume of a batch, as it is to be drawn.
pub(super) struct CountedVolume<'a> {
    pub volume: &'a Volume,
    pub counting: Counting,
    /// Where the camera may see the caster's inside.
    pub insides: Insides,
    /// Pixels outside which it cannot matter.
    pub scissor: PixelRect,
    /// Dynamic offsets of the view of its sides, as things stand, and of that of its caps, which is its surface's own
    /// ([`AnchorView::winning_ties`](super::uniforms::AnchorView::winning_ties)): seen edge-on, a cap of other depths would
    /// lie before the surface here and there.
    pub views: [u32; 2],
    /// Dynamic offset of the light in its anchor.
    pub light: u32,
    pub vertices: &'a wgpu::Buffer,
}

impl Volumes {
    /// `groups` are those of the passes that volumes are drawn in; the first two are theirs.
    pub fn new(
        gpu: &Gpu,
        groups: &[GroupLayout],
        samples: u32,
        color_formats: &[wgpu::TextureFormat],
    ) -> Self {
        let common = PipelineDescription {
            shader: "volumes.wgsl",
            fragment: "count",
            targets: color_formats.iter().copied().map(untouched).collect(),
            samples,
            ..Default::default()
        };
        let counting = PipelineDescription {
            vertex: "place",
            groups: groups.iter().copied().map(Some).collect(),
            vertex_buffers: vec![VOLUME_CORNER_LAYOUT],
            ..common.clone()
        };
        let keep = |role| {
            let counted = (
                wgpu::StencilOperation::Replace,
                COUNT | stencil::hides(role),
            );
            gpu.pipeline(&PipelineDescription {
                depth_stencil: Some(depth_stencil_state(
                    gpu.depth_format,
                    false,
                    wgpu::CompareFunction::Always,
                    stencil::stencil(wgpu::CompareFunction::NotEqual, COUNT, counted),
                )),
                ..common.clone()
            })
        };
        let always = wgpu::CompareFunction::Always;
        let zero = (wgpu::StencilOperation::Zero, u32::MAX);
        let forget = gpu.pipeline(&PipelineDescription {
            depth_stencil: Some(depth_stencil_state(
                gpu.depth_format,
                false,
                always,
                stencil::stencil(always, u32::MAX, zero),
            )),
            ..common.clone()
        });
        Self {
            among_all: Counters::new(gpu, &counting, Among::All),
            among_lit: Counters::new(gpu, &counting, Among::LitByReal),
            keep_real: keep(Role::Real),
            keep_virtual: keep(Role::Virtual),
            forget,
        }
    }

    /// Counts the volumes of one role's casters, whose bits start at 0. Returns whether anything was counted.
    pub fn count<'a>(
        &self,
        pass: &mut wgpu::RenderPass<'_>,
        among: Among,
        role: Role,
        groups: [&wgpu::BindGroup; 2],
        within: PixelRect,
        counted: impl Iterator<Item = CountedVolume<'a>>,
    ) -> PixelRect {
        let counters = match among {
            Among::All => &self.among_all,
            Among::LitByReal => &self.among_lit,
        };
        let counted: Vec<CountedVolume<'_>> = counted.collect();
        let has_parts = |counted: &&CountedVolume<'_>| !counted.volume.parts.is_empty();
        let scissors = counted.iter().filter(has_parts).map(|it| it.scissor);
        let reached = scissors.fold(PixelRect::NONE, PixelRect::union);
        let mut layers = 0;
        // What is counted apart comes first, so that the rest is left as a number.
        for apart in [true, false] {
            for counted in &counted {
                let parts = counted.volume.parts.iter();
                for part in parts.filter(|part| part.counted_apart == apart) {
                    if layers + part.layers > MOST_LAYERS {
                        self.keep(pass, role, reached);
                        layers = 0;
                    }
                    layers += part.layers;
                    counters.draw(pass, groups, counted, part);
                }
            }
            if apart && layers > 0 {
                self.keep(pass, role, reached);
                layers = 0;
            }
        }
        set_scissor(pass, within);
        reached
    }

    /// Leaves a stencil of zeros.
    pub fn forget(&self, pass: &mut wgpu::RenderPass<'_>, within: PixelRect) {
        pass.set_pipeline(&self.forget);
        set_scissor(pass, within);
        pass.draw(0..3, 0..1);
    }

    /// Makes the role's own bit of what was counted, and leaves the count at 0.
    pub fn keep(&self, pass: &mut wgpu::RenderPass<'_>, role: Role, within: PixelRect) {
        pass.set_pipeline(match role {
            Role::Real => &self.keep_real,
            Role::Virtual => &self.keep_virtual,
        });
        set_scissor(pass, within);
        pass.set_stencil_reference(stencil::hides(role));
        pass.draw(0..3, 0..1);
    }
}

/// Keeps a pass to a rectangle.
pub(super) fn set_scissor(pass: &mut wgpu::RenderPass<'_>, rect: PixelRect) {
    let [x, y] = rect.low;
    pass.set_scissor_rect(x, y, rect.high[0] - x, rect.high[1] - y);
}

/// The shadow volume of one caster and one light, kept while the two stand still to each other.
#[derive(Default)]
pub(super) struct Volume {
    made_for: Option<MadeFor>,
    parts: Vec<DrawnPart>,
}

/// All that a volume depends on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MadeFor {
    /// The caster's level of detail.
    pub level: usize,
    /// In the caster's space.
    pub light: LightPlace,
    pub casting: Casting,
}

/// Volumes that never lie more than [`MOST_LAYERS`] deep one in another.
struct DrawnPart {
    silhouette: Silhouette,
    layers: u32,
    counted_apart: bool,
    /// Triangles of the sides, then those of the caps where they are needed, the turned ones last.
    indices: IndexBuffer,
    /// Where in the indices the sides end, the caps, and the turned caps.
    ends: [u32; 3],
    has_caps: bool,
}

impl Volume {
    /// Is to be made anew: its caster has another shape.
    pub fn forget(&mut self) {
        self.made_for = None;
    }

    /// Makes anew what has changed.
    pub fn update(&mut self, gpu: &Gpu, caster: &Caster, made_for: MadeFor, counting: Counting) {
        let changed = self.made_for != Some(made_for);
        if changed {
            let MadeFor { light, casting, .. } = made_for;
            let mut buffers: Vec<IndexBuffer> =
                self.parts.drain(..).map(|part| part.indices).collect();
            self.parts = caster
                .parts(light, casting, MOST_LAYERS)
                .into_iter()
                .map(|part| DrawnPart {
                    silhouette: part.silhouette,
                    layers: part.layers,
                    counted_apart: part.counted_apart,
                    indices: buffers.pop().unwrap_or_default(),
                    ends: [0; 3],
                    has_caps: false,
                })
                .collect();
            self.made_for = Some(made_for);
        }
        let needs_caps = counting == Counting::DepthFail;
        for part in &mut self.parts {
            if changed || (needs_caps && !part.has_caps) {
                let mut indices = caster.side_indices(&part.silhouette);
                part.ends = [indices.len() as u32; 3];
                if needs_caps {
                    let [outward, turned] = caster.cap_indices(&part.silhouette);
                    indices.extend(outward);
                    part.ends[1] = indices.len() as u32;
                    indices.extend(turned);
                    part.ends[2] = indices.len() as u32;
                }
                part.has_caps = needs_caps;
                part.indices.write(&gpu.device, &gpu.queue, &indices);
            }
        }
    }
}

/// Indices that change, in a buffer that grows.
#[derive(Default)]
pub(super) struct IndexBuffer {
    buffer: Option<wgpu::Buffer>,
    count: u32,
}

impl IndexBuffer {
    /// How many there are.
    pub fn count(&self) -> u32 {
        self.count
    }

    pub fn write(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, indices: &[u32]) {
        let contents: &[u8] = bytemuck::cast_slice(indices);
        let size = contents.len() as u64;
        self.count = indices.len() as u32;
        if indices.is_empty() {
            return;
        }
        if self
            .buffer
            .as_ref()
            .is_none_or(|buffer| buffer.size() < size)
        {
            self.buffer = Some(device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("shadow volume"),
                size: size.next_power_of_two(),
                usage: wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }));
        }
        if let Some(buffer) = &self.buffer {
            queue.write_buffer(buffer, 0, contents);
        }
    }

    /// Draws some of the indices with whatever pipeline, view and vertices are set.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, range: Range<u32>) {
        if let (Some(buffer), false) = (&self.buffer, range.is_empty()) {
            pass.set_index_buffer(buffer.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(range, 0, 0..1);
        }
    }
}
