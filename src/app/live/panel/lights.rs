//! The lights: where they stand, how strong they are.

use eframe::egui::Ui;
use glam::DVec3;

use super::editing::{Editing, power, vector};
use crate::app::authoring::Edit;
use crate::app::live::command::{Commands, SceneCommand, Selected, WindowCommand};
use crate::app::live::window_state::WindowState;
use crate::light::Light;
use crate::scene::{Scene, unit_direction};

/// A light that is added: where a desk lamp stands, as bright on the table as display white.
const NEW_LIGHT: Light = Light::Point {
    position_m: DVec3::new(-0.25, 0.25, 0.5),
    intensity: DVec3::splat(1.0),
};

/// Shows them.
pub fn show(
    ui: &mut Ui,
    scene: &Scene,
    look: &WindowState,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    for (index, shown) in scene.lights.iter().enumerate() {
        let mut light = *shown;
        let selected = Selected::Light(index);
        let is_selected = look.selected.as_ref() == Some(&selected);
        let kind = match light {
            Light::Point { .. } => "point",
            Light::Directional { .. } => "directional",
        };
        ui.push_id(("light", index), |ui| {
            ui.horizontal(|ui| {
                let name = format!("light {index} ({kind})");
                if ui.selectable_label(is_selected, name).clicked() {
                    commands.push(WindowCommand::Select((!is_selected).then_some(selected)));
                }
                if ui.small_button("remove").clicked() {
                    commands.push(SceneCommand::Commit(Edit::RemoveLight(index)));
                }
            });
            let changed = match &mut light {
                Light::Point {
                    position_m,
                    intensity,
                } => {
                    let moved = vector(ui, "m", position_m, 0.002, "");
                    power(ui, "W/sr", intensity) || moved
                }
                Light::Directional {
                    direction,
                    irradiance,
                } => {
                    let turned = vector(ui, "travels", direction, 0.005, "");
                    if turned {
                        *direction = unit_direction(*direction);
                    }
                    power(ui, "W/m²", irradiance) || turned
                }
            };
            let points_somewhere =
                !matches!(light, Light::Directional { direction, .. } if direction == DVec3::ZERO);
            if changed && points_somewhere {
                editing.changed(ui, Edit::Light { index, light }, commands);
            }
        });
    }
    let mut ambient = scene.ambient_radiance;
    if power(ui, "ambient radiance", &mut ambient) {
        editing.changed(ui, Edit::Ambient(ambient), commands);
    }
    if ui.button("Add a light").clicked() {
        commands.push(SceneCommand::Commit(Edit::AddLight(NEW_LIGHT)));
        commands.push(WindowCommand::Select(Some(Selected::Light(
            scene.lights.len(),
        ))));
    }
}
