//! The composite as a video of even rate, made of frames that come when they come: a thread feeds the encoder.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use crate::app::files::output_error::OutputError;
use crate::app::files::video_writer::{Codec, Naming, Pace, VideoWriter};

/// Frames that may wait for the encoder; more are left out, and the one before is seen for longer.
const QUEUE: usize = 16;
/// A pause of the camera is shown no longer than this, seconds.
const LONGEST_PAUSE_SECS: f64 = 10.0;

/// A video that is being recorded.
pub struct CompositeVideo {
    path: PathBuf,
    size_px: [u32; 2],
    to_writer: SyncSender<(f64, Vec<u8>)>,
    thread: JoinHandle<Result<u32, OutputError>>,
    left_out: u64,
}

impl CompositeVideo {
    /// Starts the encoder; the video is there at once and whole at every moment.
    ///
    /// # Errors
    /// As [`VideoWriter::create`].
    pub fn start(path: &Path, size_px: [u32; 2], fps: f64) -> Result<Self, OutputError> {
        let pace = Pace::Even { fps };
        let writer = VideoWriter::create(path, Codec::Ffv1, size_px, pace, Naming::AtOnce)?;
        let (to_writer, frames) = sync_channel(QUEUE);
        let thread = std::thread::spawn(move || write(writer, size_px, fps, &frames));
        Ok(Self {
            path: path.to_owned(),
            size_px,
            to_writer,
            thread,
            left_out: 0,
        })
    }

    /// Adds a frame of 8-bit RGBA with its own time, without waiting. One of another size does not fit and is left out.
    pub fn add(&mut self, size_px: [u32; 2], time_secs: f64, rgba: Vec<u8>) {
        let fits = size_px == self.size_px;
        let sent = fits.then(|| self.to_writer.try_send((time_secs, rgba)));
        // A writer that has ended tells why when it is asked.
        if matches!(sent, None | Some(Err(TrySendError::Full(_)))) {
            self.left_out += 1;
        }
    }

    /// Whether it has ended by itself: [`CompositeVideo::finish`] tells why.
    pub fn has_failed(&self) -> bool {
        self.thread.is_finished()
    }

    /// Writes what waits, and ends the video. What was done, in words.
    ///
    /// # Errors
    /// What kept a frame from being written; those before are whole.
    pub fn finish(self) -> Result<String, OutputError> {
        drop(self.to_writer);
        let written = self.thread.join();
        let frames = written.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        let path = self.path.display();
        Ok(match (frames, self.left_out) {
            (0, _) => "no frame came, so there is no video".to_owned(),
            (_, 0) => format!("{frames} frames in {path}"),
            (_, left_out) => format!("{frames} frames in {path}; {left_out} were left out"),
        })
    }
}

fn write(
    mut writer: VideoWriter,
    size_px: [u32; 2],
    fps: f64,
    frames: &Receiver<(f64, Vec<u8>)>,
) -> Result<u32, OutputError> {
    let mut pace = Due::new(fps);
    let mut before: Option<Vec<u8>> = None;
    let mut written = 0;
    for (time_secs, rgba) in frames {
        let due = pace.due(time_secs);
        // Until this frame came, the one before was seen.
        for copy in 0..due {
            let pixels = match (&before, copy + 1 < due) {
                (Some(before), true) => before,
                _ => &rgba,
            };
            writer.push(size_px, time_secs, pixels)?;
            written += 1;
        }
        before = Some(rgba);
    }
    writer.finish()?;
    Ok(written)
}

/// The times at which the video's frames are due.
struct Due {
    fps: f64,
    begin_secs: Option<f64>,
    written: u32,
}

impl Due {
    fn new(fps: f64) -> Self {
        Self {
            fps,
            begin_secs: None,
            written: 0,
        }
    }

    /// How many frames are due by the time of a new one.
    fn due(&mut self, time_secs: f64) -> u32 {
        let begin_secs = *self.begin_secs.get_or_insert(time_secs);
        // Half a frame's tolerance: times jitter about their rate.
        let position = (time_secs - begin_secs) * self.fps + 0.5;
        let wanted = position.floor() + 1.0 - f64::from(self.written);
        let longest = (LONGEST_PAUSE_SECS * self.fps).ceil();
        if wanted > longest || position < -longest {
            // A long pause, or a recording that began again: time goes on from here.
            self.begin_secs = Some(time_secs - f64::from(self.written) / self.fps);
            self.written += 1;
            return 1;
        }
        let due = wanted.max(0.0) as u32;
        self.written += due;
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::FrameSource;

    #[test]
    fn frames_are_due_by_their_times() {
        let mut pace = Due::new(30.0);
        let even: u32 = (0..300)
            .map(|frame| pace.due(5.0 + f64::from(frame) / 30.0))
            .sum();
        assert_eq!(even, 300);
        let mut pace = Due::new(30.0);
        let slow: Vec<u32> = (0..10)
            .map(|frame| pace.due(f64::from(frame) / 10.0))
            .collect();
        assert_eq!(slow, [1, 3, 3, 3, 3, 3, 3, 3, 3, 3]);
        assert_eq!(pace.due(1.0 + 3600.0), 1, "an hour without a camera");
        assert_eq!(pace.due(1.0 + 3600.0 + 1.0 / 30.0), 1);
        assert_eq!(pace.due(0.0), 1, "a recording from its beginning");
    }

    #[test]
    fn what_was_added_is_in_the_video() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mkv");
        let size_px = [32, 24];
        let mut video = CompositeVideo::start(&path, size_px, 20.0).unwrap();
        let flat = |level: u8| [level, level, level, 255].repeat(32 * 24);
        for (time_secs, level) in [(0.0, 10), (0.15, 20), (0.2, 30)] {
            video.add(size_px, time_secs, flat(level));
        }
        video.add([24, 32], 0.25, flat(40));
        let said = video.finish().unwrap();
        assert!(
            said.starts_with("5 frames in ") && said.ends_with("1 were left out"),
            "{said}"
        );
        let mut source = FrameSource::open(path.to_str().unwrap()).unwrap();
        let mut levels = Vec::new();
        while let Some(frame) = source.next_frame().unwrap() {
            levels.push(frame.rgba[0]);
        }
        assert_eq!(levels, [10, 10, 10, 20, 30]);
    }
}
