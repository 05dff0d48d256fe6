//! Printed calibration targets, and photographs of them by known cameras.

use std::process::Command;
use std::sync::OnceLock;

use glam::{DAffine3, DQuat, DVec2};
use gnomon::geometry::camera::{Distortion, Intrinsics};

use super::sheets::CAMERA;

pub const CHESSBOARD: &str = "--chessboard 8x5 --square-mm 25";
pub const CHARUCO: &str = "--charuco 9x6 --square-mm 25 --marker-mm 18 --dictionary DICT_5X5_100";

pub const BENT_CAMERA: Intrinsics = Intrinsics {
    distortion: Distortion::Polynomial([-0.28, 0.09, 0.0015, -0.001, 0.0]),
    ..CAMERA
};

/// A page as it comes from the printer: black, 0 to 1, at 300 dpi, with the target's top left corner. Edges run over a few
/// dots, more than from one sample of a pixel to the next, so that samples add up to what a pixel sees.
pub struct Print {
    size_px: [u32; 2],
    black: Vec<f32>,
    /// On the page.
    target_corner_m: DVec2,
    /// Of the target.
    pub size_m: DVec2,
}

impl Print {
    /// Prints a target with 9 x 6 squares of 25 mm, which lie in the middle of what an A4 page on its side has room for.
    pub fn of(target: &str) -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let printed = Command::new(env!("CARGO_BIN_EXE_gnomon"))
            .current_dir(folder.path())
            .arg("markers")
            .args(target.split_whitespace())
            .args(["--landscape", "--out", "target.png"])
            .output()
            .expect("a run");
        assert!(printed.status.success());
        let picture = image::open(folder.path().join("target.png"))
            .expect("a page")
            .into_luma8();
        let (width, height) = picture.dimensions();
        let black: Vec<f32> = picture.iter().map(|&level| 1.0 - light_of(level)).collect();
        let size_m = DVec2::new(9.0, 6.0) * 0.025;
        let dot_m = 0.0254 / 300.0;
        // The first black dot of all is the corner of the top left square.
        let first = black
            .iter()
            .position(|&black| black > 0.5)
            .expect("a square") as u32;
        Self {
            size_px: [width, height],
            black: smeared(
                &smeared(&black, width as usize, 1),
                width as usize,
                width as usize,
            ),
            target_corner_m: DVec2::new(f64::from(first % width), f64::from(first / width)) * dot_m,
            size_m,
        }
    }

    pub fn chessboard() -> &'static Self {
        static PRINT: OnceLock<Print> = OnceLock::new();
        PRINT.get_or_init(|| Self::of(CHESSBOARD))
    }

    pub fn charuco() -> &'static Self {
        static PRINT: OnceLock<Print> = OnceLock::new();
        PRINT.get_or_init(|| Self::of(CHARUCO))
    }

    /// Light that a place of the target throws back; `None` beside the paper.
    pub fn light(&self, target_m: DVec2) -> Option<f32> {
        const DOTS_PER_M: f64 = 300.0 / 0.0254;
        // From the first dot's middle.
        let dot = (target_m + self.target_corner_m) * DOTS_PER_M - 0.5;
        let last = DVec2::new(f64::from(self.size_px[0]), f64::from(self.size_px[1])) - 1.0;
        if dot.min_element() < 0.0 || dot.cmpge(last).any() {
            return None;
        }
        let (column, row) = (dot.x as usize, dot.y as usize);
        let black = |right: usize, down: usize| {
            self.black[(row + down) * self.size_px[0] as usize + column + right]
        };
        let (right, down) = (dot.x.fract() as f32, dot.y.fract() as f32);
        let upper = black(0, 0) * (1.0 - right) + black(1, 0) * right;
        let lower = black(0, 1) * (1.0 - right) + black(1, 1) * right;
        Some(0.8 - 0.78 * (upper * (1.0 - down) + lower * down))
    }
}

fn light_of(level: u8) -> f32 {
    let encoded = f32::from(level) / 255.0;
    if encoded <= 0.04045 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

/// The mean of five neighbours, `step` apart; the page's rim is white.
fn smeared(black: &[f32], width: usize, step: usize) -> Vec<f32> {
    let rim = 2 * width;
    (0..black.len())
        .map(|k| {
            if k < rim || k + rim >= black.len() {
                return 0.0;
            }
            (0..5)
                .map(|ahead| black[k + ahead * step - 2 * step])
                .sum::<f32>()
                / 5.0
        })
        .collect()
}

/// A camera with the rays of its pixels' samples, in rows.
pub struct Photographer {
    pub camera: Intrinsics,
    rays: Vec<DVec2>,
}

const SAMPLES: usize = 4;

impl Photographer {
    pub fn new(camera: Intrinsics) -> Self {
        let [width, height] = camera.size_px.map(|side| side as usize * SAMPLES);
        let sample = |k: usize| DVec2::new((k % width) as f64, (k / width) as f64);
        let pixel = |k: usize| (sample(k) + 0.5) / SAMPLES as f64 - 0.5;
        Self {
            camera,
            rays: (0..width * height)
                .map(|k| ray(&camera, pixel(k)))
                .collect(),
        }
    }

    pub fn straight() -> &'static Self {
        static CAMERA_RAYS: OnceLock<Photographer> = OnceLock::new();
        CAMERA_RAYS.get_or_init(|| Self::new(CAMERA))
    }

    pub fn bent() -> &'static Self {
        static CAMERA_RAYS: OnceLock<Photographer> = OnceLock::new();
        CAMERA_RAYS.get_or_init(|| Self::new(BENT_CAMERA))
    }

    /// Grey levels of a print seen from a pose; the print may be `stretched` along its x.
    pub fn photograph(
        &self,
        print: &Print,
        camera_from_target: &DAffine3,
        stretched: f64,
    ) -> Vec<u8> {
        let target_from_camera = camera_from_target.inverse();
        let eye = target_from_camera.translation;
        let [width, height] = self.camera.size_px.map(|side| side as usize);
        let mut grey = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let mut light = 0.0;
                for k in 0..SAMPLES * SAMPLES {
                    let row = y * SAMPLES + k / SAMPLES;
                    let ray = self.rays[row * width * SAMPLES + x * SAMPLES + k % SAMPLES];
                    let along = target_from_camera.transform_vector3(ray.extend(1.0));
                    let on_target = (eye - along * (eye.z / along.z)).truncate();
                    let printed = on_target / DVec2::new(stretched, 1.0);
                    light += f64::from(print.light(printed).unwrap_or(0.2));
                }
                let linear = light / (SAMPLES * SAMPLES) as f64;
                grey.push((255.0 * (1.055 * linear.powf(1.0 / 2.4) - 0.055)).round() as u8);
            }
        }
        grey
    }
}

/// The point of the plane z = 1 that a distorted pixel shows.
pub fn ray(camera: &Intrinsics, pixel: DVec2) -> DVec2 {
    let target = camera.plane_from_pixel(pixel);
    let mut point = target;
    for _ in 0..60 {
        point += target - camera.distort(point);
    }
    point
}

/// A target whose middle is seen at a place of the picture (-1 to 1 each way), tilted about its own axes, turned in its
/// plane.
pub fn pose(
    print: &Print,
    place: [f64; 2],
    distance_m: f64,
    tilt_deg: [f64; 2],
    turn_deg: f64,
) -> DAffine3 {
    let turn = DQuat::from_rotation_x(tilt_deg[0].to_radians())
        * DQuat::from_rotation_y(tilt_deg[1].to_radians())
        * DQuat::from_rotation_z(turn_deg.to_radians());
    let [width, height] = CAMERA.size_px.map(f64::from);
    let aside = DVec2::new(place[0] * width, place[1] * height) / 2.0 / CAMERA.focal_px;
    let middle_m = aside.extend(1.0) * distance_m;
    let from_middle_m = turn * (print.size_m / 2.0).extend(0.0);
    DAffine3::from_rotation_translation(turn, middle_m - from_middle_m)
}

/// A good set: the whole picture, tilts to all sides, two distances.
pub fn good_poses(print: &Print) -> Vec<DAffine3> {
    let mut poses = Vec::new();
    for (row, y) in [-0.42, 0.0, 0.42].into_iter().enumerate() {
        for (column, x) in [-0.42, 0.0, 0.42].into_iter().enumerate() {
            let tilt_deg = [12.0 * (1.0 - row as f64), 12.0 * (column as f64 - 1.0)];
            poses.push(pose(
                print,
                [x, y],
                0.46,
                tilt_deg,
                4.0 * (row as f64 - column as f64),
            ));
        }
    }
    for tilt_deg in [
        [35.0, 0.0],
        [-35.0, 5.0],
        [0.0, 35.0],
        [5.0, -35.0],
        [25.0, 25.0],
        [-25.0, 25.0],
    ] {
        poses.push(pose(print, [0.05, -0.05], 0.36, tilt_deg, 3.0));
    }
    poses
}
