//! From a frame to the poses of all anchors in it.

use std::collections::HashMap;

use super::belief::Belief;
use super::layout::{Agreement, Layout, Located};
use super::light::{Grey, grey_from_rgba};
use super::pixel_pose::{PixelPose, pixel_of};
use super::tracked_anchor::TrackedAnchor;
use super::wanted::Wanted;
use super::{AnchorPose, Detection, Detector, LossReason, TrackingError};
use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::scene::{Anchor, Family, SearchArea, TrackingSettings};

/// The whole picture is searched again after this, even when nothing is missing, seconds.
const SEARCH_AGAIN_SECS: f64 = 2.0;
/// The same where any marker may come, seconds.
const LOOK_OUT_SECS: f64 = 0.25;
/// The time after which it is searched at full resolution where any marker may come, seconds.
const LOOK_OUT_BETTER_SECS: f64 = 1.0;
/// The time after which a missing anchor is looked for in the picture of light less often, seconds; at full resolution it
/// still is in every frame.
const LONG_GONE_SECS: f64 = 10.0;
/// The time between searches in the picture of light for anchors that are long gone, seconds: each costs as much again.
const LIGHT_AGAIN_SECS: f64 = 1.0;
/// The same while there are others, where any marker may come, seconds.
const LIGHT_LOOK_OUT_SECS: f64 = 4.0;
/// A search that puts an anchor's corners farther than this from where it was tracked to has found another place,
/// pixels.
const ELSEWHERE_PX: f64 = 5.0;

/// Finds the anchors of a scene, or every marker of a family, in the frames of one camera. For one thread at a time.
pub struct Tracker {
    detector: Detector,
    wanted: Wanted,
    anchors: Vec<TrackedAnchor>,
    /// What of each anchor was noticed on the way.
    noted: Vec<Noted>,
    belief: Belief,
    intrinsics: Intrinsics,
    /// Whether anchors are looked for near where they were, before the whole picture is searched.
    tracks_near: bool,
    fits_pixels: bool,
    smooths: bool,
    grey: Vec<u8>,
    detections: Vec<Detection>,
    /// The markers that the last frame's poses rest on.
    used: Vec<Detection>,
    /// When the whole picture was searched last, at full resolution, and in the picture of light; seconds.
    searched_secs: f64,
    searched_better_secs: f64,
    searched_light_secs: f64,
}

/// What was noticed of an anchor beside its poses.
#[derive(Default, Clone)]
struct Noted {
    /// When it was looked for in vain for the first time, seconds.
    missing_since_secs: Option<f64>,
    /// Frames in which another marker with an id of its own was seen elsewhere.
    doubled_frames: u32,
}

impl Tracker {
    /// A tracker of `anchors`, however many; it is the detector's construction that takes time and may fail.
    pub fn new(
        settings: &TrackingSettings,
        anchors: &[Anchor],
        intrinsics: Intrinsics,
    ) -> Result<Self, TrackingError> {
        let mut places = HashMap::new();
        for (k, anchor) in anchors.iter().enumerate() {
            for (number, marker) in anchor.markers.iter().enumerate() {
                places.insert((marker.family, marker.id), (k, number));
            }
        }
        let families: Vec<Family> = places.keys().map(|&(family, _)| family).collect();
        let layouts = anchors.iter().map(Layout::new);
        let tracked = layouts.map(|layout| Ok(TrackedAnchor::new(layout?, settings.filter)));
        let tracked = tracked.collect::<Result<Vec<_>, TrackingError>>()?;
        let wanted = Wanted::Anchors(places);
        Self::with(settings, &families, intrinsics, wanted, tracked)
    }

    /// A tracker of every marker of a family, each an anchor of its own from when it is first seen. Two with one id are
    /// two anchors.
    pub fn of_every_marker(
        settings: &TrackingSettings,
        (family, size_m): (Family, f64),
        intrinsics: Intrinsics,
    ) -> Result<Self, TrackingError> {
        let wanted = Wanted::EveryMarker {
            family,
            size_m,
            templates: HashMap::new(),
        };
        Self::with(settings, &[family], intrinsics, wanted, Vec::new())
    }

    fn with(
        settings: &TrackingSettings,
        families: &[Family],
        intrinsics: Intrinsics,
        wanted: Wanted,
        anchors: Vec<TrackedAnchor>,
    ) -> Result<Self, TrackingError> {
        Ok(Self {
            detector: Detector::new(settings, families)?,
            wanted,
            noted: vec![Noted::default(); anchors.len()],
            anchors,
            belief: Belief::new(settings.corrected_bits),
            intrinsics,
            tracks_near: settings.search == SearchArea::Near && settings.pose_from_pixels,
            fits_pixels: settings.pose_from_pixels,
            smooths: settings.filter,
            grey: Vec::new(),
            detections: Vec::new(),
            used: Vec::new(),
            searched_secs: f64::NEG_INFINITY,
            searched_better_secs: f64::NEG_INFINITY,
            searched_light_secs: f64::NEG_INFINITY,
        })
    }

    /// From now on frames are by another camera, or by one that is known better: anchors are searched for anew.
    pub fn set_camera(&mut self, intrinsics: Intrinsics) {
        self.intrinsics = intrinsics;
        self.anchors.iter_mut().for_each(TrackedAnchor::lose);
        self.searched_secs = f64::NEG_INFINITY;
    }

    /// The poses of all anchors in the order in which they were given, or came. A marker that is not seen is no error.
    /// Frames are expected in the order of their times; one from before the last one starts the tracker anew.
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
        let mut located = Vec::new();
        if self.needs_search(&fits, now_secs) {
            located = self.search(picture, now_secs, &mut fits)?;
        }
        let intrinsics = &self.intrinsics;
        let mut poses = Vec::with_capacity(self.anchors.len());
        let mut located = located.into_iter();
        self.used.clear();
        for (anchor, fit) in self.anchors.iter_mut().zip(fits) {
            let located = located.next().unwrap_or(Err(LossReason::NoMarker));
            poses.push(match (fit, located) {
                (Some(fit), _) => {
                    let seen = seen_markers(intrinsics, &anchor.layout, &fit);
                    add_new(&mut self.detections, &seen);
                    self.used.extend(seen);
                    anchor.take(picture, intrinsics, fit, now_secs)
                }
                (None, Ok(located)) => {
                    let pose = &located.solutions.best.camera_from_anchor;
                    let is_at = |seen: &&Detection| anchor.layout.is_at(intrinsics, pose, seen);
                    self.used
                        .extend(self.detections.iter().filter(is_at).cloned());
                    anchor.take_located(intrinsics, &located, now_secs)
                }
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
        fits: &mut Vec<Option<PixelPose>>,
    ) -> Result<Vec<Result<Located, LossReason>>, TrackingError> {
        self.searched_secs = now_secs;
        let Grey { levels, size_px } = picture;
        let found = self.detector.detect(levels, size_px)?;
        self.detections = self.believed(picture, found, now_secs)?;
        if let Some(in_light_too) = self.needs_better_search(fits, now_secs) {
            self.searched_better_secs = now_secs;
            let found = if in_light_too {
                self.searched_light_secs = now_secs;
                self.detector.detect_thoroughly(levels, size_px)?
            } else {
                self.detector.detect_at_full_resolution(levels, size_px)?
            };
            self.detections = self.believed(picture, found, now_secs)?;
        }
        let owned = self.owned_detections(fits)?;
        let intrinsics = &self.intrinsics;
        let mut all_located = Vec::with_capacity(self.anchors.len());
        for (k, (anchor, fit)) in self.anchors.iter_mut().zip(fits).enumerate() {
            let detections = owned.as_ref().map_or(&self.detections, |owned| &owned[k]);
            anchor.turn_to_fit(intrinsics, detections)?;
            let mut located = anchor.layout.locate(intrinsics, detections);
            if let (Ok(found), true) = (&located, self.fits_pixels) {
                let start = found.solutions.best.camera_from_anchor;
                // A search that finds the anchor elsewhere is right, unless no fewer markers were read where it was
                // tracked to.
                let is_there = fit.as_ref().is_some_and(|fit| {
                    let here = &fit.camera_from_anchor;
                    let moved_px = anchor.layout.distance_px(intrinsics, here, &start);
                    moved_px <= ELSEWHERE_PX || fit.markers() >= found.markers
                });
                if !is_there {
                    *fit = anchor.fit(picture, intrinsics, start);
                }
            }
            let noted = &mut self.noted[k];
            if let Some(agreement) = agreement_of(anchor, intrinsics, detections, fit, &located) {
                noted.doubled_frames += u32::from(agreement.doubled);
                if agreement.is_contradicted() {
                    *fit = None;
                    located = Err(LossReason::NoPose);
                    anchor.lose();
                }
            }
            noted.missing_since_secs = match (&fit, &located) {
                (None, Err(_)) => noted.missing_since_secs.or(Some(now_secs)),
                _ => None,
            };
            all_located.push(located);
        }
        Ok(all_located)
    }

    /// Those of a detector's markers that are wanted and believed, and those that nobody wants.
    fn believed(
        &mut self,
        picture: Grey<'_>,
        found: Vec<Detection>,
        now_secs: f64,
    ) -> Result<Vec<Detection>, TrackingError> {
        let mut believed = Vec::with_capacity(found.len());
        for detection in found {
            let template = self.wanted.template_of(&self.anchors, &detection)?;
            let believes = |template| {
                self.belief
                    .believes(picture, template, &detection, now_secs)
            };
            if template.is_none_or(believes) {
                believed.push(detection);
            }
        }
        Ok(believed)
    }

    /// Where every marker is an anchor: the detection of each, and new anchors for those that are nobody's. `None` where
    /// all anchors look at all detections.
    fn owned_detections(
        &mut self,
        fits: &mut Vec<Option<PixelPose>>,
    ) -> Result<Option<Vec<Vec<Detection>>>, TrackingError> {
        let Wanted::EveryMarker { family, size_m, .. } = &self.wanted else {
            return Ok(None);
        };
        let mut owned: Vec<Vec<Detection>> = vec![Vec::new(); self.anchors.len()];
        let mut nobody_s = Vec::new();
        for detection in &self.detections {
            let is_here = |k: &usize| {
                let fit = fits[*k].as_ref();
                let layout = &self.anchors[*k].layout;
                fit.is_some_and(|fit| {
                    layout.is_at(&self.intrinsics, &fit.camera_from_anchor, detection)
                })
            };
            match (0..self.anchors.len()).find(is_here) {
                Some(k) => owned[k].push(detection.clone()),
                None => nobody_s.push(detection.clone()),
            }
        }
        for detection in nobody_s {
            let is_free = |k: &usize| {
                let mut markers = self.anchors[*k].layout.markers();
                fits[*k].is_none()
                    && owned[*k].is_empty()
                    && markers.any(|(_, id)| id == detection.id)
            };
            match (0..self.anchors.len()).find(is_free) {
                Some(k) => owned[k].push(detection),
                None => {
                    let anchor = Anchor::lone(String::new(), *family, detection.id, *size_m);
                    let layout = Layout::new(&anchor)?;
                    self.anchors.push(TrackedAnchor::new(layout, self.smooths));
                    self.noted.push(Noted::default());
                    fits.push(None);
                    owned.push(vec![detection]);
                }
            }
        }
        Ok(Some(owned))
    }

    /// All markers seen in the last frame, sorted by family and id: those of the anchors' poses, and, where the whole
    /// picture was searched, all others that were believed.
    pub fn detections(&self) -> &[Detection] {
        &self.detections
    }

    /// Markers of weak families that were seen of late and are not believed unless another picture shows them too.
    pub fn unconfirmed_markers(&self) -> impl Iterator<Item = (Family, u32)> {
        self.belief.unconfirmed()
    }

    /// The markers that the last frame's poses rest on: where the poses put them, or where a search found them.
    pub fn used_markers(&self) -> &[Detection] {
        &self.used
    }

    /// Per anchor by what part of their size its markers are larger than the scene says, where pictures of several of
    /// them have told.
    pub fn size_errors(&self) -> impl Iterator<Item = Option<f64>> {
        self.anchors.iter().map(TrackedAnchor::size_error)
    }

    /// Per anchor by how many quarter turns, counter-clockwise, all of its markers are turned against what the scene
    /// says.
    pub fn quarter_turns(&self) -> impl Iterator<Item = u32> {
        self.anchors
            .iter()
            .map(|anchor| anchor.layout.quarter_turns())
    }

    /// Per anchor the frames in which another marker with one of its ids was seen elsewhere.
    pub fn doubled_frames(&self) -> impl Iterator<Item = u32> {
        self.noted.iter().map(|noted| noted.doubled_frames)
    }

    /// Whether every marker of a family is an anchor.
    pub fn is_of_every_marker(&self) -> bool {
        matches!(self.wanted, Wanted::EveryMarker { .. })
    }

    /// The anchors where every marker is one, by the name of its number; of several with one number the later ones are
    /// `7#2`, `7#3`.
    pub fn lone_anchors(&self) -> Vec<Anchor> {
        let markers = self
            .anchors
            .iter()
            .flat_map(|anchor| anchor.layout.markers());
        self.wanted.lone_anchors(markers.map(|(_, id)| id))
    }

    /// Whether the whole picture is to be searched.
    fn needs_search(&self, fits: &[Option<PixelPose>], now_secs: f64) -> bool {
        let since_secs = now_secs - self.searched_secs;
        let again_secs = match self.wanted {
            Wanted::Anchors(_) => SEARCH_AGAIN_SECS,
            Wanted::EveryMarker { .. } => LOOK_OUT_SECS,
        };
        let is_due = !(0.0..again_secs).contains(&since_secs);
        is_due || !self.tracks_near || self.misses_one(fits)
    }

    /// Whether an anchor that is to be there was not tracked; where any marker may come, those that were just there are.
    fn misses_one(&self, fits: &[Option<PixelPose>]) -> bool {
        match self.wanted {
            Wanted::Anchors(_) => fits.iter().any(Option::is_none),
            Wanted::EveryMarker { .. } => {
                let all = self.anchors.iter().zip(fits);
                let mut missed =
                    all.filter(|(anchor, fit)| fit.is_none() && anchor.was_just_seen());
                missed.next().is_some() || fits.iter().all(Option::is_none)
            }
        }
    }

    /// Whether it is to be searched once more and better, for an anchor that is in none of what was found; and if so,
    /// whether in the picture of light too.
    fn needs_better_search(&self, fits: &[Option<PixelPose>], now_secs: f64) -> Option<bool> {
        if !self.tracks_near || !self.detector.can_do_better() {
            return None;
        }
        let is_due =
            |last_secs: f64, again_secs: f64| !(0.0..again_secs).contains(&(now_secs - last_secs));
        let light_is_due = is_due(self.searched_light_secs, LIGHT_AGAIN_SECS);
        let every_marker = matches!(self.wanted, Wanted::EveryMarker { .. });
        let all = self.anchors.iter().zip(fits).zip(&self.noted);
        let missing = all.filter(|((anchor, fit), _)| {
            let counts = !every_marker || anchor.was_just_seen();
            let located = || anchor.layout.locate(&self.intrinsics, &self.detections);
            counts && fit.is_none() && located().is_err()
        });
        let for_missing = missing
            .map(|(_, noted)| {
                let since_secs = noted.missing_since_secs;
                let gone_secs = since_secs.map_or(0.0, |since_secs| now_secs - since_secs);
                light_is_due || gone_secs <= LONG_GONE_SECS
            })
            .reduce(|a, b| a || b);
        if for_missing.is_some() || !every_marker {
            return for_missing;
        }
        if self.detections.is_empty() && fits.iter().all(Option::is_none) {
            return Some(light_is_due);
        }
        is_due(self.searched_better_secs, LOOK_OUT_BETTER_SECS)
            .then(|| is_due(self.searched_light_secs, LIGHT_LOOK_OUT_SECS))
    }
}

/// What a picture's detections say of the pose that an anchor is to have; `None` where it is to have none.
fn agreement_of(
    anchor: &TrackedAnchor,
    intrinsics: &Intrinsics,
    detections: &[Detection],
    fit: &Option<PixelPose>,
    located: &Result<Located, LossReason>,
) -> Option<Agreement> {
    let (pose, seen) = match (fit, located) {
        (Some(fit), _) => (&fit.camera_from_anchor, fit.seen.as_slice()),
        (None, Ok(located)) => (&located.solutions.best.camera_from_anchor, [].as_slice()),
        (None, Err(_)) => return None,
    };
    Some(anchor.layout.agreement(intrinsics, pose, seen, detections))
}

/// The markers that a pose was found from, where it puts them.
fn seen_markers(intrinsics: &Intrinsics, layout: &Layout, fitted: &PixelPose) -> Vec<Detection> {
    let all = layout.markers().zip(&layout.templates).zip(&fitted.seen);
    all.filter(|(_, seen)| **seen)
        .filter_map(|(((family, id), template), _)| {
            let corner = |corner_m| pixel_of(intrinsics, &fitted.camera_from_anchor, corner_m);
            let [a, b, c, d] = template.corners_m().map(corner);
            Some(Detection {
                family,
                id,
                corners_px: [a?, b?, c?, d?],
                margin: 0.0,
                corrected_bits: 0,
            })
        })
        .collect()
}

/// Adds markers of which no search found one.
fn add_new(detections: &mut Vec<Detection>, seen: &[Detection]) {
    for marker in seen {
        let is_there = |known: &Detection| (known.family, known.id) == (marker.family, marker.id);
        if !detections.iter().any(is_there) {
            detections.push(marker.clone());
        }
    }
}
