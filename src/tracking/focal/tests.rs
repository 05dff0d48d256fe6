use glam::{DAffine3, DQuat, DVec3};

use super::camera_fit::first_focal_px;
use super::*;
use crate::geometry::pose::rotation_between;
use crate::tracking::pose::{self, CornerObservation};

const SIZE_PX: [u32; 2] = [640, 480];

/// Six markers about a table's edge.
fn board() -> Vec<Marker> {
    let family = Family::TAG36H11;
    let place = |k: usize| DVec2::new([-0.175, 0.0, 0.175][k % 3], [0.115, -0.115][k / 3]);
    (0..6)
        .map(|k| Marker::alone(family, k as u32, 0.045).in_plane(place(k), 0.0))
        .collect()
}

fn camera(focal_px: f64, distortion: Distortion) -> Intrinsics {
    Intrinsics {
        size_px: SIZE_PX,
        focal_px: DVec2::new(focal_px, focal_px),
        center_px: DVec2::new(325.0, 234.0),
        distortion,
    }
}

/// A camera that looks at the board, tilted and turned.
fn pose(tilt_deg: f64, turn_deg: f64, distance_m: f64) -> DAffine3 {
    let facing = DQuat::from_rotation_x(std::f64::consts::PI);
    let tilt = DQuat::from_rotation_x(tilt_deg.to_radians());
    let turn = DQuat::from_rotation_z(turn_deg.to_radians());
    DAffine3::from_rotation_translation(tilt * facing * turn, DVec3::new(0.01, -0.02, distance_m))
}

/// Evenly spread errors with this standard deviation, of a fixed seed.
fn noise(deviation_px: f64) -> impl FnMut() -> DVec2 {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    move || deviation_px * 12.0_f64.sqrt() * DVec2::new(uniform(), uniform())
}

/// The corners that a camera sees of markers printed larger than they should be by a part of their size.
fn seen(
    markers: &[Marker],
    camera: &Intrinsics,
    camera_from_board: &DAffine3,
    size_error: f64,
    noise: &mut impl FnMut() -> DVec2,
) -> Vec<Detection> {
    let ways = [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)].map(DVec2::from);
    markers
        .iter()
        .map(|marker| Detection {
            family: marker.family,
            id: marker.id,
            corners_px: ways.map(|way| {
                let turned = DVec2::from_angle(marker.rotation_rad()).rotate(way);
                let size_m = marker.size_m * (1.0 + size_error);
                let board_m = marker.center_m() + (turned * size_m).extend(0.0);
                let in_camera_m = camera_from_board.transform_point3(board_m);
                camera.pixel_of(in_camera_m).unwrap() + noise()
            }),
            margin: 0.0,
            corrected_bits: 0,
        })
        .collect()
}

fn learner(markers: &[Marker]) -> CameraLearner {
    let anchor = Anchor {
        name: "table".to_owned(),
        markers: markers.to_vec(),
    };
    CameraLearner::of_anchors(&TrackingSettings::default(), &[anchor], SIZE_PX).unwrap()
}

fn learnt(
    markers: &[Marker],
    camera: &Intrinsics,
    poses: &[DAffine3],
    size_error: f64,
    noise_px: f64,
) -> LearntCamera {
    let mut learner = learner(markers);
    let mut noise = noise(noise_px);
    for pose in poses {
        learner.take(&seen(markers, camera, pose, size_error, &mut noise));
    }
    learner.finish()
}

fn all_round(tilts_deg: &[f64]) -> Vec<DAffine3> {
    let tilts = tilts_deg.iter().enumerate();
    tilts
        .flat_map(|(k, &tilt_deg)| {
            (0..5).map(move |turn| {
                let turn_deg = 72.0 * f64::from(turn) + 31.0 * k as f64;
                pose(tilt_deg, turn_deg, 0.6 + 0.03 * f64::from(turn))
            })
        })
        .collect()
}

#[test]
fn exact_corners_give_the_exact_focal_length_at_once() {
    for focal_px in [380.0, 554.0, 615.0, 1100.0] {
        let mut straight = camera(focal_px, Distortion::NONE);
        straight.center_px = guessed_intrinsics(SIZE_PX).center_px;
        let scale = focal_px / 615.0;
        let views: Vec<View> = all_round(&[30.0, 45.0])
            .into_iter()
            .map(|mut pose| {
                pose.translation.z *= scale;
                let seen = seen(&board(), &straight, &pose, 0.0, &mut noise(0.0));
                let markers: Vec<(Marker, [DVec2; 4])> = (board().into_iter())
                    .zip(seen.iter().map(|seen| seen.corners_px))
                    .collect();
                View::of(0, &markers).unwrap()
            })
            .collect();
        let views: Vec<&[BoardCorner]> = views.iter().map(|view| &view.corners[..]).collect();
        let first = first_focal_px(SIZE_PX, &views);
        assert!((first / focal_px - 1.0).abs() < 1e-6, "{focal_px}: {first}");
    }
}

#[test]
fn views_from_all_round_tell_a_bent_camera_and_how_surely() {
    let mut apart = Vec::new();
    for (k, focal_px) in [420.0, 500.0, 615.0, 800.0, 1000.0].into_iter().enumerate() {
        for (k1, size_error) in [(0.0, 0.0), (-0.12, -0.02), (0.08, 0.01)] {
            let truth = camera(focal_px, Distortion::Polynomial([k1, 0.02, 0.0, 0.0, 0.0]));
            let mut poses = all_round(&[20.0, 35.0, 50.0]);
            for pose in &mut poses {
                pose.translation.z *= focal_px / 615.0;
            }
            let found = learnt(&board(), &truth, &poses, size_error, 0.05 + 0.05 * k as f64);
            let error = (found.intrinsics.focal_px.x / focal_px).ln();
            assert!(found.is_sure(), "{focal_px} {k1}: {found:?}");
            assert!(error.abs() < 0.01, "{focal_px} {k1}: {error}");
            apart.push(error / found.focal_deviation);
        }
    }
    let squares: f64 = apart.iter().map(|apart| apart * apart).sum();
    let rms = (squares / apart.len() as f64).sqrt();
    // As sure as it says, and not wildly modest.
    assert!((0.2..1.5).contains(&rms), "{rms}: {apart:?}");
    assert!(apart.iter().all(|apart| apart.abs() < 3.0), "{apart:?}");
}

#[test]
fn what_does_not_tell_the_focal_length_leaves_it_open() {
    let truth = camera(800.0, Distortion::NONE);
    // Square to the camera, near and far, nothing tells distance from focal length.
    let square: Vec<DAffine3> = (0..8)
        .map(|k| pose(0.0, 40.0 * f64::from(k), 0.7 + 0.1 * f64::from(k)))
        .collect();
    let found = learnt(&board(), &truth, &square, 0.0, 0.1);
    assert!(
        !found.is_sure() && found.focal_deviation > 0.05,
        "{found:?}"
    );
    let none = learnt(&board(), &truth, &[], 0.0, 0.1);
    assert_eq!(none, LearntCamera::guess(SIZE_PX));
    let once = learnt(&board(), &truth, &[pose(40.0, 20.0, 0.7)], 0.0, 0.1);
    assert!(!once.is_sure(), "{once:?}");
    let off = (once.intrinsics.focal_px.x / 800.0).ln().abs();
    assert!(off < 3.0 * once.focal_deviation, "{off} {once:?}");
}

#[test]
fn a_still_camera_gives_one_view_and_a_long_film_no_more_than_are_worth_it() {
    let truth = camera(615.0, Distortion::NONE);
    let mut learner = learner(&board());
    let mut noise = noise(0.1);
    for _ in 0..50 {
        learner.take(&seen(
            &board(),
            &truth,
            &pose(30.0, 10.0, 0.7),
            0.0,
            &mut noise,
        ));
    }
    assert_eq!(learner.views.len(), 1);
    // Frontal ones make room for those that tell more.
    for tilt_deg in [0.0, 45.0] {
        for k in 0..60 {
            let pose = pose(tilt_deg, 6.0 * f64::from(k), 0.7);
            learner.take(&seen(&board(), &truth, &pose, 0.0, &mut noise));
        }
    }
    assert_eq!(learner.views.len(), MOST_VIEWS);
    let found = learner.finish();
    assert!(
        (found.intrinsics.focal_px.x / 615.0 - 1.0).abs() < 0.01,
        "{found:?}"
    );
}

#[test]
fn prints_that_are_turned_and_a_marker_that_moved_do_no_harm() {
    let truth = camera(615.0, Distortion::NONE);
    let turned: Vec<Marker> = (board().into_iter())
        .map(|marker| marker.in_plane(marker.center_m().truncate(), 2.0 * FRAC_PI_2))
        .collect();
    let poses = all_round(&[25.0, 45.0]);
    let mut learner = learner(&board());
    let mut noise = noise(0.1);
    for (k, pose) in poses.iter().enumerate() {
        let mut detections = seen(&turned, &truth, pose, 0.0, &mut noise);
        if k % 5 == 0 {
            for corner in &mut detections[3].corners_px {
                *corner += DVec2::new(5.0, 0.0);
            }
        }
        learner.take(&detections);
    }
    let found = learner.finish();
    assert!(
        (found.intrinsics.focal_px.x / 615.0 - 1.0).abs() < 0.02,
        "{found:?}"
    );
}

#[test]
fn the_camera_that_is_learnt_gives_the_poses_that_the_true_one_has() {
    let truth = camera(700.0, Distortion::Polynomial([-0.08, 0.0, 0.0, 0.0, 0.0]));
    let found = learnt(&board(), &truth, &all_round(&[20.0, 35.0, 50.0]), 0.0, 0.1);
    let there = pose(33.0, 100.0, 0.8);
    let seen = seen(&board(), &truth, &there, 0.0, &mut noise(0.1));
    let posed = |camera: &Intrinsics| {
        let corners = board().into_iter().zip(&seen).flat_map(|(marker, seen)| {
            let ways = [(-0.5, 0.5), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5)];
            let points =
                ways.map(|way| marker.center_m() + DVec2::from(way).extend(0.0) * marker.size_m);
            points.into_iter().zip(seen.corners_px)
        });
        let observations: Vec<CornerObservation> = corners
            .map(|(point_m, pixel)| CornerObservation {
                point_m,
                pixel: camera.undistorted_pixel(pixel).unwrap(),
            })
            .collect();
        let solved = pose::solve(camera, &observations).unwrap();
        assert!(!solved.ambiguous);
        solved.best
    };
    let (learnt, guessed) = (
        posed(&found.intrinsics),
        posed(&guessed_intrinsics(SIZE_PX)),
    );
    let off = |pose: &DAffine3| {
        let distance = (pose.translation.length() / there.translation.length() - 1.0).abs();
        (distance, rotation_between(pose, &there).to_degrees())
    };
    let (distance, turn_deg) = off(&learnt.camera_from_anchor);
    assert!(distance < 0.01 && turn_deg < 0.5, "{distance} {turn_deg}°");
    assert!(off(&guessed.camera_from_anchor).0 > 0.1);
    assert!(learnt.squared_error_px < 0.2 * guessed.squared_error_px);
}

#[test]
fn words_tell_how_sure_it_is() {
    let guess = LearntCamera::guess(SIZE_PX);
    assert_eq!(guess.in_words(), "focal length 554.6 ± 194.1 px, guessed");
    let sure = LearntCamera {
        focal_deviation: 0.005,
        basis: CameraBasis::Views(12),
        ..guess
    };
    assert_eq!(
        sure.in_words(),
        "focal length 554.6 ± 2.8 px, learnt from 12 views of the markers"
    );
    assert!(sure.is_sure() && sure.replaces(&guess) && !guess.replaces(&sure));
    // What was kept of another camera is given up.
    let mut other = guess.intrinsics;
    other.focal_px *= 1.2;
    let kept = LearntCamera::kept(other);
    assert!(kept.is_sure() && sure.replaces(&kept));
    assert!(
        !LearntCamera {
            focal_deviation: 0.009,
            ..sure
        }
        .replaces(&LearntCamera::kept(guess.intrinsics))
    );
}
