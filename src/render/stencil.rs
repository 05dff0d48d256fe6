//! What the stencil's bits mean while one light is worked on, and how pipelines test depth and stencil.

use super::anchor_geometry::Role;

/// The number of volumes of the present batch that the surface lies in.
pub(super) const COUNT: u32 = 0x1f;
/// The largest number that the count can hold: a batch never has more volumes one in another.
pub(super) const MOST_LAYERS: u32 = COUNT;
/// The light is added already: of two surfaces in the same place one gets it. More than any count that leaves it.
pub(super) const ADDED: u32 = 0x20;
/// Whatever the counts say: a virtual thing of an earlier batch hides the light.
const VIRTUAL_HIDES: u32 = 0x40;
/// A real thing hides the light; virtual things can then hide no more of it, and are not counted.
pub(super) const REAL_HIDES: u32 = 0x80;
/// A virtual thing hides the light.
pub(super) const VIRTUAL_SHADOW: u32 = COUNT | VIRTUAL_HIDES;
/// Anything hides the light.
pub(super) const SHADOW: u32 = COUNT | VIRTUAL_HIDES | REAL_HIDES;

/// The bit that keeps what a finished batch of this role has counted.
pub(super) fn hides(role: Role) -> u32 {
    match role {
        Role::Real => REAL_HIDES,
        Role::Virtual => VIRTUAL_HIDES,
    }
}

/// A stencil test of both sides' bits `read`, and what a drawn sample does to other bits.
pub(super) fn stencil(
    compare: wgpu::CompareFunction,
    read: u32,
    (pass_op, written): (wgpu::StencilOperation, u32),
) -> wgpu::StencilState {
    let face = wgpu::StencilFaceState {
        compare,
        pass_op,
        ..Default::default()
    };
    wgpu::StencilState {
        front: face,
        back: face,
        read_mask: read,
        write_mask: written,
    }
}

/// Depth and stencil without any bias.
pub(super) fn depth_stencil_state(
    format: wgpu::TextureFormat,
    writes_depth: bool,
    depth_compare: wgpu::CompareFunction,
    stencil: wgpu::StencilState,
) -> wgpu::DepthStencilState {
    wgpu::DepthStencilState {
        format,
        depth_write_enabled: Some(writes_depth),
        depth_compare: Some(depth_compare),
        stencil,
        bias: wgpu::DepthBiasState::default(),
    }
}

/// The depth bias of the parts that a real surface is cut into, over the depth of the whole. A part lies in its surface but for
/// rounding: of its corners' depths, by some units in the last place, and of their places on screen to a 256th of a pixel,
/// which moves either plane by up to a 512th of its slope along both axes, both planes by less than a hundredth. At one metre
/// 16 units are 2 µm, less than the 15 µm by which a virtual thing that touches the surface is nearer
/// ([`AnchorView::winning_ties`]), so it stays in front. No volume is ever drawn with it.
///
/// [`AnchorView::winning_ties`]: super::uniforms::AnchorView::winning_ties
pub(super) const IN_A_SURFACE: wgpu::DepthBiasState = wgpu::DepthBiasState {
    constant: 16,
    slope_scale: 0.01,
    clamp: 0.0,
};
