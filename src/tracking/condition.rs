//! What stays about the same from picture to picture of an anchor, and is learned on the way: the blur, and whether its
//! markers are as large as the scene says.

use glam::DVec2;

use super::edge_fit::BlurError;
use crate::geometry::least_squares::NormalEquations;

/// The variance of the blur that a lens in focus leaves, the pixel's own square included, pixels².
const SHARP_VARIANCE: f64 = 0.25;
/// The variance of a blur: from a perfect lens, whose pixels are squares, to where no cell is left, pixels².
const BLUR_VARIANCES: [f64; 2] = [1.0 / 12.0, 25.0];
/// No edge tells the variance of the blur better than to this, pixels².
const BLUR_FLOOR: f64 = 0.1;
/// What the variance of the blur is expected to change from one look to the next, pixels².
const BLUR_CHANGE: f64 = 0.1;
/// The largest correction that one edge can ask for, pixels².
const MOST_BLUR_CHANGE: f64 = 2.0;
/// Standard deviation of a printed marker's size against the scene's, as a part of it.
const SIZE_DEVIATION: f64 = 0.03;
/// However many pictures agree, the size is not believed more firmly than this.
const LEAST_SIZE_DEVIATION: f64 = 0.001;
/// The size is worth telling once it is known to this.
const KNOWN_SIZE_DEVIATION: f64 = 0.004;

/// Learned from an anchor's pictures.
#[derive(Debug, Clone, Copy)]
pub(super) struct Condition {
    /// Covariance of the blur by the lens, the pixel and the motion during the exposure: xx, xy, yy; pixels².
    blur: [f64; 3],
    /// By what part of its size each marker is larger than the scene says.
    size_error: f64,
    /// Inverse of the variance of the size error.
    size_certainty: f64,
}

impl Condition {
    /// Nothing learned yet.
    pub(super) const UNKNOWN: Self = Self {
        blur: [SHARP_VARIANCE, 0.0, SHARP_VARIANCE],
        size_error: 0.0,
        size_certainty: 1.0 / (SIZE_DEVIATION * SIZE_DEVIATION),
    };

    /// Variance of the blur along a unit vector of the picture, pixels².
    pub(super) fn blur_variance_along(&self, direction: DVec2) -> f64 {
        let ([xx, xy, yy], DVec2 { x, y }) = (self.blur, direction);
        let variance = xx * x * x + 2.0 * xy * x * y + yy * y * y;
        variance.clamp(BLUR_VARIANCES[0], BLUR_VARIANCES[1])
    }

    /// Moves the blur toward what the edges of a picture say: each by the unit vector across it, how much it counts (0 to
    /// 1), and what it lacks. Returns by what part of itself its variance changed.
    pub(super) fn correct_blur(
        &mut self,
        edges: impl Iterator<Item = (DVec2, f64, BlurError)>,
    ) -> f64 {
        let mut equations = NormalEquations::<3>::ZERO;
        for (DVec2 { x, y }, weight, missing) in edges {
            let BlurError { error, certainty } = missing;
            let known = certainty / (1.0 + BLUR_FLOOR * BLUR_FLOOR * certainty);
            let error = error.clamp(-MOST_BLUR_CHANGE, MOST_BLUR_CHANGE);
            equations.add_weighted(&[x * x, 2.0 * x * y, y * y], error, weight * known);
        }
        for unknown in 0..3 {
            equations.add_prior(unknown, 0.0, 1.0 / (BLUR_CHANGE * BLUR_CHANGE));
        }
        let Some(change) = equations.solve() else {
            return 0.0;
        };
        let [least, most] = BLUR_VARIANCES;
        let before = self.blur[0] + self.blur[2];
        let [xx, xy, yy] = &mut self.blur;
        *xx = (*xx + change[0]).clamp(least, most);
        *yy = (*yy + change[2]).clamp(least, most);
        let most_mixed = (*xx * *yy).sqrt() - least;
        *xy = (*xy + change[1]).clamp(-most_mixed, most_mixed);
        (*xx + *yy - before).abs() / before
    }

    /// The size error as it is believed, and the inverse of its variance.
    pub(super) fn size(&self) -> (f64, f64) {
        (self.size_error, self.size_certainty)
    }

    /// Believes a size error, as certain as it is but for a limit.
    pub(super) fn learn_size(&mut self, error: f64, certainty: f64) {
        self.size_error = error;
        self.size_certainty = certainty.min(1.0 / (LEAST_SIZE_DEVIATION * LEAST_SIZE_DEVIATION));
    }

    /// By what part of its size each marker is larger than the scene says, once that is known.
    pub(super) fn known_size_error(&self) -> Option<f64> {
        let known = 1.0 / (KNOWN_SIZE_DEVIATION * KNOWN_SIZE_DEVIATION);
        (self.size_certainty >= known).then_some(self.size_error)
    }
}
