//! The window's event loop. It notes when each pass has ended: only then has its picture been handed to the screen. And it
//! outlives the device: a GPU that is lost while it shows something ends the loop, not the program.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use eframe::{EframeWinitApplication, UserEvent};
use winit::application::ApplicationHandler;
use winit::event::{DeviceEvent, DeviceId, StartCause, WindowEvent};
use winit::event_loop::ActiveEventLoop;
use winit::window::WindowId;

use crate::capture::live::Now;
use crate::render::{CaughtPanic, Gpu, without_a_panic};

/// The time when the last pass ended.
#[derive(Debug, Clone, Default)]
pub struct PassEnd(Arc<AtomicU64>);

impl PassEnd {
    /// By the clock that the loop is timed with, seconds.
    pub fn secs(&self) -> f64 {
        f64::from_bits(self.0.load(Ordering::Relaxed))
    }
}

/// An application whose passes are timed, on a device that may be lost.
pub struct Passes<'a> {
    /// The application.
    pub application: EframeWinitApplication<'a>,
    /// The device that it draws with.
    pub gpu: Arc<Gpu>,
    /// The clock.
    pub now: Now,
    /// Where the ends are noted.
    pub pass_end: PassEnd,
    /// Whether the application has come to an end within a pass: it can do nothing more.
    pub is_broken: bool,
}

/// Whether a device can no longer be drawn with.
pub fn is_lost(gpu: &Gpu) -> bool {
    gpu.check().is_err_and(|error| error.ends_a_device())
}

impl<'a> Passes<'a> {
    /// egui's painter panics on a device that is lost while it draws.
    fn guarded(
        &mut self,
        event_loop: &ActiveEventLoop,
        work: impl FnOnce(&mut EframeWinitApplication<'a>),
    ) {
        if self.is_broken {
            return;
        }
        let application = &mut self.application;
        match without_a_panic(|| work(application)) {
            Ok(()) => {}
            Err(_) if is_lost(&self.gpu) => {
                self.is_broken = true;
                event_loop.exit();
            }
            Err(CaughtPanic { words, place }) => panic!("{words} (at {place})"),
        }
    }
}

impl ApplicationHandler<UserEvent> for Passes<'_> {
    fn new_events(&mut self, event_loop: &ActiveEventLoop, cause: StartCause) {
        self.guarded(event_loop, |application| {
            application.new_events(event_loop, cause);
        });
    }

    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        self.guarded(event_loop, |application| application.resumed(event_loop));
    }

    fn user_event(&mut self, event_loop: &ActiveEventLoop, event: UserEvent) {
        self.guarded(event_loop, |application| {
            application.user_event(event_loop, event);
        });
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, window: WindowId, event: WindowEvent) {
        let paints = event == WindowEvent::RedrawRequested;
        self.guarded(event_loop, |application| {
            application.window_event(event_loop, window, event);
        });
        if paints {
            let now_secs = (self.now)();
            self.pass_end.0.store(now_secs.to_bits(), Ordering::Relaxed);
        }
    }

    fn device_event(&mut self, event_loop: &ActiveEventLoop, device: DeviceId, event: DeviceEvent) {
        self.guarded(event_loop, |application| {
            application.device_event(event_loop, device, event);
        });
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        self.guarded(event_loop, |application| {
            application.about_to_wait(event_loop);
        });
    }

    fn suspended(&mut self, event_loop: &ActiveEventLoop) {
        self.guarded(event_loop, |application| application.suspended(event_loop));
    }

    fn exiting(&mut self, event_loop: &ActiveEventLoop) {
        self.guarded(event_loop, |application| application.exiting(event_loop));
    }

    fn memory_warning(&mut self, event_loop: &ActiveEventLoop) {
        self.guarded(event_loop, |application| {
            application.memory_warning(event_loop);
        });
    }
}
