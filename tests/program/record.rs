//! `gnomon record`: sessions that replay as what was recorded, also after a kill and on a full disk; and live sources
//! taken by `track`.

use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output, Stdio};
use std::time::Duration;

#[cfg(unix)]
use crate::common::signals::{self, Signal};
use crate::common::waiting::wait_for;
use assert_cmd::Command;
use gnomon::capture::{Frame, FrameSource};

fn project_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn gnomon(arguments: &[&str]) -> Output {
    Command::cargo_bin("gnomon")
        .expect("the program")
        .args(arguments)
        .output()
        .expect("a run")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn done(arguments: &[&str]) -> String {
    let output = gnomon(arguments);
    let said = said(&output);
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

fn all_frames(recording: &Path) -> Vec<Frame> {
    let mut source = FrameSource::open(plain(recording)).expect("a recording");
    let mut frames = Vec::new();
    while let Some(frame) = source.next_frame().expect("a frame") {
        frames.push(frame);
    }
    assert!(source.notices().is_empty(), "{:?}", source.notices());
    frames
}

/// The first frames of `lamp`, as they must be in a session.
fn assert_begins_as_lamp(session: &Path) -> usize {
    let frames = all_frames(session);
    let lamp = all_frames(&project_file("recordings/lamp"));
    assert!(frames.len() <= lamp.len(), "{} frames", frames.len());
    for (frame, recorded) in frames.iter().zip(&lamp) {
        assert_eq!(frame.index, recorded.index);
        assert_eq!(frame.time_secs, recorded.time_secs, "frame {}", frame.index);
        assert!(frame.rgba == recorded.rgba, "frame {}", frame.index);
    }
    frames.len()
}

/// A file without its last two columns, the times that the work took.
fn without_costs(poses: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(poses).expect("poses");
    let fields = |line: &str| line.split(',').collect::<Vec<_>>()[..11].join(",");
    text.lines().map(fields).collect()
}

#[test]
fn a_recorded_session_replays_as_its_source_to_the_bit() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let scene = project_file("config/lamp.toml");
    let said = done(&["record", plain(&scene), "--out", plain(&session)]);
    assert!(said.contains("120 frames in "), "{said}");
    assert_eq!(assert_begins_as_lamp(&session), 120);

    // The folder has a scene of its own, and its own calibration.
    let copy = session.join("scene.toml");
    let (of_copy, of_lamp) = (folder.path().join("copy"), folder.path().join("lamp"));
    for (scene, out) in [(&copy, &of_copy), (&scene, &of_lamp)] {
        let poses = out.with_extension("csv");
        done(&[
            "replay",
            plain(scene),
            "--out",
            plain(out),
            "--frames",
            "0,40,119",
            "--poses",
            plain(&poses),
        ]);
    }
    for name in ["000000.png", "000040.png", "000119.png"] {
        let read = |folder: &Path| std::fs::read(folder.join(name)).expect("a picture");
        assert!(read(&of_copy) == read(&of_lamp), "{name}");
    }
    let poses = |out: &Path| without_costs(&out.with_extension("csv"));
    assert_eq!(poses(&of_copy), poses(&of_lamp));
    assert_eq!(poses(&of_copy).len(), 121);
}

/// Starts recording and waits until the session's video is there.
fn start_recording(session: &Path) -> std::process::Child {
    let child = Process::new(assert_cmd::cargo::cargo_bin("gnomon"))
        .args([
            "record",
            plain(&project_file("recordings/lamp")),
            "--out",
            plain(session),
        ])
        .stderr(Stdio::piped())
        .spawn()
        .expect("a start");
    // The file is there before the encoder is.
    wait_for("the video", || {
        std::fs::metadata(session.join("video.mkv")).is_ok_and(|video| video.len() > 0)
    });
    child
}

/// Until nobody writes the video any more.
fn wait_until_settled(session: &Path) {
    let length = || std::fs::metadata(session.join("video.mkv")).map_or(0, |video| video.len());
    let mut before = 0;
    wait_for("the end of the video", || {
        std::thread::sleep(Duration::from_millis(1000));
        std::mem::replace(&mut before, length()) == length() && before > 0
    });
}

#[test]
fn what_was_recorded_before_a_kill_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let mut child = start_recording(&session);
    std::thread::sleep(Duration::from_millis(2000));
    // SIGKILL
    child.kill().unwrap();
    child.wait().unwrap();
    wait_until_settled(&session);
    let frames = assert_begins_as_lamp(&session);
    assert!((5..120).contains(&frames), "{frames} frames");
    let poses = folder.path().join("poses.csv");
    let scene = project_file("config/lamp.toml");
    done(&[
        "track",
        plain(&session),
        "--anchors",
        plain(&scene),
        "--poses",
        plain(&poses),
    ]);
    assert_eq!(without_costs(&poses).len(), frames + 1);
}

/// The encoder that a process has started (Linux).
#[cfg(target_os = "linux")]
fn encoder_of(parent: u32) -> Option<u32> {
    std::fs::read_dir("/proc")
        .ok()?
        .flatten()
        .find_map(|entry| {
            let pid: u32 = entry.file_name().to_str()?.parse().ok()?;
            let status = std::fs::read_to_string(entry.path().join("stat")).ok()?;
            // After the name in parentheses: state, then the parent.
            let (name, rest) = status.rsplit_once(')')?;
            let of_parent = rest.split_whitespace().nth(1)?.parse() == Ok(parent);
            (of_parent && name.ends_with("(ffmpeg")).then_some(pid)
        })
}

#[cfg(target_os = "linux")]
#[test]
fn a_kill_of_the_encoder_too_costs_no_more_than_the_last_moment() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let mut child = start_recording(&session);
    let encoder = encoder_of(child.id()).expect("ffmpeg");
    std::thread::sleep(Duration::from_millis(2500));
    child.kill().unwrap();
    signals::send(Signal::KILL, encoder).unwrap();
    child.wait().unwrap();
    wait_until_settled(&session);
    let frames = assert_begins_as_lamp(&session);
    assert!((5..120).contains(&frames), "{frames} frames");
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_a_recording_well() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let child = start_recording(&session);
    std::thread::sleep(Duration::from_millis(500));
    signals::send(Signal::INT, child.id()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let frames = assert_begins_as_lamp(&session);
    assert!(
        said(&output).contains(&format!("{frames} frames in ")),
        "{}",
        said(&output)
    );
}

/// A limit on the size of files stands for a disk that is full: writing beyond it fails with an error.
#[cfg(unix)]
#[test]
fn what_was_recorded_before_the_disk_was_full_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let script = format!(
        "ulimit -f 6000; exec {:?} record {:?} --out {session:?}",
        assert_cmd::cargo::cargo_bin("gnomon"),
        project_file("recordings/lamp"),
    );
    let output = Process::new("bash").args(["-c", &script]).output().unwrap();
    assert!(!output.status.success());
    let said = said(&output);
    assert!(
        said.contains("video.mkv") && said.contains("File too large"),
        "{said}"
    );
    assert!(!said.contains("panicked"), "{said}");
    let frames = assert_begins_as_lamp(&session);
    assert!((5..120).contains(&frames), "{frames} frames");
}

#[test]
fn recording_ends_by_itself_after_a_time() {
    let folder = tempfile::tempdir().unwrap();
    let session = folder.path().join("session");
    let lamp = project_file("recordings/lamp");
    done(&[
        "record",
        plain(&lamp),
        "--out",
        plain(&session),
        "--seconds",
        "0.5",
    ]);
    let frames = assert_begins_as_lamp(&session);
    assert!((16..100).contains(&frames), "{frames} frames");
}

#[test]
fn what_cannot_be_recorded_leaves_nothing_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("session");
    let lamp = project_file("recordings/lamp");
    for (arguments, part) in [
        (vec!["recordings/none"], "no such file or folder"),
        (vec!["webcam:77"], "camera"),
        (
            vec!["http://127.0.0.1:9/video"],
            "no video comes from there",
        ),
        (vec![plain(&lamp), "--seconds", "0"], "a number above 0"),
        (vec!["webcam:0", "--size", "640"], "WIDTHxHEIGHT"),
        (vec!["webcam:0", "--format", "H264"], "MJPEG, YUYV"),
    ] {
        let output = gnomon(&[&["record"], arguments.as_slice(), &["--out", plain(&out)]].concat());
        let said = said(&output);
        assert!(!output.status.success(), "{arguments:?}");
        assert!(said.contains(part), "{arguments:?} lacks {part:?}: {said}");
        assert!(!said.contains("panicked"), "{said}");
        assert!(!out.exists(), "{arguments:?}");
    }
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("mine.txt"), "mine").unwrap();
    let output = gnomon(&["record", plain(&lamp), "--out", plain(&out)]);
    assert!(
        said(&output).contains("holds something already"),
        "{}",
        said(&output)
    );
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 1);
}

/// A machine with a camera has another answer.
#[cfg(target_os = "linux")]
#[test]
fn cameras_says_when_there_is_none() {
    let any = std::fs::read_dir("/dev")
        .unwrap()
        .flatten()
        .any(|entry| entry.file_name().to_string_lossy().starts_with("video"));
    let output = gnomon(&["cameras"]);
    assert_eq!(output.status.success(), any);
    if !any {
        assert!(
            said(&output).contains("no /dev/video*"),
            "{}",
            said(&output)
        );
    }
}

/// ffmpeg serves a video over HTTP as a phone's camera app does, once.
#[cfg(unix)]
#[test]
fn a_stream_is_tracked_until_an_interrupt() {
    let port = std::net::TcpListener::bind("127.0.0.1:0")
        .unwrap()
        .local_addr()
        .unwrap()
        .port();
    let address = format!("http://127.0.0.1:{port}/video");
    let mut server = Process::new("ffmpeg")
        .args(["-v", "error", "-re", "-stream_loop", "-1", "-i"])
        .arg(project_file("recordings/lamp/video.mp4"))
        .args([
            "-c:v", "mjpeg", "-q:v", "3", "-f", "mpjpeg", "-listen", "1", &address,
        ])
        .stdin(Stdio::null())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(1000));
    let folder = tempfile::tempdir().unwrap();
    let poses = folder.path().join("poses.csv");
    let child = Process::new(assert_cmd::cargo::cargo_bin("gnomon"))
        .args([
            "track",
            &address,
            "--anchors",
            plain(&project_file("config/lamp.toml")),
        ])
        .args([
            "--calibration",
            plain(&project_file("recordings/lamp/camera.toml")),
        ])
        .args(["--poses", plain(&poses)])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    std::thread::sleep(Duration::from_millis(6000));
    signals::send(Signal::INT, child.id()).unwrap();
    let output = child.wait_with_output().unwrap();
    server.kill().unwrap();
    server.wait().unwrap();
    assert!(output.status.success(), "{}", said(&output));
    let rows = without_costs(&poses);
    let tracked = rows
        .iter()
        .filter(|row| row.contains(",table,tracked,"))
        .count();
    assert!(
        tracked > 10 && tracked * 10 > rows.len() * 9,
        "{tracked} of {}: {}",
        rows.len(),
        said(&output)
    );
}
