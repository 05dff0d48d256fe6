//! Which level of detail each thing is drawn in: the coarsest whose outlines, and whose shadow's, no pixel tells apart.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::camera::Intrinsics;
use crate::geometry::levels::is_close_enough;
use crate::geometry::outline_scale::{View, outline_px_per_m, shadow_px_per_m};
use crate::light::Light;

use super::anchor_geometry::{Role, Thing, ThingLevel};
use super::touched::light_place;
use super::uniforms::NEAR_M;

/// So far may the line move at which a real thing turns away from a light.
const LARGEST_REAL_FACET_PX: f64 = 1.0;

/// For each thing the index of its level, for the camera and all lights.
pub(super) fn chosen_levels(
    things: &[Thing],
    lights: &[Light],
    camera_from_anchor: &[Option<DAffine3>],
    intrinsics: &Intrinsics,
    max_silhouette_error_px: f64,
) -> Vec<usize> {
    let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
        return vec![0; things.len()];
    };
    let view = View {
        intrinsics: *intrinsics,
        camera_from_world,
        near_m: f64::from(NEAR_M),
    };
    let world_from_camera = camera_from_world.inverse();
    let world_from = |thing: &Thing| Some(world_from_camera * camera_from_anchor[thing.anchor]?);
    let lights: Vec<_> = lights
        .iter()
        .map(|light| light_place(light, &DAffine3::IDENTITY))
        .collect();
    things
        .iter()
        .enumerate()
        .map(|(index, thing)| {
            let Some(world_from_thing) = world_from(thing).filter(|_| thing.levels.len() > 1)
            else {
                return 0;
            };
            let place = |point: DVec3| world_from_thing.transform_point3(point);
            let Some(bounds) = Bounds::around(thing.bounds.corners().map(place)) else {
                return 0;
            };
            let outline_px_per_m = outline_px_per_m(&bounds, &view);
            let mut px_per_m = outline_px_per_m;
            for &light in lights.iter().filter(|_| thing.casts) {
                // Its shadow on itself moves no farther than its outline, as the light sees it.
                let others = things
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != index);
                for (world_from_other, other) in
                    others.filter_map(|(_, other)| Some((world_from(other)?, other)))
                {
                    let place = |point: DVec3| world_from_other.transform_point3(point);
                    let receivers = other.receivers.iter().map(|corners| corners.map(place));
                    px_per_m = px_per_m.max(shadow_px_per_m(&bounds, light, receivers, &view));
                }
            }
            let close_enough = |level: &ThingLevel| {
                let (max_px, mean_px) =
                    (level.max_error_m * px_per_m, level.mean_error_m * px_per_m);
                // The video shows a real thing's own shading, and where that ends its own shadow has to.
                let facets_show = thing.role == Role::Real
                    && level.largest_facet_m * outline_px_per_m > LARGEST_REAL_FACET_PX;
                is_close_enough(max_px, mean_px, max_silhouette_error_px) && !facets_show
            };
            thing.levels.iter().rposition(close_enough).unwrap_or(0)
        })
        .collect()
}
