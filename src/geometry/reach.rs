//! How far a thing and its shadow reach in the picture, so that nothing is drawn where neither can be.

use glam::{DAffine3, DVec3};

use super::bounds::{Bounds, HalfSpace};
use super::camera::Intrinsics;
use super::shadow_volume::LightPlace;

/// Nearer than this in front of the camera a point's pixel says nothing of its neighbours', metres.
const NEAREST_M: f64 = 1e-3;

/// A rectangle of pixels: the first column and row, and those past the last.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PixelRect {
    /// First column and row.
    pub low: [u32; 2],
    /// Column and row past the last.
    pub high: [u32; 2],
}

impl PixelRect {
    /// No pixel.
    pub const NONE: Self = Self {
        low: [0; 2],
        high: [0; 2],
    };

    /// The whole picture.
    pub fn whole(size_px: [u32; 2]) -> Self {
        Self {
            low: [0; 2],
            high: size_px,
        }
    }

    /// Whether it has no pixel.
    pub fn is_empty(&self) -> bool {
        (0..2).any(|axis| self.low[axis] >= self.high[axis])
    }

    /// The smallest rectangle around both.
    pub fn union(self, other: Self) -> Self {
        if self.is_empty() || other.is_empty() {
            return if self.is_empty() { other } else { self };
        }
        Self {
            low: [0, 1].map(|axis| self.low[axis].min(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    /// The pixels that are not in `hole`, in rectangles beside each other, some of which may be empty.
    pub fn without(self, hole: Self) -> [Self; 4] {
        let hole = self.intersection(hole);
        if hole.is_empty() {
            return [self, Self::NONE, Self::NONE, Self::NONE];
        }
        let ([left, top], [right, bottom]) = (self.low, self.high);
        let ([hole_left, hole_top], [hole_right, hole_bottom]) = (hole.low, hole.high);
        let rect = |low, high| Self { low, high };
        [
            rect([left, top], [right, hole_top]),
            rect([left, hole_top], [hole_left, hole_bottom]),
            rect([hole_right, hole_top], [right, hole_bottom]),
            rect([left, hole_bottom], [right, bottom]),
        ]
    }

    /// The pixels in both.
    pub fn intersection(self, other: Self) -> Self {
        Self {
            low: [0, 1].map(|axis| self.low[axis].max(other.low[axis])),
            high: [0, 1].map(|axis| self.high[axis].min(other.high[axis])),
        }
    }
}

/// The pixels that a thing with these world-space corners can cover, with a margin for its edges' samples.
pub fn covered(
    corners: &[DVec3],
    camera_from_world: &DAffine3,
    intrinsics: &Intrinsics,
) -> PixelRect {
    const MARGIN_PX: f64 = 2.0;
    let whole = PixelRect::whole(intrinsics.size_px);
    let mut pixels = Vec::with_capacity(corners.len());
    for corner in corners {
        let place = camera_from_world.transform_point3(*corner);
        if place.z < NEAREST_M {
            return whole;
        }
        pixels.push(
            intrinsics
                .pixel_from_plane(place.truncate() / place.z)
                .extend(0.0),
        );
    }
    let Some(bounds) = Bounds::around(pixels) else {
        return PixelRect::NONE;
    };
    // Casts saturate: what lies outside the picture, however far, becomes its edge.
    let [left, top] = [bounds.low.x, bounds.low.y].map(|low| (low - MARGIN_PX).floor() as u32);
    let [right, bottom] =
        [bounds.high.x, bounds.high.y].map(|high| (high + MARGIN_PX + 1.0).ceil() as u32);
    whole.intersection(PixelRect {
        low: [left, top],
        high: [right, bottom],
    })
}

/// The pixels in which the shadow of a thing with these corners can fall on anything within `receivers`, the thing
/// itself included; all of world space.
///
/// The shadow is a cone from the light. Where all its rays leave the receivers' box through one side, what matters of it
/// is the hull of the corners and of their images on that side. Each such side gives a rectangle that holds the shadow,
/// and so does what all of them share.
pub fn shadowed(
    corners: &[DVec3; 8],
    light: LightPlace,
    receivers: &Bounds,
    camera_from_world: &DAffine3,
    intrinsics: &Intrinsics,
) -> PixelRect {
    let mut rect = PixelRect::whole(intrinsics.size_px);
    for axis in 0..3 {
        for (side, outward) in [(receivers.low[axis], -1.0), (receivers.high[axis], 1.0)] {
            // A side through which light comes in cuts nothing off, even where the thing lies in it.
            let images = corners.map(|corner| {
                let way = match light {
                    LightPlace::Point(light) => corner - light,
                    LightPlace::Along(direction) => direction,
                };
                let leaves = outward * way[axis] > 0.0;
                let ahead_m = (outward * (side - corner[axis])).max(0.0);
                leaves.then(|| corner + way * (ahead_m / (outward * way[axis])))
            });
            let images: Vec<DVec3> = images.iter().flatten().copied().collect();
            if images.len() == corners.len() && images.iter().all(|image| image.is_finite()) {
                let hull = [&images[..], &corners[..]].concat();
                rect = rect.intersection(covered(&hull, camera_from_world, intrinsics));
            }
        }
    }
    rect
}

/// A half-space that holds all receivers, and that all shadow of a thing with these corners leaves for good: its shadow
/// volume may end there. `None` where there is none. All in world space.
///
/// Of the receivers' sides it is the one that the thing's shadow reaches first.
pub fn shadow_end(
    corners: &[DVec3; 8],
    light: LightPlace,
    receivers: &Bounds,
) -> Option<HalfSpace> {
    // What lies on a side is not to be lost to rounding.
    let margin_m = 1e-2 * (receivers.high - receivers.low).length();
    let sides = [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|axis| {
        [
            HalfSpace {
                inward: axis,
                offset_m: axis.dot(receivers.low) - margin_m,
            },
            HalfSpace {
                inward: -axis,
                offset_m: -axis.dot(receivers.high) - margin_m,
            },
        ]
    });
    // How many times the way from the light to a corner leads from there to the side: the longest of all corners.
    let stretch = |side: &HalfSpace| {
        let stretches = corners.map(|corner| {
            let way = match light {
                LightPlace::Point(light) => corner - light,
                LightPlace::Along(direction) => direction,
            };
            match side.inward.dot(way) {
                falling if falling < -1e-3 * way.length() => side.depth_of(corner) / -falling,
                _ => f64::INFINITY,
            }
        });
        stretches.into_iter().fold(0.0, f64::max)
    };
    sides
        .map(|side| (stretch(&side), side))
        .filter(|(stretch, _)| stretch.is_finite())
        .min_by(|(one, _), (other, _)| one.total_cmp(other))
        .map(|(_, side)| side)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;
    use glam::{DQuat, DVec2};

    const CAMERA: Intrinsics = Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(600.0, 600.0),
        center_px: DVec2::new(319.5, 239.5),
        distortion: Distortion::NONE,
    };

    fn looking_down() -> DAffine3 {
        // From one metre above, x right.
        let turned = DQuat::from_rotation_x(std::f64::consts::PI);
        DAffine3::from_rotation_translation(turned, DVec3::new(0.0, 0.0, 1.0))
    }

    fn unit_box() -> Bounds {
        Bounds {
            low: DVec3::new(-0.05, -0.05, 0.0),
            high: DVec3::new(0.05, 0.05, 0.1),
        }
    }

    #[test]
    fn every_point_of_a_shadow_lies_in_its_rectangle() {
        let caster = unit_box();
        let receivers = Bounds {
            low: DVec3::new(-0.4, -0.3, -0.02),
            high: DVec3::new(0.4, 0.3, 0.2),
        };
        let lights = [
            LightPlace::Point(DVec3::new(-0.3, 0.1, 0.5)),
            LightPlace::Point(DVec3::new(0.2, 0.2, 0.15)),
            LightPlace::Point(DVec3::new(0.0, 0.0, 0.05)),
            LightPlace::Along(DVec3::new(0.6, 0.0, -0.8)),
            LightPlace::Along(DVec3::new(1.0, 0.0, 0.0)),
        ];
        for light in lights {
            let rect = shadowed(
                &caster.corners(),
                light,
                &receivers,
                &looking_down(),
                &CAMERA,
            );
            // Points of the box, carried away from the light, as far as the receivers' box goes.
            for step in 0..4000 {
                let grid = |divisor: usize, sides: usize| {
                    (step / divisor % sides) as f64 / (sides - 1) as f64
                };
                let share = DVec3::new(grid(1, 5), grid(5, 5), grid(25, 4));
                let point = caster.low + (caster.high - caster.low) * share;
                let way = grid(100, 40) * 4.0;
                let shadow = match light {
                    LightPlace::Point(light) => point + (point - light) * way,
                    LightPlace::Along(direction) => point + direction * way,
                };
                if shadow.cmplt(receivers.low).any() || shadow.cmpgt(receivers.high).any() {
                    continue;
                }
                let place = looking_down().transform_point3(shadow);
                let pixel = CAMERA.pixel_from_plane(place.truncate() / place.z);
                let inside_picture =
                    pixel.cmpge(DVec2::ZERO).all() && pixel.x < 640.0 && pixel.y < 480.0;
                let inside = (0..2).all(|axis| {
                    f64::from(rect.low[axis]) <= pixel[axis]
                        && pixel[axis] <= f64::from(rect.high[axis])
                });
                assert!(
                    inside || !inside_picture,
                    "{light:?} {shadow} {pixel} {rect:?}"
                );
            }
        }
    }

    #[test]
    fn a_side_in_the_caster_s_own_plane_cuts_off_what_light_leaves_through_it_alone() {
        // A card at the very top of all receivers: light comes in there, and its shadow lies on the table.
        let receivers = Bounds {
            low: DVec3::new(-0.6, -0.5, 0.0),
            high: DVec3::new(0.6, 0.5, 0.12),
        };
        let card = Bounds {
            low: DVec3::new(-0.02, -0.03, 0.12),
            high: DVec3::new(0.06, 0.03, 0.12),
        };
        let reached = |light: LightPlace| {
            shadowed(&card.corners(), light, &receivers, &looking_down(), &CAMERA)
        };
        // From (-0.3, 0, 0.6) the card's corners fall on x = 0.05 to 0.15 of the table: pixels 349.5 to 409.5.
        let lamp = reached(LightPlace::Point(DVec3::new(-0.3, 0.0, 0.6)));
        assert!(lamp.low[0] <= 349 && lamp.high[0] >= 410, "{lamp:?}");
        assert!(lamp.high[0] <= 414, "{lamp:?}");
        let sun = reached(LightPlace::Along(DVec3::new(0.6, 0.0, -0.8)));
        assert!(sun.high[0] >= 409, "{sun:?}");
        // A ray that hardly leaves through a side leaves it very far away.
        let nearly_above = DVec3::new(-0.02 - 1e-9, 0.0, 0.6);
        assert!(!reached(LightPlace::Point(nearly_above)).is_empty());
    }

    #[test]
    fn a_rectangle_without_another_has_each_other_pixel_once() {
        let whole = PixelRect {
            low: [2, 1],
            high: [9, 7],
        };
        let has = |rect: &PixelRect, x: u32, y: u32| {
            (rect.low[0]..rect.high[0]).contains(&x) && (rect.low[1]..rect.high[1]).contains(&y)
        };
        for (low, high) in [
            ([4, 3], [6, 5]),
            ([0, 0], [3, 20]),
            ([2, 1], [9, 7]),
            ([5, 5], [12, 12]),
            ([20, 2], [30, 4]),
            ([4, 4], [4, 6]),
        ] {
            let hole = PixelRect { low, high };
            let rest = whole.without(hole);
            for (x, y) in (0..32).flat_map(|x| (0..24).map(move |y| (x, y))) {
                let wanted = has(&whole, x, y) && !has(&hole, x, y);
                let found = rest.iter().filter(|rect| has(rect, x, y)).count();
                assert_eq!(found, usize::from(wanted), "{hole:?} {x} {y}");
            }
        }
    }

    #[test]
    fn beyond_the_end_of_a_shadow_nothing_can_be_shaded() {
        let receivers = Bounds {
            low: DVec3::new(-0.4, -0.3, -0.02),
            high: DVec3::new(0.4, 0.3, 0.2),
        };
        let corners = unit_box().corners();
        let from = |light: LightPlace| shadow_end(&corners, light, &receivers);
        // From above the table ends it, from the side a wall.
        let above = from(LightPlace::Point(DVec3::new(-0.3, 0.1, 0.5))).expect("an end");
        assert_eq!(above.inward, DVec3::Z);
        let aside = from(LightPlace::Along(DVec3::new(-0.9, 0.0, 0.1).normalize()));
        assert_eq!(aside.expect("an end").inward, DVec3::X);
        // All receivers and the thing lie before it.
        for point in receivers.corners().iter().chain(&corners) {
            assert!(above.depth_of(*point) > 0.0);
        }
        // From within the box light goes all ways.
        assert_eq!(from(LightPlace::Point(DVec3::new(0.0, 0.0, 0.05))), None);
        // Another space tells the same.
        let turned = DAffine3::from_rotation_translation(
            DQuat::from_rotation_y(0.7),
            DVec3::new(0.1, -0.2, 0.3),
        );
        let there = turned.inverse().transform_point3(corners[3]);
        let depth = above.in_space(&turned).depth_of(there);
        assert!((depth - above.depth_of(corners[3])).abs() < 1e-12);
    }

    #[test]
    fn a_lamp_above_keeps_the_rectangle_small_and_a_thing_behind_the_camera_does_not() {
        let receivers = Bounds {
            low: DVec3::new(-0.6, -0.5, 0.0),
            high: DVec3::new(0.6, 0.5, 0.1),
        };
        let lamp = LightPlace::Point(DVec3::new(0.0, 0.0, 0.6));
        let rect = shadowed(
            &unit_box().corners(),
            lamp,
            &receivers,
            &looking_down(),
            &CAMERA,
        );
        // Shadow of the top's edge: 0.05 · 0.6 / 0.5 = 0.06 m on the table, 36 px; the top itself: 33 px.
        assert_eq!(
            rect,
            PixelRect {
                low: [281, 201],
                high: [359, 279]
            }
        );
        let behind = [DVec3::new(0.0, 0.0, 2.0)];
        assert_eq!(
            covered(&behind, &looking_down(), &CAMERA),
            PixelRect::whole([640, 480])
        );
        let aside = [DVec3::new(9.0, 0.0, 0.0)];
        assert!(covered(&aside, &looking_down(), &CAMERA).is_empty());
    }
}
