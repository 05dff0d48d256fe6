//! Reads values from a TOML file's spanned tree; each mistake knows its place and what is allowed there.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::ops::Range;
use std::path::{Path, PathBuf};

use glam::DVec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{SceneError, TextPlace, suggestion};
use super::model_cache::ModelCache;
use super::named_files::{FileKind, NamedFile};
use super::ranges::{Numbers, Whole};

/// A TOML file's text and where it came from.
pub struct Document<'a> {
    pub path: &'a Path,
    pub text: &'a str,
    /// Models that were read before, where they are kept.
    models: Option<&'a ModelCache>,
    /// Files that were read, or looked for, on the way.
    consulted: RefCell<BTreeSet<PathBuf>>,
    /// Files that the text names.
    named: RefCell<Vec<NamedFile>>,
}

impl<'a> Document<'a> {
    pub fn new(path: &'a Path, text: &'a str, models: Option<&'a ModelCache>) -> Self {
        Self {
            path,
            text,
            models,
            consulted: RefCell::default(),
            named: RefCell::default(),
        }
    }

    /// Files that were read, or looked for, so far; and those that the text names, by their place in it.
    pub fn files(self) -> (Vec<PathBuf>, Vec<NamedFile>) {
        let mut named = self.named.into_inner();
        named.sort_by_key(|file| file.span.start);
        (self.consulted.into_inner().into_iter().collect(), named)
    }

    /// A mistake at a span of the text.
    pub fn error(&self, span: Range<usize>, message: impl Into<String>) -> SceneError {
        SceneError::at(self.path, self.text, span, message)
    }
}

/// A table with the name that messages give it, all of whose keys are known.
#[derive(Clone)]
pub struct Table<'a> {
    document: &'a Document<'a>,
    name: String,
    span: Range<usize>,
    keys: &'a DeTable<'a>,
}

/// A value with the name that messages give it.
#[derive(Clone)]
pub struct Value<'a> {
    document: &'a Document<'a>,
    name: String,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Table<'a> {
    /// The file's outermost table.
    pub fn root(
        document: &'a Document<'a>,
        root: &'a Spanned<DeTable<'a>>,
        allowed: &[&str],
    ) -> Result<Self, SceneError> {
        // A key that is missing in the whole file has its place at the file's start.
        let table = Self {
            document,
            name: String::new(),
            span: 0..0,
            keys: root.get_ref(),
        };
        table.allow(allowed)?;
        Ok(table)
    }

    /// Refuses keys other than these.
    pub fn allow(&self, allowed: &[&str]) -> Result<(), SceneError> {
        self.allow_or(allowed, |_| None)
    }

    /// Refuses keys other than these, and says `instead` of one that it knows more of.
    pub fn allow_or(
        &self,
        allowed: &[&str],
        instead: impl Fn(&str) -> Option<String>,
    ) -> Result<(), SceneError> {
        let unknown = self
            .keys
            .keys()
            .find(|key| !allowed.contains(&key.get_ref().as_ref()));
        let Some(key) = unknown else { return Ok(()) };
        let name = self.name_of(key.get_ref());
        let says = match instead(key.get_ref()) {
            Some(instead) => format!("{instead}; allowed: {}", allowed.join(", ")),
            None => format!("unknown key{}", suggestion(key.get_ref(), allowed)),
        };
        let message = format!("{name}: {says}");
        Err(self.document.error(key.span(), message))
    }

    pub fn optional(&self, key: &str) -> Option<Value<'a>> {
        let value = self.keys.get(key)?;
        Some(Value {
            document: self.document,
            name: self.name_of(key),
            value,
        })
    }

    /// A key that must be there; `what` it is follows "missing".
    pub fn required(&self, key: &str, what: &str) -> Result<Value<'a>, SceneError> {
        self.optional(key)
            .ok_or_else(|| self.error(format!("{}: missing; {what}", self.name_of(key))))
    }

    /// A table of its own, with these keys.
    pub fn table(&self, key: &str, allowed: &[&str]) -> Result<Option<Table<'a>>, SceneError> {
        self.optional(key)
            .map(|value| value.table(allowed))
            .transpose()
    }

    /// The tables of `[[key]]`, with these keys; none where it is missing.
    pub fn tables(&self, key: &str, allowed: &[&str]) -> Result<Vec<Table<'a>>, SceneError> {
        let Some(value) = self.optional(key) else {
            return Ok(Vec::new());
        };
        if value.value.get_ref().is_table() {
            return Err(
                value.error_without_value(format!("may occur more than once: write [[{key}]]"))
            );
        }
        value
            .array("tables")?
            .iter()
            .map(|entry| entry.table(allowed))
            .collect()
    }

    /// A mistake of the table as a whole, at its head.
    pub fn error(&self, message: impl Into<String>) -> SceneError {
        self.document.error(self.span.clone(), message)
    }

    fn name_of(&self, key: &str) -> String {
        match self.name.as_str() {
            "" => key.to_owned(),
            name => format!("{name}.{key}"),
        }
    }
}

/// What [`is_name`] allows.
pub const NAMES: &str =
    "a text without commas, semicolons, quotes and line breaks, and without spaces at its ends";

/// Whether a text can be the name of an anchor or a thing.
pub fn is_name(text: &str) -> bool {
    let unfit = |c: char| c.is_control() || matches!(c, ',' | ';' | '"');
    !text.is_empty() && text.trim() == text && !text.contains(unfit)
}

impl<'a> Value<'a> {
    /// `name = value: message`, at the value.
    pub fn error(&self, message: impl Display) -> SceneError {
        let written = self
            .document
            .text
            .get(self.value.span())
            .unwrap_or_default();
        let mut shown: String = written.chars().take(60).collect();
        if shown.len() < written.len() {
            shown.push('…');
        }
        self.document.error(
            self.value.span(),
            format!("{} = {shown}: {message}", self.name),
        )
    }

    /// `name: message`, at the value.
    pub fn error_without_value(&self, message: impl Display) -> SceneError {
        self.document
            .error(self.value.span(), format!("{}: {message}", self.name))
    }

    /// `file:line:column`.
    pub fn location(&self) -> String {
        let place = TextPlace::of_span(self.document.text, self.value.span());
        format!(
            "{}:{}:{}",
            self.document.path.display(),
            place.line,
            place.column
        )
    }

    /// The line that the value begins on, from 1.
    pub fn line(&self) -> usize {
        self.document
            .text
            .get(..self.value.span().start)
            .unwrap_or_default()
            .matches('\n')
            .count()
            + 1
    }

    pub fn table(&self, allowed: &[&str]) -> Result<Table<'a>, SceneError> {
        let keys = self
            .value
            .get_ref()
            .as_table()
            .ok_or_else(|| self.wrong_type("a table"))?;
        let table = Table {
            document: self.document,
            name: self.name.clone(),
            span: self.value.span(),
            keys,
        };
        table.allow(allowed)?;
        Ok(table)
    }

    /// Whether it is in brackets.
    pub fn is_array(&self) -> bool {
        self.value.get_ref().is_array()
    }

    /// The entries of an array of `what`.
    pub fn array(&self, what: &str) -> Result<Vec<Value<'a>>, SceneError> {
        let entries = self
            .value
            .get_ref()
            .as_array()
            .ok_or_else(|| self.wrong_type(&format!("an array of {what}")))?;
        Ok(entries
            .iter()
            .map(|value| Value {
                document: self.document,
                name: self.name.clone(),
                value,
            })
            .collect())
    }

    pub fn text(&self) -> Result<&'a str, SceneError> {
        self.value
            .get_ref()
            .as_str()
            .ok_or_else(|| self.wrong_type("a text in quotes"))
    }

    /// A name: a text that can stand in a message and in a column of a CSV file.
    pub fn name(&self) -> Result<String, SceneError> {
        let name = self.text()?;
        if !is_name(name) {
            return Err(self.error(format!("not a name; allowed: {NAMES}")));
        }
        Ok(name.to_owned())
    }

    pub fn flag(&self) -> Result<bool, SceneError> {
        self.value
            .get_ref()
            .as_bool()
            .ok_or_else(|| self.wrong_type("true or false"))
    }

    pub fn integer(&self, allowed: &Whole) -> Result<u32, SceneError> {
        let integer = match self.value.get_ref() {
            DeValue::Integer(integer) => integer,
            DeValue::String(_) if allowed.no_limit.is_some() => {
                return Err(self.error(allowed.refusal()));
            }
            _ => return Err(self.wrong_type("a whole number")),
        };
        // Too large for the type is out of the range as well.
        let parsed = u32::from_str_radix(integer.as_str(), integer.radix());
        let checked = parsed.map_err(|_| allowed.refusal());
        checked
            .and_then(|number| allowed.check(number))
            .map_err(|refusal| self.error(refusal))
    }

    pub fn number(&self, allowed: &Numbers) -> Result<f64, SceneError> {
        let parsed = match self.value.get_ref() {
            DeValue::Integer(integer) => i64::from_str_radix(integer.as_str(), integer.radix())
                .ok()
                .map(|number| number as f64),
            DeValue::Float(float) => float.as_str().parse().ok(),
            _ => return Err(self.wrong_type("a number")),
        };
        allowed
            .check(parsed.unwrap_or(f64::NAN))
            .map_err(|refusal| self.error(refusal))
    }

    /// Just `N` numbers in brackets.
    pub fn numbers<const N: usize>(&self, allowed: &Numbers) -> Result<[f64; N], SceneError> {
        let what = format!("{N} numbers in brackets");
        let entries = self
            .value
            .get_ref()
            .as_array()
            .ok_or_else(|| self.wrong_type(&what))?;
        if entries.len() != N {
            return Err(self.error(format!("{} entries; {what} are expected", entries.len())));
        }
        let mut numbers = [0.0; N];
        for (number, entry) in numbers.iter_mut().zip(self.array("numbers")?) {
            *number = entry.number(allowed)?;
        }
        Ok(numbers)
    }

    /// Three numbers, or one that stands for three equal ones.
    pub fn splat_or_vector(&self, allowed: &Numbers) -> Result<DVec3, SceneError> {
        match self.value.get_ref() {
            DeValue::Array(_) => self.numbers(allowed).map(DVec3::from_array),
            DeValue::Integer(_) | DeValue::Float(_) => self.number(allowed).map(DVec3::splat),
            _ => Err(self.wrong_type("a number or 3 numbers in brackets")),
        }
    }

    /// One of a few words, `what` it is called in a message.
    pub fn one_of<T: Copy>(&self, what: &str, words: &[(&str, T)]) -> Result<T, SceneError> {
        let written = self.text()?;
        let found = words.iter().find(|(word, _)| *word == written);
        found.map(|(_, meaning)| *meaning).ok_or_else(|| {
            let allowed: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            self.error(format!("unknown {what}{}", suggestion(written, &allowed)))
        })
    }

    /// A file or folder that exists: relative to the scene file's folder, or else to that one's parent (the project's
    /// root where scenes lie in `config/`). The document remembers that it is named here.
    pub fn existing_path(&self, kind: FileKind) -> Result<PathBuf, SceneError> {
        let written = self.text()?;
        let scene_file = std::path::absolute(self.document.path)
            .unwrap_or_else(|_| self.document.path.to_owned());
        let folders = scene_file.ancestors().skip(1).take(2);
        let tried: Vec<PathBuf> = folders.map(|folder| folder.join(written)).collect();
        let found = tried.iter().find(|path| {
            self.note_consulted(path);
            !written.is_empty() && path.exists()
        });
        if let Some(path) = found {
            self.document.named.borrow_mut().push(NamedFile {
                kind,
                path: path.clone(),
                span: self.value.span(),
            });
        }
        found.cloned().ok_or_else(|| {
            let mut tried: Vec<String> = tried
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            tried.dedup();
            self.error(format!(
                "no such file or folder; looked for {}",
                tried.join(" and ")
            ))
        })
    }

    /// Models that were read before, where they are kept.
    pub fn models(&self) -> Option<&'a ModelCache> {
        self.document.models
    }

    /// Remembers a file on which what the value means depends, whether it is there or not.
    pub fn note_consulted(&self, path: &Path) {
        let mut consulted = self.document.consulted.borrow_mut();
        consulted.insert(path.to_owned());
    }

    fn wrong_type(&self, expected: &str) -> SceneError {
        self.error(format!(
            "{expected} is expected, this is {}",
            article(self.value.get_ref().type_str())
        ))
    }
}

fn article(noun: &str) -> String {
    let vowel = noun.starts_with(['a', 'e', 'i', 'o', 'u']);
    format!("{} {noun}", if vowel { "an" } else { "a" })
}
