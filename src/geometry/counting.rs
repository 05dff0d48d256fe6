//! Which way of counting shadow volumes is right: depth-pass, which needs no caps but an eye in the light, or
//! depth-fail, which is right everywhere (Everitt & Kilgard 2002, section 2).

use glam::{DAffine3, DVec2, DVec3};

use super::bounds::Bounds;
use super::camera::Intrinsics;
use super::shadow_volume::LightPlace;

/// How the volumes that a surface lies in are counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Counting {
    /// The sides in front of the surface. Caps are not needed, for the near one lies on the caster, which is drawn, and
    /// the far one behind all else.
    DepthPass,
    /// The sides and caps behind the surface.
    DepthFail,
}

/// Depth-pass where no point of the near rectangle can lie in the shadow of anything within `caster`: the hull of that
/// rectangle and the light, in which all that could shade it must lie, is apart from the box.
///
/// All in the caster's space, metres; `near` are the rectangle's corners in turn ([`near_corners`]).
pub fn counting(caster: &Bounds, light: LightPlace, near: &[DVec3; 4]) -> Counting {
    let box_corners = caster.corners();
    // Rounding of the GPU's own arithmetic, which goes by how far from the anchor's and the camera's origins things are.
    let lengths = box_corners.iter().chain(near).map(|corner| corner.length());
    let slack = 4e-6 * lengths.fold(0.0, f64::max);
    let box_is_beyond = |normal: DVec3, point: DVec3| {
        let length = normal.length();
        length > 0.0
            && box_corners
                .iter()
                .all(|corner| normal.dot(*corner - point) > slack * length)
    };
    // From each corner to the light.
    let ways = near.map(|corner| match light {
        LightPlace::Point(light) => light - corner,
        LightPlace::Along(direction) => -direction,
    });

    let beside = (0..4).any(|side| {
        let (corner, next) = (near[side], near[(side + 1) % 4]);
        let normal = (next - corner).cross(ways[side]);
        // Away from the opposite corner, which lies in the hull.
        let outward = if normal.dot(near[(side + 2) % 4] - corner) > 0.0 {
            -normal
        } else {
            normal
        };
        box_is_beyond(outward, corner)
    });
    let behind = {
        let normal = (near[1] - near[0]).cross(near[3] - near[0]);
        let away = if normal.dot(ways[0]) > 0.0 {
            -normal
        } else {
            normal
        };
        box_is_beyond(away, near[0])
    };
    let apart_along_an_axis = [DVec3::X, DVec3::Y, DVec3::Z].iter().any(|&axis| {
        [axis, -axis].iter().any(|&outward| {
            let reaches = |corner: DVec3, way: DVec3| match light {
                LightPlace::Point(_) => outward.dot(corner).max(outward.dot(corner + way)),
                LightPlace::Along(_) if outward.dot(way) > 0.0 => f64::INFINITY,
                LightPlace::Along(_) => outward.dot(corner),
            };
            let hull = near
                .iter()
                .zip(ways)
                .map(|(&corner, way)| reaches(corner, way))
                .fold(f64::NEG_INFINITY, f64::max);
            box_corners
                .iter()
                .all(|corner| outward.dot(*corner) > hull + slack)
        })
    });
    if beside || behind || apart_along_an_axis {
        Counting::DepthPass
    } else {
        Counting::DepthFail
    }
}

/// The corners of the rectangle at depth `near_m` through which the camera sees, in turn, with a pixel's margin.
pub fn near_corners(
    intrinsics: &Intrinsics,
    near_m: f64,
    anchor_from_camera: &DAffine3,
) -> [DVec3; 4] {
    let [width, height] = intrinsics.size_px.map(f64::from);
    [
        DVec2::new(-1.5, -1.5),
        DVec2::new(width + 0.5, -1.5),
        DVec2::new(width + 0.5, height + 0.5),
        DVec2::new(-1.5, height + 0.5),
    ]
    .map(|pixel| {
        let place = intrinsics.plane_from_pixel(pixel).extend(1.0) * near_m;
        anchor_from_camera.transform_point3(place)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;

    const NEAR: [DVec3; 4] = [
        DVec3::new(-0.01, -0.01, 1.0),
        DVec3::new(0.01, -0.01, 1.0),
        DVec3::new(0.01, 0.01, 1.0),
        DVec3::new(-0.01, 0.01, 1.0),
    ];

    fn unit_box(low: DVec3) -> Bounds {
        Bounds {
            low,
            high: low + 0.2,
        }
    }

    #[test]
    fn depth_fail_exactly_where_a_box_can_shade_the_near_rectangle() {
        // Sampled ways from the rectangle to the light against the box: a box that is met must be told.
        let lights = [
            LightPlace::Point(DVec3::new(0.0, 0.0, 2.0)),
            LightPlace::Point(DVec3::new(1.0, 0.3, 1.5)),
            LightPlace::Point(DVec3::new(0.2, -0.4, 0.1)),
            LightPlace::Along(DVec3::new(0.0, 0.0, -1.0)),
            LightPlace::Along(DVec3::new(-0.8, 0.0, -0.6)),
        ];
        let steps = |count: usize| (0..count).map(move |step| step as f64 / (count - 1) as f64);
        let (mut met, mut passed) = (0, 0);
        for light in lights {
            for x in steps(12) {
                for y in steps(12) {
                    for z in steps(12) {
                        let low = DVec3::new(x, y, z) * 2.4 - DVec3::new(1.2, 1.2, 0.2);
                        let caster = unit_box(low);
                        let shades = steps(4).any(|u| {
                            steps(4).any(|v| {
                                let corner = NEAR[0].lerp(NEAR[1], u) + (NEAR[3] - NEAR[0]) * v;
                                steps(200).any(|share| {
                                    let point = match light {
                                        LightPlace::Point(light) => corner.lerp(light, share),
                                        LightPlace::Along(way) => corner - way * 3.0 * share,
                                    };
                                    caster.contains(point)
                                })
                            })
                        });
                        let counting = counting(&caster, light, &NEAR);
                        assert!(
                            !shades || counting == Counting::DepthFail,
                            "{light:?} {low}"
                        );
                        met += usize::from(shades);
                        passed += usize::from(counting == Counting::DepthPass && !shades);
                    }
                }
            }
        }
        // Nearly all that do not shade are told apart.
        let all = 5 * 12 * 12 * 12;
        assert!(
            met > 20 && passed > (all - met) * 98 / 100,
            "{met} {passed} of {all}"
        );
    }

    #[test]
    fn the_near_corners_are_those_of_the_picture() {
        let intrinsics = Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::splat(500.0),
            center_px: DVec2::new(319.5, 239.5),
            distortion: Distortion::NONE,
        };
        let corners = near_corners(&intrinsics, 0.5, &DAffine3::IDENTITY);
        let half = DVec2::new(321.0, 241.0) / 500.0 * 0.5;
        assert!((corners[0] - DVec3::new(-half.x, -half.y, 0.5)).length() < 1e-12);
        assert!((corners[2] - DVec3::new(half.x, half.y, 0.5)).length() < 1e-12);
    }
}
