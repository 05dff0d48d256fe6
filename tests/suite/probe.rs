//! `gnomon probe` against an environment that is known: a mirror ball in it, photographed through a known curve at
//! several exposures.

use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};

use crate::common::random::Random;
use assert_cmd::Command;
use glam::{DMat3, DVec2, DVec3};
use gnomon::app::files::picture_files::{write_radiance, write_rgb_png};
use gnomon::light::probe::Probe;
use gnomon::light::probe_maps::world_from_camera;
use gnomon::light::response::Response;
use gnomon::scene::probe_file::{ProbeKind, read};

const SIZE_PX: [u32; 2] = [480, 360];
const CENTER_PX: DVec2 = DVec2::new(251.3, 172.8);
const RADIUS_PX: f64 = 140.6;
/// From the camera to the ball's middle, in radii.
const DISTANCE: f64 = 9.0;
const REFLECTANCE: f64 = 0.65;
const TIMES: [&str; 4] = ["1/1000", "1/125", "1/15", "0.5"];
/// Exposure at which the test's curve is white.
const WHITE_AT: f64 = 1.0 / 15.0;
const LAMP_HALF_ANGLE: f64 = 0.07;
const LAMP_RADIANCE: f64 = 60.0;

/// World directions of the test's camera: turned by 25° to the left, tilted down by 15°.
fn camera() -> DMat3 {
    world_from_camera(25_f64.to_radians(), 15_f64.to_radians(), 0.0)
}

fn lamp() -> DVec3 {
    let (elevation, azimuth) = (55_f64.to_radians(), -70_f64.to_radians());
    DVec3::new(
        elevation.cos() * azimuth.cos(),
        elevation.cos() * azimuth.sin(),
        elevation.sin(),
    )
}

/// A room of the mind: a pale ceiling, a brown floor, a window, a lamp.
fn environment(direction: DVec3) -> DVec3 {
    if direction.angle_between(lamp()) < LAMP_HALF_ANGLE {
        return LAMP_RADIANCE * DVec3::new(1.0, 0.85, 0.6);
    }
    let azimuth = direction.y.atan2(direction.x);
    if (azimuth - 2.9).abs() < 0.25 && (direction.z - 0.25).abs() < 0.2 {
        return DVec3::new(3.0, 3.4, 4.0);
    }
    let checks = 0.06 * (5.0 * azimuth).sin() * (1.0 - direction.z * direction.z);
    let wall = DVec3::new(0.30, 0.28, 0.24) + checks;
    if direction.z > 0.0 {
        wall.lerp(DVec3::new(0.6, 0.6, 0.58), direction.z)
    } else {
        wall.lerp(DVec3::new(0.12, 0.08, 0.05), -direction.z)
    }
}

/// The camera's curve, as no standard has it: level in parts of 255 for an exposure.
fn curve(exposure: f64) -> f64 {
    (1.0 - (-2.5 * exposure).exp()).powf(1.0 / 2.0)
}

/// Exposure at a level.
fn curve_inverse(level: f64) -> f64 {
    -(1.0 - (level / 255.0).powi(2)).ln() / 2.5
}

/// The camera's levels mean exposures up to a factor; gnomon takes 128 as sRGB's.
fn unit() -> f64 {
    0.215_860_5 / curve_inverse(128.0)
}

/// What each pixel gets, 3 x 3 rays: from the ball where it is met, else from what lies behind it.
fn ball_radiance() -> Vec<DVec3> {
    let camera = camera();
    let limb = 1.0 / (DISTANCE * DISTANCE - 1.0).sqrt();
    let eye = DVec3::new(0.0, 0.0, -DISTANCE);
    let mut radiance = Vec::new();
    for (row, column) in
        (0..SIZE_PX[1]).flat_map(|row| (0..SIZE_PX[0]).map(move |column| (row, column)))
    {
        let mut sum = DVec3::ZERO;
        for sample in 0..9 {
            let part = DVec2::new(f64::from(sample % 3), f64::from(sample / 3)) / 3.0 + 1.0 / 6.0;
            let place_px = DVec2::new(f64::from(column), f64::from(row)) + part;
            let ray = ((place_px - CENTER_PX) / RADIUS_PX * limb)
                .extend(1.0)
                .normalize();
            let along = -eye.dot(ray);
            let inside = along * along - eye.length_squared() + 1.0;
            sum += if inside > 0.0 {
                let normal = eye + (along - inside.sqrt()) * ray;
                REFLECTANCE * environment(camera * (ray - 2.0 * ray.dot(normal) * normal))
            } else {
                environment(camera * ray)
            };
        }
        radiance.push(sum / 9.0);
    }
    radiance
}

fn photographs(folder: &Path) -> Vec<PathBuf> {
    let radiance = ball_radiance();
    let mut random = Random::new(7);
    TIMES
        .iter()
        .enumerate()
        .map(|(index, time)| {
            let time =
                gnomon::app::jobs::probe::exposure_of(time).expect("a test's own numbers fit");
            let rgba: Vec<u8> = radiance
                .iter()
                .flat_map(|radiance| {
                    let mut level = |value: f64| {
                        let exact = 255.0 * curve(value * time / WHITE_AT);
                        (exact + random.between(-1.5, 1.5))
                            .round()
                            .clamp(0.0, 255.0) as u8
                    };
                    [level(radiance.x), level(radiance.y), level(radiance.z), 255]
                })
                .collect();
            let path = folder.join(format!("ball_{index}.png"));
            write_rgb_png(&path, SIZE_PX, &rgba).expect("the folder is writable");
            path
        })
        .collect()
}

fn gnomon() -> Command {
    let mut command = Command::cargo_bin("gnomon").expect("gnomon is built");
    command.arg("probe");
    command
}

/// stdout and stderr of a run that must succeed.
fn run(command: &mut Command) -> (String, String) {
    let output = command.output().expect("gnomon starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{err}");
    (out, err)
}

fn integral(probe: &Probe, weight: impl Fn(DVec3) -> f64) -> DVec3 {
    let [width, height] = probe.size_px();
    let mut sum = DVec3::ZERO;
    for (index, radiance) in probe.pixels().iter().enumerate() {
        let (column, row) = ((index % width) as f64 + 0.5, index / width);
        let direction = probe.direction(column, row as f64 + 0.5);
        sum += radiance.as_dvec3() * (weight(direction) * probe.pixel_solid_angle(row));
    }
    assert!(height > 0);
    sum
}

/// The environment itself, as a fine probe, in the units that the levels mean.
fn truth() -> Probe {
    let size_px = [720, 360];
    let grid =
        Probe::new(size_px, vec![glam::Vec3::ZERO; 720 * 360]).expect("a test's own numbers fit");
    let pixels = (0..720 * 360)
        .map(|index| {
            let (column, row) = ((index % 720) as f64, (index / 720) as f64);
            let mut sum = DVec3::ZERO;
            for sample in 0..9 {
                let (right, down) = (f64::from(sample % 3), f64::from(sample / 3));
                sum += environment(
                    grid.direction(column + (right + 0.5) / 3.0, row + (down + 0.5) / 3.0),
                );
            }
            (unit() * sum / 9.0).as_vec3()
        })
        .collect();
    Probe::new(size_px, pixels).expect("a test's own numbers fit")
}

/// What light does, by the weight of each direction.
type Measure = (&'static str, fn(DVec3) -> f64);

fn measures() -> [Measure; 3] {
    [
        ("upward irradiance", |direction| direction.z.max(0.0)),
        ("all light", |_| 1.0),
        ("the lamp", near_lamp),
    ]
}

fn near_lamp(direction: DVec3) -> f64 {
    f64::from(direction.angle_between(lamp()) < 2.0 * LAMP_HALF_ANGLE)
}

/// How the ball was photographed, for gnomon.
const BALL_FLAGS: [&str; 10] = [
    "--kind",
    "ball",
    "--ball-distance",
    "9",
    "--reflectance",
    "0.65",
    "--turn-deg",
    "25",
    "--tilt-deg",
    "15",
];

#[test]
fn a_photographed_ball_gives_its_surroundings_back() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = photographs(folder.path());
    let file = |name: &str| folder.path().join(name);
    let (out, err) = run(gnomon()
        .args(&pictures)
        .args(["--exposures", &TIMES.join(",")])
        .args(BALL_FLAGS)
        .arg("--out")
        .arg(file("probe.exr"))
        .arg("--preview")
        .arg(file("probe.png"))
        .arg("--save-response")
        .arg(file("response.csv")));
    eprintln!("{err}{out}");
    let crop = err
        .lines()
        .find_map(|line| line.strip_prefix("the ball: --crop "))
        .expect("the outline is told");
    hold_outline(crop);
    hold_response(&file("response.csv"));

    let probe = read(&file("probe.exr"), ProbeKind::LatitudeLongitude)
        .unwrap()
        .probe;
    let truth = truth();
    // No better than the response that was estimated.
    for (name, weight) in measures() {
        let ratio = integral(&probe, weight) / integral(&truth, weight);
        eprintln!("{name}: {ratio}");
        assert!((ratio - 1.0).abs().max_element() < 0.05, "{name}: {ratio}");
    }
    hold_direction_of_lamp(&probe);
    hold_told_lamp(&out);
    assert!(err.contains("filled in"), "{err}");
    let preview = image::open(file("probe.png")).unwrap();
    assert_eq!(preview.width() as usize, probe.size_px()[0]);

    // With the outline that was found and the camera's own response, in another order, the numbers are exact.
    let again = probe_by_own_response(folder.path(), &pictures, crop);
    for (name, weight) in measures() {
        let ratio = integral(&again, weight) / integral(&truth, weight);
        eprintln!("{name}, response known: {ratio}");
        // The lamp is ten pixels wide, and the outline is found to a third of one.
        let allowed = if name == "the lamp" { 0.02 } else { 0.01 };
        assert!(
            (ratio - 1.0).abs().max_element() < allowed,
            "{name}: {ratio}"
        );
    }
}

/// Holds the outline that gnomon tells against the ball's.
fn hold_outline(crop: &str) {
    let crop_numbers: Vec<f64> = crop
        .split(',')
        .map(|number| number.parse().unwrap())
        .collect();
    let off_px = DVec2::new(crop_numbers[0], crop_numbers[1]).distance(CENTER_PX);
    eprintln!(
        "middle off by {off_px:.2} px, radius by {:.2} px",
        crop_numbers[2] - RADIUS_PX
    );
    assert!(
        off_px < 0.5 && (crop_numbers[2] - RADIUS_PX).abs() < 0.7,
        "{crop}"
    );
}

/// Holds the response that was estimated against the camera's.
fn hold_response(file: &Path) {
    let text = std::fs::read_to_string(file).unwrap();
    let response = Response::from_csv(&text).unwrap();
    let mut worst: f64 = 0.0;
    for level in 25..=235 {
        for exposure in response.exposure_of_level()[level] {
            worst = worst.max((exposure / (unit() * curve_inverse(level as f64)) - 1.0).abs());
        }
    }
    eprintln!("response: at worst {:.1} % off", 100.0 * worst);
    assert!(worst < 0.05, "{worst}");
}

/// Holds the mean direction of the light about the lamp against where it is.
fn hold_direction_of_lamp(probe: &Probe) {
    let moment = |axis: DVec3| {
        integral(probe, |direction| {
            near_lamp(direction) * direction.dot(axis)
        })
        .y
    };
    let found = DVec3::new(moment(DVec3::X), moment(DVec3::Y), moment(DVec3::Z));
    let off_deg = found.angle_between(lamp()).to_degrees();
    eprintln!("the lamp: {off_deg:.2} degrees off");
    assert!(off_deg < 0.5, "{off_deg}");
}

/// Holds the first light that gnomon tells against the lamp: azimuth, elevation and width.
fn hold_told_lamp(out: &str) {
    let first = out.lines().nth(1).expect("a light is told");
    let columns: Vec<f64> = first
        .split_whitespace()
        .filter_map(|word| word.parse().ok())
        .collect();
    assert!(
        (columns[0] + 70.0).abs() < 1.0 && (columns[1] - 55.0).abs() < 1.0,
        "{first}"
    );
    assert!(
        (columns[2] / (2.0 * LAMP_HALF_ANGLE.to_degrees()) - 1.0).abs() < 0.15,
        "{first}"
    );
}

/// The probe of the pictures the other way round, their times in a list, by the camera's own curve.
fn probe_by_own_response(folder: &Path, pictures: &[PathBuf], crop: &str) -> Probe {
    let list = folder.join("times.txt");
    let lines = pictures.iter().zip(TIMES).map(|(path, time)| {
        let name = path.file_name().unwrap().to_string_lossy();
        format!("{name} {time}\n")
    });
    std::fs::write(&list, lines.collect::<String>()).unwrap();
    let own = Response::estimated(std::array::from_fn(|level| {
        [curve_inverse((level as f64).min(254.5)); 3]
    }));
    let response = folder.join("own.csv");
    std::fs::write(&response, own.unwrap().csv()).unwrap();
    let probe = folder.join("again.hdr");
    run(gnomon()
        .args(pictures.iter().rev())
        .arg("--exposures")
        .arg(&list)
        .args(BALL_FLAGS)
        .args(["--crop", crop, "--response"])
        .arg(&response)
        .arg("--out")
        .arg(&probe));
    read(&probe, ProbeKind::LatitudeLongitude).unwrap().probe
}

#[test]
fn a_hand_that_moved_is_made_good() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = photographs(folder.path());
    // Moved by up to 7 px against each other.
    for (path, [right, down]) in pictures.iter().zip([[3, -2], [-4, 5], [0, 0], [2, 3]]) {
        let was = image::open(path).unwrap().into_rgb8();
        let moved = image::RgbImage::from_fn(SIZE_PX[0], SIZE_PX[1], |x, y| {
            let from =
                |at: u32, by: i32, count: u32| (at as i32 - by).clamp(0, count as i32 - 1) as u32;
            *was.get_pixel(from(x, right, SIZE_PX[0]), from(y, down, SIZE_PX[1]))
        });
        moved.save(path).unwrap();
    }
    let probe = folder.path().join("probe.hdr");
    let (_, err) = run(gnomon()
        .args(&pictures)
        .args(["--exposures", &TIMES.join(",")])
        .args([
            "--kind",
            "ball",
            "--align",
            "--ball-distance",
            "9",
            "--reflectance",
            "0.65",
        ])
        .args(["--turn-deg", "25", "--tilt-deg", "15", "--out"])
        .arg(&probe));
    eprintln!("{err}");
    let ratio = integral(
        &read(&probe, ProbeKind::LatitudeLongitude).unwrap().probe,
        near_lamp,
    ) / integral(&truth(), near_lamp);
    assert!((ratio - 1.0).abs().max_element() < 0.08, "{ratio}");
}

/// A panorama as photographers keep it (seen from inside, flipped against the probe), turned and brought back.
#[test]
fn a_panorama_and_an_angular_map_in_radiance_are_turned_into_the_world() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name);
    let camera = camera();
    let [width, height] = [512, 256];
    let panorama: Vec<glam::Vec3> = (0..width * height)
        .map(|index| {
            let right = ((index % width) as f64 + 0.5) / width as f64 * TAU - PI;
            let down = ((index / width) as f64 + 0.5) / height as f64 * PI - PI / 2.0;
            let direction = DVec3::new(
                down.cos() * right.sin(),
                down.sin(),
                down.cos() * right.cos(),
            );
            environment(camera * direction).as_vec3()
        })
        .collect();
    write_radiance(&file("panorama.hdr"), [width, height], &panorama).unwrap();
    let angular: Vec<glam::Vec3> = (0..512 * 512)
        .map(|index| {
            let off = (DVec2::new((index % 512) as f64, (index / 512) as f64) - 255.5) / 256.0;
            let angle = PI * off.length();
            let direction = (off.normalize() * angle.sin()).extend(angle.cos());
            if off.length() > 1.0 {
                glam::Vec3::ZERO
            } else {
                environment(camera * direction).as_vec3()
            }
        })
        .collect();
    write_radiance(&file("angular.exr"), [512, 512], &angular).unwrap();
    let truth = truth();
    for (name, kind) in [("panorama.hdr", "panorama"), ("angular.exr", "angular")] {
        let (out, _) = run(gnomon()
            .arg(file(name))
            .args([
                "--kind",
                kind,
                "--turn-deg",
                "25",
                "--tilt-deg",
                "15",
                "--out",
            ])
            .arg(file("probe.hdr")));
        let probe = read(&file("probe.hdr"), ProbeKind::LatitudeLongitude)
            .unwrap()
            .probe;
        let weights: [fn(DVec3) -> f64; 2] = [|direction| direction.z.max(0.0), near_lamp];
        for weight in weights {
            let ratio = unit() * integral(&probe, weight) / integral(&truth, weight);
            assert!((ratio - 1.0).abs().max_element() < 0.02, "{name}: {ratio}");
        }
        let first = out.lines().nth(1).expect("a light is told");
        let columns: Vec<f64> = first
            .split_whitespace()
            .filter_map(|word| word.parse().ok())
            .collect();
        assert!(
            (columns[0] + 70.0).abs() < 0.5 && (columns[1] - 55.0).abs() < 0.5,
            "{first}"
        );
    }
}

/// Writes a picture without anything in it.
fn flat_picture(path: &Path, size_px: [u32; 2]) -> PathBuf {
    let rgba = vec![90; (4 * size_px[0] * size_px[1]) as usize];
    write_rgb_png(path, size_px, &rgba).unwrap();
    path.to_owned()
}

/// A run that must fail, say each of `words`, and write no probe.
fn refused(folder: &Path, pictures: &[PathBuf], flags: &[&str], words: &[&str]) {
    let probe = folder.join("probe.hdr");
    let output = gnomon()
        .args(pictures)
        .args(flags)
        .arg("--out")
        .arg(&probe)
        .output()
        .unwrap();
    let err = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{flags:?}");
    for word in words {
        assert!(err.contains(word), "{err:?} lacks {word:?}");
    }
    assert!(!probe.exists());
}

#[test]
fn mistakes_are_told_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = photographs(folder.path());
    let file = |name: &str| folder.path().join(name);
    let flat = |name: &str, size_px: [u32; 2]| flat_picture(&file(name), size_px);
    let refused = |pictures: &[PathBuf], flags: &[&str], words: &[&str]| {
        refused(folder.path(), pictures, flags, words);
    };
    let ball = ["--kind", "ball"];
    let with = |times: &'static str| [ball[0], ball[1], "--exposures", times];
    refused(
        &pictures[..1],
        &with("1/8"),
        &["one exposure only", "--response"],
    );
    refused(&pictures, &with("1/8,1/30"), &["2 times", "4 pictures"]);
    refused(
        &pictures[..2],
        &with("1/8,soon"),
        &["soon", "no exposure time"],
    );
    refused(
        &pictures[..2],
        &ball,
        &["ball_0.png", "EXIF", "--exposures"],
    );
    refused(
        &[pictures[0].clone(), flat("small.png", [64, 48])],
        &with("1/8,1/30"),
        &["small.png", "64 x 48", "480 x 360"],
    );
    let flats = [flat("a.png", [320, 240]), flat("b.png", [320, 240])];
    refused(&flats, &with("1/8,1/30"), &["no ball was found", "--crop"]);
    refused(
        &flats,
        &["--kind", "panorama", "--exposures", "1/8,1/30"],
        &["320 x 240", "twice as wide"],
    );
    refused(
        &flats,
        &["--kind", "angular", "--exposures", "1/8,1/30"],
        &["320 x 240", "square"],
    );
    refused(
        &[file("none.png"), flats[0].clone()],
        &with("1/8,1/30"),
        &["none.png: no such file"],
    );
    refused(
        &pictures,
        &[
            "--kind",
            "ball",
            "--exposures",
            "1/8,1/15,1/30,1/60",
            "--crop",
            "900,100,50",
        ],
        &["--crop 900,100,50", "480 x 360"],
    );
    std::fs::write(file("bad.csv"), "level,red,green,blue\n0,0,0,0\n1,x,0,0\n").unwrap();
    let bad = file("bad.csv");
    let bad = [
        "--kind",
        "ball",
        "--exposures",
        "1/8,1/15,1/30,1/60",
        "--response",
        bad.to_str().unwrap(),
    ];
    refused(&pictures, &bad, &["bad.csv:3:"]);
    let output = gnomon()
        .args(&pictures)
        .args(with("1/8,1/15,1/30,1/60"))
        .arg("--out")
        .arg(file("probe.png"))
        .output()
        .unwrap();
    assert!(String::from_utf8_lossy(&output.stderr).contains(".hdr (Radiance) or .exr"));
}
