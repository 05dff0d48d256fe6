//! Which numbers a key takes, in which unit, and how finely they are written.

use std::fmt::{self, Display};

/// How many digits a number is worth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Digits {
    /// Behind the point.
    Decimals(usize),
    /// From the first that is not 0.
    Significant(i32),
}

impl Digits {
    /// The nearest number with so many digits, the very one that a reader of its text gets; never -0.
    pub fn rounded(self, number: f64) -> f64 {
        let text = match self {
            Self::Decimals(decimals) => format!("{number:.decimals$}"),
            Self::Significant(digits) => format!("{number:.*e}", digits.max(1) as usize - 1),
        };
        text.parse().unwrap_or(number) + 0.0
    }

    /// The shortest text that reads back as the rounded number, with a point or an exponent.
    pub fn text(self, number: f64) -> String {
        format!("{:?}", self.rounded(number))
    }
}

/// Numbers from a least to a most.
#[derive(Debug, Clone, Copy)]
pub struct Numbers {
    /// The least.
    pub least: f64,
    /// The largest.
    pub most: f64,
    /// Whether `least` itself is refused.
    is_above: bool,
    /// Whether the range is that of a number's size, and its sign is free.
    is_mirrored: bool,
    /// Empty where they have none.
    pub unit: &'static str,
    /// How finely they are written.
    pub digits: Digits,
}

impl Numbers {
    /// Both ends among them; four digits are enough, unless more is said.
    pub const fn between(least: f64, most: f64) -> Self {
        Self {
            least,
            most,
            is_above: false,
            is_mirrored: false,
            unit: "",
            digits: Digits::Significant(4),
        }
    }

    /// Without the lower end.
    pub const fn above(least: f64, most: f64) -> Self {
        Self {
            is_above: true,
            ..Self::between(least, most)
        }
    }

    /// Numbers whose size is in the range; what is negative mirrors.
    pub const fn of_size(least: f64, most: f64) -> Self {
        Self {
            is_mirrored: true,
            ..Self::between(least, most)
        }
    }

    /// The same with a unit.
    pub const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// The same, written otherwise.
    pub const fn digits(self, digits: Digits) -> Self {
        Self { digits, ..self }
    }

    /// The same in another unit, of which `factor` make one of theirs.
    pub const fn scaled(self, factor: f64, unit: &'static str) -> Self {
        Self {
            least: self.least * factor,
            most: self.most * factor,
            unit,
            ..self
        }
    }

    /// The number where it is one of them.
    ///
    /// # Errors
    /// What is wrong with it, and what is allowed.
    pub fn check(&self, number: f64) -> Result<f64, String> {
        if !number.is_finite() {
            return Err(format!("not a finite number; allowed: {self}"));
        }
        let size = if self.is_mirrored {
            number.abs()
        } else {
            number
        };
        let is_low = size < self.least || self.is_above && size == self.least;
        match is_low || size > self.most {
            true => Err(format!("out of range; allowed: {self}")),
            false => Ok(number),
        }
    }

    /// What a person may set it to, in steps of `step`: the nearest number of the range.
    pub fn nearest(&self, number: f64, step: f64) -> f64 {
        let least = if self.is_above {
            self.least + step
        } else {
            self.least
        };
        match self.is_mirrored && number.is_sign_negative() {
            true => number.clamp(-self.most, -least),
            false => number.clamp(least, self.most),
        }
    }
}

impl Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            least, most, unit, ..
        } = self;
        if *least == f64::MIN && *most == f64::MAX {
            return write!(f, "any");
        }
        match self.is_above {
            true => write!(f, "above {least}, up to {most}")?,
            false => write!(f, "{least} to {most}")?,
        }
        if !unit.is_empty() {
            write!(f, " {unit}")?;
        }
        match self.is_mirrored {
            true => write!(f, " in size; a negative one mirrors"),
            false => Ok(()),
        }
    }
}

/// Whole numbers from a least to a most.
#[derive(Debug, Clone, Copy)]
pub struct Whole {
    /// The least.
    pub least: u32,
    /// The largest.
    pub most: u32,
    /// Of these alone, if there are any.
    pub steps: &'static [u32],
    /// Empty where they have none.
    pub unit: &'static str,
    /// The word that stands for no limit, where there is one.
    pub no_limit: Option<&'static str>,
    /// What such a number is, where "out of range" does not tell.
    what: &'static str,
}

impl Whole {
    /// Both ends among them.
    pub const fn between(least: u32, most: u32) -> Self {
        Self {
            least,
            most,
            steps: &[],
            unit: "",
            no_limit: None,
            what: "",
        }
    }

    /// A few numbers in rising order, called `what` in a message.
    pub const fn one_of(what: &'static str, steps: &'static [u32]) -> Self {
        Self {
            steps,
            what,
            ..Self::between(0, u32::MAX)
        }
    }

    /// The same, and a word for no limit; a number is called `what` in a message.
    pub const fn or(self, word: &'static str, what: &'static str) -> Self {
        Self {
            no_limit: Some(word),
            what,
            ..self
        }
    }

    /// The same with a unit.
    pub const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// The number where it is one of them.
    ///
    /// # Errors
    /// What is allowed.
    pub fn check(&self, number: u32) -> Result<u32, String> {
        let is_step = self.steps.is_empty() || self.steps.contains(&number);
        match (self.least..=self.most).contains(&number) && is_step {
            true => Ok(number),
            false => Err(self.refusal()),
        }
    }

    /// What a value is told that is none of them.
    pub fn refusal(&self) -> String {
        match self.what {
            "" => format!("out of range; allowed: {self}"),
            what => format!("not a {what}; allowed: {self}"),
        }
    }
}

impl Display for Whole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.steps {
            [] => write!(f, "{} to {}", self.least, self.most)?,
            steps => {
                let steps: Vec<String> = steps.iter().map(u32::to_string).collect();
                write!(f, "{}", steps.join(", "))?;
            }
        }
        if !self.unit.is_empty() {
            write!(f, " {}", self.unit)?;
        }
        match self.no_limit {
            Some(word) => write!(f, ", or \"{word}\""),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_what_counts() {
        let (position, ratio, angle) = (
            Digits::Decimals(4),
            Digits::Significant(4),
            Digits::Decimals(2),
        );
        assert_eq!(position.rounded(0.123_449_9), 0.1234);
        assert_eq!(position.rounded(-0.000_01).to_bits(), 0.0_f64.to_bits());
        assert_eq!(ratio.rounded(0.001_234_56), 0.001_235);
        assert_eq!(ratio.rounded(123_456.0), 123_500.0);
        assert_eq!(ratio.rounded(0.0), 0.0);
        assert_eq!(angle.rounded(359.999), 360.0);
        assert_eq!(ratio.text(1e-7), "1e-7");
    }

    #[test]
    fn what_a_person_sets_is_always_allowed() {
        for numbers in [
            Numbers::between(1.0, 8.0),
            Numbers::above(0.0, 1e6).unit("ms"),
            Numbers::of_size(1e-6, 1e6),
        ] {
            for number in [-1e9, -1.0, -0.0, 0.0, 0.5, 1e9] {
                let set = numbers.nearest(number, 0.1);
                assert_eq!(numbers.check(set), Ok(set), "{number} of {numbers}");
            }
        }
        assert!(Numbers::between(0.0, 1.0).check(f64::NAN).is_err());
        assert_eq!(Whole::one_of("step", &[1, 4]).to_string(), "1, 4");
        let refused = Whole::between(1, 9).or("all", "number").check(0);
        assert_eq!(
            refused,
            Err("not a number; allowed: 1 to 9, or \"all\"".to_owned())
        );
    }
}
