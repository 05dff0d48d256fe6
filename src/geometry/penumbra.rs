//! How wide the soft edges of shadows are in the picture.

use glam::{DVec2, DVec3};

use super::bounds::Bounds;
use super::outline_scale::OutlineView;
use super::shadow_volume::LightPlace;

/// The light's middle, and half its extents.
#[derive(Debug, Clone, PartialEq)]
pub struct SizedPlace {
    /// The middle.
    pub place: LightPlace,
    /// From the middle to its ends, metres; of distant light as parts of a unit of its way.
    pub half_extents: Vec<DVec3>,
}

/// Most triangles of a receiver that are looked at.
const MOST_TRIANGLES: usize = 64;

/// The width of the widest soft edge that the shadow of anything within `caster` can have on triangles, in pixels, up to the
/// picture's diagonal; all in world space. 0 where none is seen. Told by where the shadows of some points of the box fall, so
/// it may be off by a part of itself.
pub fn penumbra_px(
    caster: &Bounds,
    light: &SizedPlace,
    receiver: &[[DVec3; 3]],
    view: &OutlineView,
) -> f64 {
    let size_px = DVec2::from_array(view.intrinsics.size_px.map(f64::from));
    let most_px = size_px.length();
    let points = grid(caster);
    let stride = receiver.len().div_ceil(MOST_TRIANGLES).max(1);
    let mut widest_px: f64 = 0.0;
    for triangle in receiver.iter().step_by(stride) {
        let plane = Plane::of(triangle);
        for &point in &points {
            let Some(shadow) = plane.shadow(light.place, point) else {
                continue;
            };
            if !plane.is_near(shadow) {
                continue;
            }
            let Some(pixel) = pixel_of(shadow, view).filter(|&pixel| is_seen(pixel, size_px))
            else {
                continue;
            };
            for &extent in &light.half_extents {
                let end_px = |side: f64| {
                    let end = moved(light.place, extent * side);
                    let end = plane.shadow(end, point)?;
                    Some(pixel_of(end, view)?.distance(pixel))
                };
                let ends = [end_px(1.0), end_px(-1.0)];
                let width: f64 = ends.map(|end| end.unwrap_or(most_px)).iter().sum();
                widest_px = widest_px.max(width);
            }
        }
    }
    widest_px.min(most_px)
}

/// Three points along each side.
fn grid(bounds: &Bounds) -> Vec<DVec3> {
    let steps = [0.0, 0.5, 1.0];
    let across =
        |x: f64, y: f64, z: f64| bounds.low + (bounds.high - bounds.low) * DVec3::new(x, y, z);
    let plane = |x: f64| steps.map(|y| steps.map(|z| across(x, y, z))).concat();
    steps.map(plane).concat()
}

fn moved(light: LightPlace, by: DVec3) -> LightPlace {
    match light {
        LightPlace::Point(place) => LightPlace::Point(place + by),
        LightPlace::Along(way) => LightPlace::Along(way + by),
    }
}

fn pixel_of(point: DVec3, view: &OutlineView) -> Option<DVec2> {
    let in_camera = view.camera_from_world.transform_point3(point);
    let is_in_front = in_camera.z > view.near_m;
    is_in_front
        .then(|| view.intrinsics.undistorted_pixel_of(in_camera))
        .flatten()
}

/// Whether a pixel is in the picture, or beside it by no more than a quarter of its size.
fn is_seen(pixel: DVec2, size_px: DVec2) -> bool {
    let beyond = 0.25 * size_px;
    pixel.cmpge(-beyond).all() && pixel.cmple(size_px + beyond).all()
}

/// The plane of a triangle.
struct Plane {
    normal: DVec3,
    middle: DVec3,
    radius: f64,
}

impl Plane {
    fn of(triangle: &[DVec3; 3]) -> Self {
        let [a, b, c] = *triangle;
        let middle = (a + b + c) / 3.0;
        let reach = triangle.map(|corner| corner.distance(middle));
        Self {
            normal: (b - a).cross(c - a).normalize_or_zero(),
            middle,
            radius: reach.into_iter().fold(0.0, f64::max),
        }
    }

    /// Where a point's shadow falls on it, behind the point.
    fn shadow(&self, light: LightPlace, point: DVec3) -> Option<DVec3> {
        let away = match light {
            LightPlace::Point(place) => point - place,
            LightPlace::Along(way) => way,
        };
        let falls = self.normal.dot(away);
        let height = self.normal.dot(self.middle - point);
        let way = height / falls;
        (falls.abs() > 1e-12 && way >= 0.0 && way.is_finite()).then(|| point + away * way)
    }

    fn is_near(&self, point: DVec3) -> bool {
        point.distance(self.middle) <= self.radius
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Intrinsics;
    use glam::{DAffine3, DMat3};

    /// A camera half a metre above the table that looks down on it: a pixel is a millimetre.
    fn view() -> OutlineView {
        OutlineView {
            intrinsics: Intrinsics {
                size_px: [400, 300],
                focal_px: DVec2::splat(500.0),
                center_px: DVec2::new(200.0, 150.0),
                distortion: [0.0; 5],
            },
            camera_from_world: DAffine3 {
                matrix3: DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0)),
                translation: DVec3::new(0.0, 0.0, 0.5),
            },
            near_m: 1e-3,
        }
    }

    fn table() -> [[DVec3; 3]; 2] {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        [
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
            [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        ]
    }

    #[test]
    fn a_penumbra_is_as_wide_as_the_light_seen_from_where_the_shadow_is() {
        let caster = Bounds {
            low: DVec3::new(-0.05, -0.05, 0.1),
            high: DVec3::new(0.05, 0.05, 0.1),
        };
        let lamp = SizedPlace {
            place: LightPlace::Point(DVec3::new(0.0, 0.0, 0.5)),
            half_extents: vec![DVec3::X * 0.02, DVec3::Y * 0.02],
        };
        // 4 cm of light, 0.4 m from a caster that is 0.1 m above the table: 1 cm.
        let width_px = penumbra_px(&caster, &lamp, &table(), &view());
        assert!((width_px - 10.0).abs() < 1e-6, "{width_px}");
        // The sun: 2 tan(0.265°) of the way.
        let sun = SizedPlace {
            place: LightPlace::Along(DVec3::NEG_Z),
            half_extents: vec![DVec3::X * 0.265_f64.to_radians().sin()],
        };
        let width_px = penumbra_px(&caster, &sun, &table(), &view());
        assert!((width_px - 0.925).abs() < 1e-2, "{width_px}");
        // What lies on the table has none, and what is behind the light casts none.
        let lying = Bounds {
            low: DVec3::new(-0.05, -0.05, 0.0),
            high: DVec3::new(0.05, 0.05, 0.0),
        };
        assert_eq!(penumbra_px(&lying, &lamp, &table(), &view()), 0.0);
        let above = Bounds {
            low: DVec3::new(-0.05, -0.05, 0.6),
            high: DVec3::new(0.05, 0.05, 0.6),
        };
        assert_eq!(penumbra_px(&above, &lamp, &table(), &view()), 0.0);
    }
}
