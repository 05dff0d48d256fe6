//! What a click in the picture meets.

use glam::{DVec2, Vec3};

use super::command::Selected;
use super::frame_tracker::TrackedPicture;
use super::gizmo::light_place_m;
use crate::geometry::light_placing::PosedCamera;
use crate::geometry::ray_caster::RayCaster;
use crate::scene::Scene;

/// A light is met this near to where it is shown, pixels.
const LIGHT_REACH_PX: f64 = 14.0;

/// The light or the visible thing under a pixel of the undistorted picture, the nearest one; `selects` says which things
/// may be selected: those that may not still hide what is behind them.
pub fn selected_at(
    scene: &Scene,
    picture: &TrackedPicture,
    pixel: DVec2,
    with_lights: bool,
    selects: impl Fn(&str) -> bool,
) -> Option<Selected> {
    if with_lights && let Some(light) = light_at(scene, picture, pixel) {
        return Some(Selected::Light(light));
    }
    let mut corners = Vec::new();
    let mut owners = Vec::new();
    let camera_from_node = picture.camera_from_nodes(scene);
    let scene = scene.shaped_at(picture.frame.time_secs);
    for thing in scene.phantoms.iter().chain(&scene.virtuals) {
        let Some(camera_from_anchor) = camera_from_node[thing.anchor] else {
            continue;
        };
        if !thing.visible {
            continue;
        }
        let camera_from_object = camera_from_anchor * thing.anchor_from_object;
        let positions: Vec<Vec3> = thing
            .mesh
            .positions
            .iter()
            .map(|p| camera_from_object.transform_point3(p.as_dvec3()).as_vec3())
            .collect();
        for triangle in &thing.mesh.triangles {
            corners.push(triangle.map(|index| positions[index as usize]));
            owners.push(thing);
        }
    }
    let direction = picture.intrinsics.plane_from_pixel(pixel).extend(1.0);
    let hit = RayCaster::new(&corners).first_hit(Vec3::ZERO, direction.as_vec3(), f32::INFINITY)?;
    let thing = &owners[hit.triangle].name;
    selects(thing).then(|| Selected::Thing(thing.clone()))
}

fn light_at(scene: &Scene, picture: &TrackedPicture, pixel: DVec2) -> Option<usize> {
    let lights = scene.lights.iter().enumerate();
    let (light, _) = lights
        .filter_map(|(index, light)| {
            let sight = PosedCamera {
                intrinsics: picture.intrinsics,
                camera_from_world: picture.poses.get(light.anchor)?.camera_from_anchor?,
            };
            let off_px = sight.pixel(light_place_m(&light.light))?.distance(pixel);
            (off_px <= LIGHT_REACH_PX).then_some((index, off_px))
        })
        .min_by(|(_, a), (_, b)| a.total_cmp(b))?;
    Some(light)
}
