//! Frames as they come: from a webcam, from an address, or from a recording that is played in real time.
//!
//! A source that was open once is never given up: when it is lost, that is an event, and it is taken up again as soon as
//! it is back.

pub mod decode;
mod device;
mod error;
mod feed;
mod format;
mod played;
mod reader;
mod standard_tables;
mod stream;
mod webcam;

use std::sync::Arc;
use std::thread;
use std::time::Duration;

use super::Frame;
use crate::scene::WantedFormat;
use feed::{Link, LivePicture, Opener};
use played::PlayedOpener;
use reader::{Message, Reader};
use stream::StreamOpener;
use webcam::WebcamOpener;

pub use error::LiveError;
pub use feed::{Now, Opened};
pub use format::Offer;
pub use webcam::{ListedCamera, list_cameras};

/// Time between two tries to take a lost source up again, seconds.
const RETRY_SECS: f64 = 0.5;

/// What a live source has to tell.
#[derive(Debug)]
pub enum LiveEvent {
    /// It is open; frames will follow.
    Opened(Opened),
    /// A frame. Its time is when it came, by the source's clock; in a recording when it was taken. Its size may differ from
    /// that of the one before.
    Frame(Frame),
    /// It gives no frames any more, and is looked for.
    Lost(LiveError),
    /// After having been lost it is there again.
    Back(Opened),
    /// A recording has come to its end.
    Ended,
}

/// How a source is opened.
#[derive(Debug, Clone)]
pub struct LiveOptions {
    /// What a webcam is asked for.
    pub wanted: WantedFormat,
    /// Whether each picture is turned left for right before anything else sees it.
    pub mirror: bool,
    /// Whether a recording begins again at its end; indices and times then go on.
    pub repeats: bool,
}

/// Whether a source is one of those that do not end: a webcam or a stream.
pub fn is_live(source: &str) -> bool {
    webcam_in(source).is_some() || source.contains("://")
}

/// The number or the part of a name by which a webcam is meant.
fn webcam_in(source: &str) -> Option<&str> {
    source
        .strip_prefix("webcam:")
        .or_else(|| source.strip_prefix("/dev/video"))
        .or_else(|| (source == "webcam").then_some("0"))
}

/// A source of frames that come by themselves. Dropped, it lets its camera go: at once, or when the driver lets go of the
/// thread that waits there.
pub struct LiveSource {
    opener: Arc<dyn Opener>,
    link: Link,
    mirror: bool,
    state: State,
    /// What was opened last.
    opened: Option<Opened>,
    /// A frame that comes after the news that it is there again.
    held: Option<Frame>,
    /// When it last said anything, by the clock.
    heard_at_secs: f64,
    next_index: u32,
}

enum State {
    /// It is being opened, for the first time or again.
    Opening(Reader),
    /// It is open; `silent`: without giving pictures.
    Open { reader: Reader, silent: bool },
    /// It is lost, and tried again at this time.
    Gone { retry_at_secs: f64 },
    /// There is nothing more to come.
    Ended,
}

impl LiveSource {
    /// Begins to open `source`: `webcam:0`, `webcam:NAME`, `/dev/video0`, `http://…`, `rtsp://…`, or the path of a recording.
    /// Whether that succeeds, [`LiveSource::next`] tells. `now` is the clock of the frames' times, seconds.
    pub fn open(source: &str, options: &LiveOptions, now: Now) -> Self {
        let source_name = source.to_owned();
        let opener: Arc<dyn Opener> = if let Some(camera) = webcam_in(source) {
            Arc::new(WebcamOpener {
                source_name,
                wanted_camera: camera.to_owned(),
                wanted: options.wanted,
            })
        } else if is_live(source) {
            Arc::new(StreamOpener {
                address: source_name,
            })
        } else {
            Arc::new(PlayedOpener {
                source_name,
                repeats: options.repeats,
            })
        };
        Self::with_opener(opener, options.mirror, now)
    }

    fn with_opener(opener: Arc<dyn Opener>, mirror: bool, now: Now) -> Self {
        let link = Link::new(now);
        let reader = Reader::start(Arc::clone(&opener), None, link.clone());
        Self {
            opener,
            mirror,
            state: State::Opening(reader),
            opened: None,
            held: None,
            heard_at_secs: link.now_secs(),
            next_index: 0,
            link,
        }
    }

    /// Waits at most this long for what comes next; `None` where nothing does.
    ///
    /// # Errors
    /// It cannot be opened in the first place; nothing more will come.
    pub fn next(&mut self, patience: Duration) -> Result<Option<LiveEvent>, LiveError> {
        if let Some(frame) = self.held.take() {
            return Ok(Some(LiveEvent::Frame(frame)));
        }
        match std::mem::replace(&mut self.state, State::Ended) {
            State::Ended => {
                thread::sleep(patience);
                Ok(None)
            }
            State::Gone { retry_at_secs } => {
                self.wait_to_retry(retry_at_secs, patience);
                Ok(None)
            }
            State::Opening(reader) => self.hear_opening(reader, patience),
            State::Open { reader, silent } => Ok(self.hear_open(reader, silent, patience)),
        }
    }

    /// Pictures so far that were left out because they were broken on their way from the camera.
    pub fn broken_pictures(&self) -> u64 {
        self.link.broken_pictures()
    }

    fn wait_to_retry(&mut self, retry_at_secs: f64, patience: Duration) {
        let left_secs = retry_at_secs - self.link.now_secs();
        self.state = if left_secs > 0.0 {
            thread::sleep(Duration::from_secs_f64(left_secs).min(patience));
            State::Gone { retry_at_secs }
        } else {
            let opener = Arc::clone(&self.opener);
            let name = self.opened.as_ref().map(|opened| opened.name.clone());
            State::Opening(Reader::start(opener, name, self.link.clone()))
        };
    }

    fn hear_opening(
        &mut self,
        reader: Reader,
        patience: Duration,
    ) -> Result<Option<LiveEvent>, LiveError> {
        let refused = match reader.listen(patience) {
            Ok(None) => {
                self.state = State::Opening(reader);
                return Ok(None);
            }
            Ok(Some(Message::Opened(opened))) => {
                self.heard_at_secs = self.link.now_secs();
                let silent = false;
                self.state = State::Open { reader, silent };
                let before = self.opened.replace(opened.clone());
                return Ok(Some(match before {
                    None => LiveEvent::Opened(opened),
                    Some(_) => LiveEvent::Back(opened),
                }));
            }
            Ok(Some(Message::Failed(error))) => error,
            // A source that is told to stop before it was open.
            Ok(Some(Message::Ended | Message::Picture(_))) => return Ok(None),
            Err(_) => self.reader_gone(),
        };
        if self.opened.is_none() {
            return Err(refused);
        }
        self.try_again_later();
        Ok(None)
    }

    fn hear_open(&mut self, reader: Reader, silent: bool, patience: Duration) -> Option<LiveEvent> {
        let lost = match reader.listen(patience) {
            Ok(Some(Message::Picture(picture))) => {
                self.heard_at_secs = self.link.now_secs();
                self.state = State::Open {
                    reader,
                    silent: false,
                };
                let frame = self.frame_of(picture);
                return Some(match self.opened.clone().filter(|_| silent) {
                    Some(opened) => {
                        self.held = Some(frame);
                        LiveEvent::Back(opened)
                    }
                    None => LiveEvent::Frame(frame),
                });
            }
            Ok(Some(Message::Ended)) => return Some(LiveEvent::Ended),
            Ok(Some(Message::Opened(_)) | None) => {
                let silence_secs = self.link.now_secs() - self.heard_at_secs;
                let patience_secs = self.opener.patience_secs();
                let too_long = patience_secs.is_some_and(|patience| silence_secs > patience);
                let tells = too_long && !silent;
                self.state = State::Open {
                    reader,
                    silent: silent || too_long,
                };
                return tells.then(|| LiveEvent::Lost(self.silence(silence_secs)));
            }
            Ok(Some(Message::Failed(error))) => error,
            Err(_) => self.reader_gone(),
        };
        self.try_again_later();
        // What is missed already is not lost once more.
        (!silent).then_some(LiveEvent::Lost(lost))
    }

    fn try_again_later(&mut self) {
        self.state = State::Gone {
            retry_at_secs: self.link.now_secs() + RETRY_SECS,
        };
    }

    fn silence(&self, silence_secs: f64) -> LiveError {
        LiveError::Silent {
            source_name: self.shown_name(),
            silence_secs,
        }
    }

    fn reader_gone(&self) -> LiveError {
        LiveError::ReaderGone {
            source_name: self.shown_name(),
        }
    }

    fn shown_name(&self) -> String {
        let asked_for = self.opener.source_name();
        match &self.opened {
            Some(Opened { name, .. }) if name != asked_for => format!("{asked_for} ({name})"),
            _ => asked_for.to_owned(),
        }
    }

    fn frame_of(&mut self, picture: LivePicture) -> Frame {
        let index = picture.index.unwrap_or(self.next_index);
        self.next_index = index + 1;
        let mut frame = Frame {
            index,
            time_secs: picture.time_secs,
            size_px: picture.size_px,
            rgba: picture.rgba,
        };
        if self.mirror {
            frame.mirror();
        }
        frame
    }
}

impl Drop for LiveSource {
    fn drop(&mut self) {
        self.link.stop();
    }
}

#[cfg(test)]
mod tests;
