//! The unknowns of a camera that nobody has calibrated, and what is usual of each: the logarithm of the focal length, the
//! principal point, k1 and k2. What pictures do not tell stays near what is usual.

use glam::{DVec2, DVec3};

use super::guessed_intrinsics;
use crate::geometry::camera::{Distortion, Intrinsics};

/// The number of unknowns.
pub(in crate::tracking) const CAMERA_UNKNOWNS: usize = 5;
/// The index of the logarithm of the focal length.
pub(in crate::tracking) const FOCAL: usize = 0;

/// Standard deviation of the logarithm of the focal length that nobody has measured: two of them are angles of view from
/// 32° to 98°.
pub(in crate::tracking) const FOCAL_PRIOR: f64 = 0.35;
/// Standard deviation of the principal point from the picture's middle, as a part of its longer side.
const CENTER_PRIOR: f64 = 0.02;
/// Standard deviations of k1 and k2.
const LENS_PRIOR: [f64; 2] = [0.15, 0.2];
/// Detectors' corners are no better than this, whatever fits: what blur, shade and compression do to one they do to its
/// neighbours; pixels.
pub(in crate::tracking) const LEAST_NOISE_PX: f64 = 0.15;

/// How far each unknown is from where its prior has it, in standard deviations, and those.
pub(in crate::tracking) fn priors(intrinsics: &Intrinsics) -> [(f64, f64); CAMERA_UNKNOWNS] {
    let usual = guessed_intrinsics(intrinsics.size_px);
    let [width, height] = intrinsics.size_px.map(f64::from);
    let focal = (intrinsics.focal_px.x / usual.focal_px.x).ln();
    let center_px = intrinsics.center_px - usual.center_px;
    let center_deviation_px = CENTER_PRIOR * width.max(height);
    let [k1, k2] = lens(intrinsics);
    [
        (focal, FOCAL_PRIOR),
        (center_px.x, center_deviation_px),
        (center_px.y, center_deviation_px),
        (k1, LENS_PRIOR[0]),
        (k2, LENS_PRIOR[1]),
    ]
    .map(|(off, deviation)| (off / deviation, deviation))
}

/// The camera after a step of its unknowns.
pub(in crate::tracking) fn stepped(
    intrinsics: &Intrinsics,
    step: &[f64; CAMERA_UNKNOWNS],
) -> Intrinsics {
    let [focal, center_x, center_y, by_k1, by_k2] = *step;
    let [k1, k2] = lens(intrinsics);
    Intrinsics {
        focal_px: intrinsics.focal_px * focal.clamp(-0.5, 0.5).exp(),
        center_px: intrinsics.center_px + DVec2::new(center_x, center_y),
        distortion: Distortion::Polynomial([k1 + by_k1, k2 + by_k2, 0.0, 0.0, 0.0]),
        ..*intrinsics
    }
}

/// The step of a point's pixel for one of each unknown; the point is in camera space, metres.
pub(in crate::tracking) fn by_camera(
    intrinsics: &Intrinsics,
    in_camera_m: DVec3,
    pixel: DVec2,
) -> [DVec2; CAMERA_UNKNOWNS] {
    let ray = in_camera_m.truncate() / in_camera_m.z;
    let by_k1 = intrinsics.focal_px * ray * ray.length_squared();
    [
        pixel - intrinsics.center_px,
        DVec2::X,
        DVec2::Y,
        by_k1,
        by_k1 * ray.length_squared(),
    ]
}

fn lens(intrinsics: &Intrinsics) -> [f64; 2] {
    let coefficients = intrinsics.distortion.coefficients();
    [coefficients[0], coefficients[1]]
}
