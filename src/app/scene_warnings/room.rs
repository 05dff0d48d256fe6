//! What a room's light does not take account of.

use crate::app::talk::counted;
use crate::scene::{Scene, ShadowTechnique};

/// What of a scene has no part in a room's light.
pub fn warnings(scene: &Scene) -> Vec<String> {
    if !scene.chosen_technique().0.has_shafts() {
        return Vec::new();
    }
    let mut warnings = Vec::new();
    let is_alone = scene.chosen_technique().0 == ShadowTechnique::Shafts;
    if is_alone && !scene.lights.is_empty() {
        warnings.push(format!(
            "{} not used: with shafts alone all light comes from the probe",
            counted(scene.lights.len(), "light")
        ));
    }
    let without = match is_alone {
        true => "",
        false => "of the broad light ",
    };
    let moving = scene
        .phantoms
        .iter()
        .filter(|object| object.visible && object.anchor > 0);
    warnings.extend(moving.map(|object| {
        format!(
            "\"{}\" moves with its marker: it hides what is behind it, but {without}it gets no shadow and casts none with shafts, \
             for the room's light is worked out once",
            object.name
        )
    }));
    warnings
}
