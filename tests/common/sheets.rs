//! Sheets of markers as printed, and what a camera sees of them. The prints are written down here, so that no library
//! under test draws its own question.

use std::f64::consts::PI;

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use gnomon::capture::Frame;
use gnomon::geometry::camera::Intrinsics;
use gnomon::scene::{Anchor, Codes, DetectorKind, Family, Marker, Search, TrackingSettings};
use gnomon::tracking::{AnchorPose, Tracker};

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

/// Frames of the sequences follow each other so fast, seconds.
pub const FRAME_SECS: f64 = 1.0 / 30.0;

/// Linear light of paper, of ink, and of what lies around.
const PAPER: f64 = 0.8;
const INK: f64 = 0.02;
const SURROUNDINGS: f64 = 0.25;

/// The cells of a marker as printed, without its black border; `#` is white.
pub fn printed(family: Family, id: u32) -> &'static [&'static str] {
    match (family.codes(), id) {
        (Codes::Tag36h11, 0) => &["##.#.#", ".###.#", ".##...", "#.#...", ".#.##.", "...#.."],
        (Codes::Tag36h11, 1) => &["##.##.", ".#.###", "####..", ".##...", "#.##.#", "..#..#"],
        (Codes::Tag36h11, 2) => &["##.###", ".#..#.", "#.....", "..#..#", "...#..", "..###."],
        (Codes::Tag36h11, 3) => &["###..#", "...###", "#..###", "#.#..#", "##..#.", ".##..."],
        (Codes::Tag36h11, 4) => &["###.#.", "####..", "#.####", "..#.#.", "#.....", "#...#."],
        (Codes::Tag36h11, 5) => &["####..", "##...#", "##.##.", "#.#.##", "..###.", "#.##.."],
        (Codes::Tag36h11, 6) => &[".....#", ".#.##.", "#.#..#", ".###.#", "....#.", "...#.#"],
        (Codes::Tag36h11, 7) => &["...#..", "...##.", ".#.#..", "#.###.", "...###", ".#.#.."],
        (Codes::Tag36h11, 8) => &["..#...", "#.#.##", "...###", ".#####", "###.#.", "#.##.#"],
        (Codes::Tag36h11, 9) => &["..#..#", "#..#.#", "#.#.##", ".#....", ".#...#", "##..#."],
        (Codes::Tag36h11, 17) => &[".##.#.", "....##", "#.###.", "##.##.", "##...#", "..##.."],
        // The bytes 181, 50 of OpenCV's DICT_4X4_50.
        (Codes::Aruco { cells: 4, .. }, 0) => &["#.##", ".#.#", "..##", "..#."],
        _ => panic!("not written down: {family} {id}"),
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

/// Four markers of 60 mm around the origin.
pub fn table() -> Vec<Marker> {
    vec![
        marker(0, 0.06, -0.09, 0.06),
        marker(1, 0.06, 0.09, 0.06),
        marker(2, 0.06, -0.09, -0.06),
        marker(17, 0.06, 0.09, -0.06),
    ]
}

pub fn settings(detector: DetectorKind) -> TrackingSettings {
    TrackingSettings {
        detector,
        ..TrackingSettings::default()
    }
}

/// What a program does that only calls a library: corners found anew in the whole of each picture, and a pose from
/// them.
pub fn detector_alone(detector: DetectorKind) -> TrackingSettings {
    TrackingSettings {
        search: Search::Full,
        pose_from_pixels: false,
        filter: false,
        ..settings(detector)
    }
}

pub fn tracker(settings: &TrackingSettings, anchors: &[Anchor], camera: Intrinsics) -> Tracker {
    Tracker::new(settings, anchors, camera).expect("a tracker")
}

pub fn track_once(
    settings: &TrackingSettings,
    anchors: &[Anchor],
    camera: Intrinsics,
    frame: &Frame,
) -> Vec<AnchorPose> {
    tracker(settings, anchors, camera)
        .track(frame)
        .expect("poses")
}

/// A camera on which the sheet stands upright, tilted by `tilt_deg` about the picture's x and turned by `turn_deg`.
pub fn camera_above(tilt_deg: f64, turn_deg: f64, at_m: DVec3) -> DAffine3 {
    let rotation = DQuat::from_rotation_x(tilt_deg.to_radians())
        * DQuat::from_rotation_x(PI)
        * DQuat::from_rotation_z(turn_deg.to_radians());
    DAffine3::from_rotation_translation(rotation, at_m)
}

/// Whether a marker prints white or black at a point of its anchor's plane; `None` beside it.
pub fn is_white(marker: &Marker, point_m: DVec2) -> Option<bool> {
    let offset_m = point_m - marker.center_m;
    if offset_m.abs().max_element() > marker.size_m {
        return None;
    }
    let local = DVec2::from_angle(-marker.rotation_rad).rotate(offset_m);
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

/// The rectangle of white paper around the markers of a sheet, half a marker beyond them, metres.
fn paper_m(markers: &[Marker]) -> [DVec2; 2] {
    let beyond = |marker: &Marker| DVec2::splat(marker.size_m);
    let low = markers.iter().map(|m| m.center_m - beyond(m));
    let high = markers.iter().map(|m| m.center_m + beyond(m));
    [
        low.reduce(DVec2::min).expect("a marker"),
        high.reduce(DVec2::max).expect("a marker"),
    ]
}

/// A sheet as the camera sees it.
struct SheetView<'a> {
    markers: &'a [Marker],
    paper_m: [DVec2; 2],
    anchor_from_camera: DAffine3,
    /// The pixels that it may touch: from, to (exclusive), as columns and rows.
    from: [u32; 2],
    to: [u32; 2],
}

impl<'a> SheetView<'a> {
    fn new(camera: &Intrinsics, markers: &'a [Marker], camera_from_anchor: &DAffine3) -> Self {
        let paper_m = paper_m(markers);
        let [low, high] = paper_m;
        let corners = [
            low,
            DVec2::new(high.x, low.y),
            high,
            DVec2::new(low.x, high.y),
        ]
        .map(|corner| camera_from_anchor.transform_point3(corner.extend(0.0)));
        let [width, height] = camera.size_px;
        let (mut from, mut to) = ([0, 0], [width, height]);
        // Distortion bends the sheet's edges, and what reaches behind the camera has no outline.
        if camera.distortion == [0.0; 5] && corners.iter().all(|corner| corner.z > 1e-3) {
            let pixels = corners.map(|c| camera.pixel_from_plane(c.truncate() / c.z));
            let low = pixels.into_iter().fold(pixels[0], DVec2::min) - 1.0;
            let high = pixels.into_iter().fold(pixels[0], DVec2::max) + 2.0;
            from = [low.x.max(0.0) as u32, low.y.max(0.0) as u32];
            to = [
                (high.x.max(0.0) as u32).min(width),
                (high.y.max(0.0) as u32).min(height),
            ];
        }
        Self {
            markers,
            paper_m,
            anchor_from_camera: camera_from_anchor.inverse(),
            from,
            to,
        }
    }

    fn may_touch(&self, x: u32, y: u32) -> bool {
        (self.from[0]..self.to[0]).contains(&x) && (self.from[1]..self.to[1]).contains(&y)
    }

    /// Light along the ray through a point of the plane z = 1; `None` beside the paper.
    fn light(&self, point: DVec2) -> Option<f64> {
        let eye = self.anchor_from_camera.translation;
        let ray = self.anchor_from_camera.transform_vector3(point.extend(1.0));
        let along = -eye.z / ray.z;
        if !(along > 0.0 && along.is_finite()) {
            return None;
        }
        let point_m = (eye + ray * along).truncate();
        let print = self
            .markers
            .iter()
            .find_map(|marker| is_white(marker, point_m));
        let [low, high] = self.paper_m;
        let on_paper = point_m.cmpge(low).all() && point_m.cmple(high).all();
        match print {
            Some(true) => Some(PAPER),
            Some(false) => Some(INK),
            None => on_paper.then_some(PAPER),
        }
    }
}

/// Linear light at each pixel of a camera, before it is encoded.
#[derive(Clone)]
pub struct Light {
    pub size_px: [u32; 2],
    /// Rows from the top.
    pub values: Vec<f64>,
}

impl Light {
    /// Of sheets of markers, the first one on top; 16 samples a pixel, no two of them in one row or column, since an edge
    /// that runs along the rows of a grid lies where a row is, not where it is.
    pub fn of(camera: &Intrinsics, sheets: &[(&[Marker], DAffine3)]) -> Self {
        const SAMPLES: usize = 16;
        let offsets: [DVec2; SAMPLES] = std::array::from_fn(|k| {
            let mirrored_bits = (k as u8).reverse_bits() >> 4;
            (DVec2::new(k as f64, f64::from(mirrored_bits)) + 0.5) / SAMPLES as f64 - 0.5
        });
        let views: Vec<SheetView<'_>> = sheets
            .iter()
            .map(|(markers, pose)| SheetView::new(camera, markers, pose))
            .collect();
        let [width, height] = camera.size_px;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let values = pixels.map(|(x, y)| {
            if !views.iter().any(|view| view.may_touch(x, y)) {
                return SURROUNDINGS;
            }
            let samples = offsets.map(|offset| {
                let pixel = DVec2::new(f64::from(x), f64::from(y)) + offset;
                let target = camera.plane_from_pixel(pixel);
                let mut point = target;
                if camera.distortion != [0.0; 5] {
                    for _ in 0..15 {
                        point += target - camera.distort(point);
                    }
                }
                let seen = views.iter().find_map(|view| view.light(point));
                seen.unwrap_or(SURROUNDINGS)
            });
            samples.iter().sum::<f64>() / SAMPLES as f64
        });
        Self {
            size_px: camera.size_px,
            values: values.collect(),
        }
    }

    /// What an exposure sums up while things move.
    pub fn mean(moments: &[Self]) -> Self {
        let mut mean = moments[0].clone();
        for (k, value) in mean.values.iter_mut().enumerate() {
            *value =
                moments.iter().map(|light| light.values[k]).sum::<f64>() / moments.len() as f64;
        }
        mean
    }

    /// Out of focus: a Gaussian of a standard deviation in pixels.
    pub fn blurred(&self, deviation_px: f64) -> Self {
        let reach = (4.0 * deviation_px).ceil() as isize;
        let kernel: Vec<f64> = (-reach..=reach)
            .map(|k| (-0.5 * (k as f64 / deviation_px).powi(2)).exp())
            .collect();
        let total: f64 = kernel.iter().sum();
        let [width, height] = self.size_px.map(|side| side as isize);
        let along = |values: &[f64], step: [isize; 2]| -> Vec<f64> {
            let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
            pixels
                .map(|(x, y)| {
                    let weighed = kernel.iter().zip(-reach..).map(|(weight, k)| {
                        let x = (x + k * step[0]).clamp(0, width - 1);
                        let y = (y + k * step[1]).clamp(0, height - 1);
                        weight * values[(y * width + x) as usize]
                    });
                    weighed.sum::<f64>() / total
                })
                .collect()
        };
        Self {
            size_px: self.size_px,
            values: along(&along(&self.values, [1, 0]), [0, 1]),
        }
    }

    /// Each pixel's light made another; a pixel is told by its centre.
    pub fn changed(mut self, change: impl Fn(DVec2, f64) -> f64) -> Self {
        let width = self.size_px[0] as usize;
        for (k, value) in self.values.iter_mut().enumerate() {
            *value = change(DVec2::new((k % width) as f64, (k / width) as f64), *value);
        }
        self
    }

    /// As a camera encodes it: 8 bits of sRGB.
    pub fn frame(&self, time_secs: f64) -> Frame {
        let rgba = self.values.iter().flat_map(|&linear| {
            let encoded = match linear <= 0.003_130_8 {
                true => 12.92 * linear,
                false => 1.055 * linear.powf(1.0 / 2.4) - 0.055,
            };
            let grey = (255.0 * encoded.clamp(0.0, 1.0)).round() as u8;
            [grey, grey, grey, 255]
        });
        Frame {
            index: 0,
            time_secs,
            size_px: self.size_px,
            rgba: rgba.collect(),
        }
    }
}

/// Photographs sheets of markers.
pub fn photograph(camera: &Intrinsics, sheets: &[(&[Marker], DAffine3)], time_secs: f64) -> Frame {
    Light::of(camera, sheets).frame(time_secs)
}

/// A picture with the noise of a camera in the dark: Gaussian, of a standard deviation in levels, the same each time.
pub fn with_noise(frame: &Frame, deviation: f64, seed: u64) -> Frame {
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

pub fn grey_of(frame: &Frame) -> Vec<u8> {
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
pub fn true_corners_px(
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

/// How far a pose puts the corners of markers from where they are, in the mean, pixels.
pub fn shift_px(camera: &Intrinsics, markers: &[Marker], pose: &DAffine3, truth: &DAffine3) -> f64 {
    let corners = markers.iter().flat_map(|marker| {
        let found = true_corners_px(camera, marker, pose);
        let right = true_corners_px(camera, marker, truth);
        std::array::from_fn::<f64, 4, _>(|k| found[k].distance(right[k]))
    });
    corners.sum::<f64>() / (4 * markers.len()) as f64
}

pub fn angle_between_deg(a: &DAffine3, b: &DAffine3) -> f64 {
    DQuat::from_mat3(&a.matrix3)
        .angle_between(DQuat::from_mat3(&b.matrix3))
        .to_degrees()
}

/// A pose turned about the anchor's origin by a vector in camera axes, radians, and shifted, metres.
pub fn turned(pose: &DAffine3, turn: DVec3, shift_m: DVec3) -> DAffine3 {
    DAffine3::from_mat3_translation(
        DMat3::from_quat(DQuat::from_scaled_axis(turn)) * pose.matrix3,
        pose.translation + shift_m,
    )
}

/// The noise of a hand about its rest: smooth, of some hertz, each coordinate between -1 and 1. Others with other seeds.
pub fn sway(time_secs: f64, seed: u64) -> [f64; 6] {
    std::array::from_fn(|k| {
        let phase = seed as f64 * 1.37 + k as f64 * 2.11;
        let hertz = 0.7 + 0.31 * ((seed + 3 * k as u64) % 7) as f64;
        let slow = (std::f64::consts::TAU * hertz * time_secs + phase).sin();
        let fast = (std::f64::consts::TAU * 2.3 * hertz * time_secs + 2.0 * phase).sin();
        0.75 * slow + 0.25 * fast
    })
}
