//! Tracking of whole recordings whose true poses are known, by the measures of the peers' `pose_error.py`: how far the
//! pose puts points about the board from where they are (shift), and by how much that changes from frame to frame
//! (jitter).

use std::path::Path;

use glam::{DAffine3, DVec2, DVec3};
use gnomon::app::truth::affine;
use gnomon::capture::{Frame, FrameSource};
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::{Anchor, DetectorKind, Scene, TrackingSettings};
use gnomon::tracking::{Status, Tracker};
use serde_json::Value;

use crate::common::project_file;
use crate::common::sheets::{angle_between_deg, detector_alone};

/// Points about the anchor's origin whose shift is judged, metres.
const JUDGED_M: [DVec3; 4] = [
    DVec3::ZERO,
    DVec3::new(0.0, 0.0, 0.08),
    DVec3::new(0.08, 0.05, 0.0),
    DVec3::new(-0.08, 0.05, 0.05),
];

/// A recording and its true poses.
struct Recording {
    frames: Vec<Frame>,
    camera: Intrinsics,
    anchors: Vec<Anchor>,
    /// Per frame and anchor.
    truths: Vec<Vec<DAffine3>>,
}

impl Recording {
    /// `config` names the scene that has the recording's anchors: a board, and lone markers that move.
    fn open(folder: &Path, config: &str) -> Self {
        let scene = Scene::load(&project_file(config)).expect("a scene");
        let mut source = FrameSource::open(folder.to_str().expect("a path")).expect("frames");
        let camera = source.calibration().expect("a calibration");
        let mut frames = Vec::new();
        while let Some(frame) = source.next_frame().expect("a frame") {
            frames.push(frame);
        }
        let text = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
        let truth: Value = serde_json::from_str(&text).expect("the truth");
        let truths = frames.iter().map(|frame| {
            let truth = &truth["frames"][frame.index as usize];
            let camera_from_world = affine(&truth["world_to_camera"]).expect("a pose");
            let on_table = scene
                .anchors
                .iter()
                .map(|anchor| match &anchor.markers[..] {
                    [lone] => {
                        let lone = affine(&truth["markers"][lone.id.to_string()]);
                        camera_from_world * lone.expect("a pose")
                    }
                    _ => camera_from_world,
                });
            on_table.collect()
        });
        Self {
            truths: truths.collect(),
            frames,
            camera,
            anchors: scene.anchors,
        }
    }

    /// The error of each anchor.
    fn errors(&self, settings: &TrackingSettings) -> Vec<PoseError> {
        let mut tracker = Tracker::new(settings, &self.anchors, self.camera).expect("a tracker");
        let mut shifts = vec![Vec::new(); self.anchors.len()];
        let mut turns_deg = vec![0.0; self.anchors.len()];
        for (frame, truths) in self.frames.iter().zip(&self.truths) {
            let poses = tracker.track(frame).expect("poses");
            for (k, pose) in poses.iter().enumerate() {
                let is_seen = matches!(pose.status, Status::Tracked | Status::Ambiguous);
                let seen = pose.camera_from_anchor.filter(|_| is_seen);
                shifts[k].push(seen.map(|pose| self.shift(&pose, &truths[k])));
                if let (Status::Tracked, Some(seen)) = (pose.status, seen) {
                    turns_deg[k] = angle_between_deg(&seen, &truths[k]).max(turns_deg[k]);
                }
            }
        }
        let anchors = shifts.iter().zip(turns_deg);
        anchors
            .map(|(shifts, turn_deg)| PoseError::new(shifts, turn_deg))
            .collect()
    }

    fn shift(&self, pose: &DAffine3, truth: &DAffine3) -> [DVec2; 4] {
        JUDGED_M.map(|point_m| {
            let pixel = |pose: &DAffine3| {
                let place = pose.transform_point3(point_m);
                self.camera.pixel_from_plane(place.truncate() / place.z)
            };
            pixel(pose) - pixel(truth)
        })
    }
}

#[derive(Debug)]
struct PoseError {
    lost: usize,
    median_px: f64,
    p95_px: f64,
    jitter_px: f64,
    /// The largest of those that it was sure of.
    turn_deg: f64,
}

impl PoseError {
    fn new(shifts: &[Option<[DVec2; 4]>], turn_deg: f64) -> Self {
        let length = |shift: [DVec2; 4]| shift.iter().map(|px| px.length()).sum::<f64>() / 4.0;
        let mut lengths: Vec<f64> = shifts
            .iter()
            .flatten()
            .map(|shift| length(*shift))
            .collect();
        lengths.sort_by(f64::total_cmp);
        // Between its neighbours, linearly.
        let percentile = |share: f64| {
            let place = share * (lengths.len() - 1) as f64;
            let (low, high) = (lengths[place as usize], lengths[place.ceil() as usize]);
            low + (high - low) * place.fract()
        };
        let changes: Vec<f64> = shifts
            .windows(2)
            .filter_map(|pair| {
                let (before, after) = (pair[0]?, pair[1]?);
                Some(length(std::array::from_fn(|k| after[k] - before[k])).powi(2))
            })
            .collect();
        Self {
            lost: shifts.len() - lengths.len(),
            median_px: percentile(0.5),
            p95_px: percentile(0.95),
            jitter_px: (changes.iter().sum::<f64>() / changes.len() as f64).sqrt(),
            turn_deg,
        }
    }

    fn hold(&self, what: &str, bounds_px: [f64; 3], alone: &Self) {
        let found_px = [self.median_px, self.p95_px, self.jitter_px];
        eprintln!("{what}: {self:.4?} of {bounds_px:.4?}; a detector alone: {alone:.4?}");
        assert_eq!(self.lost, 0, "{what}");
        for (found_px, bound_px) in found_px.into_iter().zip(bounds_px) {
            assert!(found_px <= bound_px, "{what}: {self:?}");
        }
        // The other of its two poses lies farther off.
        assert!(self.turn_deg < 1.0, "{what}: {self:?}");
    }
}

/// Median, 95th percentile and jitter of the board and of the other anchors, without and with the filter.
fn hold(folder: &Path, config: &str, bounds_px: &[[f64; 3]]) {
    let recording = Recording::open(folder, config);
    let alone = recording.errors(&detector_alone(DetectorKind::AprilTag));
    for filter in [false, true] {
        let settings = TrackingSettings {
            filter,
            ..TrackingSettings::default()
        };
        let errors = recording.errors(&settings);
        assert_eq!(errors.len(), bounds_px.len());
        for (k, error) in errors.iter().enumerate() {
            let kind = if filter { "filtered" } else { "raw" };
            let name = &recording.anchors[k].name;
            let what = format!("{}: {name}, {kind}", folder.display());
            error.hold(&what, bounds_px[k], &alone[k]);
        }
    }
}

/// A session larger than what ships: at most 0.6 of what the best of the peers reaches there.
fn hold_session(name: &str, config: &str, best_peer_px: [f64; 3], others_px: &[[f64; 3]]) {
    let folder = project_file("../shared/sessions").join(name);
    let mut bounds_px = vec![best_peer_px.map(|px| 0.6 * px)];
    bounds_px.extend(others_px);
    hold(&folder, config, &bounds_px);
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn session_lamp() {
    hold_session("lamp", "config/lamp.toml", [0.111, 0.143, 0.032], &[]);
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn session_hand() {
    let card_px = [0.2, 0.4, 0.3];
    hold_session(
        "hand",
        "config/hand.toml",
        [0.052, 0.068, 0.029],
        &[card_px],
    );
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/sessions")]
fn session_room() {
    // The board is that of the other sessions.
    hold_session("room", "config/lamp.toml", [0.057, 0.090, 0.029], &[]);
}

#[test]
fn recording_lamp() {
    hold(
        &project_file("recordings/lamp"),
        "config/lamp.toml",
        &[[0.02, 0.035, 0.025]],
    );
}

#[test]
fn recording_hand() {
    let card_px = [0.25, 0.5, 0.4];
    hold(
        &project_file("recordings/hand"),
        "config/hand.toml",
        &[[0.025, 0.045, 0.03], card_px],
    );
}
