//! What a job on a recording cost, as `--stats` writes it.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::scene::{DetectorKind, Family, TrackingSettings};

/// Times of one stage over all frames, milliseconds.
#[derive(Debug, Clone, Copy, Serialize, PartialEq)]
pub struct StageTimes {
    /// The time that half of the frames keep.
    pub median_ms: f64,
    /// The time that 95 % of the frames keep.
    pub p95_ms: f64,
    /// The longest time.
    pub max_ms: f64,
    /// Frames that the stage worked on.
    pub frames: usize,
}

/// Times by stage, gathered frame by frame.
#[derive(Debug, Default)]
pub struct StageLog {
    samples_ms: BTreeMap<&'static str, Vec<f64>>,
}

impl StageLog {
    /// Notes what a stage took for one frame.
    pub fn add(&mut self, stage: &'static str, ms: f64) {
        self.samples_ms.entry(stage).or_default().push(ms);
    }

    /// The summary of each stage that worked.
    pub fn summary(&self) -> BTreeMap<&'static str, StageTimes> {
        self.samples_ms
            .iter()
            .map(|(&stage, samples)| (stage, summarise(samples)))
            .collect()
    }
}

fn summarise(samples_ms: &[f64]) -> StageTimes {
    StageTimes {
        median_ms: quantile(samples_ms, 0.5),
        p95_ms: quantile(samples_ms, 0.95),
        max_ms: quantile(samples_ms, 1.0),
        frames: samples_ms.len(),
    }
}

/// The sample that at least this part of all does not exceed; 0 where there is none.
pub fn quantile(samples: &[f64], part: f64) -> f64 {
    let mut sorted = samples.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.saturating_sub(1)).copied().unwrap_or(0.0)
}

/// The whole of `--stats`.
#[derive(Debug, Serialize)]
pub struct Stats {
    /// The recording, as the scene names it.
    pub source: String,
    /// Width and height of its pictures, pixels.
    pub size_px: [u32; 2],
    /// Frames that were read.
    pub frames: u32,
    /// Frames that were drawn and written.
    pub drawn: u32,
    /// Frames that were dropped: none in a replay, but for those the recording has lost.
    pub drops: u32,
    /// For each anchor the frames without a pose.
    pub lost: BTreeMap<String, u32>,
    /// The detector and its decimation, or where the poses came from.
    pub detector: String,
    /// How shadows were made; `None` where none are.
    pub technique: Option<&'static str>,
    /// `None` where nothing was drawn.
    pub adapter: Option<String>,
    /// Times by stage.
    pub stages: BTreeMap<&'static str, StageTimes>,
    /// From the first frame to the last file, seconds.
    pub total_secs: f64,
    /// `None` where the system does not tell.
    pub peak_memory_mib: Option<f64>,
}

impl Stats {
    /// The file's text: JSON, for people too.
    ///
    /// # Errors
    /// None, with numbers as these are.
    pub fn text(&self) -> serde_json::Result<String> {
        Ok(serde_json::to_string_pretty(self)? + "\n")
    }
}

/// The detector of `--stats` for markers of some families.
pub fn detector_in_words(tracking: &TrackingSettings, families: &[Family]) -> String {
    let april_tag = format!("apriltag, decimation {}", tracking.decimation);
    match tracking.detector {
        DetectorKind::AprilTag => april_tag,
        DetectorKind::Aruco => "aruco".to_owned(),
        DetectorKind::ByFamily => {
            let has_tags = families.iter().any(|family| family.is_april_tag());
            let has_others = families.iter().any(|family| !family.is_april_tag());
            match (has_tags, has_others) {
                (true, true) => format!("{april_tag}; aruco"),
                (false, true) => "aruco".to_owned(),
                _ => april_tag,
            }
        }
    }
}

/// The largest resident memory of this process so far, MiB (Linux).
pub fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_samples() {
        let mut log = StageLog::default();
        (1..=100)
            .rev()
            .for_each(|ms| log.add("track", f64::from(ms)));
        let times = log.summary()["track"];
        assert_eq!(
            (times.median_ms, times.p95_ms, times.max_ms),
            (50.0, 95.0, 100.0)
        );
        assert_eq!(summarise(&[3.0]).p95_ms, 3.0);
    }
}
