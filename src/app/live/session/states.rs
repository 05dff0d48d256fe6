//! The states of the live session: of its scene, of its picture.

use std::sync::Arc;

use super::super::demonstration::Demonstration;
use super::super::frame_tracker::TrackedPicture;
use super::super::meters::Sample;
use super::super::shadow_clicks::ShadowClicks;
use super::super::views::ViewMode;
use super::super::window_state::WindowState;
use super::things::ReadAhead;
use crate::app::authoring::{Edit, SceneDocument, SceneWatch};
use crate::app::window::Wake;

/// The scene, as far as there is one.
pub(super) enum SceneState {
    /// First use: nobody has said what stands on the table.
    Absent,
    /// A scene is shown and edited.
    Open(Box<OpenScene>),
}

/// A scene that is shown and edited.
pub(super) struct OpenScene {
    pub(super) document: SceneDocument,
    /// Tells what becomes of its files.
    pub(super) watch: SceneWatch,
    pub(super) origin: Origin,
    /// What is shown while it lasts.
    pub(super) previewed: Option<Edit>,
    /// Models that are on their way into it.
    pub(super) reading: Vec<ReadAhead>,
}

/// The place of a scene's file.
pub(super) enum Origin {
    /// Where a person keeps it.
    Saved,
    /// In a folder that is gone with the program, until somebody saves it.
    Unsaved { folder: Demonstration },
}

/// The picture, as far as there is one.
pub(super) enum PictureState {
    /// None has come yet.
    Awaited,
    /// The newest, until a newer one comes.
    Following(Box<DrawnPicture>),
    /// One that is held, while a light is found in it by clicks.
    FindingLight(Box<DrawnPicture>, Box<ShadowClicks>),
}

/// The frame that was drawn last.
pub(super) struct DrawnPicture {
    pub(super) tracked: TrackedPicture,
    /// The view that it was drawn in, while nothing has changed since.
    pub(super) drawn: Option<ViewMode>,
    /// Its times, until its display is told of.
    pub(super) pending: Option<Pending>,
}

/// A frame that was drawn, and not yet seen to be on the screen.
pub(super) struct Pending {
    pub(super) begun_secs: f64,
    pub(super) arrived_secs: f64,
    pub(super) sample: Sample,
}

impl SceneState {
    pub(super) fn of(document: Option<SceneDocument>, wake: &Wake) -> Self {
        document.map_or(Self::Absent, |document| {
            Self::opened(document, Origin::Saved, wake)
        })
    }

    pub(super) fn opened(document: SceneDocument, origin: Origin, wake: &Wake) -> Self {
        Self::Open(Box::new(OpenScene {
            watch: watch(&document, wake),
            document,
            origin,
            previewed: None,
            reading: Vec::new(),
        }))
    }

    pub(super) fn open(&self) -> Option<&OpenScene> {
        match self {
            Self::Absent => None,
            Self::Open(scene) => Some(scene),
        }
    }

    pub(super) fn open_mut(&mut self) -> Option<&mut OpenScene> {
        match self {
            Self::Absent => None,
            Self::Open(scene) => Some(scene),
        }
    }
}

pub(super) fn watch(document: &SceneDocument, wake: &Wake) -> SceneWatch {
    let wake = Arc::clone(wake);
    document.watch(move || wake())
}

impl PictureState {
    pub(super) fn drawn(&self) -> Option<&DrawnPicture> {
        match self {
            Self::Awaited => None,
            Self::Following(picture) | Self::FindingLight(picture, _) => Some(picture.as_ref()),
        }
    }

    pub(super) fn drawn_mut(&mut self) -> Option<&mut DrawnPicture> {
        match self {
            Self::Awaited => None,
            Self::Following(picture) | Self::FindingLight(picture, _) => Some(picture.as_mut()),
        }
    }

    /// Whether it stays although a newer one has come.
    pub(super) fn is_held(&self, state: &WindowState) -> bool {
        match self {
            Self::Awaited => false,
            Self::Following(_) => state.holds,
            Self::FindingLight(..) => true,
        }
    }

    /// What is shown of it: virtual things would hide the shadows that are to be clicked.
    pub(super) fn view(&self, state: &WindowState) -> ViewMode {
        match self {
            Self::FindingLight(..) => ViewMode::Bare,
            Self::Awaited | Self::Following(_) => state.view,
        }
    }

    pub(super) fn clicks(&self) -> Option<&ShadowClicks> {
        match self {
            Self::FindingLight(_, clicks) => Some(clicks.as_ref()),
            Self::Awaited | Self::Following(_) => None,
        }
    }

    /// With clicks a light is found in it from now on, without them no longer.
    pub(super) fn set_clicks(&mut self, clicks: Option<ShadowClicks>) {
        *self = match (std::mem::replace(self, Self::Awaited), clicks) {
            (Self::Awaited, _) => Self::Awaited,
            (Self::Following(picture) | Self::FindingLight(picture, _), None) => {
                Self::Following(picture)
            }
            (Self::Following(picture) | Self::FindingLight(picture, _), Some(clicks)) => {
                Self::FindingLight(picture, Box::new(clicks))
            }
        };
    }

    /// Something has changed: it has to be drawn again.
    pub(super) fn draw_again(&mut self) {
        if let Some(picture) = self.drawn_mut() {
            picture.drawn = None;
        }
    }
}
