//! An anchor's markers and where a detector saw them: a first pose, from corners.

use glam::{DAffine3, DMat3, DVec2, DVec3};

use super::cover::Cover;
use super::marker_template::MarkerTemplate;
use super::pixel_pose::pixel_of;
use super::pose::{self, CornerObservation, Solutions};
use super::printed_marker::PrintedMarker;
use super::{Detection, LossReason, TrackingError};
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::Matrix;
use crate::scene::{Anchor, Face, Family, Marker};

/// A board's pose that leaves more than this is looked through for a marker that does not fit, pixels.
const SUSPICIOUS_RMS_PX: f64 = 1.5;

/// How near the corners of one of several markers with one id lie to where the rest of the board puts them, pixels.
const SAME_MARKER_PX: f64 = 3.0;

/// The part of its side by which a marker may lie off a pose that is roughly right.
const SAME_PART: f64 = 0.25;

/// The markers of an anchor.
pub(super) struct Layout {
    markers: Vec<Marker>,
    quarter_turns: u32,
    /// Whether they lie in one plane.
    is_flat: bool,
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

/// How a picture's detections agree with an anchor's pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Agreement {
    /// Markers that were seen where the pose puts them.
    pub(super) fitting: usize,
    /// Markers that were seen elsewhere alone.
    pub(super) elsewhere: usize,
    /// Whether one was seen there and elsewhere too.
    pub(super) doubled: bool,
}

impl Agreement {
    /// Whether as much is seen that speaks against the pose as for it.
    pub(super) fn is_contradicted(&self) -> bool {
        self.elsewhere > 0 && self.elsewhere >= self.fitting
    }
}

impl Layout {
    pub(super) fn new(anchor: &Anchor) -> Result<Self, TrackingError> {
        Self::of(anchor.markers.clone(), 0)
    }

    fn of(markers: Vec<Marker>, quarter_turns: u32) -> Result<Self, TrackingError> {
        let is_flat = Face::all_of(&markers).len() < 2;
        let templates = markers.iter().enumerate().map(|(index, marker)| {
            let printed = PrintedMarker::of(marker.family, marker.id)?;
            let mut template = MarkerTemplate::new(marker, printed);
            if !is_flat {
                template.covers = Cover::of(&markers, index);
            }
            Ok(template)
        });
        Ok(Self {
            templates: templates.collect::<Result<_, TrackingError>>()?,
            markers,
            quarter_turns,
            is_flat,
        })
    }

    /// The layout with each of its markers turned once more about its own middle.
    pub(super) fn turned_once_more(&self) -> Result<Self, TrackingError> {
        let quarter = DAffine3::from_mat3(DMat3::from_cols(DVec3::Y, -DVec3::X, DVec3::Z));
        let turned = self.markers.iter().map(|marker| Marker {
            anchor_from_marker: marker.anchor_from_marker * quarter,
            ..*marker
        });
        Self::of(turned.collect(), (self.quarter_turns + 1) % 4)
    }

    /// By how many quarter turns, counter-clockwise, its markers are turned against what the scene says.
    pub(super) fn quarter_turns(&self) -> u32 {
        self.quarter_turns
    }

    /// Whether its markers lie in one plane, which has two poses.
    pub(super) fn is_flat(&self) -> bool {
        self.is_flat
    }

    /// The family of a template's marker.
    pub(super) fn family_of(&self, template: usize) -> Family {
        self.markers[template].family
    }

    /// How many of its markers the detections show.
    pub(super) fn shown(&self, detections: &[Detection]) -> usize {
        let is_shown = |&(family, id): &(Family, u32)| {
            let mut seen = detections.iter();
            seen.any(|seen| (seen.family, seen.id) == (family, id))
        };
        self.markers().filter(is_shown).count()
    }

    /// Whether a detection is one of its markers, and where a pose puts that.
    pub(super) fn is_at(
        &self,
        intrinsics: &Intrinsics,
        pose: &DAffine3,
        detection: &Detection,
    ) -> bool {
        let mut markers = self.markers().zip(&self.templates);
        markers.any(|(marker, template)| {
            marker == (detection.family, detection.id)
                && is_near(intrinsics, pose, template, &detection.corners_px)
        })
    }

    /// How the detections agree with a pose from which the markers of `seen` were seen where it puts them.
    pub(super) fn agreement(
        &self,
        intrinsics: &Intrinsics,
        pose: &DAffine3,
        seen: &[bool],
        detections: &[Detection],
    ) -> Agreement {
        let mut agreement = Agreement::default();
        for (k, (marker, template)) in self.markers().zip(&self.templates).enumerate() {
            let of_marker = detections
                .iter()
                .filter(|detection| (detection.family, detection.id) == marker);
            let (mut near, mut far) = (0, 0);
            for detection in of_marker {
                match is_near(intrinsics, pose, template, &detection.corners_px) {
                    true => near += 1,
                    false => far += 1,
                }
            }
            let fits = near > 0 || seen.get(k) == Some(&true);
            agreement.fitting += usize::from(fits);
            agreement.elsewhere += usize::from(!fits && far > 0);
            agreement.doubled |= fits && far > 0;
        }
        agreement
    }

    /// The family and id of each template's marker.
    pub(super) fn markers(&self) -> impl Iterator<Item = (Family, u32)> {
        self.markers.iter().map(|marker| (marker.family, marker.id))
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

/// Whether corners lie where a pose puts those of a marker, as far as a pose that is roughly right would.
fn is_near(
    intrinsics: &Intrinsics,
    pose: &DAffine3,
    template: &MarkerTemplate,
    corners_px: &[DVec2; 4],
) -> bool {
    let side_px = corners_px[0].distance(corners_px[2]) / std::f64::consts::SQRT_2;
    let within_px = SAME_MARKER_PX.max(SAME_PART * side_px);
    let mut corners = template.corners_m().into_iter().zip(corners_px);
    corners.all(|(corner_m, seen_px)| {
        let place_px = pixel_of(intrinsics, pose, corner_m);
        place_px.is_some_and(|place_px| place_px.distance(*seen_px) <= within_px)
    })
}

impl SeenMarker {
    /// `None` where the lens distortion has no inverse.
    fn new(intrinsics: &Intrinsics, corners_m: [DVec3; 4], corners_px: [DVec2; 4]) -> Option<Self> {
        let [a, b, c, d] = std::array::from_fn(|k| {
            Some(CornerObservation {
                point_m: corners_m[k],
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
