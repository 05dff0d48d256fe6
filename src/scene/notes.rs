//! What of a file is passed over or taken for something else.

use std::path::Path;

use super::error::TextPlace;

/// As many different notes of one file are told.
const MOST_NOTES: usize = 20;

/// Notes of a file, each with the place that it is about first.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Notes {
    notes: Vec<Note>,
    /// Of further kinds.
    others: usize,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct Note {
    place: String,
    message: String,
    count: usize,
}

impl Notes {
    /// Adds what there is to say of a place in a text; said once where it is said more than once.
    pub fn add_at(&mut self, path: &Path, text: &str, at: usize, message: impl Into<String>) {
        self.add(message.into(), || {
            let line = TextPlace::of_span(text, at..at + 1).line;
            format!("{}:{line}", path.display())
        });
    }

    /// Adds what there is to say of a whole file.
    pub fn add_of(&mut self, path: &Path, message: impl Into<String>) {
        self.add(message.into(), || path.display().to_string());
    }

    fn add(&mut self, message: String, place: impl Fn() -> String) {
        if let Some(known) = self.notes.iter_mut().find(|note| note.message == message) {
            known.count += 1;
        } else if self.notes.len() < MOST_NOTES {
            self.notes.push(Note {
                place: place(),
                message,
                count: 1,
            });
        } else {
            self.others += 1;
        }
    }

    /// One sentence each, with file and line.
    pub fn told(&self) -> Vec<String> {
        let told = self.notes.iter().map(|note| {
            let Note {
                place,
                message,
                count,
            } = note;
            match count {
                1 => format!("{place}: {message}"),
                _ => format!("{place}: {message} (and {} more such)", count - 1),
            }
        });
        let others = (self.others > 0).then(|| format!("and {} more notes", self.others));
        told.chain(others).collect()
    }
}
