//! Where in the picture the inside of a thing can be seen: of what bounds a solid but for some holes, through these alone.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::{PixelRect, covered};
use crate::geometry::shadow_volume::EDGE_ON_TO_EYE;

use super::anchor_geometry::AnchoredModel;
use super::uniforms::NEAR_M;

/// The pixels in which the inside of a thing can be seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Insides {
    Unseen,
    /// In these pixels.
    Within(PixelRect),
    Anywhere,
}

/// Where the camera can see the inside of a thing at a level of detail.
pub(super) fn insides(
    thing: &AnchoredModel,
    level: usize,
    camera_from_anchor: &DAffine3,
    intrinsics: &Intrinsics,
) -> Insides {
    // The near plane may cut what the eye is just out of.
    let reach = DVec3::splat(2.0 * f64::from(NEAR_M));
    let around = Bounds {
        low: thing.bounds.low - reach,
        high: thing.bounds.high + reach,
    };
    let eye = camera_from_anchor.inverse().translation;
    let Some(holes) = &thing.levels[level].holes else {
        return Insides::Anywhere;
    };
    if around.contains(eye) {
        return Insides::Anywhere;
    }
    let open: Vec<DVec3> = holes
        .iter()
        .filter(|[a, b, c]| {
            // One that is hardly turned away may face the camera for all that rounding makes of it.
            let (normal, way) = ((b - a).cross(c - a), eye - a);
            normal.dot(way) >= -EDGE_ON_TO_EYE * normal.length() * way.length()
        })
        .flatten()
        .copied()
        .collect();
    let pixels = covered(&open, camera_from_anchor, intrinsics);
    match pixels.is_empty() {
        true => Insides::Unseen,
        false => Insides::Within(pixels),
    }
}
