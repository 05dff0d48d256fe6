//! Markers in a grey picture, by libapriltag or OpenCV's ArUco behind one small interface.

use std::cmp::Ordering;

use glam::DVec2;

use super::TrackingError;
use super::apriltag::AprilTagDetector;
use super::aruco::ArucoDetector;
use super::light::Grey;
use super::refine::refined;
use crate::scene::{ArucoRefinement, DetectorKind, Family, TrackingSettings};

/// A marker seen in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Family of the marker.
    pub family: Family,
    /// Its number in the family.
    pub id: u32,
    /// Corners of the black square as printed: top left, top right, bottom right, bottom left; distorted pixels, a
    /// pixel's integer coordinate is its centre.
    pub corners_px: [DVec2; 4],
    /// libapriltag's decision margin; 0 from OpenCV, which tells none.
    pub margin: f64,
    /// Bits of the code that were wrong; 0 from OpenCV, which does not tell.
    pub corrected_bits: u32,
}

impl Detection {
    /// By family and id; of one id the upper left one comes first.
    pub(super) fn by_id_and_place(a: &Self, b: &Self) -> Ordering {
        let key = |detection: &Self| (detection.family, detection.id);
        let (corner_a, corner_b) = (a.corners_px[0], b.corners_px[0]);
        key(a)
            .cmp(&key(b))
            .then(corner_a.y.total_cmp(&corner_b.y))
            .then(corner_a.x.total_cmp(&corner_b.x))
    }
}

/// No marker is smaller in a picture.
const MIN_SIDE_PX: u32 = 16;

/// A detector for some families, built once and used by one thread at a time.
pub struct Detector {
    backend: Backend,
    /// Whether corners are fitted again in linear light.
    refines: bool,
}

enum Backend {
    /// Without a family there is nothing to look for.
    Idle,
    AprilTag(AprilTagDetector),
    Aruco(ArucoDetector),
}

impl Detector {
    /// A detector for `families`, each of which may be named more than once.
    pub fn new(settings: &TrackingSettings, families: &[Family]) -> Result<Self, TrackingError> {
        check(settings)?;
        let mut families = families.to_vec();
        families.sort_unstable();
        families.dedup();
        if families.is_empty() {
            return Ok(Self {
                backend: Backend::Idle,
                refines: false,
            });
        }
        let (backend, refines) = match settings.detector {
            DetectorKind::AprilTag => (
                Backend::AprilTag(AprilTagDetector::new(settings, &families)?),
                settings.refine_edges,
            ),
            DetectorKind::Aruco => (
                Backend::Aruco(ArucoDetector::new(settings, &families)?),
                settings.aruco_refinement != ArucoRefinement::None,
            ),
        };
        Ok(Self { backend, refines })
    }

    /// The markers of an 8-bit grey picture (rows from the top, no padding), sorted by family and id.
    pub fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let [width, height] = size_px;
        let fits = i32::try_from(width).is_ok() && i32::try_from(height).is_ok();
        if !fits || grey.len() as u64 != u64::from(width) * u64::from(height) {
            return Err(TrackingError::PictureSize {
                bytes: grey.len(),
                size_px,
            });
        }
        // OpenCV refuses an empty picture; libapriltag's tiles of thresholds need some room.
        if width < MIN_SIDE_PX || height < MIN_SIDE_PX {
            return Ok(Vec::new());
        }
        let mut detections = match &mut self.backend {
            Backend::Idle => Vec::new(),
            Backend::AprilTag(detector) => detector.detect(grey, size_px)?,
            Backend::Aruco(detector) => detector.detect(grey, size_px)?,
        };
        detections.retain(|detection| detection.corners_px.iter().all(|corner| corner.is_finite()));
        if self.refines {
            let picture = Grey {
                levels: grey,
                size_px,
            };
            for detection in &mut detections {
                detection.corners_px = refined(picture, detection.corners_px);
            }
        }
        // Threads may find them in any order.
        detections.sort_by(Detection::by_id_and_place);
        Ok(detections)
    }
}

/// What the types do not rule out; the scene refuses the same with file and line.
fn check(settings: &TrackingSettings) -> Result<(), TrackingError> {
    let wrong = |name, value: String, allowed| {
        Err(TrackingError::Setting {
            name,
            value,
            allowed,
        })
    };
    if !(1.0..=16.0).contains(&settings.decimation) {
        return wrong("decimation", settings.decimation.to_string(), "1 to 16");
    }
    if !(0.0..=10.0).contains(&settings.blur_px) {
        return wrong("blur_px", settings.blur_px.to_string(), "0 to 10");
    }
    if !(settings.min_margin.is_finite() && settings.min_margin >= 0.0) {
        return wrong("min_margin", settings.min_margin.to_string(), "0 or more");
    }
    if !(1..=256).contains(&settings.threads) {
        return wrong("threads", settings.threads.to_string(), "1 to 256");
    }
    Ok(())
}
