//! Things that are added: a model's file, by the system's dialog or by its name, or a shape.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, TryRecvError, channel};

use eframe::egui::{Button, ComboBox, Key, ProgressBar, TextEdit, Ui};

use super::names::{shortened, with_whole};
use crate::app::live::adding::{WantedShape, WantedThing};
use crate::app::live::command::{Commands, SceneCommand};
use crate::app::stopwatch::Stopwatch;
use crate::scene::mesh_format::MeshFormat;
use crate::scene::{LoadStage, Scene};

/// A dialog that ends sooner was closed by no person, milliseconds.
const SOONEST_MS: f64 = 300.0;
/// A dialog that has said nothing for so long may be none, and another one may be asked for, seconds.
const PATIENCE_SECS: f64 = 10.0;
/// Letters of a model's name beside the stage that it is in.
const IN_BAR: usize = 12;
/// Letters of an anchor's name in the choice of one.
const IN_CHOICE: usize = 24;
/// What the field for a file's name has on its right, points.
const FIELD_MARGIN: f32 = 14.0;

/// The end of the system's dialog.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum DialogEnd {
    /// This file was chosen.
    Chosen(PathBuf),
    /// None was.
    Cancelled,
    /// There is no dialog on this machine.
    NoDialog,
}

/// What was said so far of the next thing.
#[derive(Debug, Default)]
pub struct Adding {
    is_real: bool,
    /// `None`: the world.
    on: Option<String>,
    file: String,
    /// How many things there were when that file was asked for.
    things_before: Option<usize>,
    /// Where the system's dialogs tell of their ends.
    dialogs: Vec<Receiver<DialogEnd>>,
    /// When the last one was opened, by the window's time.
    opened_secs: f64,
    /// Whether none can be opened here.
    no_dialog: bool,
}

/// Shows how far models are that are on their way into the scene.
pub fn being_read(ui: &mut Ui, reading: &[(&str, LoadStage)], commands: &mut Commands) {
    for (name, stage) in reading {
        ui.horizontal(|ui| {
            let shown = shortened(name, IN_BAR);
            let bar = ProgressBar::new(stage.part())
                .desired_width(220.0)
                .text(format!("{shown} {}", stage.in_words()))
                .animate(true);
            with_whole(ui.add(bar), name, &shown);
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
        self.hear_dialogs(commands);
        let things = scene.phantoms.len() + scene.virtuals.len();
        // What was asked for has come; until then its name stays, to be mended.
        if self.things_before.is_some_and(|before| things > before) {
            self.things_before = None;
            self.file.clear();
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
                let now_secs = ui.input(|input| input.time);
                let may_be_open =
                    !self.dialogs.is_empty() && now_secs - self.opened_secs < PATIENCE_SECS;
                let browse = ui.add_enabled(!may_be_open, browse);
                if browse.on_hover_text(hover).clicked() {
                    self.browse(ui);
                }
                let field = TextEdit::singleline(&mut self.file)
                    .hint_text("or its file, and Enter")
                    .desired_width(ui.available_width() - FIELD_MARGIN);
                let field = ui.add(field);
                let entered = field.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                let hover = "from here, or from the scene's folder";
                field.on_hover_text(hover);
                if entered && !self.file.trim().is_empty() {
                    let file = PathBuf::from(self.file.trim());
                    self.things_before = Some(things);
                    self.add(WantedShape::Model(file), commands);
                }
            });
            if self.no_dialog {
                ui.colored_label(
                    ui.visuals().warn_fg_color,
                    "There is no file dialog here (no desktop portal, no zenity): type the file's name, or drop it.",
                );
            }
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
            .selected_text(shortened(&shown, IN_CHOICE))
            .show_ui(ui, |ui| {
                for anchor in &scene.anchors {
                    let name = Some(anchor.name.clone());
                    let shown = shortened(&anchor.name, IN_CHOICE);
                    ui.selectable_value(&mut self.on, name, shown);
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
        let (sender, ended) = channel();
        let ctx = ui.ctx().clone();
        std::thread::spawn(move || {
            let dialog = rfd::FileDialog::new()
                .set_title("A model for the scene")
                .add_filter("models", &MeshFormat::all_extensions())
                .add_filter("all files", &["*"]);
            let (chosen, ms) = Stopwatch::time(|| dialog.pick_file());
            // (Nobody waits for it where the window has closed meanwhile.)
            _ = sender.send(DialogEnd::of(chosen, ms));
            ctx.request_repaint();
        });
        self.opened_secs = ui.input(|input| input.time);
        self.await_dialog(ended);
    }

    /// A dialog is open from now on.
    pub(super) fn await_dialog(&mut self, ended: Receiver<DialogEnd>) {
        self.dialogs.push(ended);
    }

    /// Takes what dialogs have ended with.
    fn hear_dialogs(&mut self, commands: &mut Commands) {
        let mut ends = Vec::new();
        self.dialogs.retain(|dialog| match dialog.try_recv() {
            Ok(end) => {
                ends.push(end);
                false
            }
            // (Its thread has panicked, which was told where it happened.)
            Err(TryRecvError::Disconnected) => false,
            Err(TryRecvError::Empty) => true,
        });
        for end in ends {
            self.no_dialog = end == DialogEnd::NoDialog;
            if let DialogEnd::Chosen(file) = end {
                self.add(WantedShape::Model(file), commands);
            }
        }
    }
}

impl DialogEnd {
    /// By the file that was chosen, if any, and how long it took. The system does not tell a dialog that was closed from one
    /// that there is not.
    fn of(chosen: Option<PathBuf>, ms: f64) -> Self {
        match chosen {
            Some(file) => Self::Chosen(file),
            None if ms < SOONEST_MS => Self::NoDialog,
            None => Self::Cancelled,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dialog_that_nobody_can_have_closed_was_none() {
        let file = PathBuf::from("a.obj");
        assert_eq!(
            DialogEnd::of(Some(file.clone()), 1.0),
            DialogEnd::Chosen(file)
        );
        assert_eq!(DialogEnd::of(None, 20.0), DialogEnd::NoDialog);
        assert_eq!(DialogEnd::of(None, 2000.0), DialogEnd::Cancelled);
    }
}
