//! The WGSL sources, built into the program; a line `//!include "common.wgsl"` stands for that file.

const COMMON: &str = include_str!("../../shaders/common.wgsl");

/// Puts the common part in its place.
fn source(text: &str) -> String {
    text.replace("//!include \"common.wgsl\"", COMMON)
}

/// A shader module of one of the files under `shaders/`.
pub(super) fn module(device: &wgpu::Device, label: &str, text: &str) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source(text).into()),
    })
}
