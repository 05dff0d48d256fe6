//! All families of markers, as a camera sees their prints: found by the libraries' own detectors, and their poses.

use glam::{DAffine3, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::pose::rotation_between;
use gnomon::scene::{Anchor, Drawing, Family, Ink, Marker, TrackingSettings};
use gnomon::tracking::{Cell, PrintedMarker, Status, Tracker};

use crate::common::sheets::{CAMERA, FRAME_SECS, camera_above, photograph};

/// Side of the square whose corners are found, metres.
const SIZE_M: f64 = 0.06;
/// Samples of a pixel along each side.
const SAMPLES: u32 = 4;

/// A card with a marker, as printed and cut out with two cells of paper around it, of which white on black has one black.
fn card(family: Family, id: u32, camera_from_card: &DAffine3) -> Frame {
    let printed = PrintedMarker::of(family, id).expect("a marker");
    let cell_m = SIZE_M / f64::from(printed.side());
    let paper = printed.rim() + 2;
    let card_from_camera = camera_from_card.inverse();
    let light_at = |pixel: DVec2| {
        let ray = card_from_camera.transform_vector3(CAMERA.plane_from_pixel(pixel).extend(1.0));
        let eye = card_from_camera.translation;
        let on_card = (eye - ray * (eye.z / ray.z)).truncate();
        let cells = DVec2::new(on_card.x + SIZE_M / 2.0, SIZE_M / 2.0 - on_card.y) / cell_m;
        let (column, row) = (cells.x.floor() as i32, cells.y.floor() as i32);
        let on_paper = -paper..printed.side() + paper;
        if !on_paper.contains(&column) || !on_paper.contains(&row) {
            return 0.2;
        }
        let in_ring = -printed.rim() - 1..printed.side() + printed.rim() + 1;
        match printed.cell(column, row) {
            _ if !in_ring.contains(&column) || !in_ring.contains(&row) => 0.8,
            Cell::Black => 0.03,
            // Whoever prints an open cell leaves it as the paper is.
            Cell::White | Cell::Open => 0.8,
        }
    };
    let [width, height] = CAMERA.size_px;
    let mut rgba = Vec::new();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let samples = (0..SAMPLES * SAMPLES).map(|sample| {
            let within = DVec2::new(f64::from(sample % SAMPLES), f64::from(sample / SAMPLES)) + 0.5;
            let pixel = DVec2::new(f64::from(x), f64::from(y)) + within / f64::from(SAMPLES) - 0.5;
            light_at(pixel)
        });
        let light = samples.sum::<f64>() / f64::from(SAMPLES * SAMPLES);
        let level = (255.0 * (1.055 * light.powf(1.0 / 2.4) - 0.055)).round() as u8;
        rgba.extend([level, level, level, 255]);
    }
    Frame {
        index: 0,
        time_secs: 0.0,
        size_px: CAMERA.size_px,
        rgba,
    }
}

#[test]
fn every_family_is_found_where_its_print_lies() {
    let plain = Family::all_names().filter_map(Family::from_name);
    let inverted = ["tag36h11", "DICT_6X6_250", "DICT_ARUCO_MIP_36h12"];
    let inverted =
        inverted.map(|name| Family::from_name(name).unwrap().with_ink(Ink::WhiteOnBlack));
    let truth = camera_above(25.0, 30.0, DVec3::new(0.01, -0.01, 0.45));
    for family in plain.chain(inverted) {
        // OpenCV's original dictionary has markers that differ in a single cell; any other id is as good as one.
        let id = 5;
        let frame = card(family, id, &truth);
        let anchors = [Anchor::lone("card".into(), family, id, SIZE_M)];
        let settings = TrackingSettings::default();
        let mut tracker = Tracker::new(&settings, &anchors, CAMERA).unwrap();
        let pose = &tracker.track(&frame).unwrap()[0];
        let found = pose
            .camera_from_anchor
            .unwrap_or_else(|| panic!("{family} was not found"));
        assert_ne!(pose.status, Status::Lost, "{family}");
        let off_m = found.translation.distance(truth.translation);
        let off_deg = rotation_between(&found, &truth).to_degrees();
        assert!(
            off_m < 0.001 && off_deg < 0.5,
            "{family}: {off_m} m, {off_deg}°"
        );
    }
}

/// On a sheet each has a black ring about its white one, which is a frame too.
#[test]
fn inverted_markers_are_found_on_the_sheets_that_are_printed() {
    let settings = TrackingSettings::default();
    for name in ["DICT_7X7_50", "DICT_6X6_250", "ARUCO_MIP_36h12"] {
        let family = Family::from_name(name).unwrap();
        let inverted = family.with_ink(Ink::WhiteOnBlack);
        for (id, height_m) in [(0, 0.3), (7, 0.38), (23, 0.5)] {
            let pose = camera_above(25.0, 30.0, DVec3::new(0.0, 0.0, height_m));
            for (printed, other) in [(inverted, family), (family, inverted)] {
                let frame = card(printed, id, &pose);
                let found = |of: Family| {
                    let mut tracker =
                        Tracker::of_every_marker(&settings, (of, SIZE_M), CAMERA).unwrap();
                    tracker.track(&frame).unwrap().len()
                };
                let counts = (found(printed), found(other));
                assert_eq!(counts, (1, 0), "{printed} {id} {height_m}");
            }
        }
    }
}

#[test]
fn a_marker_of_another_border_is_another_marker() {
    let narrow = Family::TAG36H11;
    let wide = narrow.with_border(2).unwrap();
    let pose = camera_above(25.0, 30.0, DVec3::new(0.0, 0.0, 0.35));
    let settings = TrackingSettings::default();
    for id in 0..6 {
        for (printed, other) in [(wide, narrow), (narrow, wide)] {
            let frame = card(printed, id, &pose);
            let found = |of: Family| {
                let anchors = [Anchor::lone("card".into(), of, id, SIZE_M)];
                let mut tracker = Tracker::new(&settings, &anchors, CAMERA).unwrap();
                tracker.track(&frame).unwrap()[0].status != Status::Lost
            };
            assert_eq!(
                (found(printed), found(other)),
                (true, false),
                "{printed} {id}"
            );
        }
    }
}

#[test]
fn a_marker_of_another_family_is_none_of_a_weak_one() {
    // What a strong family prints has a border too, and now and then a weak one's code in its middle.
    let pose = camera_above(15.0, 10.0, DVec3::new(0.0, 0.0, 0.4));
    let (mut looked, mut rows) = (0, 0);
    for id in 0..12 {
        let frame = card(Family::TAG36H11, id, &pose);
        for name in ["DICT_4X4_50", "DICT_4X4_1000", "DICT_5X5_1000", "tag16h5"] {
            let family = Family::from_name(name).unwrap();
            let settings = TrackingSettings::default();
            let mut tracker =
                Tracker::of_every_marker(&settings, (family, SIZE_M), CAMERA).unwrap();
            for _ in 0..2 {
                rows += tracker.track(&frame).unwrap().len();
                looked += 1;
            }
        }
    }
    assert_eq!(rows, 0, "of {looked} looks");
}

#[test]
fn a_board_whose_markers_are_all_turned_alike_is_tracked_and_told() {
    let family = Family::TAG36H11;
    let marker = |id: u32, x_m: f64, rotation_deg: f64| {
        let center_m = DVec2::new(x_m, 0.0);
        Marker::alone(family, id, 0.05).in_plane(center_m, rotation_deg.to_radians())
    };
    let printed = [marker(0, -0.05, 90.0), marker(1, 0.05, 90.0)];
    let anchor = Anchor {
        name: "table".into(),
        markers: vec![marker(0, -0.05, 0.0), marker(1, 0.05, 0.0)],
    };
    let truth = camera_above(25.0, 10.0, DVec3::new(0.0, 0.0, 0.45));
    let frame = photograph(&CAMERA, &[(&printed, truth)], 0.0);
    let mut tracker = Tracker::new(&TrackingSettings::default(), &[anchor], CAMERA).unwrap();
    let pose = tracker.track(&frame).unwrap().remove(0);
    let found = pose.camera_from_anchor.expect("a pose");
    assert_eq!((pose.status, pose.markers), (Status::Tracked, 2));
    assert!(rotation_between(&found, &truth).to_degrees() < 0.3);
    assert_eq!(tracker.quarter_turns().collect::<Vec<_>>(), [1]);
}

#[test]
fn a_board_that_is_contradicted_is_not_tracked() {
    let family = Family::TAG36H11;
    let marker =
        |id: u32, x_m: f64| Marker::alone(family, id, 0.05).in_plane(DVec2::new(x_m, 0.0), 0.0);
    // Its second marker lies on the other side, and farther off than any turn would bring it.
    let printed = [marker(0, -0.05), marker(1, -0.18)];
    let anchor = Anchor {
        name: "table".into(),
        markers: vec![marker(0, -0.05), marker(1, 0.05)],
    };
    let truth = camera_above(25.0, 10.0, DVec3::new(0.05, 0.0, 0.5));
    let mut frame = photograph(&CAMERA, &[(&printed, truth)], 0.0);
    let mut tracker = Tracker::new(&TrackingSettings::default(), &[anchor], CAMERA).unwrap();
    for index in 0..3 {
        frame.index = index;
        frame.time_secs = FRAME_SECS * f64::from(index);
        let pose = tracker.track(&frame).unwrap().remove(0);
        assert_ne!(pose.status, Status::Tracked, "frame {index}");
    }
}

#[test]
fn two_markers_with_one_id_are_two_where_every_marker_is_wanted() {
    let lone = [Marker::alone(Family::TAG36H11, 17, 0.05)];
    let places = [-0.08, 0.08].map(|x_m| camera_above(25.0, 40.0, DVec3::new(x_m, 0.0, 0.4)));
    let mut frame = photograph(&CAMERA, &[(&lone, places[0]), (&lone, places[1])], 0.0);
    let settings = TrackingSettings::default();
    let wanted = (Family::TAG36H11, 0.05);
    let mut tracker = Tracker::of_every_marker(&settings, wanted, CAMERA).unwrap();
    for index in 0..20 {
        frame.index = index;
        frame.time_secs = FRAME_SECS * f64::from(index);
        let poses = tracker.track(&frame).unwrap();
        let mut found_m: Vec<f64> = poses
            .iter()
            .map(|pose| pose.camera_from_anchor.expect("a pose").translation.x)
            .collect();
        found_m.sort_by(f64::total_cmp);
        assert_eq!(found_m.len(), 2, "frame {index}");
        assert!((found_m[0] + 0.08).abs() < 0.001 && (found_m[1] - 0.08).abs() < 0.001);
        let names = tracker.lone_anchors();
        let names: Vec<&str> = names.iter().map(|anchor| anchor.name.as_str()).collect();
        assert_eq!(names, ["17", "17#2"]);
    }
}

#[test]
fn opencv_s_drawings_are_april_tag_s_turned_by_half() {
    let family = Family::from_name("DICT_APRILTAG_36h11").unwrap();
    assert_eq!(family.drawing(), Drawing::OpenCv);
    let own = PrintedMarker::of(Family::TAG36H11, 3).unwrap().square();
    let opencv = PrintedMarker::of(family, 3).unwrap().square();
    assert!(opencv.iter().eq(own.iter().rev()));
}
