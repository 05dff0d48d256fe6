//! What happens to a live source, told on stderr by the commands without a window.

use super::live_capture::CaptureEvent;
use crate::app::talk;

/// Says an event; the one that ends a job is the job's to tell.
pub(crate) fn say(event: &CaptureEvent) {
    match event {
        CaptureEvent::Opened(opened) => {
            talk::say(format_args!("{}: {}", opened.name, opened.format))
        }
        CaptureEvent::Lost(error) => talk::say(format_args!("{error}; waiting until it is back")),
        CaptureEvent::Back(opened) => {
            talk::say(format_args!("{} is back: {}", opened.name, opened.format))
        }
        CaptureEvent::Failed(_) | CaptureEvent::Ended => {}
    }
}
