//! The inverse of the lens distortion, by Newton's method to the last digits.

use glam::{DMat2, DVec2};

use crate::geometry::camera::Intrinsics;

/// The undistorted pixel of a distorted one; `None` where the distortion model folds and has no inverse.
///
/// OpenCV's `undistortPoints` stops after five rounds of a fixed-point iteration, tenths of a pixel short in a wide
/// lens's corners.
pub fn undistorted_pixel(intrinsics: &Intrinsics, distorted_px: DVec2) -> Option<DVec2> {
    const ROUNDS: usize = 30;
    const TOLERANCE: f64 = 1e-12;
    let target = intrinsics.plane_from_pixel(distorted_px);
    let mut point = target;
    for _ in 0..ROUNDS {
        let step =
            distortion_jacobian(intrinsics, point).inverse() * (intrinsics.distort(point) - target);
        if !step.is_finite() {
            return None;
        }
        point -= step;
        if step.length() < TOLERANCE * (1.0 + point.length()) {
            // Behind the fold the map mirrors; its Jacobian is symmetric.
            let jacobian = distortion_jacobian(intrinsics, point);
            let unfolded =
                jacobian.determinant() > 0.0 && jacobian.x_axis.x + jacobian.y_axis.y > 0.0;
            return unfolded.then(|| intrinsics.pixel_from_plane(point));
        }
    }
    None
}

/// Derivative of [`Intrinsics::distort`].
pub(super) fn distortion_jacobian(intrinsics: &Intrinsics, point: DVec2) -> DMat2 {
    let [k1, k2, p1, p2, k3] = intrinsics.distortion;
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
    let mixed = x * y * slope + 2.0 * (p1 * x + p2 * y);
    DMat2::from_cols(
        DVec2::new(radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed),
        DVec2::new(mixed, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(distortion: [f64; 5]) -> Intrinsics {
        Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::new(615.0, 613.0),
            center_px: DVec2::new(321.4, 238.2),
            distortion,
        }
    }

    #[test]
    fn undistorting_inverts_distorting() {
        for distortion in [
            [0.0; 5],
            [0.08, -0.19, 0.0008, -0.0005, 0.05],
            [-0.35, 0.15, -0.002, 0.001, -0.03],
        ] {
            let camera = camera(distortion);
            for pixel in [(0.0, 0.0), (639.0, 0.0), (320.0, 240.0), (17.0, 461.0)].map(DVec2::from)
            {
                let undistorted = undistorted_pixel(&camera, pixel).unwrap();
                let back =
                    camera.pixel_from_plane(camera.distort(camera.plane_from_pixel(undistorted)));
                assert!(
                    (back - pixel).length() < 1e-9,
                    "{pixel} came back as {back}"
                );
            }
        }
    }

    #[test]
    fn no_point_is_made_up_where_the_model_folds() {
        // r (1 - r²/2) never exceeds 0.55, the picture's corner lies at 0.65.
        assert_eq!(
            undistorted_pixel(&camera([-0.5, 0.0, 0.0, 0.0, 0.0]), DVec2::ZERO),
            None
        );
    }
}
