//! A recording, played as if it were live: each picture comes when its time has come.

use std::thread;
use std::time::Duration;

use super::error::LiveError;
use super::feed::{Feed, Link, LivePicture, Opened, Opener};
use crate::capture::{Frame, FrameSource};

/// Longest sleep between two looks at whether to stop.
const NAP: Duration = Duration::from_millis(20);

/// Opens a recording.
pub(super) struct PlayedOpener {
    pub source_name: String,
    /// Begins again at the end.
    pub repeats: bool,
}

impl Opener for PlayedOpener {
    fn source_name(&self) -> &str {
        &self.source_name
    }

    fn patience_secs(&self) -> Option<f64> {
        None
    }

    fn open(&self, _again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError> {
        Ok(Box::new(PlayedFeed {
            source_name: self.source_name.clone(),
            repeats: self.repeats,
            source: FrameSource::open(&self.source_name)?,
            round: Round::default(),
            next: Round::default(),
            start: None,
            link: link.clone(),
        }))
    }
}

struct PlayedFeed {
    source_name: String,
    repeats: bool,
    source: FrameSource,
    /// Where this round began.
    round: Round,
    /// Where the next one would.
    next: Round,
    /// The clock at the first picture, and the time of that picture, seconds.
    start: Option<(f64, f64)>,
    link: Link,
}

/// What is added to the indices and times of a round.
#[derive(Debug, Clone, Copy, Default)]
struct Round {
    first_index: u32,
    start_secs: f64,
}

impl PlayedFeed {
    fn next_frame(&mut self) -> Result<Option<Frame>, LiveError> {
        if let Some(frame) = self.source.next_frame()? {
            return Ok(Some(frame));
        }
        if !self.repeats {
            return Ok(None);
        }
        self.source = FrameSource::open(&self.source_name)?;
        self.round = self.next;
        Ok(self.source.next_frame()?)
    }

    /// Sleeps until the clock shows `due_secs`, or until told to stop.
    fn wait_until(&self, due_secs: f64) {
        while !self.link.is_stopped() {
            let left_secs = due_secs - self.link.now_secs();
            if left_secs <= 0.0 {
                break;
            }
            thread::sleep(Duration::from_secs_f64(left_secs).min(NAP));
        }
    }
}

impl Feed for PlayedFeed {
    fn opened(&self) -> Opened {
        let [width, height] = self.source.size_px();
        Opened {
            name: self.source_name.clone(),
            format: format!("{width} x {height} at {:.0} fps", self.source.fps()),
            fps: Some(self.source.fps()),
        }
    }

    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError> {
        let Some(frame) = self.next_frame()? else {
            return Ok(None);
        };
        let index = self.round.first_index + frame.index;
        let time_secs = self.round.start_secs + frame.time_secs;
        self.next = Round {
            first_index: index + 1,
            start_secs: time_secs + 1.0 / self.source.fps(),
        };
        let (clock_secs, first_secs) = *self
            .start
            .get_or_insert_with(|| (self.link.now_secs(), time_secs));
        self.wait_until(clock_secs + time_secs - first_secs);
        Ok(Some(LivePicture {
            index: Some(index),
            time_secs,
            size_px: frame.size_px,
            rgba: frame.rgba,
        }))
    }
}
