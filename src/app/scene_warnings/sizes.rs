//! Things whose size is hardly meant: most of them have another unit than metres.

use glam::DVec3;

use crate::scene::Object;

/// The longest side of what may stand on a table, metres.
const USUAL_M: [f64; 2] = [1e-3, 10.0];
/// Units that files are written in, with their length in metres.
const UNITS: [(&str, f64); 4] = [
    ("millimetres", 1e-3),
    ("centimetres", 1e-2),
    ("inches", 0.0254),
    ("kilometres", 1e3),
];
/// A longest side that a thing on a table often has, metres.
const LIKELY_M: [f64; 2] = [5e-3, 2.0];

/// The sides of the smallest box around an object in its anchor's space, metres.
pub fn sides_m(object: &Object) -> DVec3 {
    let bounds = object.bounds_in_anchor();
    bounds.map_or(DVec3::ZERO, |bounds| bounds.high - bounds.low)
}

/// What there is to warn of.
pub fn warning(object: &Object) -> Option<String> {
    let longest_m = sides_m(object).max_element();
    if !object.visible || (USUAL_M[0]..=USUAL_M[1]).contains(&longest_m) {
        return None;
    }
    let likely = UNITS
        .iter()
        .find(|(_, unit_m)| (LIKELY_M[0]..=LIKELY_M[1]).contains(&(longest_m * unit_m)));
    let advice = match likely {
        Some((unit, unit_m)) => {
            format!(
                "if its file is in {unit}, write scale = {unit_m}; or its longest side as fit_m"
            )
        }
        None => "write its longest side as fit_m".to_owned(),
    };
    Some(format!(
        "\"{}\" is {} long: {advice}",
        object.name,
        length(longest_m)
    ))
}

/// A length in a unit that suits it.
pub fn length(length_m: f64) -> String {
    let (number, unit) = match length_m {
        _ if length_m >= 1.0 => (length_m, "m"),
        _ if length_m >= 0.01 => (length_m * 100.0, "cm"),
        _ => (length_m * 1e3, "mm"),
    };
    let decimals = (2 - number.max(1e-6).log10().floor() as i32).clamp(0, 6) as usize;
    let text = format!("{number:.decimals$}");
    let text = match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => &text,
    };
    format!("{text} {unit}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_have_three_digits() {
        let told = [60.0, 1.5, 0.12345, 0.06, 0.0012, 1e-4].map(length);
        assert_eq!(
            told,
            ["60 m", "1.5 m", "12.3 cm", "6 cm", "1.2 mm", "0.1 mm"]
        );
    }
}
