//! The lights: where they stand, how strong they are.

use eframe::egui::{ComboBox, Ui};
use glam::{DVec2, DVec3};

use super::editing::{Editing, number, power, vector};
use crate::app::authoring::Edit;
use crate::app::live::command::{Commands, SceneCommand, Selected, WindowCommand};
use crate::app::live::window_state::WindowState;
use crate::light::{Light, Rect, Shape};
use crate::scene::Numbers;
use crate::scene::format::{
    AMBIENT, DIRECTIONAL_LIGHT, LightKind, POINT_LIGHT, RECT_LIGHT, SPHERE_LIGHT, SPOT_LIGHT,
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
                if ui.selectable_label(is_selected, name).clicked() {
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
                    show_shape(ui, shape) || stronger || moved
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
        commands.push(WindowCommand::Select(Some(Selected::Light(
            scene.lights.len(),
        ))));
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
    (chosen != now).then(|| of_kind(chosen, light))
}

fn of_kind(kind: LightKind, light: &Light) -> Light {
    let (position_m, intensity, down) = match *light {
        Light::Point {
            position_m,
            intensity,
            ..
        } => (position_m, intensity, unit_direction(-position_m)),
        // From half a metre away, as bright at the origin.
        Light::Directional {
            direction,
            irradiance,
            ..
        } => (-0.5 * direction, 0.25 * irradiance, direction),
    };
    let direction = match down == DVec3::ZERO {
        true => DVec3::NEG_Z,
        false => down,
    };
    let shape = match kind {
        LightKind::Directional => {
            return Light::directional(
                direction,
                intensity / position_m.length_squared().max(1e-4),
            );
        }
        LightKind::Point => Shape::Point,
        LightKind::Spot => Shape::Spot {
            direction,
            inner_rad: 20_f64.to_radians(),
            outer_rad: 30_f64.to_radians(),
        },
        LightKind::Sphere => Shape::Sphere { radius_m: 0.04 },
        LightKind::Rect => Shape::Rect(Rect::upright(direction, DVec3::Z, DVec2::splat(0.3))),
    };
    Light::Point {
        position_m,
        intensity,
        shape,
    }
}

/// What belongs to a shape. Returns whether it was changed.
fn show_shape(ui: &mut Ui, shape: &mut Shape) -> bool {
    match shape {
        Shape::Point => false,
        Shape::Spot {
            direction,
            inner_rad,
            outer_rad,
        } => {
            let turned = aim(ui, "towards", direction);
            let outer = angle(ui, "outer", outer_rad, &SPOT_LIGHT.outer_deg.takes);
            let mut inside = SPOT_LIGHT.inner_deg.takes;
            inside.most = (outer_rad.to_degrees() - 0.01).max(0.0);
            *inner_rad = inner_rad.min(inside.most.to_radians());
            angle(ui, "inner", inner_rad, &inside) || outer || turned
        }
        Shape::Sphere { radius_m } => {
            let radius = &SPHERE_LIGHT.radius_m.takes;
            number(ui, "radius", radius_m, 0.001, radius).changed()
        }
        Shape::Rect(rect) => {
            let mut facing = rect.facing;
            let turned = aim(ui, "towards", &mut facing);
            let size = &RECT_LIGHT.size_m.takes;
            let wider = number(ui, "width", &mut rect.size_m.x, 0.005, size).changed();
            let higher = number(ui, "height", &mut rect.size_m.y, 0.005, size).changed();
            if turned {
                *rect = Rect::upright(facing, rect.up(), rect.size_m);
            }
            turned || wider || higher
        }
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
