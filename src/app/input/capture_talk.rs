//! What happens to a live source, told on stderr by the commands without a window.

use super::live_capture::CaptureEvent;

/// Says an event; the one that ends a job is the job's to tell.
pub(crate) fn say(event: &CaptureEvent) {
    match event {
        CaptureEvent::Opened(opened) => eprintln!("{}: {}", opened.name, opened.format),
        CaptureEvent::Lost(error) => eprintln!("{error}; waiting until it is back"),
        CaptureEvent::Back(opened) => eprintln!("{} is back: {}", opened.name, opened.format),
        CaptureEvent::Failed(_) | CaptureEvent::Ended => {}
    }
}
