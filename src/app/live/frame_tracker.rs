//! What is done to a live frame before it is drawn: anchors are tracked in it, or any marker is looked for.

use std::sync::Arc;

use glam::DAffine3;

use crate::app::input::live_capture::Arrived;
use crate::app::stages::known_camera::{KeptCamera, LearntFrom, LiveCamera};
use crate::app::stopwatch::Stopwatch;
use crate::capture::{Frame, check_frame_size};
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Family, Scene, TrackingSettings};
use crate::tracking::focal::{LearntCamera, guessed_intrinsics};
use crate::tracking::{
    AnchorPose, Detection, Detector, Quad, Tracker, TrackingError, grey_from_rgba, rejected_quads,
};

/// The markers that are looked for in frames.
#[derive(Debug, Clone, PartialEq)]
pub enum TrackingPlan {
    /// The anchors of a scene.
    Follow {
        /// How they are found.
        settings: TrackingSettings,
        /// The scene's, in its order.
        anchors: Arc<[Anchor]>,
    },
    /// Any marker of tag36h11: nobody has said yet what there is.
    Look,
}

/// A frame with all that is known of it.
#[derive(Debug, Clone)]
pub struct TrackedPicture {
    /// The frame.
    pub frame: Arc<Frame>,
    /// When it came, by the program's clock, seconds.
    pub arrived_secs: f64,
    /// The camera that took it.
    pub intrinsics: Intrinsics,
    /// How that is known; `None` where it is calibrated.
    pub learnt: Option<LearntCamera>,
    /// What the poses are of.
    pub anchors: Arc<[Anchor]>,
    /// Of each anchor; all lost where there is [`TrackedPicture::trouble`].
    pub poses: Vec<AnchorPose>,
    /// Markers that were seen.
    pub detections: Vec<Detection>,
    /// Quadrilaterals that turned out to be no markers, where they were asked for.
    pub rejected: Vec<Quad>,
    /// Time from the frame's coming to the beginning of its tracking, milliseconds.
    pub wait_ms: f64,
    /// What tracking took, milliseconds.
    pub track_ms: f64,
    /// Why the frame could not be tracked.
    pub trouble: Option<String>,
    /// Which anchors no picture has shown so far, and what is seen instead.
    pub never_found: Option<String>,
}

impl TrackedPicture {
    /// Whether its poses are of a scene's anchors.
    pub fn is_of(&self, scene: &Scene) -> bool {
        scene.anchors[..] == self.anchors[..]
    }

    /// Where a scene's nodes are; nowhere where its anchors are others than those of the poses.
    pub fn camera_from_nodes(&self, scene: &Scene) -> Vec<Option<DAffine3>> {
        let anchors: Vec<_> = match self.is_of(scene) {
            true => self
                .poses
                .iter()
                .map(|pose| pose.camera_from_anchor)
                .collect(),
            false => vec![None; scene.anchors.len()],
        };
        scene.camera_from_nodes(&anchors, self.frame.time_secs)
    }
}

/// The tracker of live frames, made anew where their size or the plan changes.
pub struct FrameTracker {
    calibration: Option<Intrinsics>,
    kept: KeptCamera,
    plan: TrackingPlan,
    /// The camera that was in use last, where it is learnt.
    learnt: Option<LearntCamera>,
    /// Made for the frames' size.
    worker: Option<([u32; 2], Worker)>,
}

enum Worker {
    /// With what learns the camera, where that is not calibrated.
    Follows(Box<Tracker>, Option<Box<LiveCamera>>),
    Looks(Box<Detector>),
}

impl FrameTracker {
    /// `calibration`: `None` where the camera has none; it is then learnt, and kept there.
    pub fn new(calibration: Option<Intrinsics>, kept: KeptCamera, plan: TrackingPlan) -> Self {
        Self {
            calibration,
            kept,
            plan,
            learnt: None,
            worker: None,
        }
    }

    /// From now on something else is looked for.
    pub fn set_plan(&mut self, plan: TrackingPlan) {
        if self.plan != plan {
            self.plan = plan;
            self.worker = None;
        }
    }

    /// Looks at a frame, at `now_secs` by the clock it came by.
    pub fn look(&mut self, arrived: Arrived, now_secs: f64, with_rejected: bool) -> TrackedPicture {
        let Arrived { frame, at_secs } = arrived;
        let anchors: Arc<[Anchor]> = match &self.plan {
            TrackingPlan::Follow { anchors, .. } => Arc::clone(anchors),
            TrackingPlan::Look => Arc::new([]),
        };
        let unfit = self.calibration.as_ref().and_then(|calibration| {
            let checked = check_frame_size(calibration, frame.size_px, "the camera");
            checked.err().map(|error| error.to_string())
        });
        let (tracked, track_ms) = Stopwatch::time(|| match unfit {
            Some(trouble) => Err(trouble),
            None => self.track(&frame).map_err(|error| error.to_string()),
        });
        let of_size = |camera: &LearntCamera| camera.intrinsics.size_px == frame.size_px;
        let learnt = match self.calibration {
            Some(_) => None,
            None => {
                Some((self.learnt.filter(of_size)).unwrap_or(LearntCamera::guess(frame.size_px)))
            }
        };
        let calibration = self
            .calibration
            .filter(|known| known.size_px == frame.size_px);
        let intrinsics = calibration
            .or(learnt.map(|camera| camera.intrinsics))
            .unwrap_or_else(|| guessed_intrinsics(frame.size_px));
        let lost = || vec![AnchorPose::LOST; anchors.len()];
        let ((poses, detections), trouble) = match tracked {
            Ok(tracked) => (tracked, None),
            Err(trouble) => ((lost(), Vec::new()), Some(trouble)),
        };
        TrackedPicture {
            rejected: match with_rejected {
                true => rejected_quads(&frame, Family::TAG36H11).unwrap_or_default(),
                false => Vec::new(),
            },
            frame,
            arrived_secs: at_secs,
            intrinsics,
            learnt,
            anchors,
            poses,
            detections,
            wait_ms: (now_secs - at_secs).max(0.0) * 1e3,
            track_ms,
            trouble,
            never_found: None,
        }
    }

    fn track(&mut self, frame: &Frame) -> Result<(Vec<AnchorPose>, Vec<Detection>), TrackingError> {
        let is_of_size = |(size_px, _): &(_, _)| *size_px == frame.size_px;
        if !self.worker.as_ref().is_some_and(is_of_size) {
            self.worker = Some((frame.size_px, self.worker(frame.size_px)?));
        }
        let Some((_, worker)) = &mut self.worker else {
            return Ok((Vec::new(), Vec::new()));
        };
        match worker {
            Worker::Follows(tracker, camera) => {
                if let Some(camera) = camera {
                    if camera.look(frame)? {
                        tracker.set_camera(camera.in_use().intrinsics);
                    }
                    self.learnt = Some(camera.in_use());
                }
                let poses = tracker.track(frame)?;
                Ok((poses, tracker.detections().to_vec()))
            }
            Worker::Looks(detector) => {
                let mut grey = Vec::new();
                grey_from_rgba(frame, &mut grey)?;
                Ok((Vec::new(), detector.detect(&grey, frame.size_px)?))
            }
        }
    }

    fn worker(&self, size_px: [u32; 2]) -> Result<Worker, TrackingError> {
        match &self.plan {
            TrackingPlan::Follow { settings, anchors } => {
                let learning = match self.calibration {
                    Some(_) => None,
                    None => Some(Box::new(LiveCamera::begin(
                        settings,
                        LearntFrom::Anchors(anchors),
                        size_px,
                        self.kept.clone(),
                        self.learnt,
                    )?)),
                };
                let learnt = learning.as_ref().map(|camera| camera.in_use().intrinsics);
                let intrinsics = self.calibration.or(learnt);
                let intrinsics = intrinsics.unwrap_or_else(|| guessed_intrinsics(size_px));
                let tracker = Tracker::new(settings, anchors, intrinsics)?;
                Ok(Worker::Follows(Box::new(tracker), learning))
            }
            TrackingPlan::Look => {
                // No tracker chases what a quick search misses.
                let settings = TrackingSettings {
                    library_edges: true,
                    ..TrackingSettings::default()
                };
                let detector = Detector::new(&settings, &[Family::TAG36H11])?;
                Ok(Worker::Looks(Box::new(detector)))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::FrameSource;
    use crate::scene::Scene;
    use std::path::Path;

    fn lamp() -> (Scene, Arrived, Intrinsics) {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let scene = Scene::load(&root.join("config/lamp.toml")).unwrap();
        let mut source = FrameSource::open(&scene.camera.source).unwrap();
        let frame = Arc::new(source.next_frame().unwrap().unwrap());
        let intrinsics = source.calibration().unwrap();
        let arrived = Arrived {
            frame,
            at_secs: 2.0,
        };
        (scene, arrived, intrinsics)
    }

    fn tracker_of(calibration: Option<Intrinsics>, plan: TrackingPlan) -> FrameTracker {
        FrameTracker::new(calibration, KeptCamera::default(), plan)
    }

    #[test]
    fn a_frame_that_does_not_fit_the_calibration_is_still_shown() {
        let (scene, arrived, intrinsics) = lamp();
        let plan = TrackingPlan::Follow {
            settings: scene.tracking.clone(),
            anchors: scene.anchors.into(),
        };
        let other = Intrinsics {
            size_px: [320, 240],
            ..intrinsics
        };
        let picture = tracker_of(Some(other), plan.clone()).look(arrived.clone(), 2.01, false);
        assert!(picture.trouble.unwrap().contains("320"));
        assert_eq!(picture.poses, [AnchorPose::LOST]);
        assert_eq!(picture.intrinsics.size_px, picture.frame.size_px);
        let picture = tracker_of(Some(intrinsics), plan).look(arrived, 2.01, false);
        assert_eq!(picture.trouble, None);
        assert!(picture.poses[0].camera_from_anchor.is_some());
        assert!((picture.wait_ms - 10.0).abs() < 1e-9);
    }

    #[test]
    fn a_camera_that_nobody_has_calibrated_is_learnt_while_frames_come() {
        let (scene, _, truth) = lamp();
        let plan = TrackingPlan::Follow {
            settings: scene.tracking.clone(),
            anchors: scene.anchors.into(),
        };
        let mut tracker = tracker_of(None, plan.clone());
        let mut source = FrameSource::open(&scene.camera.source).unwrap();
        let (mut cameras, mut lost) = (Vec::new(), 0);
        while let Some(frame) = source.next_frame().unwrap() {
            let at_secs = frame.time_secs;
            let frame = Arc::new(frame);
            let picture = tracker.look(Arrived { frame, at_secs }, at_secs, false);
            assert_eq!(picture.trouble, None);
            let camera = picture.learnt.unwrap();
            assert_eq!(camera.intrinsics, picture.intrinsics);
            lost += usize::from(picture.poses[0].camera_from_anchor.is_none());
            cameras.push(camera);
        }
        // What is shown jumps a few times, and never for a worse camera.
        let last = cameras[cameras.len() - 1];
        cameras.dedup();
        assert!(cameras.len() <= 8 && lost <= 3, "{cameras:?}");
        let fall = |pair: &[LearntCamera]| pair[1].focal_deviation < pair[0].focal_deviation;
        assert!(cameras.windows(2).all(fall), "{cameras:?}");
        assert!(last.is_sure(), "{last:?}");
        let off = (last.intrinsics.focal_px.x / truth.focal_px.x).ln().abs();
        assert!(
            off < 0.02 && off < 3.0 * last.focal_deviation,
            "{off} {last:?}"
        );
        // Another plan begins with what is known.
        tracker.set_plan(TrackingPlan::Look);
        tracker.set_plan(plan);
        let mut source = FrameSource::open(&scene.camera.source).unwrap();
        let frame = Arc::new(source.next_frame().unwrap().unwrap());
        let at_secs = 0.0;
        let picture = tracker.look(Arrived { frame, at_secs }, at_secs, false);
        assert_eq!(picture.learnt, Some(last));
    }

    #[test]
    fn without_a_scene_every_marker_is_seen() {
        let (_, arrived, _) = lamp();
        let mut tracker = tracker_of(None, TrackingPlan::Look);
        let picture = tracker.look(arrived, 2.0, false);
        let ids: Vec<u32> = picture.detections.iter().map(|seen| seen.id).collect();
        // Shadows lie across two of the six.
        assert!([0, 2, 3, 4].iter().all(|id| ids.contains(id)), "{ids:?}");
        assert!(ids.iter().all(|id| *id < 6), "{ids:?}");
        assert!(picture.poses.is_empty());
    }
}
