//! What a job plays: the recording, its camera's calibration, and that neither is written over.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow, bail};

use crate::capture::{FrameSource, check_frame_size, load_calibration};
use crate::geometry::camera::Intrinsics;
use crate::scene::CameraSettings;

/// Opens a recording with its calibration: the one that is named, else what the recording carries.
pub(super) fn open(camera: &CameraSettings) -> Result<(FrameSource, Intrinsics)> {
    let source = FrameSource::open(&camera.source)?.mirrored(camera.mirror);
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

/// A recording is never written over: not the video that is played, nor anything in its folder.
pub(super) fn refuse_to_overwrite(source: &FrameSource, written: Option<&Path>) -> Result<()> {
    let Some(written) = written else {
        return Ok(());
    };
    let (Ok(recording), Some(target)) = (source.path().canonicalize(), resolved(written)) else {
        return Ok(());
    };
    let lies_in = target == recording || (recording.is_dir() && target.starts_with(&recording));
    if lies_in {
        bail!(
            "{} is, or lies in, the recording {} that is being played; write elsewhere",
            written.display(),
            source.path().display()
        );
    }
    Ok(())
}

/// The real place of a file that may not be there yet.
fn resolved(path: &Path) -> Option<PathBuf> {
    if let Ok(real) = path.canonicalize() {
        return Some(real);
    }
    let parent = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    let parent = parent.unwrap_or(Path::new("."));
    Some(resolved(parent)?.join(path.file_name()?))
}
