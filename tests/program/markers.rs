//! Sheets to print, read again: by a camera that looks straight at them, and number by number.

use std::path::Path;

use assert_cmd::Command;
use glam::{DMat3, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::scene::Scene;
use gnomon::tracking::{Status, Tracker};

fn gnomon(folder: &Path, arguments: &str) -> std::process::Output {
    Command::cargo_bin("gnomon")
        .expect("the binary")
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .output()
        .expect("a run")
}

fn written(folder: &Path, arguments: &str) {
    let output = gnomon(folder, arguments);
    assert!(output.status.success(), "{arguments}: {output:?}");
}

/// The scene that has the anchors of a block, and a camera that sees a page whole and true to size.
fn scene_of(folder: &Path, block: &str, picture: &str) -> Scene {
    let block = std::fs::read_to_string(folder.join(block)).expect("the block");
    let text =
        format!("[camera]\nsource = \"{picture}\"\n\n{block}\n[ambient]\nradiance = [1, 1, 1]\n");
    let file = folder.join("scene.toml");
    std::fs::write(&file, text).expect("a written scene");
    Scene::load(&file).unwrap_or_else(|error| panic!("{error}"))
}

/// A page as a camera 0.4 m above its middle sees it, whose pixels are the sheet's.
fn look_at(picture: &Path, dpi: f64) -> (Frame, Intrinsics) {
    let grey = image::open(picture).expect("the sheet").to_rgba8();
    let size_px = [grey.width(), grey.height()];
    let pixels_per_m = dpi / 0.0254;
    let intrinsics = Intrinsics {
        size_px,
        focal_px: DVec2::splat(0.4 * pixels_per_m),
        // Between the pixels' centres.
        center_px: DVec2::from(size_px.map(|side| f64::from(side) / 2.0 - 0.5)),
        distortion: Distortion::NONE,
    };
    let frame = Frame {
        index: 0,
        time_secs: 0.0,
        size_px,
        rgba: grey.into_raw(),
    };
    (frame, intrinsics)
}

#[test]
fn a_printed_board_lies_where_its_scene_says() {
    let folder = tempfile::tempdir().expect("a folder");
    for (family, border) in [("tag36h11", 1), ("tag36h11", 2), ("tag25h9", 1)] {
        written(
            folder.path(),
            &format!(
                "markers --board 3x2 --size-mm 45 --gap-mm 30 --landscape --family {family} --border-cells {border} \
                 --first-id 7 --name desk --dpi 150 --out sheets/board.png"
            ),
        );
        let scene = scene_of(folder.path(), "sheets/board.toml", "sheets/board.png");
        assert_eq!(scene.anchors[0].name, "desk");
        let ids: Vec<u32> = scene.anchors[0]
            .markers
            .iter()
            .map(|marker| marker.id)
            .collect();
        assert_eq!(ids, [7, 8, 9, 10, 11, 12]);
        let (frame, intrinsics) = look_at(&folder.path().join("sheets/board.png"), 150.0);
        let mut tracker =
            Tracker::new(&scene.tracking, &scene.anchors, intrinsics).expect("a tracker");
        let pose = &tracker.track(&frame).expect("poses")[0];
        assert_eq!(
            (pose.status, pose.markers),
            (Status::Tracked, 6),
            "{family} {border}"
        );
        let found = pose.camera_from_anchor.expect("a pose");
        // x right and y up as printed, seen from above; the board is in the middle of what the ruler leaves free.
        let upright = DMat3::from_diagonal(DVec3::new(1.0, -1.0, -1.0));
        assert!(
            found.matrix3.abs_diff_eq(upright, 1e-3),
            "{family} {border}: {found:?}"
        );
        let off_m = found.translation - DVec3::new(0.0, -0.008, 0.4);
        assert!(off_m.length() < 3e-4, "{family} {border}: {off_m} m off");
    }
}

#[test]
fn cards_are_anchors_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    written(
        folder.path(),
        "markers --ids 3,17,30 --size-mm 36 --dpi 150 --out cards.png",
    );
    let scene = scene_of(folder.path(), "cards.toml", "cards.png");
    assert_eq!(scene.anchors.len(), 3);
    let (frame, intrinsics) = look_at(&folder.path().join("cards.png"), 150.0);
    let mut tracker = Tracker::new(&scene.tracking, &scene.anchors, intrinsics).expect("a tracker");
    for pose in tracker.track(&frame).expect("poses") {
        let found = pose.camera_from_anchor.expect("a pose");
        assert!((found.translation.z - 0.4).abs() < 1e-3, "{found:?}");
    }
    // More than a page holds: a PDF has as many pages as it takes, a picture has one.
    let ids: Vec<String> = (0..40).map(|id| id.to_string()).collect();
    let many = format!("markers --ids {} --size-mm 36 --out", ids.join(","));
    written(folder.path(), &format!("{many} many.pdf"));
    let pdf = std::fs::read(folder.path().join("many.pdf")).expect("the file");
    let pages = String::from_utf8_lossy(&pdf)
        .matches("/Type /Page\n")
        .count();
    assert!(pages >= 2, "{pages} pages");
    let refused = gnomon(folder.path(), &format!("{many} many.svg"));
    assert!(!refused.status.success() && !folder.path().join("many.svg").exists());
    assert!(String::from_utf8_lossy(&refused.stderr).contains("give --out a .pdf"));
}

/// Left, top, width and height of every rectangle of an SVG's paths, millimetres.
fn rectangles(svg: &str) -> Vec<[f64; 4]> {
    svg.split("d=\"")
        .skip(1)
        .flat_map(|rest| rest.split('"').next().unwrap_or_default().split('z'))
        .filter(|rect| !rect.is_empty())
        .map(|rect| {
            let numbers: Vec<f64> = rect
                .split(['M', ' ', 'h', 'v'])
                .filter(|word| !word.is_empty())
                .map(|word| word.parse().expect("a number"))
                .collect();
            [numbers[0], numbers[1], numbers[2], numbers[3]]
        })
        .collect()
}

#[test]
fn millimetres_are_millimetres() {
    let folder = tempfile::tempdir().expect("a folder");
    let sheet = "markers --chessboard 9x6 --square-mm 25 --landscape --out";
    written(folder.path(), &format!("{sheet} chess.svg"));
    assert!(
        !folder.path().join("chess.toml").exists(),
        "a chessboard is no anchor"
    );
    let svg = std::fs::read_to_string(folder.path().join("chess.svg")).expect("the file");
    assert!(svg.contains("width=\"297mm\" height=\"210mm\" viewBox=\"0 0 297 210\""));
    let all = rectangles(&svg);
    let squares: Vec<_> = all
        .iter()
        .filter(|[.., w, h]| (*w, *h) == (25.0, 25.0))
        .collect();
    assert_eq!(squares.len(), 35, "half of ten by seven squares");
    let left = squares
        .iter()
        .map(|[x, ..]| *x)
        .fold(f64::INFINITY, f64::min);
    let right = squares.iter().map(|[x, ..]| *x + 25.0).fold(0.0, f64::max);
    assert!((right - left - 250.0).abs() < 1e-9 && (left + right - 297.0).abs() < 1e-9);
    // The ruler: a line of 100 mm, and ticks whose outer ends are as far apart.
    let ruler = all.iter().find(|[.., w, _]| *w == 100.0).expect("a ruler");
    let ticks: Vec<_> = all
        .iter()
        .filter(|[_, _, w, h]| *w == 0.2 && *h >= 2.0)
        .collect();
    assert_eq!(ticks.len(), 101);
    let first = ticks.iter().map(|[x, ..]| *x).fold(f64::INFINITY, f64::min);
    let last = ticks.iter().map(|[x, ..]| *x + 0.2).fold(0.0, f64::max);
    assert!((first - ruler[0]).abs() < 1e-9 && (last - first - 100.0).abs() < 1e-9);

    written(folder.path(), &format!("{sheet} chess.pdf"));
    let pdf = std::fs::read(folder.path().join("chess.pdf")).expect("the file");
    let pdf = String::from_utf8_lossy(&pdf);
    let points = |mm: f64| mm * 72.0 / 25.4;
    let numbers = |line: &str| -> Vec<f64> {
        let words = line.split([' ', '[', ']']);
        words.filter_map(|word| word.parse().ok()).collect()
    };
    let page = pdf
        .lines()
        .find(|line| line.contains("/MediaBox"))
        .expect("a page");
    let size = numbers(page);
    assert!((size[2] - points(297.0)).abs() < 0.01 && (size[3] - points(210.0)).abs() < 0.01);
    let drawn: Vec<_> = pdf
        .lines()
        .filter(|line| line.ends_with(" re"))
        .map(numbers)
        .collect();
    let of_size = |w: f64, h: f64| {
        let near = |a: f64, b: f64| (a - points(b)).abs() < 0.01;
        drawn
            .iter()
            .filter(|rect| near(rect[2], w) && near(rect[3], h))
            .count()
    };
    assert_eq!((of_size(25.0, 25.0), of_size(100.0, 0.2)), (35, 1));
}

#[test]
fn a_picture_says_its_resolution_and_what_it_shows() {
    let folder = tempfile::tempdir().expect("a folder");
    written(
        folder.path(),
        "markers --ids 3 --size-mm 40 --dpi 300 --out card.png",
    );
    let file = std::fs::File::open(folder.path().join("card.png")).expect("a file");
    let decoder = png::Decoder::new(std::io::BufReader::new(file));
    let mut reader = decoder.read_info().expect("a header");
    let dims = reader.info().pixel_dims.expect("a resolution");
    assert_eq!(
        (dims.xppu, dims.yppu, dims.unit),
        (11811, 11811, png::Unit::Meter)
    );
    let (width, height) = (reader.info().width as usize, reader.info().height as usize);
    assert_eq!((width, height), (2480, 3508), "210 x 297 mm at 300 dpi");
    let mut grey = vec![0; width * height];
    reader.next_frame(&mut grey).expect("pixels");
    // As in an SVG: two lines at the foot, which begin where the ruler does, and one below the card; capitals of 1.7 mm.
    let px = |mm: f64| (mm * 300.0 / 25.4).round() as usize;
    let dark = |left: f64, top: f64, right: f64, bottom: f64| {
        (px(top)..px(bottom))
            .flat_map(|y| (px(left)..px(right)).map(move |x| (x, y)))
            .filter(|&(x, y)| grey[y * width + x] < 128)
            .count()
    };
    let base = 297.0 - 8.0 - 4.0;
    written(folder.path(), "markers --ids 3 --size-mm 40 --out card.svg");
    let svg = std::fs::read_to_string(folder.path().join("card.svg")).expect("the file");
    assert!(svg.contains("tag36h11, 40 mm; page 210 x 297 mm"), "{svg}");
    let lines: Vec<(f64, f64)> = svg
        .split("<text x=\"")
        .skip(1)
        .map(|text| {
            let numbers: Vec<f64> = text
                .split('"')
                .step_by(2)
                .take(2)
                .map(|number| number.parse().expect("a number"))
                .collect();
            (numbers[0], numbers[1])
        })
        .collect();
    assert_eq!(lines.len(), 3);
    assert!(lines.iter().any(|&(_, y)| (y - base - 3.5).abs() < 1e-9));
    for (x, y) in lines {
        let written = dark(x, y - 1.8, x + 20.0, y);
        let inked = written as f64 / (px(20.0) * px(1.8)) as f64;
        assert!((0.08..0.5).contains(&inked), "{inked} at {x}, {y}");
        assert_eq!(dark(x, y - 2.4, x + 20.0, y - 1.9), 0, "above {x}, {y}");
    }
}

/// White and black cells of a sheet, looked at in the middle of each of `columns` x `rows` cells of a rectangle, pixels.
#[cfg(aruco_in_contrib)]
fn looked_at(
    grey: &image::GrayImage,
    [left, top, right, bottom]: [f64; 4],
    [columns, rows]: [usize; 2],
) -> Vec<bool> {
    let at = |low: f64, high: f64, k: usize, count: usize| {
        (low + (high - low) * (k as f64 + 0.5) / count as f64) as u32
    };
    (0..rows)
        .flat_map(|row| (0..columns).map(move |column| (column, row)))
        .map(|(column, row)| {
            let x = at(left, right, column, columns);
            let y = at(top, bottom, row, rows);
            grey.get_pixel(x, y).0[0] > 127
        })
        .collect()
}

/// OpenCV's own picture of a ChArUco board is the oracle. From 4.7 on it is in another module, with the same layout.
#[cfg(aruco_in_contrib)]
#[test]
fn a_charuco_sheet_is_the_board_that_opencv_draws() {
    use opencv::core::{Mat, Size};
    use opencv::prelude::*;

    let folder = tempfile::tempdir().expect("a folder");
    // Even and odd numbers of rows: before 4.6 the former began with a white square. 7 or 8 cells a marker, squares of
    // half as much again: all cells of the board are on one grid.
    for (name, number, [columns, rows], square_mm, marker_mm) in [
        ("DICT_5X5_100", 5, [5, 4], 28.0, 21.0),
        ("DICT_6X6_250", 10, [6, 5], 24.0, 16.0),
        ("DICT_4X4_50", 0, [3, 8], 24.0, 18.0),
    ] {
        written(
            folder.path(),
            &format!(
                "markers --charuco {columns}x{rows} --square-mm {square_mm} --marker-mm {marker_mm} \
                 --dictionary {name} --dpi 254 --out board.png"
            ),
        );
        let dictionary =
            opencv::aruco::get_predefined_dictionary_i32(number).expect("a dictionary");
        let mut board = opencv::aruco::CharucoBoard::create(
            columns,
            rows,
            square_mm as f32,
            marker_mm as f32,
            &dictionary,
        )
        .expect("a board");
        let mut drawn = Mat::default();
        let size = Size::new(columns * 240, rows * 240);
        board.draw(size, &mut drawn, 0, 1).expect("a picture");
        let drawn = image::GrayImage::from_raw(
            size.width as u32,
            size.height as u32,
            drawn.data_bytes().expect("pixels").to_vec(),
        )
        .expect("a picture");
        let sheet = image::open(folder.path().join("board.png"))
            .expect("the sheet")
            .into_luma8();
        // In the middle of what the ruler leaves free, ten pixels a millimetre.
        let [width, height] = [columns, rows].map(|count| f64::from(count) * square_mm * 10.0);
        let (left, top) = (1050.0 - width / 2.0, 1405.0 - height / 2.0);
        let cells = [columns, rows].map(|count| count as usize * 48);
        let ours = looked_at(&sheet, [left, top, left + width, top + height], cells);
        let theirs = looked_at(
            &drawn,
            [0.0, 0.0, f64::from(size.width), f64::from(size.height)],
            cells,
        );
        let off = ours.iter().zip(&theirs).filter(|(a, b)| a != b).count();
        // A point of the grid may lie on an edge of a cell, where OpenCV rounds to pixels.
        assert!(
            off < cells[0] * cells[1] / 100,
            "{name}: {off} of {}",
            cells[0] * cells[1]
        );
    }
}

#[test]
fn mistakes_say_what_is_allowed_and_leave_nothing() {
    let folder = tempfile::tempdir().expect("a folder");
    for (arguments, message) in [
        (
            "--board 9x9 --size-mm 45 --gap-mm 10 --out x.pdf",
            "3 columns and 5 rows",
        ),
        (
            "--board 3x2 --size-mm 45 --gap-mm 1 --out x.pdf",
            "at least one cell",
        ),
        (
            "--board 3 --size-mm 45 --gap-mm 10 --out x.pdf",
            "as in 9x6",
        ),
        ("--board 3x2 --size-mm 45 --out x.pdf", "--gap-mm"),
        ("--ids 587 --size-mm 36 --out x.pdf", "it has 0 to 586"),
        (
            "--ids 17,18,17 --size-mm 36 --out x.pdf",
            "--ids has 17 twice",
        ),
        ("--ids 1 --size-mm 300 --out x.pdf", "does not fit"),
        ("--ids 1 --size-mm nan --out x.pdf", "allowed: 3 to 400"),
        (
            "--ids 1 --size-mm 36 --family tag36h12 --out x.pdf",
            "tag36h11",
        ),
        ("--ids 1 --size-mm 36 --out x.doc", ".pdf, .svg or .png"),
        (
            "--ids 1 --size-mm 36 --dpi 0 --out x.png",
            "allowed: 50 to 2400",
        ),
        (
            "--chessboard 2x2 --square-mm 25 --out x.pdf",
            "at least 3 x 3",
        ),
        (
            "--charuco 12x9 --square-mm 25 --marker-mm 18 --out x.pdf",
            "7 x 10 squares",
        ),
        (
            "--charuco 5x7 --square-mm 25 --marker-mm 24 --out x.pdf",
            "allowed: 7.5 to 22.5",
        ),
        ("--charuco 5x7 --square-mm 25 --out x.pdf", "--marker-mm"),
        (
            "--charuco 5x7 --square-mm 25 --marker-mm 18 --dictionary DICT_9X9_50 --out x.pdf",
            "DICT_4X4_50",
        ),
        ("--out x.pdf", "--board"),
    ] {
        let output = gnomon(folder.path(), &format!("markers {arguments}"));
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success(), "{arguments}");
        assert!(told.contains(message), "{arguments}: {told}");
        let left = std::fs::read_dir(folder.path())
            .expect("the folder")
            .count();
        assert_eq!(left, 0, "{arguments}");
    }
}

/// The frame of a face in the piece to fold, and what it becomes when that is folded backwards along the line between it and
/// the face to whose right, or above or below which, it hangs.
fn folded(front: glam::DAffine3, steps: [f64; 2], edge_m: f64) -> glam::DAffine3 {
    let [right, up] = steps;
    let quarter = std::f64::consts::FRAC_PI_2;
    let to_line = DVec3::new(right, up, 0.0) * (edge_m / 2.0);
    let turn =
        glam::DQuat::from_rotation_y(quarter * right) * glam::DQuat::from_rotation_x(-quarter * up);
    front
        * glam::DAffine3::from_translation(to_line)
        * glam::DAffine3::from_quat(turn)
        * glam::DAffine3::from_translation(to_line)
}

#[test]
fn a_printed_cube_folds_into_the_board_beside_it() {
    let folder = tempfile::tempdir().expect("a folder");
    written(
        folder.path(),
        "markers --cube 55 --size-mm 41 --first-id 3 --landscape --name die --dpi 150 --out die.png",
    );
    let scene = scene_of(folder.path(), "die.toml", "die.png");
    let die = &scene.anchors[0];
    assert_eq!((die.name.as_str(), die.is_flat()), ("die", false));
    // Where the page has each marker, as lone ones.
    let (frame, intrinsics) = look_at(&folder.path().join("die.png"), 150.0);
    let mut tracker =
        Tracker::of_every_marker(&scene.tracking, (die.markers[0].family, 0.041), intrinsics)
            .expect("a tracker");
    let poses = tracker.track(&frame).expect("poses");
    let on_page_m = |id: u32| {
        let at = tracker
            .lone_anchors()
            .iter()
            .position(|lone| lone.markers[0].id == id);
        let pose = poses[at.expect("the marker")]
            .camera_from_anchor
            .expect("a pose");
        pose.translation
    };
    let edge_m = 0.055;
    let front = die.markers[0].anchor_from_marker;
    // Front, right, back, left, top, bottom: each where it hangs on the one before it in the page.
    let right = folded(front, [1.0, 0.0], edge_m);
    let wanted = [
        (3, front, [0.0, 0.0]),
        (4, right, [1.0, 0.0]),
        (5, folded(right, [1.0, 0.0], edge_m), [2.0, 0.0]),
        (6, folded(front, [-1.0, 0.0], edge_m), [-1.0, 0.0]),
        (7, folded(front, [0.0, 1.0], edge_m), [0.0, 1.0]),
        (8, folded(front, [0.0, -1.0], edge_m), [0.0, -1.0]),
    ];
    for (marker, (id, place, steps)) in die.markers.iter().zip(wanted) {
        assert_eq!(marker.id, id);
        assert!(
            marker.anchor_from_marker.abs_diff_eq(place, 1e-5),
            "{id}: {place}"
        );
        let off_m = on_page_m(id) - on_page_m(3);
        let expected_m = DVec3::new(steps[0], -steps[1], 0.0) * edge_m;
        assert!(
            (off_m - expected_m).truncate().length() < 3e-4,
            "{id}: {off_m}"
        );
    }
}

#[test]
fn faces_of_a_cube_that_is_too_large_for_one_piece_are_printed_one_by_one() {
    let folder = tempfile::tempdir().expect("a folder");
    written(
        folder.path(),
        "markers --cube 90 --size-mm 70 --out cube.pdf",
    );
    let scene = scene_of(folder.path(), "cube.toml", "cube.pdf");
    assert_eq!(scene.anchors[0].markers.len(), 6);
    assert!(
        scene.anchors[0]
            .markers
            .iter()
            .all(|marker| (marker.center_m().length() - 0.045).abs() < 1e-9)
    );
    for (arguments, part) in [
        (
            "markers --cube 50 --size-mm 45 --out a.pdf",
            "--cube 50 is out of range",
        ),
        (
            "markers --cube 300 --size-mm 45 --out a.pdf",
            "does not fit",
        ),
        ("markers --cube 60 --out a.pdf", "--size-mm"),
        (
            "markers --cube 60 --size-mm 40 --first-id 585 --out a.pdf",
            "586",
        ),
    ] {
        let output = gnomon(folder.path(), arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(
            !output.status.success() && said.contains(part),
            "{arguments}: {said}"
        );
    }
}
