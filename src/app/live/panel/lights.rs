//! The lights: where they stand, how strong they are.

use eframe::egui::{ComboBox, Ui};
use glam::DVec3;

use super::editing::{Editing, number, power, vector};
use super::names::selectable;
use crate::app::authoring::Edit;
use crate::app::live::command::{Commands, SceneCommand, Selected, WindowCommand};
use crate::app::live::window_state::WindowState;
use crate::light::{Light, Shape};
use crate::scene::Numbers;
use crate::scene::format::{
    AMBIENT, DIRECTIONAL_LIGHT, LightKind, POINT_LIGHT, ShapeKnobs, turn_shape,
};
use crate::scene::{Scene, unit_direction};

/// A light that is added: where a desk lamp stands, as bright on the table as display white.
const NEW_LIGHT: Light = Light::Point {
    position_m: DVec3::new(-0.25, 0.25, 0.5),
    intensity: DVec3::splat(1.0),
    shape: Shape::Point,
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
        let mut light = shown.light;
        let selected = Selected::Light(index);
        let is_selected = look.selected.as_ref() == Some(&selected);
        let kind = LightKind::of(&light).name();
        let on = match shown.anchor {
            0 => String::new(),
            anchor => format!(" on {}", scene.anchors[anchor].name),
        };
        ui.push_id(("light", index), |ui| {
            ui.horizontal(|ui| {
                let name = format!("light {index} ({kind}{on})");
                if selectable(ui, is_selected, &name).clicked() {
                    commands.push(WindowCommand::Select((!is_selected).then_some(selected)));
                }
                if ui.small_button("remove").clicked() {
                    commands.push(SceneCommand::Commit(Edit::RemoveLight(index)));
                }
            });
            if let Some(other) = other_kind(ui, &light) {
                let light = other;
                commands.push(SceneCommand::Commit(Edit::Light { index, light }));
                return;
            }
            let changed = match &mut light {
                Light::Point {
                    position_m,
                    intensity,
                    shape,
                } => {
                    let m = POINT_LIGHT.position_m.takes.numbers;
                    let moved = vector(ui, m.unit, position_m, 0.002, &m.unit(""));
                    let watts = &POINT_LIGHT.intensity.takes.numbers;
                    let stronger = power(ui, "W/sr", intensity, watts);
                    turn_shape(shape, &mut ShapeFields(ui)) || stronger || moved
                }
                Light::Directional {
                    direction,
                    irradiance,
                    angle_rad,
                } => {
                    let turned = aim(ui, "travels", direction);
                    let watts = &DIRECTIONAL_LIGHT.irradiance.takes.numbers;
                    let stronger = power(ui, "W/m²", irradiance, watts);
                    angle(ui, "wide", angle_rad, &DIRECTIONAL_LIGHT.angle_deg.takes)
                        || stronger
                        || turned
                }
            };
            if changed {
                editing.changed(ui, Edit::Light { index, light }, commands);
            }
        });
    }
    let mut ambient = scene.ambient_radiance;
    let allowed = &AMBIENT.radiance.takes.numbers;
    if power(ui, "ambient radiance", &mut ambient, allowed) {
        editing.changed(ui, Edit::Ambient(ambient), commands);
    }
    if ui.button("Add a light").clicked() {
        commands.push(SceneCommand::Commit(Edit::AddLight(NEW_LIGHT)));
    }
}

/// A choice of kinds; a light of the one that was chosen, where and as strong as it was as far as kinds have that in common.
fn other_kind(ui: &mut Ui, light: &Light) -> Option<Light> {
    let now = LightKind::of(light);
    let mut chosen = now;
    ComboBox::from_label("kind")
        .selected_text(now.name())
        .show_ui(ui, |ui| {
            for (name, kind) in LightKind::BY_NAME {
                ui.selectable_value(&mut chosen, kind, name);
            }
        });
    (chosen != now).then(|| chosen.like(light))
}

/// The fields of a shape.
struct ShapeFields<'a>(&'a mut Ui);

impl ShapeKnobs for ShapeFields<'_> {
    fn direction(&mut self, name: &str, direction: &mut DVec3) -> bool {
        aim(self.0, name, direction)
    }

    fn angle(&mut self, name: &str, angle_rad: &mut f64, allowed: &Numbers) -> bool {
        angle(self.0, name, angle_rad, allowed)
    }

    fn length(&mut self, name: &str, length_m: &mut f64, step_m: f64, allowed: &Numbers) -> bool {
        number(self.0, name, length_m, step_m, allowed).changed()
    }
}

/// A direction; it never becomes none.
fn aim(ui: &mut Ui, name: &str, direction: &mut DVec3) -> bool {
    let any = &DIRECTIONAL_LIGHT.direction.takes.numbers;
    let mut aimed = *direction;
    let turned = vector(ui, name, &mut aimed, 0.005, any) && unit_direction(aimed) != DVec3::ZERO;
    if turned {
        *direction = unit_direction(aimed);
    }
    turned
}

/// An angle, shown in degrees.
fn angle(ui: &mut Ui, name: &str, angle_rad: &mut f64, allowed: &Numbers) -> bool {
    let mut angle_deg = angle_rad.to_degrees();
    let changed = number(ui, name, &mut angle_deg, 0.1, allowed).changed();
    if changed {
        *angle_rad = angle_deg.to_radians();
    }
    changed
}
