//! One anchor from frame to frame: predicted, found again, and which of its two poses it has.

use glam::{DAffine3, DVec2};

use super::condition::Condition;
use super::filter::Filter;
use super::flipped_pose::{FlippedPose, flipped_pose_of};
use super::layout::{Layout, Located};
use super::light::Grey;
use super::pixel_pose::{PixelPose, fit_pose, pixel_of};
use super::pose::{CornerObservation, refine};
use super::reading::{agreement, least_to_follow};
use super::template_match::{REACHES, find_shift};
use super::{Alternative, AnchorPose, Detection, LossReason, Status, TrackingError};
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::Matrix;
use crate::geometry::pose::{PoseStep, difference, moved, rotation_between};

/// The age from which on an observation decides nothing any more, seconds.
const MEMORY_SECS: f64 = 0.5;
/// A motion is believed to go on over gaps up to this, seconds.
const LONGEST_STEP_SECS: f64 = 0.15;
/// A pose is predicted without a picture for this long, and then fades, seconds.
const PREDICTED_SECS: f64 = 0.1;
/// An anchor that is not seen is gone after this, seconds.
const FADED_SECS: f64 = 0.4;
/// Without a picture a motion dies down within about this time, seconds.
const COASTING_SECS: f64 = 0.08;
/// A shift that the edges make up for themselves, pixels.
const SMALL_SHIFT_PX: f64 = 0.75;
/// A pose that moves no corner by more than this since it was shown is not shown anew, pixels.
const INVISIBLE_PX: f64 = 0.02;
/// The logarithm of the odds, 100 : 1, from which on a pose is believed to be the right one of the two.
const BELIEVED: f64 = 4.6;
/// The logarithm of the odds, 10 : 1, below which a pose that was believed is doubted again.
const DOUBTED: f64 = 2.3;
/// What a hand turns a thing beside what it did before, from one frame to the next, radians (standard deviation).
const UNFORESEEN_TURN: f64 = 0.02;
/// The most that earlier frames can say for a pose.
const MOST_ODDS: f64 = 20.0;
/// The part of the earlier frames' odds that counts in the next one.
const REMEMBERED: f64 = 0.9;
/// The part of a frame's own odds that counts: errors of neighbouring frames are not independent.
const NEW_SHARE: f64 = 0.3;

/// An anchor and what is known of it from earlier frames.
pub(super) struct TrackedAnchor {
    pub(super) layout: Layout,
    condition: Condition,
    last: Option<Observation>,
    smoothing: Option<Smoothing>,
    /// The marker that is asked for its code first.
    asked_first: usize,
}

/// What is shown of an anchor, where poses are smoothed.
struct Smoothing {
    filter: Option<Filter>,
    /// Kept as it is as long as the filter's pose looks the same.
    shown: DAffine3,
}

/// An anchor as a frame showed it.
#[derive(Clone)]
struct Observation {
    time_secs: f64,
    camera_from_anchor: DAffine3,
    motion: Motion,
    /// Variance of its turn, rad².
    turn_variance: f64,
    /// The other pose that it might have had.
    flipped: Option<DAffine3>,
    /// Logarithm of the odds for this pose against the flipped one, from all frames.
    odds: f64,
    believed: bool,
}

/// A turn (left of the rotation, rad/s) and a shift (m/s).
type Motion = PoseStep;

impl TrackedAnchor {
    pub(super) fn new(layout: Layout, smooths: bool) -> Self {
        Self {
            layout,
            condition: Condition::UNKNOWN,
            last: None,
            smoothing: smooths.then_some(Smoothing {
                filter: None,
                shown: DAffine3::IDENTITY,
            }),
            asked_first: 0,
        }
    }

    /// By what part of its size each marker is larger than the scene says, once that is known.
    pub(super) fn size_error(&self) -> Option<f64> {
        self.condition.known_size_error()
    }

    /// Forgets what is too long ago, or lies ahead in a recording that starts again.
    pub(super) fn forget(&mut self, now_secs: f64) {
        let recent = |observation: &Observation| {
            let age_secs = now_secs - observation.time_secs;
            (0.0..=MEMORY_SECS).contains(&age_secs)
        };
        if self
            .last
            .as_ref()
            .is_some_and(|observation| !recent(observation))
        {
            self.lose();
        }
    }

    /// The pose to be shown for one that was found, and its covariance.
    fn smoothed(
        &mut self,
        intrinsics: &Intrinsics,
        now_secs: f64,
        pose: DAffine3,
        covariance: Matrix<6>,
    ) -> (DAffine3, Matrix<6>) {
        let Some(Smoothing { filter, shown }) = &mut self.smoothing else {
            return (pose, covariance);
        };
        let is_new = filter.is_none();
        let filter = filter.get_or_insert_with(|| Filter::new(now_secs, pose, covariance));
        if !is_new {
            filter.add(now_secs, &pose, covariance);
        }
        // Where nothing moves, not a bit of the picture does.
        if is_new || self.layout.distance_px(intrinsics, shown, filter.pose()) > INVISIBLE_PX {
            *shown = *filter.pose();
        }
        (*shown, *filter.covariance())
    }

    /// The anchor near where its motion puts it, without a detector.
    pub(super) fn track(
        &mut self,
        picture: Grey<'_>,
        intrinsics: &Intrinsics,
        now_secs: f64,
    ) -> Option<PixelPose> {
        let predicted = self.last.as_ref()?.predicted(now_secs);
        let near = REACHES.iter().find_map(|reach| {
            let shifts: Vec<Option<DVec2>> = self
                .layout
                .templates
                .iter()
                .map(|template| find_shift(picture, intrinsics, template, &predicted, reach))
                .collect();
            shifts.iter().any(Option::is_some).then_some(shifts)
        })?;
        let start = self.shifted(intrinsics, predicted, &near)?;
        let fitted = fit_pose(
            picture,
            intrinsics,
            &self.layout.templates,
            start,
            &mut self.condition,
        )?;
        self.is_read(picture, intrinsics, &fitted).then_some(fitted)
    }

    /// Whether one of the markers that were seen can be read where the pose puts it: what moves along with a marker's
    /// edges is not yet the marker. Each frame asks another one first.
    fn is_read(&mut self, picture: Grey<'_>, intrinsics: &Intrinsics, fitted: &PixelPose) -> bool {
        let templates = &self.layout.templates;
        let count = templates.len();
        let (mut asked, mut read) = (false, false);
        self.asked_first = (self.asked_first + 1) % count.max(1);
        for k in (0..count).map(|k| (k + self.asked_first) % count) {
            if !fitted.seen[k] {
                continue;
            }
            let template = &templates[k];
            let pose = &fitted.camera_from_anchor;
            let place =
                |cells: DVec2| pixel_of(intrinsics, pose, template.point_m(cells.x, cells.y));
            if let Some(agreement) = agreement(picture, template, place) {
                asked = true;
                read = agreement >= least_to_follow(self.layout.family_of(k));
                if read {
                    break;
                }
            }
        }
        // What the picture's border cuts cannot be asked.
        read || !asked
    }

    /// Turns all its markers alike where they are seen so: a board that no pose explains as the scene has it, but one
    /// does once each of its markers is turned.
    pub(super) fn turn_to_fit(
        &mut self,
        intrinsics: &Intrinsics,
        detections: &[Detection],
    ) -> Result<(), TrackingError> {
        if self.last.is_some() || self.layout.shown(detections) < 2 {
            return Ok(());
        }
        if self.explains(&self.layout, intrinsics, detections) {
            return Ok(());
        }
        let mut turned = self.layout.turned_once_more()?;
        for _ in 0..3 {
            if self.explains(&turned, intrinsics, detections) {
                self.layout = turned;
                return Ok(());
            }
            turned = turned.turned_once_more()?;
        }
        Ok(())
    }

    /// Whether a pose puts all markers of a layout where they are seen.
    fn explains(&self, layout: &Layout, intrinsics: &Intrinsics, detections: &[Detection]) -> bool {
        let Ok(located) = layout.locate(intrinsics, detections) else {
            return false;
        };
        let pose = &located.solutions.best.camera_from_anchor;
        let agreement = layout.agreement(intrinsics, pose, &[], detections);
        agreement.elsewhere == 0 && agreement.fitting > 1
    }

    /// Forgets where it was: what is seen speaks against it.
    pub(super) fn lose(&mut self) {
        self.last = None;
        if let Some(smoothing) = &mut self.smoothing {
            smoothing.filter = None;
        }
    }

    /// Whether it was there within what is remembered.
    pub(super) fn was_just_seen(&self) -> bool {
        self.last.is_some()
    }

    /// The pose that explains by how much each marker lies from where `pose` puts it.
    fn shifted(
        &self,
        intrinsics: &Intrinsics,
        pose: DAffine3,
        shifts: &[Option<DVec2>],
    ) -> Option<DAffine3> {
        let largest_px = shifts
            .iter()
            .flatten()
            .map(|shift| shift.length())
            .fold(0.0, f64::max);
        if largest_px <= SMALL_SHIFT_PX {
            return Some(pose);
        }
        let mut observations = Vec::new();
        for (template, shift) in self.layout.templates.iter().zip(shifts) {
            let Some(shift) = shift else { continue };
            for point_m in template.corners_m() {
                let distorted_px = pixel_of(intrinsics, &pose, point_m)? + *shift;
                observations.push(CornerObservation {
                    point_m,
                    pixel: intrinsics.undistorted_pixel(distorted_px)?,
                });
            }
        }
        Some(refine(intrinsics, &observations, pose)?.camera_from_anchor)
    }

    /// The anchor's pose from the pixels around where a detector's corners put it; `None` where the pixels do not bear
    /// it out.
    pub(super) fn fit(
        &mut self,
        picture: Grey<'_>,
        intrinsics: &Intrinsics,
        start: DAffine3,
    ) -> Option<PixelPose> {
        fit_pose(
            picture,
            intrinsics,
            &self.layout.templates,
            start,
            &mut self.condition,
        )
    }

    /// The flipped pose of a board in space instead of `fitted`, where the picture has more of its markers there: of a cube
    /// of which one face is read, the wrong one of that face's poses shows faces that are not there.
    fn with_more_faces(
        &mut self,
        picture: Grey<'_>,
        intrinsics: &Intrinsics,
        fitted: PixelPose,
    ) -> PixelPose {
        if self.layout.is_flat() {
            return fitted;
        }
        let flipped = flipped_pose_of(&fitted, intrinsics, &self.layout.templates);
        let doubtful = flipped.filter(|flipped| flipped.odds < MOST_ODDS);
        let condition = self.condition;
        let other = doubtful.and_then(|flipped| {
            self.fit(picture, intrinsics, flipped.camera_from_anchor)
                .filter(|other| other.markers() > fitted.markers())
        });
        match other {
            Some(other) => other,
            None => {
                self.condition = condition;
                fitted
            }
        }
    }

    /// Takes a pose of this frame for the anchor's, or the flipped one, as this frame and the earlier ones say.
    pub(super) fn take(
        &mut self,
        picture: Grey<'_>,
        intrinsics: &Intrinsics,
        fitted: PixelPose,
        now_secs: f64,
    ) -> AnchorPose {
        let mut fitted = self.with_more_faces(picture, intrinsics, fitted);
        let mut flipped = flipped_pose_of(&fitted, intrinsics, &self.layout.templates);
        let mut odds = flipped.map_or(MOST_ODDS, |flipped| flipped.odds);
        let turn_variance = turn_variance(&fitted.covariance);
        let (mut believed, mut turns_below) = (false, 0.0);
        if let (Some(last), Some(flipped)) = (&self.last, &flipped) {
            // The earlier frames speak for the pose that theirs became, and it takes something to turn it over.
            let (here, there) = (&fitted.camera_from_anchor, &flipped.camera_from_anchor);
            odds = NEW_SHARE * odds + last.odds_of(here, there, turn_variance);
            believed = last.believed;
            let off = |pose| rotation_between(pose, &last.camera_from_anchor);
            turns_below = DOUBTED * (off(here) - off(there)).signum();
        }
        let turned = odds < turns_below;
        if let (true, Some(other)) = (turned, flipped)
            && let Some(better) = self.fit(picture, intrinsics, other.camera_from_anchor)
        {
            odds = -odds;
            flipped = Some(FlippedPose {
                camera_from_anchor: fitted.camera_from_anchor,
                odds: -other.odds,
                rms_px: fitted.rms_px,
            });
            fitted = better;
        }
        let odds = odds.clamp(-DOUBTED, MOST_ODDS);
        let believed = odds > if believed { DOUBTED } else { BELIEVED };
        let observation = Observation {
            time_secs: now_secs,
            camera_from_anchor: fitted.camera_from_anchor,
            motion: self.motion_to(&fitted.camera_from_anchor, now_secs),
            turn_variance,
            flipped: flipped.map(|flipped| flipped.camera_from_anchor),
            odds,
            believed,
        };
        self.last = Some(observation);
        let (camera_from_anchor, covariance) = self.smoothed(
            intrinsics,
            now_secs,
            fitted.camera_from_anchor,
            fitted.covariance,
        );
        AnchorPose {
            status: if believed {
                Status::Tracked
            } else {
                Status::Ambiguous
            },
            loss_reason: (!believed).then_some(LossReason::TwoPoses),
            markers: fitted.markers() as u32,
            camera_from_anchor: Some(camera_from_anchor),
            covariance: Some(covariance.0),
            // An edge tells one coordinate of a corner's two.
            reprojection_px: fitted.rms_px * std::f64::consts::SQRT_2,
            alternative: flipped.map(|flipped| Alternative {
                camera_from_anchor: flipped.camera_from_anchor,
                reprojection_px: flipped.rms_px * std::f64::consts::SQRT_2,
            }),
            visibility: 1.0,
        }
    }

    /// Takes what a detector's corners say, where the pixels have no better pose.
    pub(super) fn take_located(
        &mut self,
        intrinsics: &Intrinsics,
        located: &Located,
        now_secs: f64,
    ) -> AnchorPose {
        let solutions = &located.solutions;
        let (mut chosen, mut other) = (solutions.best, solutions.alternative);
        let before = self.last.as_ref().map(|last| last.camera_from_anchor);
        if let (true, Some(alternative), Some(before)) = (solutions.ambiguous, other, before)
            && rotation_between(&alternative.camera_from_anchor, &before)
                < rotation_between(&chosen.camera_from_anchor, &before)
        {
            other = Some(chosen);
            chosen = alternative;
        }
        let corners = 4 * located.markers;
        self.last = Some(Observation {
            time_secs: now_secs,
            camera_from_anchor: chosen.camera_from_anchor,
            motion: self.motion_to(&chosen.camera_from_anchor, now_secs),
            turn_variance: turn_variance(&located.covariance),
            flipped: other.map(|other| other.camera_from_anchor),
            odds: 0.0,
            believed: !solutions.ambiguous,
        });
        let (camera_from_anchor, covariance) = self.smoothed(
            intrinsics,
            now_secs,
            chosen.camera_from_anchor,
            located.covariance,
        );
        AnchorPose {
            status: if solutions.ambiguous {
                Status::Ambiguous
            } else {
                Status::Tracked
            },
            loss_reason: solutions.ambiguous.then_some(LossReason::TwoPoses),
            markers: located.markers as u32,
            camera_from_anchor: Some(camera_from_anchor),
            covariance: Some(covariance.0),
            reprojection_px: chosen.rms_px(corners),
            alternative: other.map(|solution| Alternative {
                camera_from_anchor: solution.camera_from_anchor,
                reprojection_px: solution.rms_px(corners),
            }),
            visibility: 1.0,
        }
    }

    /// The anchor in a frame that does not show it: predicted for a moment, fading, then lost.
    pub(super) fn missed(&self, loss_reason: LossReason, now_secs: f64) -> AnchorPose {
        let lost = AnchorPose {
            loss_reason: Some(loss_reason),
            ..AnchorPose::LOST
        };
        let Some(last) = &self.last else { return lost };
        let age_secs = now_secs - last.time_secs;
        if age_secs >= FADED_SECS {
            return lost;
        }
        AnchorPose {
            status: Status::Predicted,
            camera_from_anchor: Some(self.shown_at(last, now_secs)),
            visibility: predicted_visibility(age_secs),
            ..lost
        }
    }

    /// Where what was shown goes on to.
    fn shown_at(&self, last: &Observation, now_secs: f64) -> DAffine3 {
        match &self.smoothing {
            Some(Smoothing {
                filter: Some(filter),
                shown,
            }) => {
                let moving_secs = coasting_secs(now_secs - last.time_secs);
                moved(shown, filter.velocity().map(|speed| speed * moving_secs))
            }
            _ => last.predicted(now_secs),
        }
    }

    fn motion_to(&self, pose: &DAffine3, now_secs: f64) -> Motion {
        let Some(last) = &self.last else {
            return Motion::default();
        };
        let step_secs = now_secs - last.time_secs;
        if !(step_secs > 0.0 && step_secs <= LONGEST_STEP_SECS) {
            return Motion::default();
        }
        difference(pose, &last.camera_from_anchor).map(|step| step / step_secs)
    }
}

impl Observation {
    /// Logarithm of the odds for one of two poses that the anchor may have by now against the other: either was reached
    /// from this pose, or, where this one was the wrong one, from the flipped one. Where the two have come together, as they do
    /// when the anchor faces the camera, nobody can tell which of those that part again is which.
    fn odds_of(&self, here: &DAffine3, there: &DAffine3, turn_variance: f64) -> f64 {
        let variance = self.turn_variance + turn_variance + UNFORESEEN_TURN * UNFORESEEN_TURN;
        // Student's distribution of three degrees of freedom: hands jerk.
        let reached = |from: &DAffine3, to| {
            -2.0 * (rotation_between(from, to).powi(2) / (3.0 * variance)).ln_1p()
        };
        let doubt = REMEMBERED * self.odds;
        let likely = |pose| {
            let same = reached(&self.camera_from_anchor, pose);
            let flipped = self.flipped.as_ref();
            flipped.map_or(same, |flipped| {
                log_of_sum(same, reached(flipped, pose) - doubt)
            })
        };
        likely(here) - likely(there)
    }

    /// Where the anchor is by now.
    fn predicted(&self, now_secs: f64) -> DAffine3 {
        let moving_secs = coasting_secs(now_secs - self.time_secs);
        moved(
            &self.camera_from_anchor,
            self.motion.map(|speed| speed * moving_secs),
        )
    }
}

/// The variance of a turn, whatever its direction, rad².
fn turn_variance(covariance: &Matrix<6>) -> f64 {
    (0..3).map(|k| covariance.0[k][k]).sum()
}

/// The logarithm of a sum, ln(eᵃ + eᵇ).
fn log_of_sum(a: f64, b: f64) -> f64 {
    let (more, less) = (a.max(b), a.min(b));
    more + (less - more).exp().ln_1p()
}

/// How much of what stands on an anchor is to be shown that was seen last so many seconds ago.
pub fn predicted_visibility(age_secs: f64) -> f64 {
    ((FADED_SECS - age_secs) / (FADED_SECS - PREDICTED_SECS)).clamp(0.0, 1.0)
}

/// A motion goes on from frame to frame, and dies down where none shows it: for how long it goes on as it was.
fn coasting_secs(age_secs: f64) -> f64 {
    let unseen_secs = (age_secs - PREDICTED_SECS).max(0.0);
    age_secs.clamp(0.0, PREDICTED_SECS)
        + COASTING_SECS * (1.0 - (-unseen_secs / COASTING_SECS).exp())
}
