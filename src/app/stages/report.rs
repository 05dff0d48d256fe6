//! What a job on a recording has to say when it is done.

use anyhow::{Result, bail};

use super::tally::Tally;
use super::tracked::Ended;
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
    notices: Vec<String>,
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
        let watch = ended.mirror_watch.as_ref();
        remarks.extend(watch.and_then(|watch| watch.hint(mirror)));
        Self {
            done,
            remarks,
            notices: ended.notices.iter().map(ToString::to_string).collect(),
            interrupted,
        }
    }

    /// Whether the job was done to its end, with what was done first if it was not.
    ///
    /// # Errors
    /// An interrupt, or a damaged recording.
    pub fn conclude(&self) -> Result<()> {
        if self.interrupted {
            bail!("interrupted; what was done until then is whole");
        }
        if !self.notices.is_empty() {
            bail!(
                "the recording is damaged; all good frames were done: {}",
                self.notices.join("; ")
            );
        }
        Ok(())
    }
}
