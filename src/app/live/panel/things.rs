//! Phantoms and virtual things: what is there, and where.

use eframe::egui::Ui;

use super::Placements;
use super::editing::{Editing, vector};
use crate::app::authoring::Edit;
use crate::app::live::command::{Commands, SceneCommand, Selected, WindowCommand};
use crate::app::live::window_state::WindowState;
use crate::scene::format::PLACEMENT;
use crate::scene::{Object, Placement, Scene};

/// Metres, degrees and factors per point that a field is dragged.
const SPEEDS: [f64; 3] = [0.0005, 0.5, 0.005];

/// Shows them.
pub fn show(
    ui: &mut Ui,
    (scene, placement): (&Scene, &Placements<'_>),
    look: &WindowState,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    for (kind, things) in [("phantoms", &scene.phantoms), ("virtual", &scene.virtuals)] {
        if things.is_empty() {
            continue;
        }
        ui.weak(kind);
        for thing in things {
            let placed = placement(&thing.name);
            ui.push_id(&thing.name, |ui| {
                row(ui, thing, placed.is_some(), look, commands);
                let selected = Selected::Thing(thing.name.clone());
                if let (Some(placement), true) = (placed, look.selected == Some(selected)) {
                    fields(ui, scene, thing, placement, editing, commands);
                }
            });
        }
    }
}

/// Whether it is there, and its name.
fn row(ui: &mut Ui, thing: &Object, can_move: bool, look: &WindowState, commands: &mut Commands) {
    let selected = Selected::Thing(thing.name.clone());
    let is_selected = look.selected.as_ref() == Some(&selected);
    ui.horizontal(|ui| {
        let mut visible = thing.visible;
        // The table has no key for it.
        let checkbox = eframe::egui::Checkbox::without_text(&mut visible);
        let checkbox = ui.add_enabled(can_move, checkbox);
        let name = ui.selectable_label(is_selected, &thing.name);
        if name.clicked() && can_move {
            commands.push(WindowCommand::Select((!is_selected).then_some(selected)));
        }
        if checkbox.labelled_by(name.id).changed() {
            let thing = thing.name.clone();
            commands.push(SceneCommand::Commit(Edit::Show { thing, visible }));
        }
    });
}

fn fields(
    ui: &mut Ui,
    scene: &Scene,
    thing: &Object,
    mut placement: Placement,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    let anchor = thing
        .motion
        .as_ref()
        .map_or(thing.anchor, |motion| motion.anchor);
    if let Some(anchor) = scene.anchors.get(anchor) {
        ui.weak(format!("on {}", anchor.name));
    }
    let [position, rotation, scale] = SPEEDS;
    let [m, degrees, factor] = [
        &PLACEMENT.position_m,
        &PLACEMENT.rotation_deg,
        &PLACEMENT.scale,
    ]
    .map(|key| key.takes.numbers);
    let placed = &mut placement.position_m;
    let moved = vector(ui, m.unit, placed, position, &m.unit(""));
    let turned = vector(
        ui,
        "turned",
        &mut placement.rotation_deg,
        rotation,
        &degrees,
    );
    let scaled = vector(ui, "scale", &mut placement.scale, scale, &factor);
    if moved || turned || scaled {
        let thing = thing.name.clone();
        editing.changed(ui, Edit::Place { thing, placement }, commands);
    }
}
