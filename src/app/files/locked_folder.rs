//! A folder that one run alone writes to.

use std::fs::{File, TryLockError};
use std::io;
use std::path::Path;

/// Opens a folder that is there, so that it is known again, and keeps other runs out for as long as it is open.
///
/// # Errors
/// Another run writes there; a folder that cannot be opened.
pub fn lock(path: &Path) -> io::Result<File> {
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
        Ok(()) | Err(TryLockError::Error(_)) => Ok(folder),
    }
}
