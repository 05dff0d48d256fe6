//! What ffprobe knows of a video beforehand, and of its packets when some of them are broken.

use std::collections::BTreeSet;
use std::ffi::{OsStr, OsString};
use std::io::Read;
use std::process::{Command, Stdio};
use std::sync::mpsc::channel;
use std::time::Duration;

use serde::Deserialize;

use super::log::ratio;
use crate::capture::children::RunningChild;

/// A header that takes longer does not come, nor do the packets of a whole file.
const PATIENCE: Duration = Duration::from_secs(60);
const PATIENCE_WITH_PACKETS: Duration = Duration::from_secs(1800);
/// Bytes of an answer at most: the packets of a day of video.
const MOST_ANSWER: u64 = 256 << 20;

/// What a container says of its first video.
#[derive(Debug, Default)]
pub struct Header {
    /// Frames, where the container counts them.
    pub counted_frames: Option<u32>,
    /// How long it lasts, seconds.
    pub duration_secs: Option<f64>,
    /// Frames per second, on the average or as it is said.
    pub fps: Option<f64>,
    /// The rate that the steps of its time stamps are multiples of, as far as FFmpeg has looked.
    pub fps_by_steps: Option<f64>,
    /// Rows of a frame before it is turned.
    pub lines: Option<u32>,
    /// FFmpeg's names of the container.
    pub container: String,
    /// How wide a pixel is shown for its height, where that is said.
    pub pixel_aspect: Option<f64>,
    /// Whether a frame's lines are of two moments.
    pub is_interlaced: bool,
    /// How many videos there are, cover pictures not counted.
    pub videos: usize,
}

#[derive(Deserialize)]
struct Answer {
    #[serde(default)]
    streams: Vec<Stream>,
    #[serde(default)]
    packets: Vec<Packet>,
    format: Option<Container>,
}

#[derive(Deserialize)]
struct Stream {
    height: Option<u32>,
    start_time: Option<String>,
    r_frame_rate: Option<String>,
    avg_frame_rate: Option<String>,
    duration: Option<String>,
    nb_frames: Option<String>,
    sample_aspect_ratio: Option<String>,
    field_order: Option<String>,
}

#[derive(Deserialize)]
struct Container {
    format_name: Option<String>,
    duration: Option<String>,
}

#[derive(Deserialize)]
struct Packet {
    pts_time: Option<String>,
    dts_time: Option<String>,
    #[serde(default)]
    flags: String,
}

/// An ffprobe process. Dropped, it is ended.
pub(super) struct Probe {
    running: RunningChild,
}

impl Probe {
    /// Begins to ask for the header; `None` where the program cannot be started.
    pub(super) fn start(input_options: &[&str], input: &OsStr) -> Option<Self> {
        let entries = "stream=height,start_time,r_frame_rate,avg_frame_rate,duration,nb_frames,sample_aspect_ratio,\
                       field_order:format=format_name,duration";
        Self::ask(input_options, input, ["V", entries])
    }

    fn ask(input_options: &[&str], input: &OsStr, [streams, entries]: [&str; 2]) -> Option<Self> {
        let mut command = Command::new("ffprobe");
        command
            .args(["-v", "quiet", "-select_streams", streams, "-of", "json"])
            .args(["-show_entries", entries])
            .args(input_options)
            .arg(input)
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::null());
        let running = RunningChild::start(&mut command).ok()?;
        Some(Self { running })
    }

    /// Waits for what it says of the header.
    pub(super) fn header(self) -> Option<Header> {
        header_of(&self.answer(PATIENCE)?)
    }

    /// All that it says; `None` where it says too much, or nothing for too long.
    fn answer(mut self, patience: Duration) -> Option<String> {
        let stdout = self.running.child.stdout.take()?;
        let (to_asker, answer) = channel();
        std::thread::spawn(move || {
            let mut bytes = Vec::new();
            let read = stdout.take(MOST_ANSWER + 1).read_to_end(&mut bytes);
            // The asker may have lost patience.
            _ = to_asker.send(read.map(|_| bytes));
        });
        let bytes = answer.recv_timeout(patience).ok()?.ok()?;
        let fits = bytes.len() as u64 <= MOST_ANSWER;
        fits.then(|| String::from_utf8(bytes).ok()).flatten()
    }
}

/// What an answer of ffprobe says of the header; `None` where it is none.
pub fn header_of(answer: &str) -> Option<Header> {
    let answer: Answer = serde_json::from_str(answer).ok()?;
    let videos = answer.streams.len();
    let stream = answer.streams.into_iter().next()?;
    let rate = |text: &Option<String>| {
        let rate = text.as_deref().and_then(ratio);
        rate.filter(|fps| (0.1..=1000.0).contains(fps))
    };
    let secs = |text: Option<&String>| text.and_then(|text| text.parse::<f64>().ok());
    let start_secs = secs(stream.start_time.as_ref()).map_or(0.0, |start_secs| start_secs.max(0.0));
    let container = answer.format.map(|format| {
        let name = format.format_name.unwrap_or_default();
        // Matroska's length is counted from 0, wherever its frames begin.
        let before_secs = if name.contains("matroska") {
            start_secs
        } else {
            0.0
        };
        let whole_secs = secs(format.duration.as_ref()).map(|end_secs| end_secs - before_secs);
        (name, whole_secs)
    });
    let (container, whole_secs) = container.unwrap_or_default();
    Some(Header {
        counted_frames: stream.nb_frames.and_then(|count| count.parse().ok()),
        duration_secs: secs(stream.duration.as_ref()).or(whole_secs),
        fps: nominal_fps(rate(&stream.avg_frame_rate), rate(&stream.r_frame_rate)),
        fps_by_steps: rate(&stream.r_frame_rate),
        lines: stream.height,
        pixel_aspect: stream
            .sample_aspect_ratio
            .and_then(|aspect| ratio(&aspect.replace(':', "/"))),
        is_interlaced: stream
            .field_order
            .is_some_and(|order| matches!(order.as_str(), "tt" | "bb" | "tb" | "bt")),
        container,
        videos,
    })
}

/// The average, but where it counts what is no frame (AVI with reordered frames): no more than the steps of the time stamps.
fn nominal_fps(average: Option<f64>, by_steps: Option<f64>) -> Option<f64> {
    match (average, by_steps) {
        (Some(average), Some(by_steps)) => Some(average.min(by_steps)),
        (one, other) => one.or(other),
    }
}

/// The packets of a video's first stream that hold something to be shown.
pub struct Packets {
    /// Their time stamps, microseconds.
    stamps: BTreeSet<i64>,
}

impl Packets {
    /// Reads the whole file without decoding it.
    pub(super) fn of(input_options: &[&str], input: &OsString) -> Option<Self> {
        let entries = "packet=pts_time,dts_time,flags";
        let probe = Probe::ask(input_options, input, ["V:0", entries])?;
        Self::of_answer(&probe.answer(PATIENCE_WITH_PACKETS)?)
    }

    /// Those of an answer of ffprobe; `None` where it is none.
    pub fn of_answer(answer: &str) -> Option<Self> {
        let answer: Answer = serde_json::from_str(answer).ok()?;
        let micros = |text: &String| text.parse().ok().map(micros_of);
        let stamps = answer
            .packets
            .iter()
            // An edit list hides what is marked so.
            .filter(|packet| !packet.flags.contains('D'))
            .filter_map(|packet| packet.pts_time.as_ref().or(packet.dts_time.as_ref()))
            .filter_map(micros)
            .collect();
        Some(Self { stamps })
    }

    /// How many there are between two frames, or before or after one.
    pub fn between(&self, after_secs: Option<f64>, before_secs: Option<f64>) -> u32 {
        use std::ops::Bound::{Excluded, Unbounded};
        // The stamps are written with six places.
        let slack = 1;
        let after = after_secs.map_or(Unbounded, |secs| Excluded(micros_of(secs) + slack));
        let before = before_secs.map_or(Unbounded, |secs| Excluded(micros_of(secs) - slack));
        if let (Excluded(after), Excluded(before)) = (after, before)
            && after >= before
        {
            return 0;
        }
        u32::try_from(self.stamps.range((after, before)).count()).unwrap_or(u32::MAX)
    }
}

fn micros_of(secs: f64) -> i64 {
    (secs * 1e6).round() as i64
}
