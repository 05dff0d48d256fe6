//! The window itself, under Xvfb: it opens, obeys the keys that xdotool presses, and ends with whole files when it is told
//! to. `scripts/setup tests` installs both; build.rs says whether they are there.

#![cfg(target_os = "linux")]

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::gpu_faults;
use crate::common::prints::{BENT_CAMERA, CHESSBOARD, Photographer, Print, good_poses};
use crate::common::signals::{self, Signal};
use gnomon::app::files::video_writer::{Codec, Naming, Pace, VideoWriter};
use gnomon::capture::{FrameSource, load_calibration};

const SOON: Duration = Duration::from_secs(90);

/// An X server without a screen.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    fn open() -> Self {
        let mut server = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "900x600x24"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut number = String::new();
        let mut said = std::io::BufReader::new(server.stdout.take().unwrap());
        std::io::BufRead::read_line(&mut said, &mut number).unwrap();
        // Nothing is said by a server that ends at once.
        assert_ne!(number.trim(), "", "Xvfb opened no display");
        let name = format!(":{}", number.trim());
        Self { server, name }
    }

    fn gnomon(&self, arguments: &[&str]) -> Child {
        self.command(arguments).spawn().unwrap()
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_gnomon"));
        command
            .args(arguments)
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env("DISPLAY", &self.name)
            .env_remove("WAYLAND_DISPLAY")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    fn xdotool(&self, arguments: &[&str]) -> Output {
        Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.name)
            .output()
            .unwrap()
    }

    /// Waits for the window.
    fn window(&self) -> String {
        let began = Instant::now();
        while began.elapsed() < SOON {
            let found = self.xdotool(&["search", "--onlyvisible", "--name", "gnomon"]);
            let found = String::from_utf8_lossy(&found.stdout).into_owned();
            if let Some(window) = found.lines().next() {
                return window.to_owned();
            }
            thread::sleep(Duration::from_millis(100));
        }
        panic!("no window opened");
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        _ = self.server.kill();
        _ = self.server.wait();
    }
}

/// Waits until something is there.
fn wait_for(what: &str, holds: impl Fn() -> bool) {
    let began = Instant::now();
    while !holds() {
        assert!(began.elapsed() < SOON, "not in time: {what}");
        thread::sleep(Duration::from_millis(50));
    }
}

fn ended(child: Child) -> Output {
    let id = child.id();
    let (sender, receiver) = std::sync::mpsc::channel();
    thread::spawn(move || sender.send(child.wait_with_output()));
    match receiver.recv_timeout(SOON) {
        Ok(output) => output.unwrap(),
        Err(_) => {
            _ = signals::send(Signal::KILL, id);
            panic!("it did not end");
        }
    }
}

fn interrupt(child: &Child) {
    signals::send(Signal::INT, child.id()).unwrap();
}

fn frames_of(recording: &Path) -> usize {
    let mut source = FrameSource::open(recording.to_str().unwrap()).unwrap();
    let mut frames = 0;
    while source.next_frame().unwrap().is_some() {
        frames += 1;
    }
    frames
}

#[test]
#[cfg_attr(not(has_xvfb), ignore = "needs Xvfb and xdotool")]
fn keys_record_and_an_interrupt_leaves_whole_files() {
    let display = Display::open();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let window = display.gnomon(&["live", "config/lamp.toml", "--out", out]);
    let shown = display.window();
    // No window manager gives it the keyboard.
    let press = |key: &str| {
        display.xdotool(&["windowfocus", &shown, "key", key]);
    };
    let written = |name: &str| -> PathBuf { folder.path().join(name) };
    // Before the first picture there is none to save.
    wait_for("a screenshot", || {
        press("s");
        thread::sleep(Duration::from_millis(400));
        written("picture-001.png").is_file()
    });
    press("r");
    wait_for("a session", || written("session-001/video.mkv").is_file());
    press("v");
    wait_for("a video", || written("composite-001.mkv").is_file());
    for key in ["p", "question", "3", "7", "1", "m", "a", "f"] {
        press(key);
        thread::sleep(Duration::from_millis(150));
    }
    thread::sleep(Duration::from_secs(2));
    interrupt(&window);
    let output = ended(window);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(
        said.contains("session-001") && said.contains("composite-001"),
        "{said}"
    );
    assert!(frames_of(&written("session-001")) > 10);
    assert!(frames_of(&written("composite-001.mkv")) > 10);
    let picture = image::open(written("picture-001.png")).unwrap();
    assert_eq!((picture.width(), picture.height()), (640, 480));
}

#[test]
#[cfg_attr(not(has_xvfb), ignore = "needs Xvfb and xdotool")]
fn a_gpu_that_is_lost_is_replaced_and_what_is_recorded_goes_on() {
    let display = Display::open();
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let loss = folder.path().join("loss");
    let mut command = display.command(&["live", "config/lamp.toml", "--out"]);
    let fault = format!("file {}", loss.display());
    let window = gpu_faults::let_fail(command.arg(&out), &fault)
        .spawn()
        .unwrap();
    let written = |name: &str| -> PathBuf { out.join(name) };
    let press = |key: &str| {
        display.xdotool(&["windowfocus", &display.window(), "key", key]);
        thread::sleep(Duration::from_millis(400));
    };
    let saves = |name: &str| {
        wait_for("a picture", || {
            press("s");
            written(name).is_file()
        });
    };
    saves("picture-001.png");
    press("v");
    press("r");
    wait_for("a video", || written("composite-001.mkv").is_file());
    wait_for("a session", || written("session-001/video.mkv").is_file());
    // Twice, for the second device is as good as the first.
    for _ in 0..2 {
        thread::sleep(Duration::from_secs(1));
        std::fs::write(&loss, "").unwrap();
        wait_for("the loss", || !loss.exists());
        let before = std::fs::read_dir(&out).unwrap().count();
        wait_for("a picture on the new device", || {
            press("s");
            std::fs::read_dir(&out).unwrap().count() > before
        });
    }
    let frames_before = std::fs::metadata(written("composite-001.mkv"))
        .unwrap()
        .len();
    wait_for("more frames", || {
        std::fs::metadata(written("composite-001.mkv"))
            .unwrap()
            .len()
            > frames_before
    });
    interrupt(&window);
    let output = ended(window);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && !said.contains("panicked"),
        "{said}"
    );
    assert_eq!(said.matches("a new device is opened").count(), 2, "{said}");
    assert!(frames_of(&written("session-001")) > 10, "{said}");
    assert!(frames_of(&written("composite-001.mkv")) > 10, "{said}");
}

/// A film of a target that is held still here and there.
fn film(path: &Path) {
    const FPS: f64 = 10.0;
    const FRAMES_A_VIEW: usize = 12;
    let print = Print::chessboard();
    let size_px = BENT_CAMERA.size_px;
    let mut writer = VideoWriter::create(
        path,
        Codec::Ffv1,
        size_px,
        Pace::Even { fps: FPS },
        Naming::AtOnce,
    )
    .unwrap();
    for pose in good_poses(print) {
        let grey = Photographer::bent().photograph(print, &pose, 1.0);
        let rgba: Vec<u8> = grey
            .into_iter()
            .flat_map(|level| [level, level, level, 255])
            .collect();
        for _ in 0..FRAMES_A_VIEW {
            writer.push(size_px, 0.0, &rgba).unwrap();
        }
    }
    writer.finish().unwrap();
}

#[test]
#[cfg_attr(not(has_xvfb), ignore = "needs Xvfb and xdotool")]
fn a_target_that_is_held_to_the_camera_calibrates_it_though_the_gpu_is_lost() {
    let display = Display::open();
    let folder = tempfile::tempdir().unwrap();
    let recorded = folder.path().join("film.mkv");
    film(&recorded);
    let written = folder.path().join("camera.toml");
    let mut arguments = vec!["calibrate", recorded.to_str().unwrap(), "--watch"];
    arguments.extend(CHESSBOARD.split_whitespace());
    arguments.extend(["--out", written.to_str().unwrap()]);
    let loss = folder.path().join("loss");
    let mut command = display.command(&arguments);
    let fault = format!("file {}", loss.display());
    let mut window = gpu_faults::let_fail(&mut command, &fault).spawn().unwrap();
    let press = |shown: &str, key: &str| {
        display.xdotool(&["windowfocus", shown, "key", key]);
    };
    // Too early: it says so, and goes on.
    press(&display.window(), "Return");
    let seconds = good_poses(Print::chessboard()).len() as f64 * 1.2;
    thread::sleep(Duration::from_secs_f64(seconds / 2.0));
    // The views that it has are not lost with the device.
    std::fs::write(&loss, "").unwrap();
    wait_for("the loss", || !loss.exists());
    thread::sleep(Duration::from_secs_f64(seconds / 2.0 + 3.0));
    assert!(window.try_wait().unwrap().is_none(), "it ended by itself");
    let shown = display.window();
    let began = Instant::now();
    while window.try_wait().unwrap().is_none() {
        assert!(began.elapsed() < SOON, "Enter does not end it");
        press(&shown, "Return");
        thread::sleep(Duration::from_millis(300));
    }
    let output = ended(window);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{said}");
    assert!(said.contains("a new device is opened"), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(printed.contains("focal length"), "{printed}");
    let found = load_calibration(&written).unwrap();
    let off = (found.focal_px / BENT_CAMERA.focal_px - 1.0).abs();
    assert!(off.max_element() < 5e-3, "{found:?}\n{printed}");
}

#[test]
#[cfg_attr(not(has_xvfb), ignore = "needs Xvfb and xdotool")]
fn a_camera_that_is_not_there_is_said_and_no_success() {
    let display = Display::open();
    let window = display.gnomon(&["live", "webcam:no such camera"]);
    thread::sleep(Duration::from_secs(4));
    interrupt(&window);
    let output = ended(window);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{said}");
    assert!(said.contains("camera"), "{said}");
}

#[test]
fn without_a_display_there_is_a_message() {
    let output = Command::new(env!("CARGO_BIN_EXE_gnomon"))
        .args(["live", "config/lamp.toml"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success());
    // The system's libraries may have their say before.
    let mut lines = said.lines();
    assert!(
        lines.any(|line| line.starts_with("gnomon: the window cannot be opened")),
        "{said}"
    );
}
