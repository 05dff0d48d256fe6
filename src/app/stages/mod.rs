//! The stages of a job on a recording, and what is counted and told of them.

pub(crate) mod budget_words;
pub(crate) mod known_camera;
pub(crate) mod preparing;
pub(crate) mod progress;
pub mod report;
pub(crate) mod source;
pub mod stats;
pub(crate) mod tally;
pub(crate) mod tracked;
