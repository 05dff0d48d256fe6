//! Least squares: normal equations, and the iterations of Gauss-Newton and of Levenberg-Marquardt.
//!
//! K. Madsen, H. B. Nielsen and O. Tingleff, "Methods for Non-Linear Least Squares Problems", 2004; the damping is
//! Marquardt's, of each unknown by its own part of the diagonal, so that units do not matter.

use super::matrix::Matrix;

/// The normal equations of weighted equations `row · x = value` in N unknowns.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NormalEquations<const N: usize> {
    /// The sum of all rowᵀ · row.
    pub matrix: Matrix<N>,
    /// The sum of all rowᵀ · value.
    pub right: [f64; N],
}

impl<const N: usize> NormalEquations<N> {
    /// No equation yet.
    pub const ZERO: Self = Self {
        matrix: Matrix::ZERO,
        right: [0.0; N],
    };

    /// Adds the equation `row · x = value`.
    #[inline]
    pub fn add(&mut self, row: &[f64; N], value: f64) {
        for i in 0..N {
            for j in 0..N {
                self.matrix.0[i][j] += row[i] * row[j];
            }
            self.right[i] += row[i] * value;
        }
    }

    /// Adds the equation `row · x = value` with a weight, the inverse of the value's variance.
    #[inline]
    pub fn add_weighted(&mut self, row: &[f64; N], value: f64, weight: f64) {
        let scale = weight.sqrt();
        self.add(&row.map(|entry| entry * scale), value * scale);
    }

    /// Adds what is known of one unknown beforehand: its value with the inverse of its variance.
    pub fn add_prior(&mut self, unknown: usize, value: f64, weight: f64) {
        self.matrix.0[unknown][unknown] += weight;
        self.right[unknown] += weight * value;
    }

    /// The x that fits best; `None` where the equations do not determine it.
    #[inline]
    pub fn solve(&self) -> Option<[f64; N]> {
        self.matrix.solve(&self.right)
    }

    /// The covariance of the x that fits best; `None` where the equations do not determine it.
    pub fn covariance(&self) -> Option<Matrix<N>> {
        self.matrix.inverse()
    }
}

/// A problem made linear about a guess.
pub trait Linearized {
    /// What is added to the guess.
    type Step;

    /// The step to the minimum, the curvature of each unknown raised by a part of itself; `None` where an unknown is not
    /// determined.
    fn step(&self, damping: f64) -> Option<Self::Step>;
}

impl<const N: usize> Linearized for NormalEquations<N> {
    type Step = [f64; N];

    #[inline]
    fn step(&self, damping: f64) -> Option<[f64; N]> {
        let mut damped = self.matrix;
        for (k, row) in damped.0.iter_mut().enumerate() {
            row[k] *= 1.0 + damping;
        }
        damped.solve(&self.right)
    }
}

/// A sum of squares as a function of a guess, which the value itself is.
pub trait Problem: Sized {
    /// The problem near the guess.
    type Linearized: Linearized;

    /// The sum of squares, or robust losses, at the guess; `None` where the model says nothing (behind a camera).
    fn cost(&self) -> Option<f64>;

    /// The problem near the guess; `None` where the model says nothing.
    fn linearized(&self) -> Option<Self::Linearized>;

    /// The guess after a step.
    fn moved(&self, step: &<Self::Linearized as Linearized>::Step) -> Self;

    /// Whether a step is so small that the guess is the minimum.
    fn is_negligible(&self, _step: &<Self::Linearized as Linearized>::Step) -> bool {
        false
    }
}

/// How Levenberg-Marquardt begins and when it ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevenbergMarquardt {
    /// The damping of the first step, as a part of each unknown's curvature.
    pub first_damping: f64,
    /// The most steps that are tried.
    pub rounds: usize,
    /// The part of the cost by which a step must lower it for another one to be worth it.
    pub least_gain: f64,
}

/// What Levenberg-Marquardt came to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Minimum<P> {
    /// The problem at its best guess.
    pub problem: P,
    /// Its cost there.
    pub cost: f64,
    /// Whether it came to rest; `false` when the rounds ended first.
    pub is_settled: bool,
}

impl LevenbergMarquardt {
    /// Moves a guess to the minimum near it. `None` where the model says nothing, or an unknown is not determined.
    pub fn minimize<P: Problem>(&self, start: P) -> Option<Minimum<P>> {
        const LEAST_DAMPING: f64 = 1e-12;
        /// Steps this much shorter that still lower nothing leave rounding alone to decide.
        const MOST_DAMPING: f64 = 1e12;
        let mut best = Minimum {
            cost: start.cost()?,
            problem: start,
            is_settled: false,
        };
        let mut damping = self.first_damping;
        let mut linearized = best.problem.linearized()?;
        for _ in 0..self.rounds {
            let Some(step) = linearized.step(damping) else {
                damping *= 10.0;
                if damping > MOST_DAMPING {
                    return None;
                }
                continue;
            };
            let is_negligible = best.problem.is_negligible(&step);
            let candidate = best.problem.moved(&step);
            match candidate.cost() {
                Some(cost) if cost < best.cost => {
                    let is_enough = best.cost - cost < self.least_gain * best.cost;
                    (best.problem, best.cost) = (candidate, cost);
                    best.is_settled = is_negligible || is_enough;
                    damping = (damping / 10.0).max(LEAST_DAMPING);
                }
                _ => {
                    damping *= 10.0;
                    best.is_settled = is_negligible || damping > MOST_DAMPING;
                    if !best.is_settled {
                        continue;
                    }
                }
            }
            if best.is_settled {
                break;
            }
            linearized = best.problem.linearized()?;
        }
        Some(best)
    }
}

/// Moves a guess near a minimum on to it by undamped steps. `None` where the model says nothing, or an unknown is not
/// determined.
pub fn gauss_newton<P: Problem>(start: P, rounds: usize) -> Option<P> {
    let mut problem = start;
    for _ in 0..rounds {
        let step = problem.linearized()?.step(0.0)?;
        let is_negligible = problem.is_negligible(&step);
        problem = problem.moved(&step);
        if is_negligible {
            break;
        }
    }
    Some(problem)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_noise_is_the_closed_form() {
        // y = 1 + 2 x with errors 1, -2, 1 at x = 0, 1, 2: their slope is 0 and their mean 0.
        let mut equations = NormalEquations::<2>::ZERO;
        for (x, y) in [(0.0, 2.0), (1.0, 1.0), (2.0, 6.0)] {
            equations.add(&[1.0, x], y);
        }
        let [intercept, slope] = equations.solve().unwrap();
        assert!((intercept - 1.0).abs() < 1e-12 && (slope - 2.0).abs() < 1e-12);
        // 1/3 + mean² / Σ(x - mean)², and 1 / Σ(x - mean)².
        let covariance = equations.covariance().unwrap().0;
        assert!((covariance[0][0] - (1.0 / 3.0 + 1.0 / 2.0)).abs() < 1e-12);
        assert!((covariance[1][1] - 0.5).abs() < 1e-12);
    }

    #[test]
    fn weights_and_priors_are_repeated_equations() {
        let (mut weighted, mut repeated) = (NormalEquations::<1>::ZERO, NormalEquations::ZERO);
        weighted.add_weighted(&[1.0], 3.0, 4.0);
        weighted.add_prior(0, 1.0, 2.0);
        for value in [3.0, 3.0, 3.0, 3.0, 1.0, 1.0] {
            repeated.add(&[1.0], value);
        }
        let difference = weighted.solve().unwrap()[0] - repeated.solve().unwrap()[0];
        assert!(difference.abs() < 1e-14);
    }

    /// Rosenbrock's valley as squares: 10 (y - x²) and 1 - x.
    #[derive(Clone, Copy)]
    struct Valley([f64; 2]);

    impl Problem for Valley {
        type Linearized = NormalEquations<2>;

        fn cost(&self) -> Option<f64> {
            let [x, y] = self.0;
            (x > -10.0).then(|| 100.0 * (y - x * x).powi(2) + (1.0 - x).powi(2))
        }

        fn linearized(&self) -> Option<NormalEquations<2>> {
            let [x, y] = self.0;
            let mut equations = NormalEquations::ZERO;
            equations.add(&[-20.0 * x, 10.0], -10.0 * (y - x * x));
            equations.add(&[-1.0, 0.0], -(1.0 - x));
            Some(equations)
        }

        fn moved(&self, step: &[f64; 2]) -> Self {
            Self([self.0[0] + step[0], self.0[1] + step[1]])
        }

        fn is_negligible(&self, step: &[f64; 2]) -> bool {
            step.iter().all(|step| step.abs() < 1e-12)
        }
    }

    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-3,
        rounds: 100,
        least_gain: 0.0,
    };

    #[test]
    fn a_bent_valley_is_followed_to_its_end() {
        let found = METHOD.minimize(Valley([-1.2, 1.0])).unwrap();
        assert!(found.is_settled && found.cost < 1e-20);
        let [x, y] = found.problem.0;
        assert!((x - 1.0).abs() < 1e-9 && (y - 1.0).abs() < 1e-9, "{x} {y}");
        let Valley([x, y]) = gauss_newton(Valley([0.9, 0.8]), 20).unwrap();
        assert!((x - 1.0).abs() < 1e-12 && (y - 1.0).abs() < 1e-12);
    }

    #[test]
    fn rounds_that_end_first_are_told_and_no_model_gives_none() {
        let few = LevenbergMarquardt {
            rounds: 2,
            ..METHOD
        };
        let found = few.minimize(Valley([-1.2, 1.0])).unwrap();
        assert!(!found.is_settled && found.cost < Valley([-1.2, 1.0]).cost().unwrap());
        assert!(METHOD.minimize(Valley([-11.0, 1.0])).is_none());
    }
}
