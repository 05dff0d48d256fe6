//! The WGSL sources, built into the program; a line `//!include "NAME.wgsl"` stands for that file.

/// What others include, each after those that it is included by.
const INCLUDED: [(&str, &str); 7] = [
    (
        "//!include \"sampled_surface.wgsl\"",
        include_str!("../../shaders/sampled_surface.wgsl"),
    ),
    (
        "//!include \"partly_covered.wgsl\"",
        include_str!("../../shaders/partly_covered.wgsl"),
    ),
    (
        "//!include \"shading.wgsl\"",
        include_str!("../../shaders/shading.wgsl"),
    ),
    (
        "//!include \"mapped_source.wgsl\"",
        include_str!("../../shaders/mapped_source.wgsl"),
    ),
    (
        "//!include \"video.wgsl\"",
        include_str!("../../shaders/video.wgsl"),
    ),
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

/// A pipeline that draws one triangle over the whole of its targets, one sample per pixel.
pub(super) fn whole_picture(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    module: &wgpu::ShaderModule,
    entry_point: &str,
    targets: &[Option<wgpu::ColorTargetState>],
    depth_stencil: Option<wgpu::DepthStencilState>,
    constants: &[(&str, f64)],
) -> wgpu::RenderPipeline {
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(entry_point),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some("whole_picture"),
            compilation_options: Default::default(),
            buffers: &[],
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants,
                ..Default::default()
            },
            targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
