//! The folder of a session that is being written: new, or in the place of an older session that waits until the new one
//! has a frame.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use super::scene_copy::{SCENE_NAME, copy_folders};
use crate::app::files::is_at;
use crate::app::files::job_files::Replacing;
use crate::app::files::lock;
use crate::app::files::output_error::OutputError;

/// A session's video.
pub(super) const VIDEO_NAME: &str = "video.mkv";
/// Files of a session.
const FILES: [&str; 5] = [
    VIDEO_NAME,
    "times.csv",
    "poses.csv",
    "camera.toml",
    SCENE_NAME,
];

/// A session's folder. Dropped before [`SessionFolder::keep`] all that the session has is removed, and an older one is back.
#[derive(Debug)]
pub struct SessionFolder {
    path: PathBuf,
    /// Open, so that it is known again, and locked.
    folder: File,
    /// Holds the older session.
    older: Option<TempDir>,
    kept: bool,
}

impl SessionFolder {
    /// Makes the folder, or takes one that is empty, or whose session may be replaced.
    ///
    /// # Errors
    /// A folder that holds something, that another run records into, or that cannot be made.
    pub fn create(path: &Path, replacing: Replacing) -> Result<Self, OutputError> {
        let io_error = |error| OutputError::Io {
            path: path.to_owned(),
            error,
        };
        fs::create_dir_all(path).map_err(io_error)?;
        let mut folder = lock(path).map_err(io_error)?;
        let names = names_in(path).map_err(io_error)?;
        let mut older = None;
        if let Some(first) = names.first() {
            let foreign = names.iter().find(|name| !is_of_session(name));
            let message = match (replacing, foreign) {
                (Replacing::OlderResults, _) => {
                    format!(
                        "the folder holds something already ({first}); a recording takes a new one"
                    )
                }
                (Replacing::Anything, Some(foreign)) => format!(
                    "the folder holds something already that is no part of a session ({foreign}); a recording takes a new one"
                ),
                (Replacing::Anything, None) => {
                    older = Some(set_aside(path).map_err(io_error)?);
                    folder = lock(path).map_err(io_error)?;
                    String::new()
                }
            };
            if older.is_none() {
                return Err(OutputError::Session {
                    path: path.to_owned(),
                    message,
                });
            }
        }
        Ok(Self {
            path: path.to_owned(),
            folder,
            older,
            kept: false,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The session has a frame: it stays, and an older one goes; unless somebody took the session away.
    pub fn keep(&mut self) {
        self.kept = is_at(&self.path, &self.folder);
    }
}

impl Drop for SessionFolder {
    fn drop(&mut self) {
        if self.kept {
            return;
        }
        if is_at(&self.path, &self.folder) {
            // Nobody can play it. What is not the session's stays, and so does its folder.
            for name in FILES {
                _ = fs::remove_file(self.path.join(name));
            }
            for name in copy_folders() {
                _ = fs::remove_dir_all(self.path.join(name));
            }
            _ = fs::remove_dir(&self.path);
        }
        if let Some(older) = self.older.take() {
            let is_back =
                !self.path.exists() && fs::rename(older.path().join(OLDER), &self.path).is_ok();
            if !is_back {
                // Rather hidden than lost.
                _ = older.keep();
            }
        }
    }
}

/// The older session's name meanwhile.
const OLDER: &str = "older";

/// Moves a folder into a hidden one beside it, and makes an empty one in its place.
fn set_aside(path: &Path) -> io::Result<TempDir> {
    let place = path.canonicalize()?;
    let aside = tempfile::Builder::new()
        .prefix(".gnomon-")
        .tempdir_in(place.parent().unwrap_or(Path::new("/")))?;
    fs::rename(&place, aside.path().join(OLDER))?;
    match fs::create_dir(&place) {
        Ok(()) => Ok(aside),
        Err(error) => {
            if fs::rename(aside.path().join(OLDER), &place).is_err() {
                // Rather hidden than lost.
                _ = aside.keep();
            }
            Err(error)
        }
    }
}

fn names_in(path: &Path) -> io::Result<Vec<String>> {
    let entries = fs::read_dir(path)?;
    let names: io::Result<Vec<String>> = entries
        .map(|entry| Ok(entry?.file_name().to_string_lossy().into_owned()))
        .collect();
    let mut names = names?;
    names.sort();
    Ok(names)
}

fn is_of_session(name: &str) -> bool {
    FILES.contains(&name) || copy_folders().any(|folder| folder == name)
}
