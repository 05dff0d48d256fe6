//! What is asked when there is no scene: which marker, and how large it is.

use std::path::PathBuf;

use eframe::egui::{Button, ComboBox, Context, Id, Key, Modal, TextEdit, Ui};

use super::Facts;
use super::editing::field;
use crate::app::live::command::{ClosingAnswer, Commands, LiveCommand, SceneCommand};
use crate::scene::format::MARKER;

/// Millimetres per point that a size is dragged.
const SPEED_MM: f64 = 0.5;

/// Width of the field for a file's name, points.
const NAME_WIDTH: f32 = 190.0;

/// What was answered so far.
#[derive(Debug)]
pub struct FirstUse {
    id: Option<u32>,
    size_mm: f64,
    save_as: String,
}

impl Default for FirstUse {
    fn default() -> Self {
        Self {
            id: None,
            size_mm: 40.0,
            save_as: "scene.toml".to_owned(),
        }
    }
}

impl FirstUse {
    /// Asks what is not known yet.
    pub fn show(&mut self, ui: &mut Ui, facts: &Facts<'_>, commands: &mut Commands) {
        match facts.scene {
            None => self.ask_size(ui, facts, commands),
            Some(_) if facts.unsaved => {
                ui.heading("This scene is not saved");
                if let Some(path) = self.ask_name(ui) {
                    commands.push(SceneCommand::Save(path));
                }
                ui.separator();
            }
            Some(_) => {}
        }
    }

    fn ask_size(&mut self, ui: &mut Ui, facts: &Facts<'_>, commands: &mut Commands) {
        ui.heading("First use");
        let seen = facts.picture.map_or(&[][..], |picture| &picture.detections);
        let mut ids: Vec<u32> = seen.iter().map(|detection| detection.id).collect();
        ids.dedup();
        let Some(&first) = ids.first() else {
            ui.label(
                "Hold a marker of tag36h11 into the picture. To print one:\n\
                 gnomon markers --ids 0 --size-mm 40 --out marker.pdf",
            );
            ui.separator();
            return;
        };
        let mut id = self.id.filter(|id| ids.contains(id)).unwrap_or(first);
        ComboBox::from_label("marker")
            .selected_text(id.to_string())
            .show_ui(ui, |ui| {
                for &seen in &ids {
                    ui.selectable_value(&mut id, seen, seen.to_string());
                }
            });
        self.id = Some(id);
        ui.horizontal(|ui| {
            let allowed = MARKER.size_m.takes.scaled(1e3, "mm");
            let field = field(ui, &mut self.size_mm, SPEED_MM, &allowed);
            let label = ui.label("side of its black square");
            field.labelled_by(label.id);
        });
        if ui.button("Put something on it").clicked() {
            let size_m = self.size_mm * 1e-3;
            commands.push(SceneCommand::Demonstrate { id, size_m });
        }
        ui.separator();
    }

    /// Asks what becomes of the scene before the window closes.
    pub fn ask_before_closing(&mut self, ctx: &Context, commands: &mut Commands) {
        let asked = Modal::new(Id::unique("closing")).show(ctx, |ui| {
            ui.heading("This scene is not saved");
            let path = self.ask_name(ui);
            let mut answer = path.map(ClosingAnswer::Save);
            ui.horizontal(|ui| {
                if ui.button("Discard it and close").clicked() {
                    answer = Some(ClosingAnswer::Discard);
                }
                if ui.button("Stay").clicked() {
                    answer = Some(ClosingAnswer::Stay);
                }
            });
            answer
        });
        let stays = asked.should_close().then_some(ClosingAnswer::Stay);
        if let Some(answer) = asked.inner.or(stays) {
            commands.push(LiveCommand::Close(answer));
        }
    }

    /// The file that the scene is to be saved as, once it is said.
    fn ask_name(&mut self, ui: &mut Ui) -> Option<PathBuf> {
        let asked = ui.horizontal(|ui| {
            let label = ui.label("as");
            let field = TextEdit::singleline(&mut self.save_as).desired_width(NAME_WIDTH);
            let field = ui.add(field).labelled_by(label.id);
            let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
            let is_named = !self.save_as.trim().is_empty();
            let button = ui.add_enabled(is_named, Button::new("Save"));
            is_named && (entered || button.clicked())
        });
        asked.inner.then(|| {
            let mut path = PathBuf::from(self.save_as.trim());
            if path.extension().is_none() {
                path.set_extension("toml");
            }
            path
        })
    }
}
