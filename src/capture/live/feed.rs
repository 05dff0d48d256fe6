//! What every live source gives, and what it is given.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use super::error::LiveError;

/// A clock: seconds since a start that all sources of a run share.
pub type Now = Arc<dyn Fn() -> f64 + Send + Sync>;

/// What an opened source is.
#[derive(Debug, Clone, PartialEq)]
pub struct Opened {
    /// The source's name: the camera's own, an address, a path.
    pub name: String,
    /// Size and kind of its pictures, in words; the camera's format.
    pub format: String,
    /// Pictures per second, where it says.
    pub fps: Option<f64>,
}

/// A picture as it came.
pub(super) struct LivePicture {
    /// The frame's number in a recording; other sources do not count.
    pub index: Option<u32>,
    /// When it came; in a recording when it was taken. Seconds.
    pub time_secs: f64,
    pub size_px: [u32; 2],
    pub rgba: Vec<u8>,
}

/// A source that is open. It may block for as long as it likes; it lives in a thread of its own.
pub(super) trait Feed {
    fn opened(&self) -> Opened;

    /// The next good picture; `None` where a recording ends.
    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError>;
}

/// How a source is opened, for the first time or again.
pub(super) trait Opener: Send + Sync {
    /// As the user names it.
    fn source_name(&self) -> &str;

    /// Seconds without a picture after which something is wrong; `None` where pauses are as recorded.
    fn patience_secs(&self) -> Option<f64>;

    /// `again`: the name of what was open before and is looked for.
    fn open(&self, again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError>;
}

/// What a feed shares with the one who reads it.
#[derive(Clone)]
pub(super) struct Link {
    pub now: Now,
    stop: Arc<AtomicBool>,
    broken_pictures: Arc<AtomicU64>,
}

impl Link {
    pub(super) fn new(now: Now) -> Self {
        Self {
            now,
            stop: Arc::default(),
            broken_pictures: Arc::default(),
        }
    }

    pub(super) fn now_secs(&self) -> f64 {
        (self.now)()
    }

    /// Tells the feed's thread to end; one that blocks does so once it is let go.
    pub(super) fn stop(&self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    pub(super) fn count_broken_picture(&self) {
        self.broken_pictures.fetch_add(1, Ordering::Relaxed);
    }

    pub(super) fn broken_pictures(&self) -> u64 {
        self.broken_pictures.load(Ordering::Relaxed)
    }
}
