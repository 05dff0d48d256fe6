//! What tells one state of a file from another without reading it.

use std::fs::Metadata;
use std::path::Path;

/// A file's length, time and place on the disk; of a folder only that it is one; nothing of what is not there.
#[derive(Debug, Clone)]
pub struct FileStamp(Option<Metadata>);

impl FileStamp {
    /// As it is now.
    pub fn of(path: &Path) -> Self {
        Self(std::fs::metadata(path).ok())
    }
}

impl PartialEq for FileStamp {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (Some(a), Some(b)) if a.is_dir() && b.is_dir() => true,
            (Some(a), Some(b)) => {
                a.is_dir() == b.is_dir()
                    && a.len() == b.len()
                    && a.modified().ok() == b.modified().ok()
                    && number(a) == number(b)
            }
            (None, None) => true,
            _ => false,
        }
    }
}

/// The file's own number, which one that was put in its place does not have.
#[cfg(unix)]
fn number(metadata: &Metadata) -> Option<u64> {
    Some(std::os::unix::fs::MetadataExt::ino(metadata))
}

#[cfg(not(unix))]
fn number(_: &Metadata) -> Option<u64> {
    None
}
