//! What every window of the program has: how it is opened, where the picture lies in it, what it tells.

pub(crate) mod event_loop;
pub(crate) mod fit;
pub(crate) mod lasting;
pub mod notices;
pub(crate) mod opening;
pub(crate) mod screen;

use std::sync::{Arc, Mutex, PoisonError};

use eframe::egui::Context;

/// A call from another thread whenever there is something new to show.
pub type Wake = Arc<dyn Fn() + Send + Sync>;

/// Wakes the context that shows a window now: another one after its device was lost.
#[derive(Clone, Default)]
pub(crate) struct ContextWaker(Arc<Mutex<Option<Context>>>);

impl ContextWaker {
    /// It is shown by this context from now on.
    pub fn set(&self, context: &Context) {
        let mut shown_by = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *shown_by = Some(context.clone());
    }

    /// For other threads.
    pub fn wake(&self) -> Wake {
        let shown_by = Arc::clone(&self.0);
        Arc::new(move || {
            let context = shown_by
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .clone();
            if let Some(context) = context {
                context.request_repaint();
            }
        })
    }
}
