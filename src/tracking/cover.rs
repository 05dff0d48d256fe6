//! What markers of one anchor hide from each other: on a cube nothing, in a room or on two boxes now and then.

use glam::{DAffine3, DVec3};

use crate::scene::Marker;

/// What lies in front of a marker's plane by less than this part of the marker's side hides nothing of it.
const IN_FRONT: f64 = 1e-3;

/// The square of a marker that may lie between another one and the camera.
pub(super) struct Cover {
    marker_from_anchor: DAffine3,
    center_m: DVec3,
    half_m: f64,
}

impl Cover {
    /// Those of `markers` that may hide some of the one at `index` from where its front is seen: they have a corner before
    /// its plane.
    pub fn of(markers: &[Marker], index: usize) -> Vec<Self> {
        let seen = &markers[index];
        let is_before = |corner_m: DVec3| {
            seen.normal().dot(corner_m - seen.center_m()) > IN_FRONT * seen.size_m
        };
        let others = markers.iter().enumerate().filter(|(k, _)| *k != index);
        others
            .filter(|(_, other)| other.corners_m().into_iter().any(is_before))
            .map(|(_, other)| Self {
                marker_from_anchor: other.anchor_from_marker.inverse(),
                center_m: other.center_m(),
                half_m: other.size_m / 2.0,
            })
            .collect()
    }

    /// Whether it may hide anything within `radius_m` around a point from an eye; metres.
    fn is_near(&self, eye_m: DVec3, middle_m: DVec3, radius_m: f64) -> bool {
        let way_m = middle_m - eye_m;
        let share = (self.center_m - eye_m).dot(way_m) / way_m.length_squared();
        let nearest_m = eye_m + way_m * share.clamp(0.0, 1.0);
        let reach_m = radius_m + self.half_m * std::f64::consts::SQRT_2;
        nearest_m.distance_squared(self.center_m) < reach_m * reach_m
    }

    /// Whether the way from an eye to a point goes through it; metres.
    fn hides(&self, eye_m: DVec3, point_m: DVec3) -> bool {
        let eye_m = self.marker_from_anchor.transform_point3(eye_m);
        let point_m = self.marker_from_anchor.transform_point3(point_m);
        if eye_m.z * point_m.z >= 0.0 {
            return false;
        }
        let through_m = eye_m.lerp(point_m, eye_m.z / (eye_m.z - point_m.z));
        through_m.truncate().abs().max_element() < self.half_m
    }
}

/// What of a marker others hide from a camera.
pub(super) struct HiddenPart<'a> {
    eye_m: DVec3,
    covers: Vec<&'a Cover>,
}

impl<'a> HiddenPart<'a> {
    /// What a camera does not see within `radius_m` around a marker's middle, metres.
    pub fn of(
        covers: &'a [Cover],
        (middle_m, radius_m): (DVec3, f64),
        camera_from_anchor: &DAffine3,
    ) -> Self {
        let mut hidden = Self {
            eye_m: DVec3::ZERO,
            covers: Vec::new(),
        };
        if !covers.is_empty() {
            hidden.eye_m = camera_from_anchor.inverse().translation;
            let near = covers
                .iter()
                .filter(|cover| cover.is_near(hidden.eye_m, middle_m, radius_m));
            hidden.covers = near.collect();
        }
        hidden
    }

    /// Whether it has a point of the anchor's space, metres.
    pub fn has(&self, point_m: DVec3) -> bool {
        let mut covers = self.covers.iter();
        covers.any(|cover| cover.hides(self.eye_m, point_m))
    }
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2};

    use super::*;
    use crate::scene::Family;

    fn placed(id: u32, at_m: DVec3, turn: DQuat) -> Marker {
        Marker {
            anchor_from_marker: DAffine3::from_rotation_translation(turn, at_m),
            ..Marker::alone(Family::TAG36H11, id, 0.1)
        }
    }

    #[test]
    fn what_stands_before_a_marker_hides_it_and_what_stands_behind_does_not() {
        let markers = [
            placed(0, DVec3::ZERO, DQuat::IDENTITY),
            // Upright beside it, facing left.
            placed(
                1,
                DVec3::new(0.06, 0.0, 0.06),
                DQuat::from_rotation_y(-std::f64::consts::FRAC_PI_2),
            ),
            placed(2, DVec3::new(0.3, 0.0, -0.2), DQuat::IDENTITY),
        ];
        let covers = Cover::of(&markers, 0);
        assert_eq!(covers.len(), 1, "what lies deeper hides nothing");
        let right_half = DVec2::new(0.04, 0.0).extend(0.0);
        let left_half = -right_half;
        // Where a camera looks is no matter.
        let looking_from = |eye_m: DVec3| DAffine3::from_translation(-eye_m);
        let from_right = looking_from(DVec3::new(0.5, 0.0, 0.25));
        let hidden = HiddenPart::of(&covers, (DVec3::ZERO, 0.08), &from_right);
        assert!(hidden.has(right_half) && hidden.has(left_half));
        let from_above = looking_from(DVec3::new(0.12, 0.0, 0.5));
        let hidden = HiddenPart::of(&covers, (DVec3::ZERO, 0.08), &from_above);
        assert!(!hidden.has(left_half));
        let from_left = looking_from(DVec3::new(-0.5, 0.0, 0.3));
        let hidden = HiddenPart::of(&covers, (DVec3::ZERO, 0.08), &from_left);
        assert!(!hidden.has(right_half) && !hidden.has(left_half));
    }

    #[test]
    fn faces_of_a_cube_hide_nothing() {
        let half_m = 0.07;
        let turns = [
            DQuat::IDENTITY,
            DQuat::from_rotation_x(1.5),
            DQuat::from_rotation_x(-1.5),
            DQuat::from_rotation_y(1.5),
            DQuat::from_rotation_y(-1.5),
            DQuat::from_rotation_y(3.1),
        ];
        let markers: Vec<Marker> = (0..6)
            .map(|k| placed(k as u32, turns[k] * DVec3::Z * half_m, turns[k]))
            .collect();
        assert!((0..6).all(|k| Cover::of(&markers, k).is_empty()));
    }
}
