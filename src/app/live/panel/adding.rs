//! Things that are added: a model's file, by the system's dialog or by its name, or a shape.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};

use eframe::egui::{Button, ComboBox, ProgressBar, Ui};

use crate::app::live::adding::{WantedShape, WantedThing};
use crate::app::live::command::{Commands, SceneCommand};
use crate::scene::mesh_format::MeshFormat;
use crate::scene::{LoadStage, Scene};

/// What was said so far of the next thing.
#[derive(Debug, Default)]
pub struct Adding {
    is_real: bool,
    /// `None`: the world.
    on: Option<String>,
    file: String,
    /// Where the system's dialog tells of a file.
    pub(super) dialog: Option<Receiver<Option<PathBuf>>>,
}

/// Shows how far models are that are on their way into the scene.
pub fn being_read(ui: &mut Ui, reading: &[(&str, LoadStage)], commands: &mut Commands) {
    for (name, stage) in reading {
        ui.horizontal(|ui| {
            let text = format!("{name} {}", stage.in_words());
            ui.add(
                ProgressBar::new(stage.part())
                    .desired_width(220.0)
                    .text(text)
                    .animate(true),
            );
            if ui
                .button("stop")
                .on_hover_text("read it no further")
                .clicked()
            {
                commands.push(SceneCommand::GiveUpReading((*name).to_owned()));
            }
        });
    }
}

impl Adding {
    /// Shows what can be added.
    pub fn show(&mut self, ui: &mut Ui, scene: &Scene, commands: &mut Commands) {
        if let Some(chosen) = self.chosen() {
            self.add(WantedShape::Model(chosen), commands);
        }
        ui.collapsing("Add …", |ui| {
            ui.checkbox(&mut self.is_real, "as a phantom")
                .on_hover_text("a real thing, modelled so that light and shadow know of it");
            self.choose_anchor(ui, scene);
            ui.horizontal_wrapped(|ui| {
                for (name, shape) in WantedShape::SHAPES {
                    if ui.button(name).clicked() {
                        self.add(shape, commands);
                    }
                }
            });
            ui.horizontal(|ui| {
                let browse = Button::new("Model …");
                let hover = format!("{}; or drop it on the picture", MeshFormat::any_in_words());
                let browse = ui.add_enabled(self.dialog.is_none(), browse);
                if browse.on_hover_text(hover).clicked() {
                    self.browse(ui);
                }
                let field = ui.text_edit_singleline(&mut self.file);
                let entered = field.lost_focus()
                    && ui.input(|input| input.key_pressed(eframe::egui::Key::Enter));
                field.on_hover_text("or its name, and Enter");
                if entered && !self.file.trim().is_empty() {
                    let file = PathBuf::from(std::mem::take(&mut self.file).trim());
                    self.add(WantedShape::Model(file), commands);
                }
            });
        });
    }

    fn choose_anchor(&mut self, ui: &mut Ui, scene: &Scene) {
        if scene.anchors.len() < 2 {
            self.on = None;
            return;
        }
        let shown = self
            .on
            .clone()
            .unwrap_or_else(|| scene.anchors[0].name.clone());
        ComboBox::from_label("on")
            .selected_text(shown)
            .show_ui(ui, |ui| {
                for anchor in &scene.anchors {
                    let name = Some(anchor.name.clone());
                    ui.selectable_value(&mut self.on, name, &anchor.name);
                }
            });
    }

    /// Something to be added, of whatever was dropped too.
    pub fn add(&self, shape: WantedShape, commands: &mut Commands) {
        commands.push(SceneCommand::Add(WantedThing {
            is_real: self.is_real,
            shape,
            on: self.on.clone(),
        }));
    }

    /// Opens the system's dialog, beside the picture.
    fn browse(&mut self, ui: &Ui) {
        let (sender, chosen) = channel();
        let ctx = ui.ctx().clone();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new()
                .set_title("A model for the scene")
                .add_filter("models", &MeshFormat::all_extensions())
                .add_filter("all files", &["*"]);
            // (Nobody waits for it where the window has closed meanwhile.)
            _ = sender.send(dialog.pick_file());
            ctx.request_repaint();
        });
        self.dialog = Some(chosen);
    }

    /// The file that was chosen in the dialog just now.
    fn chosen(&mut self) -> Option<PathBuf> {
        match self.dialog.as_ref()?.try_recv() {
            Ok(chosen) => {
                self.dialog = None;
                chosen
            }
            Err(std::sync::mpsc::TryRecvError::Disconnected) => {
                self.dialog = None;
                None
            }
            Err(std::sync::mpsc::TryRecvError::Empty) => None,
        }
    }
}
