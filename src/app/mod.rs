//! The jobs: replay and check, their clock, files and progress.

pub mod check;
pub mod contact_sheet;
pub mod layer_files;
pub mod output;
mod output_error;
mod partial_files;
pub mod picture_files;
pub mod poses_file;
mod progress;
pub mod replay;
pub mod stats;
pub mod stopwatch;
pub mod video_writer;
