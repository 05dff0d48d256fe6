//! Fields that change the scene: shown while they are dragged, made when they are let go.

use eframe::egui::{DragValue, Ui};
use glam::DVec3;

use crate::app::authoring::Edit;
use crate::app::live::wish::Wish;

/// An edit that is under way.
#[derive(Debug, Default)]
pub struct Editing {
    dragged: Option<Edit>,
}

impl Editing {
    /// A field has changed to what `edit` says.
    pub fn changed(&mut self, ui: &Ui, edit: Edit, wishes: &mut Vec<Wish>) {
        if is_held(ui) {
            wishes.push(Wish::Preview(edit.clone()));
            self.dragged = Some(edit);
        } else {
            self.dragged = None;
            wishes.push(Wish::Commit(edit));
        }
    }

    /// Makes the edit that was let go, at the end of a pass.
    pub fn settle(&mut self, ui: &Ui, wishes: &mut Vec<Wish>) {
        if !is_held(ui)
            && let Some(edit) = self.dragged.take()
        {
            wishes.push(Wish::Commit(edit));
        }
    }
}

fn is_held(ui: &Ui) -> bool {
    ui.input(|input| input.pointer.any_down())
}

/// A number that is taken when it is written out, or as it is dragged; whether it has changed.
pub fn number(ui: &mut Ui, value: &mut f64, speed: f64, unit: &str) -> bool {
    let field = DragValue::new(value)
        .speed(speed)
        .max_decimals(4)
        .suffix(unit)
        .update_while_editing(false);
    ui.add(field).changed()
}

/// Three numbers in a row.
pub fn vector(ui: &mut Ui, name: &str, value: &mut DVec3, speed: f64, unit: &str) -> bool {
    ui.horizontal(|ui| {
        let mut changed = false;
        for component in value.as_mut() {
            changed |= number(ui, component, speed, unit);
        }
        ui.label(name);
        changed
    })
    .inner
}

/// A power of light as its strength and its colour; whether it has changed.
pub fn power(ui: &mut Ui, name: &str, value: &mut DVec3) -> bool {
    let strength_before = value.max_element();
    let mut strength = strength_before;
    let mut colour = match strength > 0.0 {
        true => (*value / strength).as_vec3().to_array(),
        false => [1.0; 3],
    };
    let changed = ui
        .horizontal(|ui| {
            let speed = 0.01 * strength.max(0.01);
            let field = DragValue::new(&mut strength)
                .speed(speed)
                .range(0.0..=1e9)
                .max_decimals(4)
                .update_while_editing(false);
            let by_strength = ui.add(field).changed();
            let by_colour = ui.color_edit_button_rgb(&mut colour).changed();
            ui.label(name);
            by_strength || by_colour
        })
        .inner;
    if changed {
        *value = strength * DVec3::from_array(colour.map(f64::from));
    }
    changed
}
