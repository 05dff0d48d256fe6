//! From a frame to the poses of all anchors in it.

use opencv::core::Mat;
use opencv::imgproc;

use super::layout::{Layout, Located};
use super::light::Grey;
use super::pixel_pose::{PixelPose, pixel_of};
use super::tracked_anchor::TrackedAnchor;
use super::{AnchorPose, Detection, Detector, LossReason, TrackingError};
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, SearchArea, TrackingSettings};

/// The whole picture is searched again after this, even when nothing is missing, seconds.
const SEARCH_AGAIN_SECS: f64 = 2.0;
/// The time after which a missing anchor is looked for in the picture of light less often, seconds; at full resolution it
/// still is in every frame.
const LONG_GONE_SECS: f64 = 10.0;
/// The time between searches in the picture of light for anchors that are long gone, seconds: each costs as much again.
const LIGHT_AGAIN_SECS: f64 = 1.0;
/// A search that puts an anchor's corners farther than this from where it was tracked to has found another place,
/// pixels.
const ELSEWHERE_PX: f64 = 5.0;

/// Finds the anchors of a scene in the frames of one camera. For one thread at a time.
pub struct Tracker {
    detector: Detector,
    anchors: Vec<TrackedAnchor>,
    /// Per anchor when it was looked for in vain for the first time, seconds.
    missing_since_secs: Vec<Option<f64>>,
    intrinsics: Intrinsics,
    /// Whether anchors are looked for near where they were, before the whole picture is searched.
    tracks_near: bool,
    fits_pixels: bool,
    grey: Vec<u8>,
    detections: Vec<Detection>,
    /// When the whole picture was searched last, seconds.
    searched_secs: f64,
    /// When the picture of light was, seconds.
    searched_light_secs: f64,
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
        let tracked = anchors
            .iter()
            .map(|anchor| Ok(TrackedAnchor::new(Layout::new(anchor)?, settings.filter)));
        Ok(Self {
            detector: Detector::new(settings, &families)?,
            anchors: tracked.collect::<Result<_, TrackingError>>()?,
            missing_since_secs: vec![None; anchors.len()],
            intrinsics,
            tracks_near: settings.search == SearchArea::Near && settings.pose_from_pixels,
            fits_pixels: settings.pose_from_pixels,
            grey: Vec::new(),
            detections: Vec::new(),
            searched_secs: f64::NEG_INFINITY,
            searched_light_secs: f64::NEG_INFINITY,
        })
    }

    /// The poses of all anchors in the order in which they were given. A marker that is not seen is no error. Frames
    /// are expected in the order of their times; one from before the last one starts the tracker anew.
    pub fn track(&mut self, frame: &Frame) -> Result<Vec<AnchorPose>, TrackingError> {
        if frame.size_px != self.intrinsics.size_px {
            return Err(TrackingError::FrameSize {
                frame_px: frame.size_px,
                calibration_px: self.intrinsics.size_px,
            });
        }
        let mut grey = std::mem::take(&mut self.grey);
        let poses = grey_from_rgba(frame, &mut grey).and_then(|()| {
            let picture = Grey {
                levels: &grey,
                size_px: frame.size_px,
            };
            self.track_grey(picture, frame.time_secs)
        });
        self.grey = grey;
        poses
    }

    fn track_grey(
        &mut self,
        picture: Grey<'_>,
        now_secs: f64,
    ) -> Result<Vec<AnchorPose>, TrackingError> {
        let intrinsics = &self.intrinsics;
        for anchor in &mut self.anchors {
            anchor.forget(now_secs);
        }
        let mut fits: Vec<Option<PixelPose>> = self
            .anchors
            .iter_mut()
            .map(|anchor| {
                let tracked = self.tracks_near.then_some(anchor);
                tracked.and_then(|anchor| anchor.track(picture, intrinsics, now_secs))
            })
            .collect();
        self.detections.clear();
        let located: Vec<Result<Located, LossReason>> = match self.needs_search(&fits, now_secs) {
            true => self.search(picture, now_secs, &mut fits)?,
            false => self
                .anchors
                .iter()
                .map(|_| Err(LossReason::NoMarker))
                .collect(),
        };
        let intrinsics = &self.intrinsics;
        let mut poses = Vec::with_capacity(self.anchors.len());
        for ((anchor, fit), located) in self.anchors.iter_mut().zip(fits).zip(located) {
            poses.push(match (fit, located) {
                (Some(fit), _) => {
                    add_seen(&mut self.detections, intrinsics, &anchor.layout, &fit);
                    anchor.take(picture, intrinsics, fit, now_secs)
                }
                (None, Ok(located)) => anchor.take_located(intrinsics, &located, now_secs),
                (None, Err(loss_reason)) => anchor.missed(loss_reason, now_secs),
            });
        }
        self.detections.sort_by(Detection::by_id_and_place);
        Ok(poses)
    }

    /// Searches the whole picture. Gives each anchor that was not tracked, or not to where the search has it, its pose
    /// from the pixels there; what the corners say is returned.
    fn search(
        &mut self,
        picture: Grey<'_>,
        now_secs: f64,
        fits: &mut [Option<PixelPose>],
    ) -> Result<Vec<Result<Located, LossReason>>, TrackingError> {
        self.searched_secs = now_secs;
        let Grey { levels, size_px } = picture;
        self.detections = self.detector.detect(levels, size_px)?;
        if let Some(in_light_too) = self.needs_better_search(fits, now_secs) {
            self.detections = if in_light_too {
                self.searched_light_secs = now_secs;
                self.detector.detect_thoroughly(levels, size_px)?
            } else {
                self.detector.detect_at_full_resolution(levels, size_px)?
            };
        }
        let intrinsics = &self.intrinsics;
        let mut all_located = Vec::with_capacity(self.anchors.len());
        for (k, (anchor, fit)) in self.anchors.iter_mut().zip(fits).enumerate() {
            let located = anchor.layout.locate(intrinsics, &self.detections);
            if let (Ok(located), true) = (&located, self.fits_pixels) {
                let start = located.solutions.best.camera_from_anchor;
                // A search that finds the anchor elsewhere is right: its codes were read, not taken for granted.
                let is_there = fit.as_ref().is_some_and(|fit| {
                    let here = &fit.camera_from_anchor;
                    anchor.layout.distance_px(intrinsics, here, &start) <= ELSEWHERE_PX
                });
                if !is_there {
                    *fit = anchor.fit(picture, intrinsics, start);
                }
            }
            let missing_since_secs = &mut self.missing_since_secs[k];
            *missing_since_secs = match (&fit, &located) {
                (None, Err(_)) => missing_since_secs.or(Some(now_secs)),
                _ => None,
            };
            all_located.push(located);
        }
        Ok(all_located)
    }

    /// All markers seen in the last frame, sorted by family and id: those of the anchors' poses, and, where the whole
    /// picture was searched, all others.
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// Per anchor by what part of their size its markers are larger than the scene says, where pictures of several of
    /// them have told.
    pub fn size_errors(&self) -> impl Iterator<Item = Option<f64>> {
        self.anchors.iter().map(TrackedAnchor::size_error)
    }

    /// Whether the whole picture is to be searched.
    fn needs_search(&self, fits: &[Option<PixelPose>], now_secs: f64) -> bool {
        let since_secs = now_secs - self.searched_secs;
        let is_due = !(0.0..SEARCH_AGAIN_SECS).contains(&since_secs);
        is_due || fits.iter().any(Option::is_none)
    }

    /// Whether it is to be searched once more and better, for an anchor that is in none of what was found; and if so,
    /// whether in the picture of light too.
    fn needs_better_search(&self, fits: &[Option<PixelPose>], now_secs: f64) -> Option<bool> {
        if !self.tracks_near || !self.detector.can_do_better() {
            return None;
        }
        let all = self.anchors.iter().zip(fits).zip(&self.missing_since_secs);
        let missing = all.filter(|((anchor, fit), _)| {
            let located = anchor.layout.locate(&self.intrinsics, &self.detections);
            fit.is_none() && located.is_err()
        });
        let since_secs = now_secs - self.searched_light_secs;
        let is_due = !(0.0..LIGHT_AGAIN_SECS).contains(&since_secs);
        missing
            .map(|(_, since_secs)| {
                let gone_secs = since_secs.map_or(0.0, |since_secs| now_secs - since_secs);
                is_due || gone_secs <= LONG_GONE_SECS
            })
            .reduce(|a, b| a || b)
    }
}

/// Adds the markers that a pose was found from, where the pose puts them; those that a search found are there already.
fn add_seen(
    detections: &mut Vec<Detection>,
    intrinsics: &Intrinsics,
    layout: &Layout,
    fitted: &PixelPose,
) {
    for (((family, id), template), _) in layout
        .markers()
        .zip(&layout.templates)
        .zip(&fitted.seen)
        .filter(|(_, seen)| **seen)
    {
        let corners = template
            .corners_m()
            .map(|corner_m| pixel_of(intrinsics, &fitted.camera_from_anchor, corner_m));
        let is_there = detections
            .iter()
            .any(|detection| (detection.family, detection.id) == (family, id));
        if let ([Some(a), Some(b), Some(c), Some(d)], false) = (corners, is_there) {
            detections.push(Detection {
                family,
                id,
                corners_px: [a, b, c, d],
                margin: 0.0,
                corrected_bits: 0,
            });
        }
    }
}

/// The grey levels of a frame as detectors want them: rows from the top, no padding.
///
/// # Errors
/// The frame's bytes do not make up its size.
pub fn grey_from_rgba(frame: &Frame, grey: &mut Vec<u8>) -> Result<(), TrackingError> {
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
