//! Each job beside each thing that can fail: its outputs are whole or not there, nothing else is left behind, no program that ran
//! for it lives on, and its exit status is true.

#![cfg(target_os = "linux")]

use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use gnomon::capture::FrameSource;
use gnomon::scene::radiance_file;

use crate::common::gpu_faults;
use crate::common::prints::{Photographer, Print, good_poses};
use crate::common::project_file;
use crate::common::signals::{self, Signal};
use crate::common::waiting::wait_for;

/// No job takes as long, whatever happens to it.
const BOUND: Duration = Duration::from_secs(150);
/// Interrupted by itself, as shells have it.
const INTERRUPTED: i32 = 130;

/// A job: its arguments and what it writes.
#[derive(Clone, Copy)]
struct Job {
    arguments: &'static str,
    outputs: &'static [&'static str],
}

const fn job(arguments: &'static str, outputs: &'static [&'static str]) -> Job {
    Job { arguments, outputs }
}

const VIDEO: Job = job(
    "replay short/scene.toml --out out/a.mp4 --sheet out/a.png --poses out/p.csv --stats out/s.json",
    &["a.mp4", "a.png", "p.csv", "s.json"],
);
const RECORD: Job = job(
    "record short/scene.toml --seconds 0.2 --out out/s",
    &["s/video.mkv", "s/times.csv"],
);

const SHORT: [Job; 9] = [
    VIDEO,
    job(
        "replay short/scene.toml --frames 0,1 --layers role,shadow,gain,depth --out out/d",
        &["d/000000.png", "d/000001_role.png", "d/000001_depth.exr"],
    ),
    job(
        "track short/scene.toml --poses out/p.csv --markers out/m.csv --stats out/s.json",
        &["p.csv", "m.csv", "s.json"],
    ),
    job(
        "board --from short/recording --size-mm 45 --out out/b.toml",
        &["b.toml"],
    ),
    job(
        "calibrate chess --chessboard 8x5 --square-mm 25 --out out/c.toml --coverage out/c.png",
        &["c.toml", "c.png"],
    ),
    job("markers --ids 1,2 --size-mm 40 --out out/m.pdf", &["m.pdf"]),
    job(
        "probe probe.hdr --kind panorama --out out/p.hdr --preview out/p.png",
        &["p.hdr", "p.png"],
    ),
    RECORD,
    job("check short/scene.toml", &[]),
];

/// Jobs that any machine is in the midst of for a while.
const LONG: [Job; 5] = [
    job(
        "replay long/scene.toml --out out/a.mp4 --sheet out/a.png --poses out/p.csv",
        &["a.mp4", "a.png", "p.csv"],
    ),
    job("replay long/scene.toml --layers role,gain --out out/d", &[]),
    job(
        "track long/scene.toml --poses out/p.csv --markers out/m.csv",
        &["p.csv", "m.csv"],
    ),
    job(
        "board --from long/recording --size-mm 45 --out out/b.toml",
        &["b.toml"],
    ),
    job("record long/scene.toml --out out/s", &["s/video.mkv"]),
];

/// What all jobs read: the lamp's recording, short and long, pictures of a chessboard, a probe.
fn inputs() -> &'static Path {
    static INPUTS: OnceLock<PathBuf> = OnceLock::new();
    INPUTS.get_or_init(|| {
        // It stays for the other tests of this process, and goes when the next one begins.
        let folders = Path::new(env!("CARGO_TARGET_TMPDIR"));
        for before in fs::read_dir(folders).unwrap() {
            let before = before.unwrap();
            let name = before.file_name().into_string().unwrap();
            let process = name.strip_prefix("faults-");
            if process.is_some_and(|id| !Path::new("/proc").join(id).exists()) {
                fs::remove_dir_all(before.path()).unwrap();
            }
        }
        let folder = folders.join(format!("faults-{}", std::process::id()));
        fs::create_dir(&folder).unwrap();
        for (name, options) in [
            ("short", ["-frames:v", "6"]),
            ("long", ["-frames:v", "2400"]),
        ] {
            let recording = folder.join(name).join("recording");
            fs::create_dir_all(&recording).unwrap();
            let lamp = project_file("recordings/lamp");
            fs::copy(lamp.join("camera.toml"), recording.join("camera.toml")).unwrap();
            let made = Command::new("ffmpeg")
                .args(["-v", "error", "-stream_loop", "19", "-i"])
                .arg(lamp.join("video.mp4"))
                .args(["-c", "copy"])
                .args(options)
                .arg(recording.join("video.mp4"))
                .status();
            assert!(made.unwrap().success());
            let scene = fs::read_to_string(project_file("config/lamp.toml")).unwrap();
            let models = project_file("models").display().to_string();
            let scene = scene
                .replace("recordings/lamp", "recording")
                .replace("models/", &format!("{models}/"));
            fs::write(folder.join(name).join("scene.toml"), scene).unwrap();
        }
        fs::copy(
            project_file("recordings/room/probe.hdr"),
            folder.join("probe.hdr"),
        )
        .unwrap();
        fs::create_dir(folder.join("chess")).unwrap();
        let print = Print::chessboard();
        for (number, pose) in good_poses(print).iter().take(8).enumerate() {
            let camera = Photographer::bent();
            let [width, height] = camera.camera.size_px;
            let grey = camera.photograph(print, pose, 1.0);
            let picture = image::GrayImage::from_raw(width, height, grey).unwrap();
            picture
                .save(folder.join(format!("chess/{number}.png")))
                .unwrap();
        }
        folder
    })
}

/// A folder to run a job in, with links to all that it reads.
struct Place(tempfile::TempDir);

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for input in fs::read_dir(inputs()).unwrap() {
            let input = input.unwrap();
            std::os::unix::fs::symlink(input.path(), folder.path().join(input.file_name()))
                .unwrap();
        }
        for name in ["out", "tmp", "bin"] {
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        Self(folder)
    }

    fn at(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The program through a script that may take `"$@"` elsewhere first.
    fn command(&self, job: Job, script: &str) -> Command {
        let mut command = Command::new("bash");
        let words = std::env::var_os("PATH").unwrap();
        let mut path = vec![self.at("bin")];
        path.extend(std::env::split_paths(&words));
        command
            .args(["-c", script, "bash"])
            .arg(assert_cmd::cargo::cargo_bin("gnomon"))
            .args(job.arguments.split(' '))
            .current_dir(self.0.path())
            .env("TMPDIR", self.at("tmp"))
            .env("PATH", std::env::join_paths(path).unwrap())
            .env("NODEVICE_SELECT", "1")
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        command
    }

    /// A program that stands in for ffmpeg where it encodes (`-y`) or decodes; `$FFMPEG` is the real one.
    fn stand_in(&self, kind: Kind, script: &str) {
        let is_meant = match kind {
            Kind::Encoder => "*' -y '*",
            Kind::Decoder => "*' -nostats '*",
        };
        let real = on_path("ffmpeg");
        let text = format!(
            "#!/bin/bash\nFFMPEG={}\ncase \" $* \" in {is_meant}) ;; *) exec $FFMPEG \"$@\" ;; esac\n\
             echo $$ >>{}\n{script}\n",
            real.display(),
            self.at("ids").display()
        );
        let program = self.at("bin/ffmpeg");
        fs::write(&program, text).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
    }

    /// Stand-ins that have begun and still run.
    fn running_stand_ins(&self) -> Vec<String> {
        let ids = fs::read_to_string(self.at("ids")).unwrap_or_default();
        let runs = |id: &&str| {
            let line = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
            let state = line.rsplit_once(") ").map(|(_, rest)| rest.chars().next());
            !matches!(state.flatten(), None | Some('Z'))
        };
        ids.lines().filter(runs).map(str::to_owned).collect()
    }

    /// Judges what is there, and what was said of it.
    fn judge(&self, job: Job, fault: &str, output: &Output) {
        let said = String::from_utf8_lossy(&output.stderr);
        let of = format!("{} beside {fault}: {said}", job.arguments);
        assert!(!said.contains("panicked"), "{of}");
        assert!(output.status.code().is_some(), "killed: {of}");
        assert_eq!(files(&self.at("tmp")), BTreeSet::new(), "{of}");
        let found = files(&self.at("out"));
        for name in &found {
            let complaint = complaint_of(&self.at("out").join(name));
            assert_eq!(complaint, None, "{name} of {of}");
        }
        if output.status.success() {
            for name in job.outputs {
                assert!(found.contains(*name), "{name} is missing: {of}");
            }
        }
        wait_for("the end of what ran for it", || {
            self.running_stand_ins().is_empty()
        });
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Encoder,
    Decoder,
}

fn on_path(program: &str) -> PathBuf {
    let folders = std::env::var_os("PATH").unwrap();
    let mut places = std::env::split_paths(&folders).map(|folder| folder.join(program));
    places.find(|path| path.is_file()).expect("ffmpeg")
}

fn files(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    for entry in fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        match path.is_dir() {
            true => found.extend(
                files(&path)
                    .into_iter()
                    .map(|inner| format!("{name}/{inner}")),
            ),
            false => _ = found.insert(name),
        }
    }
    found
}

/// What is wrong with a file, by its kind.
fn complaint_of(path: &Path) -> Option<String> {
    let name = path.file_name()?.to_string_lossy();
    if name.starts_with(".gnomon-") {
        return Some("it is unfinished".to_owned());
    }
    let bytes = fs::read(path).unwrap();
    let text = || String::from_utf8(bytes.clone()).map_err(|error| error.to_string());
    let held = match path.extension().unwrap_or_default().to_str().unwrap() {
        "mp4" | "mkv" => played(path),
        "png" => image::open(path)
            .map(drop)
            .map_err(|error| error.to_string()),
        "hdr" | "exr" => radiance_file::read(path, None).map(drop),
        "json" => serde_json::from_slice::<serde_json::Value>(&bytes)
            .map(drop)
            .map_err(|error| error.to_string()),
        "toml" => text().and_then(|text| {
            text.parse::<toml::Table>()
                .map(drop)
                .map_err(|error| error.to_string())
        }),
        "csv" => text().and_then(|text| {
            let columns = |line: &str| line.split(',').count();
            let first = text.lines().next().map_or(0, columns);
            let whole = text.ends_with('\n') && text.lines().all(|line| columns(line) == first);
            whole.then_some(()).ok_or(format!(
                "cut off: {}",
                text.lines().last().unwrap_or_default()
            ))
        }),
        "pdf" => bytes
            .trim_ascii_end()
            .ends_with(b"%%EOF")
            .then_some(())
            .ok_or("no end".to_owned()),
        _ => Ok(()),
    };
    held.err()
}

/// A video plays to its end.
fn played(path: &Path) -> Result<(), String> {
    let mut source =
        FrameSource::open(path.to_str().unwrap()).map_err(|error| error.to_string())?;
    while source
        .next_frame()
        .map_err(|error| error.to_string())?
        .is_some()
    {}
    match source.notices() {
        [] => Ok(()),
        notices => Err(format!("{notices:?}")),
    }
}

/// Waits for the end, which must come.
fn ended(mut child: Child, of: &str) -> Output {
    let began = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if began.elapsed() > BOUND {
            _ = child.kill();
            panic!("{of} does not end");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    child.wait_with_output().unwrap()
}

const AS_IT_IS: &str = "exec \"$@\"";

#[test]
fn closed_and_full_streams_change_no_result() {
    for (fault, script) in [
        ("closed streams", "exec \"$@\" <&- >&- 2>&-"),
        ("full streams", "exec \"$@\" >/dev/full 2>/dev/full"),
    ] {
        for job in SHORT {
            let place = Place::new();
            let output = ended(place.command(job, script).spawn().unwrap(), job.arguments);
            place.judge(job, fault, &output);
            assert!(
                output.status.success(),
                "{} beside {fault}: {output:?}",
                job.arguments
            );
        }
    }
}

/// A limit on the size of files stands for a full disk: writing beyond it fails with an error. Of 100 kB a recording has its scene,
/// and a part of its first frame.
#[test]
fn a_full_disk_leaves_whole_files_or_none() {
    for kilobytes in [0, 2, 40, 100] {
        for job in SHORT.into_iter().filter(|job| !job.outputs.is_empty()) {
            let place = Place::new();
            let script = format!("ulimit -f {kilobytes}; {AS_IT_IS}");
            let output = ended(place.command(job, &script).spawn().unwrap(), job.arguments);
            place.judge(job, &format!("a limit of {kilobytes} kB"), &output);
            let said = String::from_utf8_lossy(&output.stderr);
            if kilobytes == 0 {
                assert!(!output.status.success(), "{}: {said}", job.arguments);
            }
            let is_told = said.contains("too large") || said.contains("No space");
            assert!(
                output.status.success() || is_told,
                "{}: {said}",
                job.arguments
            );
        }
    }
}

#[test]
fn a_signal_at_any_time_leaves_whole_files() {
    let signals = [Signal::INT, Signal::TERM].into_iter().cycle();
    let cases = LONG
        .into_iter()
        .flat_map(|job| [0, 60, 350, 1200].map(|wait_ms| (job, wait_ms)));
    for ((job, wait_ms), signal) in cases.zip(signals) {
        let place = Place::new();
        let child = place.command(job, AS_IT_IS).spawn().unwrap();
        std::thread::sleep(Duration::from_millis(wait_ms));
        signals::send(signal, child.id()).unwrap();
        let output = ended(child, job.arguments);
        if output.status.code().is_none() {
            // It had not begun to listen: nothing is begun either.
            assert_eq!(files(&place.at("out")), BTreeSet::new());
            assert_eq!(files(&place.at("tmp")), BTreeSet::new());
            continue;
        }
        place.judge(job, &format!("{signal:?} after {wait_ms} ms"), &output);
        // A recording that was stopped was done; all else was asked for more.
        let is_done = job.arguments.starts_with("record");
        assert!(
            is_done || !output.status.success(),
            "{} after {wait_ms} ms: {output:?}",
            job.arguments
        );
    }
}

#[test]
fn encoders_that_fail_or_talk_are_told_from_those_that_work() {
    let faults = [
        ("one that cannot", "echo no such codec >&2; exit 3", false),
        (
            "one that dies",
            "head -c 2500000 >/dev/null; kill -9 $$",
            false,
        ),
        ("one that writes nothing", "cat >/dev/null", false),
        (
            "one that fails at the end",
            "$FFMPEG \"$@\"; echo no trailer >&2; exit 1",
            false,
        ),
        (
            "one that talks",
            "for k in {1..20000}; do echo 'a deprecated pixel format' >&2; done; exec $FFMPEG \"$@\"",
            true,
        ),
        (
            "one that dawdles",
            "$FFMPEG \"$@\"; status=$?; sleep 1; exit $status",
            true,
        ),
    ];
    for (fault, script, works) in faults {
        for job in [VIDEO, RECORD] {
            let place = Place::new();
            place.stand_in(Kind::Encoder, script);
            let output = ended(place.command(job, AS_IT_IS).spawn().unwrap(), job.arguments);
            place.judge(job, fault, &output);
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(
                output.status.success(),
                works,
                "{} beside {fault}: {said}",
                job.arguments
            );
            assert!(
                works || said.contains("gnomon: "),
                "{} beside {fault}: {said}",
                job.arguments
            );
        }
    }
}

#[test]
fn decoders_that_die_cost_what_they_have_not_given() {
    for (fault, script) in [
        (
            "one that cannot",
            "echo '[error] no such thing' >&2; exit 3",
        ),
        (
            "one that dies",
            "$FFMPEG \"$@\" | head -c 1000000; kill -9 $$",
        ),
        ("one that says nothing", "exit 0"),
    ] {
        for job in [VIDEO, SHORT[2], SHORT[3]] {
            let place = Place::new();
            place.stand_in(Kind::Decoder, script);
            let output = ended(place.command(job, AS_IT_IS).spawn().unwrap(), job.arguments);
            place.judge(job, fault, &output);
            assert!(
                !output.status.success(),
                "{} beside {fault}: {output:?}",
                job.arguments
            );
        }
    }
}

/// What hangs keeps a job no longer than its user's patience: a second interrupt ends all at once.
#[test]
fn a_second_interrupt_ends_all_at_once() {
    let hangs = "exec sleep 1000";
    for (job, kind) in [
        (VIDEO, Kind::Encoder),
        (RECORD, Kind::Encoder),
        (VIDEO, Kind::Decoder),
        (SHORT[2], Kind::Decoder),
    ] {
        let place = Place::new();
        place.stand_in(kind, hangs);
        interrupt_twice(&place, job);
        assert_eq!(
            files(&place.at("out")),
            BTreeSet::new(),
            "{}",
            job.arguments
        );
    }
}

/// Runs a job beside something that hangs, interrupts it twice, and judges what it leaves.
fn interrupt_twice(place: &Place, job: Job) {
    let child = place.command(job, AS_IT_IS).spawn().unwrap();
    wait_for("the one that hangs", || {
        !place.running_stand_ins().is_empty()
    });
    for _ in 0..2 {
        std::thread::sleep(Duration::from_millis(500));
        signals::send(Signal::INT, child.id()).unwrap();
    }
    let output = ended(child, job.arguments);
    assert_eq!(
        output.status.code(),
        Some(INTERRUPTED),
        "{}: {output:?}",
        job.arguments
    );
    place.judge(job, "two interrupts", &output);
}

/// The one that was to be replaced is there again.
#[test]
fn a_second_interrupt_gives_an_older_session_back() {
    let place = Place::new();
    let older = ended(place.command(RECORD, AS_IT_IS).spawn().unwrap(), "record");
    place.judge(RECORD, "nothing", &older);
    let times = || fs::read_to_string(place.at("out/s/times.csv")).unwrap();
    let (files_before, times_before) = (files(&place.at("out")), times());
    place.stand_in(Kind::Encoder, "exec sleep 1000");
    let again = job(
        "record short/scene.toml --seconds 0.1 --force --out out/s",
        RECORD.outputs,
    );
    interrupt_twice(&place, again);
    assert_eq!(files(&place.at("out")), files_before);
    assert_eq!(times(), times_before);
}

#[test]
fn a_gpu_that_fails_ends_a_job_in_a_message() {
    for fault in [
        "submit 1",
        "submit 4",
        "wait 1",
        "wait 5",
        "memory 2",
        "memory 10",
        "memory 50",
    ] {
        for job in [VIDEO, SHORT[1]] {
            let place = Place::new();
            let mut command = place.command(job, AS_IT_IS);
            let child = gpu_faults::let_fail(&mut command, fault).spawn().unwrap();
            let output = ended(child, job.arguments);
            place.judge(job, fault, &output);
            let said = String::from_utf8_lossy(&output.stderr);
            assert_eq!(
                output.status.code(),
                Some(1),
                "{} beside {fault}: {said}",
                job.arguments
            );
            let is_told = said.contains("the GPU") || said.contains("the adapter");
            assert!(is_told, "{} beside {fault}: {said}", job.arguments);
        }
    }
}

/// A pipe that nobody writes to, named as anything that is read.
#[test]
fn pipes_are_not_waited_for() {
    let place = Place::new();
    let pipe = |name: &str| {
        let made = Command::new("mkfifo").arg(place.at(name)).status();
        assert!(made.unwrap().success());
    };
    for name in ["pipe.mp4", "pipe.png", "pipe.toml", "pipe.obj"] {
        pipe(name);
    }
    let scene = fs::read_to_string(place.at("short/scene.toml")).unwrap();
    let of_pipe = scene.replace("\"recording\"", "\"pipe.mp4\"");
    assert_ne!(of_pipe, scene);
    fs::write(place.at("of_pipe.toml"), of_pipe).unwrap();
    for arguments in [
        "check of_pipe.toml",
        "check pipe.toml",
        "track pipe.mp4 --size-mm 30 --poses out/p.csv",
        "track pipe.png --size-mm 30 --poses out/p.csv",
        "board --from pipe.mp4 --size-mm 30 --out out/b.toml",
        "calibrate pipe.mp4 --chessboard 8x5 --square-mm 25 --out out/c.toml",
        "calibrate pipe.png --chessboard 8x5 --square-mm 25 --out out/c.toml",
        "probe pipe.png --kind panorama --out out/p.hdr",
        "record pipe.mp4 --out out/s",
        "replay of_pipe.toml --poses out/p.csv",
    ] {
        let job = job(arguments, &[]);
        let output = ended(place.command(job, AS_IT_IS).spawn().unwrap(), arguments);
        place.judge(job, "a pipe", &output);
        assert_eq!(files(&place.at("out")), BTreeSet::new(), "{arguments}");
        let is_check = arguments.starts_with("check of");
        assert!(
            is_check || !output.status.success(),
            "{arguments}: {output:?}"
        );
    }
}
