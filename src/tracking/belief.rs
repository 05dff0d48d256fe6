//! Which of a detector's markers are believed at first sight, which only once they are seen again, and which never.
//!
//! What a code alone proves is the family's: of random codes `false_rate` is the part that is taken for one of its markers.
//! The fewer that are, the less has to be seen of the rest of the marker's picture (`reading.rs`).

use glam::DVec2;

use super::light::Grey;
use super::marker_template::MarkerTemplate;
use super::reading::{agreement_at_corners, agreement_of};
use super::{Detection, TrackingError};
use crate::scene::Family;

/// A marker that looks so much like itself is believed at once, whatever its family.
const AT_ONCE: f64 = 0.8;
/// Another sight of a marker that was not yet believed confirms it within this time, seconds.
const CONFIRMED_SECS: f64 = 0.5;
/// A marker is seen again where its middle lies no farther from where it was than so many of its sides.
const CONFIRMED_SIDES: f64 = 1.5;

/// What is known of markers of weak families.
pub(super) struct Belief {
    corrected_bits: u32,
    waiting: Vec<Sight>,
}

/// A marker that was seen and is not yet believed.
struct Sight {
    marker: (Family, u32),
    middle_px: DVec2,
    time_secs: f64,
}

impl Belief {
    /// `corrected_bits` are those that the detectors may correct.
    pub(super) fn new(corrected_bits: u32) -> Self {
        Self {
            corrected_bits,
            waiting: Vec::new(),
        }
    }

    /// Whether a detection is the marker of its template.
    pub(super) fn believes(
        &mut self,
        picture: Grey<'_>,
        template: &MarkerTemplate,
        detection: &Detection,
        now_secs: f64,
    ) -> bool {
        let family = detection.family;
        let corrected_bits = self.corrected_bits.min(family.correctable_bits());
        let Some(least) = least_agreement(family.false_rate(corrected_bits)) else {
            return true;
        };
        let agreement = agreement_at_corners(picture, template, detection.corners_px);
        match agreement {
            Some(agreement) if agreement >= AT_ONCE => true,
            Some(agreement) if agreement >= least => self.was_seen_before(detection, now_secs),
            _ => false,
        }
    }

    /// Markers of which no other picture has confirmed the sight yet.
    pub(super) fn unconfirmed(&self) -> impl Iterator<Item = (Family, u32)> {
        self.waiting.iter().map(|sight| sight.marker)
    }

    /// Whether an earlier picture showed the marker nearby; remembers that this one does.
    fn was_seen_before(&mut self, detection: &Detection, now_secs: f64) -> bool {
        self.waiting
            .retain(|sight| (0.0..=CONFIRMED_SECS).contains(&(now_secs - sight.time_secs)));
        let marker = (detection.family, detection.id);
        let corners_px = &detection.corners_px;
        let middle_px = corners_px.iter().sum::<DVec2>() / 4.0;
        let within_px = CONFIRMED_SIDES * corners_px[0].distance(corners_px[2]);
        let mut sights = self.waiting.iter();
        let confirmed = sights.any(|sight| {
            sight.marker == marker
                && sight.time_secs < now_secs
                && sight.middle_px.distance(middle_px) <= within_px
        });
        self.waiting.push(Sight {
            marker,
            middle_px,
            time_secs: now_secs,
        });
        confirmed
    }
}

/// Whether a single picture proves a marker: its code alone, or how much it looks like itself.
pub(super) fn is_proven(
    picture: Grey<'_>,
    detection: &Detection,
    corrected_bits: u32,
) -> Result<bool, TrackingError> {
    let family = detection.family;
    let corrected_bits = corrected_bits.min(family.correctable_bits());
    if least_agreement(family.false_rate(corrected_bits)).is_none() {
        return Ok(true);
    }
    Ok(agreement_of(picture, detection)?.is_some_and(|agreement| agreement >= AT_ONCE))
}

/// The least agreement of a marker that is believed once it is seen again; `None` where the code alone is proof. Measured on
/// photographs and films without markers of the family: 4 × 4 cells reach .65 there with a corrected bit, others .55, and
/// .742 in a film of a sheet with markers of 3 × 3 cells; of 1,613 real markers in photographs four stay below .75.
fn least_agreement(false_rate: f64) -> Option<f64> {
    match false_rate {
        rate if rate < Family::STRONG_RATE => None,
        rate if rate < 1e-3 => Some(0.5),
        rate if rate < 1e-2 => Some(0.68),
        _ => Some(0.75),
    }
}
