//! The source of a script: what it says when its camera misbehaves.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use super::*;
use feed::Feed;

/// What a scripted feed does next.
enum ScriptStep {
    /// A picture of this size.
    Picture([u32; 2]),
    /// The driver blocks until the gate is opened.
    Block,
    /// The camera is unplugged.
    Unplug,
    /// A library panics.
    Panic,
}

/// Each opening takes the next script; an empty list of them refuses.
#[derive(Default)]
struct Scripted {
    openings: Mutex<VecDeque<Option<Vec<ScriptStep>>>>,
    asked_for: Mutex<Vec<Option<String>>>,
    gate: Arc<(Mutex<bool>, std::sync::Condvar)>,
}

struct ScriptedFeed {
    steps: VecDeque<ScriptStep>,
    gate: Arc<(Mutex<bool>, std::sync::Condvar)>,
    link: Link,
}

fn unplugged() -> LiveError {
    LiveError::Camera {
        camera: "webcam:7".to_owned(),
        message: "No such device".to_owned(),
    }
}

impl Opener for Scripted {
    fn source_name(&self) -> &str {
        "webcam:7"
    }

    fn patience_secs(&self) -> Option<f64> {
        Some(3.0)
    }

    fn open(&self, again: Option<&str>, link: &Link) -> Result<Box<dyn Feed>, LiveError> {
        self.asked_for
            .lock()
            .unwrap()
            .push(again.map(str::to_owned));
        let steps = self.openings.lock().unwrap().pop_front().flatten();
        Ok(Box::new(ScriptedFeed {
            steps: steps.ok_or_else(unplugged)?.into(),
            gate: Arc::clone(&self.gate),
            link: link.clone(),
        }))
    }
}

impl Feed for ScriptedFeed {
    fn opened(&self) -> Opened {
        Opened {
            name: "Camera X".to_owned(),
            format: "in tests".to_owned(),
            fps: Some(30.0),
        }
    }

    fn next_picture(&mut self) -> Result<Option<LivePicture>, LiveError> {
        match self.steps.pop_front() {
            Some(ScriptStep::Picture(size_px)) => Ok(Some(LivePicture {
                index: None,
                time_secs: self.link.now_secs(),
                size_px,
                rgba: vec![0; (size_px[0] * size_px[1] * 4) as usize],
            })),
            Some(ScriptStep::Block) => {
                let (open, turned) = &*self.gate;
                let held = turned.wait_while(open.lock().unwrap(), |open| !*open);
                drop(held.unwrap());
                self.next_picture()
            }
            Some(ScriptStep::Unplug) => Err(unplugged()),
            Some(ScriptStep::Panic) => panic!("a library's own"),
            None => Ok(None),
        }
    }
}

/// A clock that a test turns by hand.
#[derive(Clone, Default)]
struct HandClock(Arc<AtomicU64>);

impl HandClock {
    fn now(&self) -> Now {
        let millis = Arc::clone(&self.0);
        Arc::new(move || millis.load(Ordering::SeqCst) as f64 * 1e-3)
    }

    fn advance(&self, millis: u64) {
        self.0.fetch_add(millis, Ordering::SeqCst);
    }
}

fn source(scripts: Vec<Option<Vec<ScriptStep>>>) -> (LiveSource, Arc<Scripted>, HandClock) {
    let scripted = Arc::new(Scripted {
        openings: Mutex::new(scripts.into()),
        ..Scripted::default()
    });
    let clock = HandClock::default();
    let opener = Arc::clone(&scripted);
    let source = LiveSource::with_opener(opener, false, clock.now());
    (source, scripted, clock)
}

/// What it says next, in a letter; the clock runs by a tenth of a second for each time that it has nothing to say.
fn letter(source: &mut LiveSource, clock: &HandClock) -> char {
    for _ in 0..200 {
        match source.next(Duration::from_millis(20)).unwrap() {
            None => clock.advance(100),
            Some(LiveEvent::Opened(_)) => return 'O',
            Some(LiveEvent::Frame(_)) => return 'F',
            Some(LiveEvent::Lost(_)) => return 'L',
            Some(LiveEvent::Back(_)) => return 'B',
            Some(LiveEvent::Ended) => return 'E',
        }
    }
    '-'
}

fn letters(source: &mut LiveSource, clock: &HandClock, count: usize) -> String {
    (0..count).map(|_| letter(source, clock)).collect()
}

const VGA: [u32; 2] = [4, 3];

#[test]
fn a_source_that_cannot_be_opened_says_why_once() {
    let (mut source, _, _) = source(vec![None]);
    let error = loop {
        match source.next(Duration::from_millis(20)) {
            Ok(None) => {}
            Ok(Some(_)) => panic!("it cannot be open"),
            Err(error) => break error,
        }
    };
    assert!(matches!(error, LiveError::Camera { .. }));
    assert!(source.next(Duration::ZERO).unwrap().is_none());
}

#[test]
fn an_unplugged_camera_is_taken_up_again_by_its_name() {
    let (mut source, scripted, clock) = source(vec![
        Some(vec![
            ScriptStep::Picture(VGA),
            ScriptStep::Picture(VGA),
            ScriptStep::Unplug,
        ]),
        None,
        None,
        Some(vec![ScriptStep::Picture(VGA)]),
    ]);
    assert_eq!(letters(&mut source, &clock, 7), "OFFLBFE");
    let same = Some("Camera X".to_owned());
    let asked_for = scripted.asked_for.lock().unwrap().clone();
    assert_eq!(asked_for, [None, same.clone(), same.clone(), same]);
}

#[test]
fn frames_are_counted_on_after_a_loss() {
    let (mut source, _, clock) = source(vec![
        Some(vec![ScriptStep::Picture(VGA), ScriptStep::Unplug]),
        Some(vec![
            ScriptStep::Picture([8, 6]),
            ScriptStep::Picture([8, 6]),
        ]),
    ]);
    let mut frames = Vec::new();
    while frames.len() < 3 {
        match source.next(Duration::from_millis(20)).unwrap() {
            Some(LiveEvent::Frame(frame)) => frames.push((frame.index, frame.size_px)),
            Some(_) => {}
            None => clock.advance(100),
        }
    }
    assert_eq!(
        frames,
        [(0, VGA), (1, [8, 6]), (2, [8, 6])],
        "also in another size"
    );
}

#[test]
fn a_camera_that_falls_silent_is_lost_once_and_back_with_its_next_picture() {
    let (mut source, scripted, clock) = source(vec![Some(vec![
        ScriptStep::Picture(VGA),
        ScriptStep::Block,
        ScriptStep::Picture(VGA),
        ScriptStep::Picture(VGA),
    ])]);
    assert_eq!(letters(&mut source, &clock, 3), "OFL");
    assert!(clock.0.load(Ordering::SeqCst) >= 3000, "patience first");
    assert_eq!(
        letter(&mut source, &clock),
        '-',
        "and then nothing more is said"
    );
    let (open, turned) = &*scripted.gate;
    *open.lock().unwrap() = true;
    turned.notify_all();
    assert_eq!(letters(&mut source, &clock, 4), "BFFE");
}

#[test]
fn a_source_whose_driver_blocks_can_be_dropped() {
    let (mut source, _, clock) = source(vec![Some(vec![
        ScriptStep::Picture(VGA),
        ScriptStep::Block,
    ])]);
    assert_eq!(letters(&mut source, &clock, 2), "OF");
    // Would hang here.
    drop(source);
}

#[test]
fn a_panic_in_a_library_is_a_loss() {
    let (mut source, _, clock) = source(vec![
        Some(vec![ScriptStep::Picture(VGA), ScriptStep::Panic]),
        Some(vec![ScriptStep::Picture(VGA)]),
    ]);
    assert_eq!(letters(&mut source, &clock, 6), "OFLBFE");
}

/// The first frames of the recording `lamp`, and when each came by the clock.
fn play(options: &LiveOptions, count: usize) -> (Vec<Frame>, Vec<f64>) {
    let millis = Arc::new(AtomicU64::new(0));
    // A clock that goes on whenever somebody looks at it.
    let now: Now = {
        let millis = Arc::clone(&millis);
        Arc::new(move || millis.fetch_add(20, Ordering::SeqCst) as f64 * 1e-3)
    };
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/lamp");
    let mut source = LiveSource::open(path, options, now);
    let (mut frames, mut came_secs) = (Vec::new(), Vec::new());
    while frames.len() < count {
        match source.next(Duration::from_millis(100)).unwrap() {
            Some(LiveEvent::Frame(frame)) => {
                came_secs.push(millis.load(Ordering::SeqCst) as f64 * 1e-3);
                frames.push(frame);
            }
            Some(LiveEvent::Ended) => break,
            _ => {}
        }
    }
    (frames, came_secs)
}

#[test]
fn a_recording_comes_frame_by_frame_when_it_is_time() {
    let options = LiveOptions {
        wanted: WantedFormat::default(),
        mirror: false,
        repeats: false,
    };
    let (frames, came_secs) = play(&options, 10);
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/lamp");
    let mut recording = crate::capture::FrameSource::open(path).unwrap();
    for (frame, came_secs) in frames.iter().zip(&came_secs) {
        let recorded = recording.next_frame().unwrap().unwrap();
        assert_eq!(frame.index, recorded.index);
        assert_eq!(frame.time_secs, recorded.time_secs);
        assert!(frame.rgba == recorded.rgba, "frame {}", frame.index);
        assert!(
            *came_secs >= frame.time_secs,
            "frame {} came at {came_secs}",
            frame.index
        );
    }
}

#[test]
fn a_recording_that_repeats_goes_on_counting() {
    let options = LiveOptions {
        wanted: WantedFormat::default(),
        mirror: true,
        repeats: true,
    };
    let (frames, _) = play(&options, 125);
    assert_eq!(frames.len(), 125);
    for (number, frame) in frames.iter().enumerate() {
        assert_eq!(frame.index as usize, number);
        let expected_secs = number as f64 / 30.0;
        assert!(
            (frame.time_secs - expected_secs).abs() < 1e-9,
            "frame {number}"
        );
    }
    let mut first = frames[0].clone();
    assert!(first.rgba == frames[120].rgba, "the same pictures again");
    first.mirror();
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/lamp");
    let mut recording = crate::capture::FrameSource::open(path).unwrap();
    assert!(first.rgba == recording.next_frame().unwrap().unwrap().rgba);
}
