//! What is in one place by a hair: lights on surfaces, virtual things in real surfaces. It is drawn alike for all its
//! pixels, but hardly meant.

use glam::DVec3;

use crate::geometry::coincidence::{IN_ONE_PLACE_M, coincidence, is_on_surface};
use crate::light::Light;
use crate::scene::{Object, Scene};

/// A light is on a surface that is no farther away, metres.
const ON_SURFACE_M: f64 = 1e-6;

/// What there is to warn of.
pub fn warnings(scene: &Scene) -> Vec<String> {
    let things = || scene.phantoms.iter().chain(&scene.virtuals);
    let mut warnings = Vec::new();
    for (number, light) in scene.lights.iter().enumerate() {
        let (0, Light::Point { position_m, .. }) = (light.anchor, light.light) else {
            continue;
        };
        // Where other anchors are is not known before there are pictures.
        for object in things().filter(|object| object.visible && object.anchor == 0) {
            if is_on_surface(position_m, triangles(object), ON_SURFACE_M) {
                warnings.push(format!(
                    "light {number} is exactly on the surface of \"{}\": the triangles that it lies on hide nothing, the \
                     others do; move it off",
                    object.name
                ));
            }
        }
    }
    for thing in scene.virtuals.iter().filter(|thing| thing.visible) {
        let own: Vec<[DVec3; 3]> = triangles(thing).collect();
        let beside = |phantom: &&Object| phantom.visible && phantom.anchor == thing.anchor;
        for phantom in scene.phantoms.iter().filter(beside) {
            let real: Vec<[DVec3; 3]> = triangles(phantom).collect();
            let found = coincidence(&own, &real, IN_ONE_PLACE_M);
            // What stands on the table shows nothing of its underside.
            if found.alike || found.opposed && !thing.mesh_report.closed {
                warnings.push(format!(
                    "\"{}\" lies exactly in the surface of \"{}\": it is shown on top of it",
                    thing.name, phantom.name
                ));
            }
        }
    }
    warnings
}

/// The triangles of an object in its anchor's space.
fn triangles(object: &Object) -> impl Iterator<Item = [DVec3; 3]> {
    let place = |index: u32| {
        let position = object.mesh.positions[index as usize].as_dvec3();
        object.anchor_from_object.transform_point3(position)
    };
    let triangles = object.mesh.triangles.iter();
    triangles.map(move |triangle| triangle.map(place))
}
