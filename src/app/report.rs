//! What a job on a recording has to say when it is done.

use anyhow::{Result, bail};

use super::tracked::Ended;

/// What was done, and what was wrong.
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
    /// `mirror`: whether the frames were mirrored; `reprojection_px`: the median over the frames.
    pub(super) fn new(
        done: String,
        mut remarks: Vec<String>,
        ended: &Ended,
        mirror: bool,
        reprojection_px: Option<f64>,
        interrupted: bool,
    ) -> Self {
        if let Some(error_px) = reprojection_px.filter(|&error_px| error_px > 1.0) {
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
