//! What a job plays: the recording and its camera's calibration.

use anyhow::{Result, anyhow};

use crate::app::talk;
use crate::capture::{FrameSource, check_frame_size, load_calibration};
use crate::geometry::camera::Intrinsics;
use crate::scene::CameraSettings;

/// Opens a recording with its calibration: the one that is named, else what the recording carries.
pub(crate) fn open(camera: &CameraSettings) -> Result<(FrameSource, Intrinsics)> {
    let source = FrameSource::open(&camera.source)?.mirrored(camera.mirror);
    if let Some(remark) = source.remark() {
        talk::say(remark);
    }
    let intrinsics = match &camera.calibration {
        Some(path) => load_calibration(path)?,
        None => source.calibration().ok_or_else(|| {
            anyhow!(
                "{} carries no calibration: give one ([camera] calibration in a scene)",
                camera.source
            )
        })?,
    };
    check_frame_size(&intrinsics, source.size_px(), &camera.source)?;
    Ok((source, intrinsics))
}
