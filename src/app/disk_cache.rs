//! Values that take long to work out, kept in files by what they were made from. What cannot be read or written is worked out
//! again; nothing is lost by deleting the folder.

use std::fs;
use std::hash::{DefaultHasher, Hasher};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use crate::scene::plain_file;

/// A folder of values of one kind.
#[derive(Debug, Clone)]
pub struct DiskCache {
    /// The folder; `None`: nothing is kept.
    pub folder: Option<PathBuf>,
    /// How the files' names end.
    pub extension: &'static str,
    /// Another layout, or another way to work values out.
    pub version: u32,
    /// Bytes of the largest file that is read.
    pub most_bytes: u64,
    /// So many files stay, the newest ones.
    pub most_files: usize,
}

impl DiskCache {
    /// The file of what was made from something with that key.
    pub fn path(&self, key: u64) -> Option<PathBuf> {
        let folder = self.folder.as_ref()?;
        Some(folder.join(format!("{key:016x}.{}", self.extension)))
    }

    /// A value that was kept; `None` where there is none, or it is damaged.
    pub fn read<T: DeserializeOwned>(&self, key: u64) -> Option<T> {
        let bytes = plain_file::read(&self.path(key)?, self.most_bytes).ok()?;
        let (sum, contents) = bytes.split_at_checked(size_of::<u64>())?;
        if sum != checksum(contents) {
            return None;
        }
        self.decoded(contents)
    }

    /// A value of a file's contents behind their checksum; `None` where they are none, or of another version.
    pub fn decoded<T: DeserializeOwned>(&self, contents: &[u8]) -> Option<T> {
        let (version, value): (u32, T) = postcard::from_bytes(contents).ok()?;
        (version == self.version).then_some(value)
    }

    /// Keeps a value, whole or not at all; a full disk keeps nothing.
    pub fn keep<T: Serialize>(&self, key: u64, value: &T) {
        let Some(path) = self.path(key) else {
            return;
        };
        // What is not kept is worked out again.
        let _ = self.write(&path, value);
    }

    fn write<T: Serialize>(&self, path: &Path, value: &T) -> Option<()> {
        let folder = path.parent()?;
        fs::create_dir_all(folder).ok()?;
        let bytes = postcard::to_stdvec(&(self.version, value)).ok()?;
        let mut file = tempfile::NamedTempFile::new_in(folder).ok()?;
        file.write_all(&checksum(&bytes)).ok()?;
        file.write_all(&bytes).ok()?;
        file.persist(path).ok()?;
        self.forget_oldest(folder)
    }

    fn forget_oldest(&self, folder: &Path) -> Option<()> {
        let entries = fs::read_dir(folder).ok()?.flatten();
        let is_of_kind = |path: &Path| path.extension().is_some_and(|it| it == self.extension);
        let mut files: Vec<_> = entries
            .filter(|entry| is_of_kind(&entry.path()))
            .filter_map(|entry| Some((entry.metadata().ok()?.modified().ok()?, entry.path())))
            .collect();
        files.sort();
        let surplus = files.len().saturating_sub(self.most_files);
        for (_, path) in &files[..surplus] {
            fs::remove_file(path).ok()?;
        }
        Some(())
    }
}

fn checksum(bytes: &[u8]) -> [u8; 8] {
    let mut hasher = DefaultHasher::new();
    hasher.write(bytes);
    hasher.finish().to_le_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_read_as_they_were_kept_and_the_oldest_are_forgotten() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = |version, most_bytes| DiskCache {
            folder: Some(folder.path().join("kept")),
            extension: "numbers",
            version,
            most_bytes,
            most_files: 2,
        };
        let ours = cache(1, 1000);
        let value = vec![1.5f32, -2.0];
        assert_eq!(ours.read::<Vec<f32>>(7), None);
        ours.keep(7, &value);
        assert_eq!(ours.read(7), Some(value.clone()));
        assert_eq!(cache(2, 1000).read::<Vec<f32>>(7), None);
        assert_eq!(cache(1, 4).read::<Vec<f32>>(7), None);
        let path = ours.path(7).expect("a folder");
        let whole = fs::read(&path).expect("the file");
        for damaged in [&whole[..whole.len() - 1], &whole[..5], &[]] {
            fs::write(&path, damaged).expect("written");
            assert_eq!(ours.read::<Vec<f32>>(7), None);
        }
        for key in 8..12 {
            ours.keep(key, &value);
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        let left: Vec<bool> = (7..12)
            .map(|key| ours.read::<Vec<f32>>(key).is_some())
            .collect();
        assert_eq!(left, [false, false, false, true, true]);
        let nowhere = DiskCache {
            folder: None,
            ..ours
        };
        nowhere.keep(7, &value);
        assert_eq!(nowhere.read::<Vec<f32>>(7), None);
    }
}
