//! Sheets of markers as printed, and what a camera sees of them. The prints are written down here, so that no library
//! under test draws its own question.

use std::f64::consts::{FRAC_PI_2, PI};

use glam::{DAffine3, DQuat, DVec2, DVec3};

use crate::capture::Frame;
use crate::geometry::camera::Intrinsics;
use crate::light::srgb::srgb_from_linear;
use crate::scene::{Codes, Face, Family, Marker};

/// Linear light of paper, of ink, and of what lies around.
const PAPER: f64 = 0.8;
const INK: f64 = 0.02;
const SURROUNDINGS: f64 = 0.25;

/// The turns that bring a face that looks along z to each side of a cube.
pub fn cube_sides() -> [DQuat; 6] {
    [
        DQuat::IDENTITY,
        DQuat::from_rotation_x(FRAC_PI_2),
        DQuat::from_rotation_y(FRAC_PI_2),
        DQuat::from_rotation_x(-FRAC_PI_2),
        DQuat::from_rotation_y(-FRAC_PI_2),
        DQuat::from_rotation_x(PI),
    ]
}

/// Markers of 40 mm on the sides of a cube with edges of 80 mm around the origin.
pub fn cube() -> Vec<Marker> {
    let placed = |(id, side): (u32, DQuat)| Marker {
        anchor_from_marker: DAffine3::from_rotation_translation(side, side * DVec3::Z * 0.04),
        ..Marker::alone(Family::TAG36H11, id, 0.04)
    };
    (0..6).zip(cube_sides()).map(placed).collect()
}

/// The cells of a marker as printed, without its black border; `#` is white. `None` for those not written down.
pub fn printed(family: Family, id: u32) -> Option<&'static [&'static str]> {
    let cells: &[&str] = match (family.codes(), id) {
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
        _ => return None,
    };
    Some(cells)
}

/// A camera on which the sheet stands upright, tilted by `tilt_deg` about the picture's x and turned by `turn_deg`.
pub fn camera_above(tilt_deg: f64, turn_deg: f64, at_m: DVec3) -> DAffine3 {
    let rotation = DQuat::from_rotation_x(tilt_deg.to_radians())
        * DQuat::from_rotation_x(PI)
        * DQuat::from_rotation_z(turn_deg.to_radians());
    DAffine3::from_rotation_translation(rotation, at_m)
}

/// Whether a marker prints white or black at a point of its anchor's plane, metres; `None` beside it.
pub fn is_white(marker: &Marker, point_m: DVec2) -> Option<bool> {
    let offset_m = point_m - marker.center_m().truncate();
    if offset_m.abs().max_element() > marker.size_m {
        return None;
    }
    let local = DVec2::from_angle(-marker.rotation_rad()).rotate(offset_m);
    let cells = printed(marker.family, marker.id)?;
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
    let low = markers.iter().map(|m| m.center_m().truncate() - beyond(m));
    let high = markers.iter().map(|m| m.center_m().truncate() + beyond(m));
    [
        low.fold(DVec2::MAX, DVec2::min),
        high.fold(DVec2::MIN, DVec2::max),
    ]
}

/// A point of a sheet on a ray.
struct SheetPoint {
    /// How far along the ray it is, in the ray's lengths.
    along: f64,
    /// Linear.
    light: f64,
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
        if !camera.distortion.distorts() && corners.iter().all(|corner| corner.z > 1e-3) {
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

    /// What is seen along the ray through a point of the plane z = 1; `None` beside the paper.
    fn light(&self, point: DVec2) -> Option<SheetPoint> {
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
        let light = match (print, eye.z > 0.0) {
            // The back of a sheet is white.
            (Some(false), true) => INK,
            (Some(_), true) => PAPER,
            _ if on_paper => PAPER,
            _ => return None,
        };
        Some(SheetPoint { along, light })
    }
}

/// Linear light at each pixel of a camera, before it is encoded.
#[derive(Clone)]
pub struct Light {
    /// Width and height.
    pub size_px: [u32; 2],
    /// Rows from the top.
    pub values: Vec<f64>,
}

impl Light {
    /// Of sheets of markers, the first one on top.
    pub fn of(camera: &Intrinsics, sheets: &[(&[Marker], DAffine3)]) -> Self {
        Self::of_seen(camera, sheets, |seen| seen.next())
    }

    /// Of boards in space, each with its pose (camera from anchor): of all sheets the nearest is seen.
    pub fn of_boards(camera: &Intrinsics, boards: &[(&[Marker], DAffine3)]) -> Self {
        let faces: Vec<(Vec<Marker>, DAffine3)> = boards
            .iter()
            .flat_map(|(markers, camera_from_anchor)| {
                let faces = Face::all_of(markers).into_iter();
                faces.map(|face| (face.markers, *camera_from_anchor * face.anchor_from_face))
            })
            .collect();
        let sheets: Vec<(&[Marker], DAffine3)> = faces
            .iter()
            .map(|(markers, pose)| (markers.as_slice(), *pose))
            .collect();
        Self::of_seen(camera, &sheets, |seen| {
            seen.min_by(|a, b| a.along.total_cmp(&b.along))
        })
    }

    /// Of sheets of markers of which `seen` chooses one along each ray; 16 samples a pixel, no two of them in one row or
    /// column, since an edge that runs along the rows of a grid lies where a row is, not where it is.
    fn of_seen(
        camera: &Intrinsics,
        sheets: &[(&[Marker], DAffine3)],
        seen: impl Fn(&mut dyn Iterator<Item = SheetPoint>) -> Option<SheetPoint>,
    ) -> Self {
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
                if camera.distortion.distorts() {
                    for _ in 0..15 {
                        point += target - camera.distort(point);
                    }
                }
                let mut on_ray = views.iter().filter_map(|view| view.light(point));
                seen(&mut on_ray).map_or(SURROUNDINGS, |seen| seen.light)
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
            let grey = (255.0 * srgb_from_linear(linear)).round() as u8;
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
