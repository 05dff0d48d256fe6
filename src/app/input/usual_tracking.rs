//! Tracking settings of a recording that no scene describes.

use crate::scene::TrackingSettings;

/// The usual settings, which take the detector that knows the family.
pub(crate) fn usual_tracking(decimation: f64) -> TrackingSettings {
    TrackingSettings {
        decimation,
        ..TrackingSettings::default()
    }
}
