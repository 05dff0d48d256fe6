//! What the live program begins with: a scene's file, or a camera alone.

use std::path::Path;

use anyhow::Result;

use super::frame_tracker::TrackingPlan;
use crate::app::authoring::SceneDocument;
use crate::app::files::job_files::JobFiles;
use crate::app::files::result_kind::ResultKind;
use crate::app::input::live_input::LiveInput;
use crate::app::stages::progress::Progress;
use crate::scene::{CameraSettings, Loading};

/// A scene or a camera that was read, before anything is opened.
pub struct Opening {
    /// `None` on first use.
    pub(super) document: Option<SceneDocument>,
    pub(super) camera: CameraSettings,
    pub(super) input: LiveInput,
}

impl Opening {
    /// A scene file says all.
    ///
    /// # Errors
    /// A scene or a calibration that cannot be read.
    pub fn scene(path: &Path) -> Result<Self> {
        let loading = Loading::default();
        let open = || SceneDocument::open_telling(path, loading.clone());
        let document = Progress::of_models(&loading, open)?;
        let camera = document.scene().camera.clone();
        Self::with(Some(document), camera)
    }

    /// A camera or a recording alone: first use.
    ///
    /// # Errors
    /// A calibration that cannot be read.
    pub fn camera(camera: CameraSettings) -> Result<Self> {
        Self::with(None, camera)
    }

    fn with(document: Option<SceneDocument>, camera: CameraSettings) -> Result<Self> {
        Ok(Self {
            input: LiveInput::of(&camera)?,
            document,
            camera,
        })
    }

    /// What is read, and the folder for what is recorded.
    pub fn files(&self, out: &Path) -> JobFiles {
        let mut files = JobFiles::default();
        files.reads_camera(&self.camera);
        if let Some(document) = &self.document {
            files.reads(document.path());
            document.files().iter().for_each(|file| files.reads(file));
        }
        files.writes("--out", out, ResultKind::Folder);
        files
    }

    /// What it is, for a title.
    pub fn title(&self) -> String {
        title_of(self.document.as_ref(), &self.camera)
    }
}

/// A scene's file or, where there is none, what is filmed with.
pub(super) fn title_of(document: Option<&SceneDocument>, camera: &CameraSettings) -> String {
    let name = document.and_then(|document| document.path().file_name());
    name.map_or_else(
        || camera.source.clone(),
        |name| name.to_string_lossy().into_owned(),
    )
}

/// What is looked for in a scene's frames.
pub(super) fn plan_of(document: Option<&SceneDocument>) -> TrackingPlan {
    document.map_or(TrackingPlan::Look, |document| {
        let scene = document.scene();
        TrackingPlan::Follow {
            settings: scene.tracking.clone(),
            anchors: scene.anchors.clone().into(),
        }
    })
}

/// Whether two settings mean one camera, asked for the same.
pub(super) fn same_camera(a: &CameraSettings, b: &CameraSettings) -> bool {
    (&a.source, &a.calibration, a.mirror, a.wanted)
        == (&b.source, &b.calibration, b.mirror, b.wanted)
}
