//! Where the anchors are: markers detected, poses solved.

use glam::DAffine3;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    Tracked,
    /// A lone marker whose two poses explain the picture about equally well.
    Ambiguous,
    Lost,
}

/// What is known of one anchor in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct AnchorPose {
    pub status: Status,
    /// Markers that the pose rests on.
    pub markers: u32,
    /// `None` when lost.
    pub camera_from_anchor: Option<DAffine3>,
    /// Root mean square distance of the corners from where the pose puts them, pixels; 0 when lost.
    pub reprojection_px: f64,
}

impl AnchorPose {
    /// An anchor that was not found.
    pub fn lost() -> Self {
        Self { status: Status::Lost, markers: 0, camera_from_anchor: None, reprojection_px: 0.0 }
    }
}
