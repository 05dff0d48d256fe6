//! The outline of a ball in a picture.

use std::f64::consts::TAU;

use glam::DVec2;
use opencv::core::{CV_8U, Mat, MatTraitConst, MatTraitConstManual, Size, Vec3f, Vector};
use opencv::imgproc;

use super::exposures::{Bracket, ExposureError};
use crate::light::probe_maps::Circle;

/// Circles are first looked for in a picture of this size.
const SEARCHED_PX: f64 = 480.0;
/// Steps that Canny's edges begin with: a mirror's limb shows nearly what is behind it, so it may be a faint one.
const EDGE_STEPS: [f64; 3] = [100.0, 40.0, 15.0];
/// The number of circles that are looked at for each of these steps.
const CANDIDATES: usize = 12;
/// Rays from the middle along which the outline is looked at.
const RAYS: usize = 360;
/// The least step that an outline is, levels.
const LEAST_STEP: f64 = 2.0;
/// The step from which on more levels make no more of an outline: what a ball mirrors has steps higher than its outline.
const MOST_STEP: f64 = 12.0;
/// The part of the rays on which an outline must be such a step.
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
    let soft = Levels::blurred(&small, 2.0)?;
    let sharp = Levels::blurred(&grey, 0.6)?;
    let mut best: Option<(f64, Circle)> = None;
    for coarse in candidates(&small)? {
        let coarse = soft.fitted(coarse, 4.0);
        let fine = Circle {
            center_px: coarse.center_px / scale,
            radius_px: coarse.radius_px / scale,
        };
        let fine = sharp.fitted(fine, 1.5 / scale);
        let support = sharp.support(fine);
        let worth = support * fine.radius_px;
        if support >= LEAST_SUPPORT && best.is_none_or(|(other, _)| worth > other) {
            best = Some((worth, fine));
        }
    }
    Ok(best.map(|(_, circle)| circle))
}

/// Circles by Hough's transform.
fn candidates(grey: &Mat) -> opencv::Result<Vec<Circle>> {
    let mut levels = Mat::default();
    grey.convert_to_def(&mut levels, CV_8U)?;
    let mut soft = Mat::default();
    imgproc::gaussian_blur_def(&levels, &mut soft, Size::default(), 1.2)?;
    let shortest = f64::from(grey.cols().min(grey.rows()));
    let mut found = Vec::new();
    for step in EDGE_STEPS {
        let mut circles = Vector::<Vec3f>::new();
        imgproc::hough_circles(
            &soft,
            &mut circles,
            imgproc::HOUGH_GRADIENT,
            2.0,
            6.0,
            step,
            20.0,
            (0.04 * shortest) as i32,
            (0.6 * shortest) as i32,
        )?;
        found.extend(circles.iter().take(CANDIDATES).map(|circle| {
            let [x, y, radius] = circle.0.map(f64::from);
            // OpenCV's pixels have their centres at integers.
            Circle {
                center_px: DVec2::new(x, y) + 0.5,
                radius_px: radius,
            }
        }));
    }
    Ok(found)
}

/// A grey picture.
struct Levels {
    size_px: [usize; 2],
    levels: Vec<f32>,
}

impl Levels {
    fn blurred(picture: &Mat, deviation_px: f64) -> opencv::Result<Self> {
        let mut blurred = Mat::default();
        imgproc::gaussian_blur_def(picture, &mut blurred, Size::default(), deviation_px)?;
        Ok(Self {
            size_px: [blurred.cols() as usize, blurred.rows() as usize],
            levels: blurred.data_typed::<f32>()?.to_vec(),
        })
    }

    /// Moves and scales a circle, in ever smaller steps, to where the mean step across it is highest (Daugman's operator
    /// for the iris, 1993).
    fn fitted(&self, mut circle: Circle, first_step_px: f64) -> Circle {
        let mut step_px = first_step_px;
        let mut height = self.mean_step(circle);
        while step_px > 0.02 {
            let tried = [
                (step_px, 0.0, 0.0),
                (-step_px, 0.0, 0.0),
                (0.0, step_px, 0.0),
                (0.0, -step_px, 0.0),
                (0.0, 0.0, step_px),
                (0.0, 0.0, -step_px),
            ]
            .map(|(right, down, wider)| Circle {
                center_px: circle.center_px + DVec2::new(right, down),
                radius_px: circle.radius_px + wider,
            });
            let highest = tried
                .map(|circle| (self.mean_step(circle), circle))
                .into_iter()
                .max_by(|a, b| a.0.total_cmp(&b.0));
            match highest {
                Some((higher, better)) if higher > height => (height, circle) = (higher, better),
                _ => step_px *= 0.5,
            }
        }
        circle
    }

    fn mean_step(&self, circle: Circle) -> f64 {
        let steps = (0..RAYS).map(|ray| self.step(circle, ray).min(MOST_STEP));
        steps.sum::<f64>() / RAYS as f64
    }

    /// Part of the rays on which the circle's step is higher than those beside it.
    fn support(&self, circle: Circle) -> f64 {
        let stands_out = |ray: &usize| {
            let beside = [-8.0, -6.0, -4.0, 4.0, 6.0, 8.0].map(|off_px| {
                let radius_px = circle.radius_px + off_px;
                self.step(
                    Circle {
                        radius_px,
                        ..circle
                    },
                    *ray,
                )
            });
            let here = self.step(circle, *ray);
            here >= LEAST_STEP && here > beside.iter().sum::<f64>() / 6.0
        };
        (0..RAYS).filter(stands_out).count() as f64 / RAYS as f64
    }

    /// Levels between a pixel outside and a pixel inside, across the circle; 0 out of the picture.
    fn step(&self, circle: Circle, ray: usize) -> f64 {
        let ray = DVec2::from_angle(ray as f64 * TAU / RAYS as f64);
        let at = |off_px: f64| self.level(circle.center_px + ray * (circle.radius_px + off_px));
        match (at(1.0), at(-1.0)) {
            (Some(outside), Some(inside)) => (outside - inside).abs(),
            _ => 0.0,
        }
    }

    /// Between pixels, linearly.
    fn level(&self, place_px: DVec2) -> Option<f64> {
        let [width, height] = self.size_px;
        let corner = (place_px - 0.5).floor();
        let part = place_px - 0.5 - corner;
        let inside = corner.min_element() >= 0.0
            && corner.x + 1.0 < width as f64
            && corner.y + 1.0 < height as f64;
        if !inside {
            return None;
        }
        let index = corner.y as usize * width + corner.x as usize;
        let row = |index: usize| {
            let at = |index: usize| f64::from(self.levels[index]);
            at(index) * (1.0 - part.x) + at(index + 1) * part.x
        };
        Some(row(index) * (1.0 - part.y) + row(index + width) * part.y)
    }
}
