//! An ffmpeg process that encodes what it is fed. Waiting for it has an end: one that hangs is ended.

use std::ffi::OsStr;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{ChildStdin, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::capture::children::RunningChild;

/// Between two looks at whether it has ended.
const NAP: Duration = Duration::from_millis(10);
/// An encoder that neither takes a frame nor writes a byte for so long hangs.
const PATIENCE: Duration = Duration::from_secs(60);
/// What is kept of what it says, bytes from the end.
const MOST_TALK: usize = 1 << 16;
/// What it says where the file could not be written, though its status may be 0: a full disk while the index is written.
const UNWRITTEN: [&str; 5] = [
    "No space left",
    "quota exceeded",
    "Input/output error",
    "File too large",
    "Error writing trailer",
];

/// A running encoder. Dropped, it is ended.
pub(super) struct Encoder {
    running: RunningChild,
    /// `None` once its input has ended.
    frames_in: Option<ChildStdin>,
    talk: Option<JoinHandle<String>>,
    patience: Duration,
}

impl Encoder {
    /// Starts ffmpeg with what stands before the output, and the output.
    pub(super) fn start(arguments: &[String], output: &OsStr) -> io::Result<Self> {
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
            .args(arguments)
            .arg(output);
        Self::of(command, PATIENCE)
    }

    /// Starts a program that encodes its input. Nothing may happen for so long.
    fn of(mut command: Command, patience: Duration) -> io::Result<Self> {
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ctrl-C is for gnomon, which then finishes the video; the encoder lives until that is done.
        let mut running = RunningChild::start(&mut command)?;
        let frames_in = running.child.stdin.take();
        #[cfg(unix)]
        if let Some(frames_in) = &frames_in {
            // So that a write waits no longer than it should; where that fails it waits as it always did.
            _ = rustix::io::ioctl_fionbio(frames_in, true);
        }
        let talk = running
            .child
            .stderr
            .take()
            .map(|stderr| std::thread::spawn(move || last_words(stderr)));
        Ok(Self {
            running,
            frames_in,
            talk,
            patience,
        })
    }

    /// Ends its input and waits for it, as long as `file` goes on to change.
    ///
    /// # Errors
    /// What it said when it failed, or that it hangs.
    pub(super) fn finish(mut self, file: Option<&Path>) -> Result<(), String> {
        drop(self.frames_in.take());
        let status = self.wait(file)?;
        let said = self.words();
        let unwritten = UNWRITTEN.iter().any(|words| said.contains(words));
        if status.success() && !unwritten {
            return Ok(());
        }
        #[cfg(unix)]
        if let Some(signal) = std::os::unix::process::ExitStatusExt::signal(&status)
            && signal == rustix::process::Signal::XFSZ.as_raw()
        {
            return Err("File too large (ulimit -f)".to_owned());
        }
        match last_lines(&said) {
            words if words.is_empty() => Err(status.to_string()),
            words => Err(words),
        }
    }

    /// What it said. A program that it has left behind may hold its stderr open for ever.
    fn words(&mut self) -> String {
        let mut naps = 0;
        while let Some(talk) = &self.talk
            && !talk.is_finished()
            && NAP * naps < self.patience
        {
            std::thread::sleep(NAP);
            naps += 1;
        }
        let talk = self.talk.take().filter(JoinHandle::is_finished);
        let said = talk.map(JoinHandle::join);
        said.and_then(Result::ok).unwrap_or_default()
    }

    fn wait(&mut self, file: Option<&Path>) -> Result<ExitStatus, String> {
        let state = || {
            let metadata = std::fs::metadata(file?).ok()?;
            Some((metadata.len(), metadata.modified().ok()?))
        };
        let mut before = state();
        let mut naps = 0;
        loop {
            match self.running.try_wait() {
                Ok(Some(status)) => return Ok(status),
                Ok(None) => {}
                Err(error) => return Err(error.to_string()),
            }
            std::thread::sleep(NAP);
            naps += 1;
            if state() != before {
                before = state();
                naps = 0;
            }
            if NAP * naps > self.patience {
                let secs = self.patience.as_secs();
                return Err(format!("it does not end; nothing happened for {secs} s"));
            }
        }
    }
}

impl Write for Encoder {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(frames_in) = &mut self.frames_in else {
            return Err(io::ErrorKind::BrokenPipe.into());
        };
        #[cfg(unix)]
        wait_for_room(frames_in, self.patience)?;
        frames_in.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits until a pipe takes something.
#[cfg(unix)]
fn wait_for_room(pipe: &ChildStdin, patience: Duration) -> io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let limit = Timespec {
        tv_sec: patience.as_secs().cast_signed(),
        tv_nsec: patience.subsec_nanos().into(),
    };
    let mut pipes = [PollFd::new(pipe, PollFlags::OUT)];
    match poll(&mut pipes, Some(&limit))? {
        0 => Err(io::ErrorKind::TimedOut.into()),
        _ => Ok(()),
    }
}

/// The end of what is said, read to its end, or the program would wait.
fn last_words(mut stderr: impl Read) -> String {
    let mut last = Vec::new();
    let mut piece = [0; 1 << 12];
    // What could be read is worth telling, even where reading ended in an error.
    while let Ok(count @ 1..) = stderr.read(&mut piece) {
        last.extend_from_slice(&piece[..count]);
        if last.len() > 2 * MOST_TALK {
            last.drain(..last.len() - MOST_TALK);
        }
    }
    String::from_utf8_lossy(&last).into_owned()
}

fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines[lines.len().saturating_sub(4)..].join("; ")
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;

    const PATIENCE: Duration = Duration::from_millis(700);

    /// A script in place of ffmpeg.
    fn script(text: &str) -> Encoder {
        let mut command = Command::new("sh");
        command.args(["-c", text]);
        Encoder::of(command, PATIENCE).unwrap()
    }

    /// Writes more than a pipe holds, and what finishing says then.
    fn fed(mut encoder: Encoder) -> (io::Result<()>, Result<(), String>) {
        let written = encoder.write_all(&vec![7; 1 << 20]);
        (written, encoder.finish(None))
    }

    #[test]
    fn an_encoder_that_does_its_work_may_say_what_it_likes() {
        let talks = "cat >/dev/null; i=0; while [ $i -lt 20000 ]; do echo 'a warning of a pixel format' >&2; i=$((i+1)); done";
        for text in ["cat >/dev/null", talks] {
            let (written, finished) = fed(script(text));
            assert!(written.is_ok() && finished.is_ok(), "{finished:?}");
        }
    }

    #[test]
    fn an_encoder_that_hangs_is_ended() {
        let (written, finished) = fed(script("exec sleep 1000"));
        assert_eq!(written.unwrap_err().kind(), io::ErrorKind::TimedOut);
        assert!(finished.unwrap_err().contains("it does not end"));
        let (written, finished) = fed(script("cat >/dev/null; exec sleep 1000"));
        assert!(written.is_ok());
        assert!(finished.unwrap_err().contains("it does not end"));
    }

    #[test]
    fn one_whose_child_lives_on_is_not_waited_for() {
        let (written, finished) = fed(script("sleep 1000 </dev/null >/dev/null & cat >/dev/null"));
        assert!(written.is_ok() && finished.is_ok(), "{finished:?}");
    }

    #[test]
    fn an_encoder_that_fails_says_why() {
        let (written, finished) = fed(script(
            "head -c 1000 >/dev/null; echo no such codec >&2; exit 1",
        ));
        assert!(written.is_err());
        assert_eq!(finished.unwrap_err(), "no such codec");
        let (_, finished) = fed(script("cat >/dev/null; kill -9 $$"));
        assert!(finished.unwrap_err().contains("signal: 9"));
        let (_, finished) = fed(script("cat >/dev/null; kill -XFSZ $$"));
        assert!(finished.unwrap_err().contains("File too large"));
        let (_, finished) = fed(script(
            "cat >/dev/null; echo 'av_interleaved_write_frame: No space left on device' >&2",
        ));
        assert!(finished.unwrap_err().contains("No space left"));
    }
}
