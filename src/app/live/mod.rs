//! Live: the tabletop demo at the webcam. Capture → tracking → drawing and window, a thread each but the last, joined by
//! mailboxes in which the newest frame alone lies.
//!
//! [`studio`] is all of it but the window, which knows nothing that a test could not do; `window` and what it shows are
//! the only home of egui.

mod canvas;
mod composite_video;
mod demonstration;
mod eye;
mod false_colour;
mod fit;
mod gizmo;
mod keys;
pub mod look;
pub mod meters;
pub mod notices;
mod overlays;
pub mod panel;
pub mod pipeline;
mod recorders;
mod screen;
mod selection;
mod shadow_lines;
pub mod studio;
pub mod views;
mod window;
pub mod wish;

pub use eye::{Plan, TrackedPicture};

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, PoisonError};

use anyhow::{Context as _, Result, anyhow};
use eframe::egui::ViewportBuilder;

use crate::render::Gpu;
use crate::scene::CameraSettings;
use screen::Screen;
use studio::{Opening, Studio};
use window::{Failure, Window};

/// The window's size when it opens, points, and the smallest that it can be made.
const WINDOW: [f32; 2] = [1180.0, 720.0];
const SMALLEST_WINDOW: [f32; 2] = [240.0, 160.0];

/// What the window opens on.
#[derive(Debug, Clone)]
pub enum Input {
    /// A scene file.
    Scene(PathBuf),
    /// A camera or a recording that no scene describes: first use.
    Camera(CameraSettings),
}

/// What is asked for.
#[derive(Debug, Clone)]
pub struct Request {
    /// What the window opens on.
    pub input: Input,
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
pub fn live(request: &Request, stop: &Arc<AtomicBool>) -> Result<()> {
    let opening = match &request.input {
        Input::Scene(path) => Opening::scene(path)?,
        Input::Camera(camera) => Opening::camera(camera.clone())?,
    };
    let gpu = Arc::new(Gpu::open(request.adapter.as_deref())?);
    let options = eframe::NativeOptions {
        viewport: ViewportBuilder::default()
            .with_inner_size(WINDOW)
            .with_min_inner_size(SMALLEST_WINDOW)
            .with_app_id("gnomon"),
        wgpu_options: screen::on_device(&gpu),
        ..eframe::NativeOptions::default()
    };
    let failure: Failure = Arc::default();
    let title = format!("{} – gnomon", opening.title());
    let (left, stop, out) = (Arc::clone(&failure), Arc::clone(stop), request.out.clone());
    eframe::run_native(
        &title,
        options,
        Box::new(move |creation| {
            let context = creation.egui_ctx.clone();
            let wake = Arc::new(move || context.request_repaint());
            let state = creation.wgpu_render_state.as_ref();
            let state = state.ok_or("the window does not draw with wgpu")?;
            let adapter = gpu.description().to_owned();
            let studio = Studio::open(opening, gpu, &out, true, wake);
            let screen = Screen::new(state);
            Ok(Box::new(Window::new(studio, screen, adapter, stop, left)))
        }),
    )
    .map_err(|error| anyhow!("{error}"))
    .context("the window cannot be opened")?;
    let failed = failure.lock().unwrap_or_else(PoisonError::into_inner).take();
    failed.map_or(Ok(()), Err)
}
