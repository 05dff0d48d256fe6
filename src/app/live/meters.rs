//! What the live pipeline costs, frame by frame, over the last seconds.

use std::collections::VecDeque;

/// Frames that are remembered: some seconds.
const REMEMBERED: usize = 240;
/// Frames per second are counted over the last of these, seconds.
const RATE_SECS: f64 = 1.0;

/// One shown frame. Times in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// When it was shown, by the program's clock, seconds.
    pub shown_secs: f64,
    /// From the frame's coming to the beginning of its tracking.
    pub wait_ms: f64,
    /// Tracking.
    pub track_ms: f64,
    /// Upload, drawing, and what the window puts around it.
    pub draw_ms: f64,
    /// From the frame's coming until it was shown.
    pub latency_ms: f64,
}

impl Sample {
    /// What the frame spent waiting rather than being worked on.
    pub fn idle_ms(&self) -> f64 {
        (self.latency_ms - self.track_ms - self.draw_ms).max(0.0)
    }
}

/// The last frames that were shown.
#[derive(Debug, Default)]
pub struct Meters {
    samples: VecDeque<Sample>,
}

impl Meters {
    /// A frame was shown.
    pub fn push(&mut self, sample: Sample) {
        if self.samples.len() == REMEMBERED {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// The last frames, the newest last.
    pub fn samples(&self) -> impl ExactSizeIterator<Item = &Sample> {
        self.samples.iter()
    }

    /// Frames shown per second, over the last one.
    pub fn frames_per_sec(&self, now_secs: f64) -> f64 {
        let recent = self.samples.iter().rev();
        let recent = recent.take_while(|sample| now_secs - sample.shown_secs <= RATE_SECS);
        recent.count() as f64 / RATE_SECS
    }

    /// The middle one of a figure's values over the last frames; `None` before the first frame.
    pub fn median(&self, figure: impl Fn(&Sample) -> f64) -> Option<f64> {
        let mut values: Vec<f64> = self.samples.iter().map(figure).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_frames_are_remembered_and_counted() {
        let mut meters = Meters::default();
        assert_eq!(meters.median(|sample| sample.track_ms), None);
        for number in 0..1000 {
            meters.push(Sample {
                shown_secs: f64::from(number) / 25.0,
                track_ms: f64::from(number),
                draw_ms: 5.0,
                latency_ms: f64::from(number) + 7.0,
                wait_ms: 1.0,
            });
        }
        assert_eq!(meters.samples().len(), REMEMBERED);
        assert_eq!(meters.frames_per_sec(999.0 / 25.0 + 1e-9), 25.0);
        assert_eq!(meters.frames_per_sec(1e3), 0.0, "a camera that is gone");
        assert_eq!(meters.median(|sample| sample.track_ms), Some(880.0));
        assert_eq!(meters.median(Sample::idle_ms), Some(2.0));
    }
}
