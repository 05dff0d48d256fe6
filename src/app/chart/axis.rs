//! From values to places along an axis, and where its ticks are.

use super::figure::{Axis, Scale};

/// An axis that knows what it spans.
#[derive(Debug, Clone)]
pub struct Ruler {
    scale: Scale,
    low: f64,
    high: f64,
}

impl Ruler {
    /// Spans all values with some room around them, and whatever the axis wants.
    pub fn new(axis: &Axis, values: impl IntoIterator<Item = f64>) -> Self {
        let scale = axis.scale.clone();
        let values: Vec<f64> = values.into_iter().chain(axis.spans.clone()).collect();
        let fits = |value: &f64| value.is_finite() && (scale != Scale::Log || *value > 0.0);
        let fitting = || values.iter().copied().filter(fits);
        let (mut low, mut high) = (
            fitting().fold(f64::INFINITY, f64::min),
            fitting().fold(f64::NEG_INFINITY, f64::max),
        );
        if low > high {
            (low, high) = (1.0, 10.0);
        }
        match &scale {
            Scale::Linear => {
                let room = 0.06
                    * if high > low {
                        high - low
                    } else {
                        high.abs().max(1.0)
                    };
                low = if axis.spans.contains(&low) {
                    low
                } else {
                    low - room
                };
                high = if axis.spans.contains(&high) {
                    high
                } else {
                    high + room
                };
                // Nothing but where it begins.
                high = if high > low { high } else { low + 1.0 };
            }
            Scale::Log => {
                let room = (high / low).powf(0.06).max(1.15);
                low = if axis.spans.contains(&low) {
                    low
                } else {
                    low / room
                };
                high = if axis.spans.contains(&high) {
                    high
                } else {
                    high * room
                };
            }
            Scale::Names(names) => (low, high) = (-0.6, names.len() as f64 - 0.4),
        }
        Self { scale, low, high }
    }

    /// 0 at the axis's beginning, 1 at its end.
    pub fn share(&self, value: f64) -> f64 {
        match self.scale {
            Scale::Log => {
                let held = value.max(self.low);
                (held / self.low).ln() / (self.high / self.low).ln()
            }
            _ => (value - self.low) / (self.high - self.low),
        }
    }

    /// Values that get a number or name beside the axis, with it.
    pub fn ticks(&self) -> Vec<(f64, String)> {
        match &self.scale {
            Scale::Names(names) => (0..).map(f64::from).zip(names.clone()).collect(),
            Scale::Linear => {
                let step = nice_step((self.high - self.low) / 5.0);
                let first = (self.low / step).ceil() as i64;
                let last = (self.high / step + 1e-9).floor() as i64;
                (first..=last)
                    .map(|index| index as f64 * step)
                    .map(|value| (value, number(value, step)))
                    .collect()
            }
            Scale::Log => {
                let decades = (self.high / self.low).log10();
                let factors: &[f64] = match decades {
                    few if few < 0.8 => &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
                    some if some < 2.5 => &[1.0, 2.0, 5.0],
                    _ => &[1.0],
                };
                let first = self.low.log10().floor() as i32;
                let last = self.high.log10().ceil() as i32;
                (first..=last)
                    .flat_map(|power| factors.iter().map(move |f| f * 10_f64.powi(power)))
                    .filter(|value| (self.low..=self.high * 1.000_001).contains(value))
                    .map(|value| (value, number(value, value)))
                    .collect()
            }
        }
    }
}

/// The first of 1, 2, 5, 10, … that is not smaller.
fn nice_step(least: f64) -> f64 {
    let unit = 10_f64.powf(least.log10().floor());
    let nice = [1.0, 2.0, 5.0].map(|factor| factor * unit);
    nice.into_iter()
        .find(|step| *step >= least * 0.999)
        .unwrap_or(10.0 * unit)
}

/// A number with as many digits after its point as its step needs, thousands apart.
fn number(value: f64, step: f64) -> String {
    let digits = (-step.abs().log10().floor()).max(0.0) as usize;
    let written = format!("{value:.digits$}");
    if value < 10_000.0 {
        return written;
    }
    let bytes = written.as_bytes();
    let mut grouped = String::new();
    for (index, &digit) in bytes.iter().enumerate() {
        if index > 0 && (bytes.len() - index).is_multiple_of(3) {
            grouped.push(',');
        }
        grouped.push(char::from(digit));
    }
    grouped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(ruler: &Ruler) -> Vec<String> {
        ruler.ticks().into_iter().map(|(_, name)| name).collect()
    }

    #[test]
    fn ticks_are_round() {
        let linear = Ruler::new(&Axis::from_zero(""), [0.3, 1.04]);
        assert_eq!(names(&linear), ["0.0", "0.5", "1.0"]);
        let log = Ruler::new(&Axis::log(""), [0.011, 30.0]);
        assert_eq!(names(&log), ["0.01", "0.1", "1", "10"]);
        let narrow = Ruler::new(&Axis::log(""), [1.9, 55.0]);
        assert_eq!(names(&narrow), ["2", "5", "10", "20", "50"]);
        assert_eq!(number(1_234_567.0, 1.0), "1,234,567");
    }

    #[test]
    fn an_axis_without_values_has_ticks_all_the_same() {
        for axis in [Axis::from_zero(""), Axis::log(""), Axis::default()] {
            for values in [vec![], vec![0.0]] {
                let ruler = Ruler::new(&axis, values);
                assert!(ruler.ticks().len() > 1 && ruler.share(0.0).is_finite());
            }
        }
    }

    #[test]
    fn zero_stands_where_a_logarithmic_axis_begins() {
        let axis = Axis {
            spans: vec![0.001],
            ..Axis::log("")
        };
        let ruler = Ruler::new(&axis, [0.0, 1.0]);
        assert_eq!((ruler.share(0.0), ruler.share(0.001)), (0.0, 0.0));
        assert!(ruler.share(1.0) > 0.9 && ruler.share(1.0) < 1.0);
    }
}
