//! Pipelines and bind groups as values, and the cache that builds each once for a device.

use std::sync::{Mutex, PoisonError};

use super::shader;

/// The layout of a bind group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GroupLayout {
    pub label: &'static str,
    pub entries: &'static [wgpu::BindGroupLayoutEntry],
}

/// Entry of a uniform buffer, picked by a dynamic offset or not.
pub(super) const fn uniform(
    binding: u32,
    visibility: wgpu::ShaderStages,
    has_dynamic_offset: bool,
) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size: None,
    };
    entry(binding, visibility, ty)
}

/// Entry of a storage buffer that is read.
pub(super) const fn storage(
    binding: u32,
    visibility: wgpu::ShaderStages,
) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Storage { read_only: true },
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    entry(binding, visibility, ty)
}

/// Entry of a texture that fragments read texel by texel.
pub(super) const fn texels(binding: u32, multisampled: bool) -> wgpu::BindGroupLayoutEntry {
    texture(binding, false, multisampled)
}

/// Entry of a texture of whole numbers that is read texel by texel.
pub(super) const fn words(
    binding: u32,
    visibility: wgpu::ShaderStages,
) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Uint,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    entry(binding, visibility, ty)
}

/// Entry of a texture that fragments read through a filtering sampler.
pub(super) const fn filtered(binding: u32) -> wgpu::BindGroupLayoutEntry {
    texture(binding, true, false)
}

/// Entry of a filtering sampler.
pub(super) const fn sampler(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

/// Entry of a stack of textures that fragments read through a filtering sampler.
pub(super) const fn filtered_array(binding: u32) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable: true },
        view_dimension: wgpu::TextureViewDimension::D2Array,
        multisampled: false,
    };
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

const fn texture(binding: u32, filterable: bool, multisampled: bool) -> wgpu::BindGroupLayoutEntry {
    let ty = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Float { filterable },
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled,
    };
    entry(binding, wgpu::ShaderStages::FRAGMENT, ty)
}

const fn entry(
    binding: u32,
    visibility: wgpu::ShaderStages,
    ty: wgpu::BindingType,
) -> wgpu::BindGroupLayoutEntry {
    wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty,
        count: None,
    }
}

/// All that a pipeline depends on. By default it draws one triangle over the whole of its targets.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PipelineDescription {
    /// A file under `shaders/`.
    pub shader: &'static str,
    /// What its `//!if` lines ask for.
    pub flags: Vec<&'static str>,
    pub vertex: &'static str,
    pub fragment: &'static str,
    /// Values of the fragment shader's `override`s.
    pub constants: Vec<(&'static str, f64)>,
    pub groups: Vec<Option<GroupLayout>>,
    pub vertex_buffers: Vec<wgpu::VertexBufferLayout<'static>>,
    pub targets: Vec<wgpu::ColorTargetState>,
    pub depth_stencil: Option<wgpu::DepthStencilState>,
    pub cull_mode: Option<wgpu::Face>,
    pub samples: u32,
}

impl Default for PipelineDescription {
    fn default() -> Self {
        Self {
            shader: "fullscreen.wgsl",
            flags: Vec::new(),
            vertex: "fullscreen",
            fragment: "",
            constants: Vec::new(),
            groups: Vec::new(),
            vertex_buffers: Vec::new(),
            targets: Vec::new(),
            depth_stencil: None,
            cull_mode: None,
            samples: 1,
        }
    }
}

/// A colour target that is overwritten.
pub(super) fn overwritten(format: wgpu::TextureFormat) -> wgpu::ColorTargetState {
    format.into()
}

/// A colour target that is left alone.
pub(super) fn untouched(format: wgpu::TextureFormat) -> wgpu::ColorTargetState {
    wgpu::ColorTargetState {
        write_mask: wgpu::ColorWrites::empty(),
        ..format.into()
    }
}

/// A colour target that is added to, `factor` times what is drawn.
pub(super) fn added(
    format: wgpu::TextureFormat,
    factor: wgpu::BlendFactor,
) -> wgpu::ColorTargetState {
    let add = wgpu::BlendComponent {
        src_factor: factor,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::ColorTargetState {
        blend: Some(wgpu::BlendState {
            color: add,
            alpha: add,
        }),
        ..format.into()
    }
}

/// A colour target whose colours are multiplied by what is drawn, and whose alpha stays.
pub(super) fn multiplied(format: wgpu::TextureFormat) -> wgpu::ColorTargetState {
    let part = |src_factor, dst_factor| wgpu::BlendComponent {
        src_factor,
        dst_factor,
        operation: wgpu::BlendOperation::Add,
    };
    wgpu::ColorTargetState {
        blend: Some(wgpu::BlendState {
            color: part(wgpu::BlendFactor::Dst, wgpu::BlendFactor::Zero),
            alpha: part(wgpu::BlendFactor::Zero, wgpu::BlendFactor::One),
        }),
        ..format.into()
    }
}

/// A colour target that what is drawn is taken off.
pub(super) fn taken_off(format: wgpu::TextureFormat) -> wgpu::ColorTargetState {
    let take = wgpu::BlendComponent {
        src_factor: wgpu::BlendFactor::One,
        dst_factor: wgpu::BlendFactor::One,
        operation: wgpu::BlendOperation::ReverseSubtract,
    };
    wgpu::ColorTargetState {
        blend: Some(wgpu::BlendState {
            color: take,
            alpha: take,
        }),
        ..format.into()
    }
}

/// All pipelines that were built for one device, and the modules and layouts that they share.
#[derive(Default)]
pub(super) struct PipelineCache(Mutex<Built>);

#[derive(Default)]
struct Built {
    modules: Vec<((&'static str, Vec<&'static str>), wgpu::ShaderModule)>,
    groups: Vec<(GroupLayout, wgpu::BindGroupLayout)>,
    pipelines: Vec<(PipelineDescription, wgpu::RenderPipeline)>,
}

impl PipelineCache {
    pub fn pipeline(
        &self,
        device: &wgpu::Device,
        description: &PipelineDescription,
    ) -> wgpu::RenderPipeline {
        self.built(|built| built.pipeline(device, description))
    }

    pub fn group_layout(
        &self,
        device: &wgpu::Device,
        layout: &GroupLayout,
    ) -> wgpu::BindGroupLayout {
        self.built(|built| built.group_layout(device, layout))
    }

    fn built<T>(&self, from: impl FnOnce(&mut Built) -> T) -> T {
        // What somebody who failed has left is whole: entries are added last.
        from(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// What belongs to a key, made where it is not known yet.
fn known<K: PartialEq + Clone, V: Clone>(entries: &[(K, V)], key: &K) -> Option<V> {
    let mut entries = entries.iter();
    entries
        .find(|(known, _)| known == key)
        .map(|(_, value)| value.clone())
}

impl Built {
    fn module(
        &mut self,
        device: &wgpu::Device,
        description: &PipelineDescription,
    ) -> wgpu::ShaderModule {
        let key = (description.shader, description.flags.clone());
        known(&self.modules, &key).unwrap_or_else(|| {
            let source = shader::source(description.shader, &description.flags)
                .expect("a test puts all shaders together");
            let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(description.shader),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            self.modules.push((key, module.clone()));
            module
        })
    }

    fn group_layout(
        &mut self,
        device: &wgpu::Device,
        layout: &GroupLayout,
    ) -> wgpu::BindGroupLayout {
        known(&self.groups, layout).unwrap_or_else(|| {
            let built = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(layout.label),
                entries: layout.entries,
            });
            self.groups.push((*layout, built.clone()));
            built
        })
    }

    fn pipeline(
        &mut self,
        device: &wgpu::Device,
        description: &PipelineDescription,
    ) -> wgpu::RenderPipeline {
        known(&self.pipelines, description).unwrap_or_else(|| {
            let pipeline = self.build(device, description);
            self.pipelines.push((description.clone(), pipeline.clone()));
            pipeline
        })
    }

    fn build(
        &mut self,
        device: &wgpu::Device,
        description: &PipelineDescription,
    ) -> wgpu::RenderPipeline {
        let module = self.module(device, description);
        let groups: Vec<Option<wgpu::BindGroupLayout>> = description
            .groups
            .iter()
            .map(|group| group.map(|group| self.group_layout(device, &group)))
            .collect();
        let groups: Vec<Option<&wgpu::BindGroupLayout>> =
            groups.iter().map(Option::as_ref).collect();
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(description.fragment),
            bind_group_layouts: &groups,
            immediate_size: 0,
        });
        let buffers: Vec<Option<wgpu::VertexBufferLayout<'_>>> = description
            .vertex_buffers
            .iter()
            .cloned()
            .map(Some)
            .collect();
        let targets: Vec<Option<wgpu::ColorTargetState>> =
            description.targets.iter().cloned().map(Some).collect();
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(description.fragment),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some(description.vertex),
                compilation_options: Default::default(),
                buffers: &buffers,
            },
            primitive: wgpu::PrimitiveState {
                cull_mode: description.cull_mode,
                ..Default::default()
            },
            depth_stencil: description.depth_stencil.clone().map(with_reference),
            multisample: wgpu::MultisampleState {
                count: description.samples,
                ..Default::default()
            },
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some(description.fragment),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &description.constants,
                    ..Default::default()
                },
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

/// Vulkan wants a reference value for all that tests the stencil, and wgpu sets one for what compares alone. So what passes
/// always compares no bits, which are always equal.
fn with_reference(mut state: wgpu::DepthStencilState) -> wgpu::DepthStencilState {
    let stencil = &mut state.stencil;
    if stencil.is_enabled() && !stencil.needs_ref_value() {
        let compare = |face: wgpu::StencilFaceState| wgpu::StencilFaceState {
            compare: match face.compare {
                wgpu::CompareFunction::Always => wgpu::CompareFunction::Equal,
                other => other,
            },
            ..face
        };
        stencil.front = compare(stencil.front);
        stencil.back = compare(stencil.back);
        stencil.read_mask = 0;
    }
    state
}
