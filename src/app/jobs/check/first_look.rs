//! What the first frames of a scene's recording tell before it is played.

use anyhow::Result;

use crate::app::input::mirror_watch::MirrorWatch;
use crate::capture::{CaptureError, FrameSource};
use crate::scene::Scene;
use crate::tracking::{Detector, grey_from_rgba};

/// Frames that are looked at.
const FIRST_FRAMES: u32 = 16;

/// A warning where the recording cannot be read, or shows markers only when it is mirrored; a webcam is not asked.
pub fn first_look(scene: &Scene) -> Option<String> {
    match FrameSource::open(&scene.camera.source) {
        Err(CaptureError::Live { .. }) => None,
        Err(error) => Some(error.to_string()),
        Ok(source) => look(scene, source.mirrored(scene.camera.mirror))
            .unwrap_or_else(|error| Some(format!("{error:#}"))),
    }
}

fn look(scene: &Scene, mut source: FrameSource) -> Result<Option<String>> {
    let markers = scene.anchors.iter().flat_map(|anchor| &anchor.markers);
    let families: Vec<_> = markers.map(|marker| marker.family).collect();
    let mut detector = Detector::new(&scene.tracking, &families)?;
    let mut watch = MirrorWatch::new(&scene.tracking, &scene.anchors);
    let mut grey = Vec::new();
    for _ in 0..FIRST_FRAMES {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        grey_from_rgba(&frame, &mut grey)?;
        let shows_marker = !detector.detect(&grey, frame.size_px)?.is_empty();
        watch.watch(&frame, shows_marker)?;
        if shows_marker {
            break;
        }
    }
    Ok(watch.hint(scene.camera.mirror))
}
