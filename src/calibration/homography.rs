//! The map between two planes.

use glam::{DMat3, DVec2, DVec3};
use opencv::calib3d;
use opencv::core::{Mat, Point2d, Vector};
use opencv::prelude::*;

/// The homography that takes the first of each pair to the second, by least squares; `None` where four pairs or more do
/// not determine one.
pub(super) fn homography(pairs: &[(DVec2, DVec2)]) -> opencv::Result<Option<DMat3>> {
    if pairs.len() < 4 {
        return Ok(None);
    }
    let points = |of: fn(&(DVec2, DVec2)) -> DVec2| -> Vector<Point2d> {
        let points = pairs.iter().map(of);
        points.map(|point| Point2d::new(point.x, point.y)).collect()
    };
    let found: Mat = calib3d::find_homography_def(
        &points(|pair| pair.0),
        &points(|pair| pair.1),
        &mut Mat::default(),
    )?;
    if found.empty() {
        return Ok(None);
    }
    let entries = found.data_typed::<f64>()?;
    let row = |k: usize| DVec3::from_slice(&entries[3 * k..]);
    let matrix = DMat3::from_cols(row(0), row(1), row(2)).transpose();
    Ok(matrix.is_finite().then_some(matrix))
}

/// Where a homography takes a point.
pub(super) fn mapped(homography: &DMat3, point: DVec2) -> DVec2 {
    let image = *homography * point.extend(1.0);
    image.truncate() / image.z
}
