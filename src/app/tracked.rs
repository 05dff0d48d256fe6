//! The first two stages of every job on a recording, a thread each: frames are read, and poses found in them. No frame
//! is dropped.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;

use anyhow::{Context as _, Result};

use super::mirror_watch::MirrorWatch;
use super::poses_file::GivenPoses;
use super::progress::Progress;
use super::stopwatch::Stopwatch;
use crate::capture::{Frame, FrameSource, Notice};
use crate::tracking::{AnchorPose, Tracker};

/// Frames that may wait between two stages: enough to even out their times, few enough to stay small.
pub(super) const QUEUE: usize = 3;

/// Where poses come from.
pub(super) enum Poser {
    /// The pictures.
    Tracker(Box<Tracker>, MirrorWatch),
    /// A file.
    Given(GivenPoses),
}

/// A frame with the poses that were measured in it.
pub(super) struct TrackedFrame {
    pub frame: Frame,
    /// In the anchors' order.
    pub poses: Vec<AnchorPose>,
    pub decode_ms: f64,
    /// `None` where poses were given.
    pub track_ms: Option<f64>,
}

/// What is known once a recording has ended.
#[derive(Default)]
pub(super) struct Ended {
    /// What was wrong with the recording.
    pub notices: Vec<Notice>,
    /// Tells whether it is mirrored; `None` where poses were given.
    pub mirror_watch: Option<MirrorWatch>,
    /// Per anchor by what part of their size its markers are larger than the scene says, where that is known.
    pub size_errors: Vec<Option<f64>>,
}

/// Calls `each` with the frames of a recording in their order: all, or those up to `last`, or until `stop`.
///
/// # Errors
/// What kept a frame from being read or tracked, or the first error of `each`, which ends it.
pub(super) fn each_tracked_frame(
    source: FrameSource,
    poser: Poser,
    last: Option<u32>,
    stop: &AtomicBool,
    mut each: impl FnMut(TrackedFrame) -> Result<()>,
) -> Result<Ended> {
    let expected = match last {
        Some(last) => Some(last + 1),
        None => source.frame_count(),
    };
    let progress = Progress::new(expected);
    thread::scope(|scope| {
        let (to_tracker, from_camera) = sync_channel(QUEUE);
        let (to_caller, from_tracker) = sync_channel(QUEUE);
        let capture = scope.spawn(move || capture_stage(source, &to_tracker, last, stop));
        let tracking = scope.spawn(move || track_stage(poser, &from_camera, &to_caller));
        let mut outcome = Ok(());
        for tracked in &from_tracker {
            outcome = each(tracked);
            progress.advance();
            if outcome.is_err() {
                break;
            }
        }
        // Closing the end lets the other stages finish.
        drop(from_tracker);
        let tracked = join(tracking);
        let captured = join(capture);
        progress.finish();
        // A stage that fails stops those before it: the last one knows why.
        outcome?;
        let (mirror_watch, size_errors) = tracked?;
        Ok(Ended {
            notices: captured?,
            mirror_watch,
            size_errors,
        })
    })
}

/// What a stage gave; its panic goes on here.
pub(super) fn join<T>(handle: thread::ScopedJoinHandle<'_, Result<T>>) -> Result<T> {
    handle
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Reads frames until the end, the last one wanted, or a stop; gives what was wrong with the recording.
fn capture_stage(
    mut source: FrameSource,
    to_tracker: &SyncSender<(Frame, f64)>,
    last: Option<u32>,
    stop: &AtomicBool,
) -> Result<Vec<Notice>> {
    while !stop.load(Ordering::Relaxed) {
        let (frame, decode_ms) = Stopwatch::time(|| source.next_frame());
        let Some(frame) = frame? else { break };
        let index = frame.index;
        let receiver_gone = to_tracker.send((frame, decode_ms)).is_err();
        if receiver_gone || last.is_some_and(|last| index >= last) {
            break;
        }
    }
    Ok(source.notices().to_vec())
}

fn track_stage(
    mut poser: Poser,
    from_camera: &Receiver<(Frame, f64)>,
    to_caller: &SyncSender<TrackedFrame>,
) -> Result<(Option<MirrorWatch>, Vec<Option<f64>>)> {
    for (frame, decode_ms) in from_camera {
        let (poses, track_ms) = poser
            .poses(&frame)
            .with_context(|| format!("frame {}", frame.index))?;
        let tracked = TrackedFrame {
            frame,
            poses,
            decode_ms,
            track_ms,
        };
        if to_caller.send(tracked).is_err() {
            break;
        }
    }
    Ok(match poser {
        Poser::Tracker(tracker, watch) => (Some(watch), tracker.size_errors().collect()),
        Poser::Given(_) => (None, Vec::new()),
    })
}

impl Poser {
    /// The poses, and what a tracker took for them.
    fn poses(&mut self, frame: &Frame) -> Result<(Vec<AnchorPose>, Option<f64>)> {
        match self {
            Self::Tracker(tracker, watch) => {
                let (poses, ms) = Stopwatch::time(|| tracker.track(frame));
                watch.watch(frame, !tracker.detections().is_empty())?;
                Ok((poses?, Some(ms)))
            }
            Self::Given(given) => Ok((given.of_frame(frame.index), None)),
        }
    }
}
