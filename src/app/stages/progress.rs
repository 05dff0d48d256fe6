//! Progress bars with what is done and time left; shown only where stderr is a terminal.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::scene::{LoadStage, Loading};

/// A progress bar that counts frames, or measurements.
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
        Self::styled(bar, template)
    }

    /// Counts points of things.
    pub fn of_points(count: usize) -> Self {
        let template = "{bar:30} {pos}/{len} points of self-shadows  {eta} left";
        Self::styled(ProgressBar::new(count as u64), template)
    }

    /// Counts the measurements of charts, of which there are `count`.
    pub fn of_measurements(count: usize) -> Self {
        let bar = ProgressBar::new(count as u64);
        Self::styled(bar, "{bar:40} {pos}/{len}  {msg}  {elapsed} so far")
    }

    /// Shows how far models are while `work` reads them.
    pub fn of_models<T>(loading: &Loading, work: impl FnOnce() -> T) -> T {
        const PERIOD: Duration = Duration::from_millis(100);
        let bar = Self::styled(ProgressBar::new_spinner(), "{spinner} {msg}  {elapsed}");
        if bar.0.is_hidden() {
            return work();
        }
        thread::scope(|scope| {
            let (done, waits) = channel::<()>();
            scope.spawn(move || {
                while waits.recv_timeout(PERIOD) == Err(RecvTimeoutError::Timeout) {
                    if loading.stage() > LoadStage::Waiting {
                        bar.tell(&loading.in_words());
                        bar.0.tick();
                    }
                }
                bar.finish();
            });
            let worked = work();
            drop(done);
            worked
        })
    }

    fn styled(bar: ProgressBar, template: &str) -> Self {
        // A template that cannot be read falls back to the library's own.
        Self(match ProgressStyle::with_template(template) {
            Ok(style) => bar.with_style(style),
            Err(_) => bar,
        })
    }

    /// Says what is being done.
    pub fn tell(&self, what: &str) {
        self.0.set_message(what.to_owned());
    }

    /// One more is done.
    pub fn advance(&self) {
        self.0.inc(1);
    }

    /// So many are done.
    pub fn reach(&self, done: usize) {
        self.0.set_position(done as u64);
    }

    /// Takes the bar away.
    pub fn finish(&self) {
        self.0.finish_and_clear();
    }
}
