//! A table of a scene's file.

use crate::scene::error::SceneError;
use crate::scene::named_files::FileKind;
use crate::scene::quality::Quality;
use crate::scene::reader::{Table, Value};

/// A table with all keys that may stand in it.
pub struct Section {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub says: &'static str,
    /// How often it may be there.
    pub times: Times,
    /// Its keys, in groups that other tables may have as well.
    pub groups: &'static [&'static [&'static dyn AnyKey]],
    /// What the reference shows for keys: their defaults without this.
    pub shown: &'static [(&'static str, Example)],
    /// Whether the reference has it in a comment alone, since a scene needs more with it than others have.
    pub is_aside: bool,
}

/// How often a table may be there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Times {
    /// Just once: `[name]`.
    Once,
    /// Once, or it is not there.
    UpToOnce,
    /// As `[[name]]`.
    Any,
    /// In braces, as a key's value.
    InBraces,
}

/// What the reference shows for a key.
#[derive(Debug, Clone, Copy)]
pub enum Example {
    /// A value, as TOML.
    Live(&'static str),
    /// A value in a comment: the default is another one.
    Aside(&'static str),
}

impl Section {
    /// Its keys.
    pub fn keys(&self) -> impl Iterator<Item = &'static dyn AnyKey> {
        self.groups.iter().flat_map(|group| group.iter().copied())
    }

    /// The line that it begins with.
    pub fn head(&self) -> String {
        match self.times {
            Times::Any => format!("[[{}]]", self.name),
            Times::Once | Times::UpToOnce | Times::InBraces => format!("[{}]", self.name),
        }
    }

    /// The names of its keys, each once: one may belong to several groups.
    pub fn names(&self) -> Vec<&'static str> {
        let mut names: Vec<&'static str> = Vec::new();
        for key in self.keys() {
            if !names.contains(&key.name()) {
                names.push(key.name());
            }
        }
        names
    }

    /// The one table of this name, whose keys are all known; `None` where it is not there.
    pub fn table<'a>(&self, root: &Table<'a>) -> Result<Option<Table<'a>>, SceneError> {
        let value = root.optional(self.name);
        value.map(|value| self.table_of(&value)).transpose()
    }

    /// All tables of this name, whose keys are all known.
    pub fn tables<'a>(&self, root: &Table<'a>) -> Result<Vec<Table<'a>>, SceneError> {
        root.tables(self.name, &self.names())
    }

    /// A value that is such a table.
    pub fn table_of<'a>(&self, value: &Value<'a>) -> Result<Table<'a>, SceneError> {
        value.table(&self.names())
    }
}

/// A key whatever its type.
pub trait AnyKey: Sync {
    /// Its name.
    fn name(&self) -> &'static str;

    /// What it is, without a full stop.
    fn says(&self) -> String;

    /// What it takes, in words.
    fn told(&self) -> String;

    /// Words that it takes, each with what it means.
    fn words(&self) -> Vec<(&'static str, &'static str)>;

    /// What holds without it, in words; `None` where it has to be there.
    fn default_told(&self) -> Option<String>;

    /// What holds without it, as the file has it.
    fn default_text(&self) -> Option<String>;

    /// What a quality sets it to, as the file has it.
    fn quality_text(&self, quality: Quality) -> Option<String>;

    /// What the file is that it names.
    fn file(&self) -> Option<FileKind>;

    /// The keys of a table in braces.
    fn parts(&self) -> Option<&'static Section>;

    /// Help for the command line's option of the same name.
    fn help(&self) -> String {
        let default = self.default_told();
        let default = default.map_or(String::new(), |told| format!("; default {told}"));
        format!("{} ({}{default})", self.says(), self.told())
    }
}
