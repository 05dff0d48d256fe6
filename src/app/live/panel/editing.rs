//! Fields that change the scene: shown while they are dragged, made when they are let go.

use eframe::egui::{DragValue, Response, Ui};
use glam::DVec3;

use crate::app::authoring::Edit;
use crate::app::live::command::{Commands, SceneCommand};
use crate::scene::{Numbers, Whole};

/// An edit that is under way.
#[derive(Debug, Default)]
pub struct Editing {
    dragged: Option<Edit>,
}

impl Editing {
    /// A field has changed to what `edit` says.
    pub fn changed(&mut self, ui: &Ui, edit: Edit, commands: &mut Commands) {
        if is_held(ui) {
            commands.push(SceneCommand::Preview(edit.clone()));
            self.dragged = Some(edit);
        } else {
            self.dragged = None;
            commands.push(SceneCommand::Commit(edit));
        }
    }

    /// Makes the edit that was let go, at the end of a pass.
    pub fn settle(&mut self, ui: &Ui, commands: &mut Commands) {
        if !is_held(ui)
            && let Some(edit) = self.dragged.take()
        {
            commands.push(SceneCommand::Commit(edit));
        }
    }
}

fn is_held(ui: &Ui) -> bool {
    ui.input(|input| input.pointer.any_down())
}

/// A number with its name, that is taken when it is written out, or as it is dragged; whether it has changed.
pub fn number(ui: &mut Ui, name: &str, value: &mut f64, speed: f64, allowed: &Numbers) -> Response {
    ui.horizontal(|ui| {
        let field = field(ui, value, speed, allowed);
        let label = ui.label(name);
        field.labelled_by(label.id)
    })
    .inner
}

/// Three numbers in a row; whether one has changed.
pub fn vector(ui: &mut Ui, name: &str, value: &mut DVec3, speed: f64, allowed: &Numbers) -> bool {
    ui.horizontal(|ui| {
        let [x, y, z] = value.as_mut();
        let fields = [("x ", x), ("y ", y), ("z ", z)]
            .map(|(axis, component)| axis_field(ui, axis, component, speed, allowed));
        let label = ui.label(name);
        fields
            .map(|field| field.labelled_by(label.id).changed())
            .contains(&true)
    })
    .inner
}

/// A power of light as its strength and its colour; whether it has changed.
pub fn power(ui: &mut Ui, name: &str, value: &mut DVec3, allowed: &Numbers) -> bool {
    let mut strength = value.max_element();
    let mut colour = match strength > 0.0 {
        true => (*value / strength).as_vec3().to_array(),
        false => [1.0; 3],
    };
    let changed = ui
        .horizontal(|ui| {
            let speed = 0.01 * strength.max(0.01);
            let strength = field(ui, &mut strength, speed, allowed);
            let colour = ui.color_edit_button_rgb(&mut colour);
            let label = ui.label(name);
            let fields = [strength, colour];
            fields
                .map(|field| field.labelled_by(label.id).changed())
                .contains(&true)
        })
        .inner;
    if changed {
        *value = strength * DVec3::from_array(colour.map(f64::from));
    }
    changed
}

/// A number alone, with its unit. What it is changed to is allowed.
pub fn field(ui: &mut Ui, value: &mut f64, speed: f64, allowed: &Numbers) -> Response {
    axis_field(ui, "", value, speed, allowed)
}

/// The same with the name of an axis before it.
fn axis_field(
    ui: &mut Ui,
    axis: &'static str,
    value: &mut f64,
    speed: f64,
    allowed: &Numbers,
) -> Response {
    let suffix = match allowed.unit {
        "" => String::new(),
        "degrees" => "°".to_owned(),
        unit => format!(" {unit}"),
    };
    let field = ui.add(
        DragValue::new(value)
            .speed(speed)
            .max_decimals(4)
            .prefix(axis)
            .suffix(suffix)
            .update_while_editing(false),
    );
    if field.changed() {
        *value = allowed.nearest(*value, speed);
    }
    field
}

/// A whole number with its name.
pub fn whole(ui: &mut Ui, name: &str, value: &mut u32, allowed: &Whole) -> Response {
    ui.horizontal(|ui| {
        let field = DragValue::new(value)
            .range(allowed.least..=allowed.most)
            .update_while_editing(false);
        let field = ui.add(field);
        let label = ui.label(name);
        field.labelled_by(label.id)
    })
    .inner
}
