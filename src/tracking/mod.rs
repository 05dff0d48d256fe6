//! Where the anchors are: markers detected, poses solved.
//!
//! [`Tracker`] goes from a frame to a pose per anchor; [`Detector`] is its first half, markers alone. What the two
//! libraries behind it call a corner is told apart in `conventions.rs` and nowhere else; no type of theirs leaves.

#[expect(
    unsafe_code,
    reason = "libapriltag is a C library; no other module may be unsafe"
)]
mod apriltag;
mod aruco;
mod aruco_dictionary;
mod belief;
mod condition;
mod conventions;
mod cover;
mod detector;
mod edge_fit;
mod expected_picture;
mod filter;
mod flipped_pose;
pub mod focal;
mod layout;
mod light;
pub mod mapping;
mod marker_template;
mod pixel_pose;
mod pose;
mod pose_starts;
mod printed_marker;
mod prints;
mod reading;
mod refine;
mod survey;
mod template_match;
mod tracked_anchor;
mod tracker;
mod wanted;

use glam::DAffine3;

pub use aruco::{Quad, rejected_quads};
pub use detector::{Detection, Detector};
pub use light::grey_from_rgba;
pub use printed_marker::{Cell, PrintedMarker};
pub use prints::printed_cells;
pub use survey::Survey;
pub use tracked_anchor::predicted_visibility;
pub use tracker::Tracker;

/// How far a pose can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Status {
    /// One pose explains the picture.
    Tracked,
    /// The picture does not show the anchor, but those just before it did: it is where its motion took it.
    Predicted,
    /// A lone marker whose two poses explain the picture about equally well.
    Ambiguous,
    /// No marker of the anchor was seen, or none that can be trusted.
    Lost,
}

/// The reason why an anchor is not simply tracked.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, thiserror::Error)]
pub enum LossReason {
    /// The usual one.
    #[error("none of its markers is in the picture")]
    NoMarker,
    /// More than one marker with its id: none is trusted unless the rest of a board decides.
    #[error("several markers in the picture have its id")]
    DoubleId,
    /// A mirrored picture, or markers that do not lie as the scene says.
    #[error("no pose explains where its markers are")]
    NoPose,
    /// A small or frontal marker alone.
    #[error("two poses explain the picture about equally well")]
    TwoPoses,
}

/// What is known of one anchor in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct AnchorPose {
    /// How far the pose can be trusted.
    pub status: Status,
    /// The reason why it is not simply tracked; `None` when it is.
    pub loss_reason: Option<LossReason>,
    /// Markers that the pose rests on.
    pub markers: u32,
    /// `None` when lost.
    pub camera_from_anchor: Option<DAffine3>,
    /// Covariance of the pose: of a small turn about the anchor's origin in camera axes
    /// (radians; it stands left of the rotation), then of a shift (metres).
    pub covariance: Option<[[f64; 6]; 6]>,
    /// Root mean square distance of the corners from where the pose puts them, pixels; 0 when lost. Above a pixel the
    /// calibration or the markers' sizes are wrong.
    pub reprojection_px: f64,
    /// The other of the two poses that a plane has, where it differs.
    pub alternative: Option<Alternative>,
    /// How much of what stands on the anchor is to be shown: 1 while it is seen, less as a prediction grows old, 0 when
    /// lost.
    pub visibility: f64,
}

impl AnchorPose {
    /// An anchor that was not found.
    pub const LOST: Self = Self {
        status: Status::Lost,
        loss_reason: None,
        markers: 0,
        camera_from_anchor: None,
        covariance: None,
        reprojection_px: 0.0,
        alternative: None,
        visibility: 0.0,
    };
}

/// The pose of a plane that was not chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alternative {
    /// The pose.
    pub camera_from_anchor: DAffine3,
    /// Root mean square distance of the corners from where it puts them, pixels.
    pub reprojection_px: f64,
}

/// What stops tracking; a marker that is not seen does not.
#[derive(Debug, thiserror::Error)]
pub enum TrackingError {
    /// The detector does not know the family.
    #[error("{detector} does not know the family {family}; it knows {allowed}")]
    FamilyNotAvailable {
        /// Name of the family.
        family: &'static str,
        /// Name of the detector.
        detector: &'static str,
        /// Names of the families that it knows.
        allowed: String,
    },
    /// A family has no marker of this number.
    #[error("{family} has no marker {id}; it has 0 to {}", count - 1)]
    NoSuchMarker {
        /// Name of the family.
        family: &'static str,
        /// Number of the marker.
        id: u32,
        /// How many the family has.
        count: u32,
    },
    /// A setting is out of its range.
    #[error("{name} = {value} is out of range; allowed: {allowed}")]
    Setting {
        /// Name of the setting, as in the scene file.
        name: &'static str,
        /// What it was.
        value: String,
        /// What it may be.
        allowed: String,
    },
    /// The frame is not of the size that the camera was calibrated for.
    #[error(
        "a frame of {} x {} pixels does not fit a calibration for {} x {}",
        frame_px[0], frame_px[1], calibration_px[0], calibration_px[1]
    )]
    FrameSize {
        /// Width and height of the frame.
        frame_px: [u32; 2],
        /// Width and height that the calibration is for.
        calibration_px: [u32; 2],
    },
    /// A picture's bytes do not make up its size.
    #[error("{bytes} bytes are no picture of {} x {} pixels", size_px[0], size_px[1])]
    PictureSize {
        /// Number of bytes.
        bytes: usize,
        /// Width and height that they should make up.
        size_px: [u32; 2],
    },
    /// libapriltag or OpenCV failed.
    #[error("{0}")]
    Library(String),
}

impl From<opencv::Error> for TrackingError {
    fn from(error: opencv::Error) -> Self {
        Self::Library(format!("OpenCV: {}", error.message))
    }
}
