//! How sure a calibration is: what it would be without each view in turn (jackknife), by one step of Newton's method each
//! from the calibration that all views give.
//!
//! What the corners' scatter alone says is several times too sure: paper bends, and light changes, from view to view and
//! not from corner to corner.

use glam::{DAffine3, DVec2};

use super::TargetCorner;
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::{DynamicMatrix, dot};
use crate::geometry::pose::by_step;

/// A camera's parameters: fx, fy, cx, cy, k1, k2, p1, p2, k3.
pub(super) type Parameters = [f64; 9];

/// The number of a pose's unknowns.
const POSE: usize = 6;

/// The distortion `k1 k2 p1 p2 k3` of a camera that has been calibrated here.
pub(super) fn polynomial_of(intrinsics: &Intrinsics) -> [f64; 5] {
    std::array::from_fn(|k| intrinsics.distortion.coefficients()[k])
}

/// The standard deviations of those parameters that are `free`, 0 for the others; infinite for all where the views
/// without one of them do not determine the camera.
pub(super) fn deviations<'a>(
    intrinsics: &Intrinsics,
    views: impl Iterator<Item = (&'a [TargetCorner], DAffine3)>,
    free: [bool; 9],
) -> Parameters {
    let views = reduced_views(intrinsics, views, free);
    let steps = views.and_then(|views| steps_without_each(&views));
    let mut deviations = [f64::INFINITY; 9];
    let Some(steps) = steps else {
        return deviations;
    };
    deviations = [0.0; 9];
    let count = steps.len() as f64;
    for (at, k) in (0..9).filter(|&k| free[k]).enumerate() {
        let mean = steps.iter().map(|step| step[at]).sum::<f64>() / count;
        let squared: f64 = steps.iter().map(|step| (step[at] - mean).powi(2)).sum();
        deviations[k] = ((count - 1.0) / count * squared).sqrt();
    }
    deviations
}

/// The views' parts in the normal equations of those parameters that are `free`.
pub(super) fn reduced_views<'a>(
    intrinsics: &Intrinsics,
    views: impl Iterator<Item = (&'a [TargetCorner], DAffine3)>,
    free: [bool; 9],
) -> Option<Vec<ReducedView>> {
    let free: Vec<usize> = (0..9).filter(|&k| free[k]).collect();
    views
        .map(|(corners, pose)| ReducedView::of(intrinsics, corners, &pose, &free))
        .collect()
}

/// What each view left out would change; `None` where the others do not determine the camera.
pub(super) fn steps_without_each(views: &[ReducedView]) -> Option<Vec<Vec<f64>>> {
    let side = views.first()?.slope.len();
    let mut all = ReducedView::zero(side);
    for view in views {
        all.add(view, 1.0);
    }
    views
        .iter()
        .map(|view| {
            let mut rest = all.clone();
            rest.add(view, -1.0);
            Some(rest.curvature.cholesky()?.solve(&rest.slope))
        })
        .collect()
}

/// A view's part in the normal equations of the camera's parameters, its pose eliminated (Schur complement).
#[derive(Clone)]
pub(super) struct ReducedView {
    pub(super) curvature: DynamicMatrix,
    pub(super) slope: Vec<f64>,
    /// The corners' squared distances where the pose fits best, square pixels.
    pub(super) squares: f64,
}

impl ReducedView {
    fn zero(side: usize) -> Self {
        Self {
            curvature: DynamicMatrix::zero(side),
            slope: vec![0.0; side],
            squares: 0.0,
        }
    }

    fn add(&mut self, other: &Self, times: f64) {
        for (i, slope) in self.slope.iter_mut().enumerate() {
            *slope += times * other.slope[i];
            for j in 0..other.slope.len() {
                *self.curvature.at_mut(i, j) += times * other.curvature.at(i, j);
            }
        }
    }

    /// `None` where the corners do not determine the pose.
    fn of(
        intrinsics: &Intrinsics,
        corners: &[TargetCorner],
        camera_from_target: &DAffine3,
        free: &[usize],
    ) -> Option<Self> {
        let (shared, side) = (free.len(), free.len() + POSE);
        let mut curvature = DynamicMatrix::zero(side);
        let mut slope = vec![0.0; side];
        let mut squares = 0.0;
        for corner in corners {
            let slopes = slopes(intrinsics, camera_from_target, corner.target_m, free)?;
            let target_m = corner.target_m.extend(0.0);
            let expected_px = intrinsics.pixel_of(camera_from_target.transform_point3(target_m))?;
            let off_px = corner.pixel - expected_px;
            squares += off_px.length_squared();
            for i in 0..side {
                slope[i] += slopes[i].dot(off_px);
                for j in 0..side {
                    *curvature.at_mut(i, j) += slopes[i].dot(slopes[j]);
                }
            }
        }
        let mut of_pose = DynamicMatrix::zero(POSE);
        for i in 0..POSE {
            for j in 0..POSE {
                *of_pose.at_mut(i, j) = curvature.at(shared + i, shared + j);
            }
        }
        let of_pose = of_pose.cholesky()?;
        let along_pose = of_pose.solve(&slope[shared..]);
        let mut reduced = Self::zero(shared);
        reduced.squares = squares - dot(&slope[shared..], &along_pose);
        let row = |i: usize| (0..POSE).map(|k| curvature.at(i, shared + k)).collect();
        let rows: Vec<Vec<f64>> = (0..shared).map(row).collect();
        for (i, row) in rows.iter().enumerate() {
            reduced.slope[i] = slope[i] - dot(row, &along_pose);
            for (j, other) in rows.iter().enumerate() {
                *reduced.curvature.at_mut(i, j) =
                    curvature.at(i, j) - dot(row, &of_pose.solve(other));
            }
        }
        Some(reduced)
    }
}

/// How a corner's pixel moves with the free parameters and with a step of the pose; `None` behind the camera.
fn slopes(
    intrinsics: &Intrinsics,
    camera_from_target: &DAffine3,
    target_m: DVec2,
    free: &[usize],
) -> Option<Vec<DVec2>> {
    let turned_m = camera_from_target.matrix3 * target_m.extend(0.0);
    let in_camera_m = turned_m + camera_from_target.translation;
    let [by_x, by_y] = intrinsics
        .project(in_camera_m)?
        .gradients()
        .map(|gradient| by_step(turned_m, gradient));
    let of_camera = by_parameters(intrinsics, in_camera_m.truncate() / in_camera_m.z);
    let of_camera = free.iter().map(|&k| of_camera[k]);
    let of_pose = (0..POSE).map(|k| DVec2::new(by_x[k], by_y[k]));
    Some(of_camera.chain(of_pose).collect())
}

/// How the pixel of a point of the plane z = 1 moves with each of the camera's parameters.
fn by_parameters(intrinsics: &Intrinsics, point: DVec2) -> [DVec2; 9] {
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let bent = intrinsics.distort(point);
    let focal_px = intrinsics.focal_px;
    let by_k1 = focal_px * point * r2;
    [
        DVec2::new(bent.x, 0.0),
        DVec2::new(0.0, bent.y),
        DVec2::X,
        DVec2::Y,
        by_k1,
        by_k1 * r2,
        focal_px * DVec2::new(2.0 * x * y, r2 + 2.0 * y * y),
        focal_px * DVec2::new(r2 + 2.0 * x * x, 2.0 * x * y),
        by_k1 * r2 * r2,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;

    #[test]
    fn derivatives_by_the_parameters_are_what_small_steps_make() {
        const CAMERA: Intrinsics = Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::new(615.0, 613.0),
            center_px: DVec2::new(321.4, 238.2),
            distortion: Distortion::Polynomial([-0.35, 0.15, -0.002, 0.001, -0.03]),
        };
        const STEP: f64 = 1e-6;
        let point = DVec2::new(0.4, -0.3);
        let pixel = |parameter: usize, step: f64| {
            let mut camera = CAMERA;
            match parameter {
                0 => camera.focal_px.x += step,
                1 => camera.focal_px.y += step,
                2 => camera.center_px.x += step,
                3 => camera.center_px.y += step,
                coefficient => {
                    let mut coefficients = polynomial_of(&camera);
                    coefficients[coefficient - 4] += step;
                    camera.distortion = Distortion::Polynomial(coefficients);
                }
            }
            camera.pixel_from_plane(camera.distort(point))
        };
        let found = by_parameters(&CAMERA, point);
        for (k, derivative) in found.into_iter().enumerate() {
            let slope = (pixel(k, STEP) - pixel(k, -STEP)) / (2.0 * STEP);
            assert!(
                slope.distance(derivative) < 1e-5,
                "{k}: {slope} {derivative}"
            );
        }
    }
}
