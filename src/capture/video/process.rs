//! An ffmpeg process that decodes a video, a frame after the other: pixels on its stdout, what they are on its stderr.

use std::ffi::OsString;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use super::log::{ColourTags, FrameHead, Said, meaning};
use super::planes::PixelLayout;

/// A decoder that says nothing for so long is stuck. Files that take longer for a frame are not videos of a camera.
const PATIENCE: Duration = Duration::from_secs(60);
/// A line that is longer is not read on: some frames carry data that ffmpeg prints.
const LONGEST_LINE: u64 = 1 << 16;
/// Room for frames in the pipe, so that the decoder need not be woken for each piece of one.
#[cfg(target_os = "linux")]
const PIPE_BYTES: usize = 1 << 20;

/// A frame as it was decoded.
pub(super) struct RawFrame {
    pub stamp_secs: Option<f64>,
    /// The size that it has in the stream; the pixels are scaled to the first frame's.
    pub size_px: [u32; 2],
    pub colours: ColourTags,
    /// Whether parts of it had to be guessed.
    pub corrupt: bool,
}

/// What came next.
pub(super) enum Next {
    /// Its pixels are in [`Decoder::pixels`].
    Frame(RawFrame),
    /// The reader or the decoder complained of something before the next frame.
    Complaint(String),
    /// Nothing more comes.
    End,
}

/// Why there is no decoder.
pub(super) enum NoDecoder {
    /// The program cannot be started.
    Missing(std::io::Error),
    /// The system refuses a pipe.
    NoPipe,
}

/// A running decoder. Dropped, it is ended.
pub(super) struct Decoder {
    child: Child,
    frames_out: ChildStdout,
    said: Receiver<Said>,
    tick_secs: f64,
    /// The rate that the stream says.
    pub fps: Option<f64>,
    /// A frame whose colours were not told yet.
    head: Option<FrameHead>,
    corrupt: bool,
    /// The layout of all frames: the first one's.
    layout: Option<(PixelLayout, [u32; 2])>,
    pixels: Vec<u8>,
    /// Whether the file was opened, and there is a video in it.
    pub opened: bool,
    pub has_video: bool,
    ended: bool,
}

impl Decoder {
    /// Starts ffmpeg on an input: the options that stand before `-i`, and the file or address.
    pub(super) fn start(input_options: &[&str], input: &OsString) -> Result<Self, NoDecoder> {
        let filter = format!(
            "format=pix_fmts={},showinfo=checksum=0",
            PixelLayout::ffmpeg_names()
        );
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-nostdin", "-nostats"])
            .args(["-loglevel", "repeat+level+info", "-copyts"])
            .args(input_options)
            .arg("-i")
            .arg(input)
            .args(["-map", "0:V:0", "-fps_mode", "passthrough", "-vf", &filter])
            .args(["-f", "rawvideo", "pipe:1"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is for gnomon, which finishes what it has begun before it ends its decoder.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn().map_err(NoDecoder::Missing)?;
        let (Some(frames_out), Some(stderr)) = (child.stdout.take(), child.stderr.take()) else {
            end(&mut child);
            return Err(NoDecoder::NoPipe);
        };
        #[cfg(target_os = "linux")]
        // More room is only faster.
        let _ = rustix::pipe::fcntl_setpipe_size(&frames_out, PIPE_BYTES);
        let (to_decoder, said) = channel();
        std::thread::spawn(move || {
            let mut lines = BufReader::new(stderr);
            let mut line = Vec::new();
            // It must be read to the end, or ffmpeg would wait.
            while let Ok(1..) = (&mut lines).take(LONGEST_LINE).read_until(b'\n', &mut line) {
                if let Some(said) = meaning(&String::from_utf8_lossy(&line)) {
                    // The one who listened may be gone.
                    _ = to_decoder.send(said);
                }
                line.clear();
            }
        });
        Ok(Self {
            child,
            frames_out,
            said,
            tick_secs: 0.0,
            fps: None,
            head: None,
            corrupt: false,
            layout: None,
            pixels: Vec::new(),
            opened: false,
            has_video: false,
            ended: false,
        })
    }

    /// Waits for the next frame, or for what is told before it.
    pub(super) fn next(&mut self) -> Next {
        while !self.ended {
            match self.said.recv_timeout(PATIENCE) {
                Ok(Said::Input) => self.opened = true,
                Ok(Said::Decoding) => self.has_video = true,
                Ok(Said::TimeBase { tick_secs, fps }) => {
                    (self.tick_secs, self.fps) = (tick_secs, fps)
                }
                Ok(Said::Frame(head)) => self.head = Some(head),
                Ok(Said::Corrupt) => self.corrupt = true,
                Ok(Said::Complaint(words) | Said::Fatal(words)) => return Next::Complaint(words),
                Ok(Said::Colours(colours)) => {
                    if let Some(head) = self.head.take() {
                        match self.take(&head, colours) {
                            Some(frame) => return Next::Frame(frame),
                            None => self.ended = true,
                        }
                    }
                }
                Err(RecvTimeoutError::Disconnected) => self.ended = true,
                Err(RecvTimeoutError::Timeout) => {
                    self.ended = true;
                    end(&mut self.child);
                    let secs = PATIENCE.as_secs();
                    return Next::Complaint(format!("the decoder said nothing for {secs} s"));
                }
            }
        }
        Next::End
    }

    /// The pixels of the frame that came last, their layout and their size.
    pub(super) fn pixels(&self) -> Option<(&[u8], PixelLayout, [u32; 2])> {
        let (layout, size_px) = self.layout?;
        Some((&self.pixels, layout, size_px))
    }

    /// Reads a frame's pixels; `None` where they do not come any more.
    fn take(&mut self, head: &FrameHead, colours: ColourTags) -> Option<RawFrame> {
        // ffmpeg keeps to the first frame's size and format.
        if self.layout.is_none() {
            let layout = PixelLayout::by_ffmpeg_name(&head.pixels)?;
            self.layout = Some((layout, head.size_px));
            self.pixels = vec![0; layout.bytes(head.size_px)];
        }
        self.frames_out.read_exact(&mut self.pixels).ok()?;
        Some(RawFrame {
            stamp_secs: head.stamp.map(|stamp| stamp as f64 * self.tick_secs),
            size_px: head.size_px,
            colours,
            corrupt: std::mem::take(&mut self.corrupt),
        })
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        end(&mut self.child);
    }
}

/// Both fail only where it has ended already.
fn end(child: &mut Child) {
    _ = child.kill();
    _ = child.wait();
}
