//! A camera is calibrated live: somebody holds the target to it, the window says where it is still lacking, and views are
//! taken by themselves.

mod advice;
mod watcher;
mod window;

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Result, bail};

use crate::app::stopwatch::Stopwatch;
use crate::app::window::ContextWaker;
use crate::app::window::event_loop::PassEnd;
use crate::app::window::lasting::LastingWindow;
use crate::calibration::{Taker, Target, Views};
use crate::capture::live::{LiveOptions, Now};
use watcher::Watcher;
use window::{CalibrationWindow, Ending, Shown};

/// Views of a target that somebody held to the camera.
pub struct Held {
    /// The views that were taken.
    pub views: Views,
    /// When each picture that was looked at came, seconds since the camera was opened.
    pub times_secs: Vec<f64>,
}

/// Opens a window on a source, as `capture::live` takes it, until Enter is pressed.
///
/// # Errors
/// No adapter, no display, a source that cannot be opened, or somebody who gave up (`stop` among them).
pub fn views(
    source: &str,
    options: &LiveOptions,
    target: Target,
    adapter: Option<&str>,
    stop: &Arc<AtomicBool>,
) -> Result<Held> {
    let taker = Taker::new(target)?;
    let ending: Arc<Mutex<Option<Ending>>> = Arc::default();
    let now: Now = Arc::new(Stopwatch::clock());
    let title = format!("{source} – gnomon calibrate");
    let window = LastingWindow {
        title: &title,
        adapter,
        now: Arc::clone(&now),
        pass_end: PassEnd::default(),
    };
    let (left, stop) = (Arc::clone(&ending), Arc::clone(stop));
    let (source, options) = (source.to_owned(), options.clone());
    window.show(move |_, creation| {
        let waker = ContextWaker::default();
        waker.set(&creation.egui_ctx);
        let watcher = Watcher::start(&source, &options, taker, &now, waker.wake());
        let shown = Shown {
            stop,
            ending: left,
            waker,
        };
        Ok(CalibrationWindow::new(watcher, target, now, shown))
    })?;
    let mut ending = ending.lock().unwrap_or_else(PoisonError::into_inner);
    match ending.take() {
        Some(Ending::Enough(held)) => Ok(*held),
        Some(Ending::Failed(error)) => Err(error),
        Some(Ending::GivenUp) | None => bail!("given up; nothing was written"),
    }
}
