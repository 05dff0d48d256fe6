//! Record: a camera in, a session out, without a window.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::{Result, bail};

use crate::app::files::job_files::{JobFiles, Replacing};
use crate::app::files::result_kind::ResultKind;
use crate::app::input::capture_talk::say;
use crate::app::input::live_capture::{Arrived, CaptureEvent, LiveCapture};
use crate::app::input::live_input::LiveInput;
use crate::app::recording::session_recorder::{Recorded, SessionRecorder};
use crate::app::recording::session_writer::SessionHead;
use crate::app::stages::progress::Progress;
use crate::app::stopwatch::Stopwatch;
use crate::app::talk::counted;
use crate::scene::CameraSettings;

const PATIENCE: Duration = Duration::from_millis(50);

/// A request to record a session.
#[derive(Debug, Clone)]
pub struct RecordRequest {
    /// The camera, the stream or the recording.
    pub input: RecordInput,
    /// The session's folder.
    pub out: PathBuf,
    /// When to end by itself, seconds of frames.
    pub seconds: Option<f64>,
    /// What the session may take the place of.
    pub replacing: Replacing,
}

/// The source of the frames, and what says so.
#[derive(Debug, Clone)]
pub enum RecordInput {
    /// A scene file, which is copied into the session.
    Scene(PathBuf),
    /// A camera that no scene describes.
    Camera(CameraSettings),
}

/// Records until `stop`, the end of a recording, or the time that was asked for; what was done, in words.
///
/// # Errors
/// A source that cannot be opened, frames that do not come, or a session that cannot be written; what was recorded until
/// then is whole.
pub fn record(request: &RecordRequest, stop: &AtomicBool) -> Result<String> {
    let mut files = JobFiles::new(request.replacing);
    let (camera, scene) = match &request.input {
        RecordInput::Scene(path) => (files.reads_scene(path)?.camera, Some(path.clone())),
        RecordInput::Camera(camera) => {
            files.reads_camera(camera);
            (camera.clone(), None)
        }
    };
    files.writes("--out", &request.out, ResultKind::Session);
    files.check()?;
    let input = LiveInput::of(&camera)?;
    let options = input.options(false);
    let head = SessionHead {
        calibration: input.calibration,
        scene,
        replacing: request.replacing,
        ..SessionHead::default()
    };
    let recorder = SessionRecorder::start(&request.out, head)?;
    let now = Arc::new(Stopwatch::clock());
    let capture = LiveCapture::start(&camera.source, &options, now, Some(recorder.tap()));
    let watched = watch(&capture, &recorder, request.seconds, stop);
    let broken_pictures = capture.broken_pictures();
    drop(capture);
    let recorded = recorder.finish()?;
    watched?;
    if recorded.frames == 0 {
        bail!("no frame came; nothing was recorded");
    }
    Ok(summary(request, recorded, broken_pictures))
}

fn summary(request: &RecordRequest, recorded: Recorded, broken_pictures: u64) -> String {
    let Recorded { frames, dropped } = recorded;
    let frames = counted(frames as usize, "frame");
    let mut text = format!("{frames} in {}", request.out.display());
    if dropped > 0 {
        text +=
            &format!("; {dropped} more were dropped, because the encoder was too slow for them");
    }
    if broken_pictures > 0 {
        text += &format!("; {broken_pictures} broken pictures were left out");
    }
    text
}

/// Until something ends the recording.
fn watch(
    capture: &LiveCapture,
    recorder: &SessionRecorder,
    seconds: Option<f64>,
    stop: &AtomicBool,
) -> Result<()> {
    let progress = Progress::new(None);
    let frames = capture.frames();
    let mut first_secs = None;
    while !stop.load(Ordering::Relaxed) && !recorder.has_ended() {
        if let Some(event) = capture.next_event() {
            say(&event);
            match event {
                CaptureEvent::Failed(error) => return Err(error.into()),
                CaptureEvent::Ended => break,
                _ => {}
            }
        }
        let crate::app::input::mailbox::Taken::New(Arrived { frame, .. }) =
            frames.take_within(PATIENCE)
        else {
            continue;
        };
        progress.advance();
        let recorded_secs = frame.time_secs - *first_secs.get_or_insert(frame.time_secs);
        if seconds.is_some_and(|seconds| recorded_secs >= seconds) {
            break;
        }
    }
    progress.finish();
    Ok(())
}
