//! Markers as CSV: a row for each one that a detector saw in a frame, known to the scene or not.

use std::fmt::Write as _;

use crate::tracking::Detection;

/// The header, and so the meaning, of every row: corners as printed, from the top left clockwise, in pixels of the
/// frame as it came (distorted), a pixel's integer coordinate being its centre.
pub const HEADER: &str =
    "frame,id,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px,family,border_cells,margin";

/// A detections file's text, which grows row by row; kept in memory, because the file appears whole or not at all.
pub struct DetectionsText {
    text: String,
}

impl DetectionsText {
    /// The header alone.
    pub fn new() -> Self {
        Self {
            text: format!("{HEADER}\n"),
        }
    }

    /// Adds the markers of one frame.
    pub fn add_frame(&mut self, index: u32, detections: &[Detection]) {
        for detection in detections {
            let _ = write!(self.text, "{index},{}", detection.id);
            for corner_px in detection.corners_px {
                let _ = write!(self.text, ",{:.4},{:.4}", corner_px.x, corner_px.y);
            }
            let family = detection.family;
            let _ = writeln!(
                self.text,
                ",{},{},{:.2}",
                family.name(),
                family.border_cells(),
                detection.margin
            );
        }
    }

    /// The whole file's text.
    pub fn as_str(&self) -> &str {
        &self.text
    }
}

impl Default for DetectionsText {
    fn default() -> Self {
        Self::new()
    }
}
