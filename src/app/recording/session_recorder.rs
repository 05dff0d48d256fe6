//! Records a session beside everything else: a thread writes what the capture thread taps.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;

use super::session_writer::{SessionHead, SessionWriter};
use crate::app::files::output_error::OutputError;
use crate::app::input::live_capture::{Tap, Tapped};
use crate::capture::Frame;
use crate::tracking::AnchorPose;

/// Frames may wait for the encoder up to this; more are dropped and counted.
const WAITING_BYTES: usize = 512 << 20;

/// A recording that is under way.
pub struct SessionRecorder {
    to_writer: Sender<Item>,
    waiting: Arc<Waiting>,
    thread: JoinHandle<Result<u32, OutputError>>,
}

/// The outcome of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recorded {
    /// Frames in the session.
    pub frames: u32,
    /// Frames that the encoder had no time for.
    pub dropped: u64,
}

enum Item {
    Rate(f64),
    Frame(Arc<Frame>),
    Poses {
        index: u32,
        time_secs: f64,
        poses: Vec<AnchorPose>,
        track_ms: Option<f64>,
    },
    Finish,
}

#[derive(Default)]
struct Waiting {
    bytes: AtomicUsize,
    frames: AtomicUsize,
    dropped: AtomicU64,
}

impl SessionRecorder {
    /// Makes the session's folder and begins.
    ///
    /// # Errors
    /// As [`SessionWriter::create`].
    pub fn start(folder: &Path, head: SessionHead) -> Result<Self, OutputError> {
        let writer = SessionWriter::create(folder, head)?;
        let (to_writer, items) = channel();
        let waiting = Arc::new(Waiting::default());
        let thread = {
            let waiting = Arc::clone(&waiting);
            std::thread::spawn(move || write(writer, &items, &waiting))
        };
        Ok(Self {
            to_writer,
            waiting,
            thread,
        })
    }

    /// Takes each frame for the session, from [`crate::app::input::live_capture::LiveCapture`].
    pub fn tap(&self) -> Tap {
        let to_writer = self.to_writer.clone();
        let waiting = Arc::clone(&self.waiting);
        Box::new(move |tapped| {
            let frame = match tapped {
                Tapped::Frame(frame) => frame,
                Tapped::Opened(opened) => {
                    _ = opened.fps.map(|fps| to_writer.send(Item::Rate(fps)));
                    return;
                }
            };
            let bytes = frame.rgba.len();
            if waiting.bytes.load(Ordering::Relaxed) + bytes > WAITING_BYTES {
                waiting.dropped.fetch_add(1, Ordering::Relaxed);
                return;
            }
            waiting.bytes.fetch_add(bytes, Ordering::Relaxed);
            waiting.frames.fetch_add(1, Ordering::Relaxed);
            // A writer that has failed says so itself.
            _ = to_writer.send(Item::Frame(Arc::clone(frame)));
        })
    }

    /// Adds the poses of a tapped frame, in the order of the head's anchors.
    pub fn add_poses(
        &self,
        (index, time_secs): (u32, f64),
        poses: &[AnchorPose],
        track_ms: Option<f64>,
    ) {
        _ = self.to_writer.send(Item::Poses {
            index,
            time_secs,
            poses: poses.to_vec(),
            track_ms,
        });
    }

    /// Frames that wait for the encoder.
    pub fn waiting(&self) -> usize {
        self.waiting.frames.load(Ordering::Relaxed)
    }

    /// Whether nothing is written any more, by itself or after [`SessionRecorder::end`]: [`SessionRecorder::finish`] tells how
    /// it ended.
    pub fn has_ended(&self) -> bool {
        self.thread.is_finished()
    }

    /// Writes what waits and ends the session, beside whoever asks.
    pub fn end(&self) {
        _ = self.to_writer.send(Item::Finish);
    }

    /// Writes what waits, and ends the session.
    ///
    /// # Errors
    /// What kept a frame from being written; the frames before are whole.
    pub fn finish(self) -> Result<Recorded, OutputError> {
        self.end();
        let written = self.thread.join();
        Ok(Recorded {
            frames: written.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?,
            dropped: self.waiting.dropped.load(Ordering::Relaxed),
        })
    }
}

fn write(
    mut writer: SessionWriter,
    items: &Receiver<Item>,
    waiting: &Waiting,
) -> Result<u32, OutputError> {
    for item in items {
        match item {
            Item::Rate(fps) => writer.set_fps(fps),
            Item::Frame(frame) => {
                writer.push(&frame)?;
                waiting.bytes.fetch_sub(frame.rgba.len(), Ordering::Relaxed);
                waiting.frames.fetch_sub(1, Ordering::Relaxed);
            }
            Item::Poses {
                index,
                time_secs,
                poses,
                track_ms,
            } => writer.add_poses((index, time_secs), &poses, track_ms)?,
            Item::Finish => break,
        }
    }
    writer.finish()
}
