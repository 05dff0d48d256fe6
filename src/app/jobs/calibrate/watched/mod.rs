//! A camera is calibrated live: somebody holds the target to it, the window says where it is still lacking, and views are
//! taken by themselves.

mod advice;
mod watcher;
mod window;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::{Result, bail};

use crate::app::stopwatch::Stopwatch;
use crate::app::window::opening;
use crate::calibration::{Taker, Target, Views};
use crate::capture::live::{LiveOptions, Now};
use crate::render::Gpu;
use watcher::Watcher;
use window::{CalibrationWindow, Ending};

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
    let gpu = Gpu::open(adapter)?;
    let event_loop = opening::event_loop()?;
    let is_open = Arc::new(AtomicBool::new(false));
    let ending: Arc<Mutex<Option<Ending>>> = Arc::default();
    let now: Now = Arc::new(Stopwatch::clock());
    let begin = {
        let (opened, ending, stop) = (Arc::clone(&is_open), Arc::clone(&ending), Arc::clone(stop));
        let (source, options) = (source.to_owned(), options.clone());
        move |creation: &eframe::CreationContext| {
            let context = creation.egui_ctx.clone();
            let wake = Arc::new(move || context.request_repaint());
            let watcher = Watcher::start(&source, &options, taker, &now, wake);
            opened.store(true, Ordering::Relaxed);
            let window = CalibrationWindow::new(watcher, target, now, stop, ending);
            Ok(Box::new(window) as Box<dyn eframe::App>)
        }
    };
    let title = format!("{source} – gnomon calibrate");
    let mut application =
        eframe::create_native(&title, opening::options(&gpu), Box::new(begin), &event_loop);
    event_loop.run_app(&mut application)?;
    opening::assure(&is_open)?;
    let mut ending = ending.lock().unwrap_or_else(PoisonError::into_inner);
    match ending.take() {
        Some(Ending::Enough(held)) => Ok(*held),
        Some(Ending::Failed(error)) => Err(error),
        Some(Ending::GivenUp) | None => bail!("given up; nothing was written"),
    }
}
