//! Calibration against cameras that are known: rendered views of a chessboard, and photographs.

mod common;

use std::path::Path;

use assert_cmd::Command;
use common::random::Random;
use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::app::picture_files::write_rgb_png;
use gnomon::capture::load_calibration;
use gnomon::geometry::camera::Intrinsics;
use gnomon::tracking::calibrating::{CalibratingError, Chessboard, Gathering, Look};

const BOARD: Chessboard = Chessboard {
    corners: [9, 6],
    square_m: 0.025,
};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::new(560.0, 556.0),
    center_px: DVec2::new(325.0, 236.0),
    distortion: [-0.21, 0.06, 0.001, -0.0008, 0.0],
};

/// The board as a camera sees it, its first inner corner at the pose's origin; 4 x 4 samples a pixel, noise of a level.
fn view(camera: &Intrinsics, camera_from_board: &DAffine3, random: &mut Random) -> Vec<u8> {
    const SAMPLES: usize = 4;
    let board_from_camera = camera_from_board.inverse();
    let eye = board_from_camera.translation;
    let [width, height] = camera.size_px;
    let [columns, rows] = BOARD.corners.map(f64::from);
    let mut grey = Vec::with_capacity((width * height) as usize);
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let mut light = 0.0;
        for k in 0..SAMPLES * SAMPLES {
            let offset = DVec2::new((k % SAMPLES) as f64, (k / SAMPLES) as f64) + 0.5;
            let pixel = DVec2::new(f64::from(x), f64::from(y)) - 0.5 + offset / SAMPLES as f64;
            let target = camera.plane_from_pixel(pixel);
            let mut point = target;
            for _ in 0..12 {
                point += target - camera.distort(point);
            }
            let ray = board_from_camera.transform_vector3(point.extend(1.0));
            let place = (eye - ray * (eye.z / ray.z)).truncate() / BOARD.square_m;
            let inside = place.cmpge(DVec2::splat(-1.0)).all()
                && place.cmple(DVec2::new(columns, rows)).all();
            let odd = (place.x.floor() + place.y.floor()).rem_euclid(2.0) > 0.5;
            light += if inside && odd { 0.03 } else { 0.8 };
        }
        let linear: f64 = light / (SAMPLES * SAMPLES) as f64;
        let level = 255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055);
        grey.push(
            (level + random.between(-1.5, 1.5))
                .round()
                .clamp(0.0, 255.0) as u8,
        );
    }
    grey
}

/// A pose from which the board's middle is seen at a part of the picture, tilted about both axes.
fn pose(at: [f64; 2], tilt_deg: [f64; 2], distance_m: f64) -> DAffine3 {
    let rotation = DQuat::from_rotation_x(tilt_deg[0].to_radians())
        * DQuat::from_rotation_y(tilt_deg[1].to_radians());
    let ray = CAMERA.plane_from_pixel(DVec2::new(at[0] * 640.0, at[1] * 480.0));
    let middle = DVec3::new(4.0, 2.5, 0.0) * BOARD.square_m;
    let center = ray.extend(1.0) * distance_m;
    DAffine3::from_rotation_translation(rotation, center - rotation * middle)
}

/// Views all over the picture.
fn good_poses() -> Vec<DAffine3> {
    let mut poses = Vec::new();
    for (k, at) in [
        [0.5, 0.5],
        [0.3, 0.32],
        [0.7, 0.32],
        [0.3, 0.68],
        [0.7, 0.68],
        [0.5, 0.35],
        [0.5, 0.65],
        [0.32, 0.5],
        [0.68, 0.5],
        [0.45, 0.55],
        [0.55, 0.45],
        [0.5, 0.5],
    ]
    .into_iter()
    .enumerate()
    {
        let tilt_deg = [[25.0, 10.0], [-30.0, 15.0], [20.0, -35.0], [-15.0, 30.0]][k % 4];
        poses.push(pose(at, tilt_deg, 0.34 + 0.03 * (k % 5) as f64));
    }
    poses
}

/// The largest distance between where two calibrations put what is seen in the middle four fifths of the picture, but for
/// what all of it is shifted by: a turn of the camera does the same.
fn displacement_px(a: &Intrinsics, b: &Intrinsics) -> f64 {
    let places = (64..=576)
        .step_by(64)
        .flat_map(|x| (48..=432).step_by(48).map(move |y| (x, y)));
    let moved: Vec<DVec2> = places
        .map(|(x, y)| {
            let pixel = DVec2::new(f64::from(x), f64::from(y));
            let target = a.plane_from_pixel(pixel);
            let mut point = target;
            for _ in 0..30 {
                point += target - a.distort(point);
            }
            b.pixel_from_plane(b.distort(point)) - pixel
        })
        .collect();
    let mean = moved.iter().sum::<DVec2>() / moved.len() as f64;
    moved
        .iter()
        .map(|step| step.distance(mean))
        .fold(0.0, f64::max)
}

#[test]
fn a_known_camera_is_found_again_and_a_view_that_does_not_fit_is_left_out() {
    let mut random = Random::new(5);
    let mut gathering = Gathering::new(BOARD, CAMERA.size_px);
    let mut kept = 0;
    for (frame, pose) in good_poses().iter().enumerate() {
        let grey = view(&CAMERA, pose, &mut random);
        let look = gathering.look(frame as u32, &grey, CAMERA.size_px).unwrap();
        assert_ne!(look, Look::Nothing, "view {frame}");
        kept += usize::from(look == Look::New);
        // The same once more adds nothing.
        let again = gathering.look(99, &grey, CAMERA.size_px).unwrap();
        assert_eq!(again, Look::Known);
    }
    assert!(kept >= 10 && kept == gathering.views().len(), "{kept} kept");
    let nothing = vec![128; 640 * 480];
    assert_eq!(
        gathering.look(50, &nothing, CAMERA.size_px).unwrap(),
        Look::Nothing
    );
    let covered = gathering
        .coverage()
        .iter()
        .filter(|&&count| count > 0)
        .count();
    assert!(covered > 35, "{covered} of 48 cells");
    let found = gathering.solve().unwrap();
    let camera = &found.intrinsics;
    let focal = (camera.focal_px / CAMERA.focal_px - 1.0)
        .abs()
        .max_element();
    let moved_px = displacement_px(&CAMERA, camera);
    eprintln!(
        "focal {focal:.5}, {moved_px:.3} px, rms {:.3} px, {camera:?}",
        found.rms_px
    );
    assert!(focal < 0.002 && moved_px < 0.3, "{focal} {moved_px} px");
    assert!(found.rms_px < 0.15 && found.dropped.is_empty());
    let off = (camera.focal_px - CAMERA.focal_px).abs();
    assert!(
        off.cmplt(5.0 * found.focal_deviation_px).all(),
        "{off} of {}",
        found.focal_deviation_px
    );

    // A view by another lens.
    let other = Intrinsics {
        distortion: [0.25, 0.0, 0.0, 0.0, 0.0],
        ..CAMERA
    };
    let grey = view(&other, &pose([0.4, 0.6], [10.0, 25.0], 0.33), &mut random);
    assert_eq!(
        gathering.look(77, &grey, CAMERA.size_px).unwrap(),
        Look::New
    );
    let again = gathering.solve().unwrap();
    let dropped: Vec<u32> = again.dropped.iter().map(|(frame, _)| *frame).collect();
    assert_eq!(dropped, [77]);
    assert!(displacement_px(&CAMERA, &again.intrinsics) < 0.3);
}

#[test]
fn views_that_tell_nothing_are_refused() {
    let mut random = Random::new(6);
    let mut gathering = Gathering::new(BOARD, CAMERA.size_px);
    assert!(matches!(
        gathering.solve(),
        Err(CalibratingError::TooFewViews { found: 0 })
    ));
    // All frontal and equally far: any focal length would do.
    for at in [[0.35, 0.4], [0.65, 0.4], [0.5, 0.6], [0.4, 0.65]] {
        let grey = view(&CAMERA, &pose(at, [0.0, 0.0], 0.4), &mut random);
        gathering.look(0, &grey, CAMERA.size_px).unwrap();
    }
    let solved = gathering.solve();
    assert!(
        matches!(solved, Err(CalibratingError::AllAlike { .. })),
        "{solved:?}"
    );
    let small = vec![0; 64 * 48];
    assert!(matches!(
        gathering.look(0, &small, [64, 48]),
        Err(CalibratingError::Size { .. })
    ));
}

fn calibrate(folder: &Path, arguments: &str) -> std::process::Output {
    Command::cargo_bin("gnomon")
        .expect("the binary")
        .current_dir(folder)
        .args(format!("calibrate {arguments}").split_whitespace())
        .output()
        .expect("a run")
}

#[test]
fn the_command_writes_what_a_scene_takes() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut random = Random::new(7);
    for (index, pose) in good_poses().iter().enumerate() {
        let grey = view(&CAMERA, pose, &mut random);
        let rgba: Vec<u8> = grey
            .iter()
            .flat_map(|&level| [level, level, level, 255])
            .collect();
        let name = format!("views/{index:06}.png");
        write_rgb_png(&folder.path().join(name), CAMERA.size_px, &rgba).expect("a picture");
    }
    let output = calibrate(
        folder.path(),
        "views --chessboard 9x6 --square-mm 25 --out camera.toml --coverage coverage.png",
    );
    assert!(output.status.success(), "{output:?}");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(
        told.contains("12 of 12 pictures") && told.contains("focal lengths"),
        "{told}"
    );
    let found = load_calibration(&folder.path().join("camera.toml")).expect("a calibration");
    let moved_px = displacement_px(&CAMERA, &found);
    assert!(moved_px < 0.3, "{moved_px} px: {found:?} {told}");
    let picture = image::open(folder.path().join("coverage.png")).expect("a picture");
    assert_eq!((picture.width(), picture.height()), (640, 480));

    for (arguments, message) in [
        (
            "views --chessboard 8x5 --square-mm 25 --out x.toml",
            "8 x 5 inner corners",
        ),
        (
            "views --chessboard 2x5 --square-mm 25 --out x.toml",
            "at least 3 x 3",
        ),
        (
            "views --chessboard 9x6 --square-mm 0 --out x.toml",
            "allowed: 0.1 to 10000",
        ),
        (
            "nowhere --chessboard 9x6 --square-mm 25 --out x.toml",
            "nowhere",
        ),
        (
            "views --chessboard 9x6 --square-mm 25 --out views/x.toml",
            "write elsewhere",
        ),
    ] {
        let output = calibrate(folder.path(), arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && told.contains(message),
            "{arguments}: {told}"
        );
        assert!(!folder.path().join("x.toml").exists());
    }
}

#[test]
fn photographs_give_the_camera_that_their_authors_found() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/real/swatbotics/mapping_feb_2014/calibration");
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return;
    }
    let out = tempfile::tempdir().expect("a folder");
    let arguments = format!(
        "{} --chessboard 7x5 --square-mm 30 --out camera.toml",
        folder.display()
    );
    let output = calibrate(out.path(), &arguments);
    assert!(output.status.success(), "{output:?}");
    let told = String::from_utf8_lossy(&output.stdout);
    assert!(told.contains("17 of 17 pictures"), "{told}");
    let found = load_calibration(&out.path().join("camera.toml")).expect("a calibration");
    eprintln!("{found:?}");
    let off = (found.focal_px / DVec2::new(765.00, 764.18) - 1.0)
        .abs()
        .max_element();
    assert!(off < 0.01, "{found:?}");
}
