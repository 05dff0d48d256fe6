//! Values over time between keys (glTF 2.0, section 3.11 and appendix C).

use glam::{DQuat, DVec3};

/// How values go from one key to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Interpolation {
    /// A key's value holds until the next.
    Step,
    /// Straight; of rotations along the shorter arc at an even pace.
    Linear,
    /// By Hermite's splines: each key has a tangent in, a value and a tangent out.
    CubicSpline,
}

/// Why keys are none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum SamplerFault {
    /// There is no key.
    #[error("no key; one or more are expected")]
    Empty,
    /// This key has a time that is no time.
    #[error(
        "key {0} has a time that is below 0 or not finite; times in seconds, 0 or more, are expected"
    )]
    NoTime(usize),
    /// This key does not come after the one before it.
    #[error("key {0} is not later than the one before it; rising times are expected")]
    NotLater(usize),
    /// There are other numbers of values and keys.
    #[error("{found} values; {expected} are expected for its {keys} keys")]
    Count {
        /// Values that there are.
        found: usize,
        /// Values that there should be.
        expected: usize,
        /// Keys that there are.
        keys: usize,
    },
}

/// Values that can be interpolated.
pub trait Keyed: Clone {
    /// The value at a part of the way from this one to another.
    fn between(&self, other: &Self, part: f64) -> Self;

    /// A sum of values, each times a factor.
    fn sum(terms: [(&Self, f64); 4]) -> Self;
}

/// Values over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Sampler<T> {
    times_s: Vec<f64>,
    /// One for each time; for splines three.
    values: Vec<T>,
    interpolation: Interpolation,
}

impl<T: Keyed> Sampler<T> {
    /// Takes keys: rising times in seconds, and a value for each, or for splines three (tangent in, value, tangent out).
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn new(
        times_s: Vec<f64>,
        values: Vec<T>,
        interpolation: Interpolation,
    ) -> Result<Self, SamplerFault> {
        if times_s.is_empty() {
            return Err(SamplerFault::Empty);
        }
        let is_time = |time_s: &f64| time_s.is_finite() && *time_s >= 0.0;
        if let Some(key) = times_s.iter().position(|time_s| !is_time(time_s)) {
            return Err(SamplerFault::NoTime(key));
        }
        if let Some(key) = times_s.windows(2).position(|pair| pair[1] <= pair[0]) {
            return Err(SamplerFault::NotLater(key + 1));
        }
        let each = match interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Step | Interpolation::Linear => 1,
        };
        let expected = each * times_s.len();
        if values.len() != expected {
            return Err(SamplerFault::Count {
                found: values.len(),
                expected,
                keys: times_s.len(),
            });
        }
        Ok(Self {
            times_s,
            values,
            interpolation,
        })
    }

    /// When its last key is, seconds.
    pub fn end_s(&self) -> f64 {
        self.times_s.last().copied().unwrap_or(0.0)
    }

    /// Its value at a time, seconds; before its first key the first value, after its last key the last.
    pub fn at(&self, time_s: f64) -> T {
        let next = self.times_s.partition_point(|&key_s| key_s <= time_s);
        let Some(before) = next.checked_sub(1) else {
            return self.value(0).clone();
        };
        if next == self.times_s.len() {
            return self.value(before).clone();
        }
        let span_s = self.times_s[next] - self.times_s[before];
        let part = (time_s - self.times_s[before]) / span_s;
        match self.interpolation {
            Interpolation::Step => self.value(before).clone(),
            Interpolation::Linear => self.value(before).between(self.value(next), part),
            Interpolation::CubicSpline => self.on_spline([before, next], part, span_s),
        }
    }

    fn value(&self, key: usize) -> &T {
        match self.interpolation {
            Interpolation::CubicSpline => &self.values[3 * key + 1],
            Interpolation::Step | Interpolation::Linear => &self.values[key],
        }
    }

    /// Appendix C.5.
    fn on_spline(&self, [before, next]: [usize; 2], t: f64, span_s: f64) -> T {
        let (squared, cubed) = (t * t, t * t * t);
        T::sum([
            (self.value(before), 2.0 * cubed - 3.0 * squared + 1.0),
            (
                &self.values[3 * before + 2],
                span_s * (cubed - 2.0 * squared + t),
            ),
            (self.value(next), 3.0 * squared - 2.0 * cubed),
            (&self.values[3 * next], span_s * (cubed - squared)),
        ])
    }
}

impl Keyed for DVec3 {
    fn between(&self, other: &Self, part: f64) -> Self {
        self.lerp(*other, part)
    }

    fn sum(terms: [(&Self, f64); 4]) -> Self {
        terms.into_iter().map(|(term, factor)| *term * factor).sum()
    }
}

impl Keyed for DQuat {
    fn between(&self, other: &Self, part: f64) -> Self {
        self.slerp(*other, part)
    }

    fn sum(terms: [(&Self, f64); 4]) -> Self {
        let sum = terms
            .into_iter()
            .fold(glam::DVec4::ZERO, |sum, (term, factor)| {
                sum + glam::DVec4::from(*term) * factor
            });
        match sum.try_normalize() {
            Some(unit) => Self::from_vec4(unit),
            // Between opposite values the sum may vanish for a moment.
            None => *terms[0].0,
        }
    }
}

/// Weights of morph targets.
impl Keyed for Vec<f64> {
    fn between(&self, other: &Self, part: f64) -> Self {
        let pairs = self.iter().zip(other);
        pairs
            .map(|(one, other)| one + (other - one) * part)
            .collect()
    }

    fn sum(terms: [(&Self, f64); 4]) -> Self {
        let of_target = |target: usize| {
            let terms = terms.iter();
            terms
                .map(|(term, factor)| term.get(target).copied().unwrap_or(0.0) * factor)
                .sum()
        };
        (0..terms[0].0.len()).map(of_target).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(values: &[f64], interpolation: Interpolation) -> Sampler<DVec3> {
        let values = values.iter().map(|&x| DVec3::X * x).collect();
        Sampler::new(vec![1.0, 2.0, 4.0], values, interpolation).expect("keys")
    }

    #[test]
    fn steps_hold_and_lines_are_straight() {
        let step = of(&[3.0, 5.0, 9.0], Interpolation::Step);
        let line = of(&[3.0, 5.0, 9.0], Interpolation::Linear);
        for (time_s, stepped, straight) in [
            (0.0, 3.0, 3.0),
            (1.0, 3.0, 3.0),
            (1.75, 3.0, 4.5),
            (2.0, 5.0, 5.0),
            (3.0, 5.0, 7.0),
            (4.0, 9.0, 9.0),
            (7.0, 9.0, 9.0),
        ] {
            assert_eq!(step.at(time_s).x, stepped, "{time_s}");
            assert!((line.at(time_s).x - straight).abs() < 1e-12, "{time_s}");
        }
        assert_eq!(line.end_s(), 4.0);
    }

    #[test]
    fn splines_follow_the_cubic_whose_values_and_slopes_they_have() {
        let cubic = |t: f64| 0.5 * t * t * t - 2.0 * t * t + 3.0 * t - 1.0;
        let slope = |t: f64| 1.5 * t * t - 4.0 * t + 3.0;
        let keys = [1.0, 2.0, 4.0].map(|t| [slope(t), cubic(t), slope(t)]);
        let sampler = of(keys.as_flattened(), Interpolation::CubicSpline);
        for step in 0..=30 {
            let time_s = 1.0 + 0.1 * f64::from(step);
            let found = sampler.at(time_s).x;
            assert!((found - cubic(time_s)).abs() < 1e-12, "{time_s}: {found}");
        }
        assert_eq!(sampler.at(0.0).x, cubic(1.0));
        assert_eq!(sampler.at(9.0).x, cubic(4.0));
    }

    #[test]
    fn rotations_take_the_shorter_arc_at_an_even_pace() {
        let turn = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
        let angle = |found: DQuat| {
            let turned = found * DVec3::X;
            turned.y.atan2(turned.x).to_degrees()
        };
        let times = || vec![0.0, 1.0];
        for second in [turn(100.0), -turn(100.0)] {
            let keys = vec![turn(0.0), second];
            let sampler = Sampler::new(times(), keys, Interpolation::Linear).expect("keys");
            for part in [0.1, 0.25, 0.5, 0.9] {
                assert!((angle(sampler.at(part)) - 100.0 * part).abs() < 1e-9);
            }
        }
        // 300 degrees on is 60 back.
        let keys = vec![turn(0.0), turn(300.0)];
        let sampler = Sampler::new(times(), keys, Interpolation::Linear).expect("keys");
        assert!((angle(sampler.at(0.5)) + 30.0).abs() < 1e-9);
        // A spline's sum is made a rotation again.
        let flat = DQuat::from_vec4(glam::DVec4::ZERO);
        let keys = vec![flat, turn(0.0), flat, flat, turn(90.0), flat];
        let sampler = Sampler::new(times(), keys, Interpolation::CubicSpline).expect("keys");
        assert!((sampler.at(0.5).length() - 1.0).abs() < 1e-12);
        assert!((angle(sampler.at(0.5)) - 45.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_no_sampler_is_told() {
        let line = |times: Vec<f64>, count: usize| {
            Sampler::new(times, vec![DVec3::ZERO; count], Interpolation::Linear).err()
        };
        assert_eq!(line(vec![], 0), Some(SamplerFault::Empty));
        assert_eq!(line(vec![0.0, f64::NAN], 2), Some(SamplerFault::NoTime(1)));
        assert_eq!(line(vec![-1.0], 1), Some(SamplerFault::NoTime(0)));
        assert_eq!(
            line(vec![0.0, 1.0, 1.0], 3),
            Some(SamplerFault::NotLater(2))
        );
        let count = SamplerFault::Count {
            found: 3,
            expected: 2,
            keys: 2,
        };
        assert_eq!(line(vec![0.0, 1.0], 3), Some(count));
        assert_eq!(line(vec![0.0, 1.0], 2), None);
        let splines = Sampler::new(vec![0.0], vec![DVec3::ZERO], Interpolation::CubicSpline);
        assert!(matches!(
            splines,
            Err(SamplerFault::Count { expected: 3, .. })
        ));
    }
}
