//! One key of a scene's file.

use super::section::{AnyKey, Section};
use super::values::{Described, OfOption, Readable};
use crate::scene::error::SceneError;
use crate::scene::named_files::FileKind;
use crate::scene::quality::Quality;
use crate::scene::reader::{Table, Value};

/// All that is known of a key. What reads it, writes it, shows it and tells of it takes it from here.
pub struct Key<T: Described, M = Missing<T>> {
    /// Its name.
    pub name: &'static str,
    /// What it is, as it stands above the field; for people as well.
    pub says: &'static str,
    /// Which values it takes.
    pub takes: T::Takes,
    /// What holds where it is not there.
    pub missing: M,
}

/// A key has to be there; what is expected follows "missing".
#[derive(Debug, Clone, Copy)]
pub struct Required(pub &'static str);

/// What holds where a key is not there.
#[derive(Debug, Clone, Copy)]
pub enum Missing<T> {
    /// A value.
    Is(T),
    /// A value that does not tell by itself what it means.
    Means(T, &'static str),
    /// What the quality says; without one, what balanced does.
    ByQuality {
        /// [`Quality::Fast`].
        fast: T,
        /// [`Quality::Balanced`].
        balanced: T,
        /// [`Quality::Accurate`].
        accurate: T,
    },
}

/// A key's name with its value, as a file is to have it.
pub type NewKey = (&'static str, String);

/// A key where there is none yet.
pub fn new_key<T: Described, M>(key: &Key<T, M>, value: &T) -> NewKey {
    (key.name, key.text(value).unwrap_or_default())
}

impl<T: Described, M> Key<T, M> {
    /// The key's value in a table.
    pub fn value<'a>(&self, table: &Table<'a>) -> Option<Value<'a>> {
        table.optional(self.name)
    }

    /// A value as the file has it; `None` where it has no key for it.
    pub fn text(&self, value: &T) -> Option<String> {
        value.text(&self.takes)
    }
}

impl<T: Described> Key<T, Required> {
    /// The key's value in a table.
    pub fn require<'a>(&self, table: &Table<'a>) -> Result<Value<'a>, SceneError> {
        table.required(self.name, self.missing.0)
    }
}

impl<T: Readable> Key<T, Required> {
    /// Reads it.
    pub fn read(&self, table: &Table) -> Result<T, SceneError> {
        T::read(&self.require(table)?, &self.takes)
    }
}

impl<T: Described> Key<T> {
    /// What holds where neither it nor a quality is there.
    pub fn default(&self) -> &T {
        match &self.missing {
            Missing::Is(value)
            | Missing::Means(value, _)
            | Missing::ByQuality {
                balanced: value, ..
            } => value,
        }
    }

    /// What a quality sets it to; `None` where qualities leave it alone.
    pub fn of_quality(&self, quality: Quality) -> Option<&T> {
        let Missing::ByQuality {
            fast,
            balanced,
            accurate,
        } = &self.missing
        else {
            return None;
        };
        Some(match quality {
            Quality::Fast => fast,
            Quality::Balanced => balanced,
            Quality::Accurate => accurate,
        })
    }
}

impl<T: Readable> Key<T> {
    /// Reads it, or takes what holds without it.
    pub fn read(&self, table: &Table) -> Result<T, SceneError> {
        self.read_or(table, self.default())
    }

    /// Reads it, or takes what holds here without it.
    pub fn read_or(&self, table: &Table, default: &T) -> Result<T, SceneError> {
        self.value(table)
            .map_or(Ok(default.clone()), |value| T::read(&value, &self.takes))
    }
}

impl<T: OfOption, M> Key<T, M> {
    /// Reads what the command line's option of the same name says, which may be no more than the file.
    ///
    /// # Errors
    /// What is allowed.
    pub fn of_option(&self, text: &str) -> Result<T::Given, String> {
        T::of_option(text, &self.takes)
    }
}

/// What holds where a key is not there, of both kinds.
pub trait Absent<T>: Sync {
    /// What holds, if it may be absent.
    fn value(key: &Key<T, Self>) -> Option<&T>
    where
        T: Described,
        Self: Sized;

    /// What a quality sets it to.
    fn quality_value(key: &Key<T, Self>, quality: Quality) -> Option<&T>
    where
        T: Described,
        Self: Sized;

    /// What it means, where the value does not tell.
    fn told(&self) -> Option<&'static str>;
}

impl<T: Described> Absent<T> for Required {
    fn value(_key: &Key<T, Self>) -> Option<&T> {
        None
    }

    fn quality_value(_key: &Key<T, Self>, _quality: Quality) -> Option<&T> {
        None
    }

    fn told(&self) -> Option<&'static str> {
        None
    }
}

impl<T: Described> Absent<T> for Missing<T> {
    fn value(key: &Key<T, Self>) -> Option<&T> {
        Some(key.default())
    }

    fn quality_value(key: &Key<T, Self>, quality: Quality) -> Option<&T> {
        key.of_quality(quality)
    }

    fn told(&self) -> Option<&'static str> {
        match self {
            Self::Means(_, told) => Some(told),
            Self::Is(_) | Self::ByQuality { .. } => None,
        }
    }
}

impl<T: Described, M: Absent<T>> AnyKey for Key<T, M> {
    fn name(&self) -> &'static str {
        self.name
    }

    fn says(&self) -> String {
        let words: Vec<&str> = self.says.split_whitespace().collect();
        words.join(" ").trim_end_matches('.').to_owned()
    }

    fn told(&self) -> String {
        T::told(&self.takes)
    }

    fn words(&self) -> Vec<(&'static str, &'static str)> {
        T::words()
    }

    fn default_told(&self) -> Option<String> {
        let told = self.missing.told().map(str::to_owned);
        told.or_else(|| self.default_text())
    }

    fn default_text(&self) -> Option<String> {
        self.text(M::value(self)?)
    }

    fn quality_text(&self, quality: Quality) -> Option<String> {
        self.text(M::quality_value(self, quality)?)
    }

    fn file(&self) -> Option<FileKind> {
        T::file(&self.takes)
    }

    fn parts(&self) -> Option<&'static Section> {
        T::parts(&self.takes)
    }
}
