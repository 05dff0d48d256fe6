//! What is asked when there is no scene: which marker, and how large it is.

use std::path::PathBuf;

use eframe::egui::{ComboBox, Ui};

use super::Facts;
use super::editing::field;
use crate::app::live::command::{Commands, SceneCommand};
use crate::scene::format::MARKER;

/// Millimetres per point that a size is dragged.
const SPEED_MM: f64 = 0.5;

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
            Some(_) if facts.unsaved => self.offer_saving(ui, commands),
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

    fn offer_saving(&mut self, ui: &mut Ui, commands: &mut Commands) {
        ui.heading("This scene is not saved");
        ui.horizontal(|ui| {
            let label = ui.label("as");
            ui.text_edit_singleline(&mut self.save_as)
                .labelled_by(label.id);
            let named = !self.save_as.trim().is_empty();
            let button = eframe::egui::Button::new("Save");
            if ui.add_enabled(named, button).clicked() {
                let mut path = PathBuf::from(self.save_as.trim());
                if path.extension().is_none() {
                    path.set_extension("toml");
                }
                commands.push(SceneCommand::Save(path));
            }
        });
        ui.separator();
    }
}
