//! What a job on a live source opens: what the camera is asked for, and its calibration.

use anyhow::Result;

use crate::app::talk;
use crate::capture::live::{LiveOptions, is_live};
use crate::capture::{CalibrationError, FrameSource, load_calibration, load_calibration_among};
use crate::geometry::camera::Intrinsics;
use crate::scene::{CameraSettings, WantedFormat};

/// A camera's settings, read.
#[derive(Debug, Clone)]
pub struct LiveInput {
    /// The one that is named, else what a recording carries.
    pub calibration: Option<Intrinsics>,
    wanted: WantedFormat,
    mirror: bool,
}

impl LiveInput {
    /// Reads the calibration; unless the scene asks for another size the camera is asked for the size that it was calibrated at.
    ///
    /// # Errors
    /// A calibration that cannot be read.
    pub fn of(camera: &CameraSettings) -> Result<Self> {
        let calibration = match &camera.calibration {
            Some(path) => {
                let size_px = match (load_calibration(path), camera.wanted.size_px) {
                    (Err(CalibrationError::NoSize { .. }), Some(wanted_px)) => wanted_px,
                    (loaded, _) => loaded?.size_px,
                };
                let (intrinsics, assumed) = load_calibration_among(path, size_px)?;
                for assumed in assumed {
                    talk::say(assumed.told(path, size_px, &camera.source));
                }
                Some(intrinsics)
            }
            None if is_live(&camera.source) => None,
            None => FrameSource::open(&camera.source)?.calibration(),
        };
        let calibrated_px = calibration.map(|calibration| calibration.size_px);
        Ok(Self {
            calibration,
            wanted: WantedFormat {
                size_px: camera.wanted.size_px.or(calibrated_px),
                ..camera.wanted
            },
            mirror: camera.mirror,
        })
    }

    /// `repeats`: whether a recording begins again at its end.
    pub fn options(&self, repeats: bool) -> LiveOptions {
        LiveOptions {
            wanted: self.wanted,
            mirror: self.mirror,
            repeats,
        }
    }
}
