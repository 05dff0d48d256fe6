//! The outline of a ball in a picture.

use glam::DVec2;
use opencv::core::{Mat, MatTraitConst, MatTraitConstManual, Size, Vec3f, Vector};
use opencv::imgproc;

use super::exposures::{Bracket, ExposureError};
use crate::light::probe_maps::Circle;

/// Circles are first looked for in a picture of this size.
const SEARCHED_PX: f64 = 480.0;
const CANDIDATES: usize = 40;
/// Rays from the middle along which the outline is looked for.
const RAYS: usize = 360;
/// An outline is a step of at least so many levels.
const LEAST_STEP: f64 = 4.0;
/// Part of the rays that must meet it.
const LEAST_SUPPORT: f64 = 0.6;

/// Finds the ball: of the circles in the mean of the exposures the one whose outline is longest in pixels and seen nearly
/// all around. `None` where there is none.
///
/// # Errors
/// OpenCV's.
pub fn find(bracket: &Bracket) -> Result<Option<Circle>, ExposureError> {
    let grey = bracket.mean_grey()?;
    let largest = f64::from(grey.cols().max(grey.rows()));
    let scale = (SEARCHED_PX / largest).min(1.0);
    let mut small = Mat::default();
    imgproc::resize(
        &grey,
        &mut small,
        Size::default(),
        scale,
        scale,
        imgproc::INTER_AREA,
    )?;
    let small = blurred(&small, 1.5)?;
    let shortest = f64::from(small.cols().min(small.rows()));
    let mut circles = Vector::<Vec3f>::new();
    imgproc::hough_circles(
        &small,
        &mut circles,
        imgproc::HOUGH_GRADIENT,
        1.5,
        4.0,
        60.0,
        20.0,
        (0.04 * shortest) as i32,
        (0.6 * shortest) as i32,
    )?;
    let sharp = blurred(&grey, 1.0)?;
    let mut best: Option<(f64, Circle)> = None;
    for found in circles.iter().take(CANDIDATES) {
        let [x, y, radius] = found.0.map(f64::from);
        // OpenCV's pixels have their centres at integers.
        let coarse = Circle {
            center_px: DVec2::new(x, y) + 0.5,
            radius_px: radius,
        };
        let Some((_, coarse)) = fitted(&small, coarse, &[0.12, 0.06])? else {
            continue;
        };
        let coarse = Circle {
            center_px: coarse.center_px / scale,
            radius_px: coarse.radius_px / scale,
        };
        let Some((support, circle)) = fitted(&sharp, coarse, &[0.03, 0.015])? else {
            continue;
        };
        let worth = support * circle.radius_px;
        if support >= LEAST_SUPPORT && best.is_none_or(|(other, _)| worth > other) {
            best = Some((worth, circle));
        }
    }
    Ok(best.map(|(_, circle)| circle))
}

fn blurred(picture: &Mat, deviation_px: f64) -> opencv::Result<Mat> {
    let mut blurred = Mat::default();
    imgproc::gaussian_blur_def(picture, &mut blurred, Size::default(), deviation_px)?;
    Ok(blurred)
}

/// Moves a circle on to the steepest places within parts of its radius, narrower from round to round; with the part of
/// the rays that agree with it in the end.
fn fitted(
    grey: &Mat,
    mut circle: Circle,
    reaches: &[f64],
) -> opencv::Result<Option<(f64, Circle)>> {
    let levels = grey.data_bytes()?;
    let size = [grey.cols() as usize, grey.rows() as usize];
    let mut support = 0.0;
    for reach in reaches {
        let reach_px = (reach * circle.radius_px).max(2.5);
        let mut steps_px: Vec<DVec2> = (0..RAYS)
            .filter_map(|ray| {
                let angle = ray as f64 * std::f64::consts::TAU / RAYS as f64;
                steepest(levels, size, &circle, DVec2::from_angle(angle), reach_px)
            })
            .collect();
        // Twice around: what is far from the first circle is no outline.
        for round in 0..3 {
            if steps_px.len() < RAYS / 4 {
                return Ok(None);
            }
            let Some(better) = circle_through(&steps_px) else {
                return Ok(None);
            };
            circle = better;
            let off = |place: &DVec2| (place.distance(circle.center_px) - circle.radius_px).abs();
            let mut offs: Vec<f64> = steps_px.iter().map(off).collect();
            offs.sort_by(f64::total_cmp);
            let near_px = (3.0 * offs[offs.len() / 2]).clamp(0.7, 0.02 * circle.radius_px + 1.0);
            if round < 2 {
                steps_px.retain(|place| off(place) <= near_px);
            } else {
                support = offs.iter().filter(|off| **off <= near_px).count() as f64 / RAYS as f64;
            }
        }
    }
    Ok(Some((support, circle)))
}

/// Where along a ray the levels change most, within reach of the circle; to a part of a pixel.
fn steepest(
    levels: &[u8],
    size: [usize; 2],
    circle: &Circle,
    ray: DVec2,
    reach_px: f64,
) -> Option<DVec2> {
    const STEP_PX: f64 = 0.5;
    let count = (reach_px / STEP_PX).ceil() as i32;
    let at = |step: i32| circle.center_px + ray * (circle.radius_px + f64::from(step) * STEP_PX);
    let slope = |step: i32| {
        let across = |side: f64| level(levels, size, at(step) + side * ray);
        Some((across(1.0)? - across(-1.0)?).abs())
    };
    let (step, highest) = (-count..=count)
        .filter_map(|step| Some((step, slope(step)?)))
        .max_by(|a, b| a.1.total_cmp(&b.1))?;
    if highest < LEAST_STEP {
        return None;
    }
    let (before, after) = (slope(step - 1)?, slope(step + 1)?);
    let bend = before - 2.0 * highest + after;
    let top = if bend < 0.0 {
        (0.5 * (before - after) / bend).clamp(-0.5, 0.5)
    } else {
        0.0
    };
    Some(at(step) + ray * (top * STEP_PX))
}

fn level(levels: &[u8], [width, height]: [usize; 2], place_px: DVec2) -> Option<f64> {
    let place = place_px - 0.5;
    let corner = place.floor();
    if corner.min_element() < 0.0
        || corner.x + 1.0 >= width as f64
        || corner.y + 1.0 >= height as f64
    {
        return None;
    }
    let part = place - corner;
    let index = corner.y as usize * width + corner.x as usize;
    let at = |index: usize| f64::from(levels[index]);
    let row = |index: usize| at(index) * (1.0 - part.x) + at(index + 1) * part.x;
    Some(row(index) * (1.0 - part.y) + row(index + width) * part.y)
}

/// The circle with the least algebraic distance (Kåsa), from normal equations around the mean.
fn circle_through(places_px: &[DVec2]) -> Option<Circle> {
    let mean = places_px.iter().sum::<DVec2>() / places_px.len() as f64;
    let (mut xx, mut xy, mut yy, mut right, mut square) = (0.0, 0.0, 0.0, DVec2::ZERO, 0.0);
    for place in places_px {
        let place = *place - mean;
        let length_squared = place.length_squared();
        xx += place.x * place.x;
        xy += place.x * place.y;
        yy += place.y * place.y;
        right += 0.5 * length_squared * place;
        square += length_squared;
    }
    let determinant = xx * yy - xy * xy;
    let center = DVec2::new(yy * right.x - xy * right.y, xx * right.y - xy * right.x) / determinant;
    let radius_px = (center.length_squared() + square / places_px.len() as f64).sqrt();
    (center.is_finite() && radius_px.is_finite()).then_some(Circle {
        center_px: mean + center,
        radius_px,
    })
}
