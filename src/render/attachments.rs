//! What passes draw into, and what of it they keep.

/// A colour target that is kept.
pub(super) fn loaded(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> wgpu::RenderPassColorAttachment<'_> {
    wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load,
            store: wgpu::StoreOp::Store,
        },
    }
}

/// Depth and stencil as the last pass left them, for the next.
pub(super) fn kept(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Load,
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Load,
            store: wgpu::StoreOp::Store,
        }),
    }
}

/// Depth, at first empty, for all passes of a frame; a stencil of zeros for each.
pub(super) fn depth_stencil(
    view: &wgpu::TextureView,
    first: bool,
    last: bool,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    // Both or neither: to keep one alone costs a clear of the other.
    let store = match last {
        true => wgpu::StoreOp::Discard,
        false => wgpu::StoreOp::Store,
    };
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: match first {
                true => wgpu::LoadOp::Clear(0.0),
                false => wgpu::LoadOp::Load,
            },
            store,
        }),
        stencil_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(0),
            store,
        }),
    }
}

/// A texture of one level.
pub(super) fn texture(
    device: &wgpu::Device,
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    samples: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: samples,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A texture that passes draw into, seen whole.
pub(super) fn target(
    device: &wgpu::Device,
    label: &str,
    size_px: [u32; 2],
    format: wgpu::TextureFormat,
    samples: u32,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureView {
    let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | usage;
    texture(device, label, size_px, format, samples, usage).create_view(&Default::default())
}

/// A colour target that is emptied first.
pub(super) fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassColorAttachment<'_> {
    loaded(view, wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT))
}
