//! Writes a session as it happens: every frame losslessly, when it came, the camera's calibration, the scene, and the
//! poses where there are some. At any moment what is there is whole: a kill or a full disk ends it, nothing more.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use super::scene_copy::copy_scene;
use super::session_folder::{SessionFolder, VIDEO_NAME};
use crate::app::files::is_at;
use crate::app::files::job_files::Replacing;
use crate::app::files::new_file::{sync_folder, vanished};
use crate::app::files::output_error::OutputError;
use crate::app::files::poses_file::PosesText;
use crate::app::files::video_writer::{Codec, Naming, Pace, VideoWriter};
use crate::capture::{Frame, FrameSource, calibration_text, check_frame_size};
use crate::geometry::camera::Intrinsics;
use crate::scene::Anchor;
use crate::tracking::AnchorPose;

/// For sources that do not say their own rate.
const ASSUMED_FPS: f64 = 30.0;
/// Frames that remember which number they got, for poses that come later.
const REMEMBERED: usize = 512;

/// All that a session is besides its frames.
#[derive(Debug, Clone, Default)]
pub struct SessionHead {
    /// Frames per second that the video's own header says; `None`: 30. Each frame has its own time besides.
    pub fps: Option<f64>,
    /// The camera's, where it is known.
    pub calibration: Option<Intrinsics>,
    /// A scene file to be copied into the session.
    pub scene: Option<PathBuf>,
    /// Of which poses will be given; none: no poses are.
    pub anchors: Vec<Anchor>,
    /// Whether it may take the place of an older session.
    pub replacing: Replacing,
}

/// A session that is being written. Dropped, it ends as if it were finished.
pub struct SessionWriter {
    folder: SessionFolder,
    head: SessionHead,
    times: GrowingFile,
    poses: Option<(GrowingFile, PosesText)>,
    video: Option<VideoWriter>,
    frames: u32,
    last_secs: Option<f64>,
    /// The numbers in the session, by those that the frames came with.
    numbers: BTreeMap<u32, u32>,
    /// Whether all that was given is on the disk.
    is_whole: bool,
}

impl SessionWriter {
    /// Makes the folder, which must not be there or be empty, with all but the frames. An older session may be in the way if
    /// the head says so.
    ///
    /// # Errors
    /// A folder that holds something, or what cannot be written into it.
    pub fn create(folder: &Path, head: SessionHead) -> Result<Self, OutputError> {
        let own_folder = SessionFolder::create(folder, head.replacing)?;
        let times = GrowingFile::create(&folder.join("times.csv"), "frame,time_s\n")?;
        let poses = if head.anchors.is_empty() {
            None
        } else {
            let mut text = PosesText::new();
            let file = GrowingFile::create(&folder.join("poses.csv"), &text.take())?;
            Some((file, text))
        };
        let writer = Self {
            folder: own_folder,
            times,
            poses,
            video: None,
            frames: 0,
            last_secs: None,
            numbers: BTreeMap::new(),
            is_whole: false,
            head,
        };
        if let Some(calibration) = &writer.head.calibration {
            let path = folder.join("camera.toml");
            GrowingFile::create(&path, &calibration_text(calibration))?.finish()?;
        }
        if let Some(scene) = &writer.head.scene {
            copy_scene(scene, folder).map_err(|error| writer.refuse(format!("{error:#}")))?;
        }
        Ok(writer)
    }

    /// Frames per second, once the source has told; without effect after the first frame.
    pub(crate) fn set_fps(&mut self, fps: f64) {
        self.head.fps = Some(fps);
    }

    /// Adds a frame; all are of the first one's size.
    ///
    /// # Errors
    /// What kept it from being written; the session ends with the frame before.
    pub fn push(&mut self, frame: &Frame) -> Result<(), OutputError> {
        self.times.check_that_it_is_there()?;
        let mut video = match self.video.take() {
            Some(video) => video,
            None => self.start_video(frame.size_px)?,
        };
        // Its time first: a time without a frame does no harm, a frame without its time does.
        let time_secs = match self.last_secs {
            // Readers count on times that increase.
            Some(last_secs) if frame.time_secs <= last_secs => last_secs.next_up(),
            _ => frame.time_secs,
        };
        let number = self.frames;
        let written = self
            .times
            .add(&format!("{number},{time_secs}\n"))
            .and_then(|()| video.push(frame.size_px, time_secs, &frame.rgba));
        self.video = Some(video);
        written?;
        self.frames += 1;
        self.last_secs = Some(time_secs);
        self.numbers.insert(frame.index, number);
        if self.numbers.len() > REMEMBERED {
            self.numbers.pop_first();
        }
        Ok(())
    }

    /// Adds the poses of a frame that was added before, in the order of the head's anchors; those of other frames are left
    /// out.
    ///
    /// # Errors
    /// What kept them from being written.
    pub fn add_poses(
        &mut self,
        frame: (u32, f64),
        poses: &[AnchorPose],
        track_ms: Option<f64>,
    ) -> Result<(), OutputError> {
        let (index, time_secs) = frame;
        let (Some((file, text)), Some(&number)) = (&mut self.poses, self.numbers.get(&index))
        else {
            return Ok(());
        };
        text.add_frame(
            (number, time_secs),
            &self.head.anchors,
            poses,
            (track_ms, None),
        );
        file.add(&text.take())
    }

    /// Waits until all is written; the number of frames. Without any frame there is no session.
    ///
    /// # Errors
    /// What kept the last frames from being written.
    pub fn finish(mut self) -> Result<u32, OutputError> {
        if let Some(video) = self.video.take() {
            video.finish()?;
            self.times.finish()?;
            if let Some((poses, _)) = &self.poses {
                poses.finish()?;
            }
            sync_folder(Some(self.folder.path()));
            self.is_whole = true;
        }
        Ok(self.frames)
    }

    fn start_video(&self, size_px: [u32; 2]) -> Result<VideoWriter, OutputError> {
        if let Some(calibration) = &self.head.calibration {
            check_frame_size(calibration, size_px, "the camera")
                .map_err(|error| self.refuse(error.to_string()))?;
        }
        let path = self.folder.path().join(VIDEO_NAME);
        let fps = self.head.fps.unwrap_or(ASSUMED_FPS);
        // Each frame's own time is in times.csv.
        let pace = Pace::Even { fps };
        VideoWriter::create(&path, Codec::Ffv1, size_px, pace, Naming::AtOnce)
    }

    fn refuse(&self, message: String) -> OutputError {
        OutputError::Session {
            path: self.folder.path().to_owned(),
            message,
        }
    }
}

impl Drop for SessionWriter {
    fn drop(&mut self) {
        drop(self.video.take());
        // An encoder that fails soon was given frames, and its video has none.
        if self.frames > 0 && (self.is_whole || shows_a_frame(&self.folder.path().join(VIDEO_NAME)))
        {
            self.folder.keep();
        }
    }
}

fn shows_a_frame(video: &Path) -> bool {
    let mut source = video.to_str().map(FrameSource::open).and_then(Result::ok);
    let frame = source.as_mut().map(FrameSource::next_frame);
    matches!(frame, Some(Ok(Some(_))))
}

/// A text file that is whole after each row: what does not fit on to the disk is taken back.
struct GrowingFile {
    path: PathBuf,
    file: File,
    whole_bytes: u64,
}

impl GrowingFile {
    fn create(path: &Path, head: &str) -> Result<Self, OutputError> {
        let file = File::options().append(true).create_new(true).open(path);
        let mut growing = Self {
            path: path.to_owned(),
            file: file.map_err(|error| OutputError::Io {
                path: path.to_owned(),
                error,
            })?,
            whole_bytes: 0,
        };
        growing.add(head)?;
        Ok(growing)
    }

    fn add(&mut self, text: &str) -> Result<(), OutputError> {
        if let Err(error) = self.file.write_all(text.as_bytes()) {
            // Making a file shorter needs no room.
            _ = self.file.set_len(self.whole_bytes);
            return Err(OutputError::Io {
                path: self.path.clone(),
                error,
            });
        }
        self.whole_bytes += text.len() as u64;
        Ok(())
    }

    /// Waits until it is on the disk.
    fn finish(&self) -> Result<(), OutputError> {
        self.check_that_it_is_there()?;
        self.file.sync_all().map_err(|error| OutputError::Io {
            path: self.path.clone(),
            error,
        })
    }

    fn check_that_it_is_there(&self) -> Result<(), OutputError> {
        match is_at(&self.path, &self.file) {
            true => Ok(()),
            false => Err(OutputError::Io {
                path: self.path.clone(),
                error: vanished(),
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::files::poses_file::GivenPoses;
    use crate::tracking::Status;
    use glam::{DAffine3, DVec3};

    fn frame(index: u32, time_secs: f64, size_px: [u32; 2]) -> Frame {
        let area = size_px[0] * size_px[1];
        let rgba = (0..area)
            .flat_map(|k| {
                let hash = (k + index * area).wrapping_mul(2_654_435_761);
                let [_, red, green, blue] = hash.to_le_bytes();
                [red, green, blue, 255]
            })
            .collect();
        Frame {
            index,
            time_secs,
            size_px,
            rgba,
        }
    }

    fn head() -> SessionHead {
        SessionHead::default()
    }

    #[test]
    fn frames_and_times_come_back_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("deep/session");
        let mut writer = SessionWriter::create(&path, head()).unwrap();
        // Dropped frames, uneven times, one that stands still.
        let frames: Vec<Frame> = [
            (3, 0.1),
            (4, 1.0 / 3.0),
            (9, 0.7),
            (10, 0.7),
            (11, 2.0 / 3.0 + 0.1),
        ]
        .map(|(index, time_secs)| frame(index, time_secs, [32, 24]))
        .into();
        for frame in &frames {
            writer.push(frame).unwrap();
        }
        assert_eq!(writer.finish().unwrap(), 5);
        let mut session = FrameSource::open(path.to_str().unwrap()).unwrap();
        for (number, frame) in frames.iter().enumerate() {
            let found = session.next_frame().unwrap().unwrap();
            assert_eq!(found.index as usize, number);
            let expected_secs = if number == 3 {
                0.7_f64.next_up()
            } else {
                frame.time_secs
            };
            assert_eq!(found.time_secs, expected_secs);
            assert!(found.rgba == frame.rgba, "frame {number}");
        }
        assert!(session.next_frame().unwrap().is_none());
        assert!(session.notices().is_empty(), "{:?}", session.notices());
    }

    #[test]
    fn poses_go_by_the_numbers_of_the_session() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session");
        let anchors = vec![Anchor {
            name: "card".to_owned(),
            markers: Vec::new(),
        }];
        let head = SessionHead {
            anchors: anchors.clone(),
            ..head()
        };
        let mut writer = SessionWriter::create(&path, head).unwrap();
        let pose_at = |x_m: f64| AnchorPose {
            status: Status::Tracked,
            camera_from_anchor: Some(DAffine3::from_translation(DVec3::new(x_m, 0.25, 0.5))),
            ..AnchorPose::LOST
        };
        for index in [7, 12] {
            let frame = frame(index, f64::from(index), [32, 24]);
            writer.push(&frame).unwrap();
        }
        writer
            .add_poses((12, 12.0), &[pose_at(0.125)], None)
            .unwrap();
        // A frame that was not recorded.
        writer.add_poses((9, 9.0), &[pose_at(0.75)], None).unwrap();
        writer.finish().unwrap();
        let given = GivenPoses::read(&path.join("poses.csv"), &anchors).unwrap();
        let x_m = |number: u32| {
            let pose = given.of_frame(number)[0].camera_from_anchor;
            pose.map(|pose| pose.translation.x)
        };
        assert_eq!([x_m(0), x_m(1), x_m(9)], [None, Some(0.125), None]);
    }

    #[test]
    fn a_folder_that_holds_something_is_left_alone() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("mine.txt"), "mine").unwrap();
        let refused = SessionWriter::create(folder.path(), head());
        assert!(refused.is_err_and(|error| error.to_string().contains("holds something")));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_older_session_goes_when_the_new_one_has_a_frame_and_nothing_else_goes() {
        let outer = tempfile::tempdir().unwrap();
        let path = outer.path().join("session");
        let record = |frames: u32, replacing: Replacing| {
            let head = SessionHead {
                replacing,
                ..head()
            };
            let mut writer = SessionWriter::create(&path, head)?;
            for index in 0..frames {
                writer
                    .push(&frame(index, f64::from(index), [32, 24]))
                    .unwrap();
            }
            writer.finish()
        };
        let rows = || {
            std::fs::read_to_string(path.join("times.csv"))
                .unwrap()
                .lines()
                .count()
        };
        let count = || std::fs::read_dir(outer.path()).unwrap().count();
        record(3, Replacing::OlderResults).unwrap();
        assert!(record(2, Replacing::OlderResults).is_err());
        assert_eq!((rows(), count()), (4, 1));
        assert_eq!(record(0, Replacing::Anything).unwrap(), 0);
        assert_eq!((rows(), count()), (4, 1), "no frame came");
        record(2, Replacing::Anything).unwrap();
        assert_eq!((rows(), count()), (3, 1));
        std::fs::write(path.join("mine.txt"), "mine").unwrap();
        let refused = record(1, Replacing::Anything).unwrap_err().to_string();
        assert!(refused.contains("mine.txt"), "{refused}");
        assert_eq!((rows(), count()), (3, 1));
    }

    #[test]
    fn a_session_that_is_taken_away_is_told() {
        let outer = tempfile::tempdir().unwrap();
        let path = outer.path().join("session");
        let mut writer = SessionWriter::create(&path, head()).unwrap();
        writer.push(&frame(0, 0.0, [32, 24])).unwrap();
        std::fs::rename(&path, outer.path().join("elsewhere")).unwrap();
        assert!(writer.push(&frame(1, 0.1, [32, 24])).is_err());
        let refused = writer.finish().unwrap_err().to_string();
        assert!(refused.contains("moved or removed"), "{refused}");
        assert!(!path.exists());
    }

    #[test]
    fn a_session_without_frames_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session");
        let writer = SessionWriter::create(&path, head()).unwrap();
        assert_eq!(writer.finish().unwrap(), 0);
        assert!(!path.exists());
    }

    #[test]
    fn a_frame_of_another_size_ends_it_and_the_rest_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("session");
        let mut writer = SessionWriter::create(&path, head()).unwrap();
        writer.push(&frame(0, 0.0, [32, 24])).unwrap();
        writer.push(&frame(1, 0.1, [32, 24])).unwrap();
        assert!(writer.push(&frame(2, 0.2, [24, 32])).is_err());
        drop(writer);
        let mut session = FrameSource::open(path.to_str().unwrap()).unwrap();
        let mut frames = 0;
        while session.next_frame().unwrap().is_some() {
            frames += 1;
        }
        assert_eq!((frames, session.notices()), (2, &[][..]));
    }
}
