//! Tracking against known answers: sheets rendered through a known camera, and photographs with real markers.

mod common;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use common::sheets::{CAMERA, WIDE_CAMERA, anchor, camera_above, marker, photograph};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::{
    Anchor, ArucoRefinement, Codes, DetectorKind, Family, Marker, TrackingSettings,
};
use gnomon::tracking::{AnchorPose, Detection, Detector, Status, Tracker, TrackingError, Why};

/// A picture with the noise of a camera in the dark: Gaussian, of a standard deviation in levels, the same each time.
fn with_noise(frame: &Frame, deviation: f64, seed: u64) -> Frame {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut uniform = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let mut noisy = frame.clone();
    for pixel in noisy.rgba.chunks_exact_mut(4) {
        let gaussian = (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let level = (f64::from(pixel[0]) + deviation * gaussian)
            .round()
            .clamp(0.0, 255.0) as u8;
        pixel[..3].fill(level);
    }
    noisy
}

fn grey_of(frame: &Frame) -> Vec<u8> {
    frame
        .rgba
        .chunks_exact(4)
        .map(|pixel| {
            let [r, g, b] = [pixel[0], pixel[1], pixel[2]].map(f64::from);
            (0.299 * r + 0.587 * g + 0.114 * b).round() as u8
        })
        .collect()
}

/// True corners as printed, distorted pixels.
fn true_corners_px(
    camera: &Intrinsics,
    marker: &Marker,
    camera_from_anchor: &DAffine3,
) -> [DVec2; 4] {
    let half_m = marker.size_m / 2.0;
    let turn = DVec2::from_angle(marker.rotation_rad);
    [
        (-half_m, half_m),
        (half_m, half_m),
        (half_m, -half_m),
        (-half_m, -half_m),
    ]
    .map(|corner| {
        let point_m = marker.center_m + turn.rotate(DVec2::from(corner));
        let in_camera = camera_from_anchor.transform_point3(point_m.extend(0.0));
        camera.pixel_from_plane(camera.distort(in_camera.truncate() / in_camera.z))
    })
}

fn settings(detector: DetectorKind) -> TrackingSettings {
    TrackingSettings {
        detector,
        ..TrackingSettings::default()
    }
}

fn angle_between(a: &DAffine3, b: &DAffine3) -> f64 {
    DQuat::from_mat3(&a.matrix3)
        .angle_between(DQuat::from_mat3(&b.matrix3))
        .to_degrees()
}

fn assert_pose(found: &AnchorPose, truth: &DAffine3, within_mm: f64, within_deg: f64, what: &str) {
    let pose = found
        .camera_from_anchor
        .unwrap_or_else(|| panic!("{what}: lost"));
    let off_mm = (pose.translation - truth.translation).length() * 1000.0;
    let off_deg = angle_between(&pose, truth);
    assert!(
        off_mm < within_mm && off_deg < within_deg,
        "{what}: {off_mm:.2} mm and {off_deg:.2}° off"
    );
}

/// No corner is farther off than `within_px`, and all together are shifted by less than a fifth of a half pixel each
/// way.
fn assert_corners(
    found: &[Detection],
    markers: &[Marker],
    camera: &Intrinsics,
    truth: &DAffine3,
    within_px: f64,
    what: &str,
) {
    let mut shift = DVec2::ZERO;
    for detection in found {
        let is_it =
            |marker: &&Marker| (marker.family, marker.id) == (detection.family, detection.id);
        let true_corners_px = true_corners_px(
            camera,
            markers.iter().find(is_it).expect("a marker of this id"),
            truth,
        );
        for (k, true_corner_px) in true_corners_px.into_iter().enumerate() {
            let off = detection.corners_px[k] - true_corner_px;
            assert!(
                off.length() < within_px,
                "{what}: {} corner {k} is off by {off:.3}",
                detection.id
            );
            shift += off / (4.0 * found.len() as f64);
        }
    }
    assert!(
        shift.abs().max_element() < 0.12,
        "{what}: all are shifted by {shift:.3}"
    );
}

fn detect(settings: &TrackingSettings, families: &[Family], frame: &Frame) -> Vec<Detection> {
    Detector::new(settings, families)
        .expect("a detector")
        .detect(&grey_of(frame), frame.size_px)
        .expect("detections")
}

fn ids(detections: &[Detection]) -> Vec<u32> {
    detections.iter().map(|detection| detection.id).collect()
}

fn track_once(
    settings: &TrackingSettings,
    anchors: &[Anchor],
    camera: Intrinsics,
    frame: &Frame,
) -> Vec<AnchorPose> {
    Tracker::new(settings, anchors, camera)
        .expect("a tracker")
        .track(frame)
        .expect("poses")
}

fn table() -> Vec<Marker> {
    vec![
        marker(0, 0.06, -0.09, 0.06),
        marker(1, 0.06, 0.09, 0.06),
        marker(2, 0.06, -0.09, -0.06),
        marker(17, 0.06, 0.09, -0.06),
    ]
}

// ---------------------------------------------------------------------------------------------------------------------

#[test]
fn both_detectors_find_the_corners_as_printed() {
    let markers = table();
    // Straight lines fitted to edges that the wide lens bends cost libapriltag and OpenCV the same 0.4 mm.
    for (camera, lens, corner_px, within_mm) in [
        (CAMERA, "pinhole", 0.3, 0.2),
        (WIDE_CAMERA, "wide lens", 0.6, 0.6),
    ] {
        for (tilt_deg, turn_deg) in [(0.0, 3.0), (25.0, 20.0), (30.0, 187.0), (35.0, -100.0)] {
            let truth = camera_above(tilt_deg, turn_deg, DVec3::new(0.01, -0.005, 0.42));
            let frame = photograph(&camera, &[(&markers, truth)], 0.0);
            let mut poses = Vec::new();
            for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
                let what = format!("{kind:?}, {lens}, tilt {tilt_deg}, turn {turn_deg}");
                let found = detect(&settings(kind), &[Family::TAG36H11], &frame);
                assert_eq!(ids(&found), [0, 1, 2, 17], "{what}");
                assert_corners(&found, &markers, &camera, &truth, corner_px, &what);
                let pose = &track_once(
                    &settings(kind),
                    &[anchor("table", &markers)],
                    camera,
                    &frame,
                )[0];
                assert_eq!((pose.status, pose.markers), (Status::Tracked, 4), "{what}");
                assert!(
                    pose.reprojection_px < 0.2,
                    "{what}: {} px",
                    pose.reprojection_px
                );
                assert_pose(pose, &truth, within_mm, 0.1, &what);
                poses.extend(pose.camera_from_anchor);
            }
            let apart_mm = (poses[0].translation - poses[1].translation).length() * 1000.0;
            assert!(
                apart_mm < 0.2 && angle_between(&poses[0], &poses[1]) < 0.1,
                "the detectors differ: {apart_mm} mm"
            );
        }
    }
}

#[test]
fn every_refinement_of_opencv_means_the_same_corners() {
    let markers = table();
    let truth = camera_above(25.0, 20.0, DVec3::new(0.01, -0.005, 0.42));
    let frame = photograph(&CAMERA, &[(&markers, truth)], 0.0);
    for (refinement, corner_px) in [
        (ArucoRefinement::None, 1.0),
        (ArucoRefinement::Subpixel, 0.45),
        (ArucoRefinement::Contour, 0.2),
        (ArucoRefinement::AprilTag, 0.2),
    ] {
        let settings = TrackingSettings {
            aruco_refinement: refinement,
            ..settings(DetectorKind::Aruco)
        };
        let what = format!("{refinement:?}");
        let found = detect(&settings, &[Family::TAG36H11], &frame);
        assert_eq!(ids(&found), [0, 1, 2, 17], "{what}");
        assert_corners(&found, &markers, &CAMERA, &truth, corner_px, &what);
    }
}

#[test]
fn opencv_s_own_dictionaries_are_not_turned() {
    let family = Family::of(Codes::Aruco {
        cells: 4,
        count: 50,
    });
    let own = Marker {
        family,
        ..marker(0, 0.07, -0.07, 0.0)
    };
    // A tag beside it, to have two dictionaries at work.
    let markers = [own, marker(1, 0.07, 0.07, 0.0)];
    let truth = camera_above(20.0, 15.0, DVec3::new(0.0, 0.0, 0.4));
    let frame = photograph(&CAMERA, &[(&markers, truth)], 0.0);
    let settings = settings(DetectorKind::Aruco);
    let found = detect(&settings, &[family, Family::TAG36H11], &frame);
    assert_eq!(ids(&found), [1, 0], "sorted by family");
    assert_corners(&found, &markers, &CAMERA, &truth, 0.25, "two dictionaries");
    let pose = &track_once(&settings, &[anchor("both", &markers)], CAMERA, &frame)[0];
    assert_eq!(pose.markers, 2);
    assert_pose(pose, &truth, 0.4, 0.2, "two dictionaries");
}

#[test]
fn one_id_in_two_borders_is_two_markers() {
    let wide = Family::TAG36H11.with_border(2).expect("a border");
    let in_wide = |marker: Marker| Marker {
        family: wide,
        ..marker
    };
    let usual_board = [marker(0, 0.06, -0.05, 0.0), marker(1, 0.06, 0.05, 0.0)];
    let wide_board = [
        in_wide(marker(1, 0.07, -0.055, 0.0)),
        in_wide(marker(17, 0.07, 0.055, 0.0)),
    ];
    let usual_truth = camera_above(25.0, 20.0, DVec3::new(-0.1, 0.0, 0.45));
    let wide_truth = camera_above(30.0, -100.0, DVec3::new(0.12, 0.0, 0.45));
    let frame = photograph(
        &CAMERA,
        &[(&usual_board, usual_truth), (&wide_board, wide_truth)],
        0.0,
    );
    let anchors = [anchor("usual", &usual_board), anchor("wide", &wide_board)];
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let what = format!("{kind:?}");
        let found = detect(&settings(kind), &[wide, Family::TAG36H11], &frame);
        let seen: Vec<_> = found.iter().map(|seen| (seen.family, seen.id)).collect();
        let usual = Family::TAG36H11;
        assert_eq!(
            seen,
            [(usual, 0), (usual, 1), (wide, 1), (wide, 17)],
            "{what}"
        );
        assert_corners(&found[..2], &usual_board, &CAMERA, &usual_truth, 0.3, &what);
        assert_corners(&found[2..], &wide_board, &CAMERA, &wide_truth, 0.3, &what);
        let poses = track_once(&settings(kind), &anchors, CAMERA, &frame);
        for (pose, truth) in poses.iter().zip([usual_truth, wide_truth]) {
            assert_eq!(pose.markers, 2, "{what}");
            assert_pose(pose, &truth, 0.4, 0.2, &what);
        }
        // Who asks for one border gets that one alone.
        let ids_of = |family| ids(&detect(&settings(kind), &[family], &frame));
        assert_eq!(
            (ids_of(usual), ids_of(wide)),
            (vec![0, 1], vec![1, 17]),
            "{what}"
        );
    }
}

#[test]
fn a_turned_marker_on_a_board_counts_with_its_turn() {
    let turned = Marker {
        rotation_rad: 0.7,
        ..marker(1, 0.06, 0.08, 0.02)
    };
    let markers = [marker(0, 0.06, -0.08, 0.0), turned];
    let truth = camera_above(20.0, 40.0, DVec3::new(0.0, 0.0, 0.4));
    let frame = photograph(&CAMERA, &[(&markers, truth)], 0.0);
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let pose = &track_once(
            &settings(kind),
            &[anchor("table", &markers)],
            CAMERA,
            &frame,
        )[0];
        assert_eq!(pose.markers, 2);
        assert_pose(pose, &truth, 0.4, 0.2, &format!("{kind:?}"));
    }
}

#[test]
fn a_lone_marker_is_never_sure_of_the_wrong_pose() {
    let card = [marker(17, 0.036, 0.0, 0.0)];
    let anchors = [anchor("card", &card)];
    let (mut tracked, mut ambiguous, mut nearer_is_other) = (0, 0, 0);
    for tilt_deg in [2.0, 5.0, 10.0, 20.0, 45.0] {
        // 54, 31, 22 and 17 pixels a side.
        for distance_m in [0.4, 0.7, 1.0, 1.3] {
            let truth = camera_above(tilt_deg, 30.0, DVec3::new(0.02, 0.01, distance_m));
            let clean = photograph(&CAMERA, &[(&card, truth)], 0.0);
            for seed in 1..5 {
                let frame = with_noise(&clean, 3.0, seed);
                let settings = settings(DetectorKind::AprilTag);
                let pose = &track_once(&settings, &anchors, CAMERA, &frame)[0];
                let what = format!("tilt {tilt_deg}° at {distance_m} m");
                let found = pose
                    .camera_from_anchor
                    .unwrap_or_else(|| panic!("{what}: not seen"));
                let off_deg = angle_between(&found, &truth);
                let other_deg = pose.alternative.map_or(f64::INFINITY, |other| {
                    angle_between(&other.camera_from_anchor, &truth)
                });
                if pose.status == Status::Tracked {
                    tracked += 1;
                    assert!(off_deg < 2.0, "{what}: sure and {off_deg}° off");
                } else {
                    assert_eq!(
                        (pose.status, pose.why),
                        (Status::Ambiguous, Some(Why::TwoPoses))
                    );
                    ambiguous += 1;
                    nearer_is_other += usize::from(other_deg < off_deg);
                    assert!(
                        off_deg.min(other_deg) < 8.0,
                        "{what}: {off_deg}° and {other_deg}° off"
                    );
                }
            }
        }
    }
    eprintln!(
        "{tracked} tracked, {ambiguous} ambiguous, the other pose nearer in {nearer_is_other}"
    );
    assert!(
        tracked >= 50 && ambiguous >= 10,
        "{tracked} tracked, {ambiguous} ambiguous"
    );
}

#[test]
fn an_earlier_pose_decides_an_ambiguous_one_while_it_is_fresh() {
    let card = [marker(17, 0.036, 0.0, 0.0)];
    let anchors = [anchor("card", &card)];
    let at_m = DVec3::new(0.02, 0.01, 1.3);
    let unclear = camera_above(5.0, 30.0, at_m);
    let alone = with_noise(&photograph(&CAMERA, &[(&card, unclear)], 10.0), 3.0, 1);
    let first = &track_once(&settings(DetectorKind::AprilTag), &anchors, CAMERA, &alone)[0];
    assert_eq!(first.status, Status::Ambiguous);
    let [chosen, other] = [
        first.camera_from_anchor.unwrap(),
        first.alternative.unwrap().camera_from_anchor,
    ];
    // The same marker near and plain to see, once turned as either pose says.
    for (before, expected) in [(chosen, chosen), (other, other)] {
        // Along its tilt, far over to the side that it leans to.
        let frontal = camera_above(0.0, 30.0, at_m);
        let lean = before.matrix3 * frontal.matrix3.transpose();
        let (axis, angle) = DQuat::from_mat3(&lean).to_axis_angle();
        let plain = DAffine3::from_mat3_translation(
            DMat3::from_quat(DQuat::from_axis_angle(axis, angle.signum() * 0.75)) * frontal.matrix3,
            DVec3::new(0.0, 0.0, 0.3),
        );
        let plain = photograph(&CAMERA, &[(&card, plain)], 9.9);
        let mut tracker =
            Tracker::new(&settings(DetectorKind::AprilTag), &anchors, CAMERA).unwrap();
        assert_eq!(tracker.track(&plain).unwrap()[0].status, Status::Tracked);
        // It stays so, frame after frame.
        for frame in 0..8 {
            let seen = Frame {
                time_secs: 10.0 + f64::from(frame) / 30.0,
                ..alone.clone()
            };
            let now = &tracker.track(&seen).unwrap()[0];
            let off_deg = angle_between(&now.camera_from_anchor.unwrap(), &expected);
            assert!(off_deg < 2.0, "frame {frame}: {off_deg}°");
        }
        // Half a minute later the memory is worth nothing.
        let later = Frame {
            time_secs: 40.0,
            ..alone.clone()
        };
        let late = &tracker.track(&later).unwrap()[0];
        assert_eq!(late.status, Status::Ambiguous);
        assert!(angle_between(&late.camera_from_anchor.unwrap(), &chosen) < 0.5);
    }
}

#[test]
fn a_lost_marker_is_a_value() {
    let markers = table();
    let anchors = [
        anchor("table", &markers),
        anchor("elsewhere", &[marker(5, 0.05, 0.0, 0.0)]),
    ];
    let truth = camera_above(20.0, 10.0, DVec3::new(0.0, 0.0, 0.42));
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let mut tracker = Tracker::new(&settings(kind), &anchors, CAMERA).unwrap();
        let poses = tracker
            .track(&photograph(&CAMERA, &[(&markers, truth)], 0.0))
            .unwrap();
        assert_eq!(poses[0].status, Status::Tracked);
        let not_there = AnchorPose {
            why: Some(Why::NoMarker),
            ..AnchorPose::LOST
        };
        assert_eq!(poses[1], not_there);
        let nothing = photograph(&CAMERA, &[], 1.0);
        let poses = tracker.track(&nothing).unwrap();
        assert_eq!(poses, [not_there.clone(), not_there]);
        assert!(tracker.detections().is_empty());
    }
}

#[test]
fn of_two_markers_with_one_id_none_is_trusted_unless_the_board_decides() {
    let lone = [marker(17, 0.05, 0.0, 0.0)];
    let left = camera_above(20.0, 0.0, DVec3::new(-0.08, 0.0, 0.4));
    let right = camera_above(25.0, 40.0, DVec3::new(0.08, 0.0, 0.4));
    let twice = photograph(&CAMERA, &[(&lone, left), (&lone, right)], 0.0);
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        assert_eq!(
            ids(&detect(&settings(kind), &[Family::TAG36H11], &twice)),
            [17, 17]
        );
        let poses = track_once(&settings(kind), &[anchor("card", &lone)], CAMERA, &twice);
        assert_eq!(
            (poses[0].status, poses[0].why),
            (Status::Lost, Some(Why::DoubleId))
        );
        // A card with a copy of the board's own marker lies in the middle.
        let truth = camera_above(20.0, 10.0, DVec3::new(0.0, 0.0, 0.5));
        let intruder = [marker(17, 0.04, 0.0, 0.0)];
        let on_board = camera_above(20.0, 60.0, DVec3::new(0.0, 0.0, 0.5));
        let frame = photograph(&CAMERA, &[(&intruder, on_board), (&table(), truth)], 0.0);
        assert_eq!(
            ids(&detect(&settings(kind), &[Family::TAG36H11], &frame)),
            [0, 1, 2, 17, 17]
        );
        let pose = &track_once(
            &settings(kind),
            &[anchor("table", &table())],
            CAMERA,
            &frame,
        )[0];
        assert_eq!(pose.markers, 4, "the board knows where its own is");
        assert_pose(pose, &truth, 0.5, 0.2, &format!("{kind:?}"));
    }
}

#[test]
fn a_marker_in_the_wrong_place_does_not_bend_the_board() {
    let markers = table();
    let mut printed_wrong = table();
    printed_wrong[2].center_m.x += 0.01;
    let truth = camera_above(20.0, 10.0, DVec3::new(0.0, 0.0, 0.42));
    let frame = photograph(&CAMERA, &[(&printed_wrong, truth)], 0.0);
    let pose = &track_once(
        &settings(DetectorKind::AprilTag),
        &[anchor("table", &markers)],
        CAMERA,
        &frame,
    )[0];
    assert_eq!((pose.status, pose.markers), (Status::Tracked, 3));
    assert_pose(pose, &truth, 0.4, 0.2, "three of four");
}

#[test]
fn any_number_of_anchors_moves_on_its_own() {
    let table_markers = [
        marker(0, 0.05, -0.11, 0.07),
        marker(1, 0.05, 0.11, 0.07),
        marker(2, 0.05, -0.11, -0.07),
    ];
    let card = [marker(17, 0.05, 0.0, 0.0)];
    let anchors = [anchor("table", &table_markers), anchor("card", &card)];
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let mut tracker = Tracker::new(&settings(kind), &anchors, CAMERA).unwrap();
        for k in 0..4 {
            let step = f64::from(k);
            let table_pose = camera_above(25.0 + step, 5.0 * step, DVec3::new(0.0, 0.0, 0.5));
            let card_pose = camera_above(
                40.0 - 3.0 * step,
                20.0 * step,
                DVec3::new(0.01 * step, 0.02, 0.4),
            );
            let frame = photograph(
                &CAMERA,
                &[(&card, card_pose), (&table_markers, table_pose)],
                step / 30.0,
            );
            let poses = tracker.track(&frame).unwrap();
            assert_pose(
                &poses[0],
                &table_pose,
                0.6,
                0.5,
                &format!("{kind:?} table {k}"),
            );
            assert_pose(
                &poses[1],
                &card_pose,
                1.5,
                1.0,
                &format!("{kind:?} card {k}"),
            );
        }
    }
}

#[test]
fn wrong_calibrations_show_in_the_reprojection_error() {
    let markers = table();
    let truth = camera_above(35.0, 10.0, DVec3::new(0.0, 0.0, 0.42));
    let frame = photograph(&WIDE_CAMERA, &[(&markers, truth)], 0.0);
    let pose = &track_once(
        &settings(DetectorKind::AprilTag),
        &[anchor("table", &markers)],
        CAMERA,
        &frame,
    )[0];
    assert!(pose.reprojection_px > 1.0, "{} px", pose.reprojection_px);
}

#[test]
fn wrong_settings_say_what_is_allowed() {
    let error = |settings: TrackingSettings, families: &[Family]| match Detector::new(
        &settings, families,
    ) {
        Ok(_) => panic!("accepted"),
        Err(error) => error.to_string(),
    };
    let default = TrackingSettings::default;
    let message = error(
        default(),
        &[
            Family::TAG36H11,
            Family::of(Codes::Aruco {
                cells: 4,
                count: 50,
            }),
        ],
    );
    assert!(
        message.contains("DICT_4X4_50") && message.contains("tag25h9"),
        "{message}"
    );
    for wrong in [
        TrackingSettings {
            decimation: 0.5,
            ..default()
        },
        TrackingSettings {
            decimation: f64::NAN,
            ..default()
        },
        TrackingSettings {
            blur_px: -1.0,
            ..default()
        },
        TrackingSettings {
            min_margin: f64::INFINITY,
            ..default()
        },
        TrackingSettings {
            threads: 0,
            ..default()
        },
        TrackingSettings {
            corrected_bits: 4,
            ..default()
        },
    ] {
        let message = error(wrong, &[Family::TAG36H11]);
        assert!(message.contains("allowed"), "{message}");
    }
    let mut tracker = Tracker::new(&default(), &[anchor("table", &table())], CAMERA).unwrap();
    let small = Frame {
        index: 0,
        time_secs: 0.0,
        size_px: [320, 240],
        rgba: vec![0; 320 * 240 * 4],
    };
    assert!(matches!(
        tracker.track(&small),
        Err(TrackingError::FrameSize { .. })
    ));
    let cut_off = Frame {
        size_px: [640, 480],
        ..small
    };
    assert!(matches!(
        tracker.track(&cut_off),
        Err(TrackingError::PictureSize { .. })
    ));
}

#[test]
fn pictures_too_small_for_a_marker_have_none() {
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let mut detector = Detector::new(&settings(kind), &[Family::TAG36H11]).unwrap();
        for size_px in [[0, 0], [1, 1], [3, 200], [200, 3], [17, 17]] {
            let grey = vec![128; (size_px[0] * size_px[1]) as usize];
            assert_eq!(
                detector.detect(&grey, size_px).unwrap(),
                [],
                "{kind:?} {size_px:?}"
            );
        }
        assert!(matches!(
            detector.detect(&[0; 5], [2, 2]),
            Err(TrackingError::PictureSize { .. })
        ));
        let mut idle = Detector::new(&settings(kind), &[]).unwrap();
        assert_eq!(idle.detect(&[0; 64 * 64], [64, 64]).unwrap(), []);
    }
}

#[test]
fn blurring_leaves_the_picture_alone_and_threads_change_nothing() {
    let truth = camera_above(20.0, 10.0, DVec3::new(0.0, 0.0, 0.42));
    let frame = photograph(&CAMERA, &[(&table(), truth)], 0.0);
    let grey = grey_of(&frame);
    let blurred = TrackingSettings {
        decimation: 1.0,
        blur_px: 0.8,
        ..TrackingSettings::default()
    };
    let mut detector = Detector::new(&blurred, &[Family::TAG36H11]).unwrap();
    let first = detector.detect(&grey, CAMERA.size_px).unwrap();
    assert_eq!(first.len(), 4);
    assert_eq!(detector.detect(&grey, CAMERA.size_px).unwrap(), first);
    let on_two = TrackingSettings {
        threads: 2,
        ..blurred
    };
    assert_eq!(detect(&on_two, &[Family::TAG36H11], &frame), first);
    // A detector may be built here and used there.
    let moved = std::thread::spawn(move || detector.detect(&grey, CAMERA.size_px).unwrap());
    assert_eq!(moved.join().unwrap(), first);
}

// ---------------------------------------------------------------------------------------------------------------------
// Photographs; they lie beside the project and are not shipped with it.

#[test]
fn photographs_of_a_room_show_the_markers_that_people_counted() {
    let Some(folder) = photographs("swatbotics/mapping_feb_2014") else {
        return;
    };
    let truth = std::fs::read_to_string(folder.join("groundtruth.txt")).unwrap();
    let full = TrackingSettings {
        decimation: 1.0,
        ..TrackingSettings::default()
    };
    let mut detector = Detector::new(&full, &[Family::TAG36H11]).unwrap();
    let (mut visible, mut found, mut invented) = (0, 0, Vec::new());
    for line in truth.lines().filter(|line| !line.trim().is_empty()) {
        let mut words = line.split_whitespace();
        let name = words.next().unwrap();
        let expected = words
            .map(|word| word.parse::<u32>().unwrap())
            .collect::<BTreeSet<_>>();
        let frame = read_photograph(&folder.join(name));
        let seen = detector
            .detect_thoroughly(&grey_of(&frame), frame.size_px)
            .unwrap();
        let seen = seen
            .iter()
            .map(|detection| detection.id)
            .collect::<BTreeSet<_>>();
        visible += expected.len();
        found += expected.intersection(&seen).count();
        invented.extend(
            seen.difference(&expected)
                .map(|id| format!("{id} in {name}")),
        );
    }
    let recall = found as f64 / visible as f64;
    eprintln!("recall {found} of {visible}: {:.1} %", 100.0 * recall);
    assert_eq!(visible, 236);
    assert!(recall >= 0.96, "{found} of {visible}");
    assert!(invented.is_empty(), "{invented:?}");
}

#[test]
fn photographs_of_a_turned_tag_show_its_turn() {
    let Some(folder) = photographs("duckietown") else {
        return;
    };
    let camera = Intrinsics {
        size_px: [1056, 792],
        focal_px: DVec2::new(329.8729619143081, 332.94611303946357),
        center_px: DVec2::new(528.0, 396.0),
        distortion: [0.0; 5],
    };
    let card = [marker(76, 0.065, 0.0, 0.0)];
    // The contours of OpenCV's default miss a tag that is turned away by 70°.
    let refinement = ArucoRefinement::AprilTag;
    for kind in [DetectorKind::AprilTag, DetectorKind::Aruco] {
        let settings = TrackingSettings {
            aruco_refinement: refinement,
            ..settings(kind)
        };
        let mut excess_deg = Vec::new();
        for stated_deg in (-70..=70).step_by(10) {
            let frame =
                read_photograph(&folder.join(format!("test_image_rotation_{stated_deg}.png")));
            let pose = &track_once(&settings, &[anchor("card", &card)], camera, &frame)[0];
            let camera_from_card = pose
                .camera_from_anchor
                .unwrap_or_else(|| panic!("{kind:?}: lost at {stated_deg}°"));
            assert_eq!(pose.status, Status::Tracked, "{kind:?}: at {stated_deg}°");
            let distance_m = camera_from_card.translation.length();
            assert!(
                (0.200..0.220).contains(&distance_m),
                "{kind:?}: {distance_m} m at {stated_deg}°"
            );
            let normal = camera_from_card.matrix3.z_axis;
            excess_deg.push(normal.x.atan2(-normal.z).to_degrees() - f64::from(stated_deg));
        }
        // The stated angles are right to 4.7°, most of it one constant that the hand that placed the card left.
        let constant_deg = excess_deg.iter().sum::<f64>() / excess_deg.len() as f64;
        let rest_deg = excess_deg
            .iter()
            .map(|excess| (excess - constant_deg).abs())
            .collect::<Vec<_>>();
        eprintln!("{kind:?}: constant {constant_deg:.2}°, rest {rest_deg:.1?}");
        assert!(
            constant_deg.abs() < 3.0,
            "{kind:?}: constant {constant_deg}°"
        );
        assert!(
            rest_deg.iter().all(|&rest| rest < 4.7),
            "{kind:?}: {rest_deg:?}"
        );
        let mean_deg = rest_deg.iter().sum::<f64>() / rest_deg.len() as f64;
        assert!(mean_deg < 2.0, "{kind:?}: {rest_deg:?}");
    }
}

/// The 6 x 6 tags of Kalibr's grids: 88 mm, 0.3 of it apart, black borders of 2 cells.
fn april_grid() -> Vec<Marker> {
    let family = Family::TAG36H11.with_border(2).expect("a border");
    let pitch_m = 0.088 * 1.3;
    (0..36)
        .map(|id| Marker {
            family,
            ..marker(
                id,
                0.088,
                f64::from(id % 6) * pitch_m,
                f64::from(id / 6) * pitch_m,
            )
        })
        .collect()
}

#[test]
fn photographs_of_an_april_grid_show_all_its_tags() {
    let Some(folder) = photographs("yac_mocap") else {
        return;
    };
    let camera = Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(606.57, 609.98),
        center_px: DVec2::new(324.44, 245.65),
        distortion: [0.0; 5],
    };
    let grid = april_grid();
    let anchors = [anchor("grid", &grid)];
    let mut stills: Vec<_> = std::fs::read_dir(folder.join("cam0/data"))
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .collect();
    stills.sort();
    assert_eq!(stills.len(), 30);
    // Blur joins the tags' corners to the black squares between them: without an answer to it 85 % and 73 % were found.
    for (decimation, least_recall) in [(1.0, 0.97), (2.0, 0.89)] {
        let settings = TrackingSettings {
            decimation,
            ..TrackingSettings::default()
        };
        let mut tracker = Tracker::new(&settings, &anchors, camera).unwrap();
        let (mut visible, mut found, mut off_px) = (0, 0, Vec::new());
        for (number, still) in stills.iter().enumerate() {
            // Minutes apart: none is where the one before it was.
            let photograph = Frame {
                time_secs: 60.0 * number as f64,
                ..read_photograph(still)
            };
            let name = still.file_stem().unwrap().to_string_lossy();
            let known = grid_corners_px(&folder.join(format!("grid0/cam0/data/{name}.csv")));
            let pose = &tracker.track(&photograph).unwrap()[0];
            assert_eq!(pose.status, Status::Tracked, "{name}");
            let camera_from_grid = pose.camera_from_anchor.unwrap();
            let mut pose_off_px = Vec::new();
            for (id, corners_px) in &known {
                let marker = &grid[*id as usize];
                let posed_px = true_corners_px(&camera, marker, &camera_from_grid);
                pose_off_px.extend(distances_px(&posed_px, corners_px));
                visible += 1;
                let seen = tracker.detections().iter().find(|seen| seen.id == *id);
                let Some(seen) = seen else { continue };
                found += 1;
                off_px.extend(distances_px(&seen.corners_px, corners_px));
            }
            let pose_off_px = median(&mut pose_off_px);
            assert!(
                pose_off_px < 0.5,
                "{name}: the board is {pose_off_px} px off"
            );
        }
        let median_px = median(&mut off_px);
        let recall = f64::from(found) / f64::from(visible);
        eprintln!(
            "decimation {decimation}: {found} of {visible}, {:.1} %; corners {median_px:.2} px off",
            100.0 * recall
        );
        assert_eq!(visible, 988);
        assert!(recall >= least_recall, "{found} of {visible}");
        assert!(median_px < 0.25, "{median_px} px");
    }
}

fn distances_px(a: &[DVec2; 4], b: &[DVec2; 4]) -> [f64; 4] {
    std::array::from_fn(|corner| a[corner].distance(b[corner]))
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// The corners of each whole tag as the photographs' authors found them, as printed.
fn grid_corners_px(file: &Path) -> BTreeMap<u32, [DVec2; 4]> {
    let mut corners_px = BTreeMap::<u32, Vec<DVec2>>::new();
    for row in std::fs::read_to_string(file)
        .expect("the photographs' corners")
        .lines()
        .skip(1)
    {
        let fields: Vec<f64> = row
            .split(',')
            .map(|field| field.parse().expect("a number"))
            .collect();
        let corners = corners_px.entry(fields[10] as u32).or_default();
        corners.push(DVec2::new(fields[5], fields[6]));
    }
    corners_px
        .into_iter()
        .filter_map(|(id, corners)| {
            // Counted from the bottom left, counter-clockwise.
            let [a, b, c, d] = <[DVec2; 4]>::try_from(corners).ok()?;
            Some((id, [d, c, b, a]))
        })
        .collect()
}

/// The folder beside the project, or `None` and a line on stderr where it is not there.
fn photographs(name: &str) -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/real")
        .join(name);
    if !folder.is_dir() {
        eprintln!("skipped: {} is not there", folder.display());
        return None;
    }
    Some(folder)
}

fn read_photograph(path: &Path) -> Frame {
    let picture = image::open(path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        .to_rgba8();
    Frame {
        index: 0,
        time_secs: 0.0,
        size_px: [picture.width(), picture.height()],
        rgba: picture.into_raw(),
    }
}
