//! From a frame to the poses of all anchors in it.

use glam::{DAffine3, DVec2};
use opencv::core::Mat;
use opencv::imgproc;

use super::pose::{self, Sighting, Solutions, pixel_of, rotation_between};
use super::undistort::undistorted_pixel;
use super::{Alternative, AnchorPose, Detection, Detector, Status, TrackingError};
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Family, Marker, TrackingSettings};

/// An earlier pose decides between two poses that explain the picture equally well for this long, seconds.
const MEMORY_SECS: f64 = 0.5;

/// A board's pose that leaves more than this is looked through for a marker that does not fit, pixels.
const SUSPICIOUS_RMS_PX: f64 = 1.5;

/// Of several markers with one id the rest of the board picks the one whose corners lie this near, pixels.
const SAME_MARKER_PX: f64 = 3.0;

/// Finds the anchors of a scene in the frames of one camera. For one thread at a time.
pub struct Tracker {
    detector: Detector,
    anchors: Vec<Layout>,
    intrinsics: Intrinsics,
    grey: Vec<u8>,
    detections: Vec<Detection>,
    /// Per anchor the last pose and its time.
    last: Vec<Option<(f64, DAffine3)>>,
}

impl Tracker {
    /// A tracker of `anchors`, however many; it is the detector's construction that takes time and may fail.
    pub fn new(
        settings: &TrackingSettings,
        anchors: &[Anchor],
        intrinsics: Intrinsics,
    ) -> Result<Self, TrackingError> {
        let families = anchors
            .iter()
            .flat_map(|anchor| anchor.markers.iter().map(|marker| marker.family))
            .collect::<Vec<_>>();
        Ok(Self {
            detector: Detector::new(settings, &families)?,
            anchors: anchors.iter().map(Layout::new).collect(),
            intrinsics,
            grey: Vec::new(),
            detections: Vec::new(),
            last: vec![None; anchors.len()],
        })
    }

    /// The poses of all anchors in the order in which they were given. A marker that is not seen is no error.
    pub fn track(&mut self, frame: &Frame) -> Result<Vec<AnchorPose>, TrackingError> {
        if frame.size_px != self.intrinsics.size_px {
            return Err(TrackingError::FrameSize {
                frame_px: frame.size_px,
                calibration_px: self.intrinsics.size_px,
            });
        }
        grey_from_rgba(frame, &mut self.grey)?;
        self.detections = self.detector.detect(&self.grey, frame.size_px)?;
        let poses = self
            .anchors
            .iter()
            .zip(&mut self.last)
            .map(|(layout, last)| {
                let before = last
                    .filter(|(time_secs, _)| (frame.time_secs - time_secs).abs() <= MEMORY_SECS)
                    .map(|(_, pose)| pose);
                let pose = layout.locate(&self.intrinsics, &self.detections, before);
                if let Some(found) = pose.camera_from_anchor {
                    *last = Some((frame.time_secs, found));
                }
                pose
            })
            .collect();
        Ok(poses)
    }

    /// All markers seen in the last frame, also those of no anchor, sorted by family and id.
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }
}

/// The markers of an anchor with their corners as printed.
struct Layout {
    markers: Vec<(Family, u32, [DVec2; 4])>,
}

/// A marker of an anchor as one frame shows it.
struct SeenMarker {
    sightings: [Sighting; 4],
}

impl Layout {
    fn new(anchor: &Anchor) -> Self {
        Self {
            markers: anchor
                .markers
                .iter()
                .map(|marker| (marker.family, marker.id, printed_corners_m(marker)))
                .collect(),
        }
    }

    fn locate(
        &self,
        intrinsics: &Intrinsics,
        detections: &[Detection],
        before: Option<DAffine3>,
    ) -> AnchorPose {
        let mut seen = Vec::new();
        let mut doubled = Vec::new();
        for &(family, id, corners_m) in &self.markers {
            let start = detections
                .partition_point(|detection| (detection.family, detection.id) < (family, id));
            let mut candidates = detections[start..]
                .iter()
                .take_while(|detection| (detection.family, detection.id) == (family, id))
                .filter_map(|detection| {
                    SeenMarker::new(intrinsics, corners_m, detection.corners_px)
                })
                .collect::<Vec<_>>();
            match candidates.len() {
                0 => {}
                1 => seen.append(&mut candidates),
                _ => doubled.push(candidates),
            }
        }
        let Some(mut solutions) = solve_without_misfits(intrinsics, &mut seen) else {
            return AnchorPose::LOST;
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
        anchor_pose(&solutions, seen.len(), before)
    }
}

impl SeenMarker {
    /// `None` where the lens distortion has no inverse.
    fn new(intrinsics: &Intrinsics, corners_m: [DVec2; 4], corners_px: [DVec2; 4]) -> Option<Self> {
        let mut sightings = [Sighting {
            point_m: DVec2::ZERO,
            pixel: DVec2::ZERO,
        }; 4];
        for (sighting, (point_m, corner_px)) in sightings
            .iter_mut()
            .zip(corners_m.into_iter().zip(corners_px))
        {
            let pixel = undistorted_pixel(intrinsics, corner_px)?;
            *sighting = Sighting { point_m, pixel };
        }
        Some(Self { sightings })
    }

    /// Of the farthest corner from where the pose puts it.
    fn distance_px(&self, intrinsics: &Intrinsics, camera_from_anchor: &DAffine3) -> f64 {
        self.sightings
            .iter()
            .map(|sighting| {
                (pixel_of(intrinsics, camera_from_anchor, sighting.point_m) - sighting.pixel)
                    .length()
            })
            .fold(0.0, f64::max)
    }
}

/// Solves for all markers at once. When they do not fit together, the one without which the others do is left out
/// (a wrong id, a corner under a pencil or a shadow's edge), as long as two others agree.
fn solve_without_misfits(intrinsics: &Intrinsics, seen: &mut Vec<SeenMarker>) -> Option<Solutions> {
    let solve_for = |markers: &mut dyn Iterator<Item = &SeenMarker>| {
        let sightings = markers
            .flat_map(|marker| marker.sightings)
            .collect::<Vec<_>>();
        let solutions = pose::solve(intrinsics, &sightings)?;
        Some((solutions, solutions.best.rms_px(sightings.len())))
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

fn anchor_pose(solutions: &Solutions, markers: usize, before: Option<DAffine3>) -> AnchorPose {
    let (mut chosen, mut other) = (solutions.best, solutions.alternative);
    if let (true, Some(alternative), Some(before)) = (solutions.ambiguous, other, before)
        && rotation_between(&alternative.camera_from_anchor, &before)
            < rotation_between(&chosen.camera_from_anchor, &before)
    {
        other = Some(chosen);
        chosen = alternative;
    }
    let corners = 4 * markers;
    AnchorPose {
        status: if solutions.ambiguous {
            Status::Ambiguous
        } else {
            Status::Tracked
        },
        markers: markers as u32,
        camera_from_anchor: Some(chosen.camera_from_anchor),
        reprojection_px: chosen.rms_px(corners),
        alternative: other.map(|solution| Alternative {
            camera_from_anchor: solution.camera_from_anchor,
            reprojection_px: solution.rms_px(corners),
        }),
    }
}

/// Corners of a marker's black square in its anchor's plane: top left, top right, bottom right, bottom left.
fn printed_corners_m(marker: &Marker) -> [DVec2; 4] {
    let half_m = marker.size_m / 2.0;
    let turn = DVec2::from_angle(marker.rotation_rad);
    [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]
        .map(|corner| marker.center_m + turn.rotate(DVec2::from(corner) * half_m))
}

fn grey_from_rgba(frame: &Frame, grey: &mut Vec<u8>) -> Result<(), TrackingError> {
    let [width, height] = frame.size_px;
    let wrong_size = || TrackingError::PictureSize {
        bytes: frame.rgba.len(),
        size_px: frame.size_px,
    };
    let pixels = width as usize * height as usize;
    if frame.rgba.len() != 4 * pixels {
        return Err(wrong_size());
    }
    grey.resize(pixels, 0);
    if pixels == 0 {
        return Ok(());
    }
    let rows = i32::try_from(height).map_err(|_| wrong_size())?;
    let columns = i32::try_from(width).map_err(|_| wrong_size())?;
    let rgba = Mat::new_rows_cols_with_bytes::<opencv::core::Vec4b>(rows, columns, &frame.rgba)?;
    let mut target = Mat::new_rows_cols_with_data_mut(rows, columns, grey.as_mut_slice())?;
    imgproc::cvt_color_def(&rgba, &mut target, imgproc::COLOR_RGBA2GRAY)?;
    Ok(())
}
