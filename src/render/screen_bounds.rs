//! Bounds on screen: where in the picture virtual things and shadows can be. The passes leave the rest alone.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::{Bounds, HalfSpace};
use crate::geometry::camera::Intrinsics;
use crate::geometry::reach::{self, PixelRect};
use crate::scene::{Shortcut, Shortcuts};

use super::anchor_geometry::{AnchoredModel, Role};
use super::light_piece::{Piece, light_place};

const UNSEEN: ShadowReach = ShadowReach {
    pixels: PixelRect::NONE,
    end: None,
};

/// The pixels that a frame's things can change.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ScreenBounds {
    /// All of it.
    pub pixels: PixelRect,
    /// Where virtual things can be.
    pub virtuals: PixelRect,
    /// For each piece of a light and each thing; empty for those that cast none.
    pub shadows: Vec<Vec<ShadowReach>>,
}

/// The reach of a caster's shadow.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ShadowReach {
    /// Where in the picture it can fall on anything; empty where there is none.
    pub pixels: PixelRect,
    /// Where in the world it may end.
    pub end: Option<HalfSpace>,
}

impl ScreenBounds {
    /// The same of a part of the picture alone.
    pub fn only(&self, pixels: PixelRect) -> Self {
        Self {
            pixels,
            virtuals: self.virtuals.intersection(pixels),
            shadows: self.shadows.clone(),
        }
    }

    /// Where the passes make no difference between things and shadows.
    pub fn pixels_alone(pixels: PixelRect) -> Self {
        Self {
            pixels,
            virtuals: pixels,
            shadows: Vec::new(),
        }
    }
}

/// What virtual things and their shadows can change, and how far all shadows reach; `None` where nothing is placed.
pub(super) fn screen_bounds(
    things: &[AnchoredModel],
    pieces: &[Piece],
    camera_from_anchor: &[Option<DAffine3>],
    intrinsics: &Intrinsics,
    without: Shortcuts,
) -> Option<ScreenBounds> {
    let whole = PixelRect::whole(intrinsics.size_px);
    let scissored = |pixels: PixelRect| match without.has(Shortcut::Scissors) {
        true => whole,
        false => pixels,
    };
    let camera_from_world = (*camera_from_anchor.first()?)?;
    let world_from_camera = camera_from_world.inverse();
    let corners_in_world = |thing: &AnchoredModel| {
        let world_from_anchor = world_from_camera * camera_from_anchor[thing.anchor]?;
        Some(
            thing
                .bounds
                .corners()
                .map(|corner| world_from_anchor.transform_point3(corner)),
        )
    };
    let placed: Vec<(usize, &AnchoredModel, [DVec3; 8])> = things
        .iter()
        .enumerate()
        .filter_map(|(index, thing)| Some((index, thing, corners_in_world(thing)?)))
        .collect();
    let receivers = Bounds::around(placed.iter().flat_map(|(_, _, corners)| *corners))?;

    let mut shadows = vec![vec![UNSEEN; things.len()]; pieces.len()];
    let mut virtuals = PixelRect::NONE;
    let mut pixels = PixelRect::NONE;
    for (index, thing, corners) in &placed {
        if thing.role == Role::Virtual {
            let covered = reach::covered(corners, &camera_from_world, intrinsics);
            virtuals = virtuals.union(scissored(covered));
        }
        for (piece, shadows) in pieces.iter().zip(&mut shadows).filter(|_| thing.casts) {
            let light = light_place(&piece.light, &DAffine3::IDENTITY);
            let reached =
                reach::shadowed(corners, light, &receivers, &camera_from_world, intrinsics);
            let shadow = ShadowReach {
                pixels: scissored(reached),
                end: (!without.has(Shortcut::Ends))
                    .then(|| reach::shadow_end(corners, light, &receivers))
                    .flatten(),
            };
            if thing.role == Role::Virtual {
                pixels = pixels.union(shadow.pixels);
            }
            shadows[*index] = shadow;
        }
    }
    Some(ScreenBounds {
        pixels: pixels.union(virtuals),
        virtuals,
        shadows,
    })
}
