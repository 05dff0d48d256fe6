//! The pose of a planar anchor from its corners: a homography, its two decompositions (IPPE), both refined by
//! Levenberg-Marquardt on the pixel error.
//!
//! T. Collins and A. Bartoli, "Infinitesimal plane-based pose estimation", IJCV 2014. A plane seen from afar has two
//! poses that explain the picture about equally well; both are kept, and how sure the better one is.

use glam::{DAffine3, DMat2, DMat3, DVec2, DVec3};

use super::least_squares::{Matrix6, accumulate, inverse, solve_positive_definite, times};
use crate::geometry::camera::Intrinsics;

/// A point of the anchor's plane and where it was seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Sighting {
    /// In the anchor's plane z = 0, metres.
    pub(super) point_m: DVec2,
    /// Undistorted pixel.
    pub(super) pixel: DVec2,
}

/// A pose and how well it explains the sightings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solution {
    pub(super) camera_from_anchor: DAffine3,
    pub(super) squared_error_px: f64,
}

/// The better pose first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Solutions {
    pub(super) best: Solution,
    pub(super) alternative: Option<Solution>,
    /// Whether the picture does not decide between the two.
    pub(super) ambiguous: bool,
}

impl Solution {
    /// Root mean square distance of a corner from where the pose puts it, pixels.
    pub(super) fn rms_px(&self, sightings: usize) -> f64 {
        (self.squared_error_px / sightings as f64).sqrt()
    }
}

/// Corners are hardly ever found better than this (standard deviation of a coordinate, pixels), so two poses that fit
/// even better are still not told apart.
const CORNER_NOISE_PX: f64 = 0.2;

/// Twice the logarithm of the odds, 100 : 1, from which on the better pose is believed. Under Gaussian noise of
/// variance σ² the odds of two poses are exp(difference of their squared errors / 2σ²).
const DECISIVE: f64 = 9.2;

/// Both poses of a plane. `None` when no pose in front of the camera, facing it, explains the sightings.
pub(super) fn solve(intrinsics: &Intrinsics, sightings: &[Sighting]) -> Option<Solutions> {
    let starts = ippe_starts(intrinsics, sightings)?;
    let mut solutions = starts
        .into_iter()
        .filter_map(|start| refine(intrinsics, sightings, start))
        .filter(|solution| is_seen_from_the_front(&solution.camera_from_anchor, sightings))
        .collect::<Vec<_>>();
    solutions.sort_by(|a, b| a.squared_error_px.total_cmp(&b.squared_error_px));
    let best = *solutions.first()?;
    let alternative = solutions.get(1).copied().filter(|other| {
        rotation_between(&best.camera_from_anchor, &other.camera_from_anchor) > 1e-4
    });
    let degrees_of_freedom = (2 * sightings.len()).saturating_sub(6).max(1) as f64;
    let variance =
        (best.squared_error_px / degrees_of_freedom).max(CORNER_NOISE_PX * CORNER_NOISE_PX);
    let ambiguous = alternative
        .is_some_and(|other| other.squared_error_px - best.squared_error_px < DECISIVE * variance);
    Some(Solutions {
        best,
        alternative,
        ambiguous,
    })
}

/// Where the pose puts a point of the anchor's plane, undistorted pixels.
pub(super) fn pixel_of(
    intrinsics: &Intrinsics,
    camera_from_anchor: &DAffine3,
    point_m: DVec2,
) -> DVec2 {
    let in_camera = camera_from_anchor.transform_point3(point_m.extend(0.0));
    intrinsics.pixel_from_plane(in_camera.truncate() / in_camera.z)
}

/// Angle between the rotations of two poses, radians.
pub(super) fn rotation_between(a: &DAffine3, b: &DAffine3) -> f64 {
    let turned = a.matrix3.transpose() * b.matrix3;
    // From the sine and the cosine, since each alone is blind somewhere.
    let sine = DVec3::new(
        turned.y_axis.z - turned.z_axis.y,
        turned.z_axis.x - turned.x_axis.z,
        turned.x_axis.y - turned.y_axis.x,
    )
    .length()
        / 2.0;
    let cosine = (turned.x_axis.x + turned.y_axis.y + turned.z_axis.z - 1.0) / 2.0;
    sine.atan2(cosine)
}

fn is_seen_from_the_front(camera_from_anchor: &DAffine3, sightings: &[Sighting]) -> bool {
    let toward_viewer = camera_from_anchor.matrix3.z_axis;
    sightings.iter().all(|sighting| {
        let in_camera = camera_from_anchor.transform_point3(sighting.point_m.extend(0.0));
        in_camera.z > 0.0 && toward_viewer.dot(in_camera) < 0.0
    })
}

/// The two poses that the homography's derivative at the points' centre allows (IPPE, section 4).
pub(super) fn ippe_starts(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
) -> Option<[DAffine3; 2]> {
    if sightings.len() < 4 {
        return None;
    }
    let count = sightings.len() as f64;
    let center_m = sightings
        .iter()
        .map(|sighting| sighting.point_m)
        .sum::<DVec2>()
        / count;
    let spread_m = (sightings
        .iter()
        .map(|sighting| (sighting.point_m - center_m).length_squared())
        .sum::<f64>()
        / count)
        .sqrt();
    let in_plane = |sighting: &Sighting| (sighting.point_m - center_m) / spread_m;
    let pairs = sightings
        .iter()
        .map(|sighting| {
            (
                in_plane(sighting),
                intrinsics.plane_from_pixel(sighting.pixel),
            )
        })
        .collect::<Vec<_>>();
    let homography = homography(&pairs)?;
    // The picture of the centre, and the derivative there.
    let image_center = homography.z_axis.truncate() / homography.z_axis.z;
    let derivative =
        |column: DVec3| (column.truncate() - image_center * column.z) / homography.z_axis.z;
    let jacobian = DMat2::from_cols(derivative(homography.x_axis), derivative(homography.y_axis));
    let rotations = ippe_rotations(image_center, jacobian)?;
    let mut poses = [DAffine3::IDENTITY; 2];
    for (pose, rotation) in poses.iter_mut().zip(rotations) {
        let translation_m = translation_for(intrinsics, sightings, &rotation)?;
        *pose = DAffine3::from_mat3_translation(rotation, translation_m);
    }
    Some(poses)
}

/// The homography from points to image points (plane z = 1) by linear least squares; the points' centre must be 0 and
/// be seen, so that its last entry can be 1.
fn homography(pairs: &[(DVec2, DVec2)]) -> Option<DMat3> {
    let count = pairs.len() as f64;
    let center = pairs.iter().map(|&(_, image)| image).sum::<DVec2>() / count;
    let spread = (pairs
        .iter()
        .map(|&(_, image)| (image - center).length_squared())
        .sum::<f64>()
        / count)
        .sqrt();
    let mut normal = [[0.0; 8]; 8];
    let mut right = [0.0; 8];
    for &(point, image) in pairs {
        let (x, y) = (point.x, point.y);
        let image = (image - center) / spread;
        for (row, value) in [
            (
                [x, y, 1.0, 0.0, 0.0, 0.0, -image.x * x, -image.x * y],
                image.x,
            ),
            (
                [0.0, 0.0, 0.0, x, y, 1.0, -image.y * x, -image.y * y],
                image.y,
            ),
        ] {
            accumulate(&mut normal, &mut right, &row, value);
        }
    }
    let h = solve_positive_definite(&normal, &right)?;
    let normalized = DMat3::from_cols(
        DVec3::new(h[0], h[3], h[6]),
        DVec3::new(h[1], h[4], h[7]),
        DVec3::new(h[2], h[5], 1.0),
    );
    let image_from_normalized = DMat3::from_cols(
        DVec3::new(spread, 0.0, 0.0),
        DVec3::new(0.0, spread, 0.0),
        center.extend(1.0),
    );
    Some(image_from_normalized * normalized)
}

/// Both rotations of a plane whose centre is seen at `image_center` with the derivative `jacobian` (up to scale).
fn ippe_rotations(image_center: DVec2, jacobian: DMat2) -> Option<[DMat3; 2]> {
    // The rotation that turns the optical axis to the centre's ray.
    let ray = image_center.extend(1.0).normalize();
    let axis_to_ray = glam::DMat3::from_quat(glam::DQuat::from_rotation_arc(DVec3::Z, ray));
    let seen = |column: DVec3| column.truncate() - image_center * column.z;
    let basis = DMat2::from_cols(seen(axis_to_ray.x_axis), seen(axis_to_ray.y_axis));
    let scaled = basis.inverse() * jacobian;
    // The largest singular value is what remains of the depth.
    let (rows_x, rows_y) = (scaled.row(0), scaled.row(1));
    let (xx, xy, yy) = (
        rows_x.length_squared(),
        rows_x.dot(rows_y),
        rows_y.length_squared(),
    );
    let largest = (0.5 * (xx + yy + ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt())).sqrt();
    if !(largest.is_finite() && largest > 0.0) {
        return None;
    }
    let upper = scaled * (1.0 / largest);
    // Unit columns that are perpendicular give the last row up to its sign.
    let first = (1.0 - upper.x_axis.length_squared()).max(0.0).sqrt();
    let second = (1.0 - upper.y_axis.length_squared()).max(0.0).sqrt();
    let second = if upper.x_axis.dot(upper.y_axis) > 0.0 {
        -second
    } else {
        second
    };
    let rotation = |sign: f64| {
        let x = upper.x_axis.extend(sign * first);
        let y = upper.y_axis.extend(sign * second);
        let x = x.normalize();
        let y = (y - x * x.dot(y)).normalize();
        axis_to_ray * DMat3::from_cols(x, y, x.cross(y))
    };
    let rotations = [rotation(1.0), rotation(-1.0)];
    rotations
        .iter()
        .all(|rotation| rotation.is_finite())
        .then_some(rotations)
}

/// The translation that fits best, linearly, once the rotation is known.
fn translation_for(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    rotation: &DMat3,
) -> Option<DVec3> {
    let mut normal = [[0.0; 3]; 3];
    let mut right = [0.0; 3];
    for sighting in sightings {
        let image = intrinsics.plane_from_pixel(sighting.pixel);
        let turned = *rotation * sighting.point_m.extend(0.0);
        accumulate(
            &mut normal,
            &mut right,
            &[1.0, 0.0, -image.x],
            image.x * turned.z - turned.x,
        );
        accumulate(
            &mut normal,
            &mut right,
            &[0.0, 1.0, -image.y],
            image.y * turned.z - turned.y,
        );
    }
    solve_positive_definite(&normal, &right).map(DVec3::from)
}

/// Levenberg-Marquardt on the six parameters of the pose; `None` when it does not converge to a pose in front.
pub(super) fn refine(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    start: DAffine3,
) -> Option<Solution> {
    const ROUNDS: usize = 100;
    const STEP_TOLERANCE: f64 = 1e-10;
    let mut pose = start;
    let mut error = squared_error(intrinsics, sightings, &pose)?;
    let mut damping = 1e-4;
    let (mut normal, mut right) = linearize(intrinsics, sightings, &pose);
    for _ in 0..ROUNDS {
        let mut damped = normal;
        for (k, row) in damped.iter_mut().enumerate() {
            row[k] *= 1.0 + damping;
        }
        let [rx, ry, rz, tx, ty, tz] = solve_positive_definite(&damped, &right)?;
        let (turn, shift_m) = (DVec3::new(rx, ry, rz), DVec3::new(tx, ty, tz));
        let small = turn.length() < STEP_TOLERANCE
            && shift_m.length() < STEP_TOLERANCE * pose.translation.length();
        let rotation = (glam::DQuat::from_scaled_axis(turn)
            * glam::DQuat::from_mat3(&pose.matrix3))
        .normalize();
        let candidate = DAffine3::from_rotation_translation(rotation, pose.translation + shift_m);
        match squared_error(intrinsics, sightings, &candidate) {
            Some(candidate_error) if candidate_error < error => {
                pose = candidate;
                error = candidate_error;
                damping = (damping / 10.0).max(1e-12);
                (normal, right) = linearize(intrinsics, sightings, &pose);
            }
            // At the bottom rounding alone decides.
            _ if small => {}
            _ => damping *= 10.0,
        }
        if small || damping > 1e12 {
            return Some(Solution {
                camera_from_anchor: pose,
                squared_error_px: error,
            });
        }
    }
    None
}

/// `None` when a point lies behind the camera.
fn squared_error(intrinsics: &Intrinsics, sightings: &[Sighting], pose: &DAffine3) -> Option<f64> {
    let mut sum = 0.0;
    for sighting in sightings {
        if pose.transform_point3(sighting.point_m.extend(0.0)).z <= 0.0 {
            return None;
        }
        sum += (pixel_of(intrinsics, pose, sighting.point_m) - sighting.pixel).length_squared();
    }
    sum.is_finite().then_some(sum)
}

/// Covariance of a pose from corners: of a turn about the anchor's origin (left of the rotation) and a shift.
pub(super) fn covariance(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    pose: &DAffine3,
) -> Option<Matrix6> {
    let (normal, _) = linearize(intrinsics, sightings, pose);
    Some(times(&inverse(&normal)?, CORNER_NOISE_PX * CORNER_NOISE_PX))
}

/// The normal equations of the Gauss-Newton step: a turn about the anchor's origin (left of the rotation), a shift.
fn linearize(
    intrinsics: &Intrinsics,
    sightings: &[Sighting],
    pose: &DAffine3,
) -> ([[f64; 6]; 6], [f64; 6]) {
    let mut normal = [[0.0; 6]; 6];
    let mut right = [0.0; 6];
    for sighting in sightings {
        let turned = pose.matrix3 * sighting.point_m.extend(0.0);
        let in_camera = turned + pose.translation;
        let image = in_camera.truncate() / in_camera.z;
        let missing = sighting.pixel - intrinsics.pixel_from_plane(image);
        let by_position = [
            DVec3::new(1.0, 0.0, -image.x) * (intrinsics.focal_px.x / in_camera.z),
            DVec3::new(0.0, 1.0, -image.y) * (intrinsics.focal_px.y / in_camera.z),
        ];
        for (gradient, value) in by_position.into_iter().zip(missing.to_array()) {
            // gradient · (turn × turned) = turn · (turned × gradient)
            let by_turn = turned.cross(gradient);
            let row = [
                by_turn.x, by_turn.y, by_turn.z, gradient.x, gradient.y, gradient.z,
            ];
            accumulate(&mut normal, &mut right, &row, value);
        }
    }
    (normal, right)
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    const CAMERA: Intrinsics = Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(615.0, 613.0),
        center_px: DVec2::new(321.4, 238.2),
        distortion: [0.0; 5],
    };

    /// A camera that looks at the anchor from above, turned and tilted.
    fn pose(tilt_deg: f64, turn_deg: f64, distance_m: f64) -> DAffine3 {
        let facing = DQuat::from_rotation_x(std::f64::consts::PI);
        let tilt = DQuat::from_rotation_x(tilt_deg.to_radians())
            * DQuat::from_rotation_y(0.3 * tilt_deg.to_radians());
        let turn = DQuat::from_rotation_z(turn_deg.to_radians());
        DAffine3::from_rotation_translation(
            tilt * facing * turn,
            DVec3::new(0.03, -0.02, distance_m),
        )
    }

    fn square(size_m: f64) -> Vec<DVec2> {
        let half = size_m / 2.0;
        vec![
            DVec2::new(-half, half),
            DVec2::new(half, half),
            DVec2::new(half, -half),
            DVec2::new(-half, -half),
        ]
    }

    fn sightings(
        points_m: &[DVec2],
        pose: &DAffine3,
        mut noise: impl FnMut() -> f64,
    ) -> Vec<Sighting> {
        points_m
            .iter()
            .map(|&point_m| Sighting {
                point_m,
                pixel: pixel_of(&CAMERA, pose, point_m) + DVec2::new(noise(), noise()),
            })
            .collect()
    }

    /// Gaussian noise of a fixed seed.
    fn gaussian(sigma: f64) -> impl FnMut() -> f64 {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        let mut uniform = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        move || sigma * ((0..12).map(|_| uniform()).sum::<f64>() - 6.0)
    }

    #[test]
    fn exact_corners_give_the_exact_pose() {
        for tilt_deg in [0.0, 5.0, 20.0, 60.0] {
            for turn_deg in [0.0, 90.0, 137.0, 180.0, 271.0] {
                let truth = pose(tilt_deg, turn_deg, 0.5);
                let seen = sightings(&square(0.04), &truth, || 0.0);
                let found = solve(&CAMERA, &seen).unwrap();
                let error_m =
                    (found.best.camera_from_anchor.translation - truth.translation).length();
                let error = rotation_between(&found.best.camera_from_anchor, &truth);
                assert!(
                    error_m < 1e-8 && error < 1e-6,
                    "tilt {tilt_deg} turn {turn_deg}: {error_m} m {error}"
                );
                assert!(found.best.rms_px(4) < 1e-8);
            }
        }
    }

    #[test]
    fn the_derivative_agrees_with_differences() {
        let truth = pose(30.0, 40.0, 0.6);
        let seen = sightings(&square(0.05), &truth, gaussian(1.0));
        let (_, gradient) = linearize(&CAMERA, &seen, &truth);
        for k in 0..6 {
            let moved = |by: f64| {
                let mut step = [0.0; 6];
                step[k] = by;
                let turn = DQuat::from_scaled_axis(DVec3::new(step[0], step[1], step[2]));
                let moved = DAffine3::from_mat3_translation(
                    DMat3::from_quat(turn) * truth.matrix3,
                    truth.translation + DVec3::new(step[3], step[4], step[5]),
                );
                squared_error(&CAMERA, &seen, &moved).unwrap()
            };
            let difference = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            // The error falls along the right side, by twice of it.
            assert!(
                (difference + 2.0 * gradient[k]).abs() < 1e-4 * (1.0 + difference.abs()),
                "parameter {k}"
            );
        }
    }

    #[test]
    fn a_lone_marker_that_claims_to_be_sure_is_right() {
        let mut noise = gaussian(0.2);
        let (mut sure, mut wrong, mut lost_truth) = (0, 0, 0);
        for k in 0..2000 {
            let truth = pose(
                f64::from(k % 40) * 1.5,
                f64::from(k * 37 % 360),
                0.3 + f64::from(k % 7) * 0.1,
            );
            let found = solve(&CAMERA, &sightings(&square(0.036), &truth, &mut noise)).unwrap();
            let off = |solution: &Solution| rotation_between(&solution.camera_from_anchor, &truth);
            let other = found.alternative.as_ref().map(off);
            let best_is_nearer = other.is_none_or(|other| off(&found.best) <= other);
            if !found.ambiguous {
                sure += 1;
                wrong += usize::from(!best_is_nearer);
            }
            // Whichever is right, it must be among the two.
            lost_truth += usize::from(off(&found.best).min(other.unwrap_or(f64::MAX)) > 0.3);
        }
        assert!(sure > 700, "only {sure} of 2000 decided");
        assert!(wrong * 100 <= sure, "{wrong} wrong of {sure}");
        assert!(
            lost_truth <= 20,
            "{lost_truth} of 2000 with neither pose near the truth"
        );
    }

    #[test]
    fn a_board_is_hardly_ever_ambiguous() {
        let mut noise = gaussian(0.3);
        let board = [
            (-0.175, 0.115),
            (0.0, 0.115),
            (0.175, -0.115),
            (-0.175, -0.115),
        ]
        .iter()
        .flat_map(|&(x, y)| {
            square(0.045)
                .into_iter()
                .map(move |corner| corner + DVec2::new(x, y))
        })
        .collect::<Vec<_>>();
        for k in 0..200 {
            let truth = pose(f64::from(k % 50), f64::from(k * 37 % 360), 0.6);
            let found = solve(&CAMERA, &sightings(&board, &truth, &mut noise)).unwrap();
            assert!(rotation_between(&found.best.camera_from_anchor, &truth) < 0.02);
            // Within a few degrees of frontal the two poses are one up to the noise.
            assert!(!found.ambiguous || k % 50 < 5, "tilt {}°", k % 50);
        }
    }

    #[test]
    fn nonsense_has_no_pose() {
        let truth = pose(20.0, 0.0, 0.5);
        let seen = sightings(&square(0.04), &truth, || 0.0);
        assert_eq!(solve(&CAMERA, &seen[..3]), None);
        let on_a_line = (0..4)
            .map(|k| Sighting {
                point_m: seen[k].point_m,
                pixel: DVec2::splat(100.0 + 10.0 * k as f64),
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &on_a_line), None);
        let at_a_point = seen
            .iter()
            .map(|s| Sighting {
                pixel: DVec2::splat(9.0),
                ..*s
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &at_a_point), None);
        // A mirrored picture shows the back of the marker.
        let mirrored = seen
            .iter()
            .map(|s| Sighting {
                pixel: DVec2::new(639.0 - s.pixel.x, s.pixel.y),
                ..*s
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &mirrored), None);
    }
}
