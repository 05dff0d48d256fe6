//! The panel beside the picture. It is shown facts and gives back commands; it changes nothing itself.

mod adding;
mod editing;
mod first_use;
mod light_from_picture;
mod lights;
mod names;
mod shadows;
mod things;
mod times;
mod tracking;

use std::path::Path;
use std::sync::mpsc::Receiver;

use eframe::egui::{CollapsingHeader, Context, ScrollArea, Ui};

use super::adding::WantedShape;
use super::command::{Commands, Overlay, RecordingCommand, SceneCommand, WindowCommand};
use super::frame_tracker::TrackedPicture;
use super::meters::Meters;
use super::views::ViewMode;
use super::window_state::WindowState;
use crate::app::authoring::ThingPlace;
use crate::scene::{LoadStage, Scene, Shortcut, Shortcuts};
use adding::Adding;
pub use adding::DialogEnd;
use editing::Editing;
use first_use::FirstUse;
use names::{shortened, with_whole};
use things::Renaming;

/// Letters that a button of its own row shows at most.
const IN_BUTTON: usize = 40;

/// Where a thing stands, in the numbers of the scene's file; `None` where it has none there.
pub type Places<'a> = dyn Fn(&str) -> Option<ThingPlace> + 'a;

/// What the panel shows.
pub struct Facts<'a> {
    /// The scene; `None` on first use.
    pub scene: Option<&'a Scene>,
    /// Its file.
    pub path: Option<&'a Path>,
    /// Whether it has yet to be saved.
    pub unsaved: bool,
    /// Where a thing stands, in the numbers of the scene's file.
    pub place: &'a Places<'a>,
    /// What would be taken back, and what made again.
    pub history: [Option<&'a str>; 2],
    /// The frame that is shown.
    pub picture: Option<&'a TrackedPicture>,
    /// What it costs.
    pub meters: &'a Meters,
    /// What the program's clock shows, seconds.
    pub now_secs: f64,
    /// Frames that came, and those that were not shown: tracking was busy, the window was, they came broken.
    pub frames: (u64, [u64; 3]),
    /// The camera, in words.
    pub camera: &'a str,
    /// What draws, in words.
    pub adapter: &'a str,
    /// Whether a session and a video are being recorded.
    pub records: [bool; 2],
    /// The models that are being read: what they will be called, and how far they are.
    pub reading: Vec<(&'a str, LoadStage)>,
    /// Where a light is being found in the picture: pairs that were clicked, and whether a shadow is to be clicked next.
    pub clicks: Option<(usize, bool)>,
}

/// What the panel itself remembers.
#[derive(Debug, Default)]
pub struct Panel {
    editing: Editing,
    first_use: FirstUse,
    adding: Adding,
    things: Renaming,
}

impl Panel {
    /// Files that were dropped on the picture: each a model, as what was chosen for the next thing.
    pub fn add_dropped<'a>(
        &self,
        files: impl IntoIterator<Item = &'a Path>,
        commands: &mut Commands,
    ) {
        // (What has no path is no file of this machine.)
        let named = files
            .into_iter()
            .filter(|file| !file.as_os_str().is_empty());
        for file in named {
            self.adding
                .add(WantedShape::Model(file.to_owned()), commands);
        }
    }

    /// The system's dialog is open from now on; what is chosen in it comes here.
    pub fn await_dialog(&mut self, ended: Receiver<DialogEnd>) {
        self.adding.await_dialog(ended);
    }

    /// Asks, before the window closes, what becomes of a scene that nobody has saved.
    pub fn ask_before_closing(&mut self, ctx: &Context) -> Commands {
        let mut commands = Commands::default();
        self.first_use.ask_before_closing(ctx, &mut commands);
        commands
    }

    /// Shows it: what is asked for.
    pub fn show(&mut self, ui: &mut Ui, facts: &Facts<'_>, look: &WindowState) -> Commands {
        let mut commands = Commands::default();
        ScrollArea::vertical()
            .auto_shrink([false, false])
            .show(ui, |ui| {
                self.first_use.show(ui, facts, &mut commands);
                recording(ui, facts, &mut commands);
                let editing = &mut self.editing;
                section(ui, "Tracking", true, |ui| {
                    tracking::show(ui, facts, editing, &mut commands);
                });
                if let Some(scene) = facts.scene {
                    section(ui, "Things", true, |ui| {
                        self.adding.show(ui, scene, &mut commands);
                        adding::being_read(ui, &facts.reading, &mut commands);
                        let fields = (&mut *editing, &mut self.things);
                        things::show(ui, (scene, facts.place), look, fields, &mut commands);
                    });
                    section(ui, "Lights", true, |ui| {
                        lights::show(ui, scene, look, editing, &mut commands);
                        light_from_picture::show(ui, facts.clicks, &mut commands);
                    });
                    section(ui, "Shadows", false, |ui| {
                        shadows::show(ui, scene, editing, &mut commands);
                    });
                    history(ui, facts, &mut commands);
                }
                section(ui, "View", false, |ui| view(ui, look, &mut commands));
                section(ui, "Times", true, |ui| times::show(ui, facts));
            });
        self.editing.settle(ui, &mut commands);
        commands
    }
}

fn section(ui: &mut Ui, title: &str, open: bool, contents: impl FnOnce(&mut Ui)) {
    CollapsingHeader::new(title)
        .default_open(open)
        .show(ui, contents);
}

fn recording(ui: &mut Ui, facts: &Facts<'_>, commands: &mut Commands) {
    ui.label(facts.camera);
    let [session, video] = facts.records;
    ui.horizontal_wrapped(|ui| {
        let mut button = |text: &str, hover: &str, command| {
            if ui.button(text).on_hover_text(hover).clicked() {
                commands.push(command);
            }
        };
        button(
            "Picture",
            "save it as it is shown (S)",
            RecordingCommand::Screenshot,
        );
        let text = if session {
            "End session"
        } else {
            "Record session"
        };
        button(
            text,
            "the camera, for replay (R)",
            RecordingCommand::ToggleSession,
        );
        let text = if video { "End video" } else { "Record video" };
        button(text, "the composite (V)", RecordingCommand::ToggleVideo);
    });
}

fn view(ui: &mut Ui, look: &WindowState, commands: &mut Commands) {
    ui.horizontal_wrapped(|ui| {
        for (name, view) in ViewMode::BY_NAME {
            if ui.selectable_label(look.view == view, name).clicked() && look.view != view {
                commands.push(WindowCommand::Show(view));
            }
        }
    });
    for (name, overlay) in Overlay::BY_NAME {
        let mut shown = look.shows(overlay);
        if ui.checkbox(&mut shown, name).changed() {
            commands.push(WindowCommand::Toggle(overlay));
        }
    }
    // Where somebody looks for a wrong shadow, and wherever one is off.
    let one_is_off = look.without != Shortcuts::NONE;
    if matches!(look.view, ViewMode::StencilCount | ViewMode::Volumes) || one_is_off {
        ui.label("Shortcuts of shadow volumes").on_hover_text(
            "They change no pixel: one that does when it is switched off is what a wrong pixel comes from.",
        );
        for (name, shortcut) in Shortcut::BY_NAME {
            let mut taken = !look.without.has(shortcut);
            if ui.checkbox(&mut taken, name).changed() {
                commands.push(WindowCommand::ToggleShortcut(shortcut));
            }
        }
    }
}

fn history(ui: &mut Ui, facts: &Facts<'_>, commands: &mut Commands) {
    if let (Some(path), false) = (facts.path, facts.unsaved) {
        ui.weak(format!("Edits are written into {}.", path.display()));
    }
    ui.horizontal_wrapped(|ui| {
        for (verb, step, command) in [
            ("Undo", facts.history[0], SceneCommand::Undo),
            ("Redo", facts.history[1], SceneCommand::Redo),
        ] {
            let text = match step {
                Some(step) => format!("{verb}: {step}"),
                None => verb.to_owned(),
            };
            let shown = shortened(&text, IN_BUTTON);
            let button = eframe::egui::Button::new(shown.as_ref());
            let button = ui.add_enabled(step.is_some(), button);
            if with_whole(button, &text, &shown).clicked() {
                commands.push(command);
            }
        }
    });
}
