//! What casts shadows with sharp edges, and where it stands.

use glam::DAffine3;

use crate::geometry::shadow_volume::LightPlace;
use crate::light::Light;

use super::light_kind::LightKind;

/// The origin of a scene's light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum LitBy {
    /// The scene's lights, and what reflects them.
    Lights,
    /// A room, whose light a technique brings ([`GpuScene::set_indirect`](super::gpu_scene::GpuScene::set_indirect)).
    Room,
}

/// A part of a light that casts shadows with sharp edges.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    /// In world space.
    pub light: Light,
    pub kind: LightKind,
    /// Its number, which stays the same from frame to frame.
    pub slot: usize,
}

/// A light as its shadow volumes see it from an anchor.
pub(super) fn light_place(light: &Light, anchor_from_world: &DAffine3) -> LightPlace {
    match *light {
        Light::Point { position_m, .. } => {
            LightPlace::Point(anchor_from_world.transform_point3(position_m))
        }
        Light::Directional { direction, .. } => {
            LightPlace::Along(anchor_from_world.transform_vector3(direction))
        }
    }
}
