//! Pixels beside edges, where rays and rasterization may differ: how close an edge comes, and what lies around.

use glam::{DVec2, DVec3};
use gnomon::app::truth::ray_cast::{NEAREST_M, SeenSurface, View, World};
use gnomon::light::Light;

/// Corners are snapped to 1/256 px, so an edge may pass a place on the other side that it is nearer to than this.
const SNAPPING_PX: f64 = 1.0 / 256.0;

/// Where four samples lie about a pixel's centre (the standard places of Vulkan and Direct3D).
pub const SAMPLES_PX: [[f64; 2]; 4] = [
    [-0.125, -0.375],
    [0.375, -0.125],
    [-0.375, 0.125],
    [0.125, 0.375],
];

/// A pixel's centre, and the places of its samples.
pub fn sample_places(pixel: DVec2) -> impl Iterator<Item = DVec2> {
    let samples = SAMPLES_PX.map(|[x, y]| pixel + DVec2::new(x, y));
    std::iter::once(pixel).chain(samples)
}

/// Whether a pixel and the eight around it are all alike.
pub fn is_uniform(size_px: [u32; 2], index: usize, same: impl Fn(usize, usize) -> bool) -> bool {
    let [width, height] = size_px.map(|size| size as usize);
    let (x, y) = (index % width, index / width);
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    (y.saturating_sub(1)..(y + 2).min(height))
        .flat_map(|row| columns.clone().map(move |column| row * width + column))
        .all(|other| same(index, other))
}

/// Whether a triangle's edge, or the shadow of one, passes a place so closely that snapping may put it on the other
/// side: triangles, shadows and gaps thinner than that are there for no ray, and may yet be drawn.
pub fn is_on_edge(world: &World, view: &View, place: DVec2, light: &Light) -> bool {
    let seen = world.look(view, place);
    let pixel_of = |point: DVec3| {
        let in_camera = view.camera_from_world.transform_point3(point);
        let plane = in_camera.truncate() / in_camera.z;
        (in_camera.z > NEAREST_M).then(|| view.intrinsics.pixel_from_plane(plane))
    };
    // Where the shadow of a point falls on the plane of what is seen.
    let shadow_of = |point: DVec3| {
        let SeenSurface {
            point: on, normal, ..
        } = seen?;
        let (from, way) = match *light {
            Light::Point { position_m, .. } => (position_m, point - position_m),
            Light::Directional { direction, .. } => (point, direction),
        };
        let share = normal.dot(on - from) / normal.dot(way);
        (share > 0.0).then(|| from + way * share)
    };
    let is_near = |ends: [Option<DVec2>; 2]| {
        let [Some(a), Some(b)] = ends else {
            return false;
        };
        let along = ((place - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        (a + (b - a) * along).distance(place) < SNAPPING_PX
    };
    world.triangles.iter().any(|triangle| {
        let [a, b, c] = triangle.corners;
        [[a, b], [b, c], [c, a]].into_iter().any(|ends| {
            is_near(ends.map(pixel_of))
                || triangle.casts && is_near(ends.map(|end| shadow_of(end).and_then(pixel_of)))
        })
    })
}

/// Places from which an edge within 1.5 px of a pixel's centre shows, however thin it is where it passes close by.
pub fn places_around(pixel: DVec2) -> impl Iterator<Item = DVec2> {
    (0..10).flat_map(move |ring| {
        let radius_px = 1.5 * 0.5_f64.powi(ring);
        (0..32).map(move |step| {
            let turn = f64::from(step) + 0.37 * f64::from(ring);
            pixel + DVec2::from_angle(turn * std::f64::consts::TAU / 32.0) * radius_px
        })
    })
}
