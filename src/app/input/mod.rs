//! How frames come to a job: from a recording, or from a camera as they come.

pub(crate) mod capture_talk;
pub mod live_capture;
pub mod live_input;
pub mod mailbox;
pub(crate) mod mirror_watch;
pub(crate) mod sightings;
pub(crate) mod usual_tracking;
