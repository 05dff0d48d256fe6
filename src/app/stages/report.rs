//! What a job on a recording has to say when it is done.

use anyhow::{Result, bail};

use super::tally::Tally;
use super::tracked::Ended;
use crate::app::input::sightings::Sightings;
use crate::capture::notices_told;
use crate::scene::Anchor;

/// Markers of a size that is off by a smaller part are not worth a word.
const TOLD_SIZE_ERROR: f64 = 0.01;

/// The outcome of a job on a recording: what was done, and what was wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct Report {
    /// What was done, in words.
    pub done: String,
    /// What is worth knowing, in words.
    pub remarks: Vec<String>,
    /// What was wrong with the recording, in words.
    notices: String,
    /// What was looked for and never found, in words.
    never_found: Option<String>,
    /// Whether it was told to stop before the end.
    interrupted: bool,
}

impl Report {
    /// `mirror`: whether the frames were mirrored.
    pub(crate) fn new(
        done: String,
        mut remarks: Vec<String>,
        anchors: &[Anchor],
        (ended, tally): (&Ended, &mut Tally),
        mirror: bool,
        interrupted: bool,
    ) -> Self {
        remarks.extend(tally.hindrances(anchors));
        remarks.extend(anchors.iter().zip(&ended.size_errors).filter_map(|(anchor, error)| {
            let error = error.filter(|error| error.abs() > TOLD_SIZE_ERROR)?;
            let than = if error > 0.0 { "larger" } else { "smaller" };
            Some(format!(
                "the markers of {} are printed {:.1} % {than} than the scene says; poses allow for it, size_m is to be \
                 corrected",
                anchor.name,
                100.0 * error.abs()
            ))
        }));
        if let Some(error_px) = tally.reprojection_px().filter(|&error_px| error_px > 1.0) {
            remarks.push(format!(
                "markers lie {error_px:.1} px (median) from where their poses put them: the calibration or the \
                 markers' sizes and places in the scene are wrong"
            ));
        }
        remarks.extend(turned_words(anchors, ended));
        remarks.extend(doubled_words(anchors, ended));
        let watch = ended.mirror_watch.as_ref();
        remarks.extend(watch.and_then(|watch| watch.hint(mirror)));
        Self {
            done,
            remarks,
            notices: notices_told(&ended.notices),
            never_found: ended.sightings.as_ref().and_then(Sightings::never_found),
            interrupted,
        }
    }

    /// The same where only this was looked for and never found, in words.
    #[must_use]
    pub(crate) fn missing(self, never_found: Option<String>) -> Self {
        Self {
            never_found,
            ..self
        }
    }

    /// Whether the job was done to its end, with what was done first if it was not.
    ///
    /// # Errors
    /// An interrupt, a damaged recording, or something that was looked for and is in none of its pictures.
    pub fn conclude(&self) -> Result<()> {
        if self.interrupted {
            bail!("interrupted; what was done until then is whole");
        }
        if !self.notices.is_empty() {
            bail!(
                "the recording is damaged; all good frames were done: {}",
                self.notices
            );
        }
        if let Some(never_found) = &self.never_found {
            bail!("{never_found}");
        }
        Ok(())
    }
}

/// Boards whose markers are all turned alike.
fn turned_words(anchors: &[Anchor], ended: &Ended) -> impl Iterator<Item = String> {
    let turned = anchors.iter().zip(&ended.quarter_turns);
    turned
        .filter(|(_, turns)| **turns > 0)
        .map(|(anchor, turns)| {
            format!(
                "all markers of {} are turned by {}° against what the scene says; poses allow for it, rotation_deg (or \
                 a family's name: DICT_APRILTAG_… is OpenCV's drawing) is to be corrected",
                anchor.name,
                90 * turns
            )
        })
}

/// Anchors beside which there were other markers with their ids.
fn doubled_words(anchors: &[Anchor], ended: &Ended) -> impl Iterator<Item = String> {
    let doubled = anchors.iter().zip(&ended.doubled_frames);
    doubled
        .filter(|(_, frames)| **frames > 0)
        .map(|(anchor, frames)| {
            format!(
                "another marker with an id of {} was seen elsewhere in {frames} of the pictures that were searched; the \
                 one that fits was tracked",
                anchor.name
            )
        })
}
