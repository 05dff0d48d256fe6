//! Video files, encoded by an ffmpeg process that is fed raw frames.

use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};

use super::encoder::Encoder;
use super::file_identity::is_at;
use super::made_by::MADE_BY;
use super::new_file::{NewFile, ends_as_folder, vanished};
use super::output_error::OutputError;
use super::stamped_frames::{write_frame, write_head};

/// A video's encoding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// Small and played everywhere.
    H264,
    /// Lossless RGB.
    Ffv1,
}

impl Codec {
    /// The codec for a file of this name; `None` where no video is meant, or a folder.
    pub fn of_path(path: &Path) -> Option<Self> {
        if ends_as_folder(path) {
            return None;
        }
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "mp4" | "mov" => Some(Self::H264),
            "mkv" | "avi" => Some(Self::Ffv1),
            _ => None,
        }
    }

    fn arguments(self) -> &'static [&'static str] {
        match self {
            // 4:2:0 needs even sides. The matrix is converted to what the tags say; the frames bear them, for FFmpeg 7 passes
            // options of primaries and transfer over.
            Self::H264 => &[
                "-vf",
                "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p,\
                 setparams=range=tv:colorspace=bt709:color_primaries=bt709:color_trc=bt709",
                "-c:v",
                "libx264",
                "-preset",
                "veryfast",
                "-crf",
                "18",
                "-movflags",
                "+faststart",
            ],
            Self::Ffv1 => &["-pix_fmt", "bgr0", "-c:v", "ffv1", "-level", "3", "-g", "1"],
        }
    }
}

/// The moment at which a video gets its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Naming {
    /// When it is finished; dropped before, it is removed.
    Finished,
    /// At once: what there is of it can be played at any moment, also after a kill. FFV1 in Matroska alone.
    AtOnce,
}

/// When the frames of a video are shown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// One after the other at this rate, whatever their times.
    Even {
        /// Frames per second.
        fps: f64,
    },
    /// Each at its own time since the first; in AVI, which has no times, as near as its rate allows, or not at all.
    Stamped {
        /// Frames per second where they follow each other most closely.
        nominal_fps: f64,
    },
}

/// Ticks per second of the times in MP4: the usual rates, and the clocks of cameras and broadcasts, are whole numbers of
/// them.
const MP4_TICKS: u32 = 360_000;

/// A video that is being written.
pub struct VideoWriter {
    path: PathBuf,
    size_px: [u32; 2],
    pace: Pace,
    /// Times of the first frame and of the last, seconds; the last since the first.
    first_secs: Option<f64>,
    last_secs: Option<f64>,
    frames: u32,
    encoder: Option<Encoder>,
    /// `None` once it is finished.
    file: Option<VideoFile>,
}

/// The file that the encoder writes to, made before it begins.
enum VideoFile {
    Unfinished(NewFile),
    Named(File),
}

impl VideoWriter {
    /// Starts the encoder; the folder is made where it is missing. With [`Naming::AtOnce`] there must be no file of that
    /// name.
    ///
    /// # Errors
    /// A place that cannot be written to, or no encoder.
    pub fn create(
        path: &Path,
        codec: Codec,
        size_px: [u32; 2],
        pace: Pace,
        naming: Naming,
    ) -> Result<Self, OutputError> {
        let file = VideoFile::create(path, naming)?;
        let mut writer = Self {
            path: path.to_owned(),
            size_px,
            pace,
            first_secs: None,
            last_secs: None,
            frames: 0,
            encoder: None,
            file: None,
        };
        let mut arguments = pace.input_arguments(size_px);
        arguments.extend(codec.arguments().iter().map(|&word| word.to_owned()));
        arguments.extend(pace.output_arguments(path));
        arguments.extend(["-metadata".to_owned(), format!("comment={MADE_BY}")]);
        arguments.extend(naming.arguments().iter().map(|&word| word.to_owned()));
        let url = file_url(file.working_path(path));
        // From here on the file goes if the encoder does not start.
        writer.file = Some(file);
        let encoder =
            Encoder::start(&arguments, &url).map_err(|error| OutputError::FfmpegMissing {
                path: path.to_owned(),
                error,
            })?;
        let encoder = writer.encoder.insert(encoder);
        if let Pace::Stamped { nominal_fps } = pace
            && write_head(encoder, size_px, nominal_fps).is_err()
        {
            return Err(writer.gave_up());
        }
        Ok(writer)
    }

    /// Adds a frame of 8-bit RGBA, taken at this time; times that do not increase are moved on by a hair.
    ///
    /// # Errors
    /// A frame of another size, an encoder that fails or hangs, a file that was taken away.
    pub fn push(
        &mut self,
        size_px: [u32; 2],
        time_secs: f64,
        rgba: &[u8],
    ) -> Result<(), OutputError> {
        let expected = self.size_px[0] as usize * self.size_px[1] as usize * 4;
        if size_px != self.size_px || rgba.len() != expected {
            let [width, height] = self.size_px;
            let message = format!(
                "a frame of {} x {} in a video of {width} x {height}",
                size_px[0], size_px[1]
            );
            return Err(OutputError::Picture {
                path: self.path.clone(),
                message,
            });
        }
        self.check_that_it_is_there()?;
        let since_first_secs = time_secs - *self.first_secs.get_or_insert(time_secs);
        let stamp_secs = self
            .pace
            .stamp_secs(&self.path, since_first_secs, self.last_secs);
        self.check_that_it_is_in_time(since_first_secs, stamp_secs)?;
        self.last_secs = Some(stamp_secs);
        let written = self.encoder.as_mut().map(|encoder| match self.pace {
            Pace::Even { .. } => encoder.write_all(rgba),
            Pace::Stamped { .. } => write_frame(encoder, stamp_secs, rgba),
        });
        match written {
            Some(Ok(())) => {
                self.frames += 1;
                Ok(())
            }
            // The pipe breaks when the encoder gives up; why, it says itself.
            Some(Err(_)) | None => Err(self.gave_up()),
        }
    }

    /// AVI shows its frames one after the other at its rate. (The others have times of their own.)
    fn check_that_it_is_in_time(&self, time_secs: f64, shown_secs: f64) -> Result<(), OutputError> {
        /// Frames that are shown in its place, at most.
        const MOST_OFF: f64 = 1.5;
        match self.pace {
            Pace::Stamped { nominal_fps }
                if is_avi(&self.path) && (shown_secs - time_secs) * nominal_fps > MOST_OFF =>
            {
                let message = format!(
                    "the frame of {time_secs:.3} s would be shown at {shown_secs:.3} s: AVI has no times of its own, but \
                     {nominal_fps:.3} frames in each second; write .mkv or .mp4"
                );
                Err(OutputError::Picture {
                    path: self.path.clone(),
                    message,
                })
            }
            _ => Ok(()),
        }
    }

    fn gave_up(&mut self) -> OutputError {
        self.close()
            .err()
            .unwrap_or_else(|| self.failed("it ended too soon"))
    }

    /// Waits for the encoder and gives the video its name. Without any frame there is no video.
    pub fn finish(mut self) -> Result<(), OutputError> {
        if self.frames == 0 {
            return Ok(());
        }
        let closed = self.close();
        // An encoder that misses its file says less.
        self.check_that_it_is_there()?;
        closed?;
        let file = self.file.as_ref().map(|file| file.working_path(&self.path));
        if file.is_some_and(|file| std::fs::metadata(file).is_ok_and(|file| file.len() == 0)) {
            return Err(self.failed("it has written nothing"));
        }
        match self.file.take() {
            Some(VideoFile::Unfinished(file)) => file.finish(),
            Some(VideoFile::Named(file)) => file.sync_all().map_err(|error| OutputError::Io {
                path: self.path.clone(),
                error,
            }),
            None => Ok(()),
        }
    }

    /// The encoder does not notice when its file is taken away.
    fn check_that_it_is_there(&self) -> Result<(), OutputError> {
        match self.file.as_ref().map(|file| file.is_there(&self.path)) {
            Some(true) => Ok(()),
            _ => Err(OutputError::Io {
                path: self.path.clone(),
                error: vanished(),
            }),
        }
    }

    /// Ends the encoder's input and waits for it.
    fn close(&mut self) -> Result<(), OutputError> {
        let Some(encoder) = self.encoder.take() else {
            return Err(self.failed("it ended before"));
        };
        let file = self.file.as_ref().map(|file| file.working_path(&self.path));
        encoder.finish(file).map_err(|words| self.failed(&words))
    }

    fn failed(&self, message: &str) -> OutputError {
        OutputError::Encoder {
            path: self.path.clone(),
            frames: self.frames,
            message: message.to_owned(),
        }
    }
}

impl Naming {
    /// Matroska keeps a cluster back until it is complete; short ones lose little.
    fn arguments(self) -> &'static [&'static str] {
        match self {
            Self::Finished => &[],
            Self::AtOnce => &["-cluster_time_limit", "300", "-flush_packets", "1"],
        }
    }
}

impl Pace {
    /// What the encoder is told of the frames that it reads.
    fn input_arguments(self, size_px: [u32; 2]) -> Vec<String> {
        let [width, height] = size_px;
        let words = match self {
            Self::Even { fps } => {
                format!(
                    "-f rawvideo -pixel_format rgba -video_size {width}x{height} -framerate {fps} -i pipe:0"
                )
            }
            // All that there is to know stands at the stream's beginning.
            Self::Stamped { .. } => {
                "-f matroska -probesize 32 -analyzeduration 0 -fpsprobesize 0 -i pipe:0".to_owned()
            }
        };
        words.split(' ').map(str::to_owned).collect()
    }

    /// What it is told of their times.
    fn output_arguments(self, path: &Path) -> Vec<String> {
        let words = match self {
            Self::Even { .. } => return Vec::new(),
            Self::Stamped { nominal_fps } if is_avi(path) => {
                // (FFmpeg 7 refuses a rate beside frames of their own times.)
                let per_million_secs = (1e6 * nominal_fps).round();
                format!("-fps_mode passthrough -enc_time_base 1000000:{per_million_secs}")
            }
            Self::Stamped { .. } => format!(
                "-fps_mode passthrough -enc_time_base 1:{MP4_TICKS} -video_track_timescale {MP4_TICKS}"
            ),
        };
        let mut words: Vec<String> = words.split(' ').map(str::to_owned).collect();
        if !has_track_timescale(path) {
            words.truncate(4);
        }
        words
    }

    /// The time that a frame gets, since the first.
    fn stamp_secs(self, path: &Path, since_first_secs: f64, last_secs: Option<f64>) -> f64 {
        let per_second = match self {
            Self::Stamped { nominal_fps } if is_avi(path) => nominal_fps,
            // Matroska's own clock.
            Self::Stamped { .. } if !has_track_timescale(path) => 1000.0,
            Self::Even { .. } | Self::Stamped { .. } => f64::from(MP4_TICKS),
        };
        let slot = (since_first_secs * per_second).round();
        let least = last_secs.map_or(0.0, |last| (last * per_second).round() + 1.0);
        slot.max(least) / per_second
    }
}

fn is_avi(path: &Path) -> bool {
    extension(path) == "avi"
}

fn has_track_timescale(path: &Path) -> bool {
    matches!(extension(path).as_str(), "mp4" | "mov")
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_ascii_lowercase()
}

impl VideoFile {
    /// Neither is there before: nobody's file is written over, and no link of somebody else's is followed.
    fn create(path: &Path, naming: Naming) -> Result<Self, OutputError> {
        match naming {
            Naming::Finished => NewFile::create(path).map(Self::Unfinished),
            Naming::AtOnce => {
                let make = || {
                    if let Some(folder) = path.parent() {
                        std::fs::create_dir_all(folder)?;
                    }
                    File::create_new(path).map(Self::Named)
                };
                make().map_err(|error| OutputError::Io {
                    path: path.to_owned(),
                    error,
                })
            }
        }
    }

    fn working_path<'a>(&'a self, path: &'a Path) -> &'a Path {
        match self {
            Self::Unfinished(file) => file.temporary_path(),
            Self::Named(_) => path,
        }
    }

    fn is_there(&self, path: &Path) -> bool {
        match self {
            Self::Unfinished(file) => file.is_there(),
            Self::Named(file) => is_at(path, file),
        }
    }
}

impl Drop for VideoWriter {
    fn drop(&mut self) {
        if let Some(VideoFile::Named(file)) = self.file.take() {
            // Closing fails where the encoder has failed; what it wrote until then stays.
            _ = self.encoder.is_some().then(|| self.close());
            let is_empty = file.metadata().is_ok_and(|file| file.len() == 0);
            if (self.frames == 0 || is_empty) && is_at(&self.path, &file) {
                _ = std::fs::remove_file(&self.path);
            }
        }
        // An encoder that was not finished is ended.
    }
}

/// The path as a URL, so that no name (`a:b.mp4`, `-.mp4`) is taken for a protocol or an option.
fn file_url(path: &Path) -> std::ffi::OsString {
    let mut url = std::ffi::OsString::from("file:");
    url.push(path);
    url
}
