//! An ffmpeg process that encodes what it is fed. Waiting for it has an end: one that hangs is ended.

use std::ffi::OsStr;
use std::io::{self, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::thread::JoinHandle;
use std::time::Duration;

/// Between two looks at whether it has ended.
const NAP: Duration = Duration::from_millis(10);
/// An encoder that neither takes a frame nor writes a byte for so long hangs.
const PATIENCE_SECS: u32 = 60;
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
    child: Child,
    /// `None` once its input has ended.
    frames_in: Option<ChildStdin>,
    talk: Option<JoinHandle<String>>,
}

impl Encoder {
    /// Starts ffmpeg with what stands before the output, and the output.
    pub(super) fn start(arguments: &[String], output: &OsStr) -> io::Result<Self> {
        let mut command = Command::new("ffmpeg");
        command
            .args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y"])
            .args(arguments)
            .arg(output)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped());
        // Ctrl-C is for gnomon, which then finishes the video; the encoder must live until that is done.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let mut child = command.spawn()?;
        let frames_in = child.stdin.take();
        #[cfg(unix)]
        if let Some(frames_in) = &frames_in {
            // So that a write waits no longer than it should; where that fails it waits as it always did.
            _ = rustix::io::ioctl_fionbio(frames_in, true);
        }
        let talk = child.stderr.take().map(|mut stderr| {
            std::thread::spawn(move || {
                let mut bytes = Vec::new();
                // What could be read is worth telling, even where reading ended in an error.
                _ = stderr.read_to_end(&mut bytes);
                String::from_utf8_lossy(&bytes).into_owned()
            })
        });
        Ok(Self {
            child,
            frames_in,
            talk,
        })
    }

    /// Ends its input and waits for it, as long as `file` goes on to change.
    ///
    /// # Errors
    /// What it said when it failed, or that it hangs.
    pub(super) fn finish(mut self, file: Option<&Path>) -> Result<(), String> {
        drop(self.frames_in.take());
        let status = self.wait(file)?;
        let said = self.talk.take().map(JoinHandle::join);
        let said = said.and_then(Result::ok).unwrap_or_default();
        let unwritten = UNWRITTEN.iter().any(|words| said.contains(words));
        if status.success() && !unwritten {
            return Ok(());
        }
        match last_lines(&said) {
            words if words.is_empty() => Err(status.to_string()),
            words => Err(words),
        }
    }

    fn wait(&mut self, file: Option<&Path>) -> Result<ExitStatus, String> {
        let state = || {
            let metadata = std::fs::metadata(file?).ok()?;
            Some((metadata.len(), metadata.modified().ok()?))
        };
        let mut before = state();
        let mut naps = 0;
        loop {
            match self.child.try_wait() {
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
            if NAP * naps > Duration::from_secs(u64::from(PATIENCE_SECS)) {
                return Err(format!(
                    "it does not end; nothing happened for {PATIENCE_SECS} s"
                ));
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
        wait_for_room(frames_in)?;
        frames_in.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Waits until a pipe takes something.
#[cfg(unix)]
fn wait_for_room(pipe: &ChildStdin) -> io::Result<()> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let limit = Timespec {
        tv_sec: PATIENCE_SECS.into(),
        tv_nsec: 0,
    };
    let mut pipes = [PollFd::new(pipe, PollFlags::OUT)];
    match poll(&mut pipes, Some(&limit))? {
        0 => Err(io::ErrorKind::TimedOut.into()),
        _ => Ok(()),
    }
}

impl Drop for Encoder {
    fn drop(&mut self) {
        // Both fail only where it is gone already.
        _ = self.child.kill();
        _ = self.child.wait();
    }
}

fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines[lines.len().saturating_sub(4)..].join("; ")
}
