//! Bundle adjustment: the places of markers and cameras that explain all corners best (Triggs, McLauchlan, Hartley &
//! Fitzgibbon 2000), by Levenberg-Marquardt with Huber's loss.
//!
//! A camera's equations touch the markers that it sees and no other camera, so cameras are eliminated first (Schur
//! complement, section 6.1 there): what is left has as many unknowns as the markers have.

use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};

use super::super::least_squares::inverse;
use crate::geometry::camera::Intrinsics;
use crate::geometry::dense::Square;

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
pub(super) struct Placed {
    pub world_from_marker: DAffine3,
    pub size_m: f64,
}

/// A marker as a picture shows it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Seen {
    pub marker: usize,
    /// As printed from the top left clockwise, undistorted pixels.
    pub corners_px: [DVec2; 4],
}

/// A picture and from where it was taken.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct View {
    pub camera_from_world: DAffine3,
    pub seen: Vec<Seen>,
}

/// What may move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Freedom {
    /// Markers lie anywhere.
    Space,
    /// Markers stay in the plane z = 0 of the world, facing up.
    Plane,
}

/// All that is to be explained, and what explains it so far.
#[derive(Debug, Clone)]
pub(super) struct Bundle {
    pub intrinsics: Intrinsics,
    pub markers: Vec<Placed>,
    pub views: Vec<View>,
    /// The marker that stays where and as large as it is.
    pub gauge: usize,
    pub freedom: Freedom,
    pub sizes_are_free: bool,
}

/// How sure an adjustment is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Certainty {
    /// Standard deviation of a corner's coordinate, pixels.
    pub noise_px: f64,
    /// Of each marker's unknowns, 0 for those that are given: radians, metres, and the size as a part of itself.
    pub deviations: Vec<[f64; MARKER_UNKNOWNS]>,
}

impl Placed {
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
        // Outliers hide the noise at first.
        let mut noise_px = self.noise_px()?;
        for _ in 0..4 {
            self.minimise(HUBER * noise_px)?;
            let before_px = std::mem::replace(&mut noise_px, self.noise_px()?);
            if (before_px - noise_px).abs() < 0.01 * noise_px {
                break;
            }
        }
        self.certainty(HUBER * noise_px)
    }

    /// How far a marker's corners are from where they are seen in a view, pixels; infinite behind the camera.
    pub(super) fn distances_px(&self, view: &View, seen: &Seen) -> [f64; 4] {
        let corners_m = self.markers[seen.marker].corners_m();
        std::array::from_fn(|corner| {
            let found = project(&self.intrinsics, &view.camera_from_world, corners_m[corner]);
            found.map_or(f64::INFINITY, |found| {
                found.distance(seen.corners_px[corner])
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

    /// Levenberg-Marquardt with corners beyond `limit_px` counting less.
    fn minimise(&mut self, limit_px: f64) -> Option<()> {
        const ROUNDS: usize = 100;
        const ENOUGH: f64 = 1e-9;
        let mut cost = self.cost(limit_px)?;
        let mut damping = 1e-3;
        let mut equations = self.equations(limit_px);
        for _ in 0..ROUNDS {
            let Some(step) = self.step(&equations, damping) else {
                damping *= 10.0;
                if damping > 1e12 {
                    return None;
                }
                continue;
            };
            let candidate = self.moved(&step);
            match candidate.cost(limit_px) {
                Some(lower) if lower < cost => {
                    let settled = cost - lower < ENOUGH * cost;
                    *self = candidate;
                    cost = lower;
                    if settled {
                        return Some(());
                    }
                    damping = (damping / 10.0).max(1e-12);
                    equations = self.equations(limit_px);
                }
                // Rounding alone decides.
                _ if damping > 1e9 => return Some(()),
                _ => damping *= 10.0,
            }
        }
        None
    }

    /// Huber's loss over all corners; `None` where one lies behind its camera.
    fn cost(&self, limit_px: f64) -> Option<f64> {
        let mut cost = 0.0;
        for view in &self.views {
            for seen in &view.seen {
                for distance_px in self.distances_px(view, seen) {
                    cost += if distance_px <= limit_px {
                        0.5 * distance_px * distance_px
                    } else {
                        limit_px * (distance_px - 0.5 * limit_px)
                    };
                }
            }
        }
        cost.is_finite().then_some(cost)
    }

    /// The unknowns of a marker that are free, by their index.
    fn free(&self, marker: usize) -> &'static [usize] {
        const SPACE: [usize; 7] = [0, 1, 2, 3, 4, 5, SIZE];
        const PLANE: [usize; 4] = [TURN_Z, 3, 4, SIZE];
        if marker == self.gauge {
            return &[];
        }
        let all: &'static [usize] = match self.freedom {
            Freedom::Space => &SPACE,
            Freedom::Plane => &PLANE,
        };
        match self.sizes_are_free {
            true => all,
            false => &all[..all.len() - 1],
        }
    }

    fn equations(&self, limit_px: f64) -> Equations {
        let mut markers = vec![MarkerBlock::default(); self.markers.len()];
        let views = self
            .views
            .iter()
            .map(|view| self.view_block(view, &mut markers, limit_px))
            .collect();
        let mut first = Vec::with_capacity(markers.len());
        let mut unknowns = 0;
        for marker in 0..markers.len() {
            first.push(unknowns);
            unknowns += self.free(marker).len();
        }
        Equations {
            markers,
            views,
            first,
            unknowns,
        }
    }

    fn view_block(&self, view: &View, markers: &mut [MarkerBlock], limit_px: f64) -> ViewBlock {
        let mut block = ViewBlock::default();
        let rotation: DMat3 = view.camera_from_world.matrix3;
        for seen in &view.seen {
            let placed = &self.markers[seen.marker];
            let mut cross = [[0.0; MARKER_UNKNOWNS]; CAMERA_UNKNOWNS];
            let own = &mut markers[seen.marker];
            for (corner, corner_px) in UNIT_CORNERS.iter().zip(seen.corners_px) {
                let from_center_m = placed.world_from_marker.matrix3 * (*corner * placed.size_m);
                let turned_m = rotation * (from_center_m + placed.world_from_marker.translation);
                let in_camera_m = turned_m + view.camera_from_world.translation;
                let image = in_camera_m.truncate() / in_camera_m.z;
                let missing_px = corner_px - self.intrinsics.pixel_from_plane(image);
                let weight = (limit_px / missing_px.length()).min(1.0);
                let gradients = [
                    DVec3::new(1.0, 0.0, -image.x) * (self.intrinsics.focal_px.x / in_camera_m.z),
                    DVec3::new(0.0, 1.0, -image.y) * (self.intrinsics.focal_px.y / in_camera_m.z),
                ];
                for (gradient, value) in gradients.into_iter().zip(missing_px.to_array()) {
                    // gradient · (turn × place) = turn · (place × gradient)
                    let by_turn = turned_m.cross(gradient);
                    let of_camera = [
                        by_turn.x, by_turn.y, by_turn.z, gradient.x, gradient.y, gradient.z,
                    ];
                    let in_world = rotation.transpose() * gradient;
                    let by_turn = from_center_m.cross(in_world);
                    let of_marker = [
                        by_turn.x,
                        by_turn.y,
                        by_turn.z,
                        in_world.x,
                        in_world.y,
                        in_world.z,
                        in_world.dot(from_center_m),
                    ];
                    for (i, a) in of_camera.iter().enumerate() {
                        for (j, b) in of_camera.iter().enumerate() {
                            block.camera[i][j] += weight * a * b;
                        }
                        for (j, b) in of_marker.iter().enumerate() {
                            cross[i][j] += weight * a * b;
                        }
                        block.right[i] += weight * a * value;
                    }
                    for (i, a) in of_marker.iter().enumerate() {
                        for (j, b) in of_marker.iter().enumerate() {
                            own.normal[i][j] += weight * a * b;
                        }
                        own.right[i] += weight * a * value;
                    }
                    block.squares_px += weight * value * value;
                }
            }
            block.cross.push((seen.marker, cross));
        }
        block
    }

    /// The markers' equations with the cameras eliminated; `None` where a view does not determine its camera.
    fn reduced(
        &self,
        equations: &Equations,
        damping: f64,
    ) -> Option<(Square, Vec<f64>, Vec<Eliminated>)> {
        let mut matrix = Square::zero(equations.unknowns);
        let mut right = vec![0.0; equations.unknowns];
        for (marker, block) in equations.markers.iter().enumerate() {
            let (first, free) = (equations.first[marker], self.free(marker));
            for (i, &a) in free.iter().enumerate() {
                for (j, &b) in free.iter().enumerate() {
                    *matrix.at_mut(first + i, first + j) += block.normal[a][b];
                }
                *matrix.at_mut(first + i, first + i) += damping * block.normal[a][a];
                right[first + i] += block.right[a];
            }
        }
        let mut eliminated = Vec::with_capacity(equations.views.len());
        for view in &equations.views {
            let mut camera = view.camera;
            for (k, row) in camera.iter_mut().enumerate() {
                row[k] *= 1.0 + damping;
            }
            let inverse = inverse(&camera)?;
            for (marker_a, cross_a) in &view.cross {
                let (first_a, free_a) = (equations.first[*marker_a], self.free(*marker_a));
                for (i, &a) in free_a.iter().enumerate() {
                    // A column of the cross block, times the camera's inverse.
                    let solved: [f64; CAMERA_UNKNOWNS] = std::array::from_fn(|row| {
                        (0..CAMERA_UNKNOWNS)
                            .map(|k| inverse[row][k] * cross_a[k][a])
                            .sum()
                    });
                    // The matrix is symmetric; its lower triangle is enough.
                    for (marker_b, cross_b) in view.cross.iter().filter(|(b, _)| b <= marker_a) {
                        let (first_b, free_b) = (equations.first[*marker_b], self.free(*marker_b));
                        for (j, &b) in free_b.iter().enumerate() {
                            let product: f64 = (0..CAMERA_UNKNOWNS)
                                .map(|k| solved[k] * cross_b[k][b])
                                .sum();
                            *matrix.at_mut(first_a + i, first_b + j) -= product;
                        }
                    }
                    let product: f64 = (0..CAMERA_UNKNOWNS)
                        .map(|k| solved[k] * view.right[k])
                        .sum();
                    right[first_a + i] -= product;
                }
            }
            eliminated.push(inverse);
        }
        Some((matrix, right, eliminated))
    }

    fn step(&self, equations: &Equations, damping: f64) -> Option<Step> {
        let (matrix, right, eliminated) = self.reduced(equations, damping)?;
        let solution = matrix.cholesky()?.solve(&right);
        let markers: Vec<[f64; MARKER_UNKNOWNS]> = (0..self.markers.len())
            .map(|marker| {
                let mut step = [0.0; MARKER_UNKNOWNS];
                for (i, &unknown) in self.free(marker).iter().enumerate() {
                    step[unknown] = solution[equations.first[marker] + i];
                }
                step
            })
            .collect();
        let cameras = equations
            .views
            .iter()
            .zip(&eliminated)
            .map(|(view, inverse)| {
                let mut rest = view.right;
                for (marker, cross) in &view.cross {
                    for (rest, row) in rest.iter_mut().zip(cross) {
                        *rest -= row
                            .iter()
                            .zip(&markers[*marker])
                            .map(|(a, b)| a * b)
                            .sum::<f64>();
                    }
                }
                std::array::from_fn(|row| {
                    (0..CAMERA_UNKNOWNS)
                        .map(|k| inverse[row][k] * rest[k])
                        .sum()
                })
            })
            .collect();
        Some(Step { markers, cameras })
    }

    fn moved(&self, step: &Step) -> Self {
        let mut moved = self.clone();
        for (placed, step) in moved.markers.iter_mut().zip(&step.markers) {
            let [rx, ry, rz, tx, ty, tz, size] = *step;
            let pose = &placed.world_from_marker;
            placed.world_from_marker = DAffine3::from_rotation_translation(
                turned(pose, DVec3::new(rx, ry, rz)),
                pose.translation + DVec3::new(tx, ty, tz),
            );
            placed.size_m *= size.clamp(-1.0, 1.0).exp();
        }
        for (view, step) in moved.views.iter_mut().zip(&step.cameras) {
            let [rx, ry, rz, tx, ty, tz] = *step;
            let pose = &view.camera_from_world;
            view.camera_from_world = DAffine3::from_rotation_translation(
                turned(pose, DVec3::new(rx, ry, rz)),
                pose.translation + DVec3::new(tx, ty, tz),
            );
        }
        moved
    }

    fn certainty(&self, limit_px: f64) -> Option<Certainty> {
        let equations = self.equations(limit_px);
        let corners: usize = self.views.iter().map(|view| 4 * view.seen.len()).sum();
        let unknowns = equations.unknowns + CAMERA_UNKNOWNS * self.views.len();
        let redundancy = (2 * corners).saturating_sub(unknowns).max(1) as f64;
        let squares_px: f64 = equations.views.iter().map(|view| view.squares_px).sum();
        let variance = squares_px / redundancy;
        let (matrix, ..) = self.reduced(&equations, 0.0)?;
        let variances = matrix.cholesky()?.inverse_diagonal();
        let deviations = (0..self.markers.len()).map(|marker| {
            let mut deviations = [0.0; MARKER_UNKNOWNS];
            for (i, &unknown) in self.free(marker).iter().enumerate() {
                deviations[unknown] = (variance * variances[equations.first[marker] + i]).sqrt();
            }
            deviations
        });
        Some(Certainty {
            noise_px: variance.sqrt(),
            deviations: deviations.collect(),
        })
    }
}

/// Normal equations of the Gauss-Newton step, in blocks.
struct Equations {
    markers: Vec<MarkerBlock>,
    views: Vec<ViewBlock>,
    /// Where each marker's free unknowns begin.
    first: Vec<usize>,
    /// Free unknowns of all markers.
    unknowns: usize,
}

#[derive(Clone, Default)]
struct MarkerBlock {
    normal: [[f64; MARKER_UNKNOWNS]; MARKER_UNKNOWNS],
    right: [f64; MARKER_UNKNOWNS],
}

#[derive(Default)]
struct ViewBlock {
    camera: [[f64; CAMERA_UNKNOWNS]; CAMERA_UNKNOWNS],
    right: [f64; CAMERA_UNKNOWNS],
    cross: Vec<(usize, [[f64; MARKER_UNKNOWNS]; CAMERA_UNKNOWNS])>,
    squares_px: f64,
}

/// The inverse of a camera's block.
type Eliminated = [[f64; CAMERA_UNKNOWNS]; CAMERA_UNKNOWNS];

struct Step {
    markers: Vec<[f64; MARKER_UNKNOWNS]>,
    cameras: Vec<[f64; CAMERA_UNKNOWNS]>,
}

/// The rotation of a pose after a small turn in the axes that it maps to.
pub(super) fn turned(pose: &DAffine3, turn: DVec3) -> DQuat {
    (DQuat::from_scaled_axis(turn) * DQuat::from_mat3(&pose.matrix3)).normalize()
}

/// The undistorted pixel of a point; `None` behind the camera.
pub(super) fn project(
    intrinsics: &Intrinsics,
    camera_from_world: &DAffine3,
    point_m: DVec3,
) -> Option<DVec2> {
    let in_camera_m = camera_from_world.transform_point3(point_m);
    (in_camera_m.z > 0.0)
        .then(|| intrinsics.pixel_from_plane(in_camera_m.truncate() / in_camera_m.z))
}
