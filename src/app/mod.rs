//! The jobs: replay, track, check, chart; their clock, files and progress.

pub mod chart;
pub mod check;
pub mod contact_sheet;
pub mod detections_file;
pub mod first_look;
pub mod layer_files;
mod mirror_watch;
pub mod output;
mod output_error;
mod partial_files;
pub mod picture_files;
pub mod poses_file;
mod progress;
mod recording;
pub mod replay;
pub mod report;
pub mod stats;
pub mod stopwatch;
mod tally;
pub mod track;
mod tracked;
pub mod truth;
pub mod video_writer;
