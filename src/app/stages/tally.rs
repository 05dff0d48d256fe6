//! What tracking gave, counted over a recording.

use std::collections::BTreeMap;

use super::stats::StageLog;
use super::tracked::TrackedFrame;
use crate::app::talk::counted;
use crate::scene::Anchor;
use crate::tracking::{LossReason, Status};

/// Counts and times, gathered frame by frame.
pub(crate) struct Tally {
    /// Times of all stages.
    pub log: StageLog,
    /// For each anchor the frames without a pose.
    pub lost: Vec<u32>,
    /// Frames that were read.
    pub frames: u32,
    /// Index of the frame that was read last; a damaged recording lacks some before it.
    pub last_read: Option<u32>,
    reprojections_px: Vec<f64>,
    /// For each anchor the frames in which something else than its absence kept it from having a pose.
    hindered: Vec<BTreeMap<LossReason, u32>>,
}

impl Tally {
    pub(crate) fn new(anchors: usize) -> Self {
        Self {
            log: StageLog::default(),
            lost: vec![0; anchors],
            frames: 0,
            last_read: None,
            reprojections_px: Vec::new(),
            hindered: vec![BTreeMap::new(); anchors],
        }
    }

    pub(crate) fn add(&mut self, tracked: &TrackedFrame) {
        // An anchor that comes by itself was not there before.
        let anchors = self.lost.len().max(tracked.poses.len());
        self.lost.resize(anchors, self.frames);
        self.hindered.resize(anchors, BTreeMap::new());
        self.frames += 1;
        self.last_read = Some(tracked.frame.index);
        if let Some(ms) = tracked.decode_ms {
            self.log.add("decode", ms);
        }
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
        for (hindered, pose) in self.hindered.iter_mut().zip(&tracked.poses) {
            let reason = pose
                .loss_reason
                .filter(|reason| matches!(reason, LossReason::DoubleId | LossReason::NoPose));
            if let Some(reason) = reason {
                *hindered.entry(reason).or_default() += 1;
            }
        }
    }

    /// What kept anchors from having a pose although their markers were seen, in words.
    pub(crate) fn hindrances(&self, anchors: &[Anchor]) -> impl Iterator<Item = String> {
        anchors
            .iter()
            .zip(&self.hindered)
            .flat_map(|(anchor, hindered)| {
                let name = &anchor.name;
                hindered.iter().map(move |(reason, frames)| {
                    format!(
                        "{name} has no pose in {}: {reason}",
                        counted(*frames as usize, "frame")
                    )
                })
            })
    }

    /// Median over the frames of the reprojection error of the first anchor that is seen, pixels; `None` without a
    /// tracker.
    pub(crate) fn reprojection_px(&mut self) -> Option<f64> {
        self.reprojections_px.sort_by(f64::total_cmp);
        let middle = self.reprojections_px.len() / 2;
        self.reprojections_px.get(middle).copied()
    }
}
