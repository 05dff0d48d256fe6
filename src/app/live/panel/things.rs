//! Phantoms and virtual things: what is there, and where.

use eframe::egui::{ComboBox, TextEdit, Ui};
use glam::DVec3;

use super::Places;
use super::editing::{Editing, number, vector};
use super::names::{selectable, shortened};
use crate::app::authoring::{AnimationName, Edit, ThingPlace};
use crate::app::live::command::{Commands, SceneCommand, Selected, WindowCommand};
use crate::app::live::window_state::WindowState;
use crate::scene::format::{MATERIAL, PLACEMENT, TABLE};
use crate::scene::{Object, Placement, Scene};

/// Metres, degrees and factors per point that a field is dragged.
const SPEEDS: [f64; 3] = [0.0005, 0.5, 0.005];

/// Letters of an animation's name in the choice of one.
const IN_CHOICE: usize = 24;

/// The name that is being written.
#[derive(Debug, Default)]
pub struct Renaming {
    thing: String,
    name: String,
}

/// Shows them.
pub fn show(
    ui: &mut Ui,
    (scene, place): (&Scene, &Places<'_>),
    look: &WindowState,
    (editing, renaming): (&mut Editing, &mut Renaming),
    commands: &mut Commands,
) {
    for (kind, things) in [("phantoms", &scene.phantoms), ("virtual", &scene.virtuals)] {
        if things.is_empty() {
            continue;
        }
        ui.weak(kind);
        for thing in things {
            let placed = place(&thing.name);
            ui.push_id(&thing.name, |ui| {
                row(ui, thing, placed.is_some(), look, commands);
                let selected = Selected::Thing(thing.name.clone());
                let is_selected = look.selected == Some(selected);
                match placed.filter(|_| is_selected) {
                    Some(ThingPlace::Free(placement)) => {
                        actions(ui, thing, renaming, commands);
                        fields(ui, scene, thing, placement, editing, commands);
                        material(ui, thing, editing, commands);
                        animation(ui, thing, commands);
                    }
                    Some(place @ ThingPlace::TableTop { .. }) => {
                        table_top(ui, thing, place.placement(), editing, commands);
                    }
                    None => {}
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
        let checkbox = eframe::egui::Checkbox::without_text(&mut visible);
        let checkbox = ui.add_enabled(can_move, checkbox);
        let name = selectable(ui, is_selected, &thing.name);
        if name.clicked() && can_move {
            commands.push(WindowCommand::Select((!is_selected).then_some(selected)));
        }
        if checkbox.labelled_by(name.id).changed() {
            let thing = thing.name.clone();
            commands.push(SceneCommand::Commit(Edit::Show { thing, visible }));
        }
    });
}

/// Its name, to be written otherwise, a copy of it, and its end.
fn actions(ui: &mut Ui, thing: &Object, renaming: &mut Renaming, commands: &mut Commands) {
    if renaming.thing != thing.name {
        renaming.thing.clone_from(&thing.name);
        renaming.name.clone_from(&thing.name);
    }
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut renaming.name).desired_width(90.0);
        let field = ui.add(field);
        let label = ui.label("name");
        if field.labelled_by(label.id).lost_focus() && renaming.name != thing.name {
            let (thing, name) = (thing.name.clone(), renaming.name.clone());
            // (What becomes of it is shown when it has become it.)
            renaming.thing.clear();
            commands.push(SceneCommand::Rename { thing, name });
        }
        if ui.small_button("duplicate").clicked() {
            commands.push(SceneCommand::DuplicateSelected);
        }
        if ui.small_button("remove").clicked() {
            commands.push(SceneCommand::RemoveSelected);
        }
    });
}

/// What plays of its model.
fn animation(ui: &mut Ui, thing: &Object, commands: &mut Commands) {
    if thing.clips.is_empty() {
        return;
    }
    let told = |number: Option<usize>| match number.map(|number| (number, &thing.clips[number])) {
        None => "rest pose".to_owned(),
        Some((number, clip)) if clip.name.is_empty() => number.to_string(),
        Some((_, clip)) => clip.name.clone(),
    };
    let playing = thing.animation.as_ref().map(|animation| animation.number);
    let mut chosen = playing;
    ComboBox::from_label("plays")
        .selected_text(shortened(&told(playing), IN_CHOICE))
        .show_ui(ui, |ui| {
            let numbers = (0..thing.clips.len()).map(Some);
            for number in std::iter::once(None).chain(numbers) {
                ui.selectable_value(&mut chosen, number, told(number));
            }
        });
    if chosen != playing {
        commands.push(SceneCommand::Commit(Edit::Animate {
            thing: thing.name.clone(),
            animation: chosen.map(|number| match told(Some(number)) {
                name if first_of_name(thing, &name) == Some(number) => AnimationName::Named(name),
                _ => AnimationName::Numbered(number),
            }),
        }));
    }
}

/// The number of the first animation of a name.
fn first_of_name(thing: &Object, name: &str) -> Option<usize> {
    thing.clips.iter().position(|clip| clip.name == name)
}

/// The table's top: its height and what it reflects.
fn table_top(
    ui: &mut Ui,
    thing: &Object,
    mut placement: Placement,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    let [speed, ..] = SPEEDS;
    let height_m = &mut placement.position_m.z;
    if number(ui, "height", height_m, speed, &TABLE.height_m.takes).changed() {
        let thing = thing.name.clone();
        editing.changed(ui, Edit::Place { thing, placement }, commands);
    }
    if let Some(albedo) = albedo(ui, thing) {
        let edit = Edit::Material {
            thing: thing.name.clone(),
            albedo: Some(albedo),
            roughness: None,
            metallic: None,
        };
        editing.changed(ui, edit, commands);
    }
}

/// What it reflects; another colour, where somebody has chosen one.
fn albedo(ui: &mut Ui, thing: &Object) -> Option<DVec3> {
    let mut albedo = thing.materials.first()?.albedo.as_vec3().to_array();
    let changed = ui
        .horizontal(|ui| {
            let colour = ui.color_edit_button_rgb(&mut albedo);
            let name = match thing.materials.len() {
                1 => "albedo".to_owned(),
                count => format!("albedo, in place of {count} materials"),
            };
            let label = ui.label(name);
            colour.labelled_by(label.id).changed()
        })
        .inner;
    changed.then(|| DVec3::from_array(albedo.map(f64::from)))
}

/// What it is made of: of several materials the first, in place of all.
fn material(ui: &mut Ui, thing: &Object, editing: &mut Editing, commands: &mut Commands) {
    let Some(first) = thing.materials.first() else {
        return;
    };
    let mut roughness = first.layer_roughness().unwrap_or(1.0);
    let albedo = albedo(ui, thing);
    let takes = &MATERIAL.roughness.takes;
    let roughness_changed =
        number(ui, "roughness (1: matt)", &mut roughness, 0.01, takes).changed();
    let mut metallic = first.metallic;
    let takes = &MATERIAL.metallic.takes;
    let metallic_changed = number(ui, "metallic", &mut metallic, 0.01, takes).changed();
    if albedo.is_some() || roughness_changed || metallic_changed {
        let edit = Edit::Material {
            thing: thing.name.clone(),
            albedo,
            roughness: roughness_changed.then_some(roughness),
            metallic: metallic_changed.then_some(metallic),
        };
        editing.changed(ui, edit, commands);
    }
}

fn fields(
    ui: &mut Ui,
    scene: &Scene,
    thing: &Object,
    mut placement: Placement,
    editing: &mut Editing,
    commands: &mut Commands,
) {
    if let Some(anchor) = scene.anchors.get(thing.stands_on()) {
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
