//! From a frame to the poses of all anchors in it.

use opencv::core::Mat;
use opencv::imgproc;

use super::followed::Followed;
use super::layout::Layout;
use super::light::Grey;
use super::pixel_pose::{PixelPose, project};
use super::{AnchorPose, Detection, Detector, TrackingError, Why};
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Search, TrackingSettings};

/// The whole picture is searched again after this, even when nothing is missing, seconds.
const SEARCH_AGAIN_SECS: f64 = 1.0;
/// An anchor that has been missing for longer than this is looked for less often, seconds,
const LONG_GONE_SECS: f64 = 3.0;
/// in one of so many frames.
const LONG_GONE_FRAMES: u32 = 3;
/// A search that puts an anchor's corners farther than this from where it was followed to has found another place,
/// pixels.
const ELSEWHERE_PX: f64 = 5.0;

/// Finds the anchors of a scene in the frames of one camera. For one thread at a time.
pub struct Tracker {
    detector: Detector,
    anchors: Vec<Followed>,
    /// Per anchor when it was looked for in vain for the first time, seconds.
    missing_since_secs: Vec<Option<f64>>,
    intrinsics: Intrinsics,
    follows: bool,
    fits_pixels: bool,
    grey: Vec<u8>,
    detections: Vec<Detection>,
    /// When the whole picture was searched last, seconds.
    searched_secs: f64,
    frames: u32,
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
        let followed = anchors.iter().map(|anchor| Ok(Followed::new(Layout::new(anchor)?)));
        Ok(Self {
            detector: Detector::new(settings, &families)?,
            anchors: followed.collect::<Result<_, TrackingError>>()?,
            missing_since_secs: vec![None; anchors.len()],
            intrinsics,
            follows: settings.search == Search::Near && settings.pose_from_pixels,
            fits_pixels: settings.pose_from_pixels,
            grey: Vec::new(),
            detections: Vec::new(),
            searched_secs: f64::NEG_INFINITY,
            frames: 0,
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
        grey_from_rgba(frame, &mut self.grey)?;
        let picture = Grey {
            levels: &self.grey,
            size_px: frame.size_px,
        };
        let now_secs = frame.time_secs;
        self.frames = self.frames.wrapping_add(1);
        for anchor in &mut self.anchors {
            anchor.forget(now_secs);
        }
        let mut found: Vec<Option<PixelPose>> = self
            .anchors
            .iter_mut()
            .map(|anchor| {
                let follows = self.follows.then_some(anchor);
                follows.and_then(|anchor| anchor.follow(picture, &self.intrinsics, now_secs))
            })
            .collect();

        if !self.needs_search(&found, now_secs) {
            self.detections.clear();
            let poses = self.anchors.iter_mut().zip(found).map(|(anchor, found)| match found {
                Some(fitted) => {
                    add_seen(&mut self.detections, &self.intrinsics, &anchor.layout, &fitted);
                    anchor.take(picture, &self.intrinsics, fitted, now_secs)
                }
                None => anchor.missed(Why::NoMarker, now_secs),
            });
            let poses = poses.collect();
            self.detections.sort_by(Detection::by_id_and_place);
            return Ok(poses);
        }
        self.searched_secs = now_secs;
        self.detections = self.detector.detect(&self.grey, frame.size_px)?;
        let poses = self
            .anchors
            .iter_mut()
            .zip(found.iter_mut())
            .zip(&mut self.missing_since_secs)
            .map(|((anchor, found), missing_since_secs)| {
                let located = anchor.layout.locate(&self.intrinsics, &self.detections);
                if let Ok(located) = &located {
                    let start = located.solutions.best.camera_from_anchor;
                    // A search that finds the anchor elsewhere is right: its codes were read, not taken for granted.
                    let elsewhere = found.as_ref().is_none_or(|followed| {
                        let here = &followed.camera_from_anchor;
                        anchor.layout.distance_px(&self.intrinsics, here, &start) > ELSEWHERE_PX
                    });
                    if self.fits_pixels && elsewhere {
                        *found = anchor.fit(picture, &self.intrinsics, start);
                    }
                }
                *missing_since_secs = match (&found, &located) {
                    (None, Err(_)) => missing_since_secs.or(Some(now_secs)),
                    _ => None,
                };
                match (found.take(), located) {
                    (Some(fitted), _) => anchor.take(picture, &self.intrinsics, fitted, now_secs),
                    (None, Ok(located)) => anchor.take_located(&located, now_secs),
                    (None, Err(why)) => anchor.missed(why, now_secs),
                }
            })
            .collect();
        Ok(poses)
    }

    /// All markers seen in the last frame, sorted by family and id: by the detector also those of no anchor, and between
    /// its searches those that were followed.
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// Per anchor by what part of their size its markers are larger than the scene says, where pictures of several of
    /// them have told.
    pub fn size_errors(&self) -> impl Iterator<Item = Option<f64>> {
        self.anchors.iter().map(Followed::size_error)
    }

    /// Whether the whole picture is to be searched.
    fn needs_search(&self, found: &[Option<PixelPose>], now_secs: f64) -> bool {
        let since_secs = now_secs - self.searched_secs;
        if !(0.0..SEARCH_AGAIN_SECS).contains(&since_secs) {
            return true;
        }
        found.iter().zip(&self.missing_since_secs).any(|(found, since_secs)| {
            let long_gone = since_secs.is_some_and(|since_secs| now_secs - since_secs > LONG_GONE_SECS);
            found.is_none() && (!long_gone || self.frames.is_multiple_of(LONG_GONE_FRAMES))
        })
    }
}

/// Adds the markers that a pose was found from, where the pose puts them.
fn add_seen(
    detections: &mut Vec<Detection>,
    intrinsics: &Intrinsics,
    layout: &Layout,
    fitted: &PixelPose,
) {
    for (((family, id), print), _) in
        layout.markers().zip(&layout.prints).zip(&fitted.seen).filter(|(_, seen)| **seen)
    {
        let corners = print
            .corners_m()
            .map(|corner_m| Some(project(intrinsics, &fitted.camera_from_anchor, corner_m)?.pixel));
        if let [Some(a), Some(b), Some(c), Some(d)] = corners {
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
