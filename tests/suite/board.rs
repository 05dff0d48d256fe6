//! `gnomon board`: layouts learnt from corners with known noise, from rendered sheets, from a path-traced session and
//! from photographs of a known grid.

use std::path::{Path, PathBuf};
use std::process::Output;

use crate::common::photographs::photographs;
use crate::common::project_file;
use crate::common::random::Random;
use crate::common::sheets;
use assert_cmd::Command;
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gnomon::app::jobs::board::board_block;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::scene::{Anchor, Family, Marker, Scene, TrackingSettings};
use gnomon::tracking::focal::CameraLearner;
use gnomon::tracking::mapping::{
    LearntBoard, MapError, MapSettings, ShapeWanted, learn_board, learn_board_and_camera,
};
use gnomon::tracking::{Detection, Detector, grey_from_rgba};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [1280, 720],
    focal_px: DVec2::new(920.0, 918.0),
    center_px: DVec2::new(641.3, 357.9),
    distortion: Distortion::Polynomial([0.08, -0.19, 0.0008, -0.0005, 0.05]),
};

const SETTINGS: MapSettings = MapSettings {
    size_m: 0.04,
    gauge: None,
    learns_sizes: false,
    plane_tolerance_m: 0.002,
    shape: ShapeWanted::Flat,
};

/// A marker anywhere in space.
#[derive(Clone, Copy)]
struct Stuck {
    id: u32,
    size_m: f64,
    world_from_marker: DAffine3,
}

/// Markers on a table, some way from each other, the first at the origin.
fn table(random: &mut Random, count: u32) -> Vec<Stuck> {
    let mut stuck: Vec<Stuck> = Vec::new();
    while (stuck.len() as u32) < count {
        let id = stuck.len() as u32;
        let (center_m, turn) = match id {
            0 => (DVec3::ZERO, 0.0),
            _ => (
                DVec3::new(random.between(-0.1, 0.5), random.between(-0.2, 0.2), 0.0),
                random.between(-3.1, 3.1),
            ),
        };
        let is_free =
            |other: &Stuck| other.world_from_marker.translation.distance(center_m) > 0.065;
        if stuck.iter().all(is_free) {
            stuck.push(Stuck {
                id,
                size_m: 0.04,
                world_from_marker: DAffine3::from_translation(center_m)
                    * DAffine3::from_rotation_z(turn),
            });
        }
    }
    stuck
}

/// Cameras that go round the table in a circle and look at places on it.
fn walk(random: &mut Random, count: u32) -> Vec<DAffine3> {
    (0..count)
        .map(|k| {
            let angle = f64::from(k) / f64::from(count) * 2.0 * std::f64::consts::PI;
            let at_m = DVec3::new(
                0.2 + 0.35 * angle.cos(),
                0.35 * angle.sin(),
                random.between(0.3, 0.5),
            );
            let target_m = DVec3::new(random.between(0.05, 0.35), random.between(-0.1, 0.1), 0.0);
            let forward = (target_m - at_m).normalize();
            let right = forward.cross(DVec3::Z).normalize();
            let world_from_camera = DAffine3::from_mat3_translation(
                DMat3::from_cols(right, forward.cross(right), forward),
                at_m,
            );
            world_from_camera.inverse()
        })
        .collect()
}

/// What a detector with normally distributed errors sees of the markers that are wholly in the picture.
fn detections(
    random: &mut Random,
    stuck: &[Stuck],
    camera_from_world: &DAffine3,
    noise_px: f64,
) -> Vec<Detection> {
    let mut seen = Vec::new();
    for marker in stuck {
        let half_m = 0.5 * marker.size_m;
        let corners_px = [(-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)].map(|(x, y)| {
            let in_marker_m = DVec3::new(x * half_m, y * half_m, 0.0);
            let in_world_m = marker.world_from_marker.transform_point3(in_marker_m);
            let in_camera_m = camera_from_world.transform_point3(in_world_m);
            let noise = DVec2::new(normal(random), normal(random)) * noise_px;
            CAMERA.pixel_from_plane(CAMERA.distort(in_camera_m.truncate() / in_camera_m.z)) + noise
        });
        let high = DVec2::new(1279.0, 719.0);
        let inside = corners_px
            .iter()
            .all(|corner| corner.cmpgt(DVec2::ZERO).all() && corner.cmplt(high).all());
        if inside {
            seen.push(Detection {
                family: Family::TAG36H11,
                id: marker.id,
                corners_px,
                margin: 100.0,
                corrected_bits: 0,
            });
        }
    }
    seen
}

/// Of variance 1 (Irwin and Hall's sum of twelve).
fn normal(random: &mut Random) -> f64 {
    (0..12).map(|_| random.between(0.0, 1.0)).sum::<f64>() - 6.0
}

fn filmed(
    random: &mut Random,
    stuck: &[Stuck],
    pictures: u32,
    noise_px: f64,
) -> Vec<Vec<Detection>> {
    walk(random, pictures)
        .iter()
        .map(|camera_from_world| detections(random, stuck, camera_from_world, noise_px))
        .collect()
}

fn learn(pictures: &[Vec<Detection>], settings: &MapSettings) -> Result<LearntBoard, MapError> {
    learn_board(&CAMERA, Family::TAG36H11, pictures, settings)
}

/// Errors of centres (mm) and turns (degrees) once the layout is laid on the truth, since the gauge's own turn is the
/// frame's.
fn errors(learnt: &[Marker], truth: &[Marker]) -> Vec<(f64, f64)> {
    assert_eq!(learnt.len(), truth.len());
    let count = truth.len() as f64;
    let [from_m, to_m] = [learnt, truth].map(|markers| {
        markers
            .iter()
            .map(|marker| marker.center_m().truncate())
            .sum::<DVec2>()
            / count
    });
    // The turn of least squares: Procrustes in the plane.
    let (mut cosine, mut sine) = (0.0, 0.0);
    for (learnt, truth) in learnt.iter().zip(truth) {
        let (a, b) = (
            learnt.center_m().truncate() - from_m,
            truth.center_m().truncate() - to_m,
        );
        cosine += a.dot(b);
        sine += a.perp_dot(b);
    }
    let turn = DVec2::from_angle(sine.atan2(cosine));
    learnt
        .iter()
        .zip(truth)
        .map(|(learnt, truth)| {
            assert_eq!(learnt.id, truth.id);
            let center_m = to_m + turn.rotate(learnt.center_m().truncate() - from_m);
            let rotation = turn.rotate(DVec2::from_angle(learnt.rotation_rad()));
            let off = rotation.angle_to(DVec2::from_angle(truth.rotation_rad()));
            (
                center_m.distance(truth.center_m().truncate()) * 1e3,
                off.abs().to_degrees(),
            )
        })
        .collect()
}

fn markers(learnt: &LearntBoard) -> Vec<Marker> {
    learnt.markers.iter().map(|learnt| learnt.marker).collect()
}

fn truth(stuck: &[Stuck]) -> Vec<Marker> {
    stuck
        .iter()
        .map(|stuck| {
            let DAffine3 {
                matrix3,
                translation,
            } = stuck.world_from_marker;
            let turn_rad = matrix3.x_axis.y.atan2(matrix3.x_axis.x);
            Marker::alone(Family::TAG36H11, stuck.id, stuck.size_m)
                .in_plane(translation.truncate(), turn_rad)
        })
        .collect()
}

fn worst(errors: &[(f64, f64)]) -> (f64, f64) {
    errors.iter().fold((0.0, 0.0), |worst, error| {
        (worst.0.max(error.0), worst.1.max(error.1))
    })
}

#[test]
fn exact_corners_give_the_exact_layout() {
    for seed in 0..10 {
        let mut random = Random::new(seed);
        let stuck = table(&mut random, 12);
        let pictures = filmed(&mut random, &stuck, 30, 0.0);
        let learnt = learn(&pictures, &SETTINGS).unwrap();
        let (center_mm, turn_deg) = worst(&errors(&markers(&learnt), &truth(&stuck)));
        assert!(
            center_mm < 1e-4 && turn_deg < 1e-4,
            "{center_mm} mm {turn_deg}°"
        );
        assert_eq!(learnt.markers[0].marker.center_m(), DVec3::ZERO);
    }
}

#[test]
fn errors_are_as_large_as_is_said() {
    let (mut squares, mut count, mut all) = (0.0, 0, Vec::new());
    for seed in 0..20 {
        let mut random = Random::new(100 + seed);
        let stuck = table(&mut random, 12);
        let pictures = filmed(&mut random, &stuck, 40, 0.15);
        let learnt = learn(&pictures, &SETTINGS).unwrap();
        assert!(
            (learnt.noise_px / 0.15 - 1.0).abs() < 0.1,
            "{} px",
            learnt.noise_px
        );
        assert!(learnt.markers.iter().all(|learnt| learnt.dropped <= 1));
        all.extend(errors(&markers(&learnt), &truth(&stuck)));
        // In the gauge's own frame, whose deviations are told.
        for (learnt, truth) in learnt.markers.iter().zip(truth(&stuck)).skip(1) {
            let off_m = (learnt.marker.center_m() - truth.center_m()).truncate();
            squares += (off_m / learnt.center_deviation_m.truncate()).length_squared();
            let turn = DVec2::from_angle(learnt.marker.rotation_rad())
                .angle_to(DVec2::from_angle(truth.rotation_rad()));
            squares += (turn / learnt.rotation_deviation_rad).powi(2);
            count += 3;
        }
    }
    let (center_mm, turn_deg) = worst(&all);
    let ratio = (squares / f64::from(count)).sqrt();
    eprintln!(
        "worst of {}: {center_mm:.3} mm, {turn_deg:.3}°; errors are {ratio:.2} of the deviations",
        all.len()
    );
    assert!(
        center_mm < 0.1 && turn_deg < 0.15,
        "{center_mm} mm, {turn_deg}°"
    );
    assert!(
        (0.7..1.3).contains(&ratio),
        "errors are {ratio} of the deviations told"
    );
}

#[test]
fn a_camera_that_nobody_calibrated_is_learnt_as_well_as_is_said() {
    // Half a turn about the table, and a short sway: what little it tells is not to be taken for more.
    for (views, part_of_turn) in [(40, 0.5), (25, 0.12)] {
        let (mut squares, mut worst) = (0.0, 0.0_f64);
        const SEEDS: u64 = 20;
        for seed in 0..SEEDS {
            let mut random = Random::new(300 + seed);
            let stuck = table(&mut random, 8);
            let cameras = walk(&mut random, (f64::from(views) / part_of_turn) as u32);
            let pictures: Vec<Vec<Detection>> = (cameras.iter().take(views as usize))
                .map(|camera_from_world| detections(&mut random, &stuck, camera_from_world, 0.15))
                .collect();
            let settings = TrackingSettings::default();
            let mut learner =
                CameraLearner::of_every_marker(&settings, Family::TAG36H11, CAMERA.size_px)
                    .unwrap();
            pictures.iter().for_each(|seen| learner.look_at(seen));
            let rough = learner.finish();
            let (learnt, camera) =
                learn_board_and_camera(&rough, Family::TAG36H11, &pictures, &SETTINGS).unwrap();
            // One focal length is learnt for both axes.
            let true_px = 0.5 * CAMERA.focal_px.element_sum();
            let off = (camera.intrinsics.focal_px.x / true_px).ln();
            squares += (off / camera.focal_deviation).powi(2);
            worst = worst.max(off.abs());
            assert!(learnt.markers.iter().all(|learnt| learnt.dropped <= 1));
        }
        let ratio = (squares / SEEDS as f64).sqrt();
        eprintln!("{views} views: errors are {ratio:.2} of the deviations, {worst:.4} at most");
        assert!(
            (0.3..1.3).contains(&ratio),
            "{views} views: errors are {ratio} of the deviations told"
        );
        assert!(worst < 0.02, "{views} views: focal length off by {worst}");
    }
}

#[test]
fn photographs_of_random_sheets_give_their_layouts() {
    let intrinsics = sheets::CAMERA;
    let mut all = Vec::new();
    for seed in 0..3 {
        let mut random = Random::new(seed);
        // In the quarters of a sheet, each turned in its own way.
        let printed: Vec<Marker> = [
            (0, -1.0, 1.0),
            (1, 1.0, 1.0),
            (2, -1.0, -1.0),
            (17, 1.0, -1.0),
        ]
        .map(|(id, x, y)| {
            let turn_rad = random.between(-3.1, 3.1);
            let center_m = DVec2::new(
                x * random.between(0.04, 0.07),
                y * random.between(0.035, 0.06),
            );
            Marker::alone(Family::TAG36H11, id, 0.04).in_plane(center_m, turn_rad)
        })
        .to_vec();
        let mut detector =
            Detector::new(&TrackingSettings::default(), &[Family::TAG36H11]).unwrap();
        let pictures: Vec<Vec<Detection>> = (0..12)
            .map(|k| {
                let turn_deg = f64::from(k) * 30.0;
                let at_m = DVec3::new(
                    random.between(-0.01, 0.01),
                    random.between(-0.01, 0.01),
                    0.4,
                );
                let pose = sheets::camera_above(random.between(20.0, 40.0), turn_deg, at_m);
                let frame = sheets::photograph(&intrinsics, &[(&printed, pose)], 0.0);
                let mut grey = Vec::new();
                grey_from_rgba(&frame, &mut grey).unwrap();
                detector.detect(&grey, frame.size_px).unwrap()
            })
            .collect();
        let learnt = learn_board(&intrinsics, Family::TAG36H11, &pictures, &SETTINGS).unwrap();
        all.extend(errors(&markers(&learnt), &printed));
    }
    let (center_mm, turn_deg) = worst(&all);
    eprintln!("sheets: {center_mm:.3} mm, {turn_deg:.3}° at most");
    assert!(
        center_mm < 0.1 && turn_deg < 0.1,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn sizes_are_learnt_from_the_gauge_s() {
    let mut random = Random::new(7);
    let mut stuck = table(&mut random, 10);
    for marker in &mut stuck[1..] {
        marker.size_m = random.between(0.02, 0.06);
    }
    let pictures = filmed(&mut random, &stuck, 40, 0.1);
    let settings = MapSettings {
        learns_sizes: true,
        ..SETTINGS
    };
    let learnt = learn(&pictures, &settings).unwrap();
    for (learnt, truth) in learnt.markers.iter().zip(&stuck) {
        let off_m = (learnt.marker.size_m - truth.size_m).abs();
        assert!(off_m < 2e-4, "{}: {off_m} m", truth.id);
        assert!(
            off_m <= 5.0 * learnt.size_deviation_m,
            "{}: {off_m} m",
            truth.id
        );
    }
    assert_eq!(learnt.markers[0].size_deviation_m, 0.0);
    let (center_mm, turn_deg) = worst(&errors(&markers(&learnt), &truth(&stuck)));
    // The scale is as good as the gauge's picture: a corner's error in 80 pixels.
    assert!(
        center_mm < 0.5 && turn_deg < 0.2,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn a_marker_off_the_table_is_named_with_its_height() {
    let mut random = Random::new(11);
    for height_m in [0.01, 0.05] {
        let mut stuck = table(&mut random, 12);
        let pose = &mut stuck[5].world_from_marker;
        *pose = DAffine3::from_translation(DVec3::Z * height_m) * *pose;
        let pictures = filmed(&mut random, &stuck, 40, 0.15);
        let error = learn(&pictures, &SETTINGS).unwrap_err();
        let MapError::NotPlanar { off } = &error else {
            panic!("{error}")
        };
        assert_eq!(off.len(), 1, "{error}");
        assert_eq!(off[0].0, 5);
        assert!((off[0].1 - height_m).abs() < 1e-3, "{error}");
        assert!(error.to_string().contains("5 by "), "{error}");
    }
    // One that stands on its edge.
    let mut stuck = table(&mut random, 12);
    let pose = &mut stuck[3].world_from_marker;
    *pose = DAffine3::from_translation(DVec3::Z * 0.02)
        * *pose
        * DAffine3::from_quat(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2));
    let looking = walk(&mut random, 60);
    let pictures: Vec<Vec<Detection>> = looking
        .iter()
        .map(|camera_from_world| {
            // Seen from its front alone.
            let normal = camera_from_world.matrix3 * stuck[3].world_from_marker.matrix3.z_axis;
            let at_m = camera_from_world.transform_point3(stuck[3].world_from_marker.translation);
            let shown: Vec<Stuck> = stuck
                .iter()
                .copied()
                .filter(|marker| marker.id != 3 || normal.dot(at_m.normalize()) < -0.2)
                .collect();
            detections(&mut random, &shown, camera_from_world, 0.15)
        })
        .collect();
    let error = learn(&pictures, &SETTINGS).unwrap_err();
    let MapError::NotPlanar { off } = &error else {
        panic!("{error}")
    };
    assert!(
        off.len() == 1 && off[0].0 == 3 && (off[0].1 - 0.04).abs() < 2e-3,
        "{error}"
    );
}

#[test]
fn outliers_are_dropped_and_counted() {
    let mut random = Random::new(3);
    let stuck = table(&mut random, 10);
    let mut pictures = filmed(&mut random, &stuck, 60, 0.1);
    let mut spoilt = 0;
    for picture in pictures.iter_mut().step_by(6) {
        // A finger over a corner, and a second marker 2 elsewhere.
        if let Some(seen) = picture.iter_mut().find(|seen| seen.id == 4) {
            seen.corners_px[1] += DVec2::new(6.0, -4.0);
            spoilt += 1;
        }
        let double = picture.iter().find(|seen| seen.id == 1).cloned();
        picture.extend(double.map(|double| Detection { id: 2, ..double }));
    }
    // Once, a false id.
    let mut false_one = pictures[9][0].clone();
    false_one.id = 555;
    pictures[9].push(false_one);
    let learnt = learn(&pictures, &SETTINGS).unwrap();
    assert_eq!(learnt.left_out, [555]);
    assert!(
        spoilt > 3 && learnt.markers[4].dropped == spoilt,
        "{:?} of {spoilt}",
        learnt.markers[4]
    );
    let others: usize = learnt.markers.iter().map(|learnt| learnt.dropped).sum();
    assert!(others <= spoilt + 2, "{others}");
    let (center_mm, turn_deg) = worst(&errors(&markers(&learnt), &truth(&stuck)));
    assert!(
        center_mm < 0.1 && turn_deg < 0.15,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn a_marker_that_moved_bends_no_other() {
    let mut random = Random::new(13);
    let mut stuck = table(&mut random, 10);
    let mut pictures = filmed(&mut random, &stuck, 40, 0.1);
    let before = truth(&stuck);
    stuck[6].world_from_marker.translation += DVec3::new(0.02, 0.01, 0.0);
    pictures.extend(filmed(&mut random, &stuck, 20, 0.1));
    let learnt = learn(&pictures, &SETTINGS).unwrap();
    let moved = &learnt.markers[6];
    assert!(
        moved.dropped > 10 && moved.dropped < moved.observations,
        "{moved:?}"
    );
    let (center_mm, turn_deg) = worst(&errors(&markers(&learnt), &before));
    assert!(
        center_mm < 0.15 && turn_deg < 0.15,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn what_does_not_hang_together_is_told() {
    let mut random = Random::new(5);
    let stuck = table(&mut random, 9);
    let parts = [&stuck[..4], &stuck[4..7], &stuck[7..]];
    let pictures: Vec<Vec<Detection>> = walk(&mut random, 40)
        .iter()
        .enumerate()
        .map(|(k, camera)| detections(&mut random, parts[k % 3], camera, 0.1))
        .collect();
    let settings = MapSettings {
        gauge: Some(5),
        ..SETTINGS
    };
    let error = learn(&pictures, &settings).unwrap_err();
    let groups = vec![vec![4, 5, 6], vec![0, 1, 2, 3], vec![7, 8]];
    assert_eq!(error, MapError::NotConnected { groups });
    assert!(
        error
            .to_string()
            .contains("{4, 5, 6}, {0, 1, 2, 3}, {7, 8}"),
        "{error}"
    );

    let settings = MapSettings {
        gauge: Some(77),
        ..SETTINGS
    };
    let error = learn(&pictures, &settings).unwrap_err();
    assert!(
        error.to_string().contains("marker 77") && error.to_string().contains("0, 1, 2"),
        "{error}"
    );
    assert_eq!(learn(&[], &SETTINGS), Err(MapError::TooFewMarkers));
    let lone: Vec<Vec<Detection>> = pictures
        .iter()
        .map(|picture| picture[..1].to_vec())
        .collect();
    assert_eq!(learn(&lone, &SETTINGS), Err(MapError::TooFewMarkers));
}

#[test]
fn the_block_is_a_board_that_a_scene_takes() {
    let mut random = Random::new(8);
    let stuck = table(&mut random, 8);
    let learnt = learn(&filmed(&mut random, &stuck, 30, 0.1), &SETTINGS).unwrap();
    let block = board_block(&learnt, "the \\ desk");
    let text = format!("[camera]\nsource = \"webcam:0\"\n{block}");
    let scene = Scene::parse(Path::new("scene.toml"), &text).unwrap();
    let [
        Anchor {
            name,
            markers: read,
        },
    ] = &scene.anchors[..]
    else {
        panic!("one board")
    };
    assert_eq!((name.as_str(), read.len()), ("the \\ desk", 8));
    for (read, written) in read.iter().zip(markers(&learnt)) {
        assert_eq!((read.family, read.id), (written.family, written.id));
        assert!(read.center_m().distance(written.center_m()) < 1e-6);
        assert!((read.rotation_rad() - written.rotation_rad()).abs() < 1e-5);
        assert!((read.size_m - written.size_m).abs() < 1e-6);
    }
}

// ---------------------------------------------------------------------------------------------------------------------
// The command.

fn gnomon(folder: &Path, arguments: &[&str]) -> Output {
    Command::cargo_bin("gnomon")
        .expect("the program")
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("a run")
}

fn plain(path: &Path) -> &str {
    path.to_str().expect("a plain path")
}

/// The markers of the board that a run wrote to stdout.
fn board_of(output: &Output) -> Vec<Marker> {
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let block = String::from_utf8_lossy(&output.stdout);
    let text = format!("[camera]\nsource = \"webcam:0\"\n{block}");
    let mut scene = Scene::parse(Path::new("scene.toml"), &text).expect("a scene");
    scene.anchors.remove(0).markers
}

#[test]
fn the_board_of_a_session_is_learnt_from_its_video() {
    let folder = tempfile::tempdir().unwrap();
    let scene = project_file("config/lamp.toml");
    // The path tracer's texture filter made the printed squares smaller; a distance sets the scale right.
    let arguments = [
        "board",
        "--from",
        plain(&scene),
        "--size-mm",
        "45",
        "--distance",
        "0:2:350",
    ];
    let learnt = board_of(&gnomon(folder.path(), &arguments));
    let board = Scene::load(&scene).unwrap().anchors.remove(0);
    // Marker 5 lies under the tin.
    let known: Vec<Marker> = board
        .markers
        .into_iter()
        .filter(|marker| marker.id != 5)
        .collect();
    let (center_mm, turn_deg) = worst(&errors(&learnt, &known));
    eprintln!("lamp: {center_mm:.3} mm, {turn_deg:.3}°");
    assert!(
        center_mm < 0.2 && turn_deg < 0.1,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn the_board_of_a_video_is_learnt_with_its_camera_where_nobody_has_calibrated_it() {
    let folder = tempfile::tempdir().unwrap();
    let video = project_file("recordings/lamp/video.mp4");
    let distance = ["--size-mm", "45", "--distance", "0:2:350"];
    let arguments = [&["board", "--from", plain(&video)], &distance[..]].concat();
    let output = gnomon(folder.path(), &arguments);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        said.contains("carries no calibration: focal length"),
        "{said}"
    );
    let learnt = board_of(&output);
    let scene = Scene::load(&project_file("config/lamp.toml")).unwrap();
    let known: Vec<Marker> = scene.anchors[0]
        .markers
        .iter()
        .copied()
        .filter(|marker| marker.id != 5)
        .collect();
    let (center_mm, turn_deg) = worst(&errors(&learnt, &known));
    eprintln!("{said}{center_mm:.3} mm, {turn_deg:.3}°");
    assert!(
        center_mm < 1.0 && turn_deg < 0.2,
        "{center_mm} mm, {turn_deg}°"
    );
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/real")]
fn the_grid_of_the_photographs_is_learnt_from_them() {
    let folder = photographs("yac_mocap");
    let temporary = tempfile::tempdir().unwrap();
    let calibration = temporary.path().join("camera.toml");
    let text = "size_px = [640, 480]\nfocal_px = [606.57, 609.98]\ncenter_px = [324.44, 245.65]\n\
                distortion = [0, 0, 0, 0, 0]\n";
    std::fs::write(&calibration, text).unwrap();
    let stills = folder.join("cam0/data");
    let arguments = [
        "board",
        "--from",
        plain(&stills),
        "--calibration",
        plain(&calibration),
        "--size-mm",
        "88",
        "--border-cells",
        "2",
        "--decimation",
        "1",
    ];
    let learnt = board_of(&gnomon(temporary.path(), &arguments));
    let family = Family::TAG36H11.with_border(2).unwrap();
    let pitch_m = 0.088 * 1.3;
    let grid: Vec<Marker> = (0..36)
        .map(|id| {
            let center_m = DVec2::new(f64::from(id % 6), f64::from(id / 6)) * pitch_m;
            Marker::alone(family, id, 0.088).in_plane(center_m, 0.0)
        })
        .collect();
    assert!(learnt.iter().all(|marker| marker.family == family));
    let errors = errors(&learnt, &grid);
    let (center_mm, turn_deg) = worst(&errors);
    let rms_mm = (errors.iter().map(|error| error.0.powi(2)).sum::<f64>() / 36.0).sqrt();
    eprintln!("grid: {rms_mm:.2} mm rms, {center_mm:.2} mm at most, {turn_deg:.2}°");
    assert!(
        rms_mm < 1.0 && center_mm < 2.0 && turn_deg < 0.3,
        "{rms_mm} mm, {center_mm} mm, {turn_deg}°"
    );
}

#[test]
fn mistakes_are_told_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let scene = project_file("config/lamp.toml");
    let recording: PathBuf = project_file("recordings/lamp");
    let refused = |more: &[&str], parts: &[&str]| {
        let arguments = [&["board", "--out", "board.toml"], more].concat();
        let output = gnomon(folder.path(), &arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && output.stdout.is_empty(),
            "{more:?}: {said}"
        );
        for part in parts {
            assert!(said.contains(part), "{more:?} lacks {part:?}: {said}");
        }
        assert!(!folder.path().join("board.toml").exists());
    };
    let lamp = ["--from", plain(&scene), "--size-mm", "45"];
    let with = |more: &[&'static str]| [&lamp[..], more].concat();
    refused(
        &with(&["--gauge", "9"]),
        &["marker 9", "seen are 0, 1, 2, 3, 4"],
    );
    refused(&with(&["--family", "tag25h9"]), &["no two markers"]);
    refused(
        &with(&["--distance", "0:9:100"]),
        &["marker 9", "learnt are 0, 1"],
    );
    refused(&with(&["--distance", "0:1"]), &["like 0:7:412.5"]);
    refused(
        &with(&["--name", "a, b"]),
        &["'a, b'", "--name", "allowed: a text without commas"],
    );
    refused(&with(&["--mirror"]), &["is a scene"]);
    refused(&with(&["--plane-tolerance-mm", "nan"]), &["out of range"]);
    refused(
        &["--from", plain(&recording), "--size-mm", "-4"],
        &["--size-mm"],
    );
    let inside = recording.join("board.toml");
    let into_it = [
        "board",
        "--from",
        plain(&recording),
        "--size-mm",
        "45",
        "--out",
        plain(&inside),
    ];
    let output = gnomon(folder.path(), &into_it);
    assert!(String::from_utf8_lossy(&output.stderr).contains("write elsewhere"));
    assert!(!output.status.success() && !inside.exists());
}
