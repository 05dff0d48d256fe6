//! How far outlines and shadow edges move in the picture, in pixels for a metre that a surface is off: bounds that are
//! never too small, for [`is_close_enough`](super::levels::is_close_enough).
//!
//! A surface and its coarser version both lie in the box of the former, which is convex; so a bound on the derivative
//! of the projection over the part of a box that the camera sees bounds each movement there.

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::camera::Intrinsics;
use super::shadow_volume::LightPlace;

/// The bounds hold for movements up to this many pixels: so far beyond the picture's edge they are taken.
pub const LARGEST_MOVE_PX: f64 = 100.0;

/// Where light grazes a receiver at less than this cosine, its shadow's edge is fainter by as much as it is longer.
const LEAST_COSINE: f64 = 0.5;

/// What the camera sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutlineView {
    /// The camera; pictures are without its distortion.
    pub intrinsics: Intrinsics,
    /// Its pose.
    pub camera_from_world: DAffine3,
    /// What lies nearer is not drawn, metres.
    pub near_m: f64,
}

/// By how much a placement lengthens at most.
pub fn largest_scale(world_from_object: &DAffine3) -> f64 {
    let gram = world_from_object.matrix3.transpose() * world_from_object.matrix3;
    // No eigenvalue is above the largest sum of a row's sizes; for a rotation after a scale it is the largest exactly.
    let sums = gram
        .to_cols_array_2d()
        .map(|row| row.map(f64::abs).iter().sum::<f64>());
    sums.into_iter().fold(0.0, f64::max).sqrt()
}

/// How many pixels a point within `bounds` (world space) moves at most for a metre; 0 if none is seen.
pub fn outline_px_per_m(bounds: &Bounds, view: &OutlineView) -> f64 {
    let seen = seen_corners(bounds, view);
    let nearest_m = seen
        .iter()
        .map(|corner| corner.z)
        .fold(f64::INFINITY, f64::min);
    // The derivative of (x/z, y/z) has the norm √(1 + (x² + y²)/z²) / z.
    let slant = seen
        .iter()
        .map(|corner| corner.length() / corner.z)
        .fold(0.0, f64::max);
    view.intrinsics.focal_px.max_element() * slant / nearest_m
}

/// How many pixels the edge of a shadow moves at most for a metre that the caster's surface, within `caster`, is off.
/// The shadow falls on `receivers`, triangles counter-clockwise seen from outside; all in world space. Infinite where
/// the light may lie within the caster. On receivers that the light grazes (at a cosine below 0.5) edges may move
/// farther, but are as much fainter.
pub fn shadow_px_per_m(
    caster: &Bounds,
    light: LightPlace,
    receivers: impl IntoIterator<Item = [DVec3; 3]>,
    view: &OutlineView,
) -> f64 {
    receivers
        .into_iter()
        .filter_map(|receiver| cast(caster, light, &receiver))
        .map(|cast| match outline_px_per_m(&cast.region, view) {
            0.0 => 0.0,
            seen_px_per_m => cast.lengthening * seen_px_per_m,
        })
        .fold(0.0, f64::max)
}

/// Where the shadow of what lies in a box can fall on a triangle.
struct Cast {
    region: Bounds,
    /// How much longer than a movement of the caster the shadow's is, at most.
    lengthening: f64,
}

/// `None` where no shadow falls, or none that changes anything as the triangle is turned from the light.
///
/// A point's image on a plane moves by what the point moves across the ray, enlarged by how much farther from the light
/// the plane is, and divided by the cosine between ray and normal.
fn cast(caster: &Bounds, light: LightPlace, receiver: &[DVec3; 3]) -> Option<Cast> {
    let [a, b, c] = *receiver;
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let triangle = Bounds::around(*receiver)?;
    match light {
        LightPlace::Along(direction) => {
            let cosine = -normal.dot(direction);
            if cosine <= 0.0 {
                return None;
            }
            let ways = caster
                .corners()
                .map(|corner| normal.dot(corner - a) / cosine);
            // Rounding must not lose the shadow of what lies on the plane.
            let slack_m = 1e-9 * farthest_m(caster, a);
            if ways.iter().all(|way| *way < -slack_m) {
                return None;
            }
            let images = caster.corners().into_iter().zip(ways);
            let images = images.map(|(corner, way)| corner + direction * way);
            Some(Cast {
                region: overlap(&triangle, &Bounds::around(images)?)?,
                lengthening: 1.0 / cosine.max(LEAST_COSINE),
            })
        }
        LightPlace::Point(light) => {
            let depth_m = normal.dot(light - a);
            if depth_m <= 0.0 {
                return None;
            }
            // How deep below the light, towards the plane, the caster is.
            let depths_m = caster.corners().map(|corner| normal.dot(light - corner));
            let least_m = depths_m.into_iter().fold(f64::INFINITY, f64::min);
            let most_m = depths_m.into_iter().fold(0.0, f64::max);
            if most_m <= 0.0 || least_m > depth_m * (1.0 + 1e-9) {
                return None;
            }
            let (region, enlargement) = if least_m > 0.0 {
                let images = caster.corners().into_iter().zip(depths_m);
                let images =
                    images.map(|(corner, below_m)| light + (corner - light) * (depth_m / below_m));
                (
                    overlap(&triangle, &Bounds::around(images)?)?,
                    depth_m / least_m,
                )
            } else {
                // The caster reaches as high as the light: its shadow has no end.
                (
                    triangle,
                    farthest_m(&triangle, light) / nearest_m(caster, light),
                )
            };
            let cosine = depth_m / farthest_m(&region, light);
            Some(Cast {
                region,
                lengthening: enlargement / cosine.max(LEAST_COSINE),
            })
        }
    }
}

fn overlap(one: &Bounds, other: &Bounds) -> Option<Bounds> {
    let (low, high) = (one.low.max(other.low), one.high.min(other.high));
    // A flat triangle's plane and the images on it differ by rounding.
    let slack_m = DVec3::splat(1e-9 * (one.high - one.low).length());
    low.cmple(high + slack_m).all().then(|| Bounds {
        low: low.min(high),
        high: low.max(high),
    })
}

fn nearest_m(bounds: &Bounds, point: DVec3) -> f64 {
    (point.clamp(bounds.low, bounds.high) - point).length()
}

fn farthest_m(bounds: &Bounds, point: DVec3) -> f64 {
    let away = (bounds.low - point).abs().max((bounds.high - point).abs());
    away.length()
}

/// In camera space the corners of what is both within the bounds and seen, [`LARGEST_MOVE_PX`] beyond the picture
/// included.
fn seen_corners(bounds: &Bounds, view: &OutlineView) -> Vec<DVec3> {
    let [width, height] = view.intrinsics.size_px.map(f64::from);
    let margin = glam::DVec2::splat(0.5 + LARGEST_MOVE_PX);
    let low = view.intrinsics.plane_from_pixel(-margin);
    let high = view
        .intrinsics
        .plane_from_pixel(glam::DVec2::new(width - 1.0, height - 1.0) + margin);
    // Half-spaces `dot(normal, p) >= offset`.
    let seen = [
        (DVec3::Z, view.near_m),
        (DVec3::new(1.0, 0.0, -low.x), 0.0),
        (DVec3::new(-1.0, 0.0, high.x), 0.0),
        (DVec3::new(0.0, 1.0, -low.y), 0.0),
        (DVec3::new(0.0, -1.0, high.y), 0.0),
    ];
    let corners = bounds
        .corners()
        .map(|corner| view.camera_from_world.transform_point3(corner));
    // A corner's bits say on which side of each axis it lies.
    const FACES: [[usize; 4]; 6] = [
        [0, 2, 6, 4],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 3, 7, 6],
        [0, 1, 3, 2],
        [4, 5, 7, 6],
    ];
    let mut found = Vec::new();
    for face in FACES {
        let polygon = face.map(|corner| corners[corner]).to_vec();
        found.extend(seen.iter().fold(polygon, |polygon, &(normal, offset)| {
            clipped(&polygon, normal, offset)
        }));
    }
    // Where the camera is within the bounds, what is seen begins at the near plane.
    let world_from_camera = view.camera_from_world.inverse();
    for (x, y) in [
        (low.x, low.y),
        (low.x, high.y),
        (high.x, low.y),
        (high.x, high.y),
    ] {
        let corner = DVec3::new(x, y, 1.0) * view.near_m;
        let place = world_from_camera.transform_point3(corner);
        if place.cmpge(bounds.low).all() && place.cmple(bounds.high).all() {
            found.push(corner);
        }
    }
    found
}

/// The part of a convex polygon in a half-space (Sutherland & Hodgman 1974).
fn clipped(polygon: &[DVec3], normal: DVec3, offset: f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (index, &from) in polygon.iter().enumerate() {
        let to = polygon[(index + 1) % polygon.len()];
        let [from_side, to_side] = [from, to].map(|point| normal.dot(point) - offset);
        if from_side >= 0.0 {
            kept.push(from);
        }
        if (from_side >= 0.0) != (to_side >= 0.0) {
            kept.push(from.lerp(to, from_side / (from_side - to_side)));
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;
    use glam::{DQuat, DVec2};

    /// From half a metre above the table's near edge, looking down at its middle.
    fn view() -> OutlineView {
        let camera_from_world = DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(std::f64::consts::PI - 0.8),
            DVec3::ZERO,
        ) * DAffine3::from_translation(-DVec3::new(0.02, -0.5, 0.5));
        OutlineView {
            intrinsics: Intrinsics {
                size_px: [640, 480],
                focal_px: DVec2::new(600.0, 590.0),
                center_px: DVec2::new(321.0, 236.0),
                distortion: Distortion::NONE,
            },
            camera_from_world,
            near_m: 0.01,
        }
    }

    fn thing() -> Bounds {
        Bounds {
            low: DVec3::new(-0.06, -0.05, 0.02),
            high: DVec3::new(0.07, 0.04, 0.13),
        }
    }

    fn table() -> [[DVec3; 3]; 2] {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        [
            [corner(-0.6, -0.5), corner(0.6, -0.5), corner(0.6, 0.7)],
            [corner(-0.6, -0.5), corner(0.6, 0.7), corner(-0.6, 0.7)],
        ]
    }

    /// Numbers in [0, 1) without end, the same in each run.
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// Pairs of points in a box, at most `apart_m` from each other.
    fn pairs(bounds: Bounds, apart_m: f64) -> impl Iterator<Item = [DVec3; 2]> {
        let mut number = numbers(7);
        let mut vector = move || DVec3::new(number(), number(), number());
        (0..200_000).map(move |_| {
            let point = bounds.low + (bounds.high - bounds.low) * vector();
            let away = (vector() * 2.0 - 1.0).normalize_or_zero() * apart_m;
            [point, (point + away).clamp(bounds.low, bounds.high)]
        })
    }

    fn pixel(view: &OutlineView, point: DVec3) -> Option<DVec2> {
        let place = view.camera_from_world.transform_point3(point);
        let pixel = view.intrinsics.pixel_from_plane(place.truncate() / place.z);
        let in_picture =
            pixel.cmpge(DVec2::splat(-0.5)).all() && pixel.cmple(DVec2::new(639.5, 479.5)).all();
        (place.z >= view.near_m && in_picture).then_some(pixel)
    }

    /// Grazing light moves edges farther; they are fainter by as much as the cosine falls below its floor.
    fn strength_at(cosine: f64) -> f64 {
        (cosine / LEAST_COSINE).min(1.0)
    }

    /// The largest movement over its bound, from pairs of points, where they are cast to and how strongly that shows.
    fn largest_share(
        pairs: impl Iterator<Item = [DVec3; 2]>,
        px_per_m: f64,
        view: &OutlineView,
        cast: impl Fn(DVec3) -> Option<DVec3>,
        strength: impl Fn(DVec3) -> f64,
    ) -> f64 {
        let share = |[one, two]: [DVec3; 2]| {
            let [one_px, two_px] = [pixel(view, cast(one)?)?, pixel(view, cast(two)?)?];
            Some(strength(one) * (two_px - one_px).length() / ((two - one).length() * px_per_m))
        };
        pairs.filter_map(share).fold(0.0, f64::max)
    }

    #[test]
    fn no_point_moves_farther_in_the_picture_than_its_bound() {
        for apart_m in [1e-5, 0.003] {
            for bounds in [
                thing(),
                Bounds {
                    low: DVec3::splat(-0.4),
                    high: DVec3::splat(0.4),
                },
            ] {
                let px_per_m = outline_px_per_m(&bounds, &view());
                let share = largest_share(pairs(bounds, apart_m), px_per_m, &view(), Some, |_| 1.0);
                assert!(share <= 1.0 && share > 0.7, "{apart_m} {bounds:?}: {share}");
            }
        }
    }

    #[test]
    fn no_shadow_edge_moves_farther_than_its_bound() {
        let lights = [
            (LightPlace::Point(DVec3::new(-0.1, 0.1, 0.5)), 0.4),
            (LightPlace::Point(DVec3::new(-0.4, 0.1, 0.25)), 0.25),
            // The thing reaches as high as the lamp.
            (LightPlace::Point(DVec3::new(-0.3, 0.1, 0.125)), 0.001),
            (
                LightPlace::Along(DVec3::new(0.1, -0.2, -1.0).normalize()),
                0.6,
            ),
            (
                LightPlace::Along(DVec3::new(0.9, 0.2, -0.3).normalize()),
                0.4,
            ),
        ];
        for (light, tight) in lights {
            let px_per_m = shadow_px_per_m(&thing(), light, table(), &view());
            let ray_to = |point: DVec3| match light {
                LightPlace::Point(light) => point - light,
                LightPlace::Along(direction) => direction,
            };
            let strength = |point: DVec3| strength_at(-ray_to(point).normalize().z);
            let cast = |point: DVec3| {
                let ray = ray_to(point);
                let shadow = point - ray * (point.z / ray.z);
                let on_table = shadow.x.abs() <= 0.6 && (-0.5..=0.7).contains(&shadow.y);
                (ray.z < 0.0 && on_table).then_some(shadow)
            };
            for apart_m in [1e-5, 0.002] {
                let share =
                    largest_share(pairs(thing(), apart_m), px_per_m, &view(), cast, strength);
                assert!(
                    share <= 1.0 && share > tight,
                    "{light:?} {apart_m}: {share}"
                );
            }
        }
    }

    #[test]
    fn a_wall_s_shadow_edge_keeps_its_bound_too() {
        // A wall behind the thing, slanted, with a lamp before it.
        let corner = |x: f64, z: f64| DVec3::new(x, 0.2 + 0.3 * x, z);
        let wall = [
            [corner(-0.5, 0.0), corner(0.5, 0.0), corner(0.5, 0.6)],
            [corner(-0.5, 0.0), corner(0.5, 0.6), corner(-0.5, 0.6)],
        ];
        let normal = DVec3::new(0.3, -1.0, 0.0);
        let lamp = DVec3::new(0.1, -0.3, 0.2);
        let light = LightPlace::Point(lamp);
        let px_per_m = shadow_px_per_m(&thing(), light, wall, &view());
        let strength =
            |point: DVec3| strength_at(normal.normalize().dot((point - lamp).normalize()).abs());
        let cast = |point: DVec3| {
            let ray = point - lamp;
            let shadow = point + ray * (normal.dot(corner(0.0, 0.0) - point) / normal.dot(ray));
            (shadow.x.abs() <= 0.5 && (0.0..=0.6).contains(&shadow.z)).then_some(shadow)
        };
        let share = largest_share(pairs(thing(), 1e-4), px_per_m, &view(), cast, strength);
        assert!(share <= 1.0 && share > 0.2, "{share}");
    }

    #[test]
    fn nothing_may_be_simplified_around_a_light_or_before_the_lens_and_all_that_is_out_of_sight() {
        let view = view();
        let around = |center: DVec3, half_m: f64| Bounds {
            low: center - half_m,
            high: center + half_m,
        };
        let lamp = DVec3::new(0.0, 0.0, 0.4);
        let light = LightPlace::Point(lamp);
        let scale = |caster: &Bounds, light| shadow_px_per_m(caster, light, table(), &view);
        assert_eq!(scale(&around(lamp, 0.01), light), f64::INFINITY);
        assert!(scale(&thing(), light).is_finite());
        let above = around(lamp + DVec3::Z * 0.1, 0.05);
        assert_eq!(scale(&above, light), 0.0, "no shadow upwards");
        let below = around(-DVec3::Z * 0.1, 0.05);
        assert_eq!(scale(&below, light), 0.0, "no shadow before the caster");
        let from_below = LightPlace::Point(DVec3::new(0.0, 0.0, -0.4));
        assert_eq!(scale(&below, from_below), 0.0, "no light on the table");
        assert_eq!(scale(&thing(), LightPlace::Along(DVec3::Z)), 0.0);

        let world_from_camera = view.camera_from_world.inverse();
        let eye = world_from_camera.translation;
        assert!(outline_px_per_m(&around(eye, 0.1), &view) >= 590.0 / view.near_m);
        for unseen in [DVec3::new(0.0, 0.0, -1.0), DVec3::new(2.0, 0.0, 1.0)] {
            let place = world_from_camera.transform_point3(unseen);
            assert_eq!(outline_px_per_m(&around(place, 0.1), &view), 0.0);
        }
    }

    #[test]
    fn a_placement_lengthens_by_its_largest_scale() {
        let turned = DAffine3::from_quat(DQuat::from_rotation_y(0.7) * DQuat::from_rotation_x(1.1));
        let scaled = turned * DAffine3::from_scale(DVec3::new(0.5, -3.0, 2.0));
        assert!((largest_scale(&scaled) - 3.0).abs() < 1e-12);
        assert!(largest_scale(&(scaled * turned)) >= 3.0 - 1e-12);
    }
}
