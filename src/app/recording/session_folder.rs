//! The folder of a session that is being written: new, or in the place of an older session that waits until the new one
//! has a frame.

use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tempfile::TempDir;

use super::scene_copy::{SCENE_NAME, copy_folders};
use crate::app::files::LockedFolder;
use crate::app::files::is_at;
use crate::app::files::job_files::Replacing;
use crate::app::files::output_error::OutputError;
use crate::app::files::unfinished::Unfinished;

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
    begun: Arc<Mutex<Begun>>,
    // Dropped after what it takes back is settled.
    _unfinished: Unfinished,
}

/// What there is of a session until it is settled what becomes of it.
#[derive(Debug)]
struct Begun {
    path: PathBuf,
    /// Open, so that it is known again, and locked.
    folder: LockedFolder,
    /// Holds the older session.
    older: Option<TempDir>,
    kept: bool,
    is_settled: bool,
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
        let make =
            || Begun::make(path, replacing, io_error).map(|begun| Arc::new(Mutex::new(begun)));
        let (begun, unfinished) = Unfinished::begin(make, |begun| {
            let begun = Arc::clone(begun);
            Box::new(move || locked(&begun).settle_at_once())
        })?;
        Ok(Self {
            path: path.to_owned(),
            begun,
            _unfinished: unfinished,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The session has a frame: it stays, and an older one goes; unless somebody took the session away.
    pub fn keep(&mut self) {
        locked(&self.begun).keep();
    }
}

impl Drop for SessionFolder {
    fn drop(&mut self) {
        locked(&self.begun).settle();
    }
}

fn locked(begun: &Mutex<Begun>) -> MutexGuard<'_, Begun> {
    begun.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Begun {
    fn make(
        path: &Path,
        replacing: Replacing,
        io_error: impl Fn(io::Error) -> OutputError,
    ) -> Result<Self, OutputError> {
        fs::create_dir_all(path).map_err(&io_error)?;
        let mut folder = LockedFolder::open(path).map_err(&io_error)?;
        let names = names_in(path).map_err(&io_error)?;
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
                    older = Some(set_aside(path).map_err(&io_error)?);
                    folder = LockedFolder::open(path).map_err(&io_error)?;
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
            is_settled: false,
        })
    }

    fn keep(&mut self) {
        self.kept = is_at(&self.path, &self.folder);
    }

    /// Nothing more is written, and no time is left to see what the video shows: an encoder writes a cluster of frames as a
    /// whole.
    fn settle_at_once(&mut self) {
        if has_cluster(&self.path.join(VIDEO_NAME)) {
            self.keep();
        }
        self.settle();
    }

    fn settle(&mut self) {
        if std::mem::replace(&mut self.is_settled, true) {
            return;
        }
        if self.kept {
            drop(self.older.take());
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

/// Whether frames of a Matroska file are on the disk: the head of a cluster is.
fn has_cluster(video: &Path) -> bool {
    const CLUSTER: [u8; 4] = [0x1f, 0x43, 0xb6, 0x75];
    /// All that stands before it is less.
    const MOST_HEAD: u64 = 1 << 16;
    let mut head = Vec::new();
    let read = File::open(video).and_then(|file| file.take(MOST_HEAD).read_to_end(&mut head));
    read.is_ok() && head.windows(CLUSTER.len()).any(|bytes| bytes == CLUSTER)
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
