//! The only place that reads a clock.

use std::time::Instant;

/// A stopwatch that runs from its making.
#[derive(Debug, Clone, Copy)]
pub struct Stopwatch(Instant);

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Milliseconds since the start.
    pub fn elapsed_ms(&self) -> f64 {
        self.0.elapsed().as_secs_f64() * 1e3
    }

    /// A clock that shows seconds since now.
    pub fn clock() -> impl Fn() -> f64 + Send + Sync + 'static {
        let watch = Self::start();
        move || watch.0.elapsed().as_secs_f64()
    }

    /// What `work` gives, and the milliseconds it took.
    pub fn time<T>(work: impl FnOnce() -> T) -> (T, f64) {
        let watch = Self::start();
        let result = work();
        (result, watch.elapsed_ms())
    }
}
