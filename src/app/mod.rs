//! The jobs: replay and check, their clock, files and progress.

pub mod check;
pub mod poses_file;
mod progress;
pub mod stats;
pub mod stopwatch;
