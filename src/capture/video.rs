//! A video file as a recording, decoded by OpenCV's FFmpeg.

use std::path::{Path, PathBuf};

use opencv::core::{Mat, MatTraitConst};
use opencv::videoio::{self, VideoCapture, VideoCaptureTrait, VideoCaptureTraitConst};

use super::error::{CaptureError, Notice};
use super::pixels;

/// Reads tried on after one that failed: a decoder gives up on a broken packet, and takes the next one when asked again.
const ATTEMPTS: u32 = 64;
/// For videos that do not know their own.
const ASSUMED_FPS: f64 = 30.0;

pub(super) struct VideoFrames {
    path: PathBuf,
    capture: VideoCapture,
    bgr: Mat,
    /// The first frame is decoded when the video is opened, and waits in `bgr` with this index.
    waiting: Option<u32>,
    next_index: u32,
    good_frames: u32,
    size_px: [u32; 2],
    fps: f64,
    announced: Option<u32>,
    /// Whether all time stamps so far lay on the grid of the frame rate, so that a gap in them means missing frames.
    steady: bool,
    ended: bool,
}

impl VideoFrames {
    pub(super) fn open(path: &Path) -> Result<Self, CaptureError> {
        let not_a_video = || CaptureError::NotAVideo {
            path: path.to_owned(),
        };
        // An absolute path cannot be taken for a protocol ("a:b.mp4").
        let absolute = std::path::absolute(path).map_err(|error| CaptureError::Io {
            path: path.to_owned(),
            error,
        })?;
        let capture =
            VideoCapture::from_file(&absolute, videoio::CAP_FFMPEG).map_err(|_| not_a_video())?;
        if !capture.is_opened().unwrap_or(false) {
            return Err(not_a_video());
        }
        let property = |id| capture.get(id).unwrap_or(0.0);
        let fps = Some(property(videoio::CAP_PROP_FPS)).filter(|fps| (0.1..=1000.0).contains(fps));
        let announced = Some(property(videoio::CAP_PROP_FRAME_COUNT))
            .filter(|count| (1.0..1e9).contains(count));
        let mut video = Self {
            path: path.to_owned(),
            bgr: Mat::default(),
            waiting: None,
            next_index: 0,
            good_frames: 0,
            size_px: [0, 0],
            fps: fps.unwrap_or(ASSUMED_FPS),
            announced: announced.map(|count| count as u32),
            steady: true,
            ended: false,
            capture,
        };
        video.waiting = video.decode();
        if video.waiting.is_none() {
            return Err(CaptureError::NoGoodFrame {
                path: path.to_owned(),
            });
        }
        video.size_px = pixels::size_of(&video.bgr);
        Ok(video)
    }

    pub(super) fn announced_frames(&self) -> Option<u32> {
        self.announced
    }

    pub(super) fn fps(&self) -> f64 {
        self.fps
    }

    pub(super) fn size_px(&self) -> [u32; 2] {
        self.size_px
    }

    pub(super) fn next_picture(
        &mut self,
        notices: &mut Vec<Notice>,
    ) -> Result<Option<(u32, Vec<u8>)>, CaptureError> {
        while !self.ended {
            let Some(index) = self.waiting.take().or_else(|| self.decode()) else {
                self.ended = true;
                self.tell_end(notices);
                break;
            };
            if index > self.next_index {
                notices.push(Notice::Broken {
                    path: self.path.clone(),
                    first: self.next_index,
                    count: index - self.next_index,
                    good_before: self.good_frames,
                });
            }
            self.next_index = index + 1;
            if pixels::size_of(&self.bgr) != self.size_px {
                notices.push(Notice::OtherSize {
                    path: self.path.clone(),
                    frame: index,
                    size_px: pixels::size_of(&self.bgr),
                    expected_px: self.size_px,
                });
                continue;
            }
            self.good_frames += 1;
            let rgba = pixels::rgba_from_bgr(&self.bgr).map_err(|error| CaptureError::OpenCv {
                path: self.path.clone(),
                frame: index,
                message: error.message,
            })?;
            return Ok(Some((index, rgba)));
        }
        Ok(None)
    }

    /// Decodes the next frame that can be decoded and gives its index.
    fn decode(&mut self) -> Option<u32> {
        let decoded = (0..ATTEMPTS)
            .any(|_| self.capture.read(&mut self.bgr).unwrap_or(false) && !self.bgr.empty());
        decoded.then(|| self.index_of_decoded())
    }

    /// The index counts frames. Only where all time stamps agreed with that so far, and one now leaves a gap that the
    /// announced number of frames has room for, were frames lost: OpenCV skips broken ones without a word.
    fn index_of_decoded(&mut self) -> u32 {
        let in_frames =
            self.capture.get(videoio::CAP_PROP_POS_MSEC).unwrap_or(0.0) * self.fps / 1000.0;
        let on_grid = (in_frames - in_frames.round()).abs() < 0.2;
        let by_time = in_frames.round();
        let counted = f64::from(self.next_index);
        let has_room = self
            .announced
            .is_some_and(|announced| by_time < f64::from(announced));
        self.steady &= on_grid && by_time >= counted && has_room;
        if self.steady {
            by_time as u32
        } else {
            self.next_index
        }
    }

    /// By how much the announced number may be too large: MP4 and AVI count their frames, others give a duration.
    fn announced_slack(&self) -> u32 {
        let counts = super::has_extension(&self.path, &["mp4", "m4v", "mov", "avi"]);
        if counts {
            0
        } else {
            self.announced.map_or(0, |announced| 2 + announced / 100)
        }
    }

    fn tell_end(&self, notices: &mut Vec<Notice>) {
        let Some(announced) = self.announced else {
            return;
        };
        if self.good_frames >= announced {
            // Every frame came, so the gaps were in the recording's times alone.
            notices.retain(|notice| !matches!(notice, Notice::Broken { .. }));
        } else if self.next_index + self.announced_slack() < announced {
            notices.push(Notice::EndedEarly {
                path: self.path.clone(),
                good: self.good_frames,
                ended_at: self.next_index,
                announced,
            });
        }
    }
}
