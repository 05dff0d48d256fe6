//! Numbers as a scene's text has them, rounded to what anyone can see or set.

use toml_edit::Value;

use crate::scene::Digits;

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
        false => digits.text(wanted),
    })
}

/// Numbers in brackets.
pub fn new_array(wanted: &[f64], digits: Digits) -> String {
    let texts: Vec<String> = wanted.iter().map(|&number| digits.text(number)).collect();
    format!("[{}]", texts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const POSITION: Digits = Digits::Decimals(4);
    const RATIO: Digits = Digits::Significant(4);

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
