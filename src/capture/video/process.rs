//! An ffmpeg process that decodes a video, a frame after the other: pixels on its stdout, what they are on its stderr.

use std::ffi::OsString;
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::process::{ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use super::log::{ColourTags, FrameHead, Said, is_of_missing_headers, meaning};
use super::planes::PixelLayout;
use crate::capture::children::RunningChild;
use crate::geometry::camera::MOST_SIDE_PX;

/// Pixels of a frame at most, those of 8K video: a small file may say that it has more.
pub(super) const MOST_PIXELS: u64 = 33_554_432;
/// The same for ffmpeg.
pub(super) const MOST_PIXELS_OPTION: [&str; 2] = ["-max_pixels", "33554432"];
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
    /// The decoder said that it cannot decode some of a picture, which is near the next frame: several are decoded at once.
    Fault(String),
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
    running: RunningChild,
    frames_out: ChildStdout,
    said: Receiver<Said>,
    /// FFmpeg's name of the decoder; empty before it is at work.
    name: String,
    tick_secs: f64,
    /// The rate that the stream says.
    pub fps: Option<f64>,
    /// A frame whose colours were not told yet.
    head: Option<FrameHead>,
    corrupt: bool,
    /// The layout of all frames: the first one's.
    layout: Option<(PixelLayout, [u32; 2])>,
    pixels: Vec<u8>,
    patience: Duration,
    /// Whether the file was opened, and there is a video in it.
    pub opened: bool,
    pub has_video: bool,
    /// Whether there is anything in it.
    pub has_streams: bool,
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
            .args(["-f", "rawvideo", "pipe:1"]);
        Self::of(command, PATIENCE)
    }

    /// Starts a program that decodes. Nothing may happen for so long.
    fn of(mut command: Command, patience: Duration) -> Result<Self, NoDecoder> {
        command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // Ctrl-C is for gnomon, which finishes what it has begun before it ends its decoder.
        let mut running = RunningChild::start(&mut command).map_err(NoDecoder::Missing)?;
        let child = &mut running.child;
        let (Some(frames_out), Some(stderr)) = (child.stdout.take(), child.stderr.take()) else {
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
            running,
            frames_out,
            said,
            name: String::new(),
            tick_secs: 0.0,
            fps: None,
            head: None,
            corrupt: false,
            layout: None,
            pixels: Vec::new(),
            patience,
            opened: false,
            has_video: false,
            has_streams: false,
            ended: false,
        })
    }

    /// Waits for the next frame, or for what is told before it.
    pub(super) fn next(&mut self) -> Next {
        while !self.ended {
            match self.said.recv_timeout(self.patience) {
                Ok(Said::Input) => self.opened = true,
                Ok(Said::Stream) => self.has_streams = true,
                Ok(Said::Decoding) => self.has_video = true,
                Ok(Said::Decoder(name)) => self.name = name,
                Ok(Said::TimeBase { tick_secs, fps }) => {
                    (self.tick_secs, self.fps) = (tick_secs, fps)
                }
                Ok(Said::Frame(head)) => self.head = Some(head),
                // (While the file is looked through, it may be of a cover or of sound.)
                Ok(Said::Corrupt) => self.corrupt |= self.has_video,
                Ok(Said::Complaint { by, words }) => return self.complaint(&by, words),
                Ok(Said::Fatal(words)) => return Next::Complaint(words),
                Ok(Said::Colours(colours)) => {
                    if let Some(head) = self.head.take() {
                        match self.take(&head, colours) {
                            Ok(frame) => return Next::Frame(frame),
                            Err(error) if error.kind() == ErrorKind::TimedOut => {
                                return self.silent();
                            }
                            Err(error) if error.kind() == ErrorKind::UnexpectedEof => {
                                return self.after_the_last();
                            }
                            Err(_) => {
                                self.ended = true;
                                self.running.end();
                            }
                        }
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return self.after_the_last(),
                Err(RecvTimeoutError::Timeout) => return self.silent(),
            }
        }
        Next::End
    }

    /// (Before the decoder is named the file is only looked through.)
    fn complaint(&self, by: &str, words: String) -> Next {
        let is_fault = !by.is_empty() && by == self.name && !is_of_missing_headers(&words);
        match is_fault {
            true => Next::Fault(words),
            false => Next::Complaint(words),
        }
    }

    fn after_the_last(&mut self) -> Next {
        self.ended = true;
        self.failure().map_or(Next::End, Next::Complaint)
    }

    /// What its status says, where it has ended otherwise than well: one that is killed complains of nothing.
    fn failure(&mut self) -> Option<String> {
        const NAP: Duration = Duration::from_millis(2);
        let mut waited = Duration::ZERO;
        while waited < self.patience {
            match self.running.try_wait() {
                Ok(Some(status)) if status.success() => return None,
                Ok(Some(status)) => return Some(format!("the decoder failed: {status}")),
                Ok(None) => std::thread::sleep(NAP),
                Err(_) => return None,
            }
            waited += NAP;
        }
        self.running.end();
        Some("the decoder does not end".to_owned())
    }

    fn silent(&mut self) -> Next {
        self.ended = true;
        self.running.end();
        let secs = self.patience.as_secs();
        Next::Complaint(format!("the decoder said nothing for {secs} s"))
    }

    /// The pixels of the frame that came last, their layout and their size.
    pub(super) fn pixels(&self) -> Option<(&[u8], PixelLayout, [u32; 2])> {
        let (layout, size_px) = self.layout?;
        Some((&self.pixels, layout, size_px))
    }

    /// Reads a frame's pixels.
    ///
    /// # Errors
    /// They do not come any more, or for longer than there is patience.
    fn take(&mut self, head: &FrameHead, colours: ColourTags) -> io::Result<RawFrame> {
        // ffmpeg keeps to the first frame's size and format.
        if self.layout.is_none() {
            let layout = PixelLayout::by_ffmpeg_name(&head.pixels);
            let layout = layout.ok_or(ErrorKind::InvalidData)?;
            let [width, height] = head.size_px.map(u64::from);
            let is_too_long = width.max(height) > u64::from(MOST_SIDE_PX);
            if is_too_long || width * height > MOST_PIXELS {
                return Err(ErrorKind::InvalidData.into());
            }
            self.layout = Some((layout, head.size_px));
            self.pixels = vec![0; layout.bytes(head.size_px)];
        }
        let mut patient = Patient {
            pipe: &mut self.frames_out,
            patience: self.patience,
        };
        patient.read_exact(&mut self.pixels)?;
        Ok(RawFrame {
            stamp_secs: head.stamp.map(|stamp| stamp as f64 * self.tick_secs),
            size_px: head.size_px,
            colours,
            corrupt: std::mem::take(&mut self.corrupt),
        })
    }
}

/// A pipe that is not waited for longer than there is patience.
struct Patient<'a> {
    pipe: &'a mut ChildStdout,
    patience: Duration,
}

impl Read for Patient<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        #[cfg(unix)]
        wait_for_bytes(self.pipe, self.patience)?;
        self.pipe.read(bytes)
    }
}

/// Waits until a pipe has something to give, or has ended.
#[cfg(unix)]
fn wait_for_bytes(pipe: &ChildStdout, patience: Duration) -> io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let limit = Timespec {
        tv_sec: patience.as_secs().cast_signed(),
        tv_nsec: patience.subsec_nanos().into(),
    };
    let mut pipes = [PollFd::new(pipe, PollFlags::IN)];
    match poll(&mut pipes, Some(&limit))? {
        0 => Err(ErrorKind::TimedOut.into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    const HEAD: &str =
        "[Parsed_showinfo_1 @ 0x1] [info] n:   0 pts:   0 pts_time:0 fmt:rgba sar:0/1 s:4x2 i:P";
    const COLOURS: &str = "[Parsed_showinfo_1 @ 0x1] [info] color_range:pc color_space:gbr color_primaries:bt709 color_trc:bt709";

    /// A script in place of ffmpeg, which is given what is said of a frame.
    fn script(text: &str) -> Decoder {
        let mut command = Command::new("sh");
        let said = format!("{HEAD}\n{COLOURS}\n");
        command.args(["-c", text, "sh", &said]);
        let decoder = Decoder::of(command, Duration::from_millis(500));
        decoder.unwrap_or_else(|_| panic!("no script"))
    }

    #[test]
    fn a_decoder_that_hangs_is_ended() {
        for text in [
            "exec sleep 1000",
            "printf %b \"$1\" >&2; exec sleep 1000",
            "printf %b \"$1\" >&2; printf 123; exec sleep 1000",
        ] {
            let mut decoder = script(text);
            let next = decoder.next();
            let is_told = matches!(&next, Next::Complaint(words) if words.contains("said nothing"));
            assert!(is_told, "{text}");
            assert!(matches!(decoder.next(), Next::End), "{text}");
        }
    }

    #[test]
    fn what_it_says_and_gives_is_a_frame() {
        let pixels = "printf 12345678123456781234567812345678";
        let mut decoder = script(&format!("printf %b \"$1\" >&2; {pixels}"));
        assert!(matches!(decoder.next(), Next::Frame(_)));
        assert!(matches!(decoder.next(), Next::End));
        // One that dies in the middle of a frame, and one that is killed after it.
        let mut decoder = script("printf %b \"$1\" >&2; printf 123");
        assert!(matches!(decoder.next(), Next::End));
        let mut decoder = script("printf %b \"$1\" >&2; printf 123; kill -9 $$");
        assert!(matches!(decoder.next(), Next::Complaint(_)));
        let mut decoder = script(&format!("printf %b \"$1\" >&2; {pixels}; kill -9 $$"));
        assert!(matches!(decoder.next(), Next::Frame(_)));
        assert!(matches!(decoder.next(), Next::Complaint(words) if words.contains("signal: 9")));
        assert!(matches!(decoder.next(), Next::End));
    }

    #[test]
    fn memory_for_a_frame_is_not_taken_on_its_word() {
        let mut decoder =
            script("printf %b \"$1\" | sed 's/4x2/400000x400000/' >&2; exec sleep 1000");
        assert!(matches!(decoder.next(), Next::End));
    }
}
