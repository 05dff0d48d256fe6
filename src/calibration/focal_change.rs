//! Whether the views are those of one focal length: zoom, focus, a crop or a stabiliser change it from picture to picture,
//! and the camera that fits all of them best is then none of them.

use super::deviations::ReducedView;
use crate::geometry::camera::Intrinsics;
use crate::geometry::matrix::dot;

/// Two kinds of views that no one focal length explains.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "corners are off by {rms_px:.1} px: some pictures want a focal length of about {:.0} px, others of {:.0}; zoom, focus, crop or a \
     stabiliser changed among them",
    focal_px[0], focal_px[1]
)]
pub struct FocalChange {
    /// What the two want, the shorter first, pixels.
    pub focal_px: [f64; 2],
    /// How far corners are off on the whole for the camera that fits all best, pixels.
    pub rms_px: f64,
}

/// Corners that are less far off on the whole need no such explanation, pixels.
const LEAST_RMS_PX: f64 = 0.12;
/// What a focal length for each view would have to take away of the squared distances.
const LEAST_EXPLAINED: f64 = 0.4;
/// Views that differ by less, as a part of the focal length, are bent paper.
const LEAST_CHANGE: f64 = 0.03;

/// What two kinds of views want; `None` where one focal length explains them all. The views' unknowns begin with fx and fy.
///
/// Of each view's normal equations the step along the focal length alone is taken (by Newton's method, as for
/// deviations), what it gains, and its weight, the curvature.
pub(super) fn focal_change(
    intrinsics: &Intrinsics,
    views: &[ReducedView],
    rms_px: f64,
) -> Option<FocalChange> {
    let focal_px = intrinsics.focal_px;
    let mut gained = 0.0;
    let mut kinds = [(0.0, 0.0); 2];
    for view in views {
        let mut along = vec![0.0; view.slope.len()];
        (along[0], along[1]) = (focal_px.x, focal_px.y);
        let slope = dot(&view.slope, &along);
        let row = |i: usize| (0..along.len()).map(move |j| view.curvature.at(i, j));
        let curvature: f64 = (0..along.len())
            .map(|i| {
                along[i]
                    * row(i)
                        .zip(&along)
                        .map(|(entry, by)| entry * by)
                        .sum::<f64>()
            })
            .sum();
        if curvature <= 0.0 {
            continue;
        }
        gained += slope * slope / curvature;
        let (weighted, weight) = &mut kinds[usize::from(slope > 0.0)];
        *weighted += slope;
        *weight += curvature;
    }
    let squares: f64 = views.iter().map(|view| view.squares).sum();
    let changes = kinds.map(|(weighted, weight)| weighted / weight);
    let is_explained = rms_px > LEAST_RMS_PX && gained > LEAST_EXPLAINED * squares;
    let differs = changes[1] - changes[0] > LEAST_CHANGE;
    (is_explained && differs).then(|| FocalChange {
        focal_px: changes.map(|change| focal_px.x * (1.0 + change)),
        rms_px,
    })
}
