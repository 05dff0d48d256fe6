//! What the window's keys record: the camera as a session, the composite as a video, a single picture.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::composite_video::CompositeVideo;
use super::frame_tracker::TrackedPicture;
use super::pipeline::Pipeline;
use crate::app::files::output_error::OutputError;
use crate::app::files::picture_files::{rgb_png, write_first};
use crate::app::recording::session_recorder::SessionRecorder;
use crate::app::recording::session_writer::SessionHead;
use crate::app::talk::counted;

/// The recordings that are under way, and where to.
pub struct Recorders {
    folder: PathBuf,
    session: Option<(PathBuf, SessionRecorder)>,
    /// Sessions that have ended, while what waits for the encoder is written.
    ending: Vec<(PathBuf, SessionRecorder)>,
    video: Option<CompositeVideo>,
}

impl Recorders {
    /// Nothing is recorded yet; files will go into `folder`.
    pub fn new(folder: PathBuf) -> Self {
        Self {
            folder,
            session: None,
            ending: Vec::new(),
            video: None,
        }
    }

    /// Whether a session is being recorded.
    pub fn records_session(&self) -> bool {
        self.session.is_some()
    }

    /// Frames that have yet to be written of sessions that have ended; `None` where there is no such session.
    pub fn frames_being_written(&self) -> Option<usize> {
        let waiting = self.ending.iter().map(|(_, session)| session.waiting());
        (!self.ending.is_empty()).then(|| waiting.sum())
    }

    /// Whether a video of the composite is.
    pub fn records_video(&self) -> bool {
        self.video.is_some()
    }

    /// Begins to record the camera as a session, or ends it: what is left is then written beside everything else. What was
    /// done, in words, where there is anything to say yet.
    ///
    /// # Errors
    /// What kept it from being written; what was until then is whole.
    pub fn toggle_session(
        &mut self,
        pipeline: &Pipeline,
        head: SessionHead,
    ) -> Result<Option<String>, OutputError> {
        if self.session.is_some() {
            self.end_session(pipeline);
            return Ok(None);
        }
        let (path, recorder) = first_free(&self.folder, "session", "", |path| {
            // Made here, so that it is nobody else's.
            std::fs::create_dir(path).map_err(|error| io_error(path, error))?;
            SessionRecorder::start(path, head.clone())
        })?;
        pipeline.set_tap(Some(recorder.tap()));
        let said = format!("recording {}", path.display());
        self.session = Some((path, recorder));
        Ok(Some(said))
    }

    /// Begins to record the composite, or ends it. What was done, in words.
    ///
    /// # Errors
    /// As [`Recorders::toggle_session`].
    pub fn toggle_video(&mut self, size_px: [u32; 2], fps: f64) -> Result<String, OutputError> {
        if self.video.is_some() {
            return self.end_video();
        }
        // Matroska alone is whole at every moment.
        let (path, video) = first_free(&self.folder, "composite", ".mkv", |path| {
            CompositeVideo::start(path, size_px, fps)
        })?;
        self.video = Some(video);
        Ok(format!("recording {}", path.display()))
    }

    /// Writes a picture as it is shown.
    ///
    /// # Errors
    /// What kept it from being written.
    pub fn screenshot(&self, size_px: [u32; 2], rgba: &[u8]) -> Result<String, OutputError> {
        let (path, ()) = first_free(&self.folder, "picture", ".png", |path| {
            write_first(path, &rgb_png(path, size_px, rgba)?)
        })?;
        Ok(format!("{} saved", path.display()))
    }

    /// A frame was tracked.
    pub fn add_poses(&self, picture: &TrackedPicture) {
        if let (Some((_, session)), true) = (&self.session, !picture.poses.is_empty()) {
            let of = (picture.frame.index, picture.frame.time_secs);
            session.add_poses(of, &picture.poses, Some(picture.track_ms));
        }
    }

    /// A frame was drawn.
    pub fn add_composite(&mut self, size_px: [u32; 2], time_secs: f64, rgba: Vec<u8>) {
        if let Some(video) = &mut self.video {
            video.add(size_px, time_secs, rgba);
        }
    }

    /// What there is to say of what has been written to its end, or has failed by itself.
    pub fn take_ended(&mut self, pipeline: &Pipeline) -> Option<Result<String, OutputError>> {
        if self.session.as_ref().is_some_and(|(_, s)| s.has_ended()) {
            self.end_session(pipeline);
        }
        let ended = self.ending.iter().position(|(_, s)| s.has_ended());
        if let Some(index) = ended {
            return Some(written(self.ending.remove(index)));
        }
        let has_failed = self.video.as_ref().is_some_and(CompositeVideo::has_failed);
        has_failed.then(|| self.end_video())
    }

    /// Ends all recording: what there is to say of each.
    pub fn finish(&mut self, pipeline: &Pipeline) -> Vec<Result<String, OutputError>> {
        self.end_session(pipeline);
        let sessions = self.ending.drain(..).map(written);
        let mut said: Vec<_> = sessions.collect();
        said.extend(self.video.is_some().then(|| self.end_video()));
        said
    }

    fn end_session(&mut self, pipeline: &Pipeline) {
        if let Some((path, recorder)) = self.session.take() {
            pipeline.set_tap(None);
            recorder.end();
            self.ending.push((path, recorder));
        }
    }

    fn end_video(&mut self) -> Result<String, OutputError> {
        let video = self.video.take();
        video.map_or(Ok(String::new()), CompositeVideo::finish)
    }
}

/// Waits until a session is whole: what there is to say of it.
fn written((path, recorder): (PathBuf, SessionRecorder)) -> Result<String, OutputError> {
    let recorded = recorder.finish()?;
    let lost = match recorded.dropped {
        0 => String::new(),
        dropped => format!("; {dropped} more were dropped, the encoder was too slow"),
    };
    Ok(match recorded.frames {
        0 => format!("no frame came, so there is no session{lost}"),
        frames => {
            let frames = counted(frames as usize, "frame");
            format!("{frames} in {}{lost}", path.display())
        }
    })
}

/// Makes something under the first name with a number that nothing has yet, `stem-001.png`, whoever else takes names there.
fn first_free<T>(
    folder: &Path,
    stem: &str,
    extension: &str,
    make: impl Fn(&Path) -> Result<T, OutputError>,
) -> Result<(PathBuf, T), OutputError> {
    std::fs::create_dir_all(folder).map_err(|error| io_error(folder, error))?;
    let mut number = 1_u32;
    loop {
        let path = folder.join(format!("{stem}-{number:03}{extension}"));
        let is_taken = |error: &OutputError| {
            matches!(error, OutputError::Io { error, .. } if error.kind() == ErrorKind::AlreadyExists)
                && std::fs::symlink_metadata(&path).is_ok()
        };
        match make(&path) {
            Err(error) if is_taken(&error) => number += 1,
            made => return made.map(|made| (path, made)),
        }
    }
}

fn io_error(path: &Path, error: std::io::Error) -> OutputError {
    OutputError::Io {
        path: path.to_owned(),
        error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_that_is_there_is_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let recorders = Recorders::new(folder.path().to_owned());
        let pixels = [9, 8, 7, 255].repeat(6);
        for number in 1..4 {
            let said = recorders.screenshot([3, 2], &pixels).unwrap();
            assert!(said.contains(&format!("picture-00{number}.png")), "{said}");
        }
        std::fs::remove_file(folder.path().join("picture-002.png")).unwrap();
        let said = recorders.screenshot([3, 2], &pixels).unwrap();
        assert!(said.contains("picture-002.png"), "{said}");
        #[cfg(unix)]
        {
            let elsewhere = folder.path().join("elsewhere");
            let planted = folder.path().join("picture-004.png");
            std::os::unix::fs::symlink(&elsewhere, planted).unwrap();
            let said = recorders.screenshot([3, 2], &pixels).unwrap();
            assert!(
                said.contains("picture-005.png") && !elsewhere.exists(),
                "{said}"
            );
        }
    }
}
