//! Bundle adjustment: the places of markers and cameras that explain all corners best (Triggs, McLauchlan, Hartley &
//! Fitzgibbon 2000), by Levenberg-Marquardt with Huber's loss.
//!
//! The equations of a view's pose touch the markers that it sees and no other view, so poses are eliminated first (Schur
//! complement, section 6.1 there): what is left has as many unknowns as the markers have, and those of the camera itself
//! where nobody has calibrated it.

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::geometry::camera::Intrinsics;
use crate::geometry::least_squares::{LevenbergMarquardt, Linearized, NormalEquations, Problem};
use crate::geometry::matrix::{Cholesky, DynamicMatrix, Matrix, dot};
use crate::geometry::pose::{by_step, moved};
use crate::geometry::robust::{huber_loss, huber_weight};
use crate::tracking::focal::free_camera::{
    self, CAMERA_UNKNOWNS, FOCAL, FOCAL_PRIOR, by_camera, stepped,
};

/// Corners of a marker of side 1: top left, top right, bottom right, bottom left.
pub(super) const UNIT_CORNERS: [DVec3; 4] = [
    DVec3::new(-0.5, 0.5, 0.0),
    DVec3::new(0.5, 0.5, 0.0),
    DVec3::new(0.5, -0.5, 0.0),
    DVec3::new(-0.5, -0.5, 0.0),
];

/// A marker's unknowns: a small turn about its centre in world axes, a shift, and the logarithm of its size.
pub(super) const MARKER_UNKNOWNS: usize = 7;
const POSE_UNKNOWNS: usize = 6;
/// The most unknowns of a marker, or of the camera.
const BLOCK: usize = MARKER_UNKNOWNS;
const TURN_Z: usize = 2;
const SIZE: usize = 6;

/// Corners are found no better than this; below it Huber's loss is a square, pixels.
const LEAST_NOISE_PX: f64 = 0.05;
/// Corners farther off than so many standard deviations count less.
const HUBER: f64 = 2.0;

/// A marker and where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct PlacedMarker {
    pub world_from_marker: DAffine3,
    pub size_m: f64,
}

/// A marker as a picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct MarkerObservation {
    pub marker: usize,
    /// As printed from the top left clockwise, distorted pixels.
    pub seen_px: [DVec2; 4],
    /// The same, undistorted by the camera that is known beforehand.
    pub corners_px: [DVec2; 4],
}

/// A picture and from where it was taken.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BoardView {
    pub camera_from_world: DAffine3,
    pub seen: Vec<MarkerObservation>,
}

/// What may move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MarkerFreedom {
    /// Markers lie anywhere.
    Space,
    /// Markers stay in the plane z = 0 of the world, facing up.
    Plane,
}

/// All that is to be explained, and what explains it so far.
#[derive(Debug, Clone)]
pub(super) struct Bundle {
    pub intrinsics: Intrinsics,
    /// Whether the camera is learnt too; then it has k1 and k2 at most.
    pub camera_is_free: bool,
    pub markers: Vec<PlacedMarker>,
    pub views: Vec<BoardView>,
    /// The marker that stays where and as large as it is.
    pub gauge: usize,
    pub freedom: MarkerFreedom,
    pub sizes_are_free: bool,
}

/// How sure an adjustment is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Certainty {
    /// Standard deviation of a corner's coordinate, pixels.
    pub noise_px: f64,
    /// Standard deviations of each marker's unknowns, 0 for those that are given: radians, metres, and the size as a part of
    /// itself.
    pub deviations: Vec<[f64; MARKER_UNKNOWNS]>,
    /// Standard deviation of the focal length as a part of it; 0 where the camera is given.
    pub focal_deviation: f64,
}

impl PlacedMarker {
    pub(super) fn corners_m(&self) -> [DVec3; 4] {
        UNIT_CORNERS.map(|corner| {
            self.world_from_marker
                .transform_point3(corner * self.size_m)
        })
    }
}

impl Bundle {
    /// Moves everything to where it explains the corners best; `None` when that does not settle, or a part of it is
    /// not determined.
    pub(super) fn adjust(&mut self) -> Option<Certainty> {
        const METHOD: LevenbergMarquardt = LevenbergMarquardt {
            first_damping: 1e-3,
            rounds: 100,
            least_gain: 1e-9,
        };
        let mut bundle = self.clone();
        // Outliers hide the noise at first.
        let mut noise_px = bundle.noise_px()?;
        for _ in 0..4 {
            let found = METHOD.minimize(bundle.limited(noise_px))?;
            if !found.is_settled {
                return None;
            }
            bundle = found.problem.bundle;
            let before_px = std::mem::replace(&mut noise_px, bundle.noise_px()?);
            if (before_px - noise_px).abs() < 0.01 * noise_px {
                break;
            }
        }
        let limited = bundle.limited(noise_px);
        let certainty = limited.certainty()?;
        *self = limited.bundle;
        Some(certainty)
    }

    fn limited(self, noise_px: f64) -> Limited {
        Limited {
            bundle: self,
            noise_px,
        }
    }

    /// How far a marker's corners are from where they are seen in a view, pixels; infinite behind the camera.
    pub(super) fn distances_px(&self, view: &BoardView, seen: &MarkerObservation) -> [f64; 4] {
        let corners_m = self.markers[seen.marker].corners_m();
        std::array::from_fn(|corner| {
            let in_camera_m = view.camera_from_world.transform_point3(corners_m[corner]);
            let expected_px = self.intrinsics.pixel_of(in_camera_m);
            expected_px.map_or(f64::INFINITY, |pixel| pixel.distance(seen.seen_px[corner]))
        })
    }

    /// Standard deviation of a coordinate, told from the median distance, which outliers do not move.
    fn noise_px(&self) -> Option<f64> {
        let mut distances_px: Vec<f64> = self
            .views
            .iter()
            .flat_map(|view| {
                view.seen
                    .iter()
                    .flat_map(|seen| self.distances_px(view, seen))
            })
            .collect();
        distances_px.sort_by(f64::total_cmp);
        let median_px = *distances_px.get(distances_px.len() / 2)?;
        // The median of Rayleigh's distribution is σ √(2 ln 2).
        let noise_px = median_px / (2.0 * 2.0_f64.ln()).sqrt();
        noise_px.is_finite().then_some(noise_px.max(LEAST_NOISE_PX))
    }

    /// The block of the camera's unknowns, after those of the markers.
    fn camera_block(&self) -> usize {
        self.markers.len()
    }

    /// The unknowns of a block that are free, by their index.
    fn free(&self, block: usize) -> &'static [usize] {
        const CAMERA: [usize; CAMERA_UNKNOWNS] = [0, 1, 2, 3, 4];
        const SPACE: [usize; 7] = [0, 1, 2, 3, 4, 5, SIZE];
        const PLANE: [usize; 4] = [TURN_Z, 3, 4, SIZE];
        if block == self.camera_block() && self.camera_is_free {
            return &CAMERA;
        }
        if block == self.camera_block() || block == self.gauge {
            return &[];
        }
        let all: &'static [usize] = match self.freedom {
            MarkerFreedom::Space => &SPACE,
            MarkerFreedom::Plane => &PLANE,
        };
        match self.sizes_are_free {
            true => all,
            false => &all[..all.len() - 1],
        }
    }
}

/// A bundle whose corners are found with an error; those that are much farther off count less.
struct Limited {
    bundle: Bundle,
    /// Its standard deviation.
    noise_px: f64,
}

impl Problem for Limited {
    type Linearized = Equations;

    /// Huber's loss over all corners, and that of the camera's priors, pixels²; `None` where a corner lies behind its camera.
    fn cost(&self) -> Option<f64> {
        let mut cost = 0.0;
        if self.bundle.camera_is_free {
            let priors = free_camera::priors(&self.bundle.intrinsics).into_iter();
            let squares: f64 = priors.map(|(off, _)| off * off).sum();
            cost += 0.5 * squares * self.prior_noise_px().powi(2);
        }
        for view in &self.bundle.views {
            for seen in &view.seen {
                for distance_px in self.bundle.distances_px(view, seen) {
                    cost += huber_loss(distance_px, self.limit_px());
                }
            }
        }
        cost.is_finite().then_some(cost)
    }

    fn linearized(&self) -> Option<Equations> {
        let bundle = &self.bundle;
        let mut blocks = vec![NormalEquations::ZERO; bundle.markers.len() + 1];
        let mut camera_cross = vec![[[0.0; BLOCK]; BLOCK]; bundle.markers.len()];
        if bundle.camera_is_free {
            let priors = free_camera::priors(&bundle.intrinsics).into_iter();
            for (unknown, (off, deviation)) in priors.enumerate() {
                let weight = (self.prior_noise_px() / deviation).powi(2);
                blocks[bundle.camera_block()].add_prior(unknown, -off * deviation, weight);
            }
        }
        let views: Option<Vec<ViewBlock>> = bundle
            .views
            .iter()
            .map(|view| self.view_block(view, &mut blocks, &mut camera_cross))
            .collect();
        let mut unknowns = 0;
        let free = (0..blocks.len()).map(|block| {
            let free = bundle.free(block);
            let first = unknowns;
            unknowns += free.len();
            Unknowns { first, free }
        });
        Some(Equations {
            free: free.collect(),
            blocks,
            camera_cross,
            views: views?,
            unknowns,
        })
    }

    fn moved(&self, step: &BundleStep) -> Self {
        let mut bundle = self.bundle.clone();
        if bundle.camera_is_free {
            let [ref of_camera @ .., _, _] = step.blocks[bundle.camera_block()];
            bundle.intrinsics = stepped(&bundle.intrinsics, of_camera);
        }
        for (placed, step) in bundle.markers.iter_mut().zip(&step.blocks) {
            let [rx, ry, rz, tx, ty, tz, size] = *step;
            placed.world_from_marker = moved(&placed.world_from_marker, [rx, ry, rz, tx, ty, tz]);
            placed.size_m *= size.clamp(-1.0, 1.0).exp();
        }
        for (view, step) in bundle.views.iter_mut().zip(&step.poses) {
            view.camera_from_world = moved(&view.camera_from_world, *step);
        }
        bundle.limited(self.noise_px)
    }
}

impl Limited {
    /// The distance from which on a corner counts less, pixels.
    fn limit_px(&self) -> f64 {
        HUBER * self.noise_px
    }

    /// What a corner's error is taken to be against what is usual of cameras, pixels.
    fn prior_noise_px(&self) -> f64 {
        self.noise_px.max(free_camera::LEAST_NOISE_PX)
    }

    /// The equations of a view; what they say of its markers and the camera is added to `blocks`, and of a marker and the
    /// camera together to `camera_cross`.
    fn view_block(
        &self,
        view: &BoardView,
        blocks: &mut [NormalEquations<BLOCK>],
        camera_cross: &mut [[[f64; BLOCK]; BLOCK]],
    ) -> Option<ViewBlock> {
        let bundle = &self.bundle;
        let mut pose = NormalEquations::ZERO;
        let mut ties = Vec::with_capacity(view.seen.len() + 1);
        let mut of_camera = Tie::new(bundle.camera_block());
        let mut squares_px = 0.0;
        let rotation: DMat3 = view.camera_from_world.matrix3;
        for seen in &view.seen {
            let placed = &bundle.markers[seen.marker];
            let mut of_marker = Tie::new(seen.marker);
            for (corner, corner_px) in UNIT_CORNERS.iter().zip(seen.seen_px) {
                let from_center_m = placed.world_from_marker.matrix3 * (*corner * placed.size_m);
                let turned_m = rotation * (from_center_m + placed.world_from_marker.translation);
                let in_camera_m = turned_m + view.camera_from_world.translation;
                let projection = bundle.intrinsics.project(in_camera_m)?;
                let missing_px = corner_px - projection.pixel;
                let weight = huber_weight(missing_px.length(), self.limit_px());
                let by_camera = (bundle.camera_is_free)
                    .then(|| by_camera(&bundle.intrinsics, in_camera_m, projection.pixel));
                for (axis, gradient) in projection.gradients().into_iter().enumerate() {
                    let value = missing_px[axis];
                    let row_of_pose = by_step(turned_m, gradient);
                    let in_world = rotation.transpose() * gradient;
                    let [rx, ry, rz, tx, ty, tz] = by_step(from_center_m, in_world);
                    let row_of_marker = [rx, ry, rz, tx, ty, tz, in_world.dot(from_center_m)];
                    pose.add_weighted(&row_of_pose, value, weight);
                    blocks[seen.marker].add_weighted(&row_of_marker, value, weight);
                    of_marker.add(&row_of_pose, &row_of_marker, value, weight);
                    squares_px += weight * value * value;
                    if let Some(by_camera) = by_camera {
                        let [focal, x, y, k1, k2] = by_camera.map(|step_px| step_px[axis]);
                        let row_of_camera = [focal, x, y, k1, k2, 0.0, 0.0];
                        blocks[bundle.camera_block()].add_weighted(&row_of_camera, value, weight);
                        of_camera.add(&row_of_pose, &row_of_camera, value, weight);
                        let cross = &mut camera_cross[seen.marker];
                        add_products(cross, &row_of_camera, &row_of_marker, weight);
                    }
                }
            }
            ties.push(of_marker);
        }
        if bundle.camera_is_free {
            ties.push(of_camera);
        }
        Some(ViewBlock {
            pose,
            ties,
            squares_px,
        })
    }

    fn certainty(&self) -> Option<Certainty> {
        let equations = self.linearized()?;
        let views = &self.bundle.views;
        let corners: usize = views.iter().map(|view| 4 * view.seen.len()).sum();
        let unknowns = equations.unknowns + POSE_UNKNOWNS * views.len();
        let redundancy = (2 * corners).saturating_sub(unknowns).max(1) as f64;
        let squares_px: f64 = equations.views.iter().map(|view| view.squares_px).sum();
        let variance = squares_px / redundancy;
        let cholesky = equations.reduced(0.0)?.matrix.cholesky()?;
        let variances = cholesky.inverse_diagonal();
        let markers = &equations.free[..self.bundle.markers.len()];
        let deviations = markers.iter().map(|unknowns| {
            let mut deviations = [0.0; MARKER_UNKNOWNS];
            for (at, unknown) in unknowns.places() {
                deviations[unknown] = (variance * variances[at]).sqrt();
            }
            deviations
        });
        Some(Certainty {
            noise_px: variance.sqrt(),
            deviations: deviations.collect(),
            focal_deviation: match self.bundle.camera_is_free {
                true => self.focal_deviation(&equations, &cholesky),
                false => 0.0,
            },
        })
    }

    /// The standard deviation of the focal length's logarithm: what the normal equations say, or, where it is more, what
    /// each view left out in turn would change to first order (paper bends and light changes from view to view, and not
    /// from corner to corner).
    fn focal_deviation(&self, equations: &Equations, cholesky: &Cholesky) -> f64 {
        let at = equations.free[self.bundle.camera_block()].first + FOCAL;
        let mut unit = vec![0.0; equations.unknowns];
        unit[at] = 1.0;
        // The row of the inverse: how the focal length follows each unknown's slope.
        let follows = cholesky.solve(&unit);
        let variance = self.prior_noise_px().powi(2) * follows[at];
        let squares: f64 = (equations.views.iter())
            .map(|view| {
                let slopes = view.ties.iter().flat_map(|tie| {
                    let places = equations.free[tie.block].places();
                    places.map(|(at, unknown)| follows[at] * tie.right[unknown])
                });
                slopes.sum::<f64>().powi(2)
            })
            .sum();
        let count = equations.views.len() as f64;
        let jackknife = squares * count / (count - 1.0).max(1.0);
        variance.max(jackknife).sqrt().min(FOCAL_PRIOR)
    }
}

/// The unknowns of a block that are free.
struct Unknowns {
    /// The place of the first one among those of all blocks.
    first: usize,
    /// Their indices in the block's step.
    free: &'static [usize],
}

impl Unknowns {
    /// The place among those of all blocks, and the index in the block's step, of each.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        (self.first..).zip(self.free.iter().copied())
    }
}

/// The normal equations of the Gauss-Newton step, in blocks: one for each marker, and the camera's as the last.
struct Equations {
    blocks: Vec<NormalEquations<BLOCK>>,
    /// The camera's rows in each marker's columns.
    camera_cross: Vec<[[f64; BLOCK]; BLOCK]>,
    views: Vec<ViewBlock>,
    /// The free unknowns of each block.
    free: Vec<Unknowns>,
    /// The number of free unknowns of all blocks.
    unknowns: usize,
}

/// The equations of a view's pose, and what ties it to markers and the camera.
struct ViewBlock {
    pose: NormalEquations<POSE_UNKNOWNS>,
    /// The camera's is the last.
    ties: Vec<Tie>,
    squares_px: f64,
}

/// What a view says of a block, beside the block's own matrix.
struct Tie {
    block: usize,
    /// The pose's rows in the block's columns.
    cross: [[f64; BLOCK]; POSE_UNKNOWNS],
    right: [f64; BLOCK],
}

impl Tie {
    fn new(block: usize) -> Self {
        Self {
            block,
            cross: [[0.0; BLOCK]; POSE_UNKNOWNS],
            right: [0.0; BLOCK],
        }
    }

    fn add(
        &mut self,
        row_of_pose: &[f64; POSE_UNKNOWNS],
        row: &[f64; BLOCK],
        value: f64,
        weight: f64,
    ) {
        add_products(&mut self.cross, row_of_pose, row, weight);
        for (right, entry) in self.right.iter_mut().zip(row) {
            *right += weight * entry * value;
        }
    }
}

/// Adds the weighted products of two rows to a block of a matrix.
fn add_products<const N: usize, const M: usize>(
    block: &mut [[f64; M]; N],
    rows: &[f64; N],
    columns: &[f64; M],
    weight: f64,
) {
    for (entries, a) in block.iter_mut().zip(rows) {
        for (entry, b) in entries.iter_mut().zip(columns) {
            *entry += weight * a * b;
        }
    }
}

/// The blocks' equations with the poses eliminated.
struct ReducedEquations {
    matrix: DynamicMatrix,
    right: Vec<f64>,
    /// The inverse of each pose's block.
    poses: Vec<Matrix<POSE_UNKNOWNS>>,
}

struct BundleStep {
    blocks: Vec<[f64; BLOCK]>,
    poses: Vec<[f64; POSE_UNKNOWNS]>,
}

impl Equations {
    /// `None` where a view does not determine its pose.
    fn reduced(&self, damping: f64) -> Option<ReducedEquations> {
        let mut reduced = ReducedEquations {
            matrix: DynamicMatrix::zero(self.unknowns),
            right: vec![0.0; self.unknowns],
            poses: Vec::with_capacity(self.views.len()),
        };
        for (block, unknowns) in self.blocks.iter().zip(&self.free) {
            for (i, a) in unknowns.places() {
                for (j, b) in unknowns.places() {
                    *reduced.matrix.at_mut(i, j) += block.matrix.0[a][b];
                }
                *reduced.matrix.at_mut(i, i) += damping * block.matrix.0[a][a];
                reduced.right[i] += block.right[a];
            }
        }
        let camera = &self.free[self.blocks.len() - 1];
        for (cross, unknowns) in self.camera_cross.iter().zip(&self.free) {
            for (i, a) in camera.places() {
                for (j, b) in unknowns.places() {
                    *reduced.matrix.at_mut(i, j) += cross[a][b];
                }
            }
        }
        for view in &self.views {
            let mut pose = view.pose.matrix;
            for (k, row) in pose.0.iter_mut().enumerate() {
                row[k] *= 1.0 + damping;
            }
            let inverse = pose.inverse()?;
            self.eliminate(view, &inverse, &mut reduced);
            reduced.poses.push(inverse);
        }
        Some(reduced)
    }

    /// Takes a view's pose, whose block has this inverse, out of the blocks' equations.
    fn eliminate(
        &self,
        view: &ViewBlock,
        inverse: &Matrix<POSE_UNKNOWNS>,
        reduced: &mut ReducedEquations,
    ) {
        for of_a in &view.ties {
            for (i, a) in self.free[of_a.block].places() {
                // A column of the cross block, times the pose's inverse.
                let solved = *inverse * of_a.cross.map(|row| row[a]);
                // The matrix is symmetric; its lower triangle is enough.
                for of_b in view.ties.iter().filter(|of_b| of_b.block <= of_a.block) {
                    for (j, b) in self.free[of_b.block].places() {
                        let product = dot(&solved, &of_b.cross.map(|row| row[b]));
                        *reduced.matrix.at_mut(i, j) -= product;
                    }
                }
                reduced.right[i] -= dot(&solved, &view.pose.right);
            }
        }
    }
}

impl Linearized for Equations {
    type Step = BundleStep;

    fn step(&self, damping: f64) -> Option<BundleStep> {
        let reduced = self.reduced(damping)?;
        let solution = reduced.matrix.cholesky()?.solve(&reduced.right);
        let blocks: Vec<[f64; BLOCK]> = self
            .free
            .iter()
            .map(|unknowns| {
                let mut step = [0.0; BLOCK];
                for (at, unknown) in unknowns.places() {
                    step[unknown] = solution[at];
                }
                step
            })
            .collect();
        let poses = self.views.iter().zip(&reduced.poses);
        let poses = poses.map(|(view, inverse)| {
            let mut rest = view.pose.right;
            for tie in &view.ties {
                for (rest, row) in rest.iter_mut().zip(&tie.cross) {
                    *rest -= dot(row, &blocks[tie.block]);
                }
            }
            *inverse * rest
        });
        Some(BundleStep {
            poses: poses.collect(),
            blocks,
        })
    }
}
