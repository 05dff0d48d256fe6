//! What is well defined in a scene but hardly meant.

mod degenerate;
mod room;
pub mod sizes;
mod unlikely;

use crate::light::Light;
use crate::scene::{Object, Scene};

/// The warnings of a scene, in words; among them lights inside closed casters of the world's anchor (where others are is not
/// known before there are pictures).
pub fn warnings(scene: &Scene) -> Vec<String> {
    let casters = scene.phantoms.iter().chain(&scene.virtuals);
    let closed: Vec<&Object> = casters
        .filter(|object| {
            object.visible && object.casts && object.mesh_report.closed && object.anchor == 0
        })
        .collect();
    let mut warnings = room::warnings(scene);
    warnings.extend(degenerate::warnings(scene));
    warnings.extend(unlikely::warnings(scene));
    let things = || scene.phantoms.iter().chain(&scene.virtuals);
    for note in things().flat_map(|object| &object.notes) {
        // Things may have the same file.
        if !warnings.contains(note) {
            warnings.push(note.clone());
        }
    }
    warnings.extend(things().filter_map(sizes::warning));
    if let Some(probe) = &scene.probe {
        let notes = probe.notes.iter();
        warnings.extend(notes.map(|note| format!("{}: {note}", probe.image.display())));
    }
    for (number, light) in scene.lights.iter().enumerate() {
        // Where other anchors are is not known before there are pictures.
        let (0, Light::Point { position_m, .. }) = (light.anchor, light.light) else {
            continue;
        };
        for object in &closed {
            let object_from_world = object.anchor_from_object.inverse();
            let light_in_object = object_from_world.transform_point3(position_m);
            // Below zero where the placement mirrors the mesh.
            if object.mesh.winding_number(light_in_object).abs() > 0.5 {
                warnings.push(format!(
                    "light {number} is inside \"{}\": everything outside of it is in its shadow",
                    object.name
                ));
            }
        }
    }
    warnings
}
