//! Markers of all families that people print, for those who ask why theirs are not found.

use super::light::Grey;
use super::reading::agreement_of;
use super::{Detection, Detector, TrackingError, grey_from_rgba};
use crate::capture::Frame;
use crate::scene::{Family, Ink, TrackingSettings};

/// Of each kind of codes the family with the most markers.
const FAMILIES: [&str; 15] = [
    "tag36h11",
    "tag25h9",
    "tag16h5",
    "tag36h10",
    "tagStandard41h12",
    "tagStandard52h13",
    "tagCircle21h7",
    "tagCircle49h12",
    "tagCustom48h12",
    "DICT_ARUCO_MIP_36h12",
    "DICT_6X6_1000",
    "DICT_7X7_1000",
    "DICT_5X5_1000",
    "DICT_4X4_1000",
    "DICT_ARUCO_ORIGINAL",
];
/// A marker of any family must look like itself by this much to be named.
const LEAST_AGREEMENT: f64 = 0.75;
/// Of two markers in one place the one nearer to the other's middle than this part of its side is in its way.
const SAME_PLACE: f64 = 0.5;

/// Detectors of all families, borders and inks.
pub struct Survey {
    detector: Detector,
}

impl Survey {
    /// # Errors
    /// A failure of a library.
    pub fn new() -> Result<Self, TrackingError> {
        let known = FAMILIES.iter().filter_map(|name| Family::from_name(name));
        let mut families = Vec::new();
        for family in known {
            families.push(family);
            if !family.has_ring() {
                families.extend(family.with_border(2));
                families.push(family.with_ink(Ink::WhiteOnBlack));
            }
        }
        let settings = TrackingSettings {
            decimation: 1.0,
            corrected_bits: 0,
            ..TrackingSettings::default()
        };
        Ok(Self {
            detector: Detector::new(&settings, &families)?,
        })
    }

    /// What a picture shows for sure, at most one marker in a place: the one of the family that is hardest to mistake.
    ///
    /// # Errors
    /// A frame whose bytes do not make up its size, or a failure of a library.
    pub fn look(&mut self, frame: &Frame) -> Result<Vec<Detection>, TrackingError> {
        let mut grey = Vec::new();
        grey_from_rgba(frame, &mut grey)?;
        let picture = Grey {
            levels: &grey,
            size_px: frame.size_px,
        };
        let mut found = Vec::new();
        for detection in self.detector.detect(&grey, frame.size_px)? {
            let agreement = agreement_of(picture, &detection)?;
            if agreement.is_some_and(|agreement| agreement >= LEAST_AGREEMENT) {
                found.push(detection);
            }
        }
        found.sort_by(|a, b| a.family.false_rate(0).total_cmp(&b.family.false_rate(0)));
        let mut apart: Vec<Detection> = Vec::new();
        for detection in found {
            if !apart
                .iter()
                .any(|known| are_in_one_place(known, &detection))
            {
                apart.push(detection);
            }
        }
        Ok(apart)
    }
}

fn are_in_one_place(a: &Detection, b: &Detection) -> bool {
    let middle = |detection: &Detection| detection.corners_px.iter().sum::<glam::DVec2>() / 4.0;
    let side_px = a.corners_px[0].distance(a.corners_px[1]);
    middle(a).distance(middle(b)) < SAME_PLACE * side_px
}
