//! Tracking against known answers: sheets rendered through a known camera.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::{ArucoRefinement, Codes, DetectorKind, Family, Marker, TrackingSettings};
use gnomon::tracking::{
    AnchorPose, Detection, Detector, LossReason, Status, Tracker, TrackingError,
};

use crate::common::sheets::{
    CAMERA, WIDE_CAMERA, anchor, angle_between_deg, camera_above, grey_of, marker, photograph,
    settings, table, track_once, true_corners_px, with_noise,
};

fn assert_pose(found: &AnchorPose, truth: &DAffine3, within_mm: f64, within_deg: f64, what: &str) {
    let pose = found
        .camera_from_anchor
        .unwrap_or_else(|| panic!("{what}: lost"));
    let off_mm = (pose.translation - truth.translation).length() * 1000.0;
    let off_deg = angle_between_deg(&pose, truth);
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
                apart_mm < 0.2 && angle_between_deg(&poses[0], &poses[1]) < 0.1,
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
    let turned = marker(1, 0.06, 0.0, 0.0).in_plane(DVec2::new(0.08, 0.02), 0.7);
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
                let off_deg = angle_between_deg(&found, &truth);
                let other_deg = pose.alternative.map_or(f64::INFINITY, |other| {
                    angle_between_deg(&other.camera_from_anchor, &truth)
                });
                if pose.status == Status::Tracked {
                    tracked += 1;
                    let turn_variance: f64 = (0..3).map(|k| pose.covariance.unwrap()[k][k]).sum();
                    let known_to_deg = 3.5 * turn_variance.sqrt().to_degrees();
                    assert!(
                        off_deg < known_to_deg.max(2.0),
                        "{what}: sure and {off_deg}° off, known to {known_to_deg}°"
                    );
                    assert!(other_deg + 2.0 > off_deg, "{what}: sure of the wrong one");
                } else {
                    assert_eq!(
                        (pose.status, pose.loss_reason),
                        (Status::Ambiguous, Some(LossReason::TwoPoses))
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
            let off_deg = angle_between_deg(&now.camera_from_anchor.unwrap(), &expected);
            assert!(off_deg < 2.0, "frame {frame}: {off_deg}°");
        }
        // Half a minute later the memory is worth nothing.
        let later = Frame {
            time_secs: 40.0,
            ..alone.clone()
        };
        let late = &tracker.track(&later).unwrap()[0];
        assert_eq!(late.status, Status::Ambiguous);
        assert!(angle_between_deg(&late.camera_from_anchor.unwrap(), &chosen) < 0.5);
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
            loss_reason: Some(LossReason::NoMarker),
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
            (poses[0].status, poses[0].loss_reason),
            (Status::Lost, Some(LossReason::DoubleId))
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
    printed_wrong[2].anchor_from_marker.translation.x += 0.01;
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
        settings(DetectorKind::AprilTag),
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

/// libapriltag's own threads crash in one of some hundred first searches, where there are more of them than cores.
#[test]
fn many_first_searches_at_once() {
    let noise: Vec<u8> = (0..320_u32 * 240)
        .map(|at| (at.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    let on_three = TrackingSettings {
        threads: 3,
        ..TrackingSettings::default()
    };
    std::thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| {
                for _ in 0..60 {
                    let mut detector = Detector::new(&on_three, &[Family::TAG36H11]).unwrap();
                    detector.detect(&noise, [320, 240]).unwrap();
                }
            });
        }
    });
}
