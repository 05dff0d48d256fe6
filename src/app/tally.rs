//! What tracking gave, counted over a recording.

use super::stats::StageLog;
use super::tracked::TrackedFrame;
use crate::tracking::Status;

/// Counts and times, frame by frame.
pub(super) struct Tally {
    /// Times of all stages.
    pub log: StageLog,
    /// For each anchor the frames without a pose.
    pub lost: Vec<u32>,
    /// Frames that were read.
    pub frames: u32,
    /// Index of the frame that was read last; a damaged recording lacks some before it.
    pub last_read: Option<u32>,
    reprojections_px: Vec<f64>,
}

impl Tally {
    pub(super) fn new(anchors: usize) -> Self {
        Self {
            log: StageLog::default(),
            lost: vec![0; anchors],
            frames: 0,
            last_read: None,
            reprojections_px: Vec::new(),
        }
    }

    pub(super) fn add(&mut self, tracked: &TrackedFrame) {
        self.frames += 1;
        self.last_read = Some(tracked.frame.index);
        self.log.add("decode", tracked.decode_ms);
        if let Some(ms) = tracked.track_ms {
            self.log.add("track", ms);
            let seen = tracked
                .poses
                .iter()
                .find(|pose| pose.camera_from_anchor.is_some() && pose.status != Status::Predicted);
            self.reprojections_px
                .extend(seen.map(|pose| pose.reprojection_px));
        }
        for (lost, pose) in self.lost.iter_mut().zip(&tracked.poses) {
            *lost += u32::from(pose.camera_from_anchor.is_none());
        }
    }

    /// Median over the frames of the reprojection error of the first anchor that is seen, pixels; `None` without a
    /// tracker.
    pub(super) fn reprojection_px(&mut self) -> Option<f64> {
        self.reprojections_px.sort_by(f64::total_cmp);
        let middle = self.reprojections_px.len() / 2;
        self.reprojections_px.get(middle).copied()
    }
}
