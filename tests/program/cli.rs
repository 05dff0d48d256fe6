//! The command held against DESIGN's contract: what it writes, what it says, and that it leaves nothing half-done.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Output, Stdio};
use std::time::{Duration, Instant};

use crate::common::project_file;
#[cfg(unix)]
use crate::common::signals::{self, Signal};
use assert_cmd::Command;
use gnomon::capture::FrameSource;

const HEADER: &str =
    "frame,time_s,anchor,status,markers,tx_m,ty_m,tz_m,rx,ry,rz,track_ms,render_ms";

/// gnomon in a folder of its own.
fn gnomon(folder: &Path) -> Command {
    let mut command = Command::cargo_bin("gnomon").expect("the program");
    command.current_dir(folder);
    command
}

fn config(name: &str) -> String {
    let path = project_file(&format!("config/{name}.toml"));
    path.to_str().expect("a plain path").to_owned()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// Runs `replay`, which must do its job; what it says.
fn replay(folder: &Path, arguments: &[&str]) -> String {
    let output = gnomon(folder)
        .arg("replay")
        .args(arguments)
        .output()
        .expect("a run");
    let said = stderr(&output);
    assert!(output.status.success(), "{arguments:?}: {said}");
    assert!(output.stdout.is_empty(), "results go to files");
    said
}

/// Runs `replay`, which must fail, say each of `parts`, and print nothing; what it says.
fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) -> String {
    let output = gnomon(folder)
        .arg("replay")
        .args(arguments)
        .output()
        .expect("a run");
    let said = stderr(&output);
    assert!(!output.status.success(), "{arguments:?} succeeded: {said}");
    assert!(output.stdout.is_empty(), "talk goes to stderr");
    assert!(!said.contains("panicked"), "{said}");
    for part in parts {
        assert!(said.contains(part), "{arguments:?} lacks {part:?}: {said}");
    }
    said
}

/// All files under a folder, by their relative names.
fn files(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut waiting = vec![folder.to_owned()];
    while let Some(next) = waiting.pop() {
        for entry in std::fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                waiting.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below");
                found.insert(name.to_str().expect("a plain name").to_owned());
            }
        }
    }
    found
}

fn read(path: PathBuf) -> Vec<u8> {
    std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

fn text(path: PathBuf) -> String {
    String::from_utf8(read(path)).expect("text")
}

/// A scene like `config/lamp.toml` that plays another recording of the same camera.
fn lamp_scene_with(folder: &Path, source: &Path) -> String {
    let replaced = |key: &str| format!("source = \"{key}\"");
    let text = text(project_file("config/lamp.toml"))
        .replace(
            &replaced("recordings/lamp"),
            &format!(
                "{}\ncalibration = \"{}\"",
                replaced(&source.display().to_string()),
                project_file("recordings/lamp/camera.toml").display()
            ),
        )
        .replace(
            "\"models/",
            &format!("\"{}/", project_file("models").display()),
        );
    let scene = folder.join("scene.toml");
    std::fs::write(&scene, text).expect("a scene");
    scene.to_str().expect("a plain path").to_owned()
}

#[test]
fn help_shows_examples() {
    let folder = tempfile::tempdir().unwrap();
    let output = gnomon(folder.path()).arg("--help").output().unwrap();
    assert!(output.status.success());
    let help = String::from_utf8(output.stdout).unwrap();
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| line.starts_with("  "))
        // (Lines that go on with what a command does lie deeper.)
        .filter(|line| !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(
        commands.contains(&"replay") && commands.contains(&"check"),
        "{help}"
    );
    for command in commands {
        let output = gnomon(folder.path())
            .args([command, "--help"])
            .output()
            .unwrap();
        assert!(output.status.success(), "{command}");
        let help = String::from_utf8(output.stdout).unwrap();
        let shows = ["Example", "Examples"].map(|title| format!("{title}:\n  gnomon {command} "));
        assert!(
            shows.iter().any(|example| help.contains(example)),
            "{command}: {help}"
        );
    }
}

#[test]
fn check_names_the_anchors_of_each_scene() {
    let folder = tempfile::tempdir().unwrap();
    let mut scenes = 0;
    for entry in std::fs::read_dir(project_file("config")).unwrap() {
        let path = entry.unwrap().path();
        let output = gnomon(folder.path())
            .arg("check")
            .arg(&path)
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        assert!(output.stderr.is_empty(), "{}", stderr(&output));
        let said = String::from_utf8(output.stdout).unwrap();
        let scene = gnomon::scene::Scene::load(&path).unwrap();
        for anchor in &scene.anchors {
            assert!(
                said.split_whitespace().any(|word| word == anchor.name),
                "{said}"
            );
        }
        scenes += 1;
    }
    assert!(scenes >= 3);
}

#[test]
fn check_tells_what_a_frame_budget_means_on_this_machine() {
    let folder = tempfile::tempdir().unwrap();
    let scene = lamp_scene_with(folder.path(), &project_file("recordings/lamp"));
    let written = text(PathBuf::from(&scene));
    // No machine does anything in a microsecond, or takes a quarter of an hour.
    for (budget_ms, meant) in [
        ("0.001", "outlines within 8 px"),
        ("1000000", "outlines within 0.5 px"),
    ] {
        let budget = format!("{written}\n[shadows]\nframe_budget_ms = {budget_ms}\n");
        std::fs::write(&scene, budget).unwrap();
        let output = gnomon(folder.path())
            .args(["check", &scene])
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        let said = String::from_utf8(output.stdout).unwrap();
        let line = said.lines().find(|line| line.starts_with("budget"));
        assert!(line.is_some_and(|line| line.contains(meant)), "{said}");
    }
}

#[test]
fn check_points_at_a_typo() {
    let folder = tempfile::tempdir().unwrap();
    let good = lamp_scene_with(folder.path(), &project_file("recordings/lamp"));
    let bad = folder.path().join("bad.toml");
    let good = text(good.into());
    std::fs::write(&bad, good.replace("intensity =", "intensty =")).unwrap();
    let line = 1 + good
        .lines()
        .position(|line| line.starts_with("intensity"))
        .unwrap();
    let output = gnomon(folder.path())
        .args(["check", "bad.toml"])
        .output()
        .unwrap();
    let said = stderr(&output);
    assert!(!output.status.success() && output.stdout.is_empty());
    assert!(said.contains(&format!("bad.toml:{line}:1: ")), "{said}");
    assert!(
        said.contains("unknown key; did you mean \"intensity\"?"),
        "a suggestion: {said}"
    );
    refused(
        folder.path(),
        &["bad.toml", "--out", "DIR"],
        &["bad.toml:", "intensty"],
    );
    assert!(!folder.path().join("DIR").exists());
}

#[test]
fn a_light_in_a_thing_is_warned_of_once() {
    let folder = tempfile::tempdir().unwrap();
    let scene = lamp_scene_with(folder.path(), &project_file("recordings/lamp"));
    let lit_from_the_house = text(scene.clone().into()).replace(
        "position_m = [-0.26, 0.24, 0.46]",
        "position_m = [-0.055, 0.035, 0.03]",
    );
    std::fs::write(&scene, lit_from_the_house).unwrap();
    let said = replay(
        folder.path(),
        &[&scene, "--frames", "0,2", "--poses", "poses.csv"],
    );
    let warning =
        "warning: light 0 is inside \"house\": everything outside of it is in its shadow\n";
    assert_eq!(said.matches(warning).count(), 1, "{said}");
    assert_eq!(said.matches("warning").count(), 1, "{said}");
}

#[test]
fn layers_are_the_contract_s() {
    let folder = tempfile::tempdir().unwrap();
    let layers = ["--layers", "role,shadow,gain,depth"];
    let lamp = config("lamp");
    let mut arguments = vec![lamp.as_str(), "--frames", "0,3", "--out", "DIR"];
    arguments.extend(layers);
    arguments.extend(["--poses", "poses.csv", "--stats", "stats.json"]);
    replay(folder.path(), &arguments);
    let mut expected = BTreeSet::from(["poses.csv".to_owned(), "stats.json".to_owned()]);
    for frame in ["000000", "000003"] {
        for suffix in [
            ".png",
            "_role.png",
            "_shadow_0.png",
            "_gain.png",
            "_depth.exr",
        ] {
            expected.insert(format!("DIR/{frame}{suffix}"));
        }
    }
    assert_eq!(files(folder.path()), expected);
    for frame in ["000000", "000003"] {
        let roles = hold_pictures(&folder.path().join("DIR"), frame);
        hold_depth(&folder.path().join("DIR"), frame, &roles);
    }
    hold_poses(folder.path());
    hold_stats(folder.path());
}

/// Holds a frame's pictures against the contract; its roles.
fn hold_pictures(folder: &Path, frame: &str) -> Vec<u8> {
    let picture = |name: &str| {
        let picture = image::open(folder.join(name)).unwrap();
        assert_eq!((picture.width(), picture.height()), (640, 480), "{name}");
        picture
    };
    let color = |name: &str| picture(name).color();
    assert_eq!(color(&format!("{frame}.png")), image::ColorType::Rgb8);
    assert_eq!(color(&format!("{frame}_gain.png")), image::ColorType::Rgb16);
    assert_eq!(color(&format!("{frame}_role.png")), image::ColorType::L8);
    assert_eq!(
        color(&format!("{frame}_shadow_0.png")),
        image::ColorType::L8
    );
    let roles = picture(&format!("{frame}_role.png"))
        .into_luma8()
        .into_raw();
    let values: BTreeSet<u8> = roles.iter().copied().collect();
    assert!(values.is_subset(&BTreeSet::from([0, 100, 200])) && values.contains(&200));
    let bits = picture(&format!("{frame}_shadow_0.png")).into_luma8();
    let values: BTreeSet<u8> = bits.into_raw().into_iter().collect();
    assert!(values.is_subset(&BTreeSet::from([0, 1, 2, 3])) && values.contains(&2));
    let gain = picture(&format!("{frame}_gain.png"))
        .into_rgb16()
        .into_raw();
    let unchanged = gain.iter().filter(|&&gain| gain == 32768).count();
    assert!(2 * unchanged > gain.len(), "1 is without a change");
    assert!(gain.iter().min().is_some_and(|&least| least < 20_000));
    roles
}

/// Holds a frame's depth: nowhere but where there is something, and there as far as the scene is.
fn hold_depth(folder: &Path, frame: &str, roles: &[u8]) {
    let exr = folder.join(format!("{frame}_depth.exr"));
    let depth = exr::prelude::read_first_flat_layer_from_file(&exr).unwrap();
    assert_eq!(
        (depth.layer_data.size.x(), depth.layer_data.size.y()),
        (640, 480)
    );
    let [channel] = &depth.layer_data.channel_data.list[..] else {
        panic!("one channel")
    };
    for (depth_m, role) in channel.sample_data.values_as_f32().zip(roles) {
        // The camera is 0.7 m from the table.
        let holds = if *role == 0 {
            depth_m == 0.0
        } else {
            (0.3..2.0).contains(&depth_m)
        };
        assert!(holds, "{depth_m} m where the role is {role}");
    }
}

fn hold_poses(folder: &Path) {
    let poses = text(folder.join("poses.csv"));
    let rows: Vec<Vec<&str>> = poses
        .lines()
        .skip(1)
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(poses.lines().next(), Some(HEADER));
    assert_eq!(
        rows.len(),
        4,
        "a row for each frame up to the last asked for"
    );
    for (index, row) in rows.iter().enumerate() {
        assert_eq!(row.len(), 13);
        assert_eq!(
            (row[0], row[2], row[3]),
            (&*index.to_string(), "table", "tracked")
        );
        let drawn = [0, 3].contains(&index);
        assert_eq!(
            row[12].parse::<f64>().is_ok(),
            drawn,
            "render_ms of {index}"
        );
        assert!(row[11].parse::<f64>().is_ok(), "track_ms of {index}");
    }
}

fn hold_stats(folder: &Path) {
    let stats: serde_json::Value =
        serde_json::from_slice(&read(folder.join("stats.json"))).unwrap();
    assert_eq!(
        (&stats["frames"], &stats["drawn"], &stats["drops"]),
        (&4.into(), &2.into(), &0.into())
    );
    assert!(stats["detector"].as_str().unwrap().contains("apriltag"));
    assert_eq!(stats["technique"], "volumes");
    assert!(!stats["adapter"].as_str().unwrap().is_empty());
    assert!(stats["peak_memory_mib"].as_f64().unwrap() > 1.0);
    for stage in ["decode", "track", "render", "encode"] {
        let stage = &stats["stages"][stage];
        let [median, p95, max] =
            ["median_ms", "p95_ms", "max_ms"].map(|key| stage[key].as_f64().unwrap());
        assert!(0.0 < median && median <= p95 && p95 <= max, "{stage}");
    }
}

/// The poses without the two times, which no two runs share.
fn without_times(poses: &str) -> Vec<Vec<&str>> {
    poses
        .lines()
        .map(|line| line.split(',').take(11).collect())
        .collect()
}

#[test]
fn replays_repeat_bit_for_bit_and_poses_replace_the_tracker() {
    let folder = tempfile::tempdir().unwrap();
    let hand = config("hand");
    let run = |out: &str, poses: &str, more: &[&str]| {
        let mut arguments = vec![hand.as_str(), "--frames", "0,2,5", "--out", out];
        arguments.extend(["--layers", "role,shadow,gain,depth", "--poses", poses]);
        arguments.extend(more);
        replay(folder.path(), &arguments);
    };
    run("first", "first.csv", &[]);
    run("again", "again.csv", &[]);
    run("given", "given.csv", &["--poses-from", "first.csv"]);
    run("bare", "bare.csv", &["--bare"]);
    let names = files(&folder.path().join("first"));
    assert_eq!(names.len(), 3 * 5);
    let of = |out: &str, name: &str| read(folder.path().join(out).join(name));
    for other in ["again", "given"] {
        assert_eq!(files(&folder.path().join(other)), names);
    }
    for name in &names {
        assert!(of("first", name) == of("again", name), "again: {name}");
        assert!(of("first", name) == of("given", name), "given: {name}");
    }
    assert!(of("first", "000005.png") != of("bare", "000005.png"));
    let poses = |name: &str| text(folder.path().join(name));
    let first = poses("first.csv");
    assert_eq!(without_times(&first), without_times(&poses("again.csv")));
    assert_eq!(
        without_times(&first).len(),
        1 + 2 * 6,
        "two anchors a frame"
    );
    let given = poses("given.csv");
    assert!(
        given
            .lines()
            .skip(1)
            .all(|line| line.split(',').nth(11) == Some("")),
        "no tracker, no time for it"
    );
}

#[test]
fn mistakes_are_told_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = config("lamp");
    let cases: [(&[&str], &[&str]); 8] = [
        (
            &["--layers", "role", "--out", "a.mp4"],
            &["--layers", "folder", "a.mp4"],
        ),
        (
            &["--adapter", "no such card", "--out", "a.mp4"],
            &["no such card", "there are: "],
        ),
        (
            &["--layers", "roll", "--out", "DIR"],
            &["roll", "role", "shadow", "gain", "depth"],
        ),
        (&["--poses-from", "none.csv", "--out", "DIR"], &["none.csv"]),
        (&["--out", "a.webm"], &["a.webm", ".mp4"]),
        (&[], &["nothing to do", "--out"]),
        (&["--layers", "role"], &["--out"]),
        (&["--frames", "-1", "--out", "DIR"], &["-1"]),
    ];
    for (arguments, parts) in cases {
        let all: Vec<&str> = [lamp.as_str()].iter().chain(arguments).copied().collect();
        refused(folder.path(), &all, parts);
        assert_eq!(files(folder.path()), BTreeSet::new(), "{arguments:?}");
    }
    for elsewhere in [["--sheet", "a.png"], ["--poses", "a.csv"]] {
        let mut arguments = vec![lamp.as_str(), "--frames", "0", "--layers", "role"];
        arguments.extend(elsewhere);
        refused(folder.path(), &arguments, &["--layers", "--out"]);
        assert_eq!(files(folder.path()), BTreeSet::new(), "{elsewhere:?}");
    }
    refused(
        folder.path(),
        &["none.toml", "--out", "DIR"],
        &["none.toml"],
    );
    assert_eq!(files(folder.path()), BTreeSet::new());
}

#[test]
fn frame_beyond_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = config("lamp");
    let said = refused(
        folder.path(),
        &[&lamp, "--frames", "1,500", "--out", "a.mp4"],
        &["frame 500", "120 frames"],
    );
    assert!(said.contains("--frames"), "{said}");
    // What was done is kept, and whole.
    assert_eq!(files(folder.path()), BTreeSet::from(["a.mp4".to_owned()]));
    let video = folder.path().join("a.mp4");
    let mut source = FrameSource::open(video.to_str().unwrap()).unwrap();
    while source.next_frame().unwrap().is_some() {}
    assert_eq!(source.good_frames(), 1);
}

/// A recording of 30 frames whose file is cut after its 20th or so.
#[test]
fn truncated_video() {
    let folder = tempfile::tempdir().unwrap();
    let whole = folder.path().join("whole.mkv");
    let made = Process::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(project_file("recordings/lamp/video.mp4"))
        .args(["-frames:v", "30", "-c:v", "libx264", "-g", "10", "-bf", "0"])
        .arg(&whole)
        .status()
        .unwrap();
    assert!(made.success());
    let bytes = read(whole);
    let cut = folder.path().join("cut.mkv");
    std::fs::write(&cut, &bytes[..bytes.len() * 2 / 3]).unwrap();
    let mut source = FrameSource::open(cut.to_str().unwrap()).unwrap();
    let mut good = BTreeSet::new();
    while let Some(frame) = source.next_frame().unwrap() {
        good.insert(format!("{:06}.png", frame.index));
    }
    assert!((10..30).contains(&good.len()), "{} good frames", good.len());

    let scene = lamp_scene_with(folder.path(), &cut);
    refused(
        folder.path(),
        &[&scene, "--out", "DIR", "--poses", "poses.csv", "--bare"],
        &["damaged", "all good frames"],
    );
    assert_eq!(files(&folder.path().join("DIR")), good);
    let rows = text(folder.path().join("poses.csv")).lines().count();
    assert_eq!(rows, 1 + good.len());
}

/// One picture of a folder cannot be read; those after it keep their places.
#[test]
fn damaged_picture_in_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("recording");
    std::fs::create_dir(&recording).unwrap();
    for index in 0..6 {
        let path = recording.join(format!("{index:06}.png"));
        if index == 2 {
            std::fs::write(path, "no picture").unwrap();
        } else {
            let grey = image::RgbImage::from_pixel(640, 480, image::Rgb([90; 3]));
            grey.save(path).unwrap();
        }
    }
    let scene = lamp_scene_with(folder.path(), &recording);
    let said = refused(
        folder.path(),
        &[&scene, "--frames", "0,4", "--bare", "--out", "DIR"],
        &["damaged", "000002.png"],
    );
    assert!(!said.contains("ends after"), "{said}");
    assert_eq!(
        files(&folder.path().join("DIR")),
        BTreeSet::from(["000000.png".to_owned(), "000004.png".to_owned()])
    );
}

#[cfg(unix)]
#[test]
fn interrupt_leaves_a_whole_video() {
    stop_midway(Signal::INT);
}

#[cfg(unix)]
#[test]
fn termination_leaves_a_whole_video() {
    stop_midway(Signal::TERM);
}

#[cfg(unix)]
fn stop_midway(signal: Signal) {
    let folder = tempfile::tempdir().expect("a run that can be stopped");
    // Long enough for any card to be in the midst of it.
    let inputs = tempfile::tempdir().expect("a folder");
    let long = inputs.path().join("long.mp4");
    let made = Process::new("ffmpeg")
        .args(["-v", "error", "-stream_loop", "9", "-i"])
        .arg(project_file("recordings/lamp/video.mp4"))
        .args(["-c", "copy"])
        .arg(&long)
        .status()
        .expect("ffmpeg");
    assert!(made.success());
    let scene = lamp_scene_with(inputs.path(), &long);
    let started = Instant::now();
    let child = Process::new(assert_cmd::cargo::cargo_bin("gnomon"))
        .args(["replay", &scene, "--out", "a.mp4", "--poses", "poses.csv"])
        .current_dir(folder.path())
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .expect("a run that can be stopped");
    let has_begun = |name: &String| name.starts_with(".gnomon-") && name.ends_with(".mp4");
    while !files(folder.path()).iter().any(has_begun) {
        assert!(
            started.elapsed() < Duration::from_secs(30),
            "it never began"
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(1500));
    signals::send(signal, child.id()).expect("a run that can be stopped");
    let output = child.wait_with_output().expect("a run that can be stopped");
    let said = stderr(&output);
    assert!(!output.status.success(), "{said}");
    assert!(output.status.code().is_some(), "it ended by itself: {said}");
    assert!(said.contains("interrupted"), "{said}");
    assert_eq!(
        files(folder.path()),
        BTreeSet::from(["a.mp4".to_owned(), "poses.csv".to_owned()])
    );
    let video = folder.path().join("a.mp4");
    let mut source = FrameSource::open(video.to_str().expect("a run that can be stopped"))
        .expect("a run that can be stopped");
    while source
        .next_frame()
        .expect("a run that can be stopped")
        .is_some()
    {}
    assert!(source.notices().is_empty(), "{:?}", source.notices());
    let frames = source.good_frames();
    assert!((1..1200).contains(&frames), "{frames} frames");
    let rows = text(folder.path().join("poses.csv")).lines().count();
    assert_eq!(rows, 1 + frames as usize, "a row for each frame");
}

#[test]
fn only_drawing_needs_a_gpu() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = config("lamp");
    let without_gpu = |arguments: &[&str]| {
        gnomon(folder.path())
            .args(["replay", &lamp])
            .args(arguments)
            .env("VK_DRIVER_FILES", "/nonexistent")
            .env("VK_ICD_FILENAMES", "/nonexistent")
            .output()
            .unwrap()
    };
    let output = without_gpu(&["--out", "DIR"]);
    let said = stderr(&output);
    assert!(!output.status.success());
    assert!(
        said.contains("no graphics adapter") && !said.contains("panicked"),
        "{said}"
    );
    assert_eq!(files(folder.path()), BTreeSet::new());
    assert!(!folder.path().join("DIR").exists());

    let output = without_gpu(&[
        "--frames",
        "2",
        "--poses",
        "poses.csv",
        "--stats",
        "stats.json",
    ]);
    assert!(output.status.success(), "{}", stderr(&output));
    let poses = text(folder.path().join("poses.csv"));
    assert_eq!(poses.lines().next(), Some(HEADER));
    assert_eq!(poses.lines().count(), 4);
    let stats: serde_json::Value =
        serde_json::from_slice(&read(folder.path().join("stats.json"))).unwrap();
    assert_eq!(stats["adapter"], serde_json::Value::Null);
    assert_eq!(stats["drawn"], 0);
}

#[test]
fn a_recording_is_never_written_over() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("recording");
    std::fs::create_dir(&recording).expect("a folder");
    for file in ["video.mp4", "camera.toml"] {
        let from = project_file("recordings/lamp").join(file);
        std::fs::copy(from, recording.join(file)).expect("a copy");
    }
    let before = read(recording.join("video.mp4"));
    let scene = lamp_scene_with(folder.path(), &recording);
    let targets = [
        ["--out", "recording/video.mp4"],
        ["--out", "recording"],
        ["--out", "recording/new/place"],
        ["--poses", "recording/camera.toml"],
    ];
    for target in targets {
        refused(
            folder.path(),
            &[&[scene.as_str()], &target[..]].concat(),
            &["write elsewhere"],
        );
    }
    assert_eq!(read(recording.join("video.mp4")), before);
    assert_eq!(
        files(&recording),
        BTreeSet::from(["camera.toml".to_owned(), "video.mp4".to_owned()])
    );
}

#[test]
fn bare_layers_know_no_virtual_thing() {
    let folder = tempfile::tempdir().expect("a folder");
    let lamp = config("lamp");
    let arguments = [
        lamp.as_str(),
        "--bare",
        "--frames",
        "0",
        "--layers",
        "role,shadow,gain",
        "--out",
        "out",
    ];
    replay(folder.path(), &arguments);
    let layer = |name: &str| {
        let path = folder.path().join("out").join(format!("000000_{name}.png"));
        image::open(path).expect("a layer")
    };
    let (role, shadow) = (layer("role").to_luma8(), layer("shadow_0").to_luma8());
    assert!(role.iter().all(|&role| role == 0 || role == 100));
    assert!(shadow.iter().all(|&bits| bits & 2 == 0) && shadow.contains(&1));
    assert!(layer("gain").to_rgb16().iter().all(|&gain| gain == 32768));
}

#[cfg(target_os = "linux")]
#[test]
fn nobody_who_listens_is_no_failure_and_a_full_stream_neither() {
    let folder = tempfile::tempdir().expect("a folder");
    // A full device.
    let full = || {
        let device = std::fs::File::options().write(true).open("/dev/full");
        Stdio::from(device.expect("Linux has it"))
    };
    let lamp = config("lamp");
    let run = |stdout: Stdio, stderr: Stdio, arguments: &[&str]| {
        let mut command = Process::new(assert_cmd::cargo::cargo_bin("gnomon"));
        command.current_dir(folder.path()).args(arguments);
        command.stdout(stdout).stderr(stderr);
        command.status().expect("a run").code()
    };
    let check = ["check", &lamp];
    assert_eq!(run(full(), Stdio::null(), &check), Some(0));
    // A pipe that nobody reads from any more.
    let closed = || {
        let (reader, writer) = std::io::pipe().expect("a pipe");
        drop(reader);
        Stdio::from(writer)
    };
    assert_eq!(run(closed(), closed(), &check), Some(0));
    let wrong = ["check", "no-such-scene.toml"];
    assert_eq!(run(Stdio::null(), full(), &wrong), Some(1));
    assert_eq!(run(Stdio::null(), closed(), &wrong), Some(1));
}

#[test]
fn control_characters_of_files_are_spelt_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let scene = folder.path().join("a.toml");
    for text in [
        "[camera]\nsource = \"a\u{1b}]0;title\u{7}\"\n",
        "[cam\u{1b}[2Jera]\n",
    ] {
        std::fs::write(&scene, text).expect("a scene");
        let output = gnomon(folder.path())
            .args(["check", "a.toml"])
            .output()
            .expect("a run");
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains("\\u{1b}"), "{said:?}");
        assert!(!said.contains(['\u{1b}', '\u{7}']), "{said:?}");
    }
}

#[test]
fn what_is_no_scene_is_taken_for_what_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = project_file("recordings/lamp");
    let video = lamp.join("video.mp4").display().to_string();
    let picture = project_file("docs/lamp.png").display().to_string();
    let session = folder.path().join("session");
    std::fs::create_dir(&session).unwrap();
    std::fs::write(session.join("scene.toml"), "").unwrap();
    for (path, says) in [
        (video.as_str(), "a video, not a scene"),
        (picture.as_str(), "a picture, not a scene"),
        (lamp.to_str().unwrap(), "a folder, not a scene"),
        ("session", "its scene is session/scene.toml"),
    ] {
        for command in ["replay", "check"] {
            let output = gnomon(folder.path())
                .args([command, path])
                .output()
                .unwrap();
            let said = stderr(&output);
            assert!(!output.status.success() && said.contains(says), "{said}");
            assert!(
                said.lines().count() == 1 && !said.contains("\\u{"),
                "{said}"
            );
        }
    }
}

/// What `check` says on stdout, which must not be refused.
fn checked(folder: &Path, scene: &str) -> String {
    let output = gnomon(folder).args(["check", scene]).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn check_and_replay_agree_on_what_cannot_be_played() {
    let folder = tempfile::tempdir().unwrap();
    let video = project_file("recordings/lamp/video.mp4");
    let scene = lamp_scene_with(folder.path(), &video);
    let good = text(PathBuf::from(&scene));
    let calibration = text(project_file("recordings/lamp/camera.toml"));
    let smaller = folder.path().join("smaller.toml");
    let size_line = (calibration.lines())
        .find(|line| line.starts_with("size_px"))
        .unwrap();
    std::fs::write(
        &smaller,
        calibration.replace(size_line, "size_px = [320, 240]"),
    )
    .unwrap();
    let calibration_line = (good.lines())
        .find(|line| line.starts_with("calibration"))
        .unwrap();
    assert!(!checked(folder.path(), &scene).contains("warning"));
    for (line, says) in [
        ("calibration = \"smaller.toml\"", "320"),
        ("calibration = \"none.toml\"", "none.toml"),
    ] {
        std::fs::write(&scene, good.replace(calibration_line, line)).unwrap();
        for job in [vec!["check", &scene], vec!["replay", &scene, "--out", "o"]] {
            let output = gnomon(folder.path()).args(&job).output().unwrap();
            let said = stderr(&output);
            assert!(!output.status.success(), "{job:?} {line}");
            assert!(said.contains(says), "{job:?} {line}: {said}");
        }
    }
}

/// Whatever `check` makes of a scene, playing it comes to the same end.
#[test]
fn check_and_replay_agree_on_markers_that_are_not_there() {
    let folder = tempfile::tempdir().unwrap();
    let recording = folder.path().join("short");
    std::fs::create_dir(&recording).unwrap();
    let lamp = project_file("recordings/lamp");
    let cut = std::process::Command::new("ffmpeg")
        .args(["-v", "error", "-i"])
        .arg(lamp.join("video.mp4"))
        .args(["-c", "copy", "-frames:v", "12"])
        .arg(recording.join("video.mp4"))
        .status();
    assert!(cut.unwrap().success());
    let scene = lamp_scene_with(folder.path(), &recording);
    let good = text(PathBuf::from(&scene));
    let lone = "[[marker]]\nname = \"card\"\nid = 77\nsize_m = 0.04\n";
    for (written, says) in [
        (
            good.replace("size_m = 0.044", "size_m = 44.0"),
            "\"table\" was never found",
        ),
        (
            good.replace("tag36h11", "tag25h9"),
            "are seen; the scene wants tag25h9 0 to 5",
        ),
        (
            good.replace("[[virtual]]", &format!("{lone}[[virtual]]")),
            "\"card\" was never found",
        ),
    ] {
        assert_ne!(written, good, "{says}");
        std::fs::write(&scene, &written).unwrap();
        for job in [
            vec!["check", &scene],
            vec!["track", &scene, "--poses", "p.csv"],
        ] {
            let output = gnomon(folder.path()).args(&job).output().unwrap();
            assert!(!output.status.success(), "{job:?} {says}");
            assert!(
                stderr(&output).contains(says),
                "{job:?}: {}",
                stderr(&output)
            );
        }
    }
}

#[test]
fn check_warns_of_what_shows_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scene = lamp_scene_with(folder.path(), &project_file("recordings/lamp"));
    let good = text(PathBuf::from(&scene));
    let without_lights = good.split("[[light]]").next().unwrap();
    let dark: String = without_lights
        .lines()
        .filter(|line| !line.starts_with("ambient"))
        .map(|line| format!("{line}\n"))
        .collect();
    let torus = good.find("[[virtual]]").unwrap();
    let (before, after) = good.split_at(torus);
    let position = after
        .lines()
        .find(|line| line.starts_with("position_m"))
        .unwrap();
    let away = format!(
        "{before}{}",
        after.replace(position, "position_m = [40.0, 0.0, 0.0]")
    );
    for (written, says) in [(away, "out of view"), (dark, "nothing lights the scene")] {
        assert_ne!(written, good, "{says}");
        std::fs::write(&scene, &written).unwrap();
        let said = checked(folder.path(), &scene);
        assert!(said.contains(says), "{says}: {said}");
    }
}

#[test]
fn check_tells_which_light_is_not_used() {
    let folder = tempfile::tempdir().unwrap();
    let scene = lamp_scene_with(folder.path(), &project_file("recordings/lamp"));
    let good = text(PathBuf::from(&scene));
    let (table, _) = good.split_once("[[light]]").unwrap();
    assert!(table.contains("[[virtual]]"));
    std::fs::copy(
        project_file("recordings/sky/probe.hdr"),
        folder.path().join("probe.hdr"),
    )
    .unwrap();
    let probe = "[probe]\nimage = \"probe.hdr\"\nposition_m = [0, 0, 0.06]\n";
    let ambient = "[ambient]\nradiance = 0.2\n";
    let volumes = "[shadows]\ntechnique = \"volumes\"\n";
    let dark = "nothing lights the scene";
    for (added, says) in [
        (
            format!("{probe}{ambient}"),
            Some("[ambient] radiance is not used"),
        ),
        (
            format!("{probe}{ambient}{volumes}"),
            Some("the probe is not used"),
        ),
        (format!("{probe}{volumes}"), Some(dark)),
        (
            "[environment]\nregions = 16\n".to_owned(),
            Some("[environment] is not used"),
        ),
        (format!("{probe}[environment]\nregions = 16\n"), None),
        (probe.to_owned(), None),
    ] {
        let written = format!("{table}{added}");
        std::fs::write(&scene, written).unwrap();
        let said = checked(folder.path(), &scene);
        match says {
            Some(says) => assert!(said.contains(says), "{added}: {said}"),
            None => assert!(!said.contains("not used") && !said.contains(dark), "{said}"),
        }
    }
}

#[test]
fn help_that_cannot_be_written_was_not_given() {
    for argument in ["--help", "--version"] {
        let full = std::fs::OpenOptions::new().write(true).open("/dev/full");
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_gnomon"))
            .arg(argument)
            .stdout(full.unwrap())
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(1), "{argument}");
        assert!(stderr(&output).contains("No space left"), "{argument}");
    }
}

#[test]
fn shells_and_man_get_what_they_need() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, part) in [
        (["completions", "bash"], "--poses-from"),
        (["completions", "zsh"], "#compdef gnomon"),
        (["completions", "fish"], "complete -c gnomon"),
        (["manual", "replay"], ".TH gnomon-replay 1"),
        (["manual", "replay"], "poses\\-from"),
    ] {
        let output = gnomon(folder.path()).args(arguments).output().unwrap();
        assert!(output.status.success() && output.stderr.is_empty());
        let given = String::from_utf8(output.stdout).unwrap();
        assert!(given.contains(part), "{arguments:?} lacks {part}: {given}");
        #[cfg(target_os = "linux")]
        {
            // A shell makes a file of it, which must not be half there without a word.
            let full = std::fs::File::create("/dev/full").unwrap();
            let output = std::process::Command::new(assert_cmd::cargo::cargo_bin("gnomon"))
                .args(arguments)
                .stdout(full)
                .output()
                .unwrap();
            assert!(!output.status.success() && stderr(&output).contains("No space left"));
        }
    }
}

#[test]
#[cfg(target_os = "linux")]
fn a_machine_without_a_desktop_complains_of_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = gnomon(folder.path())
        .args(["replay", &config("lamp"), "--frames", "0", "--out", "o"])
        .env_remove("XDG_RUNTIME_DIR")
        .env_remove("NODEVICE_SELECT")
        .output()
        .unwrap();
    let said = stderr(&output);
    assert!(output.status.success() && !said.contains("error"), "{said}");
}

/// What somebody types who has not read the manual, and what says how it is meant.
#[test]
fn what_is_typed_wrong_is_told_how_it_is_meant() {
    let folder = tempfile::tempdir().expect("a folder");
    std::fs::write(folder.path().join("walk.mp4"), "x").expect("written");
    let markers_of = |family| {
        let size = ["markers", "--ids", "0", "--size-mm", "40"];
        [&size[..], &["--out", "a.svg", "--family", family]].concat()
    };
    for (arguments, code, part) in [
        (
            &["walk.mp4"][..],
            2,
            "walk.mp4 is a file, not a command: gnomon live, replay and check take a scene",
        ),
        (
            &["replay", "a.toml", "--frames", "0-3"],
            2,
            "whole numbers are expected, joined by commas",
        ),
        (
            &["replay", "a.toml", "--frames", "-1"],
            2,
            "whole numbers are expected",
        ),
        (
            &["track", "walk.mp4", "--size-mm", "-5", "--poses", "-"],
            1,
            "--size-mm -5: out of range; allowed: 0.1 to",
        ),
        (
            &["track", "walk.mp4", "--size-mm", "40mm", "--poses", "-"],
            2,
            "a number of millimetres is expected",
        ),
        (
            &markers_of("AprilTag 36h11"),
            2,
            "did you mean \"tag36h11\" (as AprilTag prints it) or \"DICT_APRILTAG_36h11\"",
        ),
        (&markers_of("4x4_50"), 2, "did you mean \"DICT_4X4_50\"?"),
    ] {
        let output = gnomon(folder.path())
            .args(arguments)
            .output()
            .expect("a run");
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(said.contains(part), "{arguments:?}: {said}");
    }
    assert!(!folder.path().join("a.svg").exists());
}
