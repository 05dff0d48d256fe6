//! The device that draws: chosen by name, else the best there is.

use std::borrow::Cow;

use super::device_failure::{DeviceFailure, without_a_panic};
use super::error::RenderError;
use super::file_limit;
use super::pipelines::{GroupLayout, PipelineCache, PipelineDescription};

/// An opened adapter.
pub struct Gpu {
    instance: wgpu::Instance,
    adapter: wgpu::Adapter,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    pub(super) depth_format: wgpu::TextureFormat,
    /// What light is added up in.
    pub(super) light_format: wgpu::TextureFormat,
    /// Nanoseconds per tick of a timestamp; `None` where the adapter has no timestamps.
    pub(super) timestamp_period_ns: Option<f32>,
    pipelines: PipelineCache,
    description: String,
    failure: DeviceFailure,
}

/// Handles on an opened adapter, for a window that shows what is drawn there.
#[derive(Debug, Clone)]
pub struct SharedDevice {
    /// Where it was found.
    pub instance: wgpu::Instance,
    /// The adapter.
    pub adapter: wgpu::Adapter,
    /// The device.
    pub device: wgpu::Device,
    /// The device's queue.
    pub queue: wgpu::Queue,
}

impl Gpu {
    /// Opens the adapter whose name contains `wanted` (any case), else the fastest kind there is: discrete,
    /// integrated, virtual, then software.
    ///
    /// # Errors
    /// No adapter, none of that name, or one that lacks what the passes need.
    pub fn open(wanted: Option<&str>) -> Result<Self, RenderError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::PRIMARY;
        let instance = wgpu::Instance::new(descriptor);
        let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        });
        let name = |adapter: &wgpu::Adapter| adapter.get_info().name;
        let adapter = match wanted {
            None => adapters.first().ok_or(RenderError::NoAdapter)?,
            Some(wanted) => adapters
                .iter()
                .find(|adapter| {
                    name(adapter)
                        .to_lowercase()
                        .contains(&wanted.to_lowercase())
                })
                .ok_or_else(|| RenderError::UnknownAdapter {
                    wanted: wanted.to_owned(),
                    found: adapters.iter().map(name).collect::<Vec<_>>().join(", "),
                })?,
        };
        Self::from_adapter(&instance, adapter)
    }

    fn from_adapter(
        instance: &wgpu::Instance,
        adapter: &wgpu::Adapter,
    ) -> Result<Self, RenderError> {
        let info = adapter.get_info();
        let offered = adapter.features();
        let wished = wgpu::Features::DEPTH32FLOAT_STENCIL8
            | wgpu::Features::TIMESTAMP_QUERY
            | wgpu::Features::FLOAT32_BLENDABLE
            | wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES;
        let features = offered & wished;
        let light_format = light_format(adapter, features);
        let unusable = |reason: String| RenderError::Unusable {
            adapter: info.name.clone(),
            reason,
        };
        if let Some(complaint) = file_limit::complaint(&info, file_limit::of_process()) {
            return Err(unusable(complaint));
        }
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("gnomon"),
            required_features: features,
            required_limits: adapter.limits(),
            ..Default::default()
        };
        // Half-made, a device that has no memory panics when it is dropped.
        let requested = without_a_panic(|| pollster::block_on(adapter.request_device(&descriptor)));
        let (device, queue) = requested
            .map_err(|panic| unusable(format!("it gives no device: {}", panic.words)))?
            .map_err(|error| unusable(error.to_string()))?;

        Ok(Self {
            // Floating depth spends its precision evenly over reversed depth; 24 bits are the fallback.
            depth_format: if features.contains(wgpu::Features::DEPTH32FLOAT_STENCIL8) {
                wgpu::TextureFormat::Depth32FloatStencil8
            } else {
                wgpu::TextureFormat::Depth24PlusStencil8
            },
            light_format,
            timestamp_period_ns: features
                .contains(wgpu::Features::TIMESTAMP_QUERY)
                .then(|| queue.get_timestamp_period()),
            description: format!("{} ({:?}, {})", info.name, info.backend, info.driver_info),
            pipelines: PipelineCache::default(),
            instance: instance.clone(),
            adapter: adapter.clone(),
            failure: DeviceFailure::of(&device),
            device,
            queue,
        })
    }

    /// The adapter's name, its interface and its driver.
    pub fn description(&self) -> &str {
        &self.description
    }

    /// The pipeline of a description.
    pub(super) fn pipeline(&self, description: &PipelineDescription) -> wgpu::RenderPipeline {
        self.pipelines.pipeline(&self.device, description)
    }

    /// A bind group of a layout; the resources come in the order of its entries.
    pub(super) fn bind_group<'a>(
        &self,
        layout: &GroupLayout,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
    ) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = layout
            .entries
            .iter()
            .zip(resources)
            .map(|(entry, resource)| wgpu::BindGroupEntry {
                binding: entry.binding,
                resource,
            })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(layout.label),
            layout: &self.pipelines.group_layout(&self.device, layout),
            entries: &entries,
        })
    }

    /// A buffer of a content that may be empty, which no binding can be.
    /// A sampler that reads between texels and between levels, and ends at the edges.
    pub(super) fn linear_sampler(&self, label: &str) -> wgpu::Sampler {
        self.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some(label),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..Default::default()
        })
    }

    pub(super) fn buffer(
        &self,
        label: &str,
        contents: &[u8],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let size = match contents.len() {
            0 => 256,
            bytes => bytes.next_multiple_of(wgpu::COPY_BUFFER_ALIGNMENT as usize),
        };
        let mut padded = Cow::Borrowed(contents);
        if size > contents.len() {
            padded.to_mut().resize(size, 0);
        }
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size as u64,
            usage: usage | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        // A buffer that is mapped when it is made panics where there is no memory for it.
        self.queue.write_buffer(&buffer, 0, &padded);
        buffer
    }

    /// What a window needs to show pictures of this device without a detour.
    pub fn shared(&self) -> SharedDevice {
        SharedDevice {
            instance: self.instance.clone(),
            adapter: self.adapter.clone(),
            device: self.device.clone(),
            queue: self.queue.clone(),
        }
    }

    /// Memory that the driver has given out so far, bytes; `None` where it does not tell.
    pub fn allocated_bytes(&self) -> Option<u64> {
        let report = self.device.generate_allocator_report()?;
        Some(report.total_allocated_bytes)
    }

    /// # Errors
    /// What the device reported, if it failed.
    pub fn check(&self) -> Result<(), RenderError> {
        self.failure.check()
    }

    /// Waits until the device has done all that it was given.
    ///
    /// # Errors
    /// The device has failed since it was opened.
    pub(super) fn wait(&self) -> Result<(), RenderError> {
        self.failure.wait(&self.device)
    }
}

/// Single precision where the adapter can blend it, else half: a lamp a millimetre away is brighter than half precision
/// reaches, and sixteen lights add up to more than its rounding.
fn light_format(adapter: &wgpu::Adapter, features: wgpu::Features) -> wgpu::TextureFormat {
    let single = wgpu::TextureFormat::Rgba32Float;
    let needed = wgpu::Features::FLOAT32_BLENDABLE
        | wgpu::Features::TEXTURE_ADAPTER_SPECIFIC_FORMAT_FEATURES;
    let offered = adapter.get_texture_format_features(single).flags;
    let blends = wgpu::TextureFormatFeatureFlags::BLENDABLE
        | wgpu::TextureFormatFeatureFlags::MULTISAMPLE_X4;
    match features.contains(needed) && offered.contains(blends) {
        true => single,
        false => wgpu::TextureFormat::Rgba16Float,
    }
}
