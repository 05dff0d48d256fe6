//! What a person asks for by keys, by the panel, or in the picture, told apart by who does it.

use std::path::PathBuf;

use glam::DVec2;

use super::adding::WantedThing;
use super::views::ViewMode;
use crate::app::authoring::Edit;
use crate::geometry::light_placing::LightFreedom;
use crate::scene::Shortcut;

/// One thing that a person asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum LiveCommand {
    /// Of the scene and its file.
    Scene(SceneCommand),
    /// Of what is written of the pictures.
    Recording(RecordingCommand),
    /// Of the window.
    Window(WindowCommand),
    /// End the program; a scene that nobody has saved is asked for first.
    Quit,
    /// What becomes of that scene.
    Close(ClosingAnswer),
}

/// An answer to what becomes of a scene that nobody has saved when the window is closed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ClosingAnswer {
    /// It is saved in this file.
    Save(PathBuf),
    /// It is gone.
    Discard,
    /// The window stays open.
    Stay,
}

/// A command to the scene and its file.
#[derive(Debug, Clone, PartialEq)]
pub enum SceneCommand {
    /// Show an edit while it lasts (a drag).
    Preview(Edit),
    /// Make an edit.
    Commit(Edit),
    /// Drop what is previewed.
    EndPreview,
    /// Take the last edit back.
    Undo,
    /// Make it again.
    Redo,
    /// Find a light in the picture.
    Clicks(Clicks),
    /// Hide the selected thing, or show it again.
    ToggleSelected,
    /// Take the selected thing or light out of the scene.
    RemoveSelected,
    /// Put a thing into the scene.
    Add(WantedThing),
    /// Read a model that is to be put there no further, by the name that it would have.
    GiveUpReading(String),
    /// Put the selected thing into the scene once more.
    DuplicateSelected,
    /// Call a thing otherwise.
    Rename {
        /// What it is called.
        thing: String,
        /// What it is to be called.
        name: String,
    },
    /// Put a demonstration on a marker.
    Demonstrate {
        /// The marker's number in tag36h11.
        id: u32,
        /// Side of its black square, metres.
        size_m: f64,
    },
    /// Save the demonstration's scene.
    Save(PathBuf),
}

/// A command to the recorders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordingCommand {
    /// Save the picture.
    Screenshot,
    /// Begin or end to record the camera.
    ToggleSession,
    /// Begin or end to record the composite.
    ToggleVideo,
}

/// A command to the window, which has no part in the scene.
#[derive(Debug, Clone, PartialEq)]
pub enum WindowCommand {
    /// Select a thing or a light, or nothing.
    Select(Option<Selected>),
    /// Show something else.
    Show(ViewMode),
    /// Show or hide what lies over the picture.
    Toggle(Overlay),
    /// Take a shortcut of shadow volumes no more, or again.
    ToggleShortcut(Shortcut),
    /// Hold the picture, or let it go on.
    ToggleHold,
    /// Show or hide the panel.
    TogglePanel,
    /// Show or hide the list of keys.
    ToggleKeys,
    /// Fill the screen, or a window again.
    ToggleFullScreen,
    /// Out of whatever one is in: the list of keys, the search for a light, a selection, the full screen.
    Escape,
}

impl From<SceneCommand> for LiveCommand {
    fn from(command: SceneCommand) -> Self {
        Self::Scene(command)
    }
}

impl From<RecordingCommand> for LiveCommand {
    fn from(command: RecordingCommand) -> Self {
        Self::Recording(command)
    }
}

impl From<WindowCommand> for LiveCommand {
    fn from(command: WindowCommand) -> Self {
        Self::Window(command)
    }
}

/// Commands in the order in which they were given.
#[derive(Debug, Default)]
pub struct Commands(Vec<LiveCommand>);

impl Commands {
    /// One more.
    pub fn push(&mut self, command: impl Into<LiveCommand>) {
        self.0.push(command.into());
    }

    /// More of them.
    pub fn append(&mut self, commands: Self) {
        self.0.extend(commands.0);
    }
}

impl IntoIterator for Commands {
    type Item = LiveCommand;
    type IntoIter = std::vec::IntoIter<LiveCommand>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

/// Steps on the way to a light that is found in the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clicks {
    /// Hold the picture and wait for clicks.
    Begin,
    /// A click on a pixel of the undistorted picture.
    At(DVec2),
    /// Forget the last one.
    TakeBack,
    /// Forget all.
    Cancel,
    /// Find the light.
    Find(LightFreedom),
}

/// The thing or light that is selected.
#[derive(Debug, Clone, PartialEq)]
pub enum Selected {
    /// A phantom or a virtual thing, by its name.
    Thing(String),
    /// A light, by its place in the scene.
    Light(usize),
}

/// A kind of marks over the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Overlay {
    /// Outlines of the markers that were seen, with their numbers.
    Outlines,
    /// Axes of the anchors.
    Axes,
    /// Quadrilaterals that were no markers.
    Rejected,
    /// Lights, where they stand.
    Lights,
}

impl Overlay {
    /// All of them, by their names.
    pub const BY_NAME: [(&str, Self); 4] = [
        ("marker outlines", Self::Outlines),
        ("anchor axes", Self::Axes),
        ("rejected quads", Self::Rejected),
        ("lights", Self::Lights),
    ];
}
