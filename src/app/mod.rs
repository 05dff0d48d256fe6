//! The jobs: replay and check, their clock, files and progress.

pub mod check;
