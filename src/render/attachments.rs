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
