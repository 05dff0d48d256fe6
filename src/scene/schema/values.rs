//! The types that values of a scene's file are read as, each with what it is read by, written by and told by.

use std::path::PathBuf;

use glam::DVec3;

use super::choice::Choice;
use super::section::Section;
use crate::scene::error::SceneError;
use crate::scene::named_files::FileKind;
use crate::scene::ranges::{Numbers, Whole};
use crate::scene::reader::{NAMES, Value, is_name};

/// A type of values.
pub trait Described: Clone + Send + Sync + 'static {
    /// What a key says of those that it takes.
    type Takes: Sync;

    /// The value as the file has it; `None` where it has no key for it.
    fn text(&self, takes: &Self::Takes) -> Option<String>;

    /// What is allowed, in words.
    fn told(takes: &Self::Takes) -> String;

    /// Words that it may be, each with what it means.
    fn words() -> Vec<(&'static str, &'static str)> {
        Vec::new()
    }

    /// What the file is that it names.
    fn file(_takes: &Self::Takes) -> Option<FileKind> {
        None
    }

    /// The keys of a table in braces.
    fn parts(_takes: &Self::Takes) -> Option<&'static Section> {
        None
    }
}

/// A type of values that are read by themselves.
pub trait Readable: Described {
    /// Reads it.
    fn read(value: &Value, takes: &Self::Takes) -> Result<Self, SceneError>;

    /// What a word stands for that no number can say.
    fn no_limit(_takes: &Self::Takes) -> Option<&'static str> {
        None
    }
}

/// A type of values that an option of the command line takes as well.
pub trait OfOption: Described {
    /// What an option that is given says.
    type Given: Clone + Send + Sync + 'static;

    /// Reads it.
    fn of_option(text: &str, takes: &Self::Takes) -> Result<Self::Given, String>;
}

impl Described for f64 {
    type Takes = Numbers;

    fn text(&self, takes: &Numbers) -> Option<String> {
        Some(takes.digits.text(*self))
    }

    fn told(takes: &Numbers) -> String {
        takes.to_string()
    }
}

impl Readable for f64 {
    fn read(value: &Value, takes: &Numbers) -> Result<Self, SceneError> {
        value.number(takes)
    }
}

impl OfOption for f64 {
    type Given = Self;

    fn of_option(text: &str, takes: &Numbers) -> Result<Self, String> {
        let number = text.trim().parse();
        takes.check(number.map_err(|_| format!("not a number; allowed: {takes}"))?)
    }
}

impl Described for u32 {
    type Takes = Whole;

    fn text(&self, _takes: &Whole) -> Option<String> {
        Some(self.to_string())
    }

    fn told(takes: &Whole) -> String {
        takes.to_string()
    }
}

impl Readable for u32 {
    fn read(value: &Value, takes: &Whole) -> Result<Self, SceneError> {
        value.integer(takes)
    }

    fn no_limit(takes: &Whole) -> Option<&'static str> {
        takes.no_limit
    }
}

impl OfOption for u32 {
    type Given = Self;

    fn of_option(text: &str, takes: &Whole) -> Result<Self, String> {
        let number = text.trim().parse();
        takes.check(number.map_err(|_| takes.refusal())?)
    }
}

impl Described for bool {
    type Takes = ();

    fn text(&self, (): &()) -> Option<String> {
        Some(self.to_string())
    }

    fn told((): &()) -> String {
        "true or false".to_owned()
    }
}

impl Readable for bool {
    fn read(value: &Value, (): &()) -> Result<Self, SceneError> {
        value.flag()
    }
}

/// What may also be left open.
impl<T: Readable> Described for Option<T> {
    type Takes = T::Takes;

    fn text(&self, takes: &T::Takes) -> Option<String> {
        match self {
            Some(value) => value.text(takes),
            None => T::no_limit(takes).map(quoted),
        }
    }

    fn told(takes: &T::Takes) -> String {
        T::told(takes)
    }

    fn words() -> Vec<(&'static str, &'static str)> {
        T::words()
    }

    fn file(takes: &T::Takes) -> Option<FileKind> {
        T::file(takes)
    }
}

impl<T: Readable> Readable for Option<T> {
    fn read(value: &Value, takes: &T::Takes) -> Result<Self, SceneError> {
        match (T::no_limit(takes), value.text()) {
            (Some(word), Ok(written)) if word == written => Ok(None),
            _ => T::read(value, takes).map(Some),
        }
    }
}

impl<T: Readable + OfOption> OfOption for Option<T> {
    type Given = T::Given;

    fn of_option(text: &str, takes: &T::Takes) -> Result<T::Given, String> {
        T::of_option(text, takes)
    }
}

/// Which vectors a key takes.
#[derive(Debug, Clone, Copy)]
pub struct Vectors {
    /// Of each component.
    pub numbers: Numbers,
    /// Whether one number stands for three equal ones.
    is_one_enough: bool,
}

impl Vectors {
    /// Three numbers.
    pub const fn three(numbers: Numbers) -> Self {
        Self {
            numbers,
            is_one_enough: false,
        }
    }

    /// Three numbers, or one that stands for three equal ones.
    pub const fn one_or_three(numbers: Numbers) -> Self {
        Self {
            numbers,
            is_one_enough: true,
        }
    }
}

impl Described for DVec3 {
    type Takes = Vectors;

    fn text(&self, takes: &Vectors) -> Option<String> {
        let digits = takes.numbers.digits;
        Some(bracketed(self.to_array().map(|part| digits.text(part))))
    }

    fn told(takes: &Vectors) -> String {
        let one = if takes.is_one_enough {
            "a number or "
        } else {
            ""
        };
        format!("{one}three numbers, {}", takes.numbers)
    }
}

impl Readable for DVec3 {
    fn read(value: &Value, takes: &Vectors) -> Result<Self, SceneError> {
        match takes.is_one_enough {
            true => value.splat_or_vector(&takes.numbers),
            false => value.numbers(&takes.numbers).map(Self::from_array),
        }
    }
}

impl<const N: usize> Described for [f64; N] {
    type Takes = Numbers;

    fn text(&self, takes: &Numbers) -> Option<String> {
        Some(bracketed(self.map(|part| takes.digits.text(part))))
    }

    fn told(takes: &Numbers) -> String {
        format!("{N} numbers, {takes}")
    }
}

impl<const N: usize> Readable for [f64; N] {
    fn read(value: &Value, takes: &Numbers) -> Result<Self, SceneError> {
        value.numbers(takes)
    }
}

/// A width and a height.
impl Described for [u32; 2] {
    type Takes = Whole;

    fn text(&self, _takes: &Whole) -> Option<String> {
        Some(bracketed(self.map(|side| side.to_string())))
    }

    fn told(takes: &Whole) -> String {
        format!("two whole numbers, {takes}")
    }
}

impl Readable for [u32; 2] {
    fn read(value: &Value, takes: &Whole) -> Result<Self, SceneError> {
        let sides = Numbers::between(takes.least.into(), takes.most.into()).unit(takes.unit);
        let sides: [f64; 2] = value.numbers(&sides)?;
        match sides.iter().all(|side| side.fract() == 0.0) {
            true => Ok(sides.map(|side| side as u32)),
            false => Err(value.error("two whole numbers are expected: [width, height]")),
        }
    }
}

impl OfOption for [u32; 2] {
    type Given = Self;

    fn of_option(text: &str, takes: &Whole) -> Result<Self, String> {
        let sides = text.split_once('x').and_then(|(width, height)| {
            Some([width.trim().parse().ok()?, height.trim().parse().ok()?])
        });
        let [width, height] = sides.ok_or("not a size; write WIDTHxHEIGHT, as 1280x720")?;
        Ok([takes.check(width)?, takes.check(height)?])
    }
}

impl<T: Choice> Described for T {
    type Takes = ();

    fn text(&self, (): &()) -> Option<String> {
        Some(quoted(self.word()))
    }

    fn told((): &()) -> String {
        let words = T::WORDS.iter().map(|(word, _)| quoted(word));
        words.collect::<Vec<_>>().join(", ")
    }

    fn words() -> Vec<(&'static str, &'static str)> {
        let words = T::WORDS.iter().map(|(word, _)| *word);
        words.zip(T::SAYS.iter().map(|says| says.trim())).collect()
    }
}

impl<T: Choice> Readable for T {
    fn read(value: &Value, (): &()) -> Result<Self, SceneError> {
        value.one_of(T::WHAT, T::WORDS)
    }
}

impl<T: Choice> OfOption for T {
    type Given = Self;

    fn of_option(text: &str, (): &()) -> Result<Self, String> {
        let mut words = T::WORDS.iter();
        let found = words.find(|(word, _)| word.eq_ignore_ascii_case(text));
        found.map(|(_, choice)| *choice).ok_or_else(|| {
            let words: Vec<&str> = T::WORDS.iter().map(|(word, _)| *word).collect();
            format!("unknown {}; allowed: {}", T::WHAT, words.join(", "))
        })
    }
}

/// A name: a text that can stand in a message and in a column of a CSV file.
impl Described for String {
    type Takes = ();

    fn text(&self, (): &()) -> Option<String> {
        Some(quoted(self))
    }

    fn told((): &()) -> String {
        NAMES.to_owned()
    }
}

impl Readable for String {
    fn read(value: &Value, (): &()) -> Result<Self, SceneError> {
        value.name()
    }
}

impl OfOption for String {
    type Given = Self;

    fn of_option(text: &str, (): &()) -> Result<Self, String> {
        match is_name(text) {
            true => Ok(text.to_owned()),
            false => Err(format!("not a name; allowed: {NAMES}")),
        }
    }
}

/// A file that is there.
impl Described for PathBuf {
    type Takes = FileKind;

    fn text(&self, _takes: &FileKind) -> Option<String> {
        Some(quoted(self.to_str()?))
    }

    fn told(takes: &FileKind) -> String {
        takes.told()
    }

    fn file(takes: &FileKind) -> Option<FileKind> {
        Some(*takes)
    }
}

impl Readable for PathBuf {
    fn read(value: &Value, takes: &FileKind) -> Result<Self, SceneError> {
        value.existing_path(*takes)
    }
}

/// What only the rest of the scene tells how to read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Written;

/// What is known of it all the same.
#[derive(Clone, Copy)]
pub struct InWords {
    /// What is allowed.
    told: &'static str,
    /// The file that it may name.
    file: Option<FileKind>,
    /// The keys of a table in braces.
    parts: Option<&'static Section>,
}

impl InWords {
    /// A text, or whatever these words say.
    pub const fn new(told: &'static str) -> Self {
        Self {
            told,
            file: None,
            parts: None,
        }
    }

    /// The name of a file, or what the words say.
    pub const fn file(told: &'static str, file: FileKind) -> Self {
        Self {
            file: Some(file),
            ..Self::new(told)
        }
    }

    /// A table in braces, or several.
    pub const fn parts(told: &'static str, parts: &'static Section) -> Self {
        Self {
            parts: Some(parts),
            ..Self::new(told)
        }
    }
}

impl Described for Written {
    type Takes = InWords;

    fn text(&self, _takes: &InWords) -> Option<String> {
        None
    }

    fn told(takes: &InWords) -> String {
        takes.told.to_owned()
    }

    fn file(takes: &InWords) -> Option<FileKind> {
        takes.file
    }

    fn parts(takes: &InWords) -> Option<&'static Section> {
        takes.parts
    }
}

fn bracketed<const N: usize>(parts: [String; N]) -> String {
    format!("[{}]", parts.join(", "))
}

/// A text as TOML has it.
pub fn quoted(text: &str) -> String {
    toml::Value::from(text).to_string()
}
