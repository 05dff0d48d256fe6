//! The jobs: replay and check, their clock, files and progress.

pub mod contact_sheet;
pub mod output;
mod output_error;
mod partial_files;
pub mod picture_files;
pub mod video_writer;
