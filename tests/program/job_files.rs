//! What a job reads and writes, as a user gets it: nothing that is read is written over, nothing is replaced that is no
//! older result, no file but those that were named is touched, and none of ours is left behind.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command as Process, Output, Stdio};
use std::time::Duration;

use crate::common::signals;
use crate::common::waiting::wait_for;

const POSES: &str = "frame,time_s,anchor,status,markers,tx_m,ty_m,tz_m,rx,ry,rz,track_ms,render_ms";
fn project_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

fn gnomon(folder: &Path) -> Process {
    let mut command = Process::new(assert_cmd::cargo::cargo_bin("gnomon"));
    command.current_dir(folder).stdin(Stdio::null());
    command
}

fn run(folder: &Path, arguments: &[&str]) -> Output {
    gnomon(folder).args(arguments).output().expect("a run")
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn done(folder: &Path, arguments: &[&str]) -> Output {
    let output = run(folder, arguments);
    assert!(output.status.success(), "{arguments:?}: {}", said(&output));
    output
}

/// A run that must fail, say each of `parts`, and change nothing in its folder.
fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let before = contents(folder);
    let output = run(folder, arguments);
    let said = said(&output);
    assert!(!output.status.success(), "{arguments:?} succeeded: {said}");
    assert!(!said.contains("panicked"), "{arguments:?}: {said}");
    for part in parts {
        assert!(said.contains(part), "{arguments:?} lacks {part:?}: {said}");
    }
    assert!(
        contents(folder) == before,
        "{arguments:?} changed something: {said}"
    );
}

/// What a folder holds: each file's bytes, each link's goal, each folder.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut waiting = vec![folder.to_owned()];
    while let Some(next) = waiting.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            let name = plain(path.strip_prefix(folder).unwrap()).to_owned();
            let kind = fs::symlink_metadata(&path).unwrap().file_type();
            if kind.is_symlink() {
                let goal = fs::read_link(&path).unwrap();
                found.insert(format!("{name} ->"), plain(&goal).as_bytes().to_vec());
            } else if kind.is_dir() {
                found.insert(format!("{name}/"), Vec::new());
                waiting.push(path);
            } else if kind.is_file() {
                found.insert(name, fs::read(path).unwrap());
            } else {
                found.insert(format!("{name} (device)"), Vec::new());
            }
        }
    }
    found
}

fn names(folder: &Path) -> Vec<String> {
    contents(folder).into_keys().collect()
}

/// A replay of one frame, which takes no time.
fn quick<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["replay", "scene.toml", "--frames", "0"], more].concat()
}

/// A scene like `config/lamp.toml`, with its recording and its meshes, in a folder of its own.
fn lamp_in(folder: &Path) -> PathBuf {
    fs::create_dir_all(folder.join("recording")).unwrap();
    fs::create_dir_all(folder.join("models")).unwrap();
    for file in ["video.mp4", "camera.toml"] {
        fs::copy(
            project_file("recordings/lamp").join(file),
            folder.join("recording").join(file),
        )
        .unwrap();
    }
    for mesh in ["house.obj", "tin.obj", "torus.obj"] {
        fs::copy(
            project_file("models").join(mesh),
            folder.join("models").join(mesh),
        )
        .unwrap();
    }
    let text = fs::read_to_string(project_file("config/lamp.toml")).unwrap();
    let scene = folder.join("scene.toml");
    fs::write(&scene, text.replace("recordings/lamp", "recording")).unwrap();
    scene
}

/// Plays the lamp's recording so often that any machine is in the midst of it for a while.
fn long_lamp_in(folder: &Path) -> PathBuf {
    let scene = lamp_in(folder);
    let video = folder.join("recording/video.mp4");
    let short = folder.join("short.mp4");
    fs::rename(&video, &short).unwrap();
    let made = Process::new("ffmpeg")
        .args(["-v", "error", "-stream_loop", "19", "-i"])
        .arg(&short)
        .args(["-c", "copy"])
        .arg(&video)
        .status()
        .unwrap();
    assert!(made.success());
    scene
}

fn spawn(folder: &Path, arguments: &[&str]) -> Child {
    let mut command = gnomon(folder);
    command
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    command.spawn().expect("a start")
}

#[cfg(unix)]
fn interrupt(child: &Child) {
    signals::send(signals::Signal::INT, child.id()).unwrap();
}

#[test]
fn a_mesh_of_somebody_else_s_cannot_say_where_a_recording_writes() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("a/b/c");
    fs::create_dir_all(&folder).unwrap();
    let scene = lamp_in(&folder);
    let profile = home.path().join(".profile");
    fs::write(&profile, "export MINE=1\n").unwrap();
    let own = home.path().join("own.mtl");
    fs::write(&own, "newmtl wood\nKd 0.1 0.2 0.3\n").unwrap();
    let torus = folder.join("models/torus.obj");
    let text = fs::read_to_string(&torus).unwrap();
    let text = format!(
        "mtllib ../../../../.profile\nmtllib {} none.mtl\nusemtl wood\n{text}",
        own.display()
    );
    fs::write(&torus, text).unwrap();
    let before = contents(home.path());
    // As deep as the copy of a mesh lies: from there, the names lead to the same places.
    let out = home.path().join("x/session");
    done(
        home.path(),
        &[
            "record",
            plain(&scene),
            "--out",
            plain(&out),
            "--seconds",
            "0.2",
        ],
    );
    let after = contents(home.path());
    for (name, bytes) in &before {
        assert!(after.get(name) == Some(bytes), "{name} was changed");
    }
    let new: Vec<&String> = after
        .keys()
        .filter(|name| !before.contains_key(*name))
        .collect();
    assert!(new.iter().all(|name| name.starts_with("x/")), "{new:?}");

    // The session has all that it needs.
    let session = home.path().join("session");
    fs::rename(&out, &session).unwrap();
    for file in [&own, &profile] {
        fs::remove_file(file).unwrap();
    }
    fs::remove_dir_all(home.path().join("a")).unwrap();
    done(home.path(), &["check", "session/scene.toml"]);
    let copies = contents(&session);
    let meshes: Vec<&String> = copies
        .keys()
        .filter(|name| name.ends_with(".obj"))
        .collect();
    assert_eq!(meshes.len(), 3, "{meshes:?}");
    let torus = copies
        .values()
        .find(|bytes| bytes.starts_with(b"mtllib"))
        .unwrap();
    let text = String::from_utf8_lossy(torus);
    assert!(
        text.starts_with("mtllib material-1.mtl\nmtllib material-2.mtl\n# not there: mtllib none.mtl\nusemtl wood\n"),
        "{}",
        text.lines().take(4).collect::<Vec<_>>().join("\n")
    );
}

#[test]
fn a_session_has_probe_room_and_dictionaries_with_it() {
    let home = tempfile::tempdir().unwrap();
    let folder = home.path().join("project");
    let scene = lamp_in(&folder);
    fs::copy(
        project_file("recordings/room/probe.hdr"),
        folder.join("p.hdr"),
    )
    .unwrap();
    let own = "%YAML:1.0\n---\nnmarkers: 2\nmarkersize: 3\nmarker_0: \"110100000\"\nmarker_1: \"111001011\"\n";
    fs::write(folder.join("own.yml"), own).unwrap();
    let text = fs::read_to_string(&scene).unwrap();
    let text = format!(
        "{text}\n[tracking]\ndetector = \"aruco\"\n[[marker]]\nname = \"card\"\nfamily = \"own.yml\"  # printed by hand\n\
         id = 1\nsize_m = 0.03\n[probe]\nimage = \"p.hdr\"\nroom = [\"models/house.obj\", 'models/tin.obj']\n\
         [[room]]\nmesh = \"models/house.obj\"\n"
    );
    fs::write(&scene, text).unwrap();
    for scene in [scene, project_file("config/room.toml")] {
        let arguments = ["record", plain(&scene), "--out", "s", "--seconds", "0.1"];
        done(home.path(), &arguments);
        let session = home.path().join("s");
        let before = contents(&session);
        assert!(before.contains_key("probe/1.hdr"), "{:?}", before.keys());
        // Away from all that was copied.
        if scene.starts_with(&folder) {
            fs::remove_dir_all(&folder).unwrap();
            let files = [
                "markers/1.yml",
                "room/1/mesh.obj",
                "room/2/mesh.obj",
                "models/3/mesh.obj",
            ];
            for file in files {
                assert!(before.contains_key(file), "{file}: {:?}", before.keys());
            }
            let scene = fs::read_to_string(session.join("scene.toml")).unwrap();
            assert!(scene.contains("# printed by hand"));
        }
        let scene = session.join("scene.toml");
        let check: &[&str] = &["check", plain(&scene)];
        let replay = ["replay", plain(&scene), "--frames", "0", "--poses", "p.csv"];
        if before.contains_key("markers/1.yml") {
            // All that is wrong is that nobody holds the card into the picture.
            for arguments in [check, &replay] {
                let said = said(&run(home.path(), arguments));
                let is_told = said.contains("gnomon: \"card\" was never found");
                assert!(is_told, "{arguments:?}: {said}");
            }
            fs::remove_file(home.path().join("p.csv")).unwrap();
        } else {
            done(home.path(), check);
            done(home.path(), &replay);
        }
        fs::remove_dir_all(&session).unwrap();
    }
}

#[test]
fn what_a_job_reads_is_never_written() {
    let folder = tempfile::tempdir().unwrap();
    all_that_is_read_in(folder.path());
    for job in jobs_that_write_what_they_read() {
        refused(folder.path(), &job, &["write elsewhere"]);
        if job[0] != "live" {
            let forced = [job.as_slice(), &["--force"]].concat();
            refused(folder.path(), &forced, &["read; write elsewhere"]);
        }
    }
}

/// A scene with a file of each kind that jobs read, some of them by other names too.
fn all_that_is_read_in(folder: &Path) {
    let at = |name: &str| folder.join(name);
    lamp_in(folder);
    fs::write(at("models/torus.mtl"), "newmtl a\nKd 1 1 1\n").unwrap();
    let torus = fs::read_to_string(at("models/torus.obj")).unwrap();
    fs::write(at("models/torus.obj"), format!("mtllib torus.mtl\n{torus}")).unwrap();
    fs::copy(
        project_file("recordings/lamp/camera.toml"),
        at("calibration.toml"),
    )
    .unwrap();
    fs::copy(project_file("recordings/room/probe.hdr"), at("probe.hdr")).unwrap();
    fs::create_dir(at("frames")).unwrap();
    fs::copy(at("models/house.obj"), at("frames/000001.png")).unwrap();
    let scene = fs::read_to_string(at("scene.toml")).unwrap();
    let scene = scene.replace(
        "\"recording\"",
        "\"recording\"\ncalibration = \"calibration.toml\"",
    );
    let scene = format!("{scene}\n[probe]\nimage = \"probe.hdr\"\nroom = \"frames/000001.png\"\n");
    fs::write(at("scene.toml"), scene).unwrap();
    fs::write(at("poses.csv"), format!("{POSES}\n")).unwrap();
    fs::hard_link(at("scene.toml"), at("hard.toml")).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("models/../scene.toml", at("soft.toml")).unwrap();
    fs::create_dir(at("links")).unwrap();
    fs::hard_link(at("scene.toml"), at("links/000003_role.png")).unwrap();
}

fn jobs_that_write_what_they_read() -> Vec<Vec<&'static str>> {
    let lone = ["--calibration", "calibration.toml", "--size-mm", "44"];
    let of_video = ["recording/video.mp4", lone[0], lone[1], lone[2], lone[3]];
    let board = ["board", "--size-mm", "44", "--from"];
    let chess = [
        "calibrate",
        "recording",
        "--chessboard",
        "9x6",
        "--square-mm",
        "25",
        "--out",
    ];
    vec![
        vec!["replay", "scene.toml", "--stats", "scene.toml"],
        vec!["replay", "scene.toml", "--stats", "models/../scene.toml"],
        vec!["replay", "scene.toml", "--stats", "none/../scene.toml"],
        vec!["replay", "scene.toml", "--stats", "hard.toml"],
        vec!["replay", "scene.toml", "--stats", "soft.toml"],
        vec!["replay", "soft.toml", "--sheet", "hard.toml"],
        vec!["replay", "scene.toml", "--poses", "models/house.obj"],
        vec!["replay", "scene.toml", "--poses", "models/torus.mtl"],
        vec!["replay", "scene.toml", "--poses", "calibration.toml"],
        vec!["replay", "scene.toml", "--sheet", "probe.hdr"],
        vec!["replay", "scene.toml", "--out", "recording/new.mp4"],
        vec!["replay", "scene.toml", "--out", "frames"],
        vec!["replay", "scene.toml", "--out", "links"],
        vec![
            "replay",
            "scene.toml",
            "--poses-from",
            "poses.csv",
            "--poses",
            "poses.csv",
        ],
        vec!["track", "scene.toml", "--poses", "scene.toml"],
        vec!["track", "scene.toml", "--markers", "recording/camera.toml"],
        [
            &["track"],
            &of_video[..],
            &["--poses", "recording/video.mp4"],
        ]
        .concat(),
        [&["track"], &of_video[..], &["--poses", "calibration.toml"]].concat(),
        vec![
            "track",
            "recording",
            "--anchors",
            "scene.toml",
            "--stats",
            "scene.toml",
        ],
        [&board[..], &["scene.toml", "--out", "scene.toml"]].concat(),
        [
            &board[..],
            &[
                "recording",
                "--calibration",
                "calibration.toml",
                "--out",
                "calibration.toml",
            ],
        ]
        .concat(),
        [&chess[..], &["recording/camera.toml"]].concat(),
        [&chess[..], &["c.toml", "--coverage", "recording/video.mp4"]].concat(),
        vec!["record", "scene.toml", "--out", "recording/new"],
        vec![
            "probe",
            "probe.hdr",
            "--kind",
            "panorama",
            "--out",
            "probe.hdr",
        ],
        vec!["live", "scene.toml", "--out", "recording"],
    ]
}

#[test]
fn two_outputs_are_never_one() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let scene = ["replay", "scene.toml", "--frames", "0"];
    let track = ["track", "scene.toml"];
    let jobs: Vec<Vec<&str>> = vec![
        [&scene[..], &["--poses", "q", "--stats", "q"]].concat(),
        [&scene[..], &["--poses", "q", "--stats", "models/../q"]].concat(),
        [&scene[..], &["--poses", "new/q", "--stats", "new/../new/q"]].concat(),
        [&scene[..], &["--poses", "q", "--stats", "q/s.json"]].concat(),
        [&scene[..], &["--poses", "-", "--stats", "-"]].concat(),
        [&scene[..], &["--out", "d", "--sheet", "d/000007.png"]].concat(),
        [&scene[..], &["--out", "d", "--stats", "d"]].concat(),
        [&track[..], &["--poses", "q", "--markers", "./q"]].concat(),
        [&track[..], &["--poses", "/dev/stdout", "--markers", "-"]].concat(),
    ];
    for job in jobs {
        let forced = [job.as_slice(), &["--force"]].concat();
        refused(
            folder.path(),
            &job,
            &["one would be written over the other"],
        );
        refused(
            folder.path(),
            &forced,
            &["one would be written over the other"],
        );
    }
}

#[test]
fn an_older_result_is_replaced_and_nothing_else_without_force() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    lamp_in(folder.path());
    let foreign = [
        "Cargo.toml",
        "models/block.obj",
        "config/hand.toml",
        "README.md",
    ];
    let of_kind: [(&str, &str); 3] = [("--poses", "p"), ("--stats", "s"), ("--sheet", "sheet.png")];
    for (option, name) in of_kind {
        done(folder.path(), &quick(&[option, name]));
        done(folder.path(), &quick(&[option, name]));
        for foreign in foreign {
            fs::copy(project_file(foreign), at(name)).unwrap();
            refused(
                folder.path(),
                &quick(&[option, name]),
                &[name, "--force", "write elsewhere"],
            );
        }
        done(folder.path(), &quick(&[option, name, "--force"]));
        done(folder.path(), &quick(&[option, name]));
    }
    // One result is not another.
    refused(folder.path(), &quick(&["--poses", "s"]), &["--force"]);
    refused(folder.path(), &quick(&["--stats", "p"]), &["--force"]);
    // A file that was made for it holds nothing yet.
    fs::write(at("empty"), "").unwrap();
    done(folder.path(), &quick(&["--poses", "empty"]));

    // What others made may be there once alone: a video of one's own, a photograph.
    let [video, photograph] = [
        "recordings/lamp/video.mp4",
        "recordings/bulb/truth/000_with.png",
    ]
    .map(|name| fs::read(project_file(name)).unwrap());
    fs::write(at("sheet.png"), &photograph).unwrap();
    refused(
        folder.path(),
        &quick(&["--sheet", "sheet.png"]),
        &["made by gnomon", "--force"],
    );
    for (name, bytes) in [
        ("a.mp4", &b"a letter"[..]),
        ("a.mp4", &video),
        ("a.mkv", &video),
        ("a.avi", &video),
        ("d/000000.png", b"a letter"),
        ("d/000000.png", &photograph),
    ] {
        fs::create_dir_all(at(name).parent().unwrap()).unwrap();
        fs::write(at(name), bytes).unwrap();
        let out = name.strip_suffix("/000000.png").unwrap_or(name);
        refused(folder.path(), &quick(&["--out", out]), &[name, "--force"]);
        done(folder.path(), &quick(&["--out", out, "--force"]));
        done(folder.path(), &quick(&["--out", out]));
    }
}

#[test]
fn probes_and_sheets_are_known_again_in_each_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let given = project_file("recordings/room/probe.hdr");
    let foreign = |name: &str| match Path::new(name).extension().unwrap().to_str().unwrap() {
        "hdr" => given.clone(),
        "png" => project_file("recordings/bulb/truth/000_with.png"),
        "svg" => project_file("charts/shadows.svg"),
        // (None of the kind is in the project.)
        _ => project_file("LICENSE"),
    };
    let of_probe = ["probe", plain(&given), "--kind", "panorama", "--out"];
    let of_sheet = [
        "markers",
        "--chessboard",
        "5x4",
        "--square-mm",
        "25",
        "--out",
    ];
    let outputs: [(&[&str], &str); 5] = [
        (&of_probe, "p.hdr"),
        (&of_probe, "p.exr"),
        (&of_sheet, "s.png"),
        (&of_sheet, "s.svg"),
        (&of_sheet, "s.pdf"),
    ];
    for (job, name) in outputs {
        let job = [job, &[name]].concat();
        done(folder.path(), &job);
        done(folder.path(), &job);
        fs::copy(foreign(name), at(name)).unwrap();
        refused(folder.path(), &job, &[name, "made by gnomon", "--force"]);
    }
}

#[test]
fn sheets_leave_layouts_that_were_learnt() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let print = [
        "markers",
        "--board",
        "2x2",
        "--size-mm",
        "40",
        "--gap-mm",
        "20",
        "--out",
        "table.pdf",
    ];
    let forced = [&print[..], &["--force"]].concat();
    done(folder.path(), &print);
    done(folder.path(), &print);
    let printed = fs::read_to_string(at("table.toml")).unwrap();
    // As `gnomon board` writes it.
    let learnt = &printed[printed.find("[[board]]").unwrap()..];
    let scene = project_file("config/lamp.toml");
    fs::write(at("table.toml"), learnt).unwrap();
    refused(folder.path(), &print, &["table.toml", "--force"]);
    fs::copy(&scene, at("table.toml")).unwrap();
    refused(folder.path(), &print, &["table.toml", "--force"]);
    done(folder.path(), &forced);
    assert_eq!(fs::read_to_string(at("table.toml")).unwrap(), printed);
    fs::write(at("table.pdf"), "a letter").unwrap();
    refused(folder.path(), &print, &["table.pdf", "--force"]);
    done(folder.path(), &forced);
    // A chessboard has no text beside it.
    fs::copy(&scene, at("chess.toml")).unwrap();
    done(
        folder.path(),
        &[
            "markers",
            "--chessboard",
            "5x4",
            "--square-mm",
            "25",
            "--out",
            "chess.pdf",
        ],
    );
}

#[test]
fn folders_are_no_files_and_that_is_said_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    lamp_in(folder.path());
    fs::create_dir(at("a.mp4")).unwrap();
    fs::create_dir(at("p.csv")).unwrap();
    fs::write(at("file"), format!("{POSES}\n")).unwrap();
    for (out, part) in [
        (["--out", "a.mp4"], "a folder is there"),
        (["--poses", "p.csv"], "a folder is there"),
        (["--out", "file"], "a folder is wanted"),
        (["--poses", "file/p.csv"], "is no folder"),
        (["--out", "-"], "stdout"),
        (["--sheet", "-"], "stdout"),
    ] {
        let job = [&["replay", "scene.toml", "--stats", "s.json"], &out[..]].concat();
        refused(folder.path(), &job, &[part]);
        refused(
            folder.path(),
            &[job.as_slice(), &["--force"]].concat(),
            &[part],
        );
    }
    fs::create_dir_all(at("d/000000.png")).unwrap();
    refused(
        folder.path(),
        &quick(&["--out", "d", "--force"]),
        &["a folder is there"],
    );
    for job in [
        ["record", "scene.toml", "--out", "file"],
        ["live", "scene.toml", "--out", "file"],
    ] {
        refused(folder.path(), &job, &["a folder is wanted"]);
    }
}

#[test]
fn every_job_that_replaces_files_can_be_forced() {
    let folder = tempfile::tempdir().unwrap();
    for job in [
        "replay",
        "record",
        "track",
        "board",
        "calibrate",
        "markers",
        "probe",
        "chart",
    ] {
        let help = done(folder.path(), &[job, "--help"]).stdout;
        assert!(String::from_utf8_lossy(&help).contains("--force"), "{job}");
    }
}

#[cfg(unix)]
#[test]
fn devices_pipes_and_stdout_are_written_through() {
    use std::os::unix::fs::FileTypeExt as _;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    lamp_in(folder.path());
    let text = |output: &Output| String::from_utf8(output.stdout.clone()).unwrap();
    // A device cannot be made by everyone, so the worst that may happen here is the true one: as root it was replaced.
    done(
        folder.path(),
        &quick(&["--poses", "/dev/null", "--stats", "/dev/null"]),
    );
    let null = fs::symlink_metadata("/dev/null").unwrap().file_type();
    assert!(null.is_char_device());

    for name in ["-", "/dev/stdout"] {
        let output = done(folder.path(), &quick(&["--poses", name]));
        assert_eq!(text(&output).lines().next(), Some(POSES), "{name}");
        assert_eq!(text(&output).lines().count(), 2);
    }
    let output = done(folder.path(), &quick(&["--stats", "-"]));
    assert!(serde_json::from_str::<serde_json::Value>(&text(&output)).is_ok());
    let output = gnomon(folder.path())
        .args(quick(&["--poses", "/dev/stdout"]))
        .stdout(fs::File::create(at("redirected")).unwrap())
        .status()
        .unwrap();
    assert!(output.success());
    assert!(
        fs::read_to_string(at("redirected"))
            .unwrap()
            .starts_with(POSES)
    );

    for (name, option) in [("pipe", "--poses"), ("pipe.mkv", "--out")] {
        let made = Process::new("mkfifo").arg(at(name)).status().unwrap();
        assert!(made.success());
        let child = spawn(folder.path(), &quick(&[option, name]));
        let read = fs::read(at(name)).unwrap();
        assert!(child.wait_with_output().unwrap().status.success());
        assert!(
            fs::symlink_metadata(at(name))
                .unwrap()
                .file_type()
                .is_fifo()
        );
        let begin: &[u8] = if name == "pipe" {
            POSES.as_bytes()
        } else {
            b"\x1a\x45\xdf\xa3"
        };
        assert!(read.starts_with(begin), "{name}");
    }
    assert!(
        names(folder.path())
            .iter()
            .all(|name| !name.starts_with('.'))
    );
}

#[cfg(unix)]
#[test]
fn a_link_stays_and_what_it_leads_to_is_replaced() {
    use std::os::unix::fs::symlink;
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    lamp_in(folder.path());
    fs::create_dir(at("real")).unwrap();
    fs::write(at("real/p.csv"), format!("{POSES}\n")).unwrap();
    symlink("real/p.csv", at("p.csv")).unwrap();
    symlink("real/none.mkv", at("a.mkv")).unwrap();
    symlink("models/block.obj", at("s.json")).unwrap();
    fs::copy(project_file("models/block.obj"), at("models/block.obj")).unwrap();
    done(
        folder.path(),
        &quick(&["--poses", "p.csv", "--out", "a.mkv"]),
    );
    refused(
        folder.path(),
        &quick(&["--stats", "s.json"]),
        &["s.json", "--force"],
    );
    for link in ["p.csv", "a.mkv", "s.json"] {
        assert!(at(link).is_symlink(), "{link}");
    }
    assert_eq!(
        fs::read_to_string(at("real/p.csv"))
            .unwrap()
            .lines()
            .count(),
        2
    );
    assert!(
        fs::read(at("real/none.mkv"))
            .unwrap()
            .starts_with(b"\x1a\x45\xdf\xa3")
    );
}

#[test]
fn no_other_file_is_touched() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    lamp_in(folder.path());
    let mine = [
        "o.partial.mp4",
        "p.partial.csv",
        "o.partial",
        "o.mp4.partial",
    ];
    for name in mine {
        fs::write(at(name), "mine").unwrap();
    }
    #[cfg(unix)]
    {
        fs::remove_file(at("p.partial.csv")).unwrap();
        std::os::unix::fs::symlink("precious", at("p.partial.csv")).unwrap();
        fs::write(at("precious"), "mine").unwrap();
    }
    let before = contents(folder.path());
    let job = [
        "replay",
        "scene.toml",
        "--frames",
        "0",
        "--out",
        "o.mp4",
        "--poses",
        "p.csv",
    ];
    done(folder.path(), &job);
    let mut after = contents(folder.path());
    assert!(after.remove("o.mp4").is_some() && after.remove("p.csv").is_some());
    assert!(after == before);
    // A run that fails leaves as little.
    refused(
        folder.path(),
        &[&job[..], &["--adapter", "none such"]].concat(),
        &["none such"],
    );
}

#[test]
fn two_runs_at_once_give_one_whole_video() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let job = [
        "replay",
        "scene.toml",
        "--frames",
        "0,1,2,3,4,5",
        "--out",
        "a.mkv",
    ];
    let runs = [spawn(folder.path(), &job), spawn(folder.path(), &job)];
    for run in runs {
        let output = run.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", said(&output));
    }
    let counted = Process::new("ffprobe")
        .args([
            "-v",
            "error",
            "-count_frames",
            "-show_entries",
            "stream=nb_read_frames",
            "-of",
            "csv=p=0",
        ])
        .arg(folder.path().join("a.mkv"))
        .output()
        .unwrap();
    assert_eq!(String::from_utf8_lossy(&counted.stdout).trim(), "6");
    assert!(
        names(folder.path())
            .iter()
            .all(|name| !name.starts_with('.'))
    );
}

#[test]
fn a_folder_of_frames_is_one_run_s() {
    let folder = tempfile::tempdir().unwrap();
    long_lamp_in(folder.path());
    let mut first = spawn(folder.path(), &["replay", "scene.toml", "--out", "d"]);
    wait_for("a frame", || folder.path().join("d/000001.png").exists());
    let second = run(
        folder.path(),
        &["replay", "scene.toml", "--frames", "0", "--out", "d"],
    );
    assert!(!second.status.success());
    assert!(said(&second).contains("another run"), "{}", said(&second));
    first.kill().unwrap();
    first.wait().unwrap();
    done(
        folder.path(),
        &["replay", "scene.toml", "--frames", "0", "--out", "d"],
    );
}

#[test]
fn a_place_that_vanishes_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    long_lamp_in(folder.path());
    let at = |name: &str| folder.path().join(name);
    let has_begun = |name: &str| {
        let entries = fs::read_dir(at(name)).into_iter().flatten().flatten();
        entries.count() > 0
    };
    for (out, gone) in [("d", "d"), ("v/a.mp4", "v"), ("s", "s")] {
        let job = match out {
            "s" => ["record", "scene.toml", "--out", out],
            _ => ["replay", "scene.toml", "--out", out],
        };
        let child = spawn(folder.path(), &job);
        wait_for("the first file", || match gone {
            "d" => at("d/000002.png").exists(),
            "s" => at("s/video.mkv").exists(),
            _ => has_begun(gone),
        });
        fs::rename(at(gone), at("elsewhere")).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = said(&output);
        assert!(!output.status.success(), "{out}: {said}");
        assert!(said.contains("moved or removed"), "{out}: {said}");
        assert!(!said.contains("frames in"), "{out}: {said}");
        assert!(!at(gone).exists(), "{out}");
        fs::remove_dir_all(at("elsewhere")).unwrap();
    }
}

#[test]
fn an_older_session_is_replaced_when_that_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let job = ["record", "scene.toml", "--out", "s", "--seconds", "0.1"];
    let forced = [&job[..], &["--force"]].concat();
    done(folder.path(), &job);
    refused(folder.path(), &job, &["holds something already"]);
    done(folder.path(), &forced);
    done(folder.path(), &["check", "s/scene.toml"]);
    fs::write(folder.path().join("s/notes.txt"), "mine").unwrap();
    refused(
        folder.path(),
        &forced,
        &["holds something already", "notes.txt"],
    );
    assert!(
        names(folder.path())
            .iter()
            .all(|name| !name.starts_with('.'))
    );
}

/// Whoever writes to a pipe that nobody reads waits, with all that it has to write in a file for the time being.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_nothing_of_a_job_that_waits() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let temporary = folder.path().join("tmp");
    fs::create_dir(&temporary).unwrap();
    for (job, interrupts) in [
        (
            vec![
                "markers",
                "--ids",
                "1,2",
                "--size-mm",
                "40",
                "--out",
                "pipe.pdf",
            ],
            1,
        ),
        // What has frames to keep ends by itself; one that cannot is told twice.
        (
            vec![
                "replay",
                "scene.toml",
                "--frames",
                "0",
                "--poses",
                "pipe.csv",
            ],
            2,
        ),
    ] {
        let pipe = folder.path().join(job[job.len() - 1]);
        assert!(
            Process::new("mkfifo")
                .arg(&pipe)
                .status()
                .unwrap()
                .success()
        );
        let child = gnomon(folder.path())
            .args(&job)
            .env("TMPDIR", &temporary)
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        wait_for("an unfinished file", || !names(&temporary).is_empty());
        for _ in 0..interrupts {
            std::thread::sleep(Duration::from_millis(300));
            interrupt(&child);
        }
        let output = child.wait_with_output().unwrap();
        assert_eq!(output.status.code(), Some(130), "{}", said(&output));
        assert_eq!(names(&temporary), [""; 0], "{job:?}");
    }
}

#[test]
fn stdout_lies_in_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let inside = folder.path().join("recording");
    let output = done(&inside, &["track", ".", "--size-mm", "44", "--poses", "-"]);
    assert!(output.stdout.starts_with(b"frame,time_s,anchor"));
}

#[test]
fn a_name_that_ends_as_a_folder_s_is_one() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let tracked = ["track", "recording", "--size-mm", "44", "--poses", "new/"];
    refused(folder.path(), &tracked, &["--poses", "new/", "a folder's"]);
    done(folder.path(), &quick(&["--out", "shots.mp4/"]));
    assert!(folder.path().join("shots.mp4/000000.png").is_file());
    refused(
        folder.path(),
        &quick(&["--sheet", "sheet.jpg"]),
        &["sheet.jpg", "the sheet is a PNG"],
    );
}

#[test]
fn options_of_another_kind_of_sheet_or_job_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let charuco = "markers --charuco 5x5 --square-mm 20 --marker-mm 12 --out a.svg";
    let board = "markers --board 2x2 --size-mm 40 --gap-mm 20 --out a.svg";
    let ids = "markers --ids 1,2 --size-mm 36 --out a.svg";
    let chessboard = "markers --chessboard 6x5 --square-mm 20 --out a.svg";
    let track = "track recording --anchors scene.toml --poses p.csv";
    for (command, option) in [
        (charuco, "--family tag36h11"),
        (charuco, "--size-mm 12"),
        (charuco, "--inverted"),
        (charuco, "--first-id 30"),
        (charuco, "--name foo"),
        (board, "--dictionary DICT_4X4_50"),
        (board, "--marker-mm 12"),
        (ids, "--gap-mm 7"),
        (ids, "--first-id 3"),
        (chessboard, "--marker-mm 5"),
        (chessboard, "--dictionary DICT_4X4_50"),
        (track, "--family DICT_4X4_50"),
        (track, "--border-cells 2"),
        (track, "--inverted"),
    ] {
        let line = format!("{command} {option}");
        let arguments: Vec<&str> = line.split(' ').collect();
        let (named, _) = option.split_once(' ').unwrap_or((option, ""));
        refused(folder.path(), &arguments, &["cannot be used with", named]);
    }
    for good in [charuco, board, ids, chessboard] {
        let arguments: Vec<&str> = good.split(' ').collect();
        done(folder.path(), &arguments);
    }
}

#[test]
fn poses_that_cover_no_frame_played_are_an_error_and_the_video_alone_needs_none() {
    let folder = tempfile::tempdir().unwrap();
    let scene = lamp_in(folder.path());
    let header = "frame,anchor,tx_m,ty_m,tz_m,rx,ry,rz\n";
    for (rows, says) in [
        ("", "it has no row"),
        (
            "1000,table,0,0,1,0,0,0\n1009,table,0,0,1,0,0,0\n",
            "it has frames 1000 to 1009",
        ),
    ] {
        fs::write(folder.path().join("given.csv"), format!("{header}{rows}")).unwrap();
        let output = run(
            folder.path(),
            &quick(&["--poses-from", "given.csv", "--out", "a.mp4"]),
        );
        let said = said(&output);
        assert!(!output.status.success(), "{said}");
        assert!(
            said.contains("has no pose of \"table\"") && said.contains(says),
            "{said}"
        );
    }
    let text = fs::read_to_string(&scene).unwrap();
    fs::write(&scene, text.replace("tag36h11", "tag25h9")).unwrap();
    let output = run(folder.path(), &quick(&["--out", "b.mp4"]));
    assert!(said(&output).contains("never found") && !output.status.success());
    done(folder.path(), &quick(&["--bare", "--out", "c.mp4"]));
}

#[cfg(target_os = "linux")]
#[test]
fn a_layout_that_a_full_stdout_does_not_take_was_not_given() {
    let folder = tempfile::tempdir().unwrap();
    lamp_in(folder.path());
    let full = fs::OpenOptions::new().write(true).open("/dev/full");
    let mut command = gnomon(folder.path());
    command.args(["board", "--from", "recording", "--size-mm", "44"]);
    let output = command.stdout(full.unwrap()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        !output.status.success() && said.contains("No space left"),
        "{said}"
    );
}
