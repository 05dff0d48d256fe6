//! The oracle of visibility: rays in double precision against every triangle, without any offset.

use glam::{DAffine3, DVec2, DVec3};
use gnomon::geometry::camera::Intrinsics;
use gnomon::light::Light;
use gnomon::scene::{Object, Scene};

pub const REAL_HIDES: u8 = 1;
pub const VIRTUAL_HIDES: u8 = 2;
pub const FACES_AWAY: u8 = 4;

/// What a ray through a pixel's centre sees.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Seen {
    /// 0 none, 100 real, 200 virtual.
    pub role: u8,
    /// For the scene's first light.
    pub bits: u8,
}

struct Triangles {
    role: u8,
    casts: bool,
    low: DVec3,
    high: DVec3,
    corners: Vec<[DVec3; 3]>,
}

/// Casts a ray through the centre of every pixel, and from what it hits to the scene's first light.
///
/// `lift_m` moves the start of the second ray off the surface along its normal: 0 is the truth; other renderers lift
/// by some 0.1 mm against self-shadowing.
pub fn cast(
    scene: &Scene,
    intrinsics: &Intrinsics,
    camera_from_world: &DAffine3,
    lift_m: f64,
) -> Vec<Seen> {
    let world_from_camera = camera_from_world.inverse();
    let eye = world_from_camera.translation;
    let real = scene.phantoms.iter().map(|object| triangles(object, 100));
    let objects: Vec<Triangles> = real
        .chain(scene.virtuals.iter().map(|object| triangles(object, 200)))
        .collect();
    let [width, height] = intrinsics.size_px;
    let mut seen = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            let plane = intrinsics.plane_from_pixel(DVec2::new(f64::from(x), f64::from(y)));
            let direction = world_from_camera.transform_vector3(plane.extend(1.0));
            seen.push(follow(&objects, &scene.lights[0], eye, direction, lift_m));
        }
    }
    seen
}

fn triangles(object: &Object, role: u8) -> Triangles {
    let place = |index: u32| {
        // The renderer's vertices are single precision; the oracle judges its visibility, not its rounding.
        let position = object.mesh.positions[index as usize].as_dvec3();
        object
            .anchor_from_object
            .transform_point3(position)
            .as_vec3()
            .as_dvec3()
    };
    let corners: Vec<[DVec3; 3]> = object.mesh.triangles.iter().map(|t| t.map(place)).collect();
    let all = || corners.iter().flatten().copied();
    Triangles {
        role,
        casts: object.casts,
        low: all().fold(DVec3::MAX, DVec3::min),
        high: all().fold(DVec3::MIN, DVec3::max),
        corners,
    }
}

fn follow(objects: &[Triangles], light: &Light, eye: DVec3, direction: DVec3, lift_m: f64) -> Seen {
    let mut nearest: Option<(f64, u8, usize, usize)> = None;
    for (object_index, object) in objects.iter().enumerate() {
        for (triangle, distance) in object.hits(eye, direction) {
            if distance > 0.0 && nearest.is_none_or(|(best, ..)| distance < best) {
                nearest = Some((distance, object.role, object_index, triangle));
            }
        }
    }
    let Some((distance, role, seen_object, seen_triangle)) = nearest else {
        return Seen::default();
    };
    let point = eye + direction * distance;
    let [a, b, c] = objects[seen_object].corners[seen_triangle];
    let normal = (b - a).cross(c - a).normalize();
    let normal = if normal.dot(direction) > 0.0 {
        -normal
    } else {
        normal
    };
    let (to_light, reach) = match *light {
        Light::Point { position_m, .. } => (position_m - point, 1.0),
        Light::Directional { direction, .. } => (-direction, f64::INFINITY),
    };
    let mut bits = if normal.dot(to_light) < 0.0 {
        FACES_AWAY
    } else {
        0
    };
    let start = point + normal * lift_m;
    for (object_index, object) in objects
        .iter()
        .enumerate()
        .filter(|(_, object)| object.casts)
    {
        let hidden = object.hits(start, to_light).any(|(triangle, distance)| {
            let own = object_index == seen_object && triangle == seen_triangle;
            !own && distance > 0.0 && distance < reach
        });
        if hidden {
            bits |= if object.role == 100 {
                REAL_HIDES
            } else {
                VIRTUAL_HIDES
            };
        }
    }
    Seen { role, bits }
}

impl Triangles {
    /// Index and distance, in units of `direction`, of every triangle that the line hits (Möller & Trumbore 1997).
    fn hits(&self, origin: DVec3, direction: DVec3) -> impl Iterator<Item = (usize, f64)> + '_ {
        let (near, far) = (
            (self.low - origin) / direction,
            (self.high - origin) / direction,
        );
        let enters = near.min(far).max_element();
        let leaves = near.max(far).min_element();
        // A flat box has no thickness to lose to rounding.
        let passes = enters.is_nan() || leaves.is_nan() || enters <= leaves + 1e-6;
        let corners = if passes { self.corners.as_slice() } else { &[] };
        corners
            .iter()
            .enumerate()
            .filter_map(move |(index, &[a, b, c])| {
                let (first, second) = (b - a, c - a);
                let across = direction.cross(second);
                let determinant = first.dot(across);
                let from_corner = origin - a;
                let u = from_corner.dot(across) / determinant;
                let aside = from_corner.cross(first);
                let v = direction.dot(aside) / determinant;
                (u >= 0.0 && v >= 0.0 && u + v <= 1.0)
                    .then(|| (index, second.dot(aside) / determinant))
            })
    }
}
