//! The flipped pose of a plane: the other one of its two.
//!
//! A plane seen from afar, or a small one, has two poses that put its points in nearly the same places (Collins and
//! Bartoli, IJCV 2014). The edges of the markers say by how much the picture prefers one of them. Markers in two planes have
//! one pose, unless hardly anything of one of them is seen.

use glam::DAffine3;

use super::marker_template::MarkerTemplate;
use super::pixel_pose::{MeasuredEdge, PixelPose, pixel_of, project};
use super::pose_starts::{CornerObservation, starts};
use crate::geometry::camera::Intrinsics;
use crate::geometry::least_squares::{NormalEquations, Problem, gauss_newton};
use crate::geometry::pose::{PoseStep, moved, rotation_between};

/// Poses nearer to each other are one, radians.
const SAME: f64 = 0.01;

/// Smaller steps, radians and metres, change nothing that counts.
const SETTLED: f64 = 1e-7;

/// The flipped pose, and how much less likely it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FlippedPose {
    pub(super) camera_from_anchor: DAffine3,
    /// Logarithm of the odds for the pose that is not the flipped one.
    pub(super) odds: f64,
    /// Root mean square distance of the edges from where the flipped pose puts them, pixels.
    pub(super) rms_px: f64,
}

/// The flipped pose that explains the edges that `pose` rests on, refined on them. `None` where there is none.
pub(super) fn flipped_pose_of(
    pose: &PixelPose,
    intrinsics: &Intrinsics,
    templates: &[MarkerTemplate],
) -> Option<FlippedPose> {
    let here = &pose.camera_from_anchor;
    let seen = templates.iter().zip(&pose.seen).filter(|(_, seen)| **seen);
    let seen: Vec<&MarkerTemplate> = seen.map(|(template, _)| template).collect();
    let corners_m = seen.iter().flat_map(|template| template.corners_m());
    let observations: Option<Vec<CornerObservation>> = corners_m
        .map(|point_m| {
            let pixel = intrinsics.undistorted_pixel_of(here.transform_point3(point_m))?;
            Some(CornerObservation { point_m, pixel })
        })
        .collect();
    let mut starts = starts(intrinsics, &observations?);
    starts.retain(|start| rotation_between(start, here) >= SAME);
    // The farthest first.
    starts.sort_by(|a, b| rotation_between(b, here).total_cmp(&rotation_between(a, here)));
    let first = *starts.first()?;
    // All are held against the same edges where they explain them best.
    let here = refined(pose, intrinsics, &seen, *here)?;
    let others = starts.into_iter().filter_map(|start| {
        let other = refined(pose, intrinsics, &seen, start)?;
        (rotation_between(&other, &here) >= SAME).then_some(other)
    });
    let edges = &pose.edges;
    let with_error = |other: DAffine3| {
        let there = distances(edges, intrinsics, &other)?;
        Some((other, error(edges, &there), there))
    };
    let best = others
        .filter_map(with_error)
        .min_by(|a, b| a.1.total_cmp(&b.1));
    // Where the error has one minimum, the other pose is no worse than the edges say of it.
    let (other, other_error, there) = best.or_else(|| with_error(first))?;
    let here = distances(edges, intrinsics, &here)?;
    Some(FlippedPose {
        camera_from_anchor: other,
        odds: 0.5 * (other_error - error(edges, &here)) / pose.excess,
        rms_px: (there.iter().map(|px| px * px).sum::<f64>() / there.len() as f64).sqrt(),
    })
}

/// The pose near `start` that fits the edges best, each with the weight that it has.
fn refined(
    pose: &PixelPose,
    intrinsics: &Intrinsics,
    seen: &[&MarkerTemplate],
    start: DAffine3,
) -> Option<DAffine3> {
    const ROUNDS: usize = 8;
    let start = FitToEdges {
        edges: &pose.edges,
        intrinsics,
        place: start,
    };
    let FitToEdges { place, .. } = gauss_newton(start, ROUNDS)?;
    let faces = seen.iter().all(|template| template.facing(&place) > 0.0);
    (place.is_finite() && faces).then_some(place)
}

/// A pose that is moved to where edges fit it.
struct FitToEdges<'a> {
    edges: &'a [MeasuredEdge],
    intrinsics: &'a Intrinsics,
    place: DAffine3,
}

impl Problem for FitToEdges<'_> {
    type Linearized = NormalEquations<6>;

    fn cost(&self) -> Option<f64> {
        let distances_px = distances(self.edges, self.intrinsics, &self.place)?;
        Some(error(self.edges, &distances_px))
    }

    fn linearized(&self) -> Option<NormalEquations<6>> {
        let mut equations = NormalEquations::ZERO;
        for edge in self.edges {
            let point = project(self.intrinsics, &self.place, edge.point_m)?;
            let distance_px = edge.normal.dot(edge.seen_px - point.projection.pixel);
            equations.add_weighted(
                &point.by_step(edge.normal),
                distance_px,
                edge.weight / edge.variance,
            );
        }
        Some(equations)
    }

    fn moved(&self, step: &PoseStep) -> Self {
        Self {
            place: moved(&self.place, *step),
            ..*self
        }
    }

    fn is_negligible(&self, step: &PoseStep) -> bool {
        step.iter().all(|entry| entry.abs() < SETTLED)
    }
}

/// The weighted squares of the edges' distances, beside their variances.
fn error(edges: &[MeasuredEdge], distances_px: &[f64]) -> f64 {
    let edges = edges.iter().zip(distances_px);
    edges
        .map(|(edge, px)| edge.weight * px * px / edge.variance)
        .sum()
}

/// How far each edge lies from where a pose puts it, pixels.
fn distances(
    edges: &[MeasuredEdge],
    intrinsics: &Intrinsics,
    place: &DAffine3,
) -> Option<Vec<f64>> {
    let distance_px = |edge: &MeasuredEdge| {
        let place_px = pixel_of(intrinsics, place, edge.point_m)?;
        Some(edge.normal.dot(edge.seen_px - place_px))
    };
    edges.iter().map(distance_px).collect()
}
