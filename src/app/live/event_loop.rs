//! The window's event loop, which notes when each pass has ended: only then has its picture been handed to the screen.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use eframe::{EframeWinitApplication, UserEvent};
use winit::application::ApplicationHandler;
use winit::event::{DeviceEvent, DeviceId, StartCause, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::window::WindowId;

use crate::capture::live::Now;

/// The time when the last pass ended.
#[derive(Debug, Clone, Default)]
pub struct PassEnd(Arc<AtomicU64>);

impl PassEnd {
    /// By the clock that the loop is timed with, seconds.
    pub fn secs(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }
}

/// An application whose passes are timed.
pub struct Timed<'a> {
    /// The application.
    pub application: EframeWinitApplication<'a>,
    /// The clock.
    pub now: Now,
    /// Where the ends are noted.
    pub pass_end: PassEnd,
}

impl ApplicationHandler<UserEvent> for Timed<'_> {
    fn new_events(&mut self, event_loop: &ActiveEventLoop, cause: StartCause) {
        self.application.new_events(event_loop, cause);
    }

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        self.application.resumed(event_loop);
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, event: UserEvent) {
        self.application.user_event(event_loop, event);
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, window: WindowId, event: WindowEvent) {
        let paints = event == WindowEvent::RedrawRequested;
        self.application.window_event(event_loop, window, event);
        if paints {
            let now_secs = (self.now)();
            self.pass_end.0.store(now_secs.to_bits(), Ordering::Relaxed);
        }
    }

    fn device_event(&mut self, event_loop: &ActiveEventLoop, device: DeviceId, event: DeviceEvent) {
        self.application.device_event(event_loop, device, event);
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        self.application.about_to_wait(event_loop);
    }

    fn suspended(&mut self, event_loop: &ActiveEventLoop) {
        self.application.suspended(event_loop);
    }

    fn exiting(&mut self, event_loop: &ActiveEventLoop) {
        self.application.exiting(event_loop);
    }

    fn memory_warning(&mut self, event_loop: &ActiveEventLoop) {
        self.application.memory_warning(event_loop);
    }
}
