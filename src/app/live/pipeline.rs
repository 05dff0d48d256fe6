//! Capture and tracking as they run beside the window: a thread each, joined by mailboxes in which the newest frame
//! alone lies. A pose travels with the image that it was measured in.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use super::frame_tracker::{FrameTracker, TrackedPicture, TrackingPlan};
use super::seen_instead::SeenInstead;
use crate::app::input::live_capture::{Arrived, CaptureEvent, LiveCapture, Tap};
use crate::app::input::mailbox::Mailbox;
use crate::app::stages::known_camera::KeptCamera;
use crate::app::window::Wake;
use crate::capture::live::{LiveOptions, Now};
use crate::geometry::camera::Intrinsics;

/// The source of the frames, and how it is opened.
pub struct PipelineInput {
    /// As `capture::live` takes it.
    pub source: String,
    /// How it is opened.
    pub options: LiveOptions,
    /// `None`: the camera is not calibrated, and learnt.
    pub calibration: Option<Intrinsics>,
}

/// A source that is captured and tracked. Dropped, it stops within a moment.
pub struct Pipeline {
    // Dropped first: it closes the mailbox that the tracking thread waits at.
    capture: Option<LiveCapture>,
    captured: Arc<Mailbox<Arrived>>,
    tracked: Arc<Mailbox<TrackedPicture>>,
    plans: Sender<TrackingPlan>,
    wants_rejected: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Pipeline {
    /// Begins to read and to track.
    pub fn start(input: &PipelineInput, plan: TrackingPlan, now: &Now, wake: Wake) -> Self {
        let capture = LiveCapture::start(&input.source, &input.options, Arc::clone(now), None);
        let captured = capture.frames();
        let tracked = Arc::new(Mailbox::new());
        let (plans, new_plans) = channel();
        let wants_rejected = Arc::new(AtomicBool::new(false));
        let thread = {
            let (captured, tracked) = (Arc::clone(&captured), Arc::clone(&tracked));
            let stage = TrackingStage {
                seen_instead: SeenInstead::of(&plan),
                tracker: FrameTracker::new(input.calibration, KeptCamera::of(&input.source), plan),
                new_plans,
                wants_rejected: Arc::clone(&wants_rejected),
                now: Arc::clone(now),
                wake,
            };
            thread::spawn(move || stage.run(&captured, &tracked))
        };
        Self {
            capture: Some(capture),
            captured,
            tracked,
            plans,
            wants_rejected,
            thread: Some(thread),
        }
    }

    /// Where the newest tracked frame lies; closed when no more will come.
    pub fn tracked(&self) -> &Mailbox<TrackedPicture> {
        &self.tracked
    }

    /// What happened to the camera, the next thing of it that was not yet told.
    pub fn next_event(&self) -> Option<CaptureEvent> {
        self.capture.as_ref()?.next_event()
    }

    /// From now on, at the next frame, something else is looked for.
    pub fn set_plan(&self, plan: TrackingPlan) {
        // A thread that has ended tracks nothing any more.
        _ = self.plans.send(plan);
    }

    /// Whether frames come with the quadrilaterals that are no markers.
    pub fn want_rejected(&self, wanted: bool) {
        self.wants_rejected.store(wanted, Ordering::Relaxed);
    }

    /// From now on every captured frame goes to `tap` as well.
    pub fn set_tap(&self, tap: Option<Tap>) {
        if let Some(capture) = &self.capture {
            capture.set_tap(tap);
        }
    }

    /// Frames that came so far.
    pub fn captured(&self) -> u64 {
        self.capture.as_ref().map_or(0, LiveCapture::captured)
    }

    /// Frames so far that were not shown because a stage was still at an earlier one: tracking, then the window; and
    /// pictures that came broken.
    pub fn dropped(&self) -> [u64; 3] {
        let broken = self
            .capture
            .as_ref()
            .map_or(0, LiveCapture::broken_pictures);
        [self.captured.dropped(), self.tracked.dropped(), broken]
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.capture = None;
        self.captured.close();
        self.tracked.close();
        if let Some(thread) = self.thread.take() {
            // A panic in it has been told on stderr.
            _ = thread.join();
        }
    }
}

struct TrackingStage {
    tracker: FrameTracker,
    seen_instead: Option<SeenInstead>,
    new_plans: Receiver<TrackingPlan>,
    wants_rejected: Arc<AtomicBool>,
    now: Now,
    wake: Wake,
}

impl TrackingStage {
    fn run(mut self, captured: &Mailbox<Arrived>, tracked: &Mailbox<TrackedPicture>) {
        while let Some(arrived) = captured.take() {
            if let Some(plan) = self.new_plans.try_iter().last() {
                if !(self.seen_instead.as_ref()).is_some_and(|watch| watch.is_for(&plan)) {
                    self.seen_instead = SeenInstead::of(&plan);
                }
                self.tracker.set_plan(plan);
            }
            let wants_rejected = self.wants_rejected.load(Ordering::Relaxed);
            let mut picture = self.tracker.look(arrived, (self.now)(), wants_rejected);
            let watch = self.seen_instead.as_mut();
            picture.never_found = watch.and_then(|watch| watch.note(&picture));
            if !tracked.put(picture) {
                return;
            }
            (self.wake)();
        }
        tracked.close();
        (self.wake)();
    }
}
