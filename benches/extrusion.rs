//! Silhouettes and extrusion on the CPU (what the renderer does) against a vertex shader that does both on static
//! buffers: each edge is a quad that opens where one of its two triangles faces the light and the other does not
//! (Brennan 2002), each triangle a near and a far cap that close where it does not. Both count the same volumes into a
//! stencil, which is held equal: sides alone (depth-pass), and sides with caps (depth-fail).

mod common;

use std::collections::HashMap;
use std::path::PathBuf;
use std::time::Instant;

use anyhow::{Context, Result, ensure};
use bytemuck::{Pod, Zeroable};
use clap::Parser;
use glam::{DAffine3, DMat4, DVec3, Mat4, Vec3, Vec4};
use gnomon::geometry::counting::Counting;
use gnomon::geometry::mesh::Mesh;
use gnomon::geometry::shadow_volume::{Caster, Casting, LightPlace};
use wgpu::util::DeviceExt as _;

use common::{Csv, Times, at_least_one};
use gnomon::app::chart::peers_table::{
    LIGHT_M, SIZE_PX, TORUS_CENTER_M, WARM_UP_FRAMES, camera_from_world, intrinsics, torus, turn,
};

/// Times silhouettes and extrusion on the CPU and in a vertex shader.
#[derive(Parser)]
struct Options {
    /// Frames that count, after the warm-up
    #[arg(long, default_value = "40", value_parser = at_least_one)]
    frames: usize,
    /// Where to write the figures
    #[arg(long)]
    csv: Option<PathBuf>,
    /// What `cargo bench` adds
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<()> {
    let options = Options::parse();
    let lab = Lab::new()?;
    println!("{}", lab.adapter);
    let mut csv = Csv::new(
        options.csv,
        "triangles,counting,way,median_ms,p10_ms,p90_ms,make_ms,upload_ms,draw_ms",
    );
    println!(
        "{:>9} {:>10} {:>6} {:>9} {:>7} {:>7} {:>7} {:>7} {:>7}  pixels whose stencil differs",
        "triangles", "counting", "way", "median ms", "p10", "p90", "make", "upload", "draw"
    );
    for triangles in [100, 300, 1_000, 3_000, 10_000, 30_000, 100_000] {
        let mesh = torus(triangles, 1.0);
        let mut bout = Bout {
            on_cpu: OnCpu::new(&lab, &mesh),
            on_gpu: OnGpu::new(&lab, &mesh),
            lab: &lab,
        };
        for counting in [Counting::DepthPass, Counting::DepthFail] {
            let [by_cpu, by_vertex] = bout.time(counting, options.frames)?;
            let (differing, shadowed) = bout.compare(counting)?;
            let name = match counting {
                Counting::DepthPass => "depth-pass",
                Counting::DepthFail => "depth-fail",
            };
            for (way, times) in [("cpu", by_cpu), ("vertex", by_vertex)] {
                let triangles = mesh.triangles.len();
                let WayTimes {
                    whole,
                    make,
                    upload,
                    draw,
                } = times;
                println!(
                    "{triangles:9} {name:>10} {way:>6} {:9.2} {:7.2} {:7.2} {:7.2} {:7.2} {:7.2}  {differing} of {shadowed}",
                    whole.median_ms,
                    whole.p10_ms,
                    whole.p90_ms,
                    make.median_ms,
                    upload.median_ms,
                    draw.median_ms,
                );
                csv.row(&[
                    &triangles,
                    &name,
                    &way,
                    &whole.median_ms,
                    &whole.p10_ms,
                    &whole.p90_ms,
                    &make.median_ms,
                    &upload.median_ms,
                    &draw.median_ms,
                ]);
            }
            // Single precision may see an edge-on triangle the other way round; more than its sliver is a mistake.
            ensure!(
                shadowed > 0 && differing * 1_000 <= shadowed,
                "the two ways count differently: {differing} of {shadowed} shadowed pixels"
            );
        }
    }
    csv.finish()
}

/// The two ways with the same mesh.
struct Bout<'a> {
    lab: &'a Lab,
    on_cpu: OnCpu,
    on_gpu: OnGpu,
}

/// A frame of one way, and its parts.
struct WayTimes {
    whole: Times,
    make: Times,
    upload: Times,
    draw: Times,
}

impl Bout<'_> {
    /// The CPU's way, then the vertex shader's. They take turns, so that whatever else the machine does meets both.
    fn time(&mut self, counting: Counting, frames: usize) -> Result<[WayTimes; 2]> {
        let mut rows = [(); 2].map(|()| Vec::with_capacity(frames));
        for frame in 0..WARM_UP_FRAMES + frames {
            let moment = Moment::new(frame);
            let begun = Instant::now();
            let (made, uploaded) = self.on_cpu.make(self.lab, &moment, counting);
            self.lab
                .count(&moment, |pass| self.on_cpu.draw(self.lab, pass, counting))?;
            let drawn = Instant::now();
            self.lab
                .count(&moment, |pass| self.on_gpu.draw(self.lab, pass, counting))?;
            let drawn_by_vertex = Instant::now();
            if frame >= WARM_UP_FRAMES {
                rows[0].push([begun, made, uploaded, drawn]);
                rows[1].push([drawn, drawn, drawn, drawn_by_vertex]);
            }
        }
        Ok(rows.map(|rows| {
            let between = |from: usize, to: usize| {
                Times::of(
                    rows.iter()
                        .map(|row| 1e3 * (row[to] - row[from]).as_secs_f64())
                        .collect(),
                )
            };
            WayTimes {
                whole: between(0, 3),
                make: between(0, 1),
                upload: between(1, 2),
                draw: between(2, 3),
            }
        }))
    }

    /// In some frames: pixels that one way counts in shadow and the other not, and those that the CPU's counts so.
    fn compare(&mut self, counting: Counting) -> Result<(usize, usize)> {
        let (mut differing, mut shadowed) = (0, 0);
        for frame in (0..5).map(|turn| 7 * turn) {
            let moment = Moment::new(frame);
            self.on_cpu.make(self.lab, &moment, counting);
            self.lab
                .count(&moment, |pass| self.on_cpu.draw(self.lab, pass, counting))?;
            let by_cpu = self.lab.read_stencil()?;
            self.lab
                .count(&moment, |pass| self.on_gpu.draw(self.lab, pass, counting))?;
            let by_gpu = self.lab.read_stencil()?;
            shadowed += by_cpu.iter().filter(|&&count| count != 0).count();
            differing += by_cpu.iter().zip(&by_gpu).filter(|(a, b)| a != b).count();
        }
        Ok((differing, shadowed))
    }
}

/// Where caster and light are in a frame.
struct Moment {
    clip_from_world: Mat4,
    clip_from_caster: Mat4,
    light_in_caster: DVec3,
}

impl Moment {
    fn new(frame: usize) -> Self {
        let world_from_caster = DAffine3::from_mat3_translation(turn(frame), TORUS_CENTER_M);
        let clip_from = |camera_from_space: DAffine3| {
            intrinsics(SIZE_PX).clip_from_camera(1e-3) * DMat4::from(camera_from_space).as_mat4()
        };
        Self {
            clip_from_world: clip_from(camera_from_world()),
            clip_from_caster: clip_from(camera_from_world() * world_from_caster),
            light_in_caster: world_from_caster.inverse().transform_point3(LIGHT_M),
        }
    }
}

/// What the stencil can count to.
const MOST_LAYERS: u32 = 255;

const SHADER: &str = "
struct Place {
    clip_from_space: mat4x4f,
    light: vec4f,
}

@group(0) @binding(0) var<uniform> place: Place;

// w = 1: the mesh's own vertices; w = 0: to be cast to infinity.
@vertex
fn made(@location(0) point: vec4f) -> @builtin(position) vec4f {
    return near_or_far(point.xyz, point.w == 0.0);
}

fn near_or_far(point: vec3f, far: bool) -> vec4f {
    return place.clip_from_space * select(vec4f(point, 1.0), vec4f(point - place.light.xyz, 0.0), far);
}

// Where all corners of what does not cast fall together.
const NOWHERE = vec4f(0.0, 0.0, 0.0, 1.0);

// left runs from a to b, right from b to a; both are planes of triangles.
@vertex
fn side(
    @builtin(vertex_index) index: u32,
    @location(0) a: vec3f,
    @location(1) b: vec3f,
    @location(2) left: vec4f,
    @location(3) right: vec4f,
) -> @builtin(position) vec4f {
    let left_casts = dot(left, place.light) > 0.0;
    if left_casts == (dot(right, place.light) > 0.0) {
        return NOWHERE;
    }
    // Round the quad: to, from, from at infinity, to at infinity.
    let corner = index & 3u;
    let at_from = corner == 1u || corner == 2u;
    return near_or_far(select(b, a, at_from == left_casts), corner >= 2u);
}

@vertex
fn cap(@builtin(vertex_index) index: u32, @location(0) point: vec3f, @location(1) plane: vec4f) -> @builtin(position) vec4f {
    if dot(plane, place.light) <= 0.0 {
        return NOWHERE;
    }
    return near_or_far(point, index % 6u >= 3u);
}
";

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Place {
    clip_from_space: Mat4,
    light: Vec4,
}

/// The corners of the table's two triangles.
const TABLE_M: [(f32, f32); 6] = [
    (-0.4, -0.4),
    (0.4, -0.4),
    (0.4, 0.4),
    (-0.4, -0.4),
    (0.4, 0.4),
    (-0.4, 0.4),
];

/// What [`SHADER`]'s `made` reads.
const POINT: [wgpu::VertexAttribute; 1] = wgpu::vertex_attr_array![0 => Float32x4];
/// What its `side` reads.
const EDGE: [wgpu::VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4, 3 => Float32x4];
/// What its `cap` reads.
const CORNER: [wgpu::VertexAttribute; 2] = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x4];

/// The device, and a stencil that counts volumes over a table.
struct Lab {
    device: wgpu::Device,
    queue: wgpu::Queue,
    adapter: String,
    depth_stencil: wgpu::Texture,
    table: wgpu::Buffer,
    table_place: (wgpu::Buffer, wgpu::BindGroup),
    caster_place: (wgpu::Buffer, wgpu::BindGroup),
    table_pipeline: wgpu::RenderPipeline,
    depth_pass: Pipelines,
    depth_fail: Pipelines,
}

/// What counts volumes.
struct Pipelines {
    made: wgpu::RenderPipeline,
    side: wgpu::RenderPipeline,
    cap: wgpu::RenderPipeline,
}

impl Lab {
    const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth24PlusStencil8;

    fn new() -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
        let (device, queue) =
            pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
                required_limits: adapter.limits(),
                ..Default::default()
            }))?;
        let bind_layout = place_layout(&device);
        let parts = PipelineParts::new(&device, &bind_layout);
        let table = TABLE_M.map(|(x, y)| Vec4::new(x, y, 0.0, 1.0));
        let info = adapter.get_info();
        Ok(Self {
            adapter: format!("{} ({:?}, {})", info.name, info.backend, info.driver_info),
            table: buffer(&device, wgpu::BufferUsages::VERTEX, &table),
            table_place: place(&device, &bind_layout),
            caster_place: place(&device, &bind_layout),
            table_pipeline: parts.pipeline("made", &POINT, None),
            depth_pass: parts.pipelines(Counting::DepthPass),
            depth_fail: parts.pipelines(Counting::DepthFail),
            depth_stencil: depth_stencil(&device),
            device,
            queue,
        })
    }

    fn pipelines(&self, counting: Counting) -> &Pipelines {
        match counting {
            Counting::DepthPass => &self.depth_pass,
            Counting::DepthFail => &self.depth_fail,
        }
    }

    /// Counts the volumes and waits until it is done.
    fn count(
        &self,
        moment: &Moment,
        draw_volumes: impl FnOnce(&mut wgpu::RenderPass<'_>),
    ) -> Result<()> {
        let light = moment.light_in_caster.as_vec3().extend(1.0);
        for ((uniform, _), clip_from_space) in [
            (&self.table_place, moment.clip_from_world),
            (&self.caster_place, moment.clip_from_caster),
        ] {
            let place = Place {
                clip_from_space,
                light,
            };
            self.queue
                .write_buffer(uniform, 0, bytemuck::bytes_of(&place));
        }
        let mut encoder = self.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth_stencil.create_view(&Default::default()),
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0),
                    store: wgpu::StoreOp::Store,
                }),
            }),
            ..Default::default()
        });
        pass.set_pipeline(&self.table_pipeline);
        pass.set_bind_group(0, &self.table_place.1, &[]);
        pass.set_vertex_buffer(0, self.table.slice(..));
        pass.draw(0..6, 0..1);
        pass.set_bind_group(0, &self.caster_place.1, &[]);
        draw_volumes(&mut pass);
        drop(pass);
        self.queue.submit([encoder.finish()]);
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        Ok(())
    }

    fn read_stencil(&self) -> Result<Vec<u8>> {
        let [width, height] = SIZE_PX;
        let row_bytes = width.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let readable = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row_bytes * height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            wgpu::TexelCopyTextureInfo {
                aspect: wgpu::TextureAspect::StencilOnly,
                ..self.depth_stencil.as_image_copy()
            },
            wgpu::TexelCopyBufferInfo {
                buffer: &readable,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row_bytes),
                    rows_per_image: None,
                },
            },
            self.depth_stencil.size(),
        );
        self.queue.submit([encoder.finish()]);
        readable.map_async(wgpu::MapMode::Read, .., |_| ());
        self.device.poll(wgpu::PollType::wait_indefinitely())?;
        let mapped = readable
            .get_mapped_range(..)
            .context("the stencil cannot be read")?;
        Ok(mapped
            .chunks_exact(row_bytes as usize)
            .flat_map(|row| row[..width as usize].to_vec())
            .collect())
    }
}

fn depth_stencil(device: &wgpu::Device) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: None,
        size: wgpu::Extent3d {
            width: SIZE_PX[0],
            height: SIZE_PX[1],
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: Lab::FORMAT,
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
        view_formats: &[],
    })
}

fn place_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
        label: None,
        entries: &[wgpu::BindGroupLayoutEntry {
            binding: 0,
            visibility: wgpu::ShaderStages::VERTEX,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Uniform,
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        }],
    })
}

/// A buffer for a [`Place`], and what binds it.
fn place(
    device: &wgpu::Device,
    bind_layout: &wgpu::BindGroupLayout,
) -> (wgpu::Buffer, wgpu::BindGroup) {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: size_of::<Place>() as u64,
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: bind_layout,
        entries: &[wgpu::BindGroupEntry {
            binding: 0,
            resource: buffer.as_entire_binding(),
        }],
    });
    (buffer, group)
}

/// What all pipelines have in common.
struct PipelineParts<'a> {
    device: &'a wgpu::Device,
    module: wgpu::ShaderModule,
    layout: wgpu::PipelineLayout,
}

impl<'a> PipelineParts<'a> {
    fn new(device: &'a wgpu::Device, bind_layout: &wgpu::BindGroupLayout) -> Self {
        Self {
            device,
            module: device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: None,
                source: wgpu::ShaderSource::Wgsl(SHADER.into()),
            }),
            layout: device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: &[Some(bind_layout)],
                immediate_size: 0,
            }),
        }
    }

    fn pipelines(&self, counting: Counting) -> Pipelines {
        Pipelines {
            made: self.pipeline("made", &POINT, Some(counting)),
            side: self.pipeline("side", &EDGE, Some(counting)),
            cap: self.pipeline("cap", &CORNER, Some(counting)),
        }
    }

    /// What counts in the stencil, or else writes depth.
    fn pipeline(
        &self,
        entry_point: &str,
        attributes: &[wgpu::VertexAttribute],
        counting: Option<Counting>,
    ) -> wgpu::RenderPipeline {
        let (up, down) = (
            wgpu::StencilOperation::IncrementWrap,
            wgpu::StencilOperation::DecrementWrap,
        );
        let array_stride = attributes
            .iter()
            .map(|attribute| attribute.format.size())
            .sum();
        self.device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(entry_point),
                layout: Some(&self.layout),
                vertex: wgpu::VertexState {
                    module: &self.module,
                    entry_point: Some(entry_point),
                    compilation_options: Default::default(),
                    buffers: &[Some(wgpu::VertexBufferLayout {
                        array_stride,
                        step_mode: wgpu::VertexStepMode::Vertex,
                        attributes,
                    })],
                },
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: Lab::FORMAT,
                    depth_write_enabled: Some(counting.is_none()),
                    depth_compare: Some(wgpu::CompareFunction::Greater),
                    stencil: wgpu::StencilState {
                        front: stencil_face(counting, up, down),
                        back: stencil_face(counting, down, up),
                        read_mask: 0xff,
                        write_mask: 0xff,
                    },
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: None,
                multiview_mask: None,
                cache: None,
            })
    }
}

/// One of two operations, by where the counting is done; neither where nothing is counted.
fn stencil_face(
    counting: Option<Counting>,
    pass_op: wgpu::StencilOperation,
    depth_fail_op: wgpu::StencilOperation,
) -> wgpu::StencilFaceState {
    let keep = wgpu::StencilFaceState::IGNORE;
    match counting {
        None => keep,
        Some(Counting::DepthPass) => wgpu::StencilFaceState { pass_op, ..keep },
        Some(Counting::DepthFail) => wgpu::StencilFaceState {
            depth_fail_op,
            ..keep
        },
    }
}

fn buffer<T: Pod>(
    device: &wgpu::Device,
    usage: wgpu::BufferUsages,
    contents: &[T],
) -> wgpu::Buffer {
    device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: None,
        contents: bytemuck::cast_slice(contents),
        usage,
    })
}

/// The silhouette found by the program's own code and taken to the GPU in every frame.
struct OnCpu {
    caster: Caster,
    vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    index_count: u32,
}

impl OnCpu {
    fn new(lab: &Lab, mesh: &Mesh) -> Self {
        // Room for the largest volume: both caps of each triangle, and a side on each of its edges.
        let most_indices = 3 * (2 + 6) * mesh.triangles.len();
        let caster = Caster::new(mesh.positions.clone(), mesh.triangles.clone());
        Self {
            vertices: buffer(
                &lab.device,
                wgpu::BufferUsages::VERTEX,
                &caster.volume_vertices(),
            ),
            indices: lab.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: (most_indices * size_of::<u32>()) as u64,
                usage: wgpu::BufferUsages::INDEX | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            index_count: 0,
            caster,
        }
    }

    /// When the volume was made, and when it was handed over.
    fn make(&mut self, lab: &Lab, moment: &Moment, counting: Counting) -> (Instant, Instant) {
        let light = LightPlace::Point(moment.light_in_caster);
        let mut indices = Vec::new();
        for part in self.caster.parts(light, Casting::Facing, MOST_LAYERS) {
            indices.extend(self.caster.side_indices(&part.silhouette));
            if counting == Counting::DepthFail {
                let [outward, turned] = self.caster.cap_indices(&part.silhouette);
                indices.extend(outward);
                indices.extend(turned.chunks(3).flat_map(|t| [t[0], t[2], t[1]]));
            }
        }
        let made = Instant::now();
        lab.queue
            .write_buffer(&self.indices, 0, bytemuck::cast_slice(&indices));
        self.index_count = indices.len() as u32;
        (made, Instant::now())
    }

    fn draw(&self, lab: &Lab, pass: &mut wgpu::RenderPass<'_>, counting: Counting) {
        pass.set_pipeline(&lab.pipelines(counting).made);
        pass.set_vertex_buffer(0, self.vertices.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.index_count, 0, 0..1);
    }
}

/// A corner of an edge's quad: the edge's ends, the planes of the triangles along it and against it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct EdgeCorner {
    ends: [Vec3; 2],
    planes: [[f32; 4]; 2],
}

/// A corner of a cap, and the plane of its triangle.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct CapCorner {
    point: Vec3,
    plane: [f32; 4],
}

/// Everything that could become a volume, for a vertex shader to choose from.
struct OnGpu {
    edges: wgpu::Buffer,
    edge_indices: wgpu::Buffer,
    edge_index_count: u32,
    caps: wgpu::Buffer,
    cap_corner_count: u32,
}

impl OnGpu {
    /// Of a closed mesh.
    fn new(lab: &Lab, mesh: &Mesh) -> Self {
        let point = |index: u32| mesh.positions[index as usize];
        let planes: Vec<[f32; 4]> = mesh
            .triangles
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|index| point(index).as_dvec3());
                let normal = (b - a).cross(c - a);
                normal.extend(-normal.dot(a)).as_vec4().to_array()
            })
            .collect();
        let plane_along: HashMap<[u32; 2], [f32; 4]> = mesh
            .triangles
            .iter()
            .zip(&planes)
            .flat_map(|(&[a, b, c], &plane)| [[a, b], [b, c], [c, a]].map(|edge| (edge, plane)))
            .collect();
        let edges: Vec<EdgeCorner> = mesh
            .triangles
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .filter(|[from, to]| from < to)
            .flat_map(|[from, to]| {
                let corner = EdgeCorner {
                    ends: [point(from), point(to)],
                    planes: [plane_along[&[from, to]], plane_along[&[to, from]]],
                };
                [corner; 4]
            })
            .collect();
        let edge_indices: Vec<u32> = (0..edges.len() as u32)
            .step_by(4)
            .flat_map(|first| [0, 1, 2, 0, 2, 3].map(|corner| first + corner))
            .collect();
        let caps: Vec<CapCorner> = mesh
            .triangles
            .iter()
            .zip(&planes)
            .flat_map(|(&[a, b, c], &plane)| {
                [a, b, c, a, c, b].map(|index| CapCorner {
                    point: point(index),
                    plane,
                })
            })
            .collect();
        Self {
            edge_index_count: edge_indices.len() as u32,
            cap_corner_count: caps.len() as u32,
            edges: buffer(&lab.device, wgpu::BufferUsages::VERTEX, &edges),
            edge_indices: buffer(&lab.device, wgpu::BufferUsages::INDEX, &edge_indices),
            caps: buffer(&lab.device, wgpu::BufferUsages::VERTEX, &caps),
        }
    }

    fn draw(&self, lab: &Lab, pass: &mut wgpu::RenderPass<'_>, counting: Counting) {
        pass.set_pipeline(&lab.pipelines(counting).side);
        pass.set_vertex_buffer(0, self.edges.slice(..));
        pass.set_index_buffer(self.edge_indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.edge_index_count, 0, 0..1);
        if counting == Counting::DepthFail {
            pass.set_pipeline(&lab.pipelines(counting).cap);
            pass.set_vertex_buffer(0, self.caps.slice(..));
            pass.draw(0..self.cap_corner_count, 0..1);
        }
    }
}
