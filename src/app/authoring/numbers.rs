//! Numbers as a scene's text has them, rounded to what anyone can see or set.

use toml_edit::Value;

/// How many digits a number is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Digits {
    /// Behind the point.
    Decimals(usize),
    /// From the first that is not 0.
    Significant(i32),
}

/// 0.1 mm.
pub const POSITION: Digits = Digits::Decimals(4);
/// 0.01 mm: a print is measured with a caliper.
pub const PRINT: Digits = Digits::Decimals(5);
/// 0.01°.
pub const ANGLE: Digits = Digits::Decimals(2);
/// 0.01° of a unit vector.
pub const DIRECTION: Digits = Digits::Decimals(4);
/// Scales, brightness, milliseconds.
pub const RATIO: Digits = Digits::Significant(4);

impl Digits {
    /// The nearest number with so many digits, the very one that a reader of its text gets; never -0.
    pub fn rounded(self, number: f64) -> f64 {
        let text = match self {
            Self::Decimals(decimals) => format!("{number:.decimals$}"),
            Self::Significant(digits) => format!("{number:.*e}", digits.max(1) as usize - 1),
        };
        text.parse().unwrap_or(number) + 0.0
    }
}

/// The number that a value is.
pub fn number_of(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|integer| integer as f64))
}

/// The text that makes a written number another one; `None` where it is that one already. A whole number stays one
/// where the new one is whole as well.
pub fn changed(written: &Value, wanted: f64, digits: Digits) -> Option<String> {
    let rounded = digits.rounded(wanted);
    let number = number_of(written);
    if number == Some(wanted) || number == Some(rounded) {
        return None;
    }
    let whole = written.is_integer() && rounded.fract() == 0.0 && rounded.abs() < 1e15;
    Some(match whole {
        true => format!("{rounded:.0}"),
        false => number_text(rounded),
    })
}

/// A number of its own.
pub fn new_number(wanted: f64, digits: Digits) -> String {
    number_text(digits.rounded(wanted))
}

/// Numbers in brackets.
pub fn new_array(wanted: &[f64], digits: Digits) -> String {
    let texts: Vec<String> = wanted
        .iter()
        .map(|&number| new_number(number, digits))
        .collect();
    format!("[{}]", texts.join(", "))
}

/// The shortest that reads back as the same number, with a point or an exponent.
fn number_text(number: f64) -> String {
    format!("{number:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_what_counts() {
        assert_eq!(POSITION.rounded(0.123_449_9), 0.1234);
        assert_eq!(POSITION.rounded(-0.000_01).to_bits(), 0.0_f64.to_bits());
        assert_eq!(RATIO.rounded(0.001_234_56), 0.001_235);
        assert_eq!(RATIO.rounded(123_456.0), 123_500.0);
        assert_eq!(RATIO.rounded(0.0), 0.0);
        assert_eq!(ANGLE.rounded(359.999), 360.0);
    }

    #[test]
    fn a_number_that_stays_keeps_its_digits_and_a_whole_one_its_kind() {
        let written = |text: &str| text.parse::<Value>().unwrap();
        assert_eq!(changed(&written("0.10"), 0.1, POSITION), None);
        assert_eq!(changed(&written("0.123456"), 0.123456, POSITION), None);
        assert_eq!(changed(&written("3"), 4.0, POSITION), Some("4".to_owned()));
        assert_eq!(
            changed(&written("3"), 4.5, POSITION),
            Some("4.5".to_owned())
        );
        assert_eq!(
            changed(&written("3.0"), 4.0, POSITION),
            Some("4.0".to_owned())
        );
        assert_eq!(
            new_array(&[1.0, 1e-7, 2.5e20], RATIO),
            "[1.0, 1e-7, 2.5e20]"
        );
    }
}
