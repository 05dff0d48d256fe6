//! `gnomon calibrate`: printed targets photographed through known cameras, and photographs of real ones.

use std::path::Path;
use std::process::Output;

use crate::common::photographs;
use crate::common::prints::{
    BENT_CAMERA, CHARUCO, CHESSBOARD, Photographer, Print, good_poses, pose, ray,
};
use crate::common::sheets::CAMERA;
use assert_cmd::Command;
use glam::{DAffine3, DMat3, DVec2, Vec2Swizzles as _};
use gnomon::app::files::picture_files::{grey_png, write_bytes};
use gnomon::calibration::{
    CalibrateError, Calibration, Lack, Target, TargetFinder, TargetLook, TargetMarkers, Views,
    solve,
};
use gnomon::capture::load_calibration;
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::Family;
use gnomon::tracking::printed_cells;

fn chessboard() -> Target {
    Target::chessboard([8, 5], 0.025).expect("a target")
}

fn charuco() -> Target {
    charuco_of([9, 6], 0.025, 0.018, "DICT_5X5_100")
}

fn charuco_of(squares: [u32; 2], square_m: f64, size_m: f64, family: &str) -> Target {
    let family = Family::from_name(family).expect("a family");
    Target::charuco(squares, square_m, TargetMarkers { family, size_m }).expect("a target")
}

fn gnomon(folder: &Path, arguments: &str) -> Output {
    Command::cargo_bin("gnomon")
        .expect("the program")
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .expect("a run")
}

fn shown(photographer: &Photographer, print: &Print, target: Target, poses: &[DAffine3]) -> Views {
    let mut views = Views::new(target).expect("a finder");
    for (number, pose) in (0..).zip(poses) {
        let grey = photographer.photograph(print, pose, 1.0);
        views
            .look(number, &grey, photographer.camera.size_px)
            .expect("a look");
    }
    views
}

/// How far off the found camera sees what the true one sees at a pixel, at most over the whole picture, once it is turned
/// to see the same: a turn is the pose's to tell.
fn farthest_px(found: &Intrinsics, truth: &Intrinsics) -> f64 {
    let [width, height] = truth.size_px;
    let pixels: Vec<DVec2> = (0..height)
        .step_by(16)
        .flat_map(|y| {
            (0..width)
                .step_by(16)
                .map(move |x| DVec2::new(f64::from(x), f64::from(y)))
        })
        .collect();
    let rays: Vec<DVec2> = pixels.iter().map(|&pixel| ray(truth, pixel)).collect();
    let mut turn = DMat3::IDENTITY;
    let mut farthest = f64::INFINITY;
    for _ in 0..10 {
        let off: Vec<DVec2> = (rays.iter().zip(&pixels))
            .map(|(ray, pixel)| {
                let turned = turn * ray.extend(1.0);
                found.pixel_from_plane(found.distort(turned.truncate() / turned.z)) - *pixel
            })
            .collect();
        farthest = off.iter().map(|off| off.length()).fold(0.0, f64::max);
        let mean = off.iter().sum::<DVec2>() / off.len() as f64 / found.focal_px;
        turn = DMat3::from_rotation_y(-mean.x) * DMat3::from_rotation_x(mean.y) * turn;
    }
    farthest
}

fn assert_camera(found: &Calibration, truth: &Intrinsics, within_px: f64) {
    let off = (found.intrinsics.focal_px / truth.focal_px - 1.0).abs();
    assert!(off.max_element() < 1e-3, "{:?}", found.intrinsics);
    let off_px = farthest_px(&found.intrinsics, truth);
    eprintln!(
        "focal lengths off by {off:.5}, the farthest pixel by {off_px:.3} px, rms {:.3} px, deviation {}",
        found.rms_px, found.focal_deviation_px
    );
    assert!(
        off_px < within_px,
        "{off_px:.3} px off: {:?}",
        found.intrinsics
    );
    // As sure as it says, and not wildly modest.
    let sigmas = (found.intrinsics.focal_px - truth.focal_px).abs() / found.focal_deviation_px;
    assert!(sigmas.max_element() < 4.0, "{sigmas}");
    assert!(
        found.focal_deviation_px.max_element() < 1.0,
        "{}",
        found.focal_deviation_px
    );
}

fn write_grey_png(path: &Path, size_px: [u32; 2], grey: &[u8]) {
    let picture = grey_png(path, size_px, grey).expect("a picture");
    write_bytes(path, &picture).expect("a picture");
}

#[test]
fn a_chessboard_tells_a_straight_lens() {
    let print = Print::chessboard();
    let poses = good_poses(print);
    let views = shown(Photographer::straight(), print, chessboard(), &poses);
    assert_eq!(views.kept().len(), poses.len());
    assert_eq!(views.lacks(), []);
    let found = solve(&views).expect("a calibration");
    assert_camera(&found, &CAMERA, 0.3);
    assert!(found.rms_px < 0.06, "{}", found.rms_px);
    assert!(
        found.dropped.is_empty() && found.lacks.is_empty(),
        "{:?}",
        found.lacks
    );
    assert_eq!(found.focal_change, None);
    // Where the target was, up to the chessboard's half turn; none of these is needed to have one.
    for (view, pose) in found.views.iter().zip(&poses) {
        let tilt = pose.matrix3.z_axis.z.abs().acos();
        assert!((view.tilt_rad() - tilt).abs() < 2e-3);
    }
}

#[test]
fn a_charuco_board_tells_a_bent_lens_by_parts_of_it() {
    let print = Print::charuco();
    let mut poses = good_poses(print);
    // Into the corners, with parts of the board outside.
    for place in [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]] {
        poses.push(pose(
            print,
            place,
            0.4,
            [15.0 * place[1], -15.0 * place[0]],
            0.0,
        ));
    }
    let views = shown(Photographer::bent(), print, charuco(), &poses);
    assert!(
        views.kept().len() >= poses.len() - 1,
        "{}",
        views.kept().len()
    );
    assert!(views.kept().iter().any(|view| view.corners.len() < 40));
    let found = solve(&views).expect("a calibration");
    assert_camera(&found, &BENT_CAMERA, 0.3);
    assert!(found.rms_px < 0.1, "{}", found.rms_px);
}

/// Tilted to all sides, so far away that squares of 25 mm are some 25 to 35 pixels wide.
fn far_poses(print: &Print) -> Vec<DAffine3> {
    let mut poses = Vec::new();
    for (k, distance_m) in (0_i32..).zip([0.44, 0.48, 0.52, 0.56, 0.6, 0.64]) {
        let turn_deg = f64::from(50 * k);
        let aside = 0.1 * f64::from(k - 3);
        for tilt_deg in [[28.0_f64, 8.0], [-10.0, -30.0]] {
            let place = [aside * tilt_deg[0].signum(), -aside];
            poses.push(pose(print, place, distance_m, tilt_deg, turn_deg));
        }
    }
    poses
}

#[test]
fn small_squares_tell_their_corners_though_markers_stand_beside_them() {
    let print = Print::charuco();
    let photographer = Photographer::bent();
    let poses = far_poses(print);
    let mut finder = TargetFinder::new(charuco()).expect("a finder");
    let (mut squares, mut count) = (0.0, 0);
    for camera_from_target in &poses {
        let grey = photographer.photograph(print, camera_from_target, 1.0);
        let corners = finder.find(&grey, BENT_CAMERA.size_px).expect("corners");
        assert_eq!(corners.len(), 40);
        count += corners.len();
        for corner in corners {
            let place = camera_from_target.transform_point3(corner.target_m.extend(0.0));
            let expected_px = BENT_CAMERA.pixel_of(place).expect("a pixel");
            squares += corner.pixel.distance_squared(expected_px);
        }
    }
    let off_px = (squares / count as f64).sqrt();
    eprintln!("{count} corners of small squares: {off_px:.4} px rms off");
    // OpenCV's own corners are off by 0.1 px there.
    assert!(off_px < 0.04, "{off_px}");
    let views = shown(photographer, print, charuco(), &poses);
    let found = solve(&views).expect("a calibration");
    let off = (found.intrinsics.focal_px / BENT_CAMERA.focal_px - 1.0).abs();
    eprintln!("focal lengths off by {off:.5}, rms {:.3} px", found.rms_px);
    assert!(off.max_element() < 3e-3, "{:?}", found.intrinsics);
}

#[test]
fn squares_that_are_too_small_are_told() {
    let print = Print::of("--charuco 9x6 --square-mm 25 --marker-mm 22 --dictionary DICT_4X4_50");
    let target = charuco_of([9, 6], 0.025, 0.022, "DICT_4X4_50");
    let views = shown(Photographer::straight(), &print, target, &far_poses(&print));
    let error = solve(&views).expect_err("too small").to_string();
    assert!(error.contains("hold it nearer"), "{error}");
}

#[test]
fn views_of_two_focal_lengths_are_told() {
    let print = Print::chessboard();
    for times in [1.15, 1.3] {
        let longer = Photographer::new(Intrinsics {
            focal_px: times * CAMERA.focal_px,
            ..CAMERA
        });
        let mut views = Views::new(chessboard()).expect("a finder");
        for (number, pose) in (0..).zip(good_poses(print)) {
            let photographer = match number % 2 {
                0 => Photographer::straight(),
                _ => &longer,
            };
            let grey = photographer.photograph(print, &pose, 1.0);
            views.look(number, &grey, CAMERA.size_px).expect("a look");
        }
        // Refused or warned of, it is told.
        let change = match solve(&views) {
            Ok(found) => found.focal_change,
            Err(CalibrateError::Changed(change)) => Some(change),
            Err(error) => panic!("{error}"),
        };
        let change = change.expect("two focal lengths");
        eprintln!("{times}: {change}");
        let [shorter_px, longer_px] = change.focal_px;
        assert!(
            longer_px / shorter_px > 1.0 + (times - 1.0) / 2.0,
            "{change}"
        );
    }
}

#[test]
fn a_board_left_for_right_and_another_board_are_told() {
    let [width, height] = CAMERA.size_px;
    let photograph = |print: &Print| {
        let poses = good_poses(print);
        let seen = move |pose| Photographer::straight().photograph(print, pose, 1.0);
        poses.iter().take(5).map(seen).collect::<Vec<_>>()
    };
    let mut views = Views::new(charuco()).expect("a finder");
    for mut grey in photograph(Print::charuco()) {
        grey.chunks_exact_mut(width as usize)
            .for_each(<[u8]>::reverse);
        views.look(0, &grey, [width, height]).expect("a look");
    }
    let error = solve(&views).expect_err("mirrored");
    assert!(
        matches!(error, CalibrateError::Mirrored { looked: 5, seen: 5 }),
        "{error}"
    );
    for counts in [[7, 5], [6, 4], [9, 6]] {
        let target = Target::chessboard(counts, 0.025).expect("a target");
        let mut views = Views::new(target).expect("a finder");
        for grey in photograph(Print::chessboard()) {
            views.look(0, &grey, [width, height]).expect("a look");
        }
        let error = solve(&views).expect_err("another board").to_string();
        assert!(error.contains("--chessboard 8x5"), "{error}");
    }
}

#[test]
fn boards_of_all_releases_of_opencv_are_found() {
    const SQUARE_PX: u32 = 70;
    let (rim_px, cell_px) = (40, 7);
    // An even number of rows: before 4.6 such boards began with a white square.
    let target = charuco_of([5, 6], 0.07, 0.049, "DICT_5X5_100");
    let family = target.markers.expect("markers").family;
    for starts_white in [false, true] {
        let [width, height] = target.squares.map(|count| count * SQUARE_PX + 2 * rim_px);
        let mut picture = image::GrayImage::from_pixel(width, height, image::Luma([230]));
        let mut blacken = |left: u32, top: u32, side: u32| {
            for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
                picture.put_pixel(rim_px + left + x, rim_px + top + y, image::Luma([20]));
            }
        };
        for row in 0..target.squares[1] {
            for column in 0..target.squares[0] {
                if ((row + column) % 2 == 0) != starts_white {
                    blacken(column * SQUARE_PX, row * SQUARE_PX, SQUARE_PX);
                }
            }
        }
        for (id, [column, row]) in (0..).zip(target.marker_squares(starts_white)) {
            let white = printed_cells(family, id).expect("a marker");
            let inset = (SQUARE_PX - 7 * cell_px) / 2;
            for (k, _) in (0..).zip(&white).filter(|(_, white)| !**white) {
                let left = column * SQUARE_PX + inset + k % 7 * cell_px;
                blacken(left, row * SQUARE_PX + inset + k / 7 * cell_px, cell_px);
            }
        }
        let mut finder = TargetFinder::new(target).expect("a finder");
        let corners = finder
            .find(picture.as_raw(), [width, height])
            .expect("corners");
        assert_eq!(corners.len(), 20, "starts white: {starts_white}");
        for corner in corners {
            // A square of 70 mm is one of 70 pixels; the picture begins half a pixel before its first pixel's centre.
            let expected_px = corner.target_m * 1000.0 + f64::from(rim_px) - 0.5;
            let off_px = corner.pixel.distance(expected_px);
            assert!(off_px < 0.02, "{off_px} px off at {expected_px}");
        }
    }
}

#[test]
fn a_board_whose_first_column_is_outside_the_picture_keeps_its_own_corners() {
    // With an even number of rows what is left looks like the other layout without its last column.
    let print = Print::charuco();
    let mut finder = TargetFinder::new(charuco()).expect("a finder");
    for (place, tilt_deg) in [
        (-0.62, [15.0, -15.0]),
        (-0.6, [0.0, 0.0]),
        (0.62, [5.0, 20.0]),
    ] {
        let camera_from_target = pose(print, [place, 0.1], 0.42, tilt_deg, 2.0);
        let grey = Photographer::straight().photograph(print, &camera_from_target, 1.0);
        let corners = finder.find(&grey, CAMERA.size_px).expect("corners");
        assert!(corners.len() >= 25, "{}", corners.len());
        for corner in corners {
            let place = camera_from_target.transform_point3(corner.target_m.extend(0.0));
            let expected_px = CAMERA.pixel_from_plane(place.truncate() / place.z);
            let off_px = corner.pixel.distance(expected_px);
            assert!(off_px < 0.15, "{off_px} px off at {expected_px}");
        }
    }
}

#[test]
fn a_view_that_does_not_fit_is_left_out() {
    let print = Print::chessboard();
    let photographer = Photographer::bent();
    let poses = good_poses(print);
    let mut views = shown(photographer, print, chessboard(), &poses);
    // Another print, from a printer that stretches.
    let odd = pose(print, [0.1, 0.1], 0.42, [-20.0, 14.0], 12.0);
    let grey = photographer.photograph(print, &odd, 1.03);
    assert_eq!(
        views.look(99, &grey, CAMERA.size_px).expect("a look"),
        TargetLook::Kept
    );
    let found = solve(&views).expect("a calibration");
    let dropped: Vec<u32> = found.dropped.iter().map(|&(picture, _)| picture).collect();
    assert_eq!(dropped, [99]);
    assert_camera(&found, &BENT_CAMERA, 0.5);
}

#[test]
fn a_view_like_another_adds_nothing() {
    let print = Print::chessboard();
    let photographer = Photographer::straight();
    let mut views = Views::new(chessboard()).expect("a finder");
    for (number, shift) in [(0, 0.0), (1, 0.004), (2, 0.4)] {
        let pose = pose(print, [shift, 0.0], 0.5, [20.0, 0.0], 0.0);
        let grey = photographer.photograph(print, &pose, 1.0);
        let expected = if number == 1 {
            TargetLook::Alike
        } else {
            TargetLook::Kept
        };
        assert_eq!(
            views.look(number, &grey, CAMERA.size_px).expect("a look"),
            expected
        );
    }
    let blank = vec![128; 640 * 480];
    assert_eq!(
        views.look(3, &blank, [640, 480]).expect("a look"),
        TargetLook::NoTarget
    );
    assert_eq!(
        (views.looked(), views.found(), views.kept().len()),
        (4, 3, 2)
    );
    let lacks = views.lacks();
    assert!(
        lacks.contains(&Lack::Views { have: 2 }) && lacks.contains(&Lack::Tilt { have: 2 }),
        "{lacks:?}"
    );
    let missing = lacks.iter().find_map(|lack| match lack {
        Lack::Coverage { missing, .. } => Some(missing),
        _ => None,
    });
    assert!(missing.expect("little coverage").contains(&"top left"));
    let error = solve(&views).expect_err("too few");
    assert!(
        matches!(
            error,
            CalibrateError::TooFewViews {
                looked: 4,
                found: 3
            }
        ),
        "{error}"
    );
}

#[test]
fn what_tells_no_focal_length_is_refused() {
    let print = Print::chessboard();
    let frontal: Vec<DAffine3> = [
        [-0.3, -0.3],
        [0.3, -0.3],
        [0.3, 0.3],
        [-0.3, 0.3],
        [0.0, 0.0],
        [0.0, 0.2],
    ]
    .into_iter()
    .map(|place| pose(print, place, 0.5, [0.0, 0.0], 0.0))
    .collect();
    let views = shown(Photographer::straight(), print, chessboard(), &frontal);
    assert!(views.lacks().contains(&Lack::Tilt { have: 0 }));
    let error = solve(&views).expect_err("no focal length");
    assert!(
        matches!(error, CalibrateError::Degenerate { .. }),
        "{error}"
    );
    let still = [pose(print, [0.0, 0.0], 0.5, [20.0, 5.0], 0.0); 6];
    let views = shown(Photographer::straight(), print, chessboard(), &still);
    let error = solve(&views).expect_err("one view");
    assert!(
        matches!(
            error,
            CalibrateError::Alike {
                found: 6,
                different: 1
            }
        ),
        "{error}"
    );
}

#[test]
fn the_command_writes_what_scenes_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let print = Print::chessboard();
    for (k, pose) in good_poses(print).iter().enumerate() {
        let grey = Photographer::bent().photograph(print, pose, 1.0);
        let path = folder.path().join(format!("views/{k}.png"));
        write_grey_png(&path, CAMERA.size_px, &grey);
    }
    // One by one, with a broken one among them: all that can be read is used, and the broken one named.
    write_bytes(&folder.path().join("broken.png"), b"no picture").expect("a file");
    let one_by_one: Vec<String> = (0..15).map(|k| format!("views/{k}.png")).collect();
    let output = gnomon(
        folder.path(),
        &format!(
            "calibrate {} broken.png {CHESSBOARD} --out one.toml",
            one_by_one.join(" ")
        ),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && said.contains("broken.png"),
        "{said}"
    );
    assert!(String::from_utf8_lossy(&output.stdout).contains("15 used"));
    let output = gnomon(
        folder.path(),
        &format!("calibrate views {CHESSBOARD} --out camera.toml --coverage coverage.png"),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.is_empty(), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    for part in ["frame 14", "15 used", "focal length", "±", "k1 -0.2"] {
        assert!(printed.contains(part), "{part:?} is not in {printed}");
    }
    let found = load_calibration(&folder.path().join("camera.toml")).expect("a calibration");
    assert!(farthest_px(&found, &BENT_CAMERA) < 0.5, "{found:?}");
    let coverage = image::open(folder.path().join("coverage.png"))
        .expect("a picture")
        .into_rgb8();
    assert!(coverage.width() >= 640 && coverage.height() > 480);
}

/// A camera whose axis is far from the middle: it tells which way up a picture is.
const LOPSIDED: Intrinsics = Intrinsics {
    center_px: DVec2::new(350.0, 222.0),
    ..BENT_CAMERA
};

/// A JPEG that says in its EXIF how the camera was held.
fn write_jpeg(path: &Path, grey: &[u8], orientation: u16) {
    let mut jpeg = Vec::new();
    let [width, height] = CAMERA.size_px;
    image::codecs::jpeg::JpegEncoder::new_with_quality(&mut jpeg, 98)
        .encode(grey, width, height, image::ExtendedColorType::L8)
        .expect("a picture");
    // One entry, tag 0x0112, a short: TIFF 6.0, section 2.
    let mut segment = b"Exif\0\0II*\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".to_vec();
    segment.extend(orientation.to_le_bytes());
    segment.extend([0; 6]);
    let length = (segment.len() as u16 + 2).to_be_bytes();
    let mut bytes = vec![0xff, 0xd8, 0xff, 0xe1, length[0], length[1]];
    bytes.extend(segment);
    bytes.extend(&jpeg[2..]);
    write_bytes(path, &bytes).expect("a picture");
}

#[test]
fn pictures_that_were_taken_upright_are_of_the_same_camera() {
    let folder = tempfile::tempdir().expect("a folder");
    let print = Print::chessboard();
    let photographer = Photographer::new(LOPSIDED);
    let [width, height] = CAMERA.size_px;
    for (k, pose) in good_poses(print).iter().enumerate() {
        let grey = photographer.photograph(print, pose, 1.0);
        match k % 5 {
            // Held upright, upside down, the other way: the file says so.
            0 => write_jpeg(&folder.path().join(format!("views/{k}.jpg")), &grey, 6),
            1 => write_jpeg(&folder.path().join(format!("views/{k}.jpg")), &grey, 3),
            2 => write_jpeg(&folder.path().join(format!("views/{k}.jpg")), &grey, 1),
            3 => write_grey_png(
                &folder.path().join(format!("views/{k}.png")),
                [width, height],
                &grey,
            ),
            // Turned by a program that has left no word of which way.
            _ => {
                let picture = image::GrayImage::from_raw(width, height, grey).expect("a picture");
                let turned = match k % 2 {
                    0 => image::imageops::rotate90(&picture),
                    _ => image::imageops::rotate270(&picture),
                };
                let path = folder.path().join(format!("views/{k}.png"));
                write_grey_png(&path, [height, width], turned.as_raw());
            }
        }
    }
    // A thumbnail among them.
    write_grey_png(
        &folder.path().join("views/small.png"),
        [64, 48],
        &[90; 64 * 48],
    );
    let output = gnomon(
        folder.path(),
        &format!("calibrate views {CHESSBOARD} --out camera.toml"),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    for part in [
        "frame 15: 64 x 48 pixels, most have 640 x 480; left out",
        "15 used",
    ] {
        assert!(printed.contains(part), "{part:?} is not in {printed}");
    }
    let found = load_calibration(&folder.path().join("camera.toml")).expect("a calibration");
    let off_px = (found.center_px - LOPSIDED.center_px).abs();
    assert!(off_px.max_element() < 2.0, "{found:?}");
    assert!(farthest_px(&found, &LOPSIDED) < 0.5, "{found:?}");
}

#[test]
fn pictures_that_are_all_upright_are_calibrated_as_they_are_shown() {
    let folder = tempfile::tempdir().expect("a folder");
    let print = Print::chessboard();
    let photographer = Photographer::new(LOPSIDED);
    for (k, pose) in good_poses(print).iter().enumerate() {
        let grey = photographer.photograph(print, pose, 1.0);
        write_jpeg(&folder.path().join(format!("views/{k}.jpg")), &grey, 6);
    }
    let output = gnomon(
        folder.path(),
        &format!("calibrate views {CHESSBOARD} --out camera.toml"),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    let found = load_calibration(&folder.path().join("camera.toml")).expect("a calibration");
    // Turned clockwise: what was up is right.
    assert_eq!(found.size_px, [480, 640]);
    let center_px = DVec2::new(479.0 - LOPSIDED.center_px.y, LOPSIDED.center_px.x);
    assert!(
        (found.center_px - center_px).abs().max_element() < 2.0,
        "{found:?}"
    );
    let off = (found.focal_px.yx() / LOPSIDED.focal_px - 1.0).abs();
    assert!(off.max_element() < 2e-3, "{found:?}");
}

#[test]
fn columns_for_rows_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    let print = Print::charuco();
    for (k, pose) in good_poses(print).iter().take(6).enumerate() {
        let grey = Photographer::straight().photograph(print, pose, 1.0);
        let path = folder.path().join(format!("views/{k}.png"));
        write_grey_png(&path, CAMERA.size_px, &grey);
    }
    let swapped = CHARUCO.replace("9x6", "6x9");
    let output = gnomon(
        folder.path(),
        &format!("calibrate views {swapped} --out camera.toml"),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(!output.status.success(), "{said}");
    let part = "6 of 6 pictures show a ChArUco board of 9 x 6 squares, not of 6 x 9: its columns come first (--charuco \
                9x6)";
    assert!(said.contains(part), "{said}");
    assert!(!folder.path().join("camera.toml").exists());
}

#[test]
fn mistakes_are_told_and_leave_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    let grey = |side: usize| vec![90; side * 480];
    let path = |name: &str| folder.path().join(name);
    write_grey_png(&path("wall/0.png"), [640, 480], &grey(640));
    write_grey_png(&path("sizes/0.png"), [640, 480], &grey(640));
    write_grey_png(&path("sizes/1.png"), [600, 480], &grey(600));
    std::fs::create_dir(path("empty")).expect("a folder");
    let written = "--out out/camera.toml --coverage out/c.png";
    let chessboard = format!("{CHESSBOARD} {written}");
    for (arguments, parts) in [
        (
            format!("wall {chessboard}"),
            vec!["none of 1 pictures", "8 x 5 inner corners", "whole"],
        ),
        (
            format!("sizes {chessboard}"),
            vec!["none of 1 pictures", "8 x 5 inner corners"],
        ),
        (
            format!("empty {chessboard}"),
            vec!["empty", "neither a video"],
        ),
        (
            format!("nowhere {chessboard}"),
            vec!["nowhere", "no such file"],
        ),
        (
            format!("wall {CHESSBOARD} --out out/camera.yml"),
            vec![".toml"],
        ),
        (
            format!("wall --chessboard 2x5 --square-mm 25 {written}"),
            vec!["2 x 5 inner corners", "at least 3 x 3"],
        ),
        (
            format!("wall --chessboard 8x5 --square-mm 0 {written}"),
            vec!["0 mm", "1 to 2000 mm"],
        ),
        (
            format!("wall --chessboard 8x5 {written}"),
            vec!["--square-mm"],
        ),
        (
            format!("wall --charuco 9x6 --square-mm 25 {written}"),
            vec!["--marker-mm"],
        ),
        (
            format!("wall --charuco 9x6 --square-mm 25 --marker-mm 24 {written}"),
            vec!["24 mm", "7.5 to 22.5 mm"],
        ),
        (
            format!("wall {CHARUCO} {CHESSBOARD} {written}"),
            vec!["cannot be used"],
        ),
        (
            format!("wall {CHARUCO} {written}"),
            vec!["9 x 6 squares", "dictionary"],
        ),
        (format!("wall {written}"), vec!["--chessboard", "--charuco"]),
        (
            format!("wall {CHESSBOARD} --out wall/camera.toml"),
            vec!["wall/camera.toml", "write elsewhere"],
        ),
    ] {
        refused(folder.path(), &arguments, &parts);
    }
}

/// A run that must fail, say each of `parts`, and write nothing.
fn refused(folder: &Path, arguments: &str, parts: &[&str]) {
    let output = gnomon(folder, &format!("calibrate {arguments}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(
        !output.status.success() && !said.contains("panicked"),
        "{arguments:?}: {said}"
    );
    assert!(output.stdout.is_empty());
    for part in parts {
        assert!(said.contains(part), "{arguments:?} lacks {part:?}: {said}");
    }
    assert!(
        !folder.join("out").exists() && !folder.join("wall/camera.toml").exists(),
        "{arguments:?}"
    );
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/real")]
fn the_photographs_of_a_wall_give_their_cameras_calibration() {
    let folder = photographs::photographs("swatbotics/mapping_feb_2014/calibration");
    let here = tempfile::tempdir().expect("a folder");
    let arguments = "--chessboard 7x5 --square-mm 30 --out camera.toml";
    let output = gnomon(
        here.path(),
        &format!("calibrate {} {arguments}", folder.display()),
    );
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{said}");
    // The board never comes near the picture's corners.
    assert!(said.contains("corners in 48 % of the picture"), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(
        printed.contains("17 pictures, 17 show the target"),
        "{printed}"
    );
    let found = load_calibration(&here.path().join("camera.toml")).expect("a calibration");
    // What its owners found: within two standard deviations, and no worse a fit than OpenCV's finder gives (0.207 px).
    let off_px = (found.focal_px - DVec2::new(765.00, 764.18)).abs();
    assert!(off_px.max_element() < 4.0, "{found:?}");
    // Theirs has no tangential terms, which take 10 px of the centre's height here.
    let off_px = (found.center_px - DVec2::new(393.72, 304.66)).abs();
    assert!(off_px.x < 4.0 && off_px.y < 15.0, "{found:?}");
    let rms_px = printed
        .split("15 used: ")
        .nth(1)
        .and_then(|rest| rest.split(' ').next());
    let rms_px: f64 = rms_px.expect("a total").parse().expect("a number");
    assert!(rms_px < 0.2, "{rms_px}");
}

#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/real")]
fn a_photographed_charuco_board_is_found_whole() {
    let folder = photographs::photographs("opencv_tutorial");
    let target = charuco_of([5, 7], 0.04, 0.02, "DICT_6X6_250");
    let mut finder = TargetFinder::new(target).expect("a finder");
    for (name, fewest) in [("choriginal.jpg", 24), ("chocclusion_original.jpg", 12)] {
        let frame = photographs::read_photograph(&folder.join(name));
        let grey = crate::common::sheets::grey_of(&frame);
        let corners = finder.find(&grey, frame.size_px).expect("corners");
        assert!(
            (fewest..=24).contains(&corners.len()),
            "{name}: {}",
            corners.len()
        );
        // Each column of corners is straight but for the lens.
        for column in 1..5 {
            let points: Vec<DVec2> = corners
                .iter()
                .filter(|corner| (corner.target_m.x - 0.04 * f64::from(column)).abs() < 1e-9)
                .map(|corner| corner.pixel)
                .collect();
            let (Some(&first), Some(&last)) = (points.first(), points.last()) else {
                continue;
            };
            let across = (last - first).perp().normalize_or_zero();
            for point in &points {
                let off_px = (point - first).dot(across).abs();
                assert!(off_px < 1.0, "{name}: {off_px:.2} px off the line");
            }
        }
    }
}
