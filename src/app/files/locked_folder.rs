//! A folder that one run alone writes to.

use std::fs::{File, TryLockError};
use std::io;
use std::ops::Deref;
use std::path::Path;

/// An open folder, which is known again by it, and which other runs are kept out of until it is dropped.
#[derive(Debug)]
pub struct LockedFolder(File);

impl LockedFolder {
    /// Opens a folder that is there.
    ///
    /// # Errors
    /// Another run writes there; a folder that cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut how = File::options();
        how.read(true);
        // Windows opens folders only if it is told so (FILE_FLAG_BACKUP_SEMANTICS).
        #[cfg(windows)]
        std::os::windows::fs::OpenOptionsExt::custom_flags(&mut how, 0x0200_0000);
        let folder = how.open(path)?;
        match folder.try_lock() {
            Err(TryLockError::WouldBlock) => Err(io::Error::new(
                io::ErrorKind::ResourceBusy,
                "another run writes there",
            )),
            // Some file systems know no locks.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self(folder)),
        }
    }
}

impl Deref for LockedFolder {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl Drop for LockedFolder {
    fn drop(&mut self) {
        // Closing alone leaves it locked for as long as a program that is just being started has the file open too.
        _ = self.0.unlock();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_one_runs_until_it_is_dropped_whoever_else_has_it_open() {
        let folder = tempfile::tempdir().unwrap();
        let locked = LockedFolder::open(folder.path()).unwrap();
        let refused = LockedFolder::open(folder.path()).unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::ResourceBusy);
        // As a child has it between its fork and its program.
        let _inherited = locked.try_clone().unwrap();
        drop(locked);
        LockedFolder::open(folder.path()).unwrap();
    }
}
