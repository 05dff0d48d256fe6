//! Boards that are not flat: cubes, corners of rooms and things that stand before others, as rendered sheets, with their true
//! poses as the oracle.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::geometry::pose::rotation_between;
use gnomon::scene::{Anchor, DetectorKind, Family, Marker, TrackingSettings};
use gnomon::tracking::mapping::{
    BoardShape, LearntBoard, MapError, MapSettings, ShapeWanted, SpaceFrame, learn_board,
};
use gnomon::tracking::{AnchorPose, Detection, Status, Tracker};

use crate::common::random::Random;
use crate::common::sheets::{
    CAMERA, FRAME_SECS, Light, anchor, cube_sides, settings, tracker, true_corners_px, with_noise,
};

/// Side of a cube's markers, half of the cube's, metres.
const MARKER_M: f64 = 0.04;

fn placed(id: u32, size_m: f64, at_m: DVec3, turn: DQuat) -> Marker {
    Marker {
        anchor_from_marker: DAffine3::from_rotation_translation(turn, at_m),
        ..Marker::alone(Family::TAG36H11, id, size_m)
    }
}

/// Markers 0 to 5 on the sides of a cube around the origin, each turned in its own way.
fn cube() -> Vec<Marker> {
    (0..6)
        .zip(cube_sides())
        .map(|(id, side)| {
            let turn = side * DQuat::from_rotation_z(f64::from(id) * FRAC_PI_2);
            placed(id, MARKER_M, side * DVec3::Z * MARKER_M, turn)
        })
        .collect()
}

/// Three walls that meet, seen from within: two markers on each.
fn room_corner() -> Vec<Marker> {
    let floor = [DVec2::new(0.08, 0.06), DVec2::new(0.2, 0.12)];
    let walls = [
        DQuat::IDENTITY,
        // x, y, z go on to y, z, x, and to z, x, y.
        DQuat::from_mat3(&glam::DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X)),
        DQuat::from_mat3(&glam::DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y)),
    ];
    let ids = 0..6;
    ids.map(|id: u32| {
        let wall = walls[id as usize / 2];
        let at_m = wall * floor[id as usize % 2].extend(0.0);
        placed(id, 0.05, at_m, wall)
    })
    .collect()
}

fn photograph(markers: &[Marker], pose: &DAffine3) -> Light {
    Light::of_boards(&CAMERA, &[(markers, *pose)])
}

fn random_turn(random: &mut Random) -> DQuat {
    let axis = DVec3::new(
        random.between(-1.0, 1.0),
        random.between(-1.0, 1.0),
        random.between(-1.0, 1.0),
    );
    DQuat::from_axis_angle(axis.normalize_or(DVec3::X), random.between(0.0, PI))
}

/// Of a pose that was found: turn, degrees, and shift over the distance.
fn errors(found: &AnchorPose, truth: &DAffine3) -> (f64, f64) {
    let pose = found.camera_from_anchor.expect("a pose");
    let shift_m = pose.translation.distance(truth.translation);
    (
        rotation_between(&pose, truth).to_degrees(),
        shift_m / truth.translation.length(),
    )
}

#[test]
fn a_cube_has_its_pose_from_wherever_it_is_seen() {
    let mut random = Random::new(21);
    let anchors = [anchor("cube", &cube())];
    let (mut sure, mut doubtful, mut faces) = (0, 0, 0);
    let mut turns_deg = Vec::new();
    for k in 0..60 {
        let at_m = DVec3::new(
            random.between(-0.05, 0.05),
            random.between(-0.04, 0.04),
            random.between(0.3, 0.8),
        );
        let truth = DAffine3::from_rotation_translation(random_turn(&mut random), at_m);
        let frame = with_noise(&photograph(&cube(), &truth).frame(0.0), 2.0, k);
        let mut tracker = tracker(&settings(DetectorKind::ByFamily), &anchors, CAMERA);
        let pose = tracker.track(&frame).unwrap().remove(0);
        match pose.status {
            Status::Tracked => {
                let (turn_deg, shift) = errors(&pose, &truth);
                assert!(
                    turn_deg < 2.0 && shift < 0.01,
                    "{k}: {turn_deg}°, {shift}, {} faces, {truth}",
                    pose.markers
                );
                turns_deg.push(turn_deg);
                sure += 1;
                faces += pose.markers;
            }
            Status::Ambiguous => doubtful += 1,
            status => panic!("{k}: {status:?} at {truth}"),
        }
    }
    turns_deg.sort_by(f64::total_cmp);
    eprintln!(
        "{sure} sure, {doubtful} doubtful, {faces} faces, median {:.3}°, worst {:.3}°",
        turns_deg[turns_deg.len() / 2],
        turns_deg[turns_deg.len() - 1]
    );
    assert!(sure >= 56, "{sure} of 60");
    assert!(faces > 2 * sure, "{faces} faces in {sure} pictures");
}

#[test]
fn a_cube_that_is_turned_in_the_hand_is_followed_over_all_its_faces() {
    let anchors = [anchor("cube", &cube())];
    let mut tracker = tracker(&settings(DetectorKind::ByFamily), &anchors, CAMERA);
    let mut seen = std::collections::BTreeSet::new();
    let mut turns_deg = Vec::new();
    for k in 0..150 {
        let time_secs = f64::from(k) * FRAME_SECS;
        // Half a turn a second about an axis that turns itself.
        let turn = DQuat::from_rotation_x(0.9 * time_secs)
            * DQuat::from_rotation_y(PI * time_secs)
            * DQuat::from_rotation_x(0.4);
        let at_m = DVec3::new(0.05 * time_secs.sin(), 0.03 * (1.3 * time_secs).cos(), 0.45);
        let truth = DAffine3::from_rotation_translation(turn, at_m);
        let frame = with_noise(&photograph(&cube(), &truth).frame(time_secs), 2.0, k as u64);
        let pose = tracker.track(&frame).unwrap().remove(0);
        let (turn_deg, shift) = errors(&pose, &truth);
        assert!(
            turn_deg < 2.0 && shift < 0.01,
            "frame {k}: {turn_deg}°, {shift}, {:?}, {} faces",
            pose.status,
            pose.markers
        );
        assert_eq!(pose.status, Status::Tracked, "frame {k}");
        turns_deg.push(turn_deg);
        for used in tracker.used_markers() {
            let marker = &cube()[used.id as usize];
            let faces = truth.transform_vector3(marker.normal());
            let to_eye = -truth.transform_point3(marker.center_m());
            assert!(
                faces.dot(to_eye) > 0.0,
                "frame {k}: {} is turned away",
                used.id
            );
            seen.insert(used.id);
        }
    }
    turns_deg.sort_by(f64::total_cmp);
    eprintln!("median {:.3}°, worst {:.3}°", turns_deg[75], turns_deg[149]);
    assert_eq!(seen.len(), 6, "{seen:?}");
}

#[test]
fn a_corner_of_a_room_is_one_board() {
    let markers = room_corner();
    let anchors = [anchor("corner", &markers)];
    let mut random = Random::new(5);
    for k in 0..10 {
        // From within, towards the corner.
        let eye_m = DVec3::new(
            random.between(0.3, 0.5),
            random.between(0.3, 0.5),
            random.between(0.3, 0.5),
        );
        let truth = looking_at(eye_m, DVec3::splat(0.05));
        let frame = with_noise(&photograph(&markers, &truth).frame(0.0), 2.0, k);
        let mut tracker = tracker(&settings(DetectorKind::ByFamily), &anchors, CAMERA);
        let pose = tracker.track(&frame).unwrap().remove(0);
        let (turn_deg, shift) = errors(&pose, &truth);
        assert!(turn_deg < 0.2 && shift < 2e-3, "{k}: {turn_deg}°, {shift}");
        assert!(pose.markers >= 5, "{k}: {} markers", pose.markers);
        assert!(pose.alternative.is_none() || pose.status == Status::Tracked);
    }
}

/// A camera at a place in the world that looks at a point, its picture's top towards the world's z.
fn looking_at(eye_m: DVec3, point_m: DVec3) -> DAffine3 {
    let z = (point_m - eye_m).normalize();
    let x = z.cross(DVec3::Z).normalize();
    let world_from_camera =
        DAffine3::from_mat3_translation(glam::DMat3::from_cols(x, z.cross(x), z), eye_m);
    world_from_camera.inverse()
}

#[test]
fn what_stands_before_a_marker_does_not_bend_the_pose() {
    // A large marker on the floor, half behind a smaller one that stands upright before it.
    let markers = [
        placed(0, 0.12, DVec3::new(0.0, 0.1, 0.0), DQuat::IDENTITY),
        placed(
            1,
            0.06,
            DVec3::new(0.02, 0.0, 0.06),
            DQuat::from_rotation_x(FRAC_PI_2),
        ),
        placed(2, 0.05, DVec3::new(-0.12, 0.0, 0.0), DQuat::IDENTITY),
    ];
    let anchors = [anchor("desk", &markers)];
    for k in 0..8 {
        let eye_m = DVec3::new(0.02 * f64::from(k) - 0.08, -0.4, 0.2);
        let truth = looking_at(eye_m, DVec3::new(0.0, 0.05, 0.03));
        let frame = with_noise(&photograph(&markers, &truth).frame(0.0), 2.0, k as u64);
        let mut tracker = tracker(&settings(DetectorKind::ByFamily), &anchors, CAMERA);
        let pose = tracker.track(&frame).unwrap().remove(0);
        let (turn_deg, shift) = errors(&pose, &truth);
        assert!(turn_deg < 0.5 && shift < 5e-3, "{k}: {turn_deg}°, {shift}");
    }
}

#[test]
fn a_flat_board_in_another_plane_than_its_frame_s_is_tracked_as_one() {
    // The same sheet, described in a frame that is tilted and elsewhere.
    let sheet: Vec<Marker> = [(0, -0.06, 0.04), (1, 0.06, 0.04), (2, -0.06, -0.04)]
        .map(|(id, x, y)| Marker::alone(Family::TAG36H11, id, 0.05).in_plane(DVec2::new(x, y), 0.2))
        .to_vec();
    let frame_from_sheet = DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(1.1) * DQuat::from_rotation_z(0.7),
        DVec3::new(0.3, -0.2, 0.1),
    );
    let moved: Vec<Marker> = sheet
        .iter()
        .map(|marker| Marker {
            anchor_from_marker: frame_from_sheet * marker.anchor_from_marker,
            ..*marker
        })
        .collect();
    let board = Anchor {
        name: "sheet".into(),
        markers: moved,
    };
    assert!(board.is_flat());
    let truth = crate::common::sheets::camera_above(30.0, 20.0, DVec3::new(0.0, 0.0, 0.5));
    let frame = photograph(&sheet, &truth).frame(0.0);
    let track = |anchors: &[Anchor]| {
        let mut tracker = Tracker::new(&TrackingSettings::default(), anchors, CAMERA).unwrap();
        tracker.track(&frame).unwrap().remove(0)
    };
    let (flat, tilted) = (track(&[anchor("sheet", &sheet)]), track(&[board]));
    assert_eq!((tilted.status, tilted.markers), (flat.status, flat.markers));
    let expected = flat.camera_from_anchor.unwrap() * frame_from_sheet.inverse();
    let found = tilted.camera_from_anchor.unwrap();
    assert!(found.abs_diff_eq(expected, 1e-4), "{found} {expected}");
}

/// What a detector with even errors of so many pixels sees of markers from poses; those that face away are not seen.
fn seen_from(
    random: &mut Random,
    markers: &[Marker],
    poses: &[DAffine3],
    noise_px: f64,
) -> Vec<Vec<Detection>> {
    let look = |pose: &DAffine3| {
        let faces = |marker: &&Marker| {
            let center_m = pose.transform_point3(marker.center_m()).normalize();
            pose.transform_vector3(marker.normal()).dot(center_m) < -0.2
        };
        let seen = markers.iter().filter(faces).map(|marker| Detection {
            family: marker.family,
            id: marker.id,
            corners_px: true_corners_px(&CAMERA, marker, pose).map(|corner_px| {
                corner_px
                    + noise_px * DVec2::new(random.between(-1.0, 1.0), random.between(-1.0, 1.0))
            }),
            margin: 100.0,
            corrected_bits: 0,
        });
        seen.collect()
    };
    poses.iter().map(look).collect()
}

const MAP: MapSettings = MapSettings {
    size_m: MARKER_M,
    gauge: None,
    learns_sizes: false,
    plane_tolerance_m: 0.002,
    shape: ShapeWanted::AsSeen,
};

fn learn(pictures: &[Vec<Detection>], settings: &MapSettings) -> Result<LearntBoard, MapError> {
    learn_board(&CAMERA, Family::TAG36H11, pictures, settings)
}

/// The farthest that a learnt marker's corner is from the truth, metres, once the gauge is laid on the gauge.
fn worst_m(learnt: &LearntBoard, truth: &[Marker]) -> f64 {
    let of = |id: u32| truth.iter().find(|marker| marker.id == id).unwrap();
    let gauge = learnt
        .markers
        .iter()
        .find(|it| it.marker.id == learnt.gauge);
    let gauge = gauge.unwrap().marker.anchor_from_marker;
    let truth_from_learnt = of(learnt.gauge).anchor_from_marker * gauge.inverse();
    let off_m = learnt.markers.iter().flat_map(|learnt| {
        let corners = learnt.marker.corners_m().into_iter();
        corners
            .zip(of(learnt.marker.id).corners_m())
            .map(move |(found, truth)| truth_from_learnt.transform_point3(found).distance(truth))
    });
    off_m.fold(0.0, f64::max)
}

fn around(random: &mut Random, count: u32) -> Vec<DAffine3> {
    (0..count)
        .map(|_| {
            let at_m = DVec3::new(0.0, 0.0, random.between(0.3, 0.5));
            DAffine3::from_rotation_translation(random_turn(random), at_m)
        })
        .collect()
}

#[test]
fn the_layout_of_a_cube_is_learnt_without_a_plane() {
    let mut random = Random::new(8);
    let poses = around(&mut random, 60);
    let exact = seen_from(&mut random, &cube(), &poses, 0.0);
    let learnt = learn(&exact, &MAP).unwrap();
    let BoardShape::Space { off, frame } = &learnt.shape else {
        panic!("{:?}", learnt.shape)
    };
    assert!(off.len() >= 4 && *frame == SpaceFrame::Gauge, "{off:?}");
    assert!(
        worst_m(&learnt, &cube()) < 1e-6,
        "{}",
        worst_m(&learnt, &cube())
    );
    assert!(
        learnt.markers[0]
            .marker
            .anchor_from_marker
            .abs_diff_eq(DAffine3::IDENTITY, 1e-12)
    );

    let noisy = seen_from(&mut random, &cube(), &poses, 0.3);
    let learnt = learn(&noisy, &MAP).unwrap();
    let off_m = worst_m(&learnt, &cube());
    assert!(off_m < 6e-4, "{off_m} m");
    let deviation_m = learnt.markers[5].center_deviation_m.length();
    let opposite = learnt.markers[5].marker.center_m();
    let error_m = opposite.distance(DVec3::new(0.0, 0.0, -2.0 * MARKER_M));
    assert!(error_m < 4.0 * deviation_m, "{error_m} m, {deviation_m} m");

    // Sizes as well, which no plane gives.
    let mut sized = cube();
    for (k, marker) in sized.iter_mut().enumerate().skip(1) {
        marker.size_m = 0.025 + 0.003 * k as f64;
    }
    let pictures = seen_from(&mut random, &sized, &poses, 0.1);
    let settings = MapSettings {
        learns_sizes: true,
        ..MAP
    };
    let learnt = learn(&pictures, &settings).unwrap();
    for (learnt, truth) in learnt.markers.iter().zip(&sized) {
        assert!(
            (learnt.marker.size_m - truth.size_m).abs() < 3e-4,
            "{learnt:?}"
        );
    }

    let flat = MapSettings {
        shape: ShapeWanted::Flat,
        ..MAP
    };
    let error = learn(&noisy, &flat).unwrap_err();
    assert!(matches!(error, MapError::NotPlanar { .. }), "{error}");
}

#[test]
fn a_table_with_something_upright_on_it_keeps_the_table_s_plane() {
    let mut markers: Vec<Marker> = (0..6)
        .map(|id: u32| {
            let at_m = DVec2::new(0.1 * f64::from(id % 3), 0.12 * f64::from(id / 3));
            Marker::alone(Family::TAG36H11, id, MARKER_M).in_plane(at_m, 0.3 * f64::from(id))
        })
        .collect();
    markers.push(placed(
        17,
        MARKER_M,
        DVec3::new(0.1, 0.06, 0.03),
        DQuat::from_rotation_x(FRAC_PI_2),
    ));
    let mut random = Random::new(3);
    let poses: Vec<DAffine3> = (0..40)
        .map(|k| {
            let way = DVec2::from_angle(f64::from(k) * PI / 20.0);
            let eye_m = DVec3::new(
                0.1 + 0.4 * way.x,
                0.06 + 0.4 * way.y,
                random.between(0.25, 0.5),
            );
            looking_at(eye_m, DVec3::new(0.1, 0.06, 0.0))
        })
        .collect();
    let pictures = seen_from(&mut random, &markers, &poses, 0.2);
    let learnt = learn(&pictures, &MAP).unwrap();
    let BoardShape::Space { off, frame } = &learnt.shape else {
        panic!("{:?}", learnt.shape)
    };
    assert_eq!(
        (off.len(), off[0].0, *frame),
        (1, 17, SpaceFrame::PlaneOfMost)
    );
    // What lies on the table lies there, more evenly than one marker tells.
    for on_table in &learnt.markers[..6] {
        let corners_m = on_table.marker.corners_m();
        assert!(
            corners_m.iter().all(|corner_m| corner_m.z.abs() < 4e-4),
            "{on_table:?}"
        );
    }
    assert!(worst_m(&learnt, &markers) < 1e-3);
    // The same without it is flat, unless space is asked for.
    let pictures = seen_from(&mut random, &markers[..6], &poses, 0.2);
    assert_eq!(learn(&pictures, &MAP).unwrap().shape, BoardShape::Flat);
    let space = MapSettings {
        shape: ShapeWanted::Space,
        ..MAP
    };
    let learnt = learn(&pictures, &space).unwrap();
    assert!(matches!(learnt.shape, BoardShape::Space { .. }));
    assert!(worst_m(&learnt, &markers) < 1e-3);
}
