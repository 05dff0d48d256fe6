//! Tracking settings of a recording that no scene describes.

use crate::scene::{DetectorKind, Family, TrackingSettings};

/// The usual settings with a detector that knows the family.
pub(crate) fn usual_tracking(family: Family, decimation: f64) -> TrackingSettings {
    TrackingSettings {
        detector: if family.is_april_tag() {
            DetectorKind::AprilTag
        } else {
            DetectorKind::Aruco
        },
        decimation,
        ..TrackingSettings::default()
    }
}
