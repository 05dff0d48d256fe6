//! Which level of detail each thing is drawn in: the coarsest whose outlines, and whose shadow's, no pixel tells apart.

use glam::{DAffine3, DVec3};

use crate::geometry::bounds::Bounds;
use crate::geometry::camera::Intrinsics;
use crate::geometry::levels::is_close_enough;
use crate::geometry::outline_scale::{OutlineView, outline_px_per_m, shadow_px_per_m};
use crate::geometry::penumbra::penumbra_px;
use crate::geometry::shadow_volume::LightPlace;
use crate::light::Light;

use super::anchor_geometry::{AnchoredModel, ModelLevel, Role};
use super::light_piece::light_place;
use super::lights::sized_place;
use super::uniforms::NEAR_M;

/// The limit to how far the line may move at which a real thing turns away from a light, pixels.
const LARGEST_REAL_FACET_PX: f64 = 1.0;

/// A coarser level than the last frame's is taken where it is off by no more than this part of what is allowed: a camera
/// that trembles about the limit does not make things flip between two levels.
const COARSER_AT: f64 = 0.75;

/// The factor by which the edge of a thing's shadow on itself may move farther than an outline where light falls straight: by
/// the error of what casts it and by that of what it falls on. Where light grazes at a sine it moves by as much more as there is less
/// light to lose, so that what is lost or won in light stays the same.
const OWN_SHADOW: f64 = 2.0;

/// For each thing the index of its level, for the camera and all lights; `before` are those of the last frame.
pub(super) fn chosen_levels(
    things: &[AnchoredModel],
    lights: &[Light],
    camera_from_anchor: &[Option<DAffine3>],
    intrinsics: &Intrinsics,
    max_silhouette_error_px: f64,
    before: &[usize],
) -> Vec<usize> {
    let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
        return vec![0; things.len()];
    };
    let placed = placed(things, camera_from_anchor, &camera_from_world.inverse());
    let place = |light| light_place(light, &DAffine3::IDENTITY);
    let choice = LevelChoice {
        view: OutlineView {
            intrinsics: *intrinsics,
            camera_from_world,
            near_m: f64::from(NEAR_M),
        },
        things,
        placed,
        lights: lights.iter().map(place).collect(),
        max_silhouette_error_px,
    };
    let before = |index: usize| before.get(index).copied().unwrap_or(0);
    let indices = 0..things.len();
    indices
        .map(|index| choice.level(index, before(index)))
        .collect()
}

/// The width of the widest soft edge that a light's shadows have in the picture, pixels.
pub(super) fn widest_penumbra_px(
    things: &[AnchoredModel],
    light: &Light,
    camera_from_anchor: &[Option<DAffine3>],
    intrinsics: &Intrinsics,
) -> f64 {
    let Some(camera_from_world) = camera_from_anchor.first().copied().flatten() else {
        return 0.0;
    };
    let view = OutlineView {
        intrinsics: *intrinsics,
        camera_from_world,
        near_m: f64::from(NEAR_M),
    };
    let placed = placed(things, camera_from_anchor, &camera_from_world.inverse());
    let standing = || {
        let all = things.iter().zip(&placed);
        all.filter_map(|(thing, placed)| Some((thing, placed.as_ref()?)))
    };
    let light = sized_place(light);
    let mut widest_px: f64 = 0.0;
    for (receiver, at) in standing() {
        let place = |point: DVec3| at.world_from_thing.transform_point3(point);
        let triangles = receiver.receivers.iter();
        let triangles: Vec<[DVec3; 3]> = triangles.map(|corners| corners.map(place)).collect();
        for (_, caster) in standing().filter(|(thing, _)| thing.casts) {
            if may_shade(light.place, &caster.bounds, &at.bounds) {
                let width_px = penumbra_px(&caster.bounds, &light, &triangles, &view);
                widest_px = widest_px.max(width_px);
            }
        }
    }
    widest_px
}

/// A box in the world around all virtual things that cast shadows.
pub(super) fn casters(
    things: &[AnchoredModel],
    camera_from_anchor: &[Option<DAffine3>],
) -> Option<Bounds> {
    let world_from_camera = camera_from_anchor.first().copied().flatten()?.inverse();
    let placed = placed(things, camera_from_anchor, &world_from_camera);
    let casters = things.iter().zip(&placed);
    let casters = casters.filter(|(thing, _)| thing.casts && thing.role == Role::Virtual);
    let bounds = casters.filter_map(|(_, placed)| Some(placed.as_ref()?.bounds));
    Bounds::around(bounds.flat_map(|bounds| bounds.corners()))
}

fn placed(
    things: &[AnchoredModel],
    camera_from_anchor: &[Option<DAffine3>],
    world_from_camera: &DAffine3,
) -> Vec<Option<PlacedBounds>> {
    let placed = things.iter().map(|thing| {
        let world_from_thing = *world_from_camera * camera_from_anchor[thing.anchor]?;
        let place = |point: DVec3| world_from_thing.transform_point3(point);
        Some(PlacedBounds {
            bounds: Bounds::around(thing.bounds.corners().map(place))?,
            world_from_thing,
        })
    });
    placed.collect()
}

/// All that the choice of levels depends on.
struct LevelChoice<'a> {
    view: OutlineView,
    things: &'a [AnchoredModel],
    placed: Vec<Option<PlacedBounds>>,
    lights: Vec<LightPlace>,
    max_silhouette_error_px: f64,
}

impl LevelChoice<'_> {
    /// The level of a thing that was drawn in another one before.
    fn level(&self, index: usize, before: usize) -> usize {
        let thing = &self.things[index];
        let Some(PlacedBounds { bounds, .. }) = &self.placed[index] else {
            return 0;
        };
        if thing.levels.len() == 1 {
            return 0;
        }
        let outline_px_per_m = outline_px_per_m(bounds, &self.view);
        let px_per_m = self.px_per_m(index, bounds, outline_px_per_m);
        // Where `part` of all that is allowed is.
        let close_enough = |level: &ModelLevel, part: f64| {
            let (max_px, mean_px) = (level.max_error_m * px_per_m, level.mean_error_m * px_per_m);
            // The video shows a real thing's own shading, and where that ends its own shadow has to.
            let facets_show = thing.role == Role::Real
                && level.largest_facet_m * outline_px_per_m > part * LARGEST_REAL_FACET_PX;
            is_close_enough(max_px, mean_px, part * self.max_silhouette_error_px) && !facets_show
        };
        let mut levels = thing.levels.iter();
        let surely = levels
            .rposition(|level| close_enough(level, COARSER_AT))
            .unwrap_or(0);
        let may_stay = |level: &ModelLevel| before > surely && close_enough(level, 1.0);
        match thing.levels.get(before).is_some_and(may_stay) {
            true => before,
            false => surely,
        }
    }

    /// By how many pixels a metre of a thing's error shows at most: in its outline, or in the edge of a shadow.
    fn px_per_m(&self, index: usize, bounds: &Bounds, outline_px_per_m: f64) -> f64 {
        let thing = &self.things[index];
        let mut px_per_m = outline_px_per_m;
        if thing.casts && !self.lights.is_empty() {
            px_per_m *= OWN_SHADOW;
        }
        for &light in self.lights.iter().filter(|_| thing.casts) {
            let others = self.things.iter().zip(&self.placed).enumerate();
            for (_, (other, placed)) in others.filter(|(other, _)| *other != index) {
                let Some(placed) = placed
                    .as_ref()
                    .filter(|placed| may_shade(light, bounds, &placed.bounds))
                else {
                    continue;
                };
                let place = |point: DVec3| placed.world_from_thing.transform_point3(point);
                let receivers = other.receivers.iter().map(|corners| corners.map(place));
                px_per_m = px_per_m.max(shadow_px_per_m(bounds, light, receivers, &self.view));
            }
        }
        px_per_m
    }
}

/// The place of a thing in this frame, in world space.
struct PlacedBounds {
    bounds: Bounds,
    world_from_thing: DAffine3,
}

/// Whether a shadow can fall from one box on another, told by the balls around them; true in doubt.
fn may_shade(light: LightPlace, caster: &Bounds, receiver: &Bounds) -> bool {
    let ball = |bounds: &Bounds| {
        let radius = 0.5 * (bounds.high - bounds.low).length();
        (0.5 * (bounds.low + bounds.high), radius)
    };
    let ((one, one_radius), (other, other_radius)) = (ball(caster), ball(receiver));
    match light {
        LightPlace::Along(direction) => {
            let way = other - one;
            let along = way.dot(direction);
            let aside = (way - direction * along).length();
            aside <= one_radius + other_radius && along >= -(one_radius + other_radius)
        }
        LightPlace::Point(light) => {
            let (one, other) = (one - light, other - light);
            let farther = other.length() + other_radius >= one.length() - one_radius;
            let half_angle = |way: DVec3, radius: f64| (radius / way.length()).min(1.0).asin();
            let apart = one.angle_between(other);
            let angles = half_angle(one, one_radius) + half_angle(other, other_radius);
            farther && (apart.is_nan() || angles.is_nan() || apart <= angles)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_may_shade_what_lies_behind_it_and_not_what_lies_beside_or_before() {
        let around = |center: DVec3| Bounds {
            low: center - 0.05,
            high: center + 0.05,
        };
        let caster = around(DVec3::new(0.0, 0.0, 0.2));
        let lamp = LightPlace::Point(DVec3::new(0.0, 0.0, 0.5));
        let sun = LightPlace::Along(DVec3::NEG_Z);
        for light in [lamp, sun] {
            assert!(may_shade(light, &caster, &around(DVec3::ZERO)), "{light:?}");
            assert!(!may_shade(light, &caster, &around(DVec3::X)), "{light:?}");
        }
        assert!(!may_shade(
            lamp,
            &caster,
            &around(DVec3::new(0.0, 0.0, 0.45))
        ));
        assert!(!may_shade(sun, &caster, &around(DVec3::new(0.0, 0.0, 0.6))));
        // A lamp within a thing lights and shades all ways.
        let within = LightPlace::Point(DVec3::new(0.0, 0.0, 0.2));
        assert!(may_shade(within, &caster, &around(DVec3::X)));
    }
}
