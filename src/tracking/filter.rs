//! Smooths an anchor's poses: much while it rests, not at all while it moves in a way that cannot be foreseen.
//!
//! A Kalman filter of a pose and its velocity (P. S. Maybeck, "Stochastic Models, Estimation, and Control", 1979), its
//! state a small turn and shift from the pose, fed with each pose's own covariance. How much acceleration is expected is
//! what a one-euro filter's cutoff is: it follows the innovations. When one is larger than the covariances allow, the
//! expected acceleration rises before that very pose is weighed, so that a start, a stop or a step is shown in the frame
//! that sees it; while none is, it falls, and the pose becomes the mean of ever more frames.
//!
//! Measured on the recorded sessions: any smoothing that does not weigh a pose by its covariance does harm while a hand
//! holds the camera, since the hand's own acceleration moves the picture by more than a pose from pixels errs.

use glam::DAffine3;

use crate::geometry::matrix::{Matrix, dot};
use crate::geometry::pose::{PoseStep, difference, moved};

/// Standard deviation of the acceleration of something that a hand holds: of its turn, rad/s²; the shift's is that times
/// the distance.
const TURN_ACCELERATION: f64 = 5.0;
/// The least variance of the acceleration that is expected, at rest, as a part of a hand's.
const CALM: f64 = 1e-10;
/// The largest variance of the acceleration that is expected, as a part of a hand's.
const WILD: f64 = 100.0;
/// The squared innovation over what is expected of it, per degree of freedom, above which the anchor accelerates.
const SURPRISE: f64 = 2.5;
/// The squared innovation over what is expected of it, per degree of freedom, down to which the expected acceleration then
/// rises.
const EXPECTED: f64 = 1.0;
/// What is left of the expected acceleration after a frame without surprise.
const CALMING: f64 = 0.8;
/// Frames farther apart are no motion, seconds.
const LONGEST_STEP_SECS: f64 = 0.25;
/// Poses from pixels err by somewhat more than their covariance says, as a factor of the variance: measured.
const CAUTION: f64 = 1.6;
/// Standard deviation of a velocity of which nothing is known: rad/s, and m/s per metre of distance.
const UNKNOWN_SPEED: f64 = 3.0;

/// A pose and its velocity, as all frames so far say.
#[derive(Clone)]
pub(super) struct Filter {
    time_secs: f64,
    pose: DAffine3,
    /// Turn (left of the rotation) and shift per second.
    velocity: PoseStep,
    by_pose: Matrix<6>,
    /// Row: pose, column: velocity.
    mixed: Matrix<6>,
    by_velocity: Matrix<6>,
    /// Variance of the acceleration, as a part of a hand's.
    liveliness: f64,
}

impl Filter {
    /// Starts at a pose. Covariances are of a turn about the anchor's origin in camera axes, left of the rotation, and a
    /// shift; radians and metres.
    pub(super) fn new(time_secs: f64, pose: DAffine3, covariance: Matrix<6>) -> Self {
        let speed = scaled_by_distance(&pose, UNKNOWN_SPEED * UNKNOWN_SPEED);
        Self {
            time_secs,
            pose,
            velocity: [0.0; 6],
            by_pose: covariance * CAUTION,
            mixed: Matrix::ZERO,
            by_velocity: speed,
            liveliness: 1.0,
        }
    }

    pub(super) fn pose(&self) -> &DAffine3 {
        &self.pose
    }

    pub(super) fn covariance(&self) -> &Matrix<6> {
        &self.by_pose
    }

    /// Turn (left of the rotation, rad/s) and shift (m/s).
    pub(super) fn velocity(&self) -> PoseStep {
        self.velocity
    }

    /// Takes a pose of a later time.
    pub(super) fn add(&mut self, time_secs: f64, pose: &DAffine3, covariance: Matrix<6>) {
        let step_secs = time_secs - self.time_secs;
        if !(step_secs > 0.0 && step_secs <= LONGEST_STEP_SECS) {
            *self = Self::new(time_secs, *pose, covariance);
            return;
        }
        let expected = moved(&self.pose, self.velocity.map(|speed| speed * step_secs));
        let innovation = difference(pose, &expected);
        let noise = covariance * CAUTION;
        // What the velocity's covariance adds, before any acceleration.
        let to_mixed = self.mixed + self.by_velocity * step_secs;
        let mixed_twice = self.mixed + self.mixed.transposed();
        let drifted =
            self.by_pose + (mixed_twice * step_secs + self.by_velocity * (step_secs * step_secs));
        let acceleration = scaled_by_distance(pose, TURN_ACCELERATION * TURN_ACCELERATION);
        let weigh = |liveliness: f64| {
            let by_pose = drifted + acceleration * (liveliness * step_secs.powi(4) / 4.0);
            let certainty = (by_pose + noise).inverse()?;
            let surprise = dot(&innovation, &(certainty * innovation)) / 6.0;
            Some((by_pose, certainty, surprise))
        };
        let mut weighed = weigh(self.liveliness);
        match weighed {
            Some((_, _, surprise)) if surprise > SURPRISE => {
                while self.liveliness < WILD && weighed.is_some_and(|(.., rest)| rest > EXPECTED) {
                    self.liveliness *= 2.0;
                    weighed = weigh(self.liveliness);
                }
            }
            _ => self.liveliness = (self.liveliness * CALMING).max(CALM),
        }
        let explained = weighed.filter(|(.., surprise)| *surprise <= 4.0 * SURPRISE);
        let Some((by_pose, certainty, _)) = explained else {
            // It was put elsewhere.
            *self = Self::new(time_secs, *pose, covariance);
            return;
        };
        let variance = self.liveliness * step_secs * step_secs;
        let mixed = to_mixed + acceleration * (0.5 * variance * step_secs);
        let by_velocity = self.by_velocity + acceleration * variance;
        let gain = by_pose * certainty;
        let velocity_gain = mixed.transposed() * certainty;
        let faster = velocity_gain * innovation;
        self.pose = moved(&expected, gain * innovation);
        self.velocity = std::array::from_fn(|k| self.velocity[k] + faster[k]);
        self.by_velocity = symmetric(by_velocity - velocity_gain * mixed);
        self.mixed = mixed - gain * mixed;
        self.by_pose = symmetric(by_pose - gain * by_pose);
        self.time_secs = time_secs;
    }
}

/// A variance for each of a turn and, times the squared distance, of a shift.
fn scaled_by_distance(pose: &DAffine3, variance: f64) -> Matrix<6> {
    let by_shift = variance * pose.translation.length_squared();
    Matrix::diagonal([variance, variance, variance, by_shift, by_shift, by_shift])
}

/// Rounding must not make a covariance lopsided.
fn symmetric(matrix: Matrix<6>) -> Matrix<6> {
    (matrix + matrix.transposed()) * 0.5
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::*;
    use crate::geometry::pose::rotation_between;

    const FRAME_SECS: f64 = 1.0 / 30.0;
    /// Standard deviations of a lone marker's pose: of its turn, rad, and its shift, m.
    const NOISE: [f64; 2] = [2e-3, 3e-4];

    fn covariance() -> Matrix<6> {
        Matrix::diagonal(std::array::from_fn(|k| NOISE[k / 3] * NOISE[k / 3]))
    }

    fn start() -> DAffine3 {
        DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(2.5),
            DVec3::new(0.02, -0.01, 0.5),
        )
    }

    /// Gaussian noise on a pose, the same each time.
    fn noisy(pose: &DAffine3, state: &mut u64) -> DAffine3 {
        let mut uniform = || {
            *state ^= *state << 13;
            *state ^= *state >> 7;
            *state ^= *state << 17;
            (*state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let mut gaussian = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        moved(pose, std::array::from_fn(|k| NOISE[k / 3] * gaussian()))
    }

    #[test]
    fn what_rests_comes_to_rest() {
        let mut seed = 7;
        let mut filter = Filter::new(0.0, noisy(&start(), &mut seed), covariance());
        let mut steps = Vec::new();
        for frame in 1..=300 {
            let before = filter.pose().translation;
            filter.add(
                f64::from(frame) * FRAME_SECS,
                &noisy(&start(), &mut seed),
                covariance(),
            );
            steps.push(before.distance(filter.pose().translation));
        }
        let mean = |steps: &[f64]| steps.iter().sum::<f64>() / steps.len() as f64;
        assert!(
            mean(&steps[..5]) > 0.2 * NOISE[1],
            "it begins as it is told"
        );
        assert!(
            mean(&steps[250..]) < 0.05 * NOISE[1],
            "{:?}",
            mean(&steps[250..])
        );
        assert!(rotation_between(filter.pose(), &start()) < 0.5 * NOISE[0]);
        assert!(filter.pose().translation.distance(start().translation) < 0.5 * NOISE[1]);
    }

    #[test]
    fn a_step_is_shown_in_the_frame_that_sees_it() {
        let mut filter = Filter::new(0.0, start(), covariance());
        for frame in 1..100 {
            filter.add(f64::from(frame) * FRAME_SECS, &start(), covariance());
        }
        // Two to a thousand times what noise does.
        for factor in [8.0, 30.0, 300.0, 3000.0] {
            let mut stepped = filter.clone();
            let there = moved(&start(), std::array::from_fn(|k| factor * NOISE[k / 3]));
            stepped.add(100.0 * FRAME_SECS, &there, covariance());
            let left = stepped.pose().translation.distance(there.translation)
                / start().translation.distance(there.translation);
            assert!(left < 0.25, "factor {factor}: {left} of the step is left");
            stepped.add(101.0 * FRAME_SECS, &there, covariance());
            let left = stepped.pose().translation.distance(there.translation)
                / start().translation.distance(there.translation);
            assert!(
                left.abs() < 0.25,
                "factor {factor}: {left} of the step is left after it"
            );
        }
    }

    #[test]
    fn a_steady_motion_is_not_held_back() {
        let mut filter = Filter::new(0.0, start(), covariance());
        let speed = [0.5, -0.2, 0.1, 0.1, 0.05, -0.02];
        for frame in 1..60 {
            let time_secs = f64::from(frame) * FRAME_SECS;
            let there = moved(&start(), speed.map(|speed| speed * time_secs));
            filter.add(time_secs, &there, covariance());
            let lag_m = filter.pose().translation.distance(there.translation);
            assert!(
                frame < 10 || lag_m < 0.1 * NOISE[1],
                "frame {frame}: {lag_m} m behind"
            );
        }
        let [.., z] = filter.velocity();
        assert!((z + 0.02).abs() < 1e-3, "{z} m/s");
    }

    #[test]
    fn odd_times_start_it_anew() {
        for time_secs in [0.0, -1.0, 10.0, f64::NAN] {
            let mut filter = Filter::new(0.0, start(), covariance());
            let there = moved(&start(), [0.3, 0.0, 0.0, 0.0, 0.1, 0.0]);
            filter.add(time_secs, &there, covariance());
            assert_eq!(*filter.pose(), there, "{time_secs} s");
        }
    }
}
