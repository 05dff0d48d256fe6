//! Video files, encoded by an ffmpeg process that is fed raw frames.

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::thread::JoinHandle;

use super::file_identity::is_at;
use super::new_file::{NewFile, vanished};
use super::output_error::OutputError;

/// A video's encoding.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Codec {
    /// Small and played everywhere.
    H264,
    /// Lossless RGB.
    Ffv1,
}

impl Codec {
    /// The codec for a file of this name; `None` where no video is meant.
    pub fn of_path(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "mp4" | "mov" => Some(Self::H264),
            "mkv" | "avi" => Some(Self::Ffv1),
            _ => None,
        }
    }

    fn arguments(self) -> &'static [&'static str] {
        match self {
            // 4:2:0 needs even sides. The matrix is converted to what the tags say.
            Self::H264 => &[
                "-vf",
                "pad=ceil(iw/2)*2:ceil(ih/2)*2,scale=out_color_matrix=bt709:out_range=tv,format=yuv420p",
                "-c:v",
                "libx264",
                "-preset",
                "veryfast",
                "-crf",
                "18",
                "-colorspace",
                "bt709",
                "-color_primaries",
                "bt709",
                "-color_trc",
                "bt709",
                "-color_range",
                "tv",
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

/// A video that is being written.
pub struct VideoWriter {
    path: PathBuf,
    size_px: [u32; 2],
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

struct Encoder {
    child: Child,
    frames_in: ChildStdin,
    talk: JoinHandle<String>,
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
        fps: f64,
        naming: Naming,
    ) -> Result<Self, OutputError> {
        let file = VideoFile::create(path, naming)?;
        let mut writer = Self {
            path: path.to_owned(),
            size_px,
            frames: 0,
            encoder: None,
            file: None,
        };
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
            .args(["-f", "rawvideo", "-pixel_format", "rgba"])
            .args([
                "-video_size",
                &format!("{}x{}", size_px[0], size_px[1]),
                "-framerate",
                &fps.to_string(),
            ])
            .args(["-i", "pipe:0"])
            .args(codec.arguments())
            .args(naming.arguments())
            .arg(file_url(file.working_path(path)))
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // From here on the file goes if the encoder does not start.
        writer.file = Some(file);
        // Ctrl-C is for gnomon, which then finishes the video; the encoder must live until that is done.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command
            .spawn()
            .map_err(|error| OutputError::FfmpegMissing {
                path: path.to_owned(),
                error,
            })?;
        let pipe_lost = || OutputError::Encoder {
            path: path.to_owned(),
            frames: 0,
            message: "its input or output cannot be reached".to_owned(),
        };
        let frames_in = child.stdin.take().ok_or_else(pipe_lost)?;
        let mut stderr = child.stderr.take().ok_or_else(pipe_lost)?;
        let talk = std::thread::spawn(move || {
            let mut bytes = Vec::new();
            // What could be read is worth telling, even where reading ended in an error.
            _ = stderr.read_to_end(&mut bytes);
            String::from_utf8_lossy(&bytes).into_owned()
        });
        writer.encoder = Some(Encoder {
            child,
            frames_in,
            talk,
        });
        Ok(writer)
    }

    /// Adds a frame of 8-bit RGBA.
    pub fn push(&mut self, size_px: [u32; 2], rgba: &[u8]) -> Result<(), OutputError> {
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
        let written = self
            .encoder
            .as_mut()
            .map(|encoder| encoder.frames_in.write_all(rgba));
        match written {
            Some(Ok(())) => {
                self.frames += 1;
                Ok(())
            }
            // The pipe breaks when the encoder gives up; why, it says itself.
            Some(Err(_)) | None => Err(self
                .close()
                .err()
                .unwrap_or_else(|| self.failed("it ended too soon"))),
        }
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
        let Some(Encoder {
            mut child,
            frames_in,
            talk,
        }) = self.encoder.take()
        else {
            return Err(self.failed("it ended before"));
        };
        drop(frames_in);
        let status = child.wait().map_err(|error| OutputError::Io {
            path: self.path.clone(),
            error,
        })?;
        let said = talk.join().unwrap_or_default();
        // A full disk while the index is written is only said, the status is 0.
        if status.success() && said.trim().is_empty() {
            return Ok(());
        }
        match last_lines(&said) {
            words if words.is_empty() => Err(self.failed(&status.to_string())),
            words => Err(self.failed(&words)),
        }
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
            if self.frames == 0 && is_at(&self.path, &file) {
                _ = std::fs::remove_file(&self.path);
            }
        } else if let Some(Encoder {
            mut child,
            frames_in,
            ..
        }) = self.encoder.take()
        {
            drop(frames_in);
            // Both fail only where the encoder is gone already.
            _ = child.kill();
            _ = child.wait();
        }
    }
}

/// The path as a URL, so that no name (`a:b.mp4`, `-.mp4`) is taken for a protocol or an option.
fn file_url(path: &Path) -> std::ffi::OsString {
    let mut url = std::ffi::OsString::from("file:");
    url.push(path);
    url
}

fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines[lines.len().saturating_sub(4)..].join("; ")
}
