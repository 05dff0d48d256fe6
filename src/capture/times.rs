//! `times.csv` of a session: when each frame was taken.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::CaptureError;
use crate::scene::plain_file;

const HEADER: &str = "frame,time_s";
/// Thirty years; what is beyond is no time, and its differences are lost to rounding.
const LATEST_SECS: f64 = 1e9;
/// No camera is as fast.
const MOST_FPS: f64 = 1e5;
/// Steps that are shorter are no rate, but stamps that tremble.
const MOST_FINE_FPS: f64 = 1000.0;

/// Times by frame; empty where the recording says nothing.
#[derive(Debug, Default)]
pub(super) struct FrameTimes {
    secs_by_frame: BTreeMap<u32, f64>,
}

impl FrameTimes {
    pub(super) fn load(path: &Path) -> Result<Self, CaptureError> {
        let text = plain_file::read_text(path).map_err(|error| CaptureError::Io {
            path: path.to_owned(),
            error,
        })?;
        Self::parse(&text).map_err(|(line, message)| CaptureError::Times {
            path: path.to_owned(),
            line,
            message,
        })
    }

    fn parse(text: &str) -> Result<Self, (usize, String)> {
        // (Spreadsheets begin a file with a mark of its encoding.)
        let mut lines = text
            .trim_start_matches('\u{feff}')
            .lines()
            .enumerate()
            .map(|(number, line)| (number + 1, line.trim()));
        match lines.next() {
            Some((_, HEADER)) => {}
            _ => return Err((1, format!("the first line must be '{HEADER}'"))),
        }
        let mut secs_by_frame = BTreeMap::new();
        let mut last: Option<(u32, f64)> = None;
        for (number, line) in lines.filter(|(_, line)| !line.is_empty()) {
            let (frame, secs) = parse_row(line).ok_or_else(|| {
                (
                    number,
                    format!("'{line}' is not a frame's index and its time in seconds"),
                )
            })?;
            // A filter divides by the time that passed: it has to pass.
            if last.is_some_and(|(last_frame, last_secs)| frame <= last_frame || secs <= last_secs)
            {
                return Err((number, "frames and times must both increase".to_owned()));
            }
            if secs.abs() > LATEST_SECS {
                let message =
                    format!("{secs} s is no time of a recording; at most {LATEST_SECS} are read");
                return Err((number, message));
            }
            last = Some((frame, secs));
            secs_by_frame.insert(frame, secs);
        }
        let times = Self { secs_by_frame };
        // Two frames of one moment are told apart by a hair; a recording of such frames has no times.
        match times.mean_fps().filter(|fps| *fps > MOST_FPS) {
            Some(fps) if times.secs_by_frame.len() > 2 => {
                let message =
                    format!("these times come to {fps:e} frames per second, which no camera takes");
                Err((text.lines().count(), message))
            }
            _ => Ok(times),
        }
    }

    /// A frame's time; of one that the file leaves out, so many frames of `frame_secs` after (else before) the nearest that it
    /// has, for times must not go back. `None` where the file has none at all.
    pub(super) fn time_secs(&self, frame: u32, frame_secs: f64) -> Option<f64> {
        let before = self.secs_by_frame.range(..=frame).next_back();
        let after = self.secs_by_frame.range(frame..).next();
        let (near, secs) = before.or(after)?;
        let by_rate = secs + (f64::from(frame) - f64::from(*near)) * frame_secs;
        // Between two that it has it stays between them.
        Some(match (before, after) {
            (Some((first, from)), Some((last, to))) if last > first => {
                from + (to - from) * f64::from(frame - first) / f64::from(last - first)
            }
            _ => by_rate,
        })
    }

    /// Whether the recording says nothing of its times.
    pub(super) fn is_empty(&self) -> bool {
        self.secs_by_frame.is_empty()
    }

    /// What to say where the file leaves out some of so many frames.
    pub(super) fn missing(&self, frames: u32) -> Option<String> {
        let there = self.secs_by_frame.range(..frames).count() as u32;
        (there > 0 && there < frames).then(|| {
            format!(
                "it has times for {there} of {frames} frames; the others are placed by its rate"
            )
        })
    }

    /// The mean rate; `None` with less than two times, or where it is no camera's.
    pub(super) fn fps(&self) -> Option<f64> {
        self.mean_fps()
            .filter(|fps| (1e-3..=MOST_FPS).contains(fps))
    }

    /// The rate of the shortest step of all, if it is a camera's; `None` with less than two times.
    pub(super) fn finest_fps(&self) -> Option<f64> {
        let neighbours = self
            .secs_by_frame
            .iter()
            .zip(self.secs_by_frame.iter().skip(1));
        let steps_secs =
            neighbours.map(|((first, from), (last, to))| (to - from) / f64::from(last - first));
        let fps = 1.0 / steps_secs.min_by(f64::total_cmp)?;
        (fps <= MOST_FINE_FPS).then_some(fps)
    }

    fn mean_fps(&self) -> Option<f64> {
        let (first_frame, first_secs) = self.secs_by_frame.first_key_value()?;
        let (last_frame, last_secs) = self.secs_by_frame.last_key_value()?;
        (last_frame > first_frame)
            .then(|| f64::from(last_frame - first_frame) / (last_secs - first_secs))
    }
}

fn parse_row(line: &str) -> Option<(u32, f64)> {
    let (frame, secs) = line.split_once(',')?;
    let secs: f64 = secs.trim().parse().ok()?;
    secs.is_finite()
        .then_some((frame.trim().parse().ok()?, secs))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read() {
        let times =
            FrameTimes::parse("\u{feff}frame,time_s\n0,0.0\n1,0.04\n\n3, 0.12\r\n").unwrap();
        assert_eq!(times.time_secs(3, 0.1), Some(0.12));
        // Between its neighbours, and beyond the last by the rate.
        assert!((times.time_secs(2, 0.1).unwrap() - 0.08).abs() < 1e-12);
        assert!((times.time_secs(5, 0.1).unwrap() - 0.32).abs() < 1e-12);
        assert_eq!(FrameTimes::default().time_secs(5, 0.1), None);
        assert!((times.fps().unwrap() - 25.0).abs() < 1e-9);
    }

    #[test]
    fn bad_times_name_their_line() {
        for (text, line) in [
            ("", 1),
            ("time,frame\n", 1),
            ("frame,time_s\n0,0\n1,soon\n", 3),
            ("frame,time_s\n0,0\n1,NaN\n", 3),
            ("frame,time_s\n0,1\n1,1\n", 3),
            ("frame,time_s\n1,0\n0,1\n", 3),
            ("frame,time_s\n0,0\n1,1e300\n", 3),
            ("frame,time_s\n0,-1e300\n1,1\n", 2),
            ("frame,time_s\n0,0\n1,1e-300\n2,1e-299\n", 4),
        ] {
            assert_eq!(FrameTimes::parse(text).unwrap_err().0, line, "{text:?}");
        }
    }
}
