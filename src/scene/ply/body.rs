//! The numbers of a PLY file, one after the other, in words or in bytes.

use super::PlyError;
use super::header::{Format, Scalar};

/// What is left to read.
pub struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    format: Format,
}

impl<'a> Body<'a> {
    /// All from a byte on.
    pub fn new(bytes: &'a [u8], at: usize, format: Format) -> Self {
        Self { bytes, at, format }
    }

    /// Bytes that are left.
    pub fn left(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// The next number.
    pub fn next(&mut self, scalar: Scalar) -> Result<f64, PlyError> {
        match self.format {
            Format::Text => self.word(),
            Format::LittleEndian => self.number(scalar, false),
            Format::BigEndian => self.number(scalar, true),
        }
    }

    /// What is wrong here.
    pub fn error(&self, message: impl Into<String>) -> PlyError {
        let message = message.into();
        match self.format {
            Format::Text => PlyError {
                line: Some(self.line()),
                message,
            },
            _ => PlyError {
                line: None,
                message: format!("byte {}: {message}", self.at),
            },
        }
    }

    fn line(&self) -> usize {
        let before = &self.bytes[..self.at];
        let newlines = before.iter().filter(|byte| **byte == b'\n').count();
        let returns = before.iter().filter(|byte| **byte == b'\r').count();
        newlines.max(returns) + 1
    }

    fn word(&mut self) -> Result<f64, PlyError> {
        let rest = &self.bytes[self.at..];
        let blank = rest.iter().position(|byte| !byte.is_ascii_whitespace());
        let Some(blank) = blank else {
            return Err(self.error("the file ends before its last element"));
        };
        self.at += blank;
        let rest = &rest[blank..];
        let end = rest.iter().position(u8::is_ascii_whitespace);
        let word = &rest[..end.unwrap_or(rest.len())];
        let number = std::str::from_utf8(word).ok().and_then(parsed);
        let number = number.ok_or_else(|| {
            let shown: String = String::from_utf8_lossy(word).chars().take(40).collect();
            self.error(format!("{shown} is not a number"))
        })?;
        self.at += word.len();
        Ok(number)
    }

    fn number(&mut self, scalar: Scalar, is_big: bool) -> Result<f64, PlyError> {
        let mut bytes = [0; 8];
        let count = scalar.bytes();
        let Some(written) = self.bytes[self.at..].get(..count) else {
            return Err(self.error("the file ends before its last element"));
        };
        bytes[..count].copy_from_slice(written);
        if is_big {
            bytes[..count].reverse();
        }
        self.at += count;
        let [a, b, c, d, ..] = bytes;
        Ok(match scalar {
            Scalar::I8 => f64::from(a as i8),
            Scalar::U8 => f64::from(a),
            Scalar::I16 => f64::from(i16::from_le_bytes([a, b])),
            Scalar::U16 => f64::from(u16::from_le_bytes([a, b])),
            Scalar::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Scalar::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Scalar::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Scalar::F64 => f64::from_le_bytes(bytes),
        })
    }
}

/// A number; what some write for none is NaN.
fn parsed(word: &str) -> Option<f64> {
    let lower = word.to_ascii_lowercase();
    let is_none = lower.contains("nan") || lower.contains("#ind") || lower.contains("#inf");
    word.parse().ok().or(is_none.then_some(f64::NAN))
}
