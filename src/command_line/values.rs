//! How values of options are read, and what is said of those that are none.

use std::path::Path;

use gnomon::app::jobs::board::Distance;
use gnomon::light::probe_maps::Circle;
use gnomon::scene::Family;

/// Millimetres; what they may be, each job says.
pub fn mm_of(written: &str) -> Result<f64, String> {
    let expected =
        "a number of millimetres is expected, with a point and without its unit, as in 45 or 4.5";
    written.trim().parse().map_err(|_| expected.to_owned())
}

/// One of a list of whole numbers.
pub fn index_of(written: &str) -> Result<u32, String> {
    let expected = "whole numbers are expected, joined by commas, as in 0,25,50";
    written.trim().parse().map_err(|_| expected.to_owned())
}

/// Columns and rows, "9x6".
pub fn counts_of(text: &str) -> Result<[u32; 2], String> {
    let counts = text.split_once('x').and_then(|(columns, rows)| {
        Some([columns.trim().parse().ok()?, rows.trim().parse().ok()?])
    });
    counts
        .filter(|counts| counts.iter().all(|&count| (1..=1000).contains(&count)))
        .ok_or_else(|| "columns and rows are expected, as in 9x6".to_owned())
}

pub fn distance_of(text: &str) -> Result<Distance, String> {
    let parts: Vec<&str> = text.split(':').collect();
    let parsed = match parts[..] {
        [a, b, mm] => (a.parse().ok()).zip(b.parse().ok()).zip(mm.parse().ok()),
        _ => None,
    };
    let expected = "two ids and the millimetres between their centres are expected, like 0:7:412.5";
    match parsed {
        Some(((a, b), mm)) if a != b && (1e-3..1e6).contains(&mm) => Ok(Distance {
            ids: [a, b],
            distance_m: mm * 1e-3,
        }),
        _ => Err(expected.to_owned()),
    }
}

pub fn circle_of(written: &str) -> Result<Circle, String> {
    let numbers: Option<Vec<f64>> = written
        .split(',')
        .map(|number| {
            number
                .trim()
                .parse()
                .ok()
                .filter(|number: &f64| number.is_finite())
        })
        .collect();
    match numbers.as_deref() {
        Some([x, y, radius_px]) if *radius_px >= 2.0 => Ok(Circle {
            center_px: glam::DVec2::new(*x, *y),
            radius_px: *radius_px,
        }),
        _ => Err(
            "three numbers are expected, like 640,360,210: the middle, and a radius of at least 2"
                .to_owned(),
        ),
    }
}

fn number_between(written: &str, allowed: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let number = written.parse().ok();
    number
        .filter(|number| allowed.contains(number))
        .ok_or_else(|| {
            format!(
                "out of range; allowed: {} to {}",
                allowed.start(),
                allowed.end()
            )
        })
}

pub fn ball_distance_of(written: &str) -> Result<f64, String> {
    number_between(written, 1.5..=1e6)
}

pub fn reflectance_of(written: &str) -> Result<f64, String> {
    number_between(written, 0.01..=1.0)
}

pub fn degrees_of(written: &str) -> Result<f64, String> {
    number_between(written, -360.0..=360.0)
}

pub fn probe_width_of(written: &str) -> Result<usize, String> {
    let width_px = written.parse().ok();
    width_px
        .filter(|width_px| (16..=8192).contains(width_px) && width_px % 2 == 0)
        .ok_or_else(|| "an even number from 16 to 8192 is expected".to_owned())
}

pub fn seconds_of(written: &str) -> Result<f64, String> {
    let seconds = written.parse().ok();
    seconds
        .filter(|seconds: &f64| *seconds > 0.0 && seconds.is_finite())
        .ok_or_else(|| "not a time; a number above 0 is expected".to_owned())
}

pub fn family_of(name: &str) -> Result<Family, String> {
    if Family::is_file_name(name) {
        return Family::from_file(Path::new(name)).map_err(|error| error.to_string());
    }
    Family::from_name(name).ok_or_else(|| Family::unknown(name))
}
