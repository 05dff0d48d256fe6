//! Tells a mirrored recording: none of its frames shows a marker, but some do once they are turned left for right.

use anyhow::Result;

use crate::capture::Frame;
use crate::scene::{Family, TrackingSettings};
use crate::tracking::{Detector, grey_from_rgba};

/// A watch for mirrored recordings, which looks into a few of those frames that show nothing.
pub(crate) struct MirrorWatch {
    settings: TrackingSettings,
    families: Vec<Family>,
    /// Made for the first frame without a marker: most recordings have one in each.
    detector: Option<Detector>,
    blank_frames: u32,
    seen: bool,
    seen_mirrored: bool,
}

impl MirrorWatch {
    /// A watch for markers of families, each of which may be named more than once.
    pub(crate) fn new(settings: &TrackingSettings, families: Vec<Family>) -> Self {
        Self {
            settings: settings.clone(),
            families,
            detector: None,
            blank_frames: 0,
            seen: false,
            seen_mirrored: false,
        }
    }

    /// Takes a frame and whether it shows a marker.
    pub(crate) fn watch(&mut self, frame: &Frame, shows_marker: bool) -> Result<()> {
        self.seen |= shows_marker;
        if self.seen || self.seen_mirrored {
            return Ok(());
        }
        self.blank_frames += 1;
        // A look costs a search; a long recording gets few, all over its length.
        if self.blank_frames.is_power_of_two() {
            self.seen_mirrored = self.sees_markers_mirrored(frame)?;
        }
        Ok(())
    }

    fn sees_markers_mirrored(&mut self, frame: &Frame) -> Result<bool> {
        let detector = match &mut self.detector {
            Some(detector) => detector,
            none => none.insert(Detector::new(&self.settings, &self.families)?),
        };
        let mut mirrored = frame.clone();
        mirrored.mirror();
        let mut grey = Vec::new();
        grey_from_rgba(&mirrored, &mut grey)?;
        Ok(!detector.detect_proven(&grey, frame.size_px)?.is_empty())
    }

    /// What to say at the end: nothing unless markers were seen in mirrored frames alone. `mirror`: whether frames were
    /// mirrored already.
    pub(crate) fn hint(&self, mirror: bool) -> Option<String> {
        let advice = if mirror { "leave out" } else { "set" };
        (!self.seen && self.seen_mirrored).then(|| {
            format!(
                "markers are seen only when the pictures are turned left for right: {advice} [camera] mirror = true \
                 (without a scene: --mirror)"
            )
        })
    }
}
