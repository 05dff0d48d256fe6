//! Whether a view or a term of the lens is worth having: whether what the others make of it says where the corners of
//! views that they have not seen are (leave-one-out cross-validation; M. Stone, "Cross-validatory choice and assessment of
//! statistical predictions", 1974), by one step of Newton's method each from the calibration that all views give.

use glam::DAffine3;

use super::TargetCorner;
use super::deviations::{ReducedView, reduced_views, steps_without_each};
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::dot;

/// For each view the squared distances of its corners from where a camera puts them that is known from the other views,
/// the target wherever they fit best; pixels. `None` where the others do not determine the camera.
pub(super) fn left_out_errors<'a>(
    intrinsics: &Intrinsics,
    views: impl Iterator<Item = (&'a [TargetCorner], DAffine3)>,
    free: [bool; 9],
) -> Option<Vec<f64>> {
    let views = reduced_views(intrinsics, views, free)?;
    let steps = steps_without_each(&views)?;
    let errors: Vec<f64> = (views.iter().zip(&steps))
        .map(|(view, step)| error_after(view, step))
        .collect();
    errors
        .iter()
        .all(|error| error.is_finite())
        .then_some(errors)
}

/// What is left of a view's squared distances after a step of the camera.
fn error_after(view: &ReducedView, step: &[f64]) -> f64 {
    let along: Vec<f64> = (0..step.len())
        .map(|i| {
            let row: Vec<f64> = (0..step.len()).map(|j| view.curvature.at(i, j)).collect();
            dot(&row, step)
        })
        .collect();
    view.squares - 2.0 * dot(&view.slope, step) + dot(step, &along)
}

/// Whether the simpler of two models says as well where the corners are of views that it has not seen: on the mean within
/// a standard error of the fuller one's (L. Breiman et al., "Classification and Regression Trees", 1984, section 3.4.3).
pub(super) fn is_no_worse(simpler: &[f64], fuller: &[f64]) -> bool {
    let rises: Vec<f64> = simpler.iter().zip(fuller).map(|(a, b)| a - b).collect();
    let count = rises.len() as f64;
    let mean = rises.iter().sum::<f64>() / count;
    let squares: f64 = rises.iter().map(|rise| (rise - mean).powi(2)).sum();
    mean <= (squares / (count * (count - 1.0).max(1.0))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rise_beyond_its_scatter_is_worse() {
        let fuller = [1.0, 2.0, 1.5, 1.0, 3.0, 2.0];
        assert!(is_no_worse(&fuller, &fuller));
        assert!(is_no_worse(&[1.2, 1.9, 1.6, 0.9, 3.1, 1.9], &fuller));
        assert!(!is_no_worse(&fuller.map(|error| error + 0.1), &fuller));
        assert!(is_no_worse(&fuller.map(|error| error - 0.1), &fuller));
    }
}
