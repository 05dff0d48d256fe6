//! The other pose of a plane.
//!
//! A plane seen from afar, or a small one, has two poses that put its points in nearly the same places (Collins and
//! Bartoli, IJCV 2014). The edges of the print say by how much the picture prefers one of them.

use glam::DAffine3;

use super::least_squares::{accumulate, solve_positive_definite};
use super::pixel_pose::{Edge, PixelPose, moved, project};
use super::pose::{Sighting, ippe_starts, pixel_of, rotation_between};
use super::print::Print;
use crate::geometry::camera::Intrinsics;

/// Poses nearer to each other are one, radians.
const SAME: f64 = 0.01;

/// Smaller steps, radians and metres, change nothing that counts.
const SETTLED: f64 = 1e-7;

/// The other pose, and how much less likely it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Twin {
    pub(super) camera_from_anchor: DAffine3,
    /// Logarithm of the odds for the pose that is not the twin.
    pub(super) odds: f64,
    /// Root mean square distance of the edges from where the twin puts them, pixels.
    pub(super) rms_px: f64,
}

/// The other pose that explains the edges that `pose` rests on, refined on them. `None` where there is no other.
pub(super) fn twin_of(pose: &PixelPose, intrinsics: &Intrinsics, prints: &[Print]) -> Option<Twin> {
    let here = &pose.camera_from_anchor;
    let seen = prints.iter().zip(&pose.seen).filter(|(_, seen)| **seen);
    let sightings: Vec<Sighting> = seen
        .flat_map(|(print, _)| print.corners_m())
        .map(|point_m| Sighting {
            point_m,
            pixel: pixel_of(intrinsics, here, point_m),
        })
        .collect();
    let start = ippe_starts(intrinsics, &sightings)?
        .into_iter()
        .max_by(|a, b| rotation_between(a, here).total_cmp(&rotation_between(b, here)))?;
    if rotation_between(&start, here) < SAME {
        return None;
    }
    // Both are held against the same edges where they explain them best.
    let here = refined(pose, intrinsics, *here)?;
    let is_other = |other: &DAffine3| rotation_between(other, &here) >= SAME;
    // Where the error has one minimum, the other pose is no worse than the edges say of it.
    let other = refined(pose, intrinsics, start)
        .filter(is_other)
        .unwrap_or(start);
    let here = distances(pose, intrinsics, &here)?;
    let there = distances(pose, intrinsics, &other)?;
    let error = |distances_px: &[f64]| -> f64 {
        let edges = pose.edges.iter().zip(distances_px);
        edges
            .map(|(edge, px)| edge.weight * px * px / edge.variance)
            .sum()
    };
    Some(Twin {
        camera_from_anchor: other,
        odds: 0.5 * (error(&there) - error(&here)) / pose.excess,
        rms_px: (there.iter().map(|px| px * px).sum::<f64>() / there.len() as f64).sqrt(),
    })
}

/// Gauss-Newton steps on the distances of the edges, each with the weight that it has.
fn refined(pose: &PixelPose, intrinsics: &Intrinsics, start: DAffine3) -> Option<DAffine3> {
    const ROUNDS: usize = 8;
    let mut place = start;
    for _ in 0..ROUNDS {
        let mut normal = [[0.0; 6]; 6];
        let mut right = [0.0; 6];
        for edge in &pose.edges {
            let projected = project(intrinsics, &place, edge.point_m)?;
            let certainty = (edge.weight / edge.variance).sqrt();
            let row = projected.row(edge.normal).map(|entry| entry * certainty);
            let distance_px = edge.normal.dot(edge.seen_px - projected.pixel);
            accumulate(&mut normal, &mut right, &row, distance_px * certainty);
        }
        let step = solve_positive_definite(&normal, &right)?;
        place = moved(&place, step);
        if step.iter().all(|entry| entry.abs() < SETTLED) {
            break;
        }
    }
    let faces = place.matrix3.z_axis.dot(place.translation) < 0.0;
    (place.is_finite() && faces).then_some(place)
}

/// Of each edge from where a pose puts it, pixels.
fn distances(pose: &PixelPose, intrinsics: &Intrinsics, place: &DAffine3) -> Option<Vec<f64>> {
    let distance_px = |edge: &Edge| {
        let projected = project(intrinsics, place, edge.point_m)?;
        Some(edge.normal.dot(edge.seen_px - projected.pixel))
    };
    pose.edges.iter().map(distance_px).collect()
}
