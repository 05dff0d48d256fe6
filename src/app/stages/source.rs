//! What a job plays: the recording and its camera.

use std::sync::atomic::AtomicBool;

use anyhow::{Result, anyhow};

use super::known_camera::{KnownCamera, LearntFrom, learnt_camera};
use crate::app::talk;
use crate::capture::{FrameSource, check_frame_size, load_calibration_among};
use crate::geometry::camera::Intrinsics;
use crate::scene::{CameraSettings, Scene, TrackingSettings};

/// Where whoever runs the job names a calibration, for messages.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum CalibrationNamed {
    /// In the scene's file.
    ByKey,
    /// On the command line.
    ByOption,
}

impl CalibrationNamed {
    pub(crate) fn place(self) -> &'static str {
        match self {
            Self::ByKey => "calibration = \"FILE\" under [camera] in the scene",
            Self::ByOption => "--calibration FILE",
        }
    }
}

/// Opens a scene's recording with its camera: the calibration that is named, else what the recording carries, else what
/// its pictures of the scene's markers tell.
pub(crate) fn open(scene: &Scene, stop: &AtomicBool) -> Result<(FrameSource, KnownCamera)> {
    let from = LearntFrom::Anchors(&scene.anchors);
    open_and_learn(&scene.camera, &scene.tracking, from, stop)
}

/// The same of any recording and markers.
pub(crate) fn open_and_learn(
    camera: &CameraSettings,
    settings: &TrackingSettings,
    from: LearntFrom<'_>,
    stop: &AtomicBool,
) -> Result<(FrameSource, KnownCamera)> {
    let (source, calibration) = open_as_it_is(camera)?;
    if let Some(intrinsics) = calibration {
        return Ok((source, KnownCamera::Calibrated(intrinsics)));
    }
    let looked_through = FrameSource::open(&camera.source)?.mirrored(camera.mirror);
    let learnt = learnt_camera(looked_through, settings, from, stop)?;
    Ok((source, KnownCamera::Learnt(learnt)))
}

/// Opens a recording for a job that cannot do without a calibration.
pub(crate) fn open_calibrated(
    camera: &CameraSettings,
    named: CalibrationNamed,
) -> Result<(FrameSource, Intrinsics)> {
    let (source, calibration) = open_as_it_is(camera)?;
    let intrinsics = calibration.ok_or_else(|| {
        let (source, place) = (&camera.source, named.place());
        anyhow!("{source} carries no calibration: give one ({place})")
    })?;
    Ok((source, intrinsics))
}

/// A recording, and the calibration that is named or that it carries.
pub(crate) fn open_as_it_is(camera: &CameraSettings) -> Result<(FrameSource, Option<Intrinsics>)> {
    let source = FrameSource::open(&camera.source)?.mirrored(camera.mirror);
    if let Some(remark) = source.remark() {
        talk::say(remark);
    }
    let calibration = match &camera.calibration {
        Some(path) => {
            let (intrinsics, assumed) = load_calibration_among(path, source.size_px())?;
            for assumed in assumed {
                talk::say(assumed.told(path, source.size_px(), &camera.source));
            }
            Some(intrinsics)
        }
        None => source.calibration(),
    };
    if let Some(intrinsics) = &calibration {
        check_frame_size(intrinsics, source.size_px(), &camera.source)?;
    }
    Ok((source, calibration))
}
