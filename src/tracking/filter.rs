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

use super::least_squares::{Matrix6, inverse, product, sum, times, transposed};
use super::pixel_pose::{difference, moved};

/// Standard deviation of the acceleration of something that a hand holds: of its turn, rad/s²; the shift's is that times
/// the distance.
const TURN_ACCELERATION: f64 = 5.0;
/// The variance of the acceleration that is expected, as a part of the above: at rest, and at most.
const CALM: f64 = 1e-7;
const WILD: f64 = 100.0;
/// Squared innovation over what is expected of it, per degree of freedom: above this the anchor accelerates,
const SURPRISE: f64 = 2.5;
/// and that much more acceleration is expected that it is no more than this.
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
    velocity: [f64; 6],
    by_pose: Matrix6,
    /// Row: pose, column: velocity.
    mixed: Matrix6,
    by_velocity: Matrix6,
    /// Variance of the acceleration, as a part of a hand's.
    liveliness: f64,
}

impl Filter {
    /// Starts at a pose. Covariances are of a turn about the anchor's origin in camera axes, left of the rotation, and a
    /// shift; radians and metres.
    pub(super) fn new(time_secs: f64, pose: DAffine3, covariance: &Matrix6) -> Self {
        let speed = scaled_by_distance(&pose, UNKNOWN_SPEED * UNKNOWN_SPEED);
        Self {
            time_secs,
            pose,
            velocity: [0.0; 6],
            by_pose: times(covariance, CAUTION),
            mixed: [[0.0; 6]; 6],
            by_velocity: speed,
            liveliness: 1.0,
        }
    }

    pub(super) fn pose(&self) -> &DAffine3 {
        &self.pose
    }

    pub(super) fn covariance(&self) -> &Matrix6 {
        &self.by_pose
    }

    /// Turn (left of the rotation, rad/s) and shift (m/s).
    pub(super) fn velocity(&self) -> [f64; 6] {
        self.velocity
    }

    /// Takes a pose of a later time.
    pub(super) fn add(&mut self, time_secs: f64, pose: &DAffine3, covariance: &Matrix6) {
        let step_secs = time_secs - self.time_secs;
        if !(step_secs > 0.0 && step_secs <= LONGEST_STEP_SECS) {
            *self = Self::new(time_secs, *pose, covariance);
            return;
        }
        let expected = moved(&self.pose, self.velocity.map(|speed| speed * step_secs));
        let innovation = difference(pose, &expected);
        let noise = times(covariance, CAUTION);
        // What the velocity's covariance adds, before any acceleration.
        let to_mixed = sum(&self.mixed, &times(&self.by_velocity, step_secs));
        let mixed_twice = sum(&self.mixed, &transposed(&self.mixed));
        let drifted = sum(
            &self.by_pose,
            &sum(
                &times(&mixed_twice, step_secs),
                &times(&self.by_velocity, step_secs * step_secs),
            ),
        );
        let acceleration = scaled_by_distance(pose, TURN_ACCELERATION * TURN_ACCELERATION);
        let weigh = |liveliness: f64| {
            let jolt = times(&acceleration, liveliness * step_secs.powi(4) / 4.0);
            let by_pose = sum(&drifted, &jolt);
            let certainty = inverse(&sum(&by_pose, &noise))?;
            let weighed = product_with(&certainty, &innovation);
            let surprise = innovation
                .iter()
                .zip(weighed)
                .map(|(a, b)| a * b)
                .sum::<f64>()
                / 6.0;
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
        let mixed = sum(&to_mixed, &times(&acceleration, 0.5 * variance * step_secs));
        let by_velocity = sum(&self.by_velocity, &times(&acceleration, variance));
        let gain = product(&by_pose, &certainty);
        let velocity_gain = product(&transposed(&mixed), &certainty);
        let correction = product_with(&gain, &innovation);
        let faster = product_with(&velocity_gain, &innovation);
        self.pose = moved(&expected, correction);
        self.velocity = std::array::from_fn(|k| self.velocity[k] + faster[k]);
        let less = |covariance: &Matrix6, gain: &Matrix6, with: &Matrix6| {
            sum(covariance, &times(&product(gain, with), -1.0))
        };
        self.by_velocity = symmetric(&less(&by_velocity, &velocity_gain, &mixed));
        self.mixed = less(&mixed, &gain, &mixed);
        self.by_pose = symmetric(&less(&by_pose, &gain, &by_pose));
        self.time_secs = time_secs;
    }
}

/// A variance for each of a turn and, times the squared distance, of a shift.
fn scaled_by_distance(pose: &DAffine3, variance: f64) -> Matrix6 {
    let by_shift = variance * pose.translation.length_squared();
    let mut matrix = [[0.0; 6]; 6];
    for (k, row) in matrix.iter_mut().enumerate() {
        row[k] = if k < 3 { variance } else { by_shift };
    }
    matrix
}

fn product_with(matrix: &Matrix6, vector: &[f64; 6]) -> [f64; 6] {
    matrix.map(|row| row.iter().zip(vector).map(|(a, b)| a * b).sum())
}

/// Rounding must not make a covariance lopsided.
fn symmetric(matrix: &Matrix6) -> Matrix6 {
    times(&sum(matrix, &transposed(matrix)), 0.5)
}
