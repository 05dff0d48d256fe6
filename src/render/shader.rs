//! The WGSL sources, built into the program; a line `//!include "NAME.wgsl"` stands for that file.

const INCLUDED: [(&str, &str); 2] = [
    (
        "//!include \"common.wgsl\"",
        include_str!("../../shaders/common.wgsl"),
    ),
    (
        "//!include \"whole_picture.wgsl\"",
        include_str!("../../shaders/whole_picture.wgsl"),
    ),
];

/// Puts the included parts in their places.
pub(super) fn source(text: &str) -> String {
    INCLUDED.iter().fold(text.to_owned(), |text, (line, part)| {
        text.replace(line, part)
    })
}

/// A shader module of one of the files under `shaders/`.
pub(super) fn module(device: &wgpu::Device, label: &str, text: &str) -> wgpu::ShaderModule {
    device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(label),
        source: wgpu::ShaderSource::Wgsl(source(text).into()),
    })
}

/// The layout of pipelines that read nothing.
pub(super) fn no_bindings(device: &wgpu::Device) -> wgpu::PipelineLayout {
    device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: Some("no bindings"),
        bind_group_layouts: &[],
        immediate_size: 0,
    })
}
