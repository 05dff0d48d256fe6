//! Markers as CSV: a row for each one that a detector saw in a frame, known to the scene or not.

use std::fmt::Write as _;

use crate::scene::Ink;
use crate::tracking::Detection;

/// The header, and so the meaning, of every row: corners as printed, from the top left clockwise, in pixels of the
/// frame as it came (distorted), a pixel's integer coordinate being its centre. `seen_by` tells who saw the marker: the
/// `detector` alone (no pose rests on it), `tracking` alone (it was followed, and the corners are where the pose puts
/// them), or `both` (the corners are the detector's).
pub const HEADER: &str = "frame,id,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px,family,border_cells,margin,\
     seen_by,inverted";

/// What the header has always begun with.
pub const FIRST_COLUMNS: &str = "frame,id,x0_px,y0_px,x1_px,y1_px,x2_px,y2_px,x3_px,y3_px,family";

/// Corners of one marker that the detector and tracking saw lie this near to each other, as a part of its side.
const SAME_PART: f64 = 0.25;

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

    /// Adds the markers of one frame: those that a detector read, and those that poses rest on.
    pub fn add_frame(&mut self, index: u32, read: &[Detection], used: &[Detection]) {
        for detection in read {
            let is_used = used.iter().any(|used| is_same(used, detection));
            self.add(index, detection, if is_used { "both" } else { "detector" });
        }
        let followed = |used: &&Detection| !read.iter().any(|read| is_same(used, read));
        for detection in used.iter().filter(followed) {
            self.add(index, detection, "tracking");
        }
    }

    fn add(&mut self, index: u32, detection: &Detection, seen_by: &str) {
        let _ = write!(self.text, "{index},{}", detection.id);
        for corner_px in detection.corners_px {
            let _ = write!(self.text, ",{:.4},{:.4}", corner_px.x, corner_px.y);
        }
        let family = detection.family;
        let _ = writeln!(
            self.text,
            ",{},{},{:.2},{seen_by},{}",
            family.name(),
            family.border_cells(),
            detection.margin,
            u8::from(family.ink() == Ink::WhiteOnBlack)
        );
    }

    /// The whole file's text.
    pub fn as_str(&self) -> &str {
        &self.text
    }
}

/// Whether two are one marker in one place.
fn is_same(a: &Detection, b: &Detection) -> bool {
    let within_px = SAME_PART * a.corners_px[0].distance(a.corners_px[1]);
    let mut corners = a.corners_px.iter().zip(&b.corners_px);
    (a.family, a.id) == (b.family, b.id) && corners.all(|(a, b)| a.distance(*b) <= within_px)
}

impl Default for DetectionsText {
    fn default() -> Self {
        Self::new()
    }
}
