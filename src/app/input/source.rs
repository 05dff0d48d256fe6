//! What a job plays: the recording and its camera's calibration.

use anyhow::{Result, anyhow};

use crate::app::talk;
use crate::capture::{FrameSource, check_frame_size, load_calibration};
use crate::geometry::camera::Intrinsics;
use crate::scene::CameraSettings;

/// Where whoever runs the job names a calibration, for messages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CalibrationNamed {
    /// In the scene's file.
    ByKey,
    /// On the command line.
    ByOption,
}

impl CalibrationNamed {
    /// What to say where there is none.
    pub(crate) fn missing(self, source: &str) -> String {
        let place = match self {
            Self::ByKey => "calibration = \"FILE\" under [camera] in the scene",
            Self::ByOption => "--calibration FILE",
        };
        format!("{source} carries no calibration: give one ({place})")
    }
}

/// Opens a scene's recording with its calibration: the one that is named, else what the recording carries.
pub(crate) fn open(camera: &CameraSettings) -> Result<(FrameSource, Intrinsics)> {
    open_named(camera, CalibrationNamed::ByKey)
}

/// The same of a recording that may be named on the command line.
pub(crate) fn open_named(
    camera: &CameraSettings,
    named: CalibrationNamed,
) -> Result<(FrameSource, Intrinsics)> {
    let source = FrameSource::open(&camera.source)?.mirrored(camera.mirror);
    if let Some(remark) = source.remark() {
        talk::say(remark);
    }
    let intrinsics = match &camera.calibration {
        Some(path) => load_calibration(path)?,
        None => (source.calibration()).ok_or_else(|| anyhow!(named.missing(&camera.source)))?,
    };
    check_frame_size(&intrinsics, source.size_px(), &camera.source)?;
    Ok((source, intrinsics))
}
