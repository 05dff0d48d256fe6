//! Draws a frame: the GPU side of the pipeline, and the only home of wgpu.
//!
//! Each pass is one file here and one WGSL file of the same name under `shaders/`; [`Renderer::draw`] tells the frame
//! from top to bottom.

mod accumulation;
mod anchor_geometry;
mod attachments;
mod background;
mod casters;
mod composite;
mod detail;
mod direct;
mod fade;
mod governed;
mod governor;
mod gpu;
mod gpu_clock;
mod indirect;
mod insides;
mod layers;
mod readback;
mod renderer;
mod shader;
mod shafts;
mod stage;
mod stencil;
mod surfaces;
mod touched;
mod uniforms;
mod volumes;

pub use governed::{Governed, Setting};
pub use gpu::{Gpu, RenderError, SharedDevice};
pub use gpu_clock::GpuTimes;
pub use layers::{Layers, REAL, REAL_HIDES, VIRTUAL, VIRTUAL_HIDES};
pub use renderer::{Renderer, Shown};
