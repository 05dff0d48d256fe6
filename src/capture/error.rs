//! What can go wrong with a recording: errors end it, notices do not.

use std::fmt;
use std::path::{Path, PathBuf};

use super::calibration::CalibrationError;
use crate::geometry::camera::MOST_SIDE_PX;

/// Why a recording cannot be opened or read on.
#[derive(Debug, thiserror::Error)]
pub enum CaptureError {
    /// The scene names a camera or a stream.
    #[error(
        "{source_name}: a live source, of which no frame comes twice; record it first (gnomon record {source_name} --out \
         DIR), or name a session folder, a video file or a folder of images"
    )]
    Live {
        /// As the scene says.
        source_name: String,
    },
    /// There is nothing at this path.
    #[error("{}: no such file or folder{}", path.display(), pattern_hint(path))]
    Missing {
        /// What was looked for.
        path: PathBuf,
    },
    /// The system refuses to read it.
    #[error("{}: {error}", path.display())]
    Io {
        /// What was to be read.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A folder without a video and without pictures.
    #[error("{}: the folder holds neither a video (video.mp4, .mkv, .avi, …) nor pictures (.png, .jpg, …){there}", path.display())]
    NoPictures {
        /// The folder.
        path: PathBuf,
        /// What it holds instead, after a semicolon, or nothing.
        there: String,
    },
    /// A session folder in which more than one file could be the recording.
    #[error("{}: both {} and {} could be the session's video; leave one", path.display(), first.display(), second.display())]
    SeveralVideos {
        /// The folder.
        path: PathBuf,
        /// One candidate.
        first: PathBuf,
        /// Another candidate.
        second: PathBuf,
    },
    /// FFmpeg does not know the file as a video.
    #[error(
        "{}: cannot be opened as a video; it is of an unknown format, or it was cut off before its index was written{said}",
        path.display()
    )]
    NotAVideo {
        /// The file.
        path: PathBuf,
        /// What FFmpeg says, after a colon, or nothing.
        said: String,
    },
    /// FFmpeg reads the file, and there is no video in it.
    #[error("{}: holds no video, but sound or a cover picture alone; a recording is a video or a folder of pictures", path.display())]
    SoundAlone {
        /// The file.
        path: PathBuf,
    },
    /// There is no ffmpeg to decode it.
    #[error("{}: videos are read by ffmpeg, which cannot be started: {error} (Debian: sudo apt install ffmpeg)", path.display())]
    FfmpegMissing {
        /// The video.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A frame's pixels cannot be converted.
    #[error("{}: frame {frame}: {message}", path.display())]
    Pixels {
        /// The video.
        path: PathBuf,
        /// Index of the frame.
        frame: u32,
        /// What is wrong with them.
        message: String,
    },
    /// Not one frame could be decoded.
    #[error("{}: not one frame can be decoded{why}", path.display())]
    NoGoodFrame {
        /// The recording.
        path: PathBuf,
        /// Why, after a colon, or nothing.
        why: String,
    },
    /// Pictures that are all longer or wider than any that is read.
    #[error(
        "{}: pictures of {} x {} pixels; a side has at most {}",
        path.display(), size_px[0], size_px[1], MOST_SIDE_PX
    )]
    TooLong {
        /// The recording.
        path: PathBuf,
        /// Width and height of the first such picture.
        size_px: [u32; 2],
    },
    /// OpenCV failed where it has no reason to.
    #[error("{}: frame {frame}: {message}", path.display())]
    OpenCv {
        /// The recording or the picture.
        path: PathBuf,
        /// Index of the frame.
        frame: u32,
        /// What OpenCV says.
        message: String,
    },
    /// `times.csv` cannot be used.
    #[error("{}:{line}: {message}", path.display())]
    Times {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: usize,
        /// What is wrong there.
        message: String,
    },
    /// The session's calibration cannot be used.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// What to say where no picture is read because all are too large.
pub(super) fn too_many_pixels(most: u64) -> String {
    format!(
        ": it has pictures of more than {most} pixels, the most that are read of such a file; make them smaller"
    )
}

/// What to say of a name that programs of other kinds take for many files.
fn pattern_hint(path: &Path) -> &'static str {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match name.contains(['%', '*', '?']) {
        true => "; pictures are named by their folder, without a pattern",
        false => "",
    }
}

/// What went wrong without ending the recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Notice {
    /// Frames that cannot be decoded, or are missing, with others after them.
    Broken {
        /// The video, or the picture.
        path: PathBuf,
        /// Index of the first such frame.
        first: u32,
        /// How many there are.
        count: u32,
        /// Good frames that came before.
        good_before: u32,
    },
    /// A picture of another size than the first one's.
    OtherSize {
        /// The video, or the picture.
        path: PathBuf,
        /// Index of the frame.
        frame: u32,
        /// The picture's width and height.
        size_px: [u32; 2],
        /// Width and height of the first frame.
        expected_px: [u32; 2],
    },
    /// A picture of a kind that is not read.
    OtherKind {
        /// The picture.
        path: PathBuf,
        /// Index of the frame.
        frame: u32,
        /// What it is, and what to do with it.
        what: &'static str,
    },
    /// A file of several pictures, of which the first is taken.
    FirstOfSeveral {
        /// The file.
        path: PathBuf,
        /// How many it holds.
        pictures: u32,
    },
    /// A picture of more pixels than are read of a file of its size.
    TooLarge {
        /// The picture.
        path: PathBuf,
        /// Index of the frame.
        frame: u32,
        /// The most pixels that are read of it.
        most: u64,
    },
    /// Frames of which parts could not be decoded and were guessed.
    Corrupt {
        /// The video.
        path: PathBuf,
        /// Index of the first such frame.
        first: u32,
        /// How many there are.
        count: u32,
    },
    /// Pictures of which the decoder could not decode all, though it gives them.
    Faulty {
        /// The video.
        path: PathBuf,
        /// Index of the frame that came next.
        near: u32,
        /// What FFmpeg says first.
        said: String,
    },
    /// A video that gives fewer frames than its header says.
    EndedEarly {
        /// The video.
        path: PathBuf,
        /// Good frames in it.
        good: u32,
        /// Index at which nothing more could be read.
        ended_at: u32,
        /// How many frames the header says.
        announced: u32,
    },
    /// A video whose file is cut off, and that does not say how many frames it had.
    CutOff {
        /// The video.
        path: PathBuf,
        /// Good frames in it.
        good: u32,
    },
}

impl Notice {
    /// How many frames this cost.
    pub fn lost_frames(&self) -> u32 {
        match self {
            Self::Broken { count, .. } => *count,
            Self::OtherSize { .. } | Self::TooLarge { .. } | Self::OtherKind { .. } => 1,
            Self::Corrupt { .. }
            | Self::Faulty { .. }
            | Self::CutOff { .. }
            | Self::FirstOfSeveral { .. } => 0,
            Self::EndedEarly {
                ended_at,
                announced,
                ..
            } => announced.saturating_sub(*ended_at),
        }
    }
}

/// All of them in words, one after the other; pictures of another size or kind that follow each other are told as one, and
/// so are files of as many pictures.
pub fn notices_told(notices: &[Notice]) -> String {
    let alike = |one: &Notice, next: &Notice| match (one, next) {
        (Notice::OtherSize { size_px: a, .. }, Notice::OtherSize { size_px: b, .. }) => a == b,
        (Notice::OtherKind { what: a, .. }, Notice::OtherKind { what: b, .. }) => a == b,
        (
            Notice::FirstOfSeveral { pictures: a, .. },
            Notice::FirstOfSeveral { pictures: b, .. },
        ) => a == b,
        _ => false,
    };
    let told = notices.chunk_by(alike).map(|run| match run.len() {
        1 => run[0].to_string(),
        count => format!("{} (and {} more such)", run[0], count - 1),
    });
    told.collect::<Vec<_>>().join("; ")
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Broken {
                path,
                first,
                count,
                good_before,
            } => {
                let name = path.display();
                match count {
                    1 => write!(f, "{name}: frame {first} is broken or missing")?,
                    _ => write!(
                        f,
                        "{name}: frames {first} to {} are broken or missing",
                        first + count - 1
                    )?,
                }
                write!(f, "; {good_before} good frames before, reading goes on")
            }
            Self::OtherSize {
                path,
                frame,
                size_px: [width, height],
                expected_px: [first_width, first_height],
            } => write!(
                f,
                "{}: frame {frame} is {width} x {height}, the first one was {first_width} x {first_height}; left out",
                path.display()
            ),
            Self::TooLarge { path, frame, most } => write!(
                f,
                "{}: frame {frame} has more than {most} pixels, the most that are read of such a file; left out",
                path.display()
            ),
            Self::OtherKind { path, frame, what } => {
                write!(f, "{}: frame {frame} is {what}; left out", path.display())
            }
            Self::FirstOfSeveral { path, pictures } => write!(
                f,
                "{}: holds {pictures} pictures, of which the first is taken; save each as a file of its own",
                path.display()
            ),
            Self::Corrupt { path, first, count } => write!(
                f,
                "{}: {count} frames, the first of them {first}, have errors in them; what could not be decoded was guessed",
                path.display()
            ),
            Self::Faulty { path, near, said } => write!(
                f,
                "{}: pictures near frame {near} have errors in them ({said}); what could not be decoded was guessed",
                path.display()
            ),
            Self::EndedEarly {
                path,
                good,
                ended_at,
                announced,
            } => write!(
                f,
                "{}: ends early, at frame {ended_at} of {announced}; {good} frames were good",
                path.display()
            ),
            Self::CutOff { path, good } => write!(
                f,
                "{}: the file is cut off, its end is missing; {good} frames were good",
                path.display()
            ),
        }
    }
}
