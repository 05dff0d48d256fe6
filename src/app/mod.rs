//! The jobs: replay and check, their clock, files and progress.

pub mod contact_sheet;
pub mod output;
pub mod picture_files;
pub mod video_writer;
