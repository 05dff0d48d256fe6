//! How a window is opened, and what is told where it cannot be.

use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Result, anyhow, ensure};
use eframe::egui::ViewportBuilder;
use eframe::{NativeOptions, UserEvent};
use winit::event_loop::EventLoop;

use super::screen;
use crate::render::Gpu;

/// The window's size when it opens, points, and the smallest that it can be made.
const WINDOW: [f32; 2] = [1180.0, 720.0];
const SMALLEST_WINDOW: [f32; 2] = [240.0, 160.0];

/// A window that draws on a device.
pub fn options(gpu: &Gpu) -> NativeOptions {
    NativeOptions {
        viewport: ViewportBuilder::default()
            .with_inner_size(WINDOW)
            .with_min_inner_size(SMALLEST_WINDOW)
            .with_app_id("gnomon"),
        wgpu_options: screen::on_device(gpu),
        // The camera's own noise dithers enough.
        dithering: false,
        ..NativeOptions::default()
    }
}

/// Where the display's events come from.
///
/// # Errors
/// No display.
pub fn event_loop() -> Result<EventLoop<UserEvent>> {
    EventLoop::<UserEvent>::with_user_event()
        .build()
        .map_err(|error| {
            // What comes before its last part is where in winit's source it arose.
            let error = error.to_string();
            let reason = error.rsplit(": ").next().unwrap_or_default();
            anyhow!("the window cannot be opened (is there a display?): {reason}")
        })
}

/// # Errors
/// The event loop has ended without having opened a window.
pub fn assure(is_open: &AtomicBool) -> Result<()> {
    ensure!(
        is_open.load(Ordering::Relaxed),
        "the window cannot be opened: the adapter does not draw on this display (--adapter NAME chooses another)"
    );
    Ok(())
}
