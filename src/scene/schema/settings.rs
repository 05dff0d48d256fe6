//! Settings that are read from a table's keys, and what changes in them.

use super::key::{Key, Missing};
use super::values::Described;
use crate::scene::error::SceneError;
use crate::scene::quality::Quality;
use crate::scene::reader::Table;

/// A struct with a field for each of a table's keys; `settings!` makes it.
pub trait Settings: Sized {
    /// Reads the keys that a table has; the rest is as `default` has it.
    fn read(table: &Table, default: &Self) -> Result<Self, SceneError>;

    /// With all that a quality sets; the rest stays.
    fn at_quality(self, quality: Quality) -> Self;

    /// With what differs between two others, as the second has it; the rest stays.
    fn with_changes(self, from: &Self, to: &Self) -> Self;

    /// The keys by which one becomes the other. `given` is what the quality means, where that is another one.
    fn changed_keys(from: &Self, to: &Self, given: Option<&Self>) -> Vec<KeyChange>;
}

/// What becomes of a key.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyChange {
    /// Its name.
    pub key: &'static str,
    /// Its value as the file has it; `None` where the key goes.
    pub text: Option<String>,
}

impl<T: Described + PartialEq> Key<T> {
    /// What becomes of it where a value becomes another. What another quality says itself goes (`given`), what it does not
    /// say stands.
    pub fn change(&self, from: &T, to: &T, given: Option<&T>) -> Option<KeyChange> {
        let given = given.filter(|_| matches!(self.missing, Missing::ByQuality { .. }));
        let text = match given {
            Some(given) if to == given => None,
            None if from == to => return None,
            _ => self.text(to),
        };
        Some(KeyChange {
            key: self.name,
            text,
        })
    }
}
