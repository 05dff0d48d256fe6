//! The program as it is used: its command, files, window, threads and signals.
#![allow(
    clippy::unwrap_used,
    reason = "a test may stop where its own files fail"
)]

#[path = "../common/mod.rs"]
mod common;

mod chart;
mod cli;
mod cubes;
mod faults;
mod job_files;
mod live;
mod live_panel;
mod markers;
mod readers;
mod record;
mod soak;
mod track;
mod window;
