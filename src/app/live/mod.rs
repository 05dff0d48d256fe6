//! Live: the tabletop demo at the webcam. Capture → tracking → drawing and window, a thread each but the last, joined by
//! mailboxes in which the newest frame alone lies.
//!
//! [`session`] is all of it but the window, which knows nothing that a test could not do; `window` and what it shows are
//! the only home of egui.

pub mod adding;
pub mod beginning;
mod canvas;
pub mod command;
mod composite_video;
mod demonstration;
mod false_colour;
mod frame_tracker;
mod gizmo;
mod keys;
pub mod meters;
mod overlays;
pub mod panel;
pub mod pipeline;
mod recorders;
mod seen_instead;
mod selected_outline;
mod selection;
pub mod session;
mod shadow_clicks;
mod shadow_lines;
pub mod views;
mod window;
pub mod window_state;

pub use frame_tracker::{TrackedPicture, TrackingPlan};

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, PoisonError};

use anyhow::Result;

use crate::app::stopwatch::Stopwatch;
use crate::app::window::ContextWaker;
use crate::app::window::event_loop::PassEnd;
use crate::app::window::lasting::LastingWindow;
use crate::capture::live::Now;
use crate::scene::CameraSettings;
use beginning::Opening;
use session::LiveSession;
use window::{Failure, LiveWindow, WindowShared};

/// The scene or camera that the window opens on.
#[derive(Debug, Clone)]
pub enum LiveStart {
    /// A scene file.
    Scene(PathBuf),
    /// A camera or a recording that no scene describes: first use.
    Camera(CameraSettings),
}

/// A request to open the live window.
#[derive(Debug, Clone)]
pub struct LiveRequest {
    /// What the window opens on.
    pub input: LiveStart,
    /// The folder for what its keys record.
    pub out: PathBuf,
    /// Part of the wanted graphics adapter's name.
    pub adapter: Option<String>,
}

/// Opens the window, until somebody closes it or `stop` is set.
///
/// # Errors
/// A scene that cannot be read, no adapter, no display, a camera that cannot be opened, or a recording that could not be
/// written; all recordings are whole then.
pub fn live(request: &LiveRequest, stop: &Arc<AtomicBool>) -> Result<()> {
    let opening = match &request.input {
        LiveStart::Scene(path) => Opening::scene(path)?,
        LiveStart::Camera(camera) => Opening::camera(camera.clone())?,
    };
    opening.files(&request.out).check()?;
    let failure: Failure = Arc::default();
    let now: Now = Arc::new(Stopwatch::clock());
    let pass_end = PassEnd::default();
    let title = window_title(&opening.title());
    let shared = WindowShared {
        stop: Arc::clone(stop),
        failure: Arc::clone(&failure),
        pass_end: pass_end.clone(),
        waker: ContextWaker::default(),
    };
    let (clock, out) = (Arc::clone(&now), request.out.clone());
    let window = LastingWindow {
        title: &title,
        adapter: request.adapter.as_deref(),
        now,
        pass_end,
    };
    window.show(move |gpu, creation| {
        let timing = (clock, shared.waker.wake());
        let session = LiveSession::open(opening, Arc::clone(gpu), &out, true, timing);
        LiveWindow::new(session, shared, gpu, creation)
    })?;
    let failed = failure
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    failed.map_or(Ok(()), Err)
}

/// A window's title, by what it shows.
fn window_title(what: &str) -> String {
    format!("{what} – gnomon")
}
