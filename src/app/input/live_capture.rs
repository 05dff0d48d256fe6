//! The capture thread: it owns a live source, puts each frame where the next stage takes the newest, and tells what
//! happens to the camera.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use super::mailbox::Mailbox;
use crate::capture::Frame;
use crate::capture::live::{LiveError, LiveEvent, LiveOptions, LiveSource, Now, Opened, is_live};

/// How soon the thread sees that it is to stop.
const PATIENCE: Duration = Duration::from_millis(50);
/// A camera that is not there is looked for again after so long, seconds.
const AGAIN_SECS: f64 = 2.0;

/// An event of a live source, besides its frames.
#[derive(Debug)]
pub enum CaptureEvent {
    /// It is open; frames will follow.
    Opened(Opened),
    /// It cannot be opened. Of a recording nothing will come; a camera or a stream is looked for until it is there.
    Failed(LiveError),
    /// It gives no frames any more, and is looked for.
    Lost(LiveError),
    /// It is there again.
    Back(Opened),
    /// The recording has come to its end; nothing more will come.
    Ended,
}

/// A call with everything that comes, on the capture thread: it must not wait for anything.
pub type Tap = Box<dyn FnMut(Tapped) + Send>;

/// A thing that a tap is called with.
#[derive(Debug, Clone, Copy)]
pub enum Tapped<'a> {
    /// The source was opened, for the first time or again.
    Opened(&'a Opened),
    /// A frame came.
    Frame(&'a Arc<Frame>),
}

/// A frame, and when it came.
#[derive(Debug, Clone)]
pub struct Arrived {
    /// The frame.
    pub frame: Arc<Frame>,
    /// By the clock that the source is read with, seconds; in a recording that is not the frame's own time.
    pub at_secs: f64,
}

/// A live source that is being read. Dropped, it stops within a moment, whatever the camera does.
pub struct LiveCapture {
    frames: Arc<Mailbox<Arrived>>,
    events: Receiver<CaptureEvent>,
    shared: Arc<CaptureShared>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Default)]
struct CaptureShared {
    stop: AtomicBool,
    tap: Mutex<Option<Tap>>,
    captured: AtomicU64,
    broken_pictures: AtomicU64,
}

impl LiveCapture {
    /// Begins to read `source` (as [`LiveSource::open`] takes it) by the clock `now`. `tap` misses nothing; one that is set
    /// later does.
    pub fn start(source: &str, options: &LiveOptions, now: Now, tap: Option<Tap>) -> Self {
        let frames = Arc::new(Mailbox::new());
        let (to_owner, events) = channel();
        let shared = Arc::new(CaptureShared {
            tap: Mutex::new(tap),
            ..CaptureShared::default()
        });
        let thread = {
            let (frames, shared) = (Arc::clone(&frames), Arc::clone(&shared));
            let (source, options) = (source.to_owned(), options.clone());
            thread::spawn(move || {
                let stage = CaptureStage {
                    now,
                    frames,
                    to_owner,
                    shared,
                };
                loop {
                    let opened = LiveSource::open(&source, &options, Arc::clone(&stage.now));
                    let ends = stage.capture(opened) == Ending::ForGood || !is_live(&source);
                    if ends || !stage.waits_to_try_again() {
                        break;
                    }
                }
                stage.frames.close();
            })
        };
        Self {
            frames,
            events,
            shared,
            thread: Some(thread),
        }
    }

    /// Where the newest frame lies; closed when no more will come.
    pub fn frames(&self) -> Arc<Mailbox<Arrived>> {
        Arc::clone(&self.frames)
    }

    /// The next event, if there is one.
    pub fn next_event(&self) -> Option<CaptureEvent> {
        self.events.try_recv().ok()
    }

    /// Waits at most this long for the next event.
    pub fn wait_for_event(&self, patience: Duration) -> Option<CaptureEvent> {
        let event = self.events.recv_timeout(patience);
        if matches!(event, Err(std::sync::mpsc::RecvTimeoutError::Disconnected)) {
            thread::sleep(patience);
        }
        event.ok()
    }

    /// From now on everything goes to `tap` as well; in place of the one before.
    pub fn set_tap(&self, tap: Option<Tap>) {
        *self
            .shared
            .tap
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = tap;
    }

    /// Frames that came so far.
    pub fn captured(&self) -> u64 {
        self.shared.captured.load(Ordering::Relaxed)
    }

    /// Pictures so far that were broken on their way from the camera.
    pub fn broken_pictures(&self) -> u64 {
        self.shared.broken_pictures.load(Ordering::Relaxed)
    }
}

impl Drop for LiveCapture {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Relaxed);
        self.frames.close();
        if let Some(thread) = self.thread.take() {
            // A panic in it has been told on stderr.
            _ = thread.join();
        }
    }
}

/// The end of what a source gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Ending {
    /// Nothing more will come, or nobody wants it.
    ForGood,
    /// It could not be opened.
    NotOpened,
}

/// What the capture thread works with.
struct CaptureStage {
    now: Now,
    frames: Arc<Mailbox<Arrived>>,
    to_owner: Sender<CaptureEvent>,
    shared: Arc<CaptureShared>,
}

impl CaptureStage {
    /// Until the source ends or the owner stops it.
    fn capture(&self, mut source: LiveSource) -> Ending {
        let shared = &self.shared;
        while !shared.stop.load(Ordering::Relaxed) {
            let event = match source.next(PATIENCE) {
                Ok(event) => event,
                Err(error) => {
                    _ = self.to_owner.send(CaptureEvent::Failed(error));
                    return Ending::NotOpened;
                }
            };
            let broken_pictures = source.broken_pictures();
            shared
                .broken_pictures
                .store(broken_pictures, Ordering::Relaxed);
            let (event, is_last) = match event {
                None => continue,
                Some(LiveEvent::Frame(frame)) => {
                    let arrived = Arrived {
                        frame: Arc::new(frame),
                        at_secs: (self.now)(),
                    };
                    shared.take(arrived, &self.frames);
                    continue;
                }
                Some(LiveEvent::Opened(opened)) => {
                    shared.tap(Tapped::Opened(&opened));
                    (CaptureEvent::Opened(opened), false)
                }
                Some(LiveEvent::Lost(error)) => (CaptureEvent::Lost(error), false),
                Some(LiveEvent::Back(opened)) => {
                    shared.tap(Tapped::Opened(&opened));
                    (CaptureEvent::Back(opened), false)
                }
                Some(LiveEvent::Ended) => (CaptureEvent::Ended, true),
            };
            // The owner may have gone, and then sets `stop`.
            _ = self.to_owner.send(event);
            if is_last {
                break;
            }
        }
        Ending::ForGood
    }

    /// Waits until a source that could not be opened is tried again; false where it is wanted no more.
    fn waits_to_try_again(&self) -> bool {
        let until_secs = (self.now)() + AGAIN_SECS;
        while (self.now)() < until_secs {
            if self.shared.stop.load(Ordering::Relaxed) {
                return false;
            }
            thread::sleep(PATIENCE);
        }
        true
    }
}

impl CaptureShared {
    fn take(&self, arrived: Arrived, frames: &Mailbox<Arrived>) {
        self.captured.fetch_add(1, Ordering::Relaxed);
        self.tap(Tapped::Frame(&arrived.frame));
        frames.put(arrived);
    }

    fn tap(&self, tapped: Tapped) {
        if let Some(tap) = &mut *self.tap.lock().unwrap_or_else(PoisonError::into_inner) {
            tap(tapped);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::input::mailbox::Taken;
    use crate::app::stopwatch::Stopwatch;
    use crate::scene::WantedFormat;
    use std::sync::mpsc::sync_channel;

    fn play(source: &str, repeats: bool) -> LiveCapture {
        play_with(source, repeats, None)
    }

    fn play_with(source: &str, repeats: bool, tap: Option<Tap>) -> LiveCapture {
        let options = LiveOptions {
            wanted: WantedFormat::default(),
            mirror: false,
            repeats,
        };
        LiveCapture::start(source, &options, Arc::new(Stopwatch::clock()), tap)
    }

    const LAMP: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/lamp");
    const SOON: Duration = Duration::from_secs(20);

    #[test]
    fn a_recording_is_played_to_its_end_and_each_frame_reaches_the_tap() {
        let watch = Stopwatch::start();
        let (to_test, tapped) = sync_channel(200);
        let tap: Tap = Box::new(move |tapped| match tapped {
            Tapped::Opened(opened) => assert_eq!(opened.fps, Some(30.0)),
            Tapped::Frame(frame) => to_test.send(frame.index).unwrap(),
        });
        let capture = play_with(LAMP, false, Some(tap));
        let frames = capture.frames();
        let mut newest = None;
        // A slow reader.
        while let Some(Arrived { frame, .. }) = frames.take() {
            assert!(newest < Some(frame.index));
            newest = Some(frame.index);
            thread::sleep(Duration::from_millis(150));
        }
        assert!(watch.elapsed_ms() >= 119.0 / 30.0 * 1e3, "in real time");
        assert_eq!(newest, Some(119), "the last frame is seen");
        assert_eq!(capture.captured(), 120);
        assert!(frames.dropped() > 60, "{} were dropped", frames.dropped());
        assert!(matches!(
            capture.wait_for_event(SOON),
            Some(CaptureEvent::Opened(_))
        ));
        assert!(matches!(
            capture.wait_for_event(SOON),
            Some(CaptureEvent::Ended)
        ));
        drop(capture);
        let tapped: Vec<u32> = tapped.iter().collect();
        assert!(
            tapped.ends_with(&(60..120).collect::<Vec<_>>()),
            "none is dropped"
        );
    }

    #[test]
    fn it_stops_at_once_while_it_plays() {
        let capture = play(LAMP, true);
        let frames = capture.frames();
        assert!(frames.take().is_some());
        let watch = Stopwatch::start();
        drop(capture);
        assert!(watch.elapsed_ms() < 1500.0, "{} ms", watch.elapsed_ms());
        // What was in it may still be there.
        _ = frames.take_within(Duration::ZERO);
        assert!(matches!(frames.take_within(Duration::ZERO), Taken::Closed));
    }

    #[test]
    fn it_stops_at_once_while_an_address_does_not_answer() {
        // A listener that never says a word.
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/video", listener.local_addr().unwrap());
        let capture = play(&address, false);
        let _connection = listener.accept().unwrap();
        let watch = Stopwatch::start();
        drop(capture);
        assert!(watch.elapsed_ms() < 1500.0, "{} ms", watch.elapsed_ms());
    }

    #[test]
    fn a_camera_that_is_not_there_is_looked_for_again_and_a_stop_ends_that() {
        let capture = play("webcam:no such camera", false);
        for _ in 0..2 {
            let event = capture.wait_for_event(SOON);
            assert!(matches!(event, Some(CaptureEvent::Failed(_))), "{event:?}");
        }
        let watch = Stopwatch::start();
        drop(capture);
        assert!(watch.elapsed_ms() < 1500.0, "{} ms", watch.elapsed_ms());
    }

    #[test]
    fn what_is_not_there_is_told() {
        let capture = play("recordings/none", false);
        match capture.wait_for_event(SOON) {
            Some(CaptureEvent::Failed(error)) => {
                assert!(error.to_string().contains("no such file or folder"));
            }
            other => panic!("{other:?}"),
        }
        assert!(capture.frames().take().is_none());
    }
}
