//! An anchor's markers and where a detector saw them: a first pose, from corners.

use glam::{DAffine3, DVec2};

use super::aruco::printed_cells;
use super::marker_template::MarkerTemplate;
use super::pixel_pose::pixel_of;
use super::pose::{self, CornerObservation, Solutions};
use super::{Detection, LossReason, TrackingError};
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::Matrix;
use crate::scene::{Anchor, Family};

/// A board's pose that leaves more than this is looked through for a marker that does not fit, pixels.
const SUSPICIOUS_RMS_PX: f64 = 1.5;

/// How near the corners of one of several markers with one id lie to where the rest of the board puts them, pixels.
const SAME_MARKER_PX: f64 = 3.0;

/// The markers of an anchor.
pub(super) struct Layout {
    markers: Vec<(Family, u32)>,
    /// The markers' templates, in the same order.
    pub(super) templates: Vec<MarkerTemplate>,
}

/// Poses that a detector's corners allow.
pub(super) struct Located {
    pub(super) solutions: Solutions,
    /// The covariance of a step from the better pose.
    pub(super) covariance: Matrix<6>,
    /// Markers that they rest on.
    pub(super) markers: usize,
}

/// A marker of an anchor as one frame shows it.
struct SeenMarker {
    observations: [CornerObservation; 4],
}

impl Layout {
    pub(super) fn new(anchor: &Anchor) -> Result<Self, TrackingError> {
        let templates = anchor.markers.iter().map(|marker| {
            Ok(MarkerTemplate::new(
                marker,
                printed_cells(marker.family, marker.id)?,
            ))
        });
        Ok(Self {
            markers: anchor
                .markers
                .iter()
                .map(|marker| (marker.family, marker.id))
                .collect(),
            templates: templates.collect::<Result<_, TrackingError>>()?,
        })
    }

    /// The family and id of each template's marker.
    pub(super) fn markers(&self) -> impl Iterator<Item = (Family, u32)> {
        self.markers.iter().copied()
    }

    /// How far the two poses put the same corner from each other at most, pixels; infinite behind the camera.
    pub(super) fn distance_px(&self, intrinsics: &Intrinsics, a: &DAffine3, b: &DAffine3) -> f64 {
        let corners = self.templates.iter().flat_map(MarkerTemplate::corners_m);
        corners
            .map(|point_m| {
                let place = |pose| pixel_of(intrinsics, pose, point_m);
                match (place(a), place(b)) {
                    (Some(a), Some(b)) => a.distance(b),
                    _ => f64::INFINITY,
                }
            })
            .fold(0.0, f64::max)
    }

    /// The poses that explain where a detector saw the anchor's markers; `detections` are sorted by family and id.
    pub(super) fn locate(
        &self,
        intrinsics: &Intrinsics,
        detections: &[Detection],
    ) -> Result<Located, LossReason> {
        let mut seen = Vec::new();
        let mut doubled = Vec::new();
        for (marker, template) in self.markers().zip(&self.templates) {
            let of = |detection: &Detection| (detection.family, detection.id);
            let start = detections.partition_point(|detection| of(detection) < marker);
            let mut candidates = detections[start..]
                .iter()
                .take_while(|detection| of(detection) == marker)
                .filter_map(|detection| {
                    SeenMarker::new(intrinsics, template.corners_m(), detection.corners_px)
                })
                .collect::<Vec<_>>();
            match candidates.len() {
                0 => {}
                1 => seen.append(&mut candidates),
                _ => doubled.push(candidates),
            }
        }
        let Some(mut solutions) = solve_without_misfits(intrinsics, &mut seen) else {
            return Err(match (seen.is_empty(), doubled.is_empty()) {
                (true, true) => LossReason::NoMarker,
                (true, false) => LossReason::DoubleId,
                (false, _) => LossReason::NoPose,
            });
        };
        // The rest of the board decides which of several markers with one id is its own.
        if !doubled.is_empty() && !solutions.ambiguous {
            let known = seen.len();
            let camera_from_anchor = solutions.best.camera_from_anchor;
            for candidates in doubled {
                let mut fitting = candidates.into_iter().filter(|marker| {
                    marker.distance_px(intrinsics, &camera_from_anchor) < SAME_MARKER_PX
                });
                if let (Some(marker), None) = (fitting.next(), fitting.next()) {
                    seen.push(marker);
                }
            }
            if seen.len() > known
                && let Some(better) = solve_without_misfits(intrinsics, &mut seen)
            {
                solutions = better;
            }
        }
        let observations: Vec<CornerObservation> =
            seen.iter().flat_map(|marker| marker.observations).collect();
        let best = &solutions.best.camera_from_anchor;
        Ok(Located {
            covariance: pose::covariance(intrinsics, &observations, best)
                .ok_or(LossReason::NoPose)?,
            solutions,
            markers: seen.len(),
        })
    }
}

impl SeenMarker {
    /// `None` where the lens distortion has no inverse.
    fn new(intrinsics: &Intrinsics, corners_m: [DVec2; 4], corners_px: [DVec2; 4]) -> Option<Self> {
        let [a, b, c, d] = std::array::from_fn(|k| {
            Some(CornerObservation {
                point_m: corners_m[k].extend(0.0),
                pixel: intrinsics.undistorted_pixel(corners_px[k])?,
            })
        });
        Some(Self {
            observations: [a?, b?, c?, d?],
        })
    }

    /// The distance of the farthest corner from where the pose puts it, pixels; infinite behind the camera.
    fn distance_px(&self, intrinsics: &Intrinsics, camera_from_anchor: &DAffine3) -> f64 {
        self.observations
            .iter()
            .map(|observation| {
                let in_camera_m = camera_from_anchor.transform_point3(observation.point_m);
                let expected_px = intrinsics.undistorted_pixel_of(in_camera_m);
                expected_px.map_or(f64::INFINITY, |pixel| pixel.distance(observation.pixel))
            })
            .fold(0.0, f64::max)
    }
}

/// Solves for all markers at once. When they do not fit together, the one without which the others do is left out
/// (a wrong id, a corner under a pencil or a shadow's edge), as long as two others agree.
fn solve_without_misfits(intrinsics: &Intrinsics, seen: &mut Vec<SeenMarker>) -> Option<Solutions> {
    let solve_for = |markers: &mut dyn Iterator<Item = &SeenMarker>| {
        let observations = markers
            .flat_map(|marker| marker.observations)
            .collect::<Vec<_>>();
        let solutions = pose::solve(intrinsics, &observations)?;
        Some((solutions, solutions.best.rms_px(observations.len())))
    };
    loop {
        let all = solve_for(&mut seen.iter());
        let rms_px = all.map_or(f64::INFINITY, |(_, rms_px)| rms_px);
        if seen.len() < 3 || rms_px <= SUSPICIOUS_RMS_PX {
            return all.map(|(solutions, _)| solutions);
        }
        let without = (0..seen.len())
            .filter_map(|left_out| {
                let mut others = seen
                    .iter()
                    .enumerate()
                    .filter(|&(k, _)| k != left_out)
                    .map(|(_, marker)| marker);
                solve_for(&mut others).map(|(_, rms_px)| (left_out, rms_px))
            })
            .min_by(|a, b| a.1.total_cmp(&b.1));
        match without {
            // A bad calibration spreads its error over all markers; one misfit stands out.
            Some((left_out, rest_px)) if rest_px < rms_px / 3.0 => {
                seen.remove(left_out);
            }
            _ => return all.map(|(solutions, _)| solutions),
        }
    }
}
