//! What the first frames of a scene's recording tell before it is played.

use anyhow::Result;

use crate::app::input::mirror_watch::MirrorWatch;
use crate::app::input::sightings::Sightings;
use crate::capture::{CaptureError, FrameSource};
use crate::scene::{Anchor, Scene};
use crate::tracking::{Detection, Detector, grey_from_rgba};

/// Frames that are looked at.
const FIRST_FRAMES: u32 = 16;

/// A warning where the recording cannot be read, shows markers only when it is mirrored, or others than the scene has; a
/// webcam is not asked.
pub fn first_look(scene: &Scene) -> Option<String> {
    match FrameSource::open(&scene.camera.source) {
        Err(CaptureError::Live { .. }) => None,
        Err(error) => Some(error.to_string()),
        Ok(source) => look(scene, source.mirrored(scene.camera.mirror))
            .unwrap_or_else(|error| Some(format!("{error:#}"))),
    }
}

fn look(scene: &Scene, mut source: FrameSource) -> Result<Option<String>> {
    let families = scene.families();
    let mut detector = Detector::new(&scene.tracking, &families)?;
    let mut watch = MirrorWatch::new(&scene.tracking, families);
    let mut sightings = Sightings::of_anchors(&scene.anchors);
    let is_of = |anchor: &Anchor, seen: &Detection| {
        let mut markers = anchor.markers.iter();
        markers.any(|marker| (marker.family, marker.id) == (seen.family, seen.id))
    };
    let mut grey = Vec::new();
    for _ in 0..FIRST_FRAMES {
        let Some(frame) = source.next_frame()? else {
            break;
        };
        grey_from_rgba(&frame, &mut grey)?;
        let seen = detector.detect(&grey, frame.size_px)?;
        watch.watch(&frame, !seen.is_empty())?;
        let is_seen = |anchor: &Anchor| seen.iter().any(|seen| is_of(anchor, seen));
        if scene.anchors.iter().any(is_seen) {
            return Ok(watch.hint(scene.camera.mirror));
        }
        sightings.watch(&frame, scene.anchors.iter().map(is_seen))?;
    }
    let mirrored = watch.hint(scene.camera.mirror);
    let others = sightings.saw_others().then(|| sightings.never_found());
    Ok(mirrored.or(others.flatten()))
}
