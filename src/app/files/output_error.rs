//! What can go wrong while results are written.

use std::path::PathBuf;

/// The reason why results cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum OutputError {
    /// The encoder is not installed.
    #[error(
        "{}: writing a video needs ffmpeg, which cannot be started ({error}); install it (apt-get install ffmpeg), \
         or name a folder to get PNGs",
        path.display()
    )]
    FfmpegMissing {
        /// What was to be written.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// The encoder gave up.
    #[error("{}: ffmpeg failed after {frames} frames: {message}", path.display())]
    Encoder {
        /// What was to be written.
        path: PathBuf,
        /// Frames it had been given.
        frames: u32,
        /// The end of what ffmpeg said.
        message: String,
    },
    /// The system refuses to write.
    #[error("{}: {error}", path.display())]
    Io {
        /// What was to be written.
        path: PathBuf,
        /// What the system says.
        error: std::io::Error,
    },
    /// A picture that its format cannot hold.
    #[error("{}: {message}", path.display())]
    Picture {
        /// What was to be written.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// A name that looks like a video, of a kind that is not written.
    #[error("{}: videos are written as .mp4 or .mov (H.264), .mkv or .avi (FFV1, lossless); any other name is a folder of PNGs", path.display())]
    UnknownFormat {
        /// The name.
        path: PathBuf,
    },
    /// A folder for a recording that holds other things, or frames that do not fit into it.
    #[error("{}: {message}", path.display())]
    Session {
        /// The folder.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
}
