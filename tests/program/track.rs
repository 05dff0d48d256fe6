//! `gnomon track` and mirrored recordings: the same poses as replay's, lone markers where the board puts them, and
//! cameras that mirror.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use glam::{DAffine3, DQuat, DVec3};
use gnomon::app::files::picture_files::write_rgb_png;
use gnomon::capture::FrameSource;
use gnomon::scene::{Family, Scene};
use gnomon::tracking::printed_cells;

fn project_file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// Runs gnomon where no Vulkan driver is found.
fn gnomon(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("gnomon")
        .expect("the program")
        .current_dir(folder)
        .args(arguments)
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .output()
        .expect("a run")
}

fn done(folder: &Path, arguments: &[&str]) -> String {
    let output = gnomon(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{arguments:?}: {said}");
    said
}

fn refused(folder: &Path, arguments: &[&str], parts: &[&str]) {
    let output = gnomon(folder, arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{arguments:?} succeeded: {said}");
    for part in parts {
        assert!(said.contains(part), "{arguments:?} lacks {part:?}: {said}");
    }
    let left: Vec<_> = std::fs::read_dir(folder).expect("a folder").collect();
    assert!(left.is_empty(), "{arguments:?} left {left:?}");
}

/// The rows of a CSV file without its header, split.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(path).expect("a file");
    let fields = |line: &str| line.split(',').map(str::to_owned).collect();
    text.lines().skip(1).map(fields).collect()
}

/// All but the times that the work took.
fn without_costs(rows: Vec<Vec<String>>) -> Vec<Vec<String>> {
    rows.into_iter().map(|row| row[..11].to_vec()).collect()
}

fn pose_of(row: &[String]) -> Option<DAffine3> {
    let numbers: Vec<f64> = row[5..11]
        .iter()
        .map_while(|field| field.parse().ok())
        .collect();
    let [tx, ty, tz, rx, ry, rz] = numbers[..] else {
        return None;
    };
    let rotation = DQuat::from_scaled_axis(DVec3::new(rx, ry, rz));
    Some(DAffine3::from_rotation_translation(
        rotation,
        DVec3::new(tx, ty, tz),
    ))
}

#[test]
fn tracking_alone_gives_the_poses_of_a_replay_and_needs_no_gpu() {
    let folder = tempfile::tempdir().unwrap();
    let scene = project_file("config/hand.toml");
    let lamp = [
        "track",
        plain(&scene),
        "--poses",
        "track.csv",
        "--stats",
        "stats.json",
    ];
    done(folder.path(), &lamp);
    done(
        folder.path(),
        &["replay", plain(&scene), "--poses", "replay.csv"],
    );
    let poses = |name: &str| without_costs(rows(&folder.path().join(name)));
    assert_eq!(poses("track.csv"), poses("replay.csv"));
    assert_eq!(poses("track.csv").len(), 240);
    let stats = std::fs::read(folder.path().join("stats.json")).unwrap();
    let stats: serde_json::Value = serde_json::from_slice(&stats).unwrap();
    assert_eq!(
        (&stats["frames"], &stats["drawn"]),
        (&120.into(), &0.into())
    );
    assert_eq!(stats["technique"], serde_json::Value::Null);
    assert!(stats["stages"]["track"]["median_ms"].as_f64().unwrap() > 0.0);

    // The same recording with the scene's anchors alone.
    let recording = project_file("recordings/hand");
    let anchors = ["--anchors", plain(&scene), "--poses", "anchors.csv"];
    done(
        folder.path(),
        &[&["track", plain(&recording)], &anchors[..]].concat(),
    );
    assert_eq!(poses("anchors.csv"), poses("track.csv"));
}

#[test]
fn markers_that_no_scene_names_stand_where_the_board_puts_them() {
    let folder = tempfile::tempdir().unwrap();
    let scene_file = project_file("config/lamp.toml");
    let recording = project_file("recordings/lamp");
    done(
        folder.path(),
        &["track", plain(&scene_file), "--poses", "board.csv"],
    );
    let lone = [
        "--size-mm",
        "45",
        "--poses",
        "lone.csv",
        "--markers",
        "markers.csv",
    ];
    let said = done(
        folder.path(),
        &[&["track", plain(&recording)], &lone[..]].concat(),
    );
    assert!(said.contains("5 markers found"), "{said}");

    let board = Scene::load(&scene_file).unwrap().anchors.remove(0);
    let camera_from_board: BTreeMap<String, DAffine3> = rows(&folder.path().join("board.csv"))
        .iter()
        .filter_map(|row| Some((row[0].clone(), pose_of(row)?)))
        .collect();
    let (mut off_deg, mut nearness) = (Vec::new(), Vec::new());
    let mut names = BTreeSet::new();
    for row in rows(&folder.path().join("lone.csv")) {
        names.insert(row[2].clone());
        let Some(pose) = pose_of(&row) else { continue };
        let marker = board
            .markers
            .iter()
            .find(|marker| marker.id.to_string() == row[2]);
        let center_m = marker.expect("a marker of the board").center_m();
        let expected_m = camera_from_board[&row[0]].transform_point3(center_m);
        off_deg.push(expected_m.angle_between(pose.translation).to_degrees());
        nearness.push(pose.translation.length() / expected_m.length());
    }
    // Marker 5 lies under the tin.
    assert_eq!(
        names.iter().map(String::as_str).collect::<Vec<_>>(),
        ["0", "1", "2", "3", "4"]
    );
    let quantile = |values: &mut Vec<f64>, part: f64| {
        values.sort_by(f64::total_cmp);
        values[(part * (values.len() - 1) as f64) as usize]
    };
    let far_off_deg = quantile(&mut off_deg, 0.95);
    let [low, middle, high] = [0.05, 0.5, 0.95].map(|part| quantile(&mut nearness, part));
    eprintln!(
        "{} poses: p95 {far_off_deg:.3}° off, distances {low:.4} {middle:.4} {high:.4} of the board's",
        off_deg.len()
    );
    // A pixel is 0.093°. The path tracer's texture filter made each printed square 2 % smaller than its 45 mm; a tenth
    // of a pixel of a square's 40 is 0.25 %.
    assert!(far_off_deg < 0.01, "{far_off_deg}°");
    assert!((1.0..1.03).contains(&middle), "{middle}");
    assert!(high - low < 0.01, "{low} to {high}");

    let seen = rows(&folder.path().join("markers.csv"));
    assert!(seen.len() > 450, "{} detections", seen.len());
    let seen_by = |who: &str| seen.iter().filter(|row| row[13] == who).count();
    assert!(seen_by("both") > 400 && seen_by("detector") + seen_by("tracking") < 100);
    for row in &seen {
        assert_eq!((row.len(), &*row[10], &*row[11]), (15, "tag36h11", "1"));
        assert!(
            ["detector", "tracking", "both"].contains(&&*row[13]),
            "{row:?}"
        );
        assert!(
            row[2..10]
                .iter()
                .all(|pixel| (0.0..640.0).contains(&pixel.parse::<f64>().unwrap()))
        );
    }
}

#[test]
fn mistakes_are_told_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, recording) = (
        project_file("config/lamp.toml"),
        project_file("recordings/lamp"),
    );
    let (scene, recording) = (plain(&scene), plain(&recording));
    let refused = |arguments: &[&str], parts: &[&str]| refused(folder.path(), arguments, parts);
    refused(&["track", scene], &["nothing to do", "--poses"]);
    refused(
        &["track", recording, "--poses", "p.csv"],
        &["what is tracked", "--anchors", "--size-mm"],
    );
    refused(
        &["track", scene, "--size-mm", "45", "--poses", "p.csv"],
        &["is a scene"],
    );
    refused(
        &["track", scene, "--decimation", "1", "--poses", "p.csv"],
        &["is a scene", "--decimation"],
    );
    refused(
        &["track", scene, "--family", "tag16h5", "--poses", "p.csv"],
        &["--size-mm"],
    );
    refused(
        &[
            "track",
            recording,
            "--anchors",
            scene,
            "--decimation",
            "1",
            "--poses",
            "p.csv",
        ],
        &["does not go with it"],
    );
    refused(
        &[
            "track",
            "no/such/place",
            "--size-mm",
            "45",
            "--poses",
            "p.csv",
        ],
        &["no/such/place"],
    );
    let inside = project_file("recordings/lamp/poses.csv");
    refused(
        &[
            "track",
            recording,
            "--size-mm",
            "45",
            "--poses",
            plain(&inside),
        ],
        &["write elsewhere"],
    );
}

#[test]
fn impossible_values_are_told_with_what_is_allowed() {
    let folder = tempfile::tempdir().unwrap();
    let recording = project_file("recordings/lamp");
    let recording = plain(&recording);
    let refused = |arguments: &[&str], parts: &[&str]| refused(folder.path(), arguments, parts);
    refused(
        &["track", recording, "--size-mm", "0", "--poses", "p.csv"],
        &["--size-mm 0", "allowed: 0.1"],
    );
    refused(
        &[
            "track",
            recording,
            "--size-mm",
            "4",
            "--family",
            "tag36h12",
            "--poses",
            "p",
        ],
        &["allowed: tag16h5"],
    );
    refused(
        &[
            "track",
            recording,
            "--size-mm",
            "4",
            "--border-cells",
            "3",
            "--poses",
            "p",
        ],
        &["--border-cells", "1 to 2"],
    );
    refused(
        &[
            "track",
            recording,
            "--size-mm",
            "4",
            "--decimation",
            "0",
            "--poses",
            "p",
        ],
        &["--decimation", "1 to 8"],
    );
}

#[test]
fn what_is_seen_in_place_of_an_anchor_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let recording = project_file("recordings/lamp");
    let scene = |name: &str, board: &str| {
        let path = folder.path().join(name);
        let text = format!("[camera]\nsource = \"{}\"\n{board}", plain(&recording));
        std::fs::write(&path, text).unwrap();
        plain(&path).to_owned()
    };
    let others = scene(
        "others.toml",
        "[[board]]\nname = \"table\"\nmarkers = [ { id = 10, size_m = 0.045, center_m = [0, 0] }, \
         { id = 11, size_m = 0.045, center_m = [0.1, 0] } ]\n",
    );
    let dictionary = scene(
        "dictionary.toml",
        "[[marker]]\nname = \"card\"\nfamily = \"DICT_4X4_50\"\nid = 7\nsize_m = 0.04\n",
    );
    for (scene, wants) in [
        (
            &others,
            "\"table\" was never found: tag36h11 0 to 4 are seen; the scene wants tag36h11 10, 11",
        ),
        (
            &dictionary,
            "\"card\" was never found: tag36h11 0 to 4 are seen; the scene wants DICT_4X4_50 7",
        ),
    ] {
        for command in ["track", "replay"] {
            let output = gnomon(
                folder.path(),
                &[command, scene, "--poses", "poses.csv", "--force"],
            );
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            assert!(!output.status.success(), "{said}");
            assert!(said.contains(wants), "{said}");
        }
        // Before it is played it is told as well, and is as much of a failure.
        let output = gnomon(folder.path(), &["check", scene]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && said.contains(wants), "{said}");
    }
}

/// Inputs of others that broke the program, from `../shared/cases`.
#[cfg(has_shared)]
mod cases {
    use super::*;

    fn case(name: &str) -> PathBuf {
        project_file("../shared/cases/tracking").join(name)
    }

    fn every_marker(source: &Path, calibration: &str, family: &str) -> Vec<Vec<String>> {
        let folder = tempfile::tempdir().unwrap();
        let calibration = case(calibration);
        let arguments = [
            "track",
            plain(source),
            "--calibration",
            plain(&calibration),
            "--size-mm",
            "40",
            "--family",
            family,
            "--poses",
            "poses.csv",
        ];
        // A part of a video ends early, which is told with another status; the frames that there are were tracked.
        let output = gnomon(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(
            said.contains("0 markers found") || said.contains("damaged"),
            "{said}"
        );
        rows(&folder.path().join("poses.csv"))
    }

    #[test]
    fn a_candidate_that_makes_opencv_throw_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::copy(case("contour_crash.png"), folder.path().join("0.png")).unwrap();
        let rows = every_marker(folder.path(), "contour_crash.toml", "DICT_4X4_50");
        assert!(rows.is_empty(), "{rows:?}");
    }

    #[test]
    fn nothing_is_tracked_in_a_room_without_markers() {
        for family in [
            "DICT_4X4_50",
            "DICT_4X4_1000",
            "DICT_5X5_1000",
            "tag16h5",
            "tag36h11",
        ] {
            let rows = every_marker(&case("false_chase.mkv"), "false_chase.toml", family);
            assert!(rows.is_empty(), "{family}: {} rows", rows.len());
        }
    }

    #[test]
    fn opencv_s_drawing_of_a_tag_stands_as_opencv_draws_it() {
        let folder = tempfile::tempdir().unwrap();
        let of = |scene: &str| {
            let scene = case("opencv_apriltag").join(scene);
            let output = gnomon(
                folder.path(),
                &["track", plain(&scene), "--poses", "poses.csv", "--force"],
            );
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            (rows(&folder.path().join("poses.csv")), said)
        };
        for scene in ["pics.toml", "turned.toml"] {
            let (found, said) = of(scene);
            // Turned by the scene as well, the board's markers are turned, and that is told.
            assert_eq!(
                said.contains("turned by 180°"),
                scene == "turned.toml",
                "{said}"
            );
            assert!(!found.is_empty());
            for row in &found {
                assert_eq!(row[3], "tracked", "{scene}: {row:?}");
                let at_m = pose_of(row).expect("a pose").translation;
                let off_m = at_m.distance(DVec3::new(0.04, 0.0, 0.5));
                assert!(off_m < 0.002, "{scene}: {at_m}");
            }
        }
        // With a second marker 0 in view no pose is shown that the rest speaks against.
        for row in of("dup_board.toml").0 {
            if let Some(pose) = pose_of(&row) {
                let upright = pose.matrix3.x_axis.x;
                assert!(row[3] != "tracked" || upright > 0.9, "{row:?}");
            }
        }
    }
}

/// A mosaic that has a code of a weak family, read from both sides, and is no marker: tiles of many greys, light ones where
/// white cells would be. Pictures of it from several places, in a folder.
fn pictures_of_a_mosaic(folder: &Path) -> PathBuf {
    const SIZE_PX: [u32; 2] = [320, 240];
    let family = Family::from_name("DICT_4X4_50").expect("a family");
    let cells = printed_cells(family, 17).expect("a marker");
    let side = cells.len().isqrt() as f64;
    let pictures = folder.join("mosaic");
    std::fs::create_dir_all(&pictures).expect("a folder");
    for number in 0..8 {
        // It shrinks to one side, as from aslant.
        let slant = 0.05 + 0.03 * f64::from(number % 4);
        let shift_px = 9.0 * f64::from(number);
        let level = |x: f64, y: f64| {
            let depth = 1.0 + slant * (x - 100.0) / 100.0;
            let place = [x - 60.0 - shift_px, (y - 120.0) * depth + 50.0];
            let place = place.map(|px| px / 100.0 * side);
            if place.iter().any(|at| !(0.0..side).contains(at)) {
                return 235;
            }
            let [column, row] = place.map(|at| at as usize);
            let tile = row * side as usize + column;
            let grey = (tile * 37 + column * 11) % 120;
            if cells[tile] {
                255 - grey as u8
            } else {
                grey as u8
            }
        };
        let mut rgba = Vec::new();
        for (y, x) in (0..SIZE_PX[1]).flat_map(|y| (0..SIZE_PX[0]).map(move |x| (y, x))) {
            let level = level(f64::from(x), f64::from(y));
            rgba.extend([level, level, level, 255]);
        }
        let file = pictures.join(format!("{number}.png"));
        write_rgb_png(&file, SIZE_PX, &rgba).expect("a written picture");
    }
    pictures
}

#[test]
fn what_only_has_a_weak_code_tells_nothing_of_the_camera() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = pictures_of_a_mosaic(folder.path());
    let mut arguments = vec!["track", plain(&pictures)];
    arguments.extend(["--size-mm", "40", "--family", "DICT_4X4_50"]);
    arguments.extend(["--poses", "poses.csv", "--markers", "markers.csv"]);
    let said = done(folder.path(), &arguments);
    assert!(said.contains("0 markers found"), "{said}");
    assert!(rows(&folder.path().join("poses.csv")).is_empty(), "{said}");
    // The detector does read the code.
    let read = rows(&folder.path().join("markers.csv"));
    assert!(read.len() >= 6, "{read:?}");
    assert!(said.contains("guessed"), "{said}");
    assert!(!said.contains("turned left for right"), "{said}");
}

/// What a recording's stamps and its decoder say: a stamp that repeats is a word, a picture that was guessed is damage.
#[test]
fn repeated_times_are_told_and_guessed_pictures_are_damage() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = project_file("recordings/lamp");
    let made = |arguments: &str| {
        let status = std::process::Command::new("ffmpeg")
            .current_dir(folder.path())
            .args(["-v", "error", "-nostdin", "-i"])
            .arg(lamp.join("video.mp4"))
            .args(arguments.split(' '))
            .status();
        assert!(status.expect("ffmpeg").success(), "{arguments}");
    };
    let repeated = "setts=ts=if(eq(N\\,3)\\,PREV_OUTPTS\\,TS)";
    made(&format!(
        "-frames:v 6 -c:v mjpeg -q:v 2 -bsf:v {repeated} repeated.mkv"
    ));
    made("-frames:v 6 -c:v libx264 -g 1 -bf 0 guessed.mp4");
    let guessed = folder.path().join("guessed.mp4");
    let mut bytes = std::fs::read(&guessed).expect("a video");
    let begin = bytes.len() * 3 / 8;
    let damaged = bytes.iter_mut().skip(begin).take(1500);
    damaged
        .zip(0_u32..)
        .for_each(|(byte, k)| *byte = ((k * k * 7 + k * 31) % 251) as u8);
    std::fs::write(&guessed, bytes).expect("a damaged video");
    let calibration = lamp.join("camera.toml");
    let track = |name: &str| {
        let poses = format!("{name}.csv");
        let output = gnomon(
            folder.path(),
            &[
                "track",
                name,
                "--size-mm",
                "44",
                "--calibration",
                plain(&calibration),
                "--poses",
                &poses,
            ],
        );
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let times: BTreeMap<String, String> = (rows(&folder.path().join(&poses)).into_iter())
            .map(|row| (row[0].clone(), row[1].clone()))
            .collect();
        (output.status.success(), said, times)
    };
    let (is_done, said, times) = track("repeated.mkv");
    assert!(
        is_done && said.contains("1 frames had no time of their own"),
        "{said}"
    );
    let time_secs = |frame: &str| times[frame].parse::<f64>().expect("a time");
    assert!(
        time_secs("3") > time_secs("2") && time_secs("3") < time_secs("4"),
        "{times:?}"
    );
    assert!((time_secs("5") - 5.0 / 30.0).abs() < 1e-3, "{times:?}");
    let (is_done, said, times) = track("guessed.mp4");
    assert!(!is_done && said.contains("damaged"), "{said}");
    assert_eq!(times.len(), 6, "{said}");
}

/// Frames of the lamp as pictures, as they are and as a camera that mirrors gives them.
fn picture_folders(folder: &Path) -> [PathBuf; 2] {
    let folders = ["as-is", "mirrored"].map(|name| folder.join(name));
    let mut source =
        FrameSource::open(plain(&project_file("recordings/lamp"))).expect("the shipped recording");
    for _ in 0..6 {
        let mut frame = source.next_frame().expect("a frame").expect("a frame");
        let name = format!("{:06}.png", frame.index);
        write_rgb_png(&folders[0].join(&name), frame.size_px, &frame.rgba)
            .expect("a written picture");
        let width = frame.size_px[0] as usize;
        let before = frame.rgba.clone();
        frame.mirror();
        for (place, pixel) in frame.rgba.chunks_exact(4).enumerate() {
            let (row, column) = (place / width, place % width);
            let from = 4 * (row * width + width - 1 - column);
            assert_eq!(pixel, &before[from..from + 4]);
        }
        write_rgb_png(&folders[1].join(&name), frame.size_px, &frame.rgba)
            .expect("a written picture");
    }
    folders
}

#[test]
fn a_mirrored_recording_is_told_and_turned_back() {
    let folder = tempfile::tempdir().unwrap();
    let [as_is, mirrored] = picture_folders(folder.path());
    let calibration = project_file("recordings/lamp/camera.toml");
    let scene = |name: &str, source: &Path, mirror: &str| {
        let text = format!(
            "[camera]\nsource = \"{}\"\ncalibration = \"{}\"\n{mirror}\n[[board]]\nname = \"table\"\nmarkers = [\n\
             {{ id = 0, size_m = 0.045, center_m = [-0.175, 0.115] }},\n\
             {{ id = 4, size_m = 0.045, center_m = [0, -0.115] }} ]\n",
            source.display(),
            calibration.display()
        );
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        plain(&path).to_owned()
    };
    let plain_scene = scene("plain.toml", &as_is, "");
    let unaware = scene("unaware.toml", &mirrored, "");
    let aware = scene("aware.toml", &mirrored, "mirror = true");
    let wrongly = scene("wrongly.toml", &as_is, "mirror = true");
    let poses = |scene: &str, command: &str| {
        let said = done(folder.path(), &[command, scene, "--poses", "poses.csv"]);
        (without_costs(rows(&folder.path().join("poses.csv"))), said)
    };
    let hint = "markers are seen only when the pictures are turned left for right: ";
    let (expected, said) = poses(&plain_scene, "track");
    assert!(
        expected.iter().all(|row| row[3] == "tracked") && !said.contains(hint),
        "{said}"
    );
    for command in ["track", "replay"] {
        let (turned, said) = poses(&aware, command);
        assert_eq!(turned, expected, "{command}");
        assert!(!said.contains(hint), "{said}");
        // What was looked for is in no picture, and that is a failure.
        let output = gnomon(folder.path(), &[command, &unaware, "--poses", "lost.csv"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{said}");
        let lost = rows(&folder.path().join("lost.csv"));
        assert!(lost.iter().all(|row| row[3] == "lost"), "{lost:?}");
        assert!(
            said.contains(&format!("{hint}set [camera] mirror = true")),
            "{said}"
        );
        let output = gnomon(folder.path(), &[command, &wrongly, "--poses", "wrong.csv"]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success(), "{said}");
        assert!(
            said.contains(&format!("{hint}leave out [camera] mirror = true")),
            "{said}"
        );
    }
    let checked = |scene: &str| {
        let output = gnomon(folder.path(), &["check", scene]);
        (
            output.status.success(),
            String::from_utf8(output.stdout).unwrap(),
        )
    };
    let (is_well, said) = checked(&unaware);
    assert!(!is_well && said.contains(hint), "{said}");
    for scene in [&aware, &plain_scene] {
        let (is_well, said) = checked(scene);
        assert!(is_well && !said.contains("warning"), "{said}");
    }

    let without_scene = |more: &[&str]| {
        let tracked = [
            "track",
            plain(&mirrored),
            "--calibration",
            plain(&calibration),
        ];
        let rest = ["--size-mm", "45", "--poses", "lone.csv"];
        done(folder.path(), &[&tracked[..], &rest[..], more].concat())
    };
    assert!(without_scene(&[]).contains("--mirror"));
    assert!(without_scene(&["--mirror"]).contains("markers found"));
}

/// The focal length and its deviation that a job tells of a recording without a calibration.
fn told_focal_px(said: &str) -> (f64, f64) {
    let (_, rest) = said
        .split_once("carries no calibration: focal length ")
        .unwrap_or_else(|| panic!("no focal length in {said}"));
    let mut words = rest.split_whitespace();
    let mut number = || words.next().and_then(|word| word.parse().ok());
    let focal_px = number();
    let deviation_px = rest.split_whitespace().nth(2);
    (
        focal_px.expect("a number"),
        deviation_px
            .and_then(|word| word.parse().ok())
            .expect("a number"),
    )
}

/// A scene of the project that plays its video alone: nothing there says what camera it was.
fn scene_without_a_calibration(name: &str) -> String {
    let video = project_file(&format!("recordings/{name}/video.mp4"));
    let text = std::fs::read_to_string(project_file(&format!("config/{name}.toml"))).unwrap();
    let root = project_file("");
    text.replace(
        &format!("source = \"recordings/{name}\""),
        &format!("source = \"{}\"", plain(&video)),
    )
    .replace("\"models/", &format!("\"{}models/", plain(&root)))
    .replace("\"recordings/", &format!("\"{}recordings/", plain(&root)))
}

#[test]
fn a_camera_without_a_calibration_is_learnt_and_all_jobs_say_the_same() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["lamp", "hand", "room"] {
        let path = |file: &str| folder.path().join(format!("{name}_{file}"));
        let video = project_file(&format!("recordings/{name}/video.mp4"));
        let scene = path("scene.toml");
        std::fs::write(&scene, scene_without_a_calibration(name)).unwrap();
        let scene = plain(&scene).to_owned();
        let poses = plain(&path("poses.csv")).to_owned();
        let again = plain(&path("again.csv")).to_owned();
        let known = plain(&path("known.csv")).to_owned();
        let replayed = done(folder.path(), &["replay", &scene, "--poses", &poses]);
        let tracked = done(folder.path(), &["track", &scene, "--poses", &again]);
        let checked = gnomon(folder.path(), &["check", &scene]);
        assert!(checked.status.success());
        let checked = String::from_utf8_lossy(&checked.stdout).into_owned();
        let calibration = project_file(&format!("recordings/{name}/camera.toml"));
        let (anchors, source) = (scene.as_str(), plain(&video));
        done(
            folder.path(),
            &[
                "track",
                source,
                "--anchors",
                anchors,
                "--calibration",
                plain(&calibration),
                "--poses",
                &known,
            ],
        );
        let (focal_px, deviation_px) = told_focal_px(&replayed);
        eprintln!("{name}: {focal_px} ± {deviation_px} px");
        for said in [&tracked, &checked] {
            assert_eq!(told_focal_px(said), (focal_px, deviation_px), "{said}");
        }
        hold_focal(name, &calibration, focal_px, deviation_px);
        let learnt = rows(Path::new(&poses));
        // The second run repeats the first bit for bit, in another job.
        assert_eq!(
            without_costs(learnt.clone()),
            without_costs(rows(Path::new(&again))),
            "{name}"
        );
        hold_places(name, &learnt, &rows(Path::new(&known)));
    }
}

/// Holds a focal length that was learnt, and its deviation, against the camera's calibration.
fn hold_focal(name: &str, calibration: &Path, focal_px: f64, deviation_px: f64) {
    let truth = gnomon::capture::load_calibration(calibration).unwrap();
    let truth_px = (truth.focal_px.x + truth.focal_px.y) / 2.0;
    let off_px = (focal_px - truth_px).abs();
    assert!(
        off_px < 0.03 * truth_px,
        "{name}: {focal_px} for {truth_px}"
    );
    assert!(
        off_px < 3.0 * deviation_px,
        "{name}: {focal_px} ± {deviation_px}"
    );
}

/// Holds the places that a learnt camera gives against a known one's.
fn hold_places(name: &str, learnt: &[Vec<String>], known: &[Vec<String>]) {
    // Distances follow the focal length, directions do not.
    let mut apart = Vec::new();
    for (learnt, known) in learnt.iter().zip(known) {
        assert_eq!(learnt[..3], known[..3]);
        let place = |row: &[String]| -> Option<DVec3> {
            let numbers: Option<Vec<f64>> =
                row[5..8].iter().map(|field| field.parse().ok()).collect();
            numbers.map(|numbers| DVec3::from_slice(&numbers))
        };
        if let (Some(learnt), Some(known)) = (place(learnt), place(known)) {
            apart.push((learnt - known).length() / known.length());
        }
    }
    apart.sort_by(f64::total_cmp);
    let median = apart[apart.len() / 2];
    eprintln!("{name}: places {median:.4} apart");
    assert!(apart.len() > 30 && median < 0.03, "{name}: {median}");
}

#[test]
fn lone_markers_tell_a_camera_as_far_as_they_can() {
    let folder = tempfile::tempdir().unwrap();
    let video = project_file("recordings/lamp/video.mp4");
    let poses = plain(&folder.path().join("poses.csv")).to_owned();
    let said = done(
        folder.path(),
        &["track", plain(&video), "--size-mm", "44", "--poses", &poses],
    );
    let (focal_px, deviation_px) = told_focal_px(&said);
    eprintln!("{focal_px} ± {deviation_px} px by lone markers");
    assert!((focal_px - 614.0).abs() < 3.0 * deviation_px, "{said}");
    assert!(rows(Path::new(&poses)).len() > 300);
}
