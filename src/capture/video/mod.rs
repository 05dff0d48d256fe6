//! A video file as a recording, decoded by an ffmpeg process: each frame with its own time stamp, its colours as the
//! stream says, its picture as it is meant to be held. A decoder that crashes or hangs does not take gnomon with it.

mod clock;
mod colours;
mod file_end;
pub mod log;
mod planes;
pub mod probe;
mod process;
pub(super) mod stream;

use std::ffi::OsString;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use super::error::{CaptureError, Notice, too_many_pixels};
use crate::scene::in_its_place::in_place_of;
use clock::Clock;
use colours::{Colours, ToSrgb};
use planes::{rgba8, rgba16};
use probe::{Header, Packets, Probe};
use process::{Decoder, MOST_PIXELS, MOST_PIXELS_OPTION, Next, NoDecoder, RawFrame};

/// For videos that do not know their own.
const ASSUMED_FPS: f64 = 30.0;
/// A playlist from a stranger must not reach into the net, and no header asks for more pixels than a camera has.
const INPUT_OPTIONS: [&str; 6] = [
    "-protocol_whitelist",
    "file",
    CLOCK_OPTIONS[0],
    CLOCK_OPTIONS[1],
    MOST_PIXELS_OPTION[0],
    MOST_PIXELS_OPTION[1],
];
const PROBE_OPTIONS: [&str; 4] = [
    "-protocol_whitelist",
    "file",
    CLOCK_OPTIONS[0],
    CLOCK_OPTIONS[1],
];
/// Stamps as they are stored: a step back, where recordings were put one after the other, would be taken for the overflow of a
/// clock that runs for a day.
const CLOCK_OPTIONS: [&str; 2] = ["-correct_ts_overflow", "0"];

/// A frame's place in the recording.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub index: u32,
    /// Since the first frame, by the stream's own time stamps, seconds.
    pub time_secs: f64,
}

pub(super) struct VideoFrames {
    path: PathBuf,
    input: OsString,
    decoder: Decoder,
    header: Header,
    size_px: [u32; 2],
    /// The first frame is decoded when the video is opened, and waits.
    waiting: Option<RawFrame>,
    clock: Clock,
    conversion: Conversion,
    remark: Option<String>,
    damage: Damage,
    next_index: u32,
    good_frames: u32,
    ended: bool,
    /// Whether the file ends before its video does, though ffmpeg may not say so.
    is_file_cut_off: bool,
}

/// What is known of what is wrong with the file.
#[derive(Default)]
struct Damage {
    /// What ffmpeg said first; without it nothing is damaged.
    complaint: Option<String>,
    /// What the decoder could not decode first, and the frame that came next.
    fault: Option<(u32, String)>,
    packets: Option<Option<Packets>>,
    corrupt: u32,
    first_corrupt: u32,
}

impl Damage {
    fn complained(&mut self, words: String) {
        self.complaint.get_or_insert(words);
    }

    fn failed(&mut self, near: u32, words: String) {
        self.fault.get_or_insert_with(|| (near, words.clone()));
        self.complained(words);
    }
}

impl VideoFrames {
    pub(super) fn open(path: &Path) -> Result<Self, CaptureError> {
        if is_playlist(path) {
            return Err(no_video(
                path,
                Some("it is a list of other files".to_owned()),
            ));
        }
        // An absolute path cannot be taken for a protocol ("a:b.mp4") or an option.
        let absolute = std::path::absolute(path).map_err(|error| CaptureError::Io {
            path: path.to_owned(),
            error,
        })?;
        let mut input = OsString::from("file:");
        input.push(absolute);
        let probe = Probe::start(&PROBE_OPTIONS, &input);
        let mut decoder =
            Decoder::start(&INPUT_OPTIONS, &input).map_err(|error| no_decoder(path, error))?;
        let mut damage = Damage::default();
        let waiting = loop {
            match decoder.next() {
                Next::Frame(frame) => break frame,
                Next::Complaint(words) => damage.complained(words),
                Next::Fault(words) => damage.failed(0, words),
                Next::End => return Err(no_frame(path, &decoder, damage.complaint)),
            }
        };
        let header = probe.and_then(Probe::header).unwrap_or_default();
        // A stream that was taken up in its middle begins with what cannot be decoded.
        if header.container.contains("mpeg") {
            damage.fault = None;
        }
        // A text is a picture of letters to ffmpeg.
        if header.container == "tty" {
            return Err(no_video(path, None));
        }
        let mut video = Self {
            path: path.to_owned(),
            input,
            size_px: waiting.size_px,
            waiting: Some(waiting),
            clock: Clock::new(1.0 / header.fps.unwrap_or(ASSUMED_FPS)),
            header,
            decoder,
            conversion: Conversion::default(),
            remark: None,
            damage,
            next_index: 0,
            good_frames: 0,
            ended: false,
            is_file_cut_off: false,
        };
        video.remark = video.first_remark();
        Ok(video)
    }

    /// What the first frame and the header tell.
    fn first_remark(&self) -> Option<String> {
        let (_, layout, [_, lines]) = self.decoder.pixels()?;
        let tags = &self.waiting.as_ref()?.colours;
        let of_light = Colours::of(tags, layout, lines).remark();
        let remarks: Vec<String> = of_light
            .map(str::to_owned)
            .into_iter()
            .chain(colours::remark_of_matrix(tags, layout))
            .chain(header_remarks(&self.header))
            .collect();
        (!remarks.is_empty()).then(|| remarks.join("; "))
    }

    /// Frames that the container counts, or else what its length and rate come to.
    pub(super) fn announced_frames(&self) -> Option<u32> {
        self.header.counted_frames.or_else(|| {
            let frames = (self.header.duration_secs? * self.header.fps?).round();
            (1.0..1e9).contains(&frames).then_some(frames as u32)
        })
    }

    /// The nominal rate; frames come at their own times.
    pub(super) fn fps(&self) -> f64 {
        self.header.fps.unwrap_or(ASSUMED_FPS)
    }

    /// The rate that all steps of the time stamps are multiples of, where that is finer.
    pub(super) fn finest_fps(&self) -> f64 {
        self.header.fps_by_steps.unwrap_or(0.0).max(self.fps())
    }

    pub(super) fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    /// What is done to it that a user should know.
    pub(super) fn remark(&self) -> Option<&str> {
        self.remark.as_deref()
    }

    /// How many frames so far had no time of their own.
    pub(super) fn moved_frames(&self) -> u32 {
        self.clock.moved_frames
    }

    pub(super) fn next_picture(
        &mut self,
        notices: &mut Vec<Notice>,
    ) -> Result<Option<(Place, Vec<u8>)>, CaptureError> {
        while !self.ended {
            let Some(frame) = self.next_decoded() else {
                self.ended = true;
                self.is_file_cut_off = file_end::is_cut_off(&self.path);
                self.tell_end(notices);
                break;
            };
            let index = self.index_of(&frame, notices);
            self.next_index = index + 1;
            let time_secs = self.clock.time_secs(frame.stamp_secs);
            if frame.size_px != self.size_px {
                notices.push(Notice::OtherSize {
                    path: self.path.clone(),
                    frame: index,
                    size_px: frame.size_px,
                    expected_px: self.size_px,
                });
                continue;
            }
            if frame.corrupt {
                if self.damage.corrupt == 0 {
                    self.damage.first_corrupt = index;
                }
                self.damage.corrupt += 1;
            }
            self.good_frames += 1;
            let lines = self.header.lines;
            let rgba = self
                .conversion
                .rgba_of(&self.decoder, &frame, lines)
                .map_err(|message| CaptureError::Pixels {
                    path: self.path.clone(),
                    frame: index,
                    message,
                })?;
            return Ok(Some((Place { index, time_secs }, rgba)));
        }
        Ok(None)
    }

    fn next_decoded(&mut self) -> Option<RawFrame> {
        if let Some(waiting) = self.waiting.take() {
            return Some(waiting);
        }
        loop {
            match self.decoder.next() {
                Next::Frame(frame) => return Some(frame),
                Next::Complaint(words) => self.damage.complained(words),
                Next::Fault(words) => self.damage.failed(self.next_index, words),
                Next::End => return None,
            }
        }
    }

    /// The index counts frames. Where ffmpeg complains, the file's packets tell which of them gave no frame.
    fn index_of(&mut self, frame: &RawFrame, notices: &mut Vec<Notice>) -> u32 {
        let counted = self.next_index;
        let Some(stamp_secs) = frame.stamp_secs else {
            return counted;
        };
        // Nor is a frame lost that refers to others before a cut.
        let is_taken_up = counted == 0 && self.damage.fault.is_none();
        if is_taken_up {
            return counted;
        }
        let lost = self.lost_between(self.clock.last_stamp_secs, Some(stamp_secs));
        self.tell_lost(lost, notices);
        counted + lost
    }

    fn lost_between(&mut self, after_secs: Option<f64>, before_secs: Option<f64>) -> u32 {
        if self.damage.complaint.is_none() {
            return 0;
        }
        let input = &self.input;
        let packets = self
            .damage
            .packets
            .get_or_insert_with(|| Packets::of(&PROBE_OPTIONS, input));
        packets
            .as_ref()
            .map_or(0, |packets| packets.between(after_secs, before_secs))
    }

    fn tell_lost(&self, count: u32, notices: &mut Vec<Notice>) {
        if count > 0 {
            notices.push(Notice::Broken {
                path: self.path.clone(),
                first: self.next_index,
                count,
                good_before: self.good_frames,
            });
        }
    }

    fn tell_end(&mut self, notices: &mut Vec<Notice>) {
        self.tell_what_ended(notices);
        // What is told already needs no second word.
        if let Some((near, said)) = self.damage.fault.take().filter(|_| notices.is_empty()) {
            notices.push(Notice::Faulty {
                path: self.path.clone(),
                near,
                said,
            });
        }
    }

    fn tell_what_ended(&mut self, notices: &mut Vec<Notice>) {
        if self.damage.corrupt > 0 {
            notices.push(Notice::Corrupt {
                path: self.path.clone(),
                first: self.damage.first_corrupt,
                count: self.damage.corrupt,
            });
        }
        if let Some(announced) = self.cut_off() {
            notices.push(Notice::EndedEarly {
                path: self.path.clone(),
                good: self.good_frames,
                ended_at: self.next_index,
                announced,
            });
            return;
        }
        let after_last = self.lost_between(self.clock.last_stamp_secs, None);
        self.tell_lost(after_last, notices);
        if notices.is_empty() && self.is_file_cut_off {
            notices.push(Notice::CutOff {
                path: self.path.clone(),
                good: self.good_frames,
            });
        }
    }

    /// How many frames the header says, where the file ends before them.
    fn cut_off(&self) -> Option<u32> {
        let announced = self.announced_frames()?;
        let may_be_cut = self.damage.complaint.is_some() || self.is_file_cut_off;
        let length_secs = self.header.duration_secs? - self.clock.length_secs();
        let slack_frames = match self.header.counted_frames {
            Some(_) => 1.5,
            // A length may be that of the sound.
            None => 2.5 + f64::from(announced) / 100.0,
        };
        let ends_early = length_secs * self.fps() > slack_frames;
        (may_be_cut && ends_early && self.next_index < announced).then_some(announced)
    }
}

/// What a header says that a user has to know.
fn header_remarks(header: &Header) -> impl Iterator<Item = String> {
    let aspect = header
        .pixel_aspect
        .filter(|aspect| (aspect - 1.0).abs() > 1e-3);
    let of_aspect = aspect.map(|aspect| {
        format!(
            "its pixels are shown {aspect:.3} times as wide as high, and taken as they are stored: it needs a calibration of \
             the same camera and mode"
        )
    });
    let of_fields = header.is_interlaced.then(|| {
        "it is interlaced: each of its pictures is of two moments, so what moves is combed (ffmpeg -i IN -vf yadif OUT \
         mends that)"
            .to_owned()
    });
    let of_others = (header.videos > 1).then(|| {
        format!(
            "it holds {} videos, of which the first is taken (ffmpeg -i IN -map 0:V:1 -c copy OUT brings the second)",
            header.videos
        )
    });
    of_aspect.into_iter().chain(of_fields).chain(of_others)
}

/// From decoded pixels to sRGB.
#[derive(Default)]
struct Conversion {
    to_srgb: Option<ToSrgb>,
}

impl Conversion {
    /// sRGB of the frame whose pixels the decoder has at hand. `lines`: the rows of the stream's pictures.
    fn rgba_of(
        &mut self,
        decoder: &Decoder,
        frame: &RawFrame,
        lines: Option<u32>,
    ) -> Result<Vec<u8>, String> {
        let (pixels, layout, size_px) = decoder.pixels().ok_or("no pixels came")?;
        let colours = Colours::of(&frame.colours, layout, lines.unwrap_or(size_px[1]));
        if colours.is_srgb() {
            return rgba8(pixels, layout, size_px, colours.coding)
                .map_err(|error| error.to_string());
        }
        let coded =
            rgba16(pixels, layout, size_px, colours.coding).map_err(|error| error.to_string())?;
        let largest = layout.largest();
        let known = self.to_srgb.take();
        let to_srgb = known
            .filter(|known| known.fits(colours, largest))
            .unwrap_or_else(|| ToSrgb::new(colours, largest));
        Ok(self.to_srgb.insert(to_srgb).rgba(&coded))
    }
}

/// Whether a file is a list of other files or addresses, which a stranger's file does not make gnomon open.
fn is_playlist(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(64).read_to_end(&mut head));
    let text = head
        .strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(&head)
        .trim_ascii_start();
    let heads: [&[u8]; 5] = [b"#EXTM3U", b"ffconcat", b"<?xml", b"<MPD", b"v=0"];
    read.is_ok() && heads.iter().any(|head| text.starts_with(head))
}

fn no_decoder(path: &Path, error: NoDecoder) -> CaptureError {
    let error = match error {
        NoDecoder::Missing(error) => error,
        NoDecoder::NoPipe => std::io::Error::other("its output cannot be reached"),
    };
    CaptureError::FfmpegMissing {
        path: path.to_owned(),
        error,
    }
}

fn no_frame(path: &Path, decoder: &Decoder, complaint: Option<String>) -> CaptureError {
    match decoder.opened {
        true if decoder.has_video => CaptureError::NoGoodFrame {
            path: path.to_owned(),
            why: complaint
                .filter(|words| words.contains("max pixel count"))
                .map_or(String::new(), |_| too_many_pixels(MOST_PIXELS)),
        },
        true if decoder.has_streams => CaptureError::SoundAlone {
            path: path.to_owned(),
        },
        _ => no_video(path, complaint),
    }
}

fn no_video(path: &Path, complaint: Option<String>) -> CaptureError {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(256).read_to_end(&mut head));
    let complaint = match in_place_of(&head) {
        Some(what) => Some(what.to_owned()),
        None if read.is_ok() && head.is_empty() => Some("the file is empty".to_owned()),
        None => complaint,
    };
    CaptureError::NotAVideo {
        path: path.to_owned(),
        said: complaint.map_or(String::new(), |words| format!(": {words}")),
    }
}

#[cfg(test)]
mod tests;
