//! Soft shadows by shafts (Gibson, Cook, Howard & Hubbold 2003), as plain values: the room in patches, the light that
//! each sends to each place, and which of it a moving thing may hide. World space, metres, linear radiance.

pub mod bounding;
pub mod bright_patches;
mod carried_light;
pub mod casters;
pub mod difference;
mod form_factor;
pub mod hidden_light;
pub mod hierarchy;
pub mod intensity_transfers;
pub mod irradiance_volume;
pub mod light_of_room;
pub mod patches;
pub mod placed_probe;
mod points;
pub mod receiver_patches;
mod receiver_tree;
pub mod room;
pub mod room_transport;
pub mod selection;
pub mod shadow_atlas;
mod shaft;
mod solid_angle;
pub mod source_tree;
pub mod surfels;
pub mod transfer;

use glam::Vec3;

use crate::light::REC_709;

/// Luminance of linear RGB (Rec. 709).
pub(crate) fn luminance(color: Vec3) -> f32 {
    color.dot(REC_709.as_vec3())
}
