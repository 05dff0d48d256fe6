//! The jobs of the program, and what they share: its clock, files, frames, stages and windows.
//!
//! A job (each module of [`jobs`], [`live`] and [`chart`]) imports no other job; what two of them need lies in a group below
//! them. Lowest first: [`stopwatch`], [`talk`] → [`files`] → [`disk_cache`] → [`precomputed`] →
//! [`input`] → [`recording`] → [`stages`] → `scene_warnings` →
//! [`authoring`] → [`truth`] → [`window`] → the jobs. Charts alone know [`truth`]. `tests/architecture.rs` keeps that.

pub mod authoring;
pub mod chart;
pub mod disk_cache;
pub mod files;
pub mod input;
pub mod jobs;
pub mod live;
pub mod precomputed;
pub mod recording;
pub mod scene_warnings;
pub mod stages;
pub mod stopwatch;
pub mod talk;
pub mod truth;
pub mod window;
