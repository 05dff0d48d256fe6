//! How sure a calibration is: what it would be without each view in turn (jackknife), by one step of Newton's method each
//! from the calibration that all views give.
//!
//! What the corners' scatter alone says is several times too sure: paper bends, and light changes, from view to view and
//! not from corner to corner.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

use super::Corner;
use crate::geometry::camera::Intrinsics;
use crate::geometry::dense::Square;

/// fx, fy, cx, cy, k1, k2, p1, p2, k3.
pub(super) type Parameters = [f64; 9];

/// Turn about the camera's axes, then shift.
const POSE: usize = 6;
/// Steps of the numeric derivatives: of pixels, of coefficients, of turns (radians), of shifts as a part of the distance.
const PIXEL_STEP: f64 = 1e-3;
const COEFFICIENT_STEP: f64 = 1e-6;
const POSE_STEP: f64 = 1e-6;

/// The camera's parameters in their order.
pub(super) fn parameters_of(intrinsics: &Intrinsics) -> Parameters {
    let [k1, k2, p1, p2, k3] = intrinsics.distortion;
    let (focal, center) = (intrinsics.focal_px, intrinsics.center_px);
    [focal.x, focal.y, center.x, center.y, k1, k2, p1, p2, k3]
}

/// The standard deviations of those parameters that are `free`, 0 for the others; infinite for all where the views
/// without one of them do not determine the camera.
pub(super) fn deviations<'a>(
    intrinsics: &Intrinsics,
    views: impl Iterator<Item = (&'a [Corner], DAffine3)>,
    free: [bool; 9],
) -> Parameters {
    let free: Vec<usize> = (0..9).filter(|&k| free[k]).collect();
    let views: Option<Vec<Reduced>> = views
        .map(|(corners, pose)| Reduced::of(intrinsics, corners, &pose, &free))
        .collect();
    let steps = views.and_then(|views| steps_without_each(&views));
    let mut deviations = [f64::INFINITY; 9];
    let Some(steps) = steps else {
        return deviations;
    };
    deviations = [0.0; 9];
    let count = steps.len() as f64;
    for (at, &k) in free.iter().enumerate() {
        let mean = steps.iter().map(|step| step[at]).sum::<f64>() / count;
        let squared: f64 = steps.iter().map(|step| (step[at] - mean).powi(2)).sum();
        deviations[k] = ((count - 1.0) / count * squared).sqrt();
    }
    deviations
}

/// What each view left out would change; `None` where the others do not determine the camera.
fn steps_without_each(views: &[Reduced]) -> Option<Vec<Vec<f64>>> {
    let side = views.first()?.slope.len();
    let mut all = Reduced::zero(side);
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
struct Reduced {
    curvature: Square,
    slope: Vec<f64>,
}

impl Reduced {
    fn zero(side: usize) -> Self {
        Self {
            curvature: Square::zero(side),
            slope: vec![0.0; side],
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
        corners: &[Corner],
        camera_from_target: &DAffine3,
        free: &[usize],
    ) -> Option<Self> {
        let (shared, side) = (free.len(), free.len() + POSE);
        let mut curvature = Square::zero(side);
        let mut slope = vec![0.0; side];
        for corner in corners {
            let slopes = slopes(intrinsics, camera_from_target, corner.target_m, free);
            let off_px = corner.pixel - pixel_of(intrinsics, camera_from_target, corner.target_m);
            for i in 0..side {
                slope[i] += slopes[i].dot(off_px);
                for j in 0..side {
                    *curvature.at_mut(i, j) += slopes[i].dot(slopes[j]);
                }
            }
        }
        let mut of_pose = Square::zero(POSE);
        for i in 0..POSE {
            for j in 0..POSE {
                *of_pose.at_mut(i, j) = curvature.at(shared + i, shared + j);
            }
        }
        let of_pose = of_pose.cholesky()?;
        let along_pose = of_pose.solve(&slope[shared..]);
        let mut reduced = Self::zero(shared);
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// How a corner's pixel moves with the free parameters and with the pose, by central differences.
fn slopes(
    intrinsics: &Intrinsics,
    camera_from_target: &DAffine3,
    target_m: DVec2,
    free: &[usize],
) -> Vec<DVec2> {
    let of_camera = free.iter().map(|&k| {
        let step = if k < 4 { PIXEL_STEP } else { COEFFICIENT_STEP };
        let at = |step: f64| pixel_of(&stepped(intrinsics, k, step), camera_from_target, target_m);
        (at(step) - at(-step)) / (2.0 * step)
    });
    let distance_m = camera_from_target.translation.length();
    let of_pose = (0..POSE).map(|k| {
        let at = |step: f64| {
            pixel_of(
                intrinsics,
                &moved(camera_from_target, k, step * distance_m),
                target_m,
            )
        };
        (at(POSE_STEP) - at(-POSE_STEP)) / (2.0 * POSE_STEP)
    });
    of_camera.chain(of_pose).collect()
}

/// Where a camera sees a point of the target, distorted pixels.
pub(super) fn pixel_of(
    intrinsics: &Intrinsics,
    camera_from_target: &DAffine3,
    target_m: DVec2,
) -> DVec2 {
    let in_camera = camera_from_target.transform_point3(target_m.extend(0.0));
    intrinsics.pixel_from_plane(intrinsics.distort(in_camera.truncate() / in_camera.z))
}

fn stepped(intrinsics: &Intrinsics, parameter: usize, step: f64) -> Intrinsics {
    let mut stepped = *intrinsics;
    match parameter {
        0 => stepped.focal_px.x += step,
        1 => stepped.focal_px.y += step,
        2 => stepped.center_px.x += step,
        3 => stepped.center_px.y += step,
        coefficient => stepped.distortion[coefficient - 4] += step,
    }
    stepped
}

/// `way`: a turn about the camera's x, y or z, then a shift along them.
fn moved(pose: &DAffine3, way: usize, step: f64) -> DAffine3 {
    let axis = DVec3::AXES[way % 3];
    if way < 3 {
        let turn = DMat3::from_quat(DQuat::from_scaled_axis(axis * step));
        DAffine3::from_mat3_translation(turn * pose.matrix3, pose.translation)
    } else {
        DAffine3::from_mat3_translation(pose.matrix3, pose.translation + axis * step)
    }
}
