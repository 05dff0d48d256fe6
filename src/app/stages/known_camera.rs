//! What is known of the camera that took a job's frames: it was calibrated, or its focal length is learnt from the scene's
//! markers. One rule for all jobs.
//!
//! A recording is looked through before it is played, so that all of it is seen by one camera: nothing slides while the
//! focal length becomes better known, a replay repeats bit for bit, and `replay`, `track` and `check` say the same. Of a
//! live source nobody knows what will come: there the camera is learnt beside tracking, and the better one is taken when it
//! is worth the jump.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, Result};

use super::progress::Progress;
use crate::app::files::picture_files::write_text;
use crate::capture::live::is_live;
use crate::capture::{Frame, FrameSource, calibration_text, load_calibration_for};
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Family, TrackingSettings};
use crate::tracking::TrackingError;
use crate::tracking::focal::{CameraLearner, LearntCamera};

/// Frames of a recording that are looked at: neighbours in a video show the same.
const MOST_FRAMES: u32 = 200;
/// Where a recording does not say how long it is, one in so many is.
const STRIDE: u32 = 5;
/// The time between frames of a live source that are looked at, seconds: each costs as much as a search.
const LOOK_AGAIN_SECS: f64 = 0.2;

/// What is known of a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum KnownCamera {
    /// It was calibrated.
    Calibrated(Intrinsics),
    /// It was not.
    Learnt(LearntCamera),
}

/// The markers that a camera is learnt from.
#[derive(Debug, Clone, Copy)]
pub(crate) enum LearntFrom<'a> {
    /// A scene's.
    Anchors(&'a [Anchor]),
    /// Any of a family.
    EveryMarker(Family),
}

impl KnownCamera {
    /// The camera.
    pub fn intrinsics(&self) -> Intrinsics {
        match self {
            Self::Calibrated(intrinsics) => *intrinsics,
            Self::Learnt(camera) => camera.intrinsics,
        }
    }

    /// What there is to say of it, of a source and where one names a calibration; nothing where it is calibrated.
    pub(crate) fn remark(&self, source: &str, place: &str) -> Option<String> {
        let Self::Learnt(camera) = self else {
            return None;
        };
        let known = camera.in_words();
        Some(match camera.is_sure() {
            true => format!("{source} carries no calibration: {known}"),
            false => format!(
                "{source} carries no calibration: {known}; things will not stand quite still. Show several markers of a \
                 board from several sides, or give a calibration ({place})"
            ),
        })
    }
}

impl LearntFrom<'_> {
    fn learner(
        self,
        settings: &TrackingSettings,
        size_px: [u32; 2],
    ) -> Result<CameraLearner, TrackingError> {
        match self {
            Self::Anchors(anchors) => CameraLearner::of_anchors(settings, anchors, size_px),
            Self::EveryMarker(family) => CameraLearner::of_every_marker(settings, family, size_px),
        }
    }
}

/// The camera of a recording, learnt from frames all through it.
///
/// # Errors
/// A recording that cannot be read, or a failure of a library.
pub(crate) fn learnt_camera(
    mut source: FrameSource,
    settings: &TrackingSettings,
    from: LearntFrom<'_>,
    stop: &AtomicBool,
) -> Result<LearntCamera> {
    let mut learner = from.learner(settings, source.size_px())?;
    let step = source
        .frame_count()
        .map_or(STRIDE, |count| count.div_ceil(MOST_FRAMES).max(1));
    let progress = Progress::new(source.frame_count());
    while let Some(frame) = source.next_frame()? {
        progress.advance();
        if frame.index.is_multiple_of(step) {
            let looked = learner.look(&frame);
            looked.with_context(|| format!("frame {}", frame.index))?;
        }
        if learner.is_done() || stop.load(Ordering::Relaxed) {
            break;
        }
    }
    progress.finish();
    Ok(learner.finish())
}

/// The camera of a live source, learnt while frames come.
pub(crate) struct LiveCamera {
    learner: CameraLearner,
    /// The one that frames are tracked with.
    in_use: LearntCamera,
    kept: KeptCamera,
    looked_secs: f64,
}

impl LiveCamera {
    /// Begins with `known`, where there is one, else with what an earlier run was sure of, else with a guess.
    pub(crate) fn begin(
        settings: &TrackingSettings,
        from: LearntFrom<'_>,
        size_px: [u32; 2],
        kept: KeptCamera,
        known: Option<LearntCamera>,
    ) -> Result<Self, TrackingError> {
        let known = known.filter(|camera| camera.intrinsics.size_px == size_px);
        Ok(Self {
            learner: from.learner(settings, size_px)?,
            in_use: known
                .or_else(|| kept.read(size_px))
                .unwrap_or(LearntCamera::guess(size_px)),
            kept,
            looked_secs: f64::NEG_INFINITY,
        })
    }

    /// The camera that frames are tracked with.
    pub(crate) fn in_use(&self) -> LearntCamera {
        self.in_use
    }

    /// Looks at a frame; whether another camera is in use from now on.
    pub(crate) fn look(&mut self, frame: &Frame) -> Result<bool, TrackingError> {
        let since_secs = frame.time_secs - self.looked_secs;
        if self.learner.is_done() || (0.0..LOOK_AGAIN_SECS).contains(&since_secs) {
            return Ok(false);
        }
        self.looked_secs = frame.time_secs;
        self.learner.look(frame)?;
        let learnt = self.learner.camera();
        let is_better = learnt.replaces(&self.in_use);
        if is_better {
            self.in_use = learnt;
            if learnt.is_sure() {
                self.kept.keep(&learnt);
            }
        }
        Ok(is_better)
    }
}

/// The place where a live source's camera is kept from one run to the next, by the source's name and its pictures' size.
/// Nothing is lost by deleting it.
#[derive(Debug, Clone, Default)]
pub struct KeptCamera {
    /// Without the size; `None`: nothing is kept.
    stem: Option<PathBuf>,
}

impl KeptCamera {
    /// In the user's folder; of recordings, which tell it anew each time, nothing is kept.
    pub fn of(source: &str) -> Self {
        let folder = dirs::cache_dir().filter(|_| is_live(source));
        Self {
            stem: folder.map(|folder| Self::stem(&folder.join("gnomon").join("cameras"), source)),
        }
    }

    /// A name that a file can have: other signs than letters and digits are told by their numbers.
    fn stem(folder: &Path, source: &str) -> PathBuf {
        let plain = source.chars().map(|sign| match sign {
            sign if sign.is_ascii_alphanumeric() => sign.to_string(),
            sign => format!("_{:x}", u32::from(sign)),
        });
        // Addresses may be longer than names of files.
        folder.join(
            plain
                .collect::<String>()
                .chars()
                .take(150)
                .collect::<String>(),
        )
    }

    fn path(&self, [width, height]: [u32; 2]) -> Option<PathBuf> {
        let mut name = self.stem.clone()?.into_os_string();
        name.push(format!("-{width}x{height}.toml"));
        Some(name.into())
    }

    fn read(&self, size_px: [u32; 2]) -> Option<LearntCamera> {
        let path = self.path(size_px)?;
        let intrinsics = load_calibration_for(&path, size_px, "the camera").ok()?;
        Some(LearntCamera::kept(intrinsics))
    }

    /// Whole or not at all; what is not kept is learnt again.
    fn keep(&self, camera: &LearntCamera) {
        let Some(path) = self.path(camera.intrinsics.size_px) else {
            return;
        };
        let text = format!(
            "# {}\n{}",
            camera.in_words(),
            calibration_text(&camera.intrinsics)
        );
        if let Some(folder) = path.parent()
            && std::fs::create_dir_all(folder).is_ok()
        {
            _ = write_text(&path, &text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracking::focal::CameraBasis;

    #[test]
    fn what_is_kept_comes_back_by_source_and_size() {
        let folder = tempfile::tempdir().unwrap();
        let kept = |source: &str| KeptCamera {
            stem: Some(KeptCamera::stem(&folder.path().join("cameras"), source)),
        };
        let mut camera = LearntCamera::guess([640, 480]);
        camera.intrinsics.focal_px *= 1.2345;
        camera.basis = CameraBasis::Views(20);
        camera.focal_deviation = 0.004;
        kept("webcam:0").keep(&camera);
        let found = kept("webcam:0").read([640, 480]).unwrap();
        assert_eq!(found, LearntCamera::kept(camera.intrinsics));
        assert_eq!(kept("webcam:0").read([1280, 720]), None);
        assert_eq!(kept("webcam:1").read([640, 480]), None);
        // Not a path of its own.
        let path = kept("http://a/../../b").path([640, 480]).unwrap();
        assert_eq!(path.parent(), Some(folder.path().join("cameras").as_path()));
        assert_eq!(KeptCamera::of("recordings/lamp").path([640, 480]), None);
    }
}
