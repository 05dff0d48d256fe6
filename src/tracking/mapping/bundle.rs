//! Bundle adjustment: the places of markers and cameras that explain all corners best (Triggs, McLauchlan, Hartley &
//! Fitzgibbon 2000), by Levenberg-Marquardt with Huber's loss.
//!
//! A camera's equations touch the markers that it sees and no other camera, so cameras are eliminated first (Schur
//! complement, section 6.1 there): what is left has as many unknowns as the markers have.

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::geometry::camera::Intrinsics;
use crate::geometry::least_squares::{LevenbergMarquardt, Linearized, NormalEquations, Problem};
use crate::geometry::matrix::{DynamicMatrix, Matrix, dot};
use crate::geometry::pose::{by_step, moved};
use crate::geometry::robust::{huber_loss, huber_weight};

/// Corners of a marker of side 1: top left, top right, bottom right, bottom left.
pub(super) const UNIT_CORNERS: [DVec3; 4] = [
    DVec3::new(-0.5, 0.5, 0.0),
    DVec3::new(0.5, 0.5, 0.0),
    DVec3::new(0.5, -0.5, 0.0),
    DVec3::new(-0.5, -0.5, 0.0),
];

/// A marker's unknowns: a small turn about its centre in world axes, a shift, and the logarithm of its size.
pub(super) const MARKER_UNKNOWNS: usize = 7;
const CAMERA_UNKNOWNS: usize = 6;
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
    /// As printed from the top left clockwise, undistorted pixels.
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
            let found = METHOD.minimize(bundle.limited(HUBER * noise_px))?;
            if !found.is_settled {
                return None;
            }
            bundle = found.problem.bundle;
            let before_px = std::mem::replace(&mut noise_px, bundle.noise_px()?);
            if (before_px - noise_px).abs() < 0.01 * noise_px {
                break;
            }
        }
        let limited = bundle.limited(HUBER * noise_px);
        let certainty = limited.certainty()?;
        *self = limited.bundle;
        Some(certainty)
    }

    fn limited(self, limit_px: f64) -> Limited {
        Limited {
            bundle: self,
            limit_px,
        }
    }

    /// How far a marker's corners are from where they are seen in a view, pixels; infinite behind the camera.
    pub(super) fn distances_px(&self, view: &BoardView, seen: &MarkerObservation) -> [f64; 4] {
        let corners_m = self.markers[seen.marker].corners_m();
        std::array::from_fn(|corner| {
            let in_camera_m = view.camera_from_world.transform_point3(corners_m[corner]);
            let expected_px = self.intrinsics.undistorted_pixel_of(in_camera_m);
            expected_px.map_or(f64::INFINITY, |pixel| {
                pixel.distance(seen.corners_px[corner])
            })
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

    /// The unknowns of a marker that are free, by their index.
    fn free(&self, marker: usize) -> &'static [usize] {
        const SPACE: [usize; 7] = [0, 1, 2, 3, 4, 5, SIZE];
        const PLANE: [usize; 4] = [TURN_Z, 3, 4, SIZE];
        if marker == self.gauge {
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

/// A bundle whose corners beyond a distance count less.
struct Limited {
    bundle: Bundle,
    limit_px: f64,
}

impl Problem for Limited {
    type Linearized = Equations;

    /// Huber's loss over all corners; `None` where one lies behind its camera.
    fn cost(&self) -> Option<f64> {
        let mut cost = 0.0;
        for view in &self.bundle.views {
            for seen in &view.seen {
                for distance_px in self.bundle.distances_px(view, seen) {
                    cost += huber_loss(distance_px, self.limit_px);
                }
            }
        }
        cost.is_finite().then_some(cost)
    }

    fn linearized(&self) -> Option<Equations> {
        let bundle = &self.bundle;
        let mut markers = vec![NormalEquations::ZERO; bundle.markers.len()];
        let views: Option<Vec<ViewBlock>> = bundle
            .views
            .iter()
            .map(|view| self.view_block(view, &mut markers))
            .collect();
        let mut unknowns = 0;
        let free = (0..markers.len()).map(|marker| {
            let free = bundle.free(marker);
            let first = unknowns;
            unknowns += free.len();
            Unknowns { first, free }
        });
        Some(Equations {
            free: free.collect(),
            markers,
            views: views?,
            unknowns,
        })
    }

    fn moved(&self, step: &BundleStep) -> Self {
        let mut bundle = self.bundle.clone();
        for (placed, step) in bundle.markers.iter_mut().zip(&step.markers) {
            let [rx, ry, rz, tx, ty, tz, size] = *step;
            placed.world_from_marker = moved(&placed.world_from_marker, [rx, ry, rz, tx, ty, tz]);
            placed.size_m *= size.clamp(-1.0, 1.0).exp();
        }
        for (view, step) in bundle.views.iter_mut().zip(&step.cameras) {
            view.camera_from_world = moved(&view.camera_from_world, *step);
        }
        bundle.limited(self.limit_px)
    }
}

impl Limited {
    /// The equations of a view; what they say of its markers alone is added to `markers`.
    fn view_block(
        &self,
        view: &BoardView,
        markers: &mut [NormalEquations<MARKER_UNKNOWNS>],
    ) -> Option<ViewBlock> {
        let mut block = ViewBlock {
            camera: NormalEquations::ZERO,
            cross: Vec::with_capacity(view.seen.len()),
            squares_px: 0.0,
        };
        let rotation: DMat3 = view.camera_from_world.matrix3;
        for seen in &view.seen {
            let placed = &self.bundle.markers[seen.marker];
            let mut cross = [[0.0; MARKER_UNKNOWNS]; CAMERA_UNKNOWNS];
            for (corner, corner_px) in UNIT_CORNERS.iter().zip(seen.corners_px) {
                let from_center_m = placed.world_from_marker.matrix3 * (*corner * placed.size_m);
                let turned_m = rotation * (from_center_m + placed.world_from_marker.translation);
                let in_camera_m = turned_m + view.camera_from_world.translation;
                let projection = self.bundle.intrinsics.project_undistorted(in_camera_m)?;
                let missing_px = corner_px - projection.pixel;
                let weight = huber_weight(missing_px.length(), self.limit_px);
                let gradients = projection.gradients();
                for (gradient, value) in gradients.into_iter().zip(missing_px.to_array()) {
                    let of_camera = by_step(turned_m, gradient);
                    let in_world = rotation.transpose() * gradient;
                    let [rx, ry, rz, tx, ty, tz] = by_step(from_center_m, in_world);
                    let of_marker = [rx, ry, rz, tx, ty, tz, in_world.dot(from_center_m)];
                    block.camera.add_weighted(&of_camera, value, weight);
                    markers[seen.marker].add_weighted(&of_marker, value, weight);
                    for (cross, a) in cross.iter_mut().zip(of_camera) {
                        for (cross, b) in cross.iter_mut().zip(of_marker) {
                            *cross += weight * a * b;
                        }
                    }
                    block.squares_px += weight * value * value;
                }
            }
            block.cross.push((seen.marker, cross));
        }
        Some(block)
    }

    fn certainty(&self) -> Option<Certainty> {
        let equations = self.linearized()?;
        let views = &self.bundle.views;
        let corners: usize = views.iter().map(|view| 4 * view.seen.len()).sum();
        let unknowns = equations.unknowns + CAMERA_UNKNOWNS * views.len();
        let redundancy = (2 * corners).saturating_sub(unknowns).max(1) as f64;
        let squares_px: f64 = equations.views.iter().map(|view| view.squares_px).sum();
        let variance = squares_px / redundancy;
        let variances = equations
            .reduced(0.0)?
            .matrix
            .cholesky()?
            .inverse_diagonal();
        let deviations = equations.free.iter().map(|unknowns| {
            let mut deviations = [0.0; MARKER_UNKNOWNS];
            for (at, unknown) in unknowns.places() {
                deviations[unknown] = (variance * variances[at]).sqrt();
            }
            deviations
        });
        Some(Certainty {
            noise_px: variance.sqrt(),
            deviations: deviations.collect(),
        })
    }
}

/// The unknowns of a marker that are free.
struct Unknowns {
    /// The place of the first one among those of all markers.
    first: usize,
    /// Their indices in the marker's step.
    free: &'static [usize],
}

impl Unknowns {
    /// The place among those of all markers, and the index in the marker's step, of each.
    fn places(&self) -> impl Iterator<Item = (usize, usize)> {
        (self.first..).zip(self.free.iter().copied())
    }
}

/// The normal equations of the Gauss-Newton step, in blocks.
struct Equations {
    markers: Vec<NormalEquations<MARKER_UNKNOWNS>>,
    views: Vec<ViewBlock>,
    /// The free unknowns of each marker.
    free: Vec<Unknowns>,
    /// The number of free unknowns of all markers.
    unknowns: usize,
}

/// The equations of a view's camera, and those that tie it to each marker in the view.
struct ViewBlock {
    camera: NormalEquations<CAMERA_UNKNOWNS>,
    cross: Vec<(usize, [[f64; MARKER_UNKNOWNS]; CAMERA_UNKNOWNS])>,
    squares_px: f64,
}

/// The markers' equations with the cameras eliminated.
struct ReducedEquations {
    matrix: DynamicMatrix,
    right: Vec<f64>,
    /// The inverse of each camera's block.
    cameras: Vec<Matrix<CAMERA_UNKNOWNS>>,
}

struct BundleStep {
    markers: Vec<[f64; MARKER_UNKNOWNS]>,
    cameras: Vec<[f64; CAMERA_UNKNOWNS]>,
}

impl Equations {
    /// `None` where a view does not determine its camera.
    fn reduced(&self, damping: f64) -> Option<ReducedEquations> {
        let mut reduced = ReducedEquations {
            matrix: DynamicMatrix::zero(self.unknowns),
            right: vec![0.0; self.unknowns],
            cameras: Vec::with_capacity(self.views.len()),
        };
        for (block, unknowns) in self.markers.iter().zip(&self.free) {
            for (i, a) in unknowns.places() {
                for (j, b) in unknowns.places() {
                    *reduced.matrix.at_mut(i, j) += block.matrix.0[a][b];
                }
                *reduced.matrix.at_mut(i, i) += damping * block.matrix.0[a][a];
                reduced.right[i] += block.right[a];
            }
        }
        for view in &self.views {
            let mut camera = view.camera.matrix;
            for (k, row) in camera.0.iter_mut().enumerate() {
                row[k] *= 1.0 + damping;
            }
            let inverse = camera.inverse()?;
            self.eliminate(view, &inverse, &mut reduced);
            reduced.cameras.push(inverse);
        }
        Some(reduced)
    }

    /// Takes a view's camera, whose block has this inverse, out of the markers' equations.
    fn eliminate(
        &self,
        view: &ViewBlock,
        inverse: &Matrix<CAMERA_UNKNOWNS>,
        reduced: &mut ReducedEquations,
    ) {
        for (marker_a, cross_a) in &view.cross {
            for (i, a) in self.free[*marker_a].places() {
                // A column of the cross block, times the camera's inverse.
                let solved = *inverse * cross_a.map(|row| row[a]);
                // The matrix is symmetric; its lower triangle is enough.
                for (marker_b, cross_b) in view.cross.iter().filter(|(b, _)| b <= marker_a) {
                    for (j, b) in self.free[*marker_b].places() {
                        let product = dot(&solved, &cross_b.map(|row| row[b]));
                        *reduced.matrix.at_mut(i, j) -= product;
                    }
                }
                reduced.right[i] -= dot(&solved, &view.camera.right);
            }
        }
    }
}

impl Linearized for Equations {
    type Step = BundleStep;

    fn step(&self, damping: f64) -> Option<BundleStep> {
        let reduced = self.reduced(damping)?;
        let solution = reduced.matrix.cholesky()?.solve(&reduced.right);
        let markers: Vec<[f64; MARKER_UNKNOWNS]> = self
            .free
            .iter()
            .map(|unknowns| {
                let mut step = [0.0; MARKER_UNKNOWNS];
                for (at, unknown) in unknowns.places() {
                    step[unknown] = solution[at];
                }
                step
            })
            .collect();
        let cameras = self.views.iter().zip(&reduced.cameras);
        let cameras = cameras.map(|(view, inverse)| {
            let mut rest = view.camera.right;
            for (marker, cross) in &view.cross {
                for (rest, row) in rest.iter_mut().zip(cross) {
                    *rest -= dot(row, &markers[*marker]);
                }
            }
            *inverse * rest
        });
        Some(BundleStep {
            cameras: cameras.collect(),
            markers,
        })
    }
}
