//! The pose of an anchor from the corners of its markers: where it may be (`pose_starts.rs`), refined by
//! Levenberg-Marquardt on the pixel error.
//!
//! A plane seen from afar has two poses that explain the picture about equally well; both are kept, and how sure the better
//! one is. Two planes have one.

use glam::{DAffine3, DVec3};

pub(super) use super::pose_starts::CornerObservation;
use super::pose_starts::{normal_of, starts};
use crate::geometry::camera::Intrinsics;
use crate::geometry::least_squares::{LevenbergMarquardt, Minimum, NormalEquations, Problem};
use crate::geometry::matrix::Matrix;
use crate::geometry::pose::{PoseStep, by_step, moved, rotation_between};

/// A pose and how well it explains the observations.
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
    pub(super) fn rms_px(&self, observations: usize) -> f64 {
        (self.squared_error_px / observations as f64).sqrt()
    }
}

/// Corners are hardly ever found better than this (standard deviation of a coordinate, pixels), so two poses that fit
/// even better are still not told apart.
const CORNER_NOISE_PX: f64 = 0.2;

/// Twice the logarithm of the odds, 100 : 1, from which on the better pose is believed. Under Gaussian noise of
/// variance σ² the odds of two poses are exp(difference of their squared errors / 2σ²).
const DECISIVE: f64 = 9.2;

/// The two poses of a plane, or the best two of what is not flat. The observations are markers' corners, four by four, as
/// printed from the top left clockwise. `None` when no pose in front of the camera, to which all of them face, explains them.
pub(super) fn solve(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
) -> Option<Solutions> {
    let mut solutions = starts(intrinsics, observations)
        .into_iter()
        .filter_map(|start| refine(intrinsics, observations, start))
        .filter(|solution| is_seen_from_the_front(&solution.camera_from_anchor, observations))
        .collect::<Vec<_>>();
    solutions.sort_by(|a, b| a.squared_error_px.total_cmp(&b.squared_error_px));
    let best = *solutions.first()?;
    let is_other = |other: &&Solution| {
        rotation_between(&best.camera_from_anchor, &other.camera_from_anchor) > 1e-4
    };
    let alternative = solutions[1..].iter().find(is_other).copied();
    let degrees_of_freedom = (2 * observations.len()).saturating_sub(6).max(1) as f64;
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

fn is_seen_from_the_front(
    camera_from_anchor: &DAffine3,
    observations: &[CornerObservation],
) -> bool {
    observations.chunks(4).all(|corners| {
        let Some(normal) = normal_of(corners) else {
            return false;
        };
        let toward_viewer = camera_from_anchor.matrix3 * normal;
        corners.iter().all(|observation| {
            let in_camera = camera_from_anchor.transform_point3(observation.point_m);
            in_camera.z > 0.0 && toward_viewer.dot(in_camera) < 0.0
        })
    })
}

/// A pose that is moved to where it explains the observations.
struct CornerFit<'a> {
    intrinsics: &'a Intrinsics,
    observations: &'a [CornerObservation],
    camera_from_anchor: DAffine3,
}

impl Problem for CornerFit<'_> {
    type Linearized = NormalEquations<6>;

    fn cost(&self) -> Option<f64> {
        let mut squares_px = 0.0;
        for observation in self.observations {
            let in_camera_m = self
                .camera_from_anchor
                .transform_point3(observation.point_m);
            let pixel = self.intrinsics.undistorted_pixel_of(in_camera_m)?;
            squares_px += (pixel - observation.pixel).length_squared();
        }
        squares_px.is_finite().then_some(squares_px)
    }

    fn linearized(&self) -> Option<NormalEquations<6>> {
        let mut equations = NormalEquations::ZERO;
        for observation in self.observations {
            let turned_m = self.camera_from_anchor.matrix3 * observation.point_m;
            let in_camera_m = turned_m + self.camera_from_anchor.translation;
            let projection = self.intrinsics.project_undistorted(in_camera_m)?;
            let missing_px = observation.pixel - projection.pixel;
            let gradients = projection.gradients();
            for (gradient, value) in gradients.into_iter().zip(missing_px.to_array()) {
                equations.add(&by_step(turned_m, gradient), value);
            }
        }
        Some(equations)
    }

    fn moved(&self, step: &PoseStep) -> Self {
        Self {
            camera_from_anchor: moved(&self.camera_from_anchor, *step),
            ..*self
        }
    }

    fn is_negligible(&self, step: &PoseStep) -> bool {
        const TOLERANCE: f64 = 1e-10;
        let [rx, ry, rz, tx, ty, tz] = *step;
        DVec3::new(rx, ry, rz).length() < TOLERANCE
            && DVec3::new(tx, ty, tz).length()
                < TOLERANCE * self.camera_from_anchor.translation.length()
    }
}

/// The pose near `start` that explains the observations best; `None` when it does not come to rest in front of the camera.
pub(super) fn refine(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
    start: DAffine3,
) -> Option<Solution> {
    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-4,
        rounds: 100,
        least_gain: 0.0,
    };
    let found = minimized(&METHOD, intrinsics, observations, start)?;
    found.is_settled.then_some(Solution {
        camera_from_anchor: found.problem.camera_from_anchor,
        squared_error_px: found.cost,
    })
}

/// The pose near `start` that a few steps toward the best one come to, where many starts are to be compared.
pub(super) fn refine_roughly(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
    start: DAffine3,
) -> Option<Solution> {
    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-3,
        rounds: 15,
        least_gain: 1e-6,
    };
    let found = minimized(&METHOD, intrinsics, observations, start)?;
    Some(Solution {
        camera_from_anchor: found.problem.camera_from_anchor,
        squared_error_px: found.cost,
    })
}

fn minimized<'a>(
    method: &LevenbergMarquardt,
    intrinsics: &'a Intrinsics,
    observations: &'a [CornerObservation],
    start: DAffine3,
) -> Option<Minimum<CornerFit<'a>>> {
    method.minimize(CornerFit {
        intrinsics,
        observations,
        camera_from_anchor: start,
    })
}

/// The covariance of a pose's step, from corners.
pub(super) fn covariance(
    intrinsics: &Intrinsics,
    observations: &[CornerObservation],
    pose: &DAffine3,
) -> Option<Matrix<6>> {
    let fit = CornerFit {
        intrinsics,
        observations,
        camera_from_anchor: *pose,
    };
    Some(fit.linearized()?.covariance()? * (CORNER_NOISE_PX * CORNER_NOISE_PX))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec2};

    use super::*;
    use crate::geometry::camera::Distortion;

    const CAMERA: Intrinsics = Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(615.0, 613.0),
        center_px: DVec2::new(321.4, 238.2),
        distortion: Distortion::NONE,
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

    fn observations(
        points_m: &[DVec2],
        pose: &DAffine3,
        mut noise: impl FnMut() -> f64,
    ) -> Vec<CornerObservation> {
        points_m
            .iter()
            .map(|point_m| {
                let point_m = point_m.extend(0.0);
                let pixel = CAMERA.undistorted_pixel_of(pose.transform_point3(point_m));
                CornerObservation {
                    point_m,
                    pixel: pixel.unwrap() + DVec2::new(noise(), noise()),
                }
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
                let seen = observations(&square(0.04), &truth, || 0.0);
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
        let seen = observations(&square(0.05), &truth, gaussian(1.0));
        let fit = CornerFit {
            intrinsics: &CAMERA,
            observations: &seen,
            camera_from_anchor: truth,
        };
        let gradient = fit.linearized().unwrap().right;
        for k in 0..6 {
            let moved = |by: f64| {
                let mut step = [0.0; 6];
                step[k] = by;
                fit.moved(&step).cost().unwrap()
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
            let found = solve(&CAMERA, &observations(&square(0.036), &truth, &mut noise)).unwrap();
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
            let found = solve(&CAMERA, &observations(&board, &truth, &mut noise)).unwrap();
            assert!(rotation_between(&found.best.camera_from_anchor, &truth) < 0.02);
            // Within a few degrees of frontal the two poses are one up to the noise.
            assert!(!found.ambiguous || k % 50 < 5, "tilt {}°", k % 50);
        }
    }

    #[test]
    fn nonsense_has_no_pose() {
        let truth = pose(20.0, 0.0, 0.5);
        let seen = observations(&square(0.04), &truth, || 0.0);
        assert_eq!(solve(&CAMERA, &seen[..3]), None);
        let on_a_line = (0..4)
            .map(|k| CornerObservation {
                point_m: seen[k].point_m,
                pixel: DVec2::splat(100.0 + 10.0 * k as f64),
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &on_a_line), None);
        let at_a_point = seen
            .iter()
            .map(|s| CornerObservation {
                pixel: DVec2::splat(9.0),
                ..*s
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &at_a_point), None);
        // A mirrored picture shows the back of the marker.
        let mirrored = seen
            .iter()
            .map(|s| CornerObservation {
                pixel: DVec2::new(639.0 - s.pixel.x, s.pixel.y),
                ..*s
            })
            .collect::<Vec<_>>();
        assert_eq!(solve(&CAMERA, &mirrored), None);
    }
}
