//! Streams from an address.

use super::error::LiveError;
use super::feed::{Feed, Link, LivePicture, Opened, Opener};
use crate::capture::video::stream::{Streamed, VideoStream};

/// How long an address may take to answer, and a stream to go on, seconds.
const TIMEOUT_SECS: u32 = 5;

/// Opens an address.
pub(super) struct StreamOpener {
    pub address: String,
}

impl Opener for StreamOpener {
    fn source_name(&self) -> &str {
        &self.address
    }

    fn patience_secs(&self) -> Option<f64> {
        Some(f64::from(TIMEOUT_SECS))
    }

    fn open(&self, _again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError> {
        // A stream does not know its size before the first picture.
        let stream =
            VideoStream::open(&self.address, TIMEOUT_SECS).ok_or_else(|| LiveError::NoStream {
                address: self.address.clone(),
            })?;
        Ok(Box::new(StreamFeed {
            address: self.address.clone(),
            stream,
            waiting_since_secs: Some(link.now_secs()),
            link: link.clone(),
        }))
    }
}

struct StreamFeed {
    address: String,
    stream: VideoStream,
    /// When the first picture came, which waits.
    waiting_since_secs: Option<f64>,
    link: Link,
}

impl Feed for StreamFeed {
    fn opened(&self) -> Opened {
        let [width, height] = self.stream.size_px();
        let fps = self.stream.fps();
        Opened {
            name: self.address.clone(),
            format: match fps {
                Some(fps) => format!("{width} x {height} at {fps:.0} fps"),
                None => format!("{width} x {height}"),
            },
            fps,
        }
    }

    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError> {
        loop {
            match self.stream.next() {
                Streamed::Picture(rgba) => {
                    let came_secs = self.waiting_since_secs.take();
                    return Ok(Some(LivePicture {
                        index: None,
                        time_secs: came_secs.unwrap_or_else(|| self.link.now_secs()),
                        size_px: self.stream.size_px(),
                        rgba,
                    }));
                }
                Streamed::Broken => self.link.count_broken_picture(),
                Streamed::Resized(size_px) => {
                    return Err(LiveError::StreamResized {
                        address: self.address.clone(),
                        size_px,
                        before_px: self.stream.size_px(),
                    });
                }
                Streamed::End => {
                    return Err(LiveError::StreamStopped {
                        address: self.address.clone(),
                    });
                }
            }
        }
    }
}
