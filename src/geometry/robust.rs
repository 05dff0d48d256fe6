//! Weights that keep what lies far off from having a say (M-estimators: P. J. Huber, "Robust Statistics", 1981; Z. Zhang,
//! "Parameter estimation techniques: a tutorial", Image and Vision Computing, 1997).

/// Tukey's constant, standard deviations: 95 % of what least squares would make of Gaussian noise alone.
const TUKEY: f64 = 4.685;
/// The median of |x| of a unit Gaussian.
const GAUSSIAN_MEDIAN: f64 = 0.6745;

/// Tukey's weight (0 to 1) of a residual beside the standard deviation of residuals.
#[inline]
pub fn tukey_weight(residual: f64, deviation: f64) -> f64 {
    let share = residual / (TUKEY * deviation);
    (1.0 - share * share).max(0.0).powi(2)
}

/// Huber's weight (0 to 1) of a distance: 1 up to the limit.
pub fn huber_weight(distance: f64, limit: f64) -> f64 {
    (limit / distance).min(1.0)
}

/// Huber's loss at a distance: half its square up to the limit, and a straight line beyond.
pub fn huber_loss(distance: f64, limit: f64) -> f64 {
    if distance <= limit {
        0.5 * distance * distance
    } else {
        limit * (distance - 0.5 * limit)
    }
}

/// The standard deviation of a Gaussian with the median of these residuals' distances from 0; there must be one.
pub fn deviation(residuals: impl Iterator<Item = f64>) -> f64 {
    let mut distances: Vec<f64> = residuals.map(f64::abs).collect();
    let middle = distances.len() / 2;
    let (_, median, _) = distances.select_nth_unstable_by(middle, f64::total_cmp);
    *median / GAUSSIAN_MEDIAN
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_losses_slopes() {
        const STEP: f64 = 1e-6;
        for distance in [0.3_f64, 1.9, 2.1, 7.0] {
            let slope = (huber_loss(distance + STEP, 2.0) - huber_loss(distance - STEP, 2.0))
                / (2.0 * STEP);
            assert!((slope - huber_weight(distance, 2.0) * distance).abs() < 1e-8);
        }
        assert_eq!(huber_weight(0.0, 2.0), 1.0);
    }

    #[test]
    fn tukey_ends_at_its_constant() {
        assert_eq!(tukey_weight(0.0, 0.5), 1.0);
        assert_eq!(tukey_weight(-0.5 * TUKEY, 0.5), 0.0);
        assert_eq!(tukey_weight(100.0, 0.5), 0.0);
        // (1 - 1/4)²
        assert!((tukey_weight(0.25 * TUKEY, 0.5) - 0.5625).abs() < 1e-15);
    }

    #[test]
    fn a_third_of_outliers_leaves_the_deviation_near() {
        // Quantiles of a Gaussian of deviation 2, by inverting its integral; and as many again far off.
        let inlier = |k: usize| 2.0 * (k as f64 / 100.0 * 0.6745);
        let clean: Vec<f64> = (0..=200).map(inlier).collect();
        assert!((deviation(clean.iter().copied()) - 2.0).abs() < 1e-12);
        let dirty = clean.iter().copied().chain((0..60).map(|_| 1e3));
        assert!(deviation(dirty) < 3.0);
    }
}
