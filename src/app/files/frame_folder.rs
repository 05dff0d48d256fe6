//! A folder that frames are written to, one file each. It is one job's as long as that lasts, and what was written there
//! has to be there at the end.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use super::file_identity::is_at;
use super::locked_folder::LockedFolder;
use super::new_file::{NewFile, vanished};
use super::output_error::OutputError;

/// A folder of frames that is being written. One that it has made goes again where it got nothing.
#[derive(Debug)]
pub struct FrameFolder {
    path: PathBuf,
    /// Open, so that it is known again, and locked.
    folder: LockedFolder,
    written: BTreeSet<String>,
    /// Whether nothing was there before.
    is_new: bool,
}

impl FrameFolder {
    /// Makes the folder, or takes one that is there.
    ///
    /// # Errors
    /// One that cannot be made, or that another run writes to.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        let is_new = !path.exists();
        let open = || {
            fs::create_dir_all(path)?;
            LockedFolder::open(path)
        };
        Ok(Self {
            path: path.to_owned(),
            folder: open().map_err(|error| io_error(path, error))?,
            written: BTreeSet::new(),
            is_new,
        })
    }

    /// Writes a file, whose bytes `make` gives when it is told where.
    ///
    /// # Errors
    /// What `make` fails with; a full disk, a folder that is gone.
    pub fn put(
        &mut self,
        name: &str,
        make: impl FnOnce(&Path) -> Result<Vec<u8>, OutputError>,
    ) -> Result<(), OutputError> {
        self.check_that_it_is_there()?;
        let path = self.path.join(name);
        let mut file = NewFile::create(&path)?;
        file.write(&make(&path)?)?;
        // Waiting for the disk at each frame would take longer than all the rest; `finish` does it.
        file.finish_unsynced()?;
        self.written.insert(name.to_owned());
        Ok(())
    }

    /// Looks whether all is there, and waits until it is on the disk.
    ///
    /// # Errors
    /// A folder, or files in it, that somebody took away.
    pub fn finish(self) -> Result<(), OutputError> {
        self.check_that_it_is_there()?;
        let is_missing = |name: &&String| {
            let file = File::open(self.path.join(name));
            file.and_then(|file| file.sync_all()).is_err()
        };
        let missing = self.written.iter().filter(is_missing).count();
        if missing > 0 {
            let all = self.written.len();
            let message =
                format!("{missing} of {all} files that were written there are gone or broken");
            return Err(io_error(&self.path, io::Error::other(message)));
        }
        // Some file systems have no such thing for folders.
        _ = self.folder.sync_all();
        Ok(())
    }

    fn check_that_it_is_there(&self) -> Result<(), OutputError> {
        match is_at(&self.path, &self.folder) {
            true => Ok(()),
            false => Err(io_error(&self.path, vanished())),
        }
    }
}

impl Drop for FrameFolder {
    fn drop(&mut self) {
        if self.is_new && self.written.is_empty() && is_at(&self.path, &self.folder) {
            // What somebody else has put there keeps it.
            _ = fs::remove_dir(&self.path);
        }
    }
}

/// The name of a frame's picture: its index in the recording, six digits.
pub fn frame_name(index: u32) -> String {
    format!("{index:06}.png")
}

fn io_error(path: &Path, error: io::Error) -> OutputError {
    OutputError::Io {
        path: path.to_owned(),
        error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put(folder: &mut FrameFolder, index: u32) -> Result<(), OutputError> {
        folder.put(&frame_name(index), |_| Ok(b"x".to_vec()))
    }

    #[test]
    fn a_folder_that_got_nothing_goes_again() {
        let outer = tempfile::tempdir().unwrap();
        let path = outer.path().join("out");
        drop(FrameFolder::create(&path).unwrap());
        assert!(!path.exists());
        fs::create_dir(&path).unwrap();
        drop(FrameFolder::create(&path).unwrap());
        assert!(path.exists(), "it was there before");
    }

    #[test]
    fn what_is_taken_away_is_told() {
        let outer = tempfile::tempdir().unwrap();
        let path = outer.path().join("out");
        let mut folder = FrameFolder::create(&path).unwrap();
        put(&mut folder, 0).unwrap();
        assert!(
            FrameFolder::create(&path)
                .is_err_and(|error| error.to_string().contains("another run"))
        );
        fs::remove_dir_all(&path).unwrap();
        assert!(put(&mut folder, 1).is_err() && !path.exists());
        fs::create_dir(&path).unwrap();
        assert!(put(&mut folder, 1).is_err(), "another folder of that name");
        assert!(folder.finish().is_err());

        let mut folder = FrameFolder::create(&path).unwrap();
        put(&mut folder, 0).unwrap();
        put(&mut folder, 1).unwrap();
        fs::remove_file(path.join("000000.png")).unwrap();
        let text = folder.finish().unwrap_err().to_string();
        assert!(text.contains("1 of 2 files"), "{text}");
        let mut folder = FrameFolder::create(&path).unwrap();
        put(&mut folder, 0).unwrap();
        folder.finish().unwrap();
    }
}
