//! The first two stages of every job, a thread each: frames are read, and poses found in them. No frame of a recording
//! is dropped; of a live source the newest is taken.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, Result};

use super::known_camera::LiveCamera;
use super::progress::Progress;
use crate::app::files::poses_file::GivenPoses;
use crate::app::input::capture_talk::say;
use crate::app::input::live_capture::{Arrived, CaptureEvent, LiveCapture};
use crate::app::input::mailbox::Taken;
use crate::app::input::mirror_watch::MirrorWatch;
use crate::app::input::sightings::Sightings;
use crate::app::stopwatch::Stopwatch;
use crate::app::talk;
use crate::capture::{Frame, FrameSource, Notice, check_frame_size};
use crate::geometry::camera::Intrinsics;
use crate::scene::Anchor;
use crate::tracking::focal::LearntCamera;
use crate::tracking::{AnchorPose, Detection, Tracker};

/// Frames that may wait between two stages: enough to even out their times, few enough to stay small.
pub(crate) const QUEUE: usize = 3;
/// How soon a stop is seen while no frame comes.
const LIVE_PATIENCE: Duration = Duration::from_millis(50);

/// The source of a job's frames.
pub(crate) enum Frames {
    /// A recording: all of them.
    Recorded(Box<FrameSource>),
    /// A camera: as they come, of one size.
    Live(Box<LiveCapture>, Intrinsics),
}

/// The source of a job's poses.
pub(crate) enum Poser {
    /// The pictures.
    Tracker(Box<PicturePoser>),
    /// A file.
    Given(GivenPoses),
}

/// A tracker, and what is watched beside it.
pub(crate) struct PicturePoser {
    tracker: Tracker,
    /// `None` where the camera is known before.
    camera: Option<LiveCamera>,
    mirror_watch: MirrorWatch,
    sightings: Sightings,
    /// Anchors that came by themselves so far.
    came: usize,
}

/// A frame with the poses that were measured in it.
pub(crate) struct TrackedFrame {
    pub frame: Frame,
    /// In the anchors' order.
    pub poses: Vec<AnchorPose>,
    /// `None` where frames come by themselves.
    pub decode_ms: Option<f64>,
    /// `None` where poses were given.
    pub track_ms: Option<f64>,
    /// Anchors whose first frame it is, where each marker is one; their poses come last.
    pub came: Vec<Anchor>,
    /// The markers that the poses rest on.
    pub used: Vec<Detection>,
}

/// The knowledge that is there once a recording has ended.
#[derive(Default)]
pub(crate) struct Ended {
    /// What was wrong with the recording.
    pub notices: Vec<Notice>,
    /// Frames that were not tracked: broken ones, and those of a live source that came too fast.
    pub dropped: u32,
    /// The camera that was learnt while frames came; `None` where it was known before.
    pub camera: Option<LearntCamera>,
    /// Tells whether it is mirrored; `None` where poses were given.
    pub mirror_watch: Option<MirrorWatch>,
    /// Tells what was never found; `None` where poses were given.
    pub sightings: Option<Sightings>,
    /// Per anchor by how many quarter turns its markers are turned against what the scene says.
    pub quarter_turns: Vec<u32>,
    /// Per anchor the frames in which another marker with one of its ids was seen elsewhere.
    pub doubled_frames: Vec<u32>,
    /// Per anchor by what part of their size its markers are larger than the scene says, where that is known.
    pub size_errors: Vec<Option<f64>>,
}

/// Calls `each` with the frames in their order: all, or those up to `last`, or until `stop`.
///
/// # Errors
/// What kept a frame from being read or tracked, or the first error of `each`, which ends it.
pub(crate) fn each_tracked_frame(
    frames: Frames,
    poser: Poser,
    last: Option<u32>,
    stop: &AtomicBool,
    mut each: impl FnMut(TrackedFrame) -> Result<()>,
) -> Result<Ended> {
    let expected = match (last, &frames) {
        (Some(last), _) => Some(last + 1),
        (None, Frames::Recorded(source)) => source.frame_count(),
        (None, Frames::Live(..)) => None,
    };
    let progress = Progress::new(expected);
    thread::scope(|scope| {
        let (to_tracker, from_camera) = sync_channel(QUEUE);
        let (to_caller, from_tracker) = sync_channel(QUEUE);
        let capture = scope.spawn(move || match frames {
            Frames::Recorded(source) => capture_stage(*source, &to_tracker, last, stop),
            Frames::Live(capture, intrinsics) => {
                live_stage(&capture, &intrinsics, &to_tracker, stop)
            }
        });
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
        let tracked = tracked?;
        let Captured { notices, dropped } = captured?;
        Ok(Ended {
            notices,
            dropped,
            ..tracked
        })
    })
}

/// What a stage gave; its panic goes on here.
pub(crate) fn join<T>(handle: thread::ScopedJoinHandle<'_, Result<T>>) -> Result<T> {
    handle
        .join()
        .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// The outcome of the first stage.
struct Captured {
    notices: Vec<Notice>,
    dropped: u32,
}

/// A frame, and what it took to decode it where that is known.
type Decoded = (Frame, Option<f64>);

/// Reads frames until the end, the last one wanted, or a stop.
fn capture_stage(
    mut source: FrameSource,
    to_tracker: &SyncSender<Decoded>,
    last: Option<u32>,
    stop: &AtomicBool,
) -> Result<Captured> {
    while !stop.load(Ordering::Relaxed) {
        let (frame, decode_ms) = Stopwatch::time(|| source.next_frame());
        let Some(frame) = frame? else { break };
        let index = frame.index;
        let receiver_gone = to_tracker.send((frame, Some(decode_ms))).is_err();
        if receiver_gone || last.is_some_and(|last| index >= last) {
            break;
        }
    }
    if let Some(remark) = source.remark_of_times() {
        talk::say(remark);
    }
    let notices = source.notices().to_vec();
    Ok(Captured {
        dropped: notices.iter().map(Notice::lost_frames).sum(),
        notices,
    })
}

/// Takes the newest frame whenever the tracker is ready for one, until the source ends or a stop.
fn live_stage(
    capture: &LiveCapture,
    intrinsics: &Intrinsics,
    to_tracker: &SyncSender<Decoded>,
    stop: &AtomicBool,
) -> Result<Captured> {
    let frames = capture.frames();
    while !stop.load(Ordering::Relaxed) {
        let taken = frames.take_within(LIVE_PATIENCE);
        while let Some(event) = capture.next_event() {
            say(&event);
            if let CaptureEvent::Failed(error) = event {
                return Err(error.into());
            }
        }
        match taken {
            Taken::New(Arrived { frame, .. }) => {
                check_frame_size(intrinsics, frame.size_px, "the camera")?;
                let frame = Arc::unwrap_or_clone(frame);
                if to_tracker.send((frame, None)).is_err() {
                    break;
                }
            }
            Taken::Nothing => {}
            Taken::Closed => break,
        }
    }
    let dropped = frames.dropped() + capture.broken_pictures();
    Ok(Captured {
        notices: Vec::new(),
        dropped: u32::try_from(dropped).unwrap_or(u32::MAX),
    })
}

fn track_stage(
    mut poser: Poser,
    from_camera: &Receiver<Decoded>,
    to_caller: &SyncSender<TrackedFrame>,
) -> Result<Ended> {
    for (frame, decode_ms) in from_camera {
        let frame_words = || format!("frame {}", frame.index);
        let (poses, track_ms) = poser.poses(&frame).with_context(frame_words)?;
        let came = poser.came(poses.len());
        let used = match &poser {
            Poser::Tracker(poser) => poser.tracker.used_markers().to_vec(),
            Poser::Given(_) => Vec::new(),
        };
        let tracked = TrackedFrame {
            frame,
            poses,
            decode_ms,
            track_ms,
            came,
            used,
        };
        if to_caller.send(tracked).is_err() {
            break;
        }
    }
    Ok(match poser {
        Poser::Tracker(poser) => Ended {
            quarter_turns: poser.tracker.quarter_turns().collect(),
            doubled_frames: poser.tracker.doubled_frames().collect(),
            size_errors: poser.tracker.size_errors().collect(),
            camera: poser.camera.map(|camera| camera.in_use()),
            mirror_watch: Some(poser.mirror_watch),
            sightings: Some(poser.sightings),
            ..Ended::default()
        },
        Poser::Given(_) => Ended::default(),
    })
}

impl Poser {
    /// Poses from pictures.
    pub(crate) fn tracker(
        tracker: Tracker,
        mirror_watch: MirrorWatch,
        sightings: Sightings,
    ) -> Self {
        Self::Tracker(Box::new(PicturePoser {
            tracker,
            camera: None,
            mirror_watch,
            sightings,
            came: 0,
        }))
    }

    /// The same of a camera that is learnt while frames come.
    pub(crate) fn of_live_camera(self, learnt: LiveCamera) -> Self {
        match self {
            Self::Tracker(mut poser) => {
                poser.camera = Some(learnt);
                Self::Tracker(poser)
            }
            Self::Given(given) => Self::Given(given),
        }
    }

    /// The poses, and what a tracker took for them.
    fn poses(&mut self, frame: &Frame) -> Result<(Vec<AnchorPose>, Option<f64>)> {
        match self {
            Self::Tracker(poser) => {
                if let Some(camera) = &mut poser.camera
                    && camera.look(frame)?
                {
                    poser.tracker.set_camera(camera.in_use().intrinsics);
                }
                let (poses, ms) = Stopwatch::time(|| poser.tracker.track(frame));
                let poses = poses?;
                let shows_marker = !poser.tracker.detections().is_empty();
                poser.mirror_watch.watch(frame, shows_marker)?;
                let is_there = |pose: &AnchorPose| pose.camera_from_anchor.is_some();
                let unconfirmed = poser.tracker.unconfirmed_markers();
                poser.sightings.note_unconfirmed(unconfirmed);
                match poser.tracker.is_of_every_marker() {
                    true => {
                        let any = poses.iter().any(is_there);
                        poser.sightings.watch(frame, [any])?;
                    }
                    false => poser.sightings.watch(frame, poses.iter().map(is_there))?,
                }
                Ok((poses, Some(ms)))
            }
            Self::Given(given) => Ok((given.of_frame(frame.index), None)),
        }
    }

    /// Anchors that came with the last of so many poses.
    fn came(&mut self, poses: usize) -> Vec<Anchor> {
        match self {
            Self::Tracker(poser) if poser.tracker.is_of_every_marker() && poses > poser.came => {
                let came = poser.tracker.lone_anchors().split_off(poser.came);
                poser.came = poses;
                came
            }
            _ => Vec::new(),
        }
    }
}
