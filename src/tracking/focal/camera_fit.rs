//! The camera that explains views of flat boards best: its focal length first from what a plane's homography says of it
//! (Zhang, "A flexible new technique for camera calibration", 2000, section 3.1), then from all corners at once.
//!
//! The unknowns of the camera are few, and each has a prior: what the pictures do not tell stays near what is usual. The
//! poses are eliminated (Schur complement), so that the normal equations tell how sure the focal length is with all that
//! may make up for it: distance, tilt, principal point, lens, and the size of the print.

use glam::{DAffine3, DMat3, DVec2};

use super::free_camera::{
    CAMERA_UNKNOWNS, FOCAL, FOCAL_PRIOR, LEAST_NOISE_PX, by_camera, priors, stepped,
};
use super::guessed_intrinsics;
use crate::geometry::camera::Intrinsics;
use crate::geometry::homography::{PointScale, linear_homography};
use crate::geometry::least_squares::{LevenbergMarquardt, Linearized, NormalEquations, Problem};
use crate::geometry::matrix::{Matrix, dot};
use crate::geometry::pose::{by_step, moved};
use crate::geometry::robust::{huber_loss, huber_weight};
use crate::tracking::pose::{self, CornerObservation};

/// The camera's unknowns, and the part of their size by which markers are printed larger than they should be.
const CAMERA: usize = CAMERA_UNKNOWNS + 1;
const POSE: usize = 6;
const BOTH: usize = CAMERA + POSE;

/// Standard deviation of a print's scale.
const SIZE_PRIOR: f64 = 0.02;
/// Corners farther off than so many standard deviations count less.
const HUBER: f64 = 2.0;
/// Times that poses are looked for anew with the camera that was found: the first ones rest on a rough one.
const ROUNDS: usize = 3;

/// A corner of a board, and where a picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BoardCorner {
    /// Its marker's middle in the board's frame, metres.
    pub(super) center_m: DVec2,
    /// From there to the corner, metres.
    pub(super) from_center_m: DVec2,
    /// Distorted pixel.
    pub(super) pixel: DVec2,
}

/// What pictures tell of a camera.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct CameraFit {
    pub(super) intrinsics: Intrinsics,
    /// Standard deviation of the focal length as a part of it.
    pub(super) focal_deviation: f64,
    /// Views that it rests on.
    pub(super) views: usize,
}

impl BoardCorner {
    pub(super) fn board_m(&self) -> DVec2 {
        self.center_m + self.from_center_m
    }
}

/// The camera that explains the views best; `None` where none of them has a pose.
pub(super) fn fit(size_px: [u32; 2], views: &[&[BoardCorner]]) -> Option<CameraFit> {
    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-3,
        rounds: 50,
        least_gain: 1e-9,
    };
    let mut camera = FittedCamera::of(Intrinsics {
        focal_px: DVec2::splat(first_focal_px(size_px, views)),
        ..guessed_intrinsics(size_px)
    });
    let mut noise_px = 1.0;
    let mut found = None;
    for _ in 0..ROUNDS {
        let posed: Vec<PosedView<'_>> = views
            .iter()
            .filter_map(|corners| PosedView::of(&camera, corners))
            .collect();
        if posed.is_empty() {
            return None;
        }
        let mut joint = JointFit {
            camera,
            views: posed,
            noise_px,
        };
        for _ in 0..2 {
            joint = METHOD.minimize(joint)?.problem;
            joint.noise_px = joint.measured_noise_px()?;
        }
        (camera, noise_px) = (joint.camera, joint.noise_px);
        found = Some(joint);
    }
    let joint = found?;
    Some(CameraFit {
        intrinsics: joint.camera.intrinsics,
        focal_deviation: joint.focal_deviation()?,
        views: joint.views.len(),
    })
}

/// How much a view tells of the focal length by itself: the inverse variance of its logarithm where all else of the camera
/// is known, corners being off by a pixel.
pub(super) fn information(intrinsics: &Intrinsics, corners: &[BoardCorner]) -> f64 {
    let camera = FittedCamera::of(*intrinsics);
    let of_view = || {
        let view = PosedView::of(&camera, corners)?;
        let equations = view.equations(&camera, f64::INFINITY, 1.0)?;
        Some(Reduced::of(&equations, 0.0)?.equations.matrix.0[FOCAL][FOCAL])
    };
    of_view().unwrap_or(0.0)
}

/// The focal length of square pixels about the picture's middle that the views' homographies agree on best; a usual one
/// where they tell none.
///
/// With a homography's columns h, scaled to a picture whose focal length is 1, a plane says h1ᵀ ω h2 = 0 and
/// h1ᵀ ω h1 = h2ᵀ ω h2, where ω = diag(w, w, 1) and the focal length is 1 / √w: two linear equations in w.
pub(super) fn first_focal_px(size_px: [u32; 2], views: &[&[BoardCorner]]) -> f64 {
    /// What is farther off is none.
    const MOST: f64 = 4.0;
    let usual = guessed_intrinsics(size_px);
    let mut equations = NormalEquations::<1>::ZERO;
    for corners in views {
        let scale = PointScale::of(corners.iter().map(BoardCorner::board_m));
        let pairs: Vec<(DVec2, DVec2)> = corners
            .iter()
            .map(|corner| {
                (
                    scale.scaled(corner.board_m()),
                    usual.plane_from_pixel(corner.pixel),
                )
            })
            .collect();
        let Some(DMat3 { x_axis, y_axis, .. }) = linear_homography(&pairs) else {
            continue;
        };
        let size = x_axis.truncate().length() * y_axis.truncate().length();
        let (flat_x, flat_y) = (x_axis.truncate(), y_axis.truncate());
        let across = flat_x.dot(flat_y);
        equations.add(&[across / size], -x_axis.z * y_axis.z / size);
        let along = flat_x.length_squared() - flat_y.length_squared();
        let depths = y_axis.z * y_axis.z - x_axis.z * x_axis.z;
        equations.add(&[along / size], depths / size);
    }
    let ratio = equations.solve().map(|[w]| w.sqrt().recip());
    let believed = ratio.filter(|ratio| (MOST.recip()..=MOST).contains(ratio));
    believed.unwrap_or(1.0) * usual.focal_px.x
}

/// A camera, and how large its boards are printed.
#[derive(Debug, Clone, Copy)]
struct FittedCamera {
    intrinsics: Intrinsics,
    /// The part of their size by which markers are larger than they should be.
    size_error: f64,
}

impl FittedCamera {
    fn of(intrinsics: Intrinsics) -> Self {
        Self {
            intrinsics,
            size_error: 0.0,
        }
    }

    fn board_m(&self, corner: &BoardCorner) -> DVec2 {
        corner.center_m + corner.from_center_m * (1.0 + self.size_error)
    }

    /// How far each unknown is from where its prior has it, in standard deviations, and those.
    fn priors(&self) -> [(f64, f64); CAMERA] {
        let [focal, center_x, center_y, k1, k2] = priors(&self.intrinsics);
        let size = (self.size_error / SIZE_PRIOR, SIZE_PRIOR);
        [focal, center_x, center_y, k1, k2, size]
    }

    fn moved(&self, step: &[f64; CAMERA]) -> Self {
        let [ref of_camera @ .., size] = *step;
        Self {
            intrinsics: stepped(&self.intrinsics, of_camera),
            size_error: self.size_error + size,
        }
    }
}

/// A view, and where its board lies.
#[derive(Debug, Clone, Copy)]
struct PosedView<'a> {
    corners: &'a [BoardCorner],
    camera_from_board: DAffine3,
}

impl<'a> PosedView<'a> {
    /// `None` where no pose explains the corners, or two do.
    fn of(camera: &FittedCamera, corners: &'a [BoardCorner]) -> Option<Self> {
        let observations: Option<Vec<CornerObservation>> = corners
            .iter()
            .map(|corner| {
                Some(CornerObservation {
                    point_m: camera.board_m(corner).extend(0.0),
                    pixel: camera.intrinsics.undistorted_pixel(corner.pixel)?,
                })
            })
            .collect();
        let solutions = pose::solve(&camera.intrinsics, &observations?)?;
        (!solutions.ambiguous).then_some(Self {
            corners,
            camera_from_board: solutions.best.camera_from_anchor,
        })
    }

    /// How far each corner is from where the camera sees it, pixels; `None` behind the camera.
    fn distances_px(&self, camera: &FittedCamera) -> Option<Vec<f64>> {
        let corners = self.corners.iter().map(|corner| {
            let in_camera_m =
                (self.camera_from_board).transform_point3(camera.board_m(corner).extend(0.0));
            let expected_px = camera.intrinsics.pixel_of(in_camera_m)?;
            Some(expected_px.distance(corner.pixel))
        });
        corners.collect()
    }

    /// Its equations in the camera's unknowns and the pose's step, in units of the noise.
    fn equations(
        &self,
        camera: &FittedCamera,
        limit_px: f64,
        noise_px: f64,
    ) -> Option<NormalEquations<BOTH>> {
        let mut equations = NormalEquations::ZERO;
        let intrinsics = &camera.intrinsics;
        let rotation = self.camera_from_board.matrix3;
        for corner in self.corners {
            let turned_m = rotation * camera.board_m(corner).extend(0.0);
            let in_camera_m = turned_m + self.camera_from_board.translation;
            let projection = intrinsics.project(in_camera_m)?;
            let missing_px = corner.pixel - projection.pixel;
            let weight = huber_weight(missing_px.length(), limit_px) / (noise_px * noise_px);
            let [by_focal, by_x, by_y, by_k1, by_k2] =
                by_camera(intrinsics, in_camera_m, projection.pixel);
            let by_size = projection.step_px(rotation * corner.from_center_m.extend(0.0));
            let [of_x, of_y] = projection
                .gradients()
                .map(|gradient| by_step(turned_m, gradient));
            let row = |axis: usize, of_pose: [f64; POSE]| {
                let [rx, ry, rz, tx, ty, tz] = of_pose;
                [
                    by_focal[axis],
                    by_x[axis],
                    by_y[axis],
                    by_k1[axis],
                    by_k2[axis],
                    by_size[axis],
                    rx,
                    ry,
                    rz,
                    tx,
                    ty,
                    tz,
                ]
            };
            equations.add_weighted(&row(0, of_x), missing_px.x, weight);
            equations.add_weighted(&row(1, of_y), missing_px.y, weight);
        }
        Some(equations)
    }
}

/// A camera and the boards before it, which are moved together to where they explain the corners best.
struct JointFit<'a> {
    camera: FittedCamera,
    views: Vec<PosedView<'a>>,
    /// Standard deviation of a corner's coordinate.
    noise_px: f64,
}

impl JointFit<'_> {
    /// Standard deviation of a coordinate, from the median distance, which outliers do not move.
    fn measured_noise_px(&self) -> Option<f64> {
        let distances: Option<Vec<Vec<f64>>> = (self.views.iter())
            .map(|view| view.distances_px(&self.camera))
            .collect();
        let mut distances_px: Vec<f64> = distances?.into_iter().flatten().collect();
        distances_px.sort_by(f64::total_cmp);
        let median_px = *distances_px.get(distances_px.len() / 2)?;
        // The median of Rayleigh's distribution is σ √(2 ln 2).
        let noise_px = median_px / (2.0 * 2.0_f64.ln()).sqrt();
        Some(noise_px.max(LEAST_NOISE_PX))
    }

    /// The standard deviation of the focal length's logarithm: what the normal equations say, or, where it is more, what
    /// each view left out in turn would change (as in `calibration`: paper bends and light changes from view to view, and
    /// not from corner to corner).
    fn focal_deviation(&self) -> Option<f64> {
        let equations = self.linearized()?;
        let reduced: Option<Vec<Reduced>> = (equations.views.iter())
            .map(|view| Reduced::of(view, 0.0))
            .collect();
        let reduced = reduced?;
        let mut all = equations.prior;
        for view in &reduced {
            all.matrix = all.matrix + view.equations.matrix;
        }
        let variance = all.covariance()?.0[FOCAL][FOCAL];
        let steps: Option<Vec<f64>> = reduced
            .iter()
            .map(|view| {
                // All together are at rest: without one of them its slope is missing.
                let rest = NormalEquations {
                    matrix: all.matrix - view.equations.matrix,
                    right: view.equations.right.map(|slope| -slope),
                };
                Some(rest.solve()?[FOCAL])
            })
            .collect();
        let steps = steps?;
        let count = steps.len() as f64;
        let mean = steps.iter().sum::<f64>() / count;
        let squares: f64 = steps.iter().map(|step| (step - mean).powi(2)).sum();
        let jackknife = (count - 1.0) / count * squares;
        Some(variance.max(jackknife).sqrt().min(FOCAL_PRIOR))
    }
}

impl Problem for JointFit<'_> {
    type Linearized = JointEquations;

    /// Huber's loss over all corners, in units of the noise, and that of the priors.
    fn cost(&self) -> Option<f64> {
        let priors = self.camera.priors();
        let mut cost: f64 = priors.iter().map(|(off, _)| 0.5 * off * off).sum();
        for view in &self.views {
            for distance_px in view.distances_px(&self.camera)? {
                cost += huber_loss(distance_px / self.noise_px, HUBER);
            }
        }
        cost.is_finite().then_some(cost)
    }

    fn linearized(&self) -> Option<JointEquations> {
        let mut prior = NormalEquations::ZERO;
        for (unknown, (off, deviation)) in self.camera.priors().into_iter().enumerate() {
            prior.add_prior(unknown, -off * deviation, deviation.powi(-2));
        }
        let limit_px = HUBER * self.noise_px;
        let views: Option<Vec<NormalEquations<BOTH>>> = (self.views.iter())
            .map(|view| view.equations(&self.camera, limit_px, self.noise_px))
            .collect();
        Some(JointEquations {
            prior,
            views: views?,
        })
    }

    fn moved(&self, step: &JointStep) -> Self {
        let views = self.views.iter().zip(&step.poses);
        Self {
            camera: self.camera.moved(&step.camera),
            views: views
                .map(|(view, step)| PosedView {
                    camera_from_board: moved(&view.camera_from_board, *step),
                    ..*view
                })
                .collect(),
            noise_px: self.noise_px,
        }
    }
}

/// The equations of the camera's priors, and those of each view.
struct JointEquations {
    prior: NormalEquations<CAMERA>,
    views: Vec<NormalEquations<BOTH>>,
}

struct JointStep {
    camera: [f64; CAMERA],
    poses: Vec<[f64; POSE]>,
}

impl Linearized for JointEquations {
    type Step = JointStep;

    fn step(&self, damping: f64) -> Option<JointStep> {
        let reduced: Option<Vec<Reduced>> = (self.views.iter())
            .map(|view| Reduced::of(view, damping))
            .collect();
        let reduced = reduced?;
        let mut all = self.prior;
        for k in 0..CAMERA {
            all.matrix.0[k][k] *= 1.0 + damping;
        }
        for view in &reduced {
            all.matrix = all.matrix + view.equations.matrix;
            for k in 0..CAMERA {
                all.right[k] += view.equations.right[k];
            }
        }
        let camera = all.solve()?;
        Some(JointStep {
            camera,
            poses: reduced.iter().map(|view| view.pose_step(&camera)).collect(),
        })
    }
}

/// A view's equations with its pose eliminated.
struct Reduced {
    equations: NormalEquations<CAMERA>,
    /// The inverse of the pose's block.
    of_pose: Matrix<POSE>,
    /// The pose's rows in the camera's columns.
    cross: [[f64; CAMERA]; POSE],
    right: [f64; POSE],
}

impl Reduced {
    /// `None` where the view does not determine the pose.
    fn of(view: &NormalEquations<BOTH>, damping: f64) -> Option<Self> {
        let mut damped = view.matrix.0;
        for (k, row) in damped.iter_mut().enumerate() {
            row[k] *= 1.0 + damping;
        }
        let of_pose = Matrix::<POSE>(std::array::from_fn(|i| {
            std::array::from_fn(|j| damped[CAMERA + i][CAMERA + j])
        }))
        .inverse()?;
        let cross: [[f64; CAMERA]; POSE] =
            std::array::from_fn(|i| std::array::from_fn(|j| damped[CAMERA + i][j]));
        let right: [f64; POSE] = std::array::from_fn(|i| view.right[CAMERA + i]);
        let columns: [[f64; POSE]; CAMERA] = std::array::from_fn(|j| cross.map(|row| row[j]));
        let along_right = of_pose * right;
        let equations = NormalEquations {
            matrix: Matrix(std::array::from_fn(|i| {
                let solved = of_pose * columns[i];
                std::array::from_fn(|j| damped[i][j] - dot(&solved, &columns[j]))
            })),
            right: std::array::from_fn(|i| view.right[i] - dot(&columns[i], &along_right)),
        };
        Some(Self {
            equations,
            of_pose,
            cross,
            right,
        })
    }

    fn pose_step(&self, camera: &[f64; CAMERA]) -> [f64; POSE] {
        let left: [f64; POSE] =
            std::array::from_fn(|i| self.right[i] - dot(&self.cross[i], camera));
        self.of_pose * left
    }
}
