//! Markers in a grey picture, by libapriltag or OpenCV's ArUco behind one small interface.

use std::cmp::Ordering;
use std::sync::LazyLock;

use glam::DVec2;

use super::TrackingError;
use super::apriltag::AprilTagDetector;
use super::aruco::ArucoDetector;
use super::belief::is_proven;
use super::light::Grey;
use super::reading::has_whole_border;
use super::refine::refined;
use crate::scene::format::{AnyKey, TRACKING};
use crate::scene::{ArucoRefinement, DetectorKind, Family, TrackingSettings};

/// A marker seen in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Family of the marker.
    pub family: Family,
    /// The marker's number in the family.
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
    /// Whether both are one marker, found twice.
    fn is_same(&self, other: &Self) -> bool {
        let mut corners = self.corners_px.iter().zip(&other.corners_px);
        (self.family, self.id) == (other.family, other.id)
            && corners.all(|(a, b)| a.distance(*b) < SAME_CORNER_PX)
    }

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

/// Corners of one marker found twice lie this near to each other, pixels.
const SAME_CORNER_PX: f64 = 5.0;

/// Grey levels halfway from their encoding to light: light itself leaves too few levels for the dark.
static LIGHT: LazyLock<[u8; 256]> = LazyLock::new(|| {
    const POWER: f64 = 1.8;
    std::array::from_fn(|level| (255.0 * (level as f64 / 255.0).powf(POWER)).round() as u8)
});

/// No marker is smaller in a picture.
const MIN_SIDE_PX: u32 = 16;

/// A detector for some families, built once and used by one thread at a time.
pub struct Detector {
    april_tag: Option<AprilTagDetector>,
    aruco: Option<ArucoDetector>,
    /// What a thorough search looks with, built when there is one for the first time.
    thorough: Thorough,
    /// A picture in another encoding.
    encoded_anew: Vec<u8>,
    /// Whether corners are fitted again in linear light.
    refines: Refines,
    corrected_bits: u32,
}

/// Whose corners are fitted again.
#[derive(Clone, Copy)]
struct Refines {
    april_tag: bool,
    aruco: bool,
}

/// What a slower search does.
#[derive(Clone, Copy, PartialEq)]
enum SearchEffort {
    FullResolution,
    LightToo,
}

enum Thorough {
    /// What the detector itself does not find, nothing does.
    Never,
    /// To be built from these.
    Later(Box<TrackingSettings>, Vec<Family>),
    /// libapriltag at full resolution.
    Ready(AprilTagDetector),
}

impl Detector {
    /// A detector for `families`, each of which may be named more than once.
    pub fn new(settings: &TrackingSettings, families: &[Family]) -> Result<Self, TrackingError> {
        check(settings)?;
        let mut families = families.to_vec();
        families.sort_unstable();
        families.dedup();
        let (tags, others): (Vec<Family>, Vec<Family>) =
            families
                .into_iter()
                .partition(|family| match settings.detector {
                    DetectorKind::ByFamily => family.is_april_tag(),
                    DetectorKind::AprilTag => true,
                    DetectorKind::Aruco => false,
                });
        let april_tag = (!tags.is_empty()).then(|| AprilTagDetector::new(settings, &tags));
        let aruco = (!others.is_empty()).then(|| ArucoDetector::new(settings, &others));
        let full = TrackingSettings {
            decimation: 1.0,
            ..settings.clone()
        };
        let refines_aruco = settings.aruco_refinement != ArucoRefinement::None;
        Ok(Self {
            thorough: match tags.is_empty() {
                true => Thorough::Never,
                false => Thorough::Later(Box::new(full), tags),
            },
            april_tag: april_tag.transpose()?,
            aruco: aruco.transpose()?,
            encoded_anew: Vec::new(),
            corrected_bits: settings.corrected_bits,
            refines: Refines {
                april_tag: settings.refine_edges,
                aruco: settings.refine_edges && refines_aruco,
            },
        })
    }

    /// The markers of an 8-bit grey picture (rows from the top, no padding), sorted by family and id.
    pub fn detect(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        if !holds_markers(grey, size_px)? {
            return Ok(Vec::new());
        }
        let tags = match &mut self.april_tag {
            Some(detector) => detector.detect(grey, size_px)?,
            None => Vec::new(),
        };
        self.finished(tags, grey, size_px)
    }

    /// As [`detect`](Self::detect), but only what this picture alone proves: of families with few bits the markers whose
    /// whole print is there, for codes of them are read in what is no marker too.
    pub fn detect_proven(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let picture = Grey {
            levels: grey,
            size_px,
        };
        let mut proven = Vec::new();
        for detection in self.detect(grey, size_px)? {
            if is_proven(picture, &detection, self.corrected_bits)? {
                proven.push(detection);
            }
        }
        Ok(proven)
    }

    /// As [`detect`](Self::detect), but at full resolution. OpenCV's ArUco finds no more than it does anyway.
    pub fn detect_at_full_resolution(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        self.detect_with(SearchEffort::FullResolution, grey, size_px)
    }

    /// As [`detect`](Self::detect), but at full resolution and at any price: in the picture as it is, and in one of
    /// light, where a marker in the shade stands out less and one in a glare more. OpenCV's ArUco finds no more than
    /// it does anyway.
    pub fn detect_thoroughly(
        &mut self,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        self.detect_with(SearchEffort::LightToo, grey, size_px)
    }

    /// Whether the slower searches can find what [`detect`](Self::detect) does not.
    pub(super) fn can_do_better(&self) -> bool {
        !matches!(self.thorough, Thorough::Never)
    }

    fn detect_with(
        &mut self,
        effort: SearchEffort,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        if let Thorough::Later(settings, families) = &self.thorough {
            self.thorough = Thorough::Ready(AprilTagDetector::new(settings, families)?);
        }
        let Thorough::Ready(detector) = &mut self.thorough else {
            return self.detect(grey, size_px);
        };
        if !holds_markers(grey, size_px)? {
            return Ok(Vec::new());
        }
        let mut tags = detector.detect(grey, size_px)?;
        if effort == SearchEffort::LightToo {
            self.encoded_anew.clear();
            let as_light = grey.iter().map(|&level| LIGHT[usize::from(level)]);
            self.encoded_anew.extend(as_light);
            for found in detector.detect(&self.encoded_anew, size_px)? {
                if !tags.iter().any(|known| known.is_same(&found)) {
                    tags.push(found);
                }
            }
        }
        self.finished(tags, grey, size_px)
    }

    /// libapriltag's detections with OpenCV's beside them, their corners fitted again, in order.
    fn finished(
        &mut self,
        tags: Vec<Detection>,
        grey: &[u8],
        size_px: [u32; 2],
    ) -> Result<Vec<Detection>, TrackingError> {
        let others = match &mut self.aruco {
            Some(detector) => detector.detect(grey, size_px)?,
            None => Vec::new(),
        };
        let picture = Grey {
            levels: grey,
            size_px,
        };
        let mut detections = Vec::with_capacity(tags.len() + others.len());
        for (found, refines) in [(tags, self.refines.april_tag), (others, self.refines.aruco)] {
            let is_finite = |corners: &[DVec2; 4]| corners.iter().all(|corner| corner.is_finite());
            let whole = found.into_iter().filter(|found| {
                is_finite(&found.corners_px)
                    && has_whole_border(picture, found.family, found.corners_px)
            });
            detections.extend(whole.map(|mut detection| {
                if refines {
                    let lighter_outside = detection.family.is_lighter_outside();
                    detection.corners_px = refined(picture, detection.corners_px, lighter_outside);
                }
                detection
            }));
        }
        // Threads may find them in any order.
        detections.sort_by(Detection::by_id_and_place);
        Ok(detections)
    }
}

/// Whether a picture is large enough; OpenCV refuses an empty one, libapriltag's tiles of thresholds need some room.
fn holds_markers(grey: &[u8], size_px: [u32; 2]) -> Result<bool, TrackingError> {
    let [width, height] = size_px;
    let fits = i32::try_from(width).is_ok() && i32::try_from(height).is_ok();
    if !fits || grey.len() as u64 != u64::from(width) * u64::from(height) {
        return Err(TrackingError::PictureSize {
            bytes: grey.len(),
            size_px,
        });
    }
    Ok(width >= MIN_SIDE_PX && height >= MIN_SIDE_PX)
}

/// What the types do not rule out; a scene's reader refuses the same with file and line.
fn check(settings: &TrackingSettings) -> Result<(), TrackingError> {
    for (key, number) in [
        (&TRACKING.decimation, settings.decimation),
        (&TRACKING.blur_px, settings.blur_px),
        (&TRACKING.min_margin, settings.min_margin),
    ] {
        wrong(key, number.to_string(), key.takes.check(number).is_err())?;
    }
    for (key, number) in [
        (&TRACKING.corrected_bits, settings.corrected_bits),
        (&TRACKING.threads, settings.threads),
    ] {
        wrong(key, number.to_string(), key.takes.check(number).is_err())?;
    }
    Ok(())
}

fn wrong(key: &dyn AnyKey, value: String, is_wrong: bool) -> Result<(), TrackingError> {
    match is_wrong {
        true => Err(TrackingError::Setting {
            name: key.name(),
            value,
            allowed: key.told(),
        }),
        false => Ok(()),
    }
}
