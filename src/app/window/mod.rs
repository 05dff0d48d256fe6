//! What every window of the program has: how it is opened, where the picture lies in it, what it tells.

pub(crate) mod fit;
pub mod notices;
pub(crate) mod opening;
pub(crate) mod screen;

use std::sync::Arc;

/// A call from another thread whenever there is something new to show.
pub type Wake = Arc<dyn Fn() + Send + Sync>;
