//! A stream from an address, decoded by ffmpeg. Its frames have no times of their own that a reader could use: they come
//! when they come.

use std::ffi::OsString;

use super::Conversion;
use super::process::{Decoder, MOST_PIXELS_OPTION, Next, RawFrame};

/// A stream that gives pictures.
pub(in crate::capture) struct VideoStream {
    decoder: Decoder,
    conversion: Conversion,
    /// The first frame is decoded when the stream is opened, and waits.
    waiting: Option<RawFrame>,
    size_px: [u32; 2],
}

/// What came next.
pub(in crate::capture) enum Streamed {
    /// 8-bit RGBA of the first picture's size.
    Picture(Vec<u8>),
    /// A picture of which a part is missing or wrong.
    Broken,
    /// Pictures are of another size from here on.
    Resized([u32; 2]),
    /// Nothing more comes.
    End,
}

impl VideoStream {
    /// Opens an address and waits for the first whole picture; `None` where none comes, after a silence of so many seconds
    /// at most.
    pub(in crate::capture) fn open(address: &str, silence_secs: u32) -> Option<Self> {
        let jpegs = ["-f", "mjpeg"];
        // Cameras differ in how they part one JPEG from the next; their own beginnings and ends are always there.
        let openings: &[&[&str]] = if address.starts_with("http") {
            &[&[], &jpegs]
        } else {
            &[&[]]
        };
        openings
            .iter()
            .find_map(|forced| Self::open_as(forced, address, silence_secs))
    }

    fn open_as(forced: &[&str], address: &str, silence_secs: u32) -> Option<Self> {
        let micros = (silence_secs * 1_000_000).to_string();
        let limit = match address.split_once("://") {
            Some(("http" | "https", _)) => vec!["-rw_timeout", &micros],
            Some(("rtsp" | "rtsps", _)) => vec!["-timeout", &micros],
            _ => Vec::new(),
        };
        // No frame is held back for others that are decoded beside it.
        let prompt = ["-fflags", "nobuffer", "-thread_type", "slice"];
        let options = [&limit, forced, &prompt[..], &MOST_PIXELS_OPTION].concat();
        let mut decoder = Decoder::start(&options, &OsString::from(address)).ok()?;
        loop {
            match decoder.next() {
                // Joined in the middle of a picture, it begins with a half one.
                Next::Frame(frame) if frame.corrupt => {}
                Next::Frame(frame) => {
                    return Some(Self {
                        decoder,
                        conversion: Conversion::default(),
                        size_px: frame.size_px,
                        waiting: Some(frame),
                    });
                }
                Next::Complaint(_) | Next::Fault(_) => {}
                Next::End => return None,
            }
        }
    }

    pub(in crate::capture) fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    /// Frames per second, where the stream says so.
    pub(in crate::capture) fn fps(&self) -> Option<f64> {
        self.decoder.fps.filter(|fps| (1.0..=240.0).contains(fps))
    }

    pub(in crate::capture) fn next(&mut self) -> Streamed {
        let frame = match self.waiting.take() {
            Some(waiting) => waiting,
            None => loop {
                match self.decoder.next() {
                    Next::Frame(frame) => break frame,
                    Next::Complaint(_) | Next::Fault(_) => {}
                    Next::End => return Streamed::End,
                }
            },
        };
        if frame.corrupt {
            return Streamed::Broken;
        }
        if frame.size_px != self.size_px {
            return Streamed::Resized(frame.size_px);
        }
        match self.conversion.rgba_of(&self.decoder, &frame, None) {
            Ok(rgba) => Streamed::Picture(rgba),
            Err(_) => Streamed::Broken,
        }
    }
}
