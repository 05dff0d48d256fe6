//! What is done to a live frame before it is drawn: anchors are tracked in it, or any marker is looked for.

use std::sync::Arc;

use glam::{DAffine3, DVec2};

use crate::app::input::live_capture::Arrived;
use crate::app::stopwatch::Stopwatch;
use crate::capture::{Frame, check_frame_size};
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Family, Scene, TrackingSettings};
use crate::tracking::{
    AnchorPose, Detection, Detector, Quad, Tracker, TrackingError, grey_from_rgba, rejected_quads,
};

/// Tangent of half the angle that a camera nobody has calibrated is taken to see across: most webcams see about 60°.
const GUESSED_HALF_WIDTH: f64 = 0.577;

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
    /// The camera that took it: calibrated, or a guess.
    pub intrinsics: Intrinsics,
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
}

impl TrackedPicture {
    /// Where a scene's nodes are; nowhere where its anchors are others than those of the poses.
    pub fn camera_from_nodes(&self, scene: &Scene) -> Vec<Option<DAffine3>> {
        let anchors: Vec<_> = match scene.anchors[..] == self.anchors[..] {
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
    plan: TrackingPlan,
    /// Made for the frames' size.
    worker: Option<([u32; 2], Worker)>,
}

enum Worker {
    Follows(Box<Tracker>),
    Looks(Box<Detector>),
}

impl FrameTracker {
    /// `calibration`: `None` where the camera has none, and a guess must do.
    pub fn new(calibration: Option<Intrinsics>, plan: TrackingPlan) -> Self {
        Self {
            calibration,
            plan,
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
        let intrinsics = match &self.calibration {
            Some(calibration) if unfit.is_none() => *calibration,
            _ => guessed_intrinsics(frame.size_px),
        };
        let (tracked, track_ms) = Stopwatch::time(|| match unfit {
            Some(trouble) => Err(trouble),
            None => self
                .track(&frame, intrinsics)
                .map_err(|error| error.to_string()),
        });
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
            anchors,
            poses,
            detections,
            wait_ms: (now_secs - at_secs).max(0.0) * 1e3,
            track_ms,
            trouble,
        }
    }

    fn track(
        &mut self,
        frame: &Frame,
        intrinsics: Intrinsics,
    ) -> Result<(Vec<AnchorPose>, Vec<Detection>), TrackingError> {
        let worker = match &mut self.worker {
            Some((size_px, worker)) if *size_px == frame.size_px => worker,
            other => {
                let worker = Worker::new(&self.plan, intrinsics)?;
                &mut other.insert((frame.size_px, worker)).1
            }
        };
        match worker {
            Worker::Follows(tracker) => {
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
}

impl Worker {
    fn new(plan: &TrackingPlan, intrinsics: Intrinsics) -> Result<Self, TrackingError> {
        Ok(match plan {
            TrackingPlan::Follow { settings, anchors } => {
                Self::Follows(Box::new(Tracker::new(settings, anchors, intrinsics)?))
            }
            TrackingPlan::Look => {
                // No tracker chases what a quick search misses.
                let settings = TrackingSettings {
                    library_edges: true,
                    ..TrackingSettings::default()
                };
                Self::Looks(Box::new(Detector::new(&settings, &[Family::TAG36H11])?))
            }
        })
    }
}

/// A camera that nobody has calibrated, by its pictures' size.
pub fn guessed_intrinsics(size_px: [u32; 2]) -> Intrinsics {
    let [width, height] = size_px.map(f64::from);
    Intrinsics {
        size_px,
        focal_px: DVec2::splat(width.max(height) / 2.0 / GUESSED_HALF_WIDTH),
        center_px: (DVec2::new(width, height) - 1.0) / 2.0,
        distortion: [0.0; 5],
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
        let picture =
            FrameTracker::new(Some(other), plan.clone()).look(arrived.clone(), 2.01, false);
        assert!(picture.trouble.unwrap().contains("320"));
        assert_eq!(picture.poses, [AnchorPose::LOST]);
        assert_eq!(picture.intrinsics.size_px, picture.frame.size_px);
        let picture = FrameTracker::new(Some(intrinsics), plan).look(arrived, 2.01, false);
        assert_eq!(picture.trouble, None);
        assert!(picture.poses[0].camera_from_anchor.is_some());
        assert!((picture.wait_ms - 10.0).abs() < 1e-9);
    }

    #[test]
    fn without_a_scene_every_marker_is_seen() {
        let (_, arrived, _) = lamp();
        let mut tracker = FrameTracker::new(None, TrackingPlan::Look);
        let picture = tracker.look(arrived, 2.0, false);
        let ids: Vec<u32> = picture.detections.iter().map(|seen| seen.id).collect();
        // Shadows lie across two of the six.
        assert!([0, 2, 3, 4].iter().all(|id| ids.contains(id)), "{ids:?}");
        assert!(ids.iter().all(|id| *id < 6), "{ids:?}");
        assert!(picture.poses.is_empty());
    }
}
