//! Streams from an address, decoded by OpenCV's FFmpeg.

use opencv::core::{Mat, MatTraitConst, Vector};
use opencv::videoio::{self, VideoCapture, VideoCaptureTrait, VideoCaptureTraitConst};

use super::error::LiveError;
use super::feed::{Feed, Link, LivePicture, Opened, Opener};
use crate::capture::pixels;

/// How long an address may take to answer, and a stream to go on.
const TIMEOUT_MSEC: i32 = 5000;

/// Opens an address.
pub(super) struct StreamOpener {
    pub address: String,
}

impl Opener for StreamOpener {
    fn source_name(&self) -> &str {
        &self.address
    }

    fn patience_secs(&self) -> Option<f64> {
        Some(f64::from(TIMEOUT_MSEC) * 1e-3)
    }

    fn open(&self, _again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError> {
        let no_stream = || LiveError::NoStream {
            address: self.address.clone(),
        };
        let timeouts = Vector::from_slice(&[
            videoio::CAP_PROP_OPEN_TIMEOUT_MSEC,
            TIMEOUT_MSEC,
            videoio::CAP_PROP_READ_TIMEOUT_MSEC,
            TIMEOUT_MSEC,
        ]);
        let mut capture =
            VideoCapture::from_file_with_params(&self.address, videoio::CAP_FFMPEG, &timeouts)
                .map_err(|_| no_stream())?;
        let mut bgr = Mat::default();
        // What opens may still hold no picture, and a stream does not know its size before the first.
        if !capture.read(&mut bgr).unwrap_or(false) || bgr.empty() {
            return Err(no_stream());
        }
        let fps = capture.get(videoio::CAP_PROP_FPS).unwrap_or(0.0);
        Ok(Box::new(StreamFeed {
            address: self.address.clone(),
            capture,
            waiting_since_secs: Some(link.now_secs()),
            fps: Some(fps).filter(|fps| (1.0..=240.0).contains(fps)),
            bgr,
            link: link.clone(),
        }))
    }
}

struct StreamFeed {
    address: String,
    capture: VideoCapture,
    bgr: Mat,
    /// When the picture came that waits in `bgr`: the first does.
    waiting_since_secs: Option<f64>,
    fps: Option<f64>,
    link: Link,
}

impl Feed for StreamFeed {
    fn opened(&self) -> Opened {
        let [width, height] = pixels::size_of(&self.bgr);
        Opened {
            name: self.address.clone(),
            format: match self.fps {
                Some(fps) => format!("{width} x {height} at {fps:.0} fps"),
                None => format!("{width} x {height}"),
            },
            fps: self.fps,
        }
    }

    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError> {
        let stopped = || LiveError::StreamStopped {
            address: self.address.clone(),
        };
        let time_secs = match self.waiting_since_secs.take() {
            Some(time_secs) => time_secs,
            None => {
                let read = self.capture.read(&mut self.bgr).unwrap_or(false);
                if !read || self.bgr.empty() {
                    return Err(stopped());
                }
                self.link.now_secs()
            }
        };
        let rgba = pixels::rgba_from_bgr(&self.bgr).map_err(|_| stopped())?;
        Ok(Some(LivePicture {
            index: None,
            time_secs,
            size_px: pixels::size_of(&self.bgr),
            rgba,
        }))
    }
}
