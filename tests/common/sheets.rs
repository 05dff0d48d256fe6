//! Sheets of markers as printed, photographed through a known camera; written down here so that no library under test
//! draws its own question.

use std::f64::consts::PI;

use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::{Anchor, Codes, Family, Marker};

pub const CAMERA: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::new(615.0, 613.0),
    center_px: DVec2::new(321.4, 238.2),
    distortion: [0.0; 5],
};

pub const WIDE_CAMERA: Intrinsics = Intrinsics {
    distortion: [-0.28, 0.09, 0.0015, -0.001, -0.01],
    ..CAMERA
};

/// The cells of a marker as printed, without its black border; `#` is white.
pub fn printed(family: Family, id: u32) -> &'static [&'static str] {
    match (family.codes(), id) {
        (Codes::Tag36h11, 0) => &["##.#.#", ".###.#", ".##...", "#.#...", ".#.##.", "...#.."],
        (Codes::Tag36h11, 1) => &["##.##.", ".#.###", "####..", ".##...", "#.##.#", "..#..#"],
        (Codes::Tag36h11, 2) => &["##.###", ".#..#.", "#.....", "..#..#", "...#..", "..###."],
        (Codes::Tag36h11, 17) => &[".##.#.", "....##", "#.###.", "##.##.", "##...#", "..##.."],
        // The bytes 181, 50 of OpenCV's DICT_4X4_50.
        (Codes::Aruco { cells: 4, .. }, 0) => &["#.##", ".#.#", "..##", "..#."],
        _ => panic!("not written down: {} {id}", family),
    }
}

pub fn marker(id: u32, size_m: f64, x_m: f64, y_m: f64) -> Marker {
    Marker {
        family: Family::TAG36H11,
        id,
        size_m,
        center_m: DVec2::new(x_m, y_m),
        rotation_rad: 0.0,
    }
}

pub fn anchor(name: &str, markers: &[Marker]) -> Anchor {
    Anchor {
        name: name.into(),
        markers: markers.to_vec(),
    }
}

/// Whether a marker prints white or black at a point of its anchor's plane; `None` beside it.
pub fn is_white(marker: &Marker, point_m: DVec2) -> Option<bool> {
    let local = DVec2::from_angle(-marker.rotation_rad).rotate(point_m - marker.center_m);
    let cells = printed(marker.family, marker.id);
    let border = marker.family.border_cells() as i32;
    let across = cells.len() as i32 + 2 * border;
    // In cells from the black square's top left corner.
    let column = ((local.x / marker.size_m + 0.5) * f64::from(across)).floor() as i32;
    let row = ((0.5 - local.y / marker.size_m) * f64::from(across)).floor() as i32;
    if !(0..across).contains(&column) || !(0..across).contains(&row) {
        return None;
    }
    let cell = |row: i32, column: i32| {
        Some(cells.get(row as usize)?.as_bytes().get(column as usize)? == &b'#')
    };
    Some(cell(row - border, column - border).unwrap_or(false))
}

/// Linear light from a sheet: its markers on white paper that reaches half a marker beyond them; `None` beside the paper.
pub fn sheet_level(markers: &[Marker], point_m: DVec2) -> Option<f64> {
    let print = markers.iter().find_map(|marker| is_white(marker, point_m));
    let on_paper = || {
        let beyond = |marker: &Marker| DVec2::splat(marker.size_m);
        let low = markers
            .iter()
            .map(|m| m.center_m - beyond(m))
            .reduce(DVec2::min)?;
        let high = markers
            .iter()
            .map(|m| m.center_m + beyond(m))
            .reduce(DVec2::max)?;
        (point_m.cmpge(low).all() && point_m.cmple(high).all()).then_some(true)
    };
    print
        .or_else(on_paper)
        .map(|white| if white { 0.8 } else { 0.02 })
}

/// A camera on which the sheet stands upright, tilted by `tilt_deg` about the picture's x and turned by `turn_deg`.
pub fn camera_above(tilt_deg: f64, turn_deg: f64, at_m: DVec3) -> DAffine3 {
    let rotation = DQuat::from_rotation_x(tilt_deg.to_radians())
        * DQuat::from_rotation_x(PI)
        * DQuat::from_rotation_z(turn_deg.to_radians());
    DAffine3::from_rotation_translation(rotation, at_m)
}

/// Photographs sheets of markers, 4 × 4 samples a pixel.
pub fn photograph(camera: &Intrinsics, sheets: &[(&[Marker], DAffine3)], time_secs: f64) -> Frame {
    const SAMPLES: usize = 4;
    let anchors_from_camera = sheets
        .iter()
        .map(|(_, pose)| pose.inverse())
        .collect::<Vec<_>>();
    let [width, height] = camera.size_px;
    let mut rgba = Vec::with_capacity(4 * (width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            let mut sum = 0.0;
            for k in 0..SAMPLES * SAMPLES {
                let offset = DVec2::new((k % SAMPLES) as f64, (k / SAMPLES) as f64) + 0.5;
                let pixel = DVec2::new(f64::from(x), f64::from(y)) - 0.5 + offset / SAMPLES as f64;
                let target = camera.plane_from_pixel(pixel);
                let mut point = target;
                if camera.distortion != [0.0; 5] {
                    for _ in 0..15 {
                        point += target - camera.distort(point);
                    }
                }
                let level = sheets.iter().zip(&anchors_from_camera).find_map(
                    |((markers, _), anchor_from_camera)| {
                        let eye = anchor_from_camera.translation;
                        let ray = anchor_from_camera.transform_vector3(point.extend(1.0));
                        let on_sheet = (eye - ray * (eye.z / ray.z)).truncate();
                        sheet_level(markers, on_sheet)
                    },
                );
                sum += level.unwrap_or(0.25);
            }
            let linear: f64 = sum / (SAMPLES * SAMPLES) as f64;
            let encoded = 1.055 * linear.powf(1.0 / 2.4) - 0.055;
            let grey = (255.0 * encoded).round() as u8;
            rgba.extend([grey, grey, grey, 255]);
        }
    }
    Frame {
        index: 0,
        time_secs,
        size_px: camera.size_px,
        rgba,
    }
}
