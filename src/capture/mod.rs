//! Frames from sessions, videos, folders of images and live cameras, and the calibration of the camera that took them.
//! OpenCV's types stay inside.

mod alignment;
pub mod ball;
pub mod calibration;
pub mod children;
mod error;
pub mod exposures;
mod images;
mod jpeg_end;
pub mod linear;
pub mod live;
mod pixels;
mod several_pictures;
mod times;
pub mod video;

use std::path::{Path, PathBuf};

use crate::geometry::camera::Intrinsics;
use crate::geometry::quarter_turns::QuarterTurns;
use crate::scene::plain_file;

pub use calibration::{
    Assumed, CalibrationError, calibration_text, check_frame_size, load_calibration,
    load_calibration_among, load_calibration_for,
};
pub use error::{CaptureError, Notice, notices_told};

use images::{Image, ImageFrames};
use times::FrameTimes;
use video::{Place, VideoFrames};

/// A picture with its place in the recording; the pixels are as the camera gave them (distorted, sRGB).
#[derive(Debug, Clone)]
pub struct Frame {
    /// Number of the frame in its recording, from 0.
    pub index: u32,
    /// Time since the recording's first frame by the recording's own time stamps, seconds.
    pub time_secs: f64,
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// 8-bit RGBA, rows from the top, alpha 255.
    pub rgba: Vec<u8>,
}

impl Frame {
    /// Turns the picture left for right.
    pub fn mirror(&mut self) {
        let pixels: &mut [[u8; 4]] = bytemuck::cast_slice_mut(&mut self.rgba);
        let width = self.size_px[0] as usize;
        if width > 0 {
            pixels.chunks_exact_mut(width).for_each(<[_]>::reverse);
        }
    }
}

/// A recording that hands out its frames in order: a session folder, a video file or a folder of images.
///
/// Frames that cannot be decoded are left out and told of in [`FrameSource::notices`]; all others come, each with
/// the index that it has in the recording.
pub struct FrameSource {
    path: PathBuf,
    pictures: PictureSource,
    times: FrameTimes,
    calibration: Option<Intrinsics>,
    passed_over: Option<String>,
    notices: Vec<Notice>,
    good_frames: u32,
    mirrored: bool,
}

enum PictureSource {
    Video(Box<VideoFrames>),
    Images(ImageFrames),
}

/// What a session folder calls its calibration, the preferred one first.
const CALIBRATION_NAMES: [&str; 5] = [
    "camera.toml",
    "camera.json",
    "camera.yaml",
    "camera.yml",
    "session.json",
];
const TIMES_NAME: &str = "times.csv";
const VIDEO_EXTENSIONS: [&str; 8] = ["mp4", "mkv", "avi", "mov", "webm", "m4v", "mpg", "ts"];

impl FrameSource {
    /// Opens a session folder (`video.*` with `camera.toml`, perhaps `times.csv`), a video file or a folder of images.
    pub fn open(source: &str) -> Result<Self, CaptureError> {
        if live::is_live(source) {
            return Err(CaptureError::Live {
                source_name: source.to_owned(),
            });
        }
        let path = Path::new(source);
        let io_error = |error| CaptureError::Io {
            path: path.to_owned(),
            error,
        };
        let metadata = std::fs::metadata(path).map_err(|error| match error.kind() {
            std::io::ErrorKind::NotFound => CaptureError::Missing {
                path: path.to_owned(),
            },
            _ => io_error(error),
        })?;
        // A pipe would be waited for.
        if !metadata.is_dir() && !metadata.is_file() {
            return Err(io_error(plain_file::not_plain()));
        }
        if metadata.is_dir() {
            let (files, folders) = contents_of(path).map_err(io_error)?;
            Self::open_folder(path, files, &folders)
        } else if images::is_image(path) {
            let images = ImageFrames::open(path, vec![path.to_owned()])?;
            Ok(Self::new(
                path,
                PictureSource::Images(images),
                FrameTimes::default(),
                None,
            ))
        } else {
            let video = VideoFrames::open(path)?;
            Ok(Self::new(
                path,
                PictureSource::Video(Box::new(video)),
                FrameTimes::default(),
                None,
            ))
        }
    }

    fn open_folder(
        folder: &Path,
        files: Vec<PathBuf>,
        folders: &[PathBuf],
    ) -> Result<Self, CaptureError> {
        let named = |name: &str| {
            files
                .iter()
                .find(|file| file.file_name().is_some_and(|found| found == name))
        };
        let videos: Vec<&PathBuf> = files.iter().filter(|file| is_session_video(file)).collect();
        let mut passed_over = None;
        let pictures = match videos.as_slice() {
            [] => {
                let pictures: Vec<PathBuf> = files
                    .iter()
                    .filter(|file| images::is_image(file))
                    .cloned()
                    .collect();
                if pictures.is_empty() {
                    return Err(CaptureError::NoPictures {
                        path: folder.to_owned(),
                        there: what_is_there(&files, folders),
                    });
                }
                passed_over = passed_over_among(&files);
                PictureSource::Images(ImageFrames::open(folder, pictures)?)
            }
            [video] => PictureSource::Video(Box::new(VideoFrames::open(video)?)),
            [first, second, ..] => {
                return Err(CaptureError::SeveralVideos {
                    path: folder.to_owned(),
                    first: first.to_path_buf(),
                    second: second.to_path_buf(),
                });
            }
        };
        let times = named(TIMES_NAME)
            .map(|file| FrameTimes::load(file))
            .transpose()?
            .unwrap_or_default();
        let size_px = pictures.size_px();
        let calibration = CALIBRATION_NAMES
            .iter()
            .find_map(|name| named(name))
            .map(|file| calibration::load_calibration_or_fill(file, size_px))
            .transpose()?;
        Ok(Self {
            passed_over,
            ..Self::new(folder, pictures, times, calibration)
        })
    }

    fn new(
        path: &Path,
        pictures: PictureSource,
        times: FrameTimes,
        calibration: Option<Intrinsics>,
    ) -> Self {
        Self {
            path: path.to_owned(),
            pictures,
            times,
            calibration,
            passed_over: None,
            notices: Vec::new(),
            good_frames: 0,
            mirrored: false,
        }
    }

    /// Whether each picture is turned left for right before anything else sees it: some webcams mirror theirs. The
    /// calibration is then that of the turned pictures.
    #[must_use]
    pub fn mirrored(self, mirrored: bool) -> Self {
        Self { mirrored, ..self }
    }

    /// The same with each picture of a folder of its own size and as the camera's sensor has it, whatever its EXIF says of
    /// how the camera was held. (Frames of a video are all of one size, and shown as it says.)
    #[must_use]
    pub fn as_taken(mut self) -> Self {
        if let PictureSource::Images(images) = &mut self.pictures {
            images.take_as_taken();
        }
        self
    }

    /// The turn by which the last frame is shown, where frames come [as taken](Self::as_taken).
    pub fn shown_turn(&self) -> QuarterTurns {
        match &self.pictures {
            PictureSource::Video(_) => QuarterTurns::NONE,
            PictureSource::Images(images) => images.shown_turn(),
        }
    }

    /// Where the recording lies.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The calibration that the session carries. Whether its size is that of the frames, [`check_frame_size`] tells.
    pub fn calibration(&self) -> Option<Intrinsics> {
        self.calibration
    }

    /// How many frames the recording says it has; a broken one may give fewer.
    pub fn frame_count(&self) -> Option<u32> {
        match &self.pictures {
            PictureSource::Video(video) => video.announced_frames(),
            PictureSource::Images(images) => Some(images.frame_count()),
        }
    }

    /// Frames per second.
    pub fn fps(&self) -> f64 {
        let nominal = match &self.pictures {
            PictureSource::Video(video) => video.fps(),
            PictureSource::Images(_) => images::ASSUMED_FPS,
        };
        self.times.fps().unwrap_or(nominal)
    }

    /// The rate of the shortest steps between frames, for files that have no other times.
    pub fn finest_fps(&self) -> f64 {
        let by_stamps = match &self.pictures {
            PictureSource::Video(video) if self.times.is_empty() => Some(video.finest_fps()),
            _ => self.times.finest_fps(),
        };
        by_stamps.unwrap_or_else(|| self.fps())
    }

    /// Width and height of every frame, pixels.
    pub fn size_px(&self) -> [u32; 2] {
        self.pictures.size_px()
    }

    /// The next good frame; `None` at the end.
    pub fn next_frame(&mut self) -> Result<Option<Frame>, CaptureError> {
        let picture = match &mut self.pictures {
            PictureSource::Video(video) => {
                let size_px = video.size_px();
                let picture = video.next_picture(&mut self.notices)?;
                picture.map(|(place, rgba)| (place, size_px, rgba))
            }
            PictureSource::Images(images) => {
                let picture = images.next_picture(&mut self.notices)?;
                picture.map(
                    |Image {
                         index,
                         size_px,
                         rgba,
                     }| { (images::place_of(index), size_px, rgba) },
                )
            }
        };
        let Some((Place { index, time_secs }, size_px, rgba)) = picture else {
            return Ok(None);
        };
        self.good_frames += 1;
        let time_secs = self
            .times
            .time_secs(index, 1.0 / self.fps())
            .unwrap_or(time_secs);
        let mut frame = Frame {
            index,
            time_secs,
            size_px,
            rgba,
        };
        if self.mirrored {
            frame.mirror();
        }
        Ok(Some(frame))
    }

    /// What is done to the pictures, or guessed of them, that a user should know.
    pub fn remark(&self) -> Option<String> {
        let of_pictures = match &self.pictures {
            PictureSource::Video(video) => video.remark(),
            PictureSource::Images(_) => None,
        };
        let of_pictures = of_pictures.map(|remark| format!("{}: {remark}", self.path.display()));
        let missing = self
            .frame_count()
            .and_then(|frames| self.times.missing(frames));
        let of_times =
            missing.map(|missing| format!("{}: {missing}", self.path.join(TIMES_NAME).display()));
        let remarks = [of_pictures, of_times, self.passed_over()];
        let remarks: Vec<String> = remarks.into_iter().flatten().collect();
        (!remarks.is_empty()).then(|| remarks.join("; "))
    }

    /// The pictures of a folder that are of no kind that is read there, and what to do with them.
    pub fn passed_over(&self) -> Option<String> {
        let passed_over = self.passed_over.as_ref()?;
        Some(format!("{}: {passed_over}", self.path.display()))
    }

    /// What is known of the frames' times once they were read: how many had none of their own.
    pub fn remark_of_times(&self) -> Option<String> {
        let PictureSource::Video(video) = &self.pictures else {
            return None;
        };
        let moved = video.moved_frames();
        (moved > 0 && self.times.is_empty()).then(|| {
            format!(
                "{}: {moved} frames had no time of their own, or one that does not increase; they are placed after the frame \
                 before them",
                self.path.display()
            )
        })
    }

    /// What went wrong so far without ending the recording; whole once [`FrameSource::next_frame`] gave `None`.
    pub fn notices(&self) -> &[Notice] {
        &self.notices
    }

    /// Frames handed out so far.
    pub fn good_frames(&self) -> u32 {
        self.good_frames
    }
}

impl PictureSource {
    fn size_px(&self) -> [u32; 2] {
        match self {
            Self::Video(video) => video.size_px(),
            Self::Images(images) => images.size_px(),
        }
    }
}

/// The files and the folders in a folder.
fn contents_of(folder: &Path) -> std::io::Result<(Vec<PathBuf>, Vec<PathBuf>)> {
    let (mut files, mut folders) = (Vec::new(), Vec::new());
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        // What is hidden is no picture: macOS leaves `._1.png` beside each file on foreign disks.
        let is_hidden = path
            .file_name()
            .is_some_and(|name| name.as_encoded_bytes().starts_with(b"."));
        if is_hidden {
            continue;
        }
        if path.is_file() {
            files.push(path);
        } else if path.is_dir() {
            folders.push(path);
        }
    }
    files.sort();
    folders.sort();
    Ok((files, folders))
}

/// What is said of pictures that nothing here reads.
const TO_BE_SAVED: &str = "have to be saved as JPEG or PNG first";

/// Pictures that are no frames beside those that are, in words.
fn passed_over_among(files: &[PathBuf]) -> Option<String> {
    const EXTENSIONS: [&str; 13] = [
        "heic", "heif", "avif", "jxl", "jp2", "gif", "dng", "cr2", "cr3", "nef", "arw", "orf",
        "rw2",
    ];
    let unread: Vec<&PathBuf> = files
        .iter()
        .filter(|file| has_extension(file, &EXTENSIONS))
        .collect();
    let count = unread.len();
    let are = if count == 1 { "is" } else { "are" };
    (count > 0).then(|| {
        format!(
            "{} {are} passed over: such pictures {TO_BE_SAVED}",
            listed(&unread)
        )
    })
}

/// The names of the first files.
fn listed(files: &[impl AsRef<Path>]) -> String {
    const LISTED: usize = 3;
    let name_of = |file: &Path| {
        let name = file.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    };
    let names: Vec<String> = files
        .iter()
        .take(LISTED)
        .map(|file| name_of(file.as_ref()))
        .collect();
    let more = if files.len() > LISTED { ", …" } else { "" };
    format!("{}{more}", names.join(", "))
}

/// What a folder has in place of a recording, in words that go on a sentence.
fn what_is_there(files: &[PathBuf], folders: &[PathBuf]) -> String {
    let is_video = |file: &&PathBuf| has_extension(file, &VIDEO_EXTENSIONS);
    if let Some(video) = files.iter().find(is_video) {
        return format!(
            "; a video by another name is meant by its own path, as {}",
            video.display()
        );
    }
    let names = listed(files);
    let is_heic = files
        .iter()
        .any(|file| has_extension(file, &["heic", "heif", "avif"]));
    if let ([], [first, ..]) = (files, folders) {
        return format!(
            "; it has nothing but folders ({}), which are named by their own paths, as {}",
            listed(folders),
            first.display()
        );
    }
    match (files.is_empty(), is_heic) {
        (true, _) => "; it is empty".to_owned(),
        (false, false) => format!("; it has {names}"),
        (false, true) => format!("; it has {names}, which {TO_BE_SAVED}"),
    }
}

fn is_session_video(file: &Path) -> bool {
    file.file_stem().is_some_and(|stem| stem == "video") && has_extension(file, &VIDEO_EXTENSIONS)
}

fn has_extension(file: &Path, extensions: &[&str]) -> bool {
    file.extension()
        .and_then(|extension| extension.to_str())
        .is_some_and(|extension| {
            extensions
                .iter()
                .any(|known| known.eq_ignore_ascii_case(extension))
        })
}

#[cfg(test)]
mod tests;
