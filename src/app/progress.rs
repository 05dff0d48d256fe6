//! A progress bar with frames, speed and time left; shown only where stderr is a terminal.

use indicatif::{ProgressBar, ProgressStyle};

/// Counts frames.
pub struct Progress(ProgressBar);

impl Progress {
    /// `expected`: frames to come, where that is known.
    pub fn new(expected: Option<u32>) -> Self {
        let (bar, template) = match expected {
            Some(count) => (
                ProgressBar::new(count.into()),
                "{bar:40} {pos}/{len} frames  {per_sec}  {eta} left",
            ),
            None => (
                ProgressBar::new_spinner(),
                "{spinner} {pos} frames  {per_sec}",
            ),
        };
        // A template that cannot be read falls back to the library's own.
        Self(match ProgressStyle::with_template(template) {
            Ok(style) => bar.with_style(style),
            Err(_) => bar,
        })
    }

    /// One frame more is done.
    pub fn advance(&self) {
        self.0.inc(1);
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
