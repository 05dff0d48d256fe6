//! Draws a frame: the GPU side of the pipeline, and the only home of wgpu.
//!
//! Each pass is one file here and one WGSL file of the same name under `shaders/`; [`Renderer::draw`] tells the frame
//! from top to bottom.

mod accumulated;
mod anchor_geometry;
mod attachments;
mod background;
mod casters;
mod combined;
mod deforming;
mod detail;
mod device_failure;
mod direct;
mod environment;
mod error;
mod fade;
mod file_limit;
mod final_gather;
mod gpu;
mod gpu_clock;
mod gpu_scene;
mod indirect;
mod insides;
mod known_levels;
mod known_states;
mod layered_scene;
mod layers;
mod light_kind;
mod light_piece;
mod light_sums;
mod lights;
mod linear_picture;
mod map_atlas;
mod materials;
mod mirrored_probe;
mod mirroring;
mod opacity_map;
mod passes;
mod pipelines;
mod precomputation;
mod quality_controller;
mod ray_trees;
mod readback;
mod reflections;
mod renderer;
mod rung_chooser;
mod screen_bounds;
mod shader;
mod shafts;
mod shown;
mod stencil;
mod surfaces;
mod tables;
mod technique;
mod translucent;
mod uniforms;
mod volumes;

pub(crate) use device_failure::{CaughtPanic, without_a_panic};
pub use error::RenderError;
pub use gpu::{Gpu, SharedDevice};
pub use gpu_clock::GpuTimes;
pub use layers::{Layers, REAL, REAL_HIDES, VIRTUAL, VIRTUAL_HIDES};
pub use precomputation::{Afresh, Precomputation};
pub use quality_controller::{QualityController, Setting};
pub use renderer::Renderer;
pub use shown::Shown;
