//! Files that get their names when they are whole: until then they have a name that nobody can foresee, in the same folder.
//! A link keeps standing and what it leads to is replaced; a device, a pipe and `-` (stdout) are written through.

use std::fs::{self, File};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::file_identity::{is_at, is_open_file, real_place};
use super::output_error::OutputError;
use super::unfinished::Unfinished;

/// What names of unfinished files begin with.
const PREFIX: &str = ".gnomon-";
/// Letters and digits that follow, so many that none is met by chance or guessed.
const RANDOM_LETTERS: usize = 16;

/// A file that is being written. Dropped before [`NewFile::finish`] it leaves nothing.
pub struct NewFile {
    /// As the user named it.
    path: PathBuf,
    target: WriteTarget,
    /// Whether nothing may be there.
    is_first: bool,
    temporary: NamedTempFile,
    // Dropped after the file is gone.
    _unfinished: Unfinished,
}

/// The place where what is written goes.
enum WriteTarget {
    /// To this place, instead of what is there.
    Place(PathBuf),
    /// Through a device, a pipe or an open file.
    Through(PathBuf),
    Stdout,
}

/// Whether a name ends as those of folders may.
pub(super) fn ends_as_folder(path: &Path) -> bool {
    let name = path.as_os_str().as_encoded_bytes();
    let last = name.last().copied().map(char::from);
    last.is_some_and(std::path::is_separator)
}

/// Whether a path stands for stdout.
pub fn is_stdout(path: &Path) -> bool {
    path.as_os_str() == "-"
}

impl NewFile {
    /// Begins a file; the folder is made where it is missing.
    ///
    /// # Errors
    /// A folder by that name, or one that cannot be made or written to.
    pub fn create(path: &Path) -> Result<Self, OutputError> {
        Self::begin(path, false)
    }

    /// Begins a file under a name that nothing has, not even a link; whatever gets that name meanwhile stays.
    ///
    /// # Errors
    /// As [`NewFile::create`], and something of that name.
    pub fn create_first(path: &Path) -> Result<Self, OutputError> {
        match fs::symlink_metadata(path) {
            Ok(_) => Err(io_error(path, is_there())),
            Err(_) => Self::begin(path, true),
        }
    }

    fn begin(path: &Path, is_first: bool) -> Result<Self, OutputError> {
        let create = || -> io::Result<Self> {
            let target = WriteTarget::of(path)?;
            let folder = match &target {
                WriteTarget::Place(place) => place.parent().unwrap_or(Path::new("/")).to_owned(),
                WriteTarget::Through(_) | WriteTarget::Stdout => std::env::temp_dir(),
            };
            fs::create_dir_all(&folder)?;
            let mut suffix = std::ffi::OsString::new();
            if let Some(extension) = path.extension() {
                suffix.push(".");
                suffix.push(extension);
            }
            let mut builder = tempfile::Builder::new();
            builder
                .prefix(PREFIX)
                .rand_bytes(RANDOM_LETTERS)
                .suffix(&suffix);
            // The rights that any new file gets.
            #[cfg(unix)]
            builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
            let (temporary, unfinished) = Unfinished::begin(
                || builder.tempfile_in(&folder),
                |temporary| {
                    let place = temporary.path().to_owned();
                    // Nobody is left to be told of a failure.
                    Box::new(move || _ = fs::remove_file(place))
                },
            )?;
            Ok(Self {
                path: path.to_owned(),
                target,
                is_first,
                temporary,
                _unfinished: unfinished,
            })
        };
        create().map_err(|error| io_error(path, error))
    }

    /// Adds bytes at its end.
    ///
    /// # Errors
    /// A full disk.
    pub fn write(&mut self, bytes: &[u8]) -> Result<(), OutputError> {
        let written = self.temporary.as_file_mut().write_all(bytes);
        written.map_err(|error| io_error(&self.path, error))
    }

    /// The name that it has until it is finished, for other programs to write to.
    pub fn temporary_path(&self) -> &Path {
        self.temporary.path()
    }

    /// Whether it has not been moved or removed since.
    pub fn is_there(&self) -> bool {
        is_at(self.temporary.path(), self.temporary.as_file())
    }

    /// Waits until all is on the disk, and gives it its name.
    ///
    /// # Errors
    /// A full disk, or a folder that is gone: there is then no such file, or what was there before.
    pub fn finish(self) -> Result<(), OutputError> {
        let path = self.path.clone();
        let sync = |file: &File| file.sync_all();
        (self.put(sync).map(|place| sync_folder(place.as_deref())))
            .map_err(|error| io_error(&path, error))
    }

    /// Gives it its name; that all is on the disk is somebody else's to wait for, as where many files are written.
    ///
    /// # Errors
    /// As [`NewFile::finish`].
    pub fn finish_unsynced(self) -> Result<(), OutputError> {
        let path = self.path.clone();
        let put = self.put(|_| Ok(()));
        put.map(|_| ()).map_err(|error| io_error(&path, error))
    }

    /// The folder that it lies in now.
    fn put(mut self, sync: impl FnOnce(&File) -> io::Result<()>) -> io::Result<Option<PathBuf>> {
        match self.target {
            WriteTarget::Place(place) => {
                if !is_at(self.temporary.path(), self.temporary.as_file()) {
                    return Err(vanished());
                }
                if let Ok(before) = fs::metadata(&place) {
                    // The one who may write here need not own it: rights that cannot be set are no reason to fail.
                    _ = self
                        .temporary
                        .as_file()
                        .set_permissions(before.permissions());
                }
                sync(self.temporary.as_file())?;
                match self.is_first {
                    true => self.temporary.persist_noclobber(&place),
                    false => self.temporary.persist(&place),
                }
                .map_err(|failed| match failed.error.kind() {
                    io::ErrorKind::AlreadyExists => is_there(),
                    _ => failed.error,
                })?;
                return Ok(place.parent().map(Path::to_owned));
            }
            WriteTarget::Through(place) => {
                // Appending does no harm to a device, and none to what an open file has already.
                let mut device = File::options().append(true).open(place)?;
                copy_from_start(self.temporary.as_file_mut(), &mut device)?;
            }
            WriteTarget::Stdout => {
                copy_from_start(self.temporary.as_file_mut(), &mut io::stdout().lock())?;
            }
        }
        Ok(None)
    }
}

impl WriteTarget {
    fn of(path: &Path) -> io::Result<Self> {
        if is_stdout(path) {
            return Ok(Self::Stdout);
        }
        let place = real_place(path)?;
        match fs::metadata(&place) {
            Ok(there) if there.is_dir() => Err(io::ErrorKind::IsADirectory.into()),
            Ok(there) if there.is_file() && !is_open_file(&place) => Ok(Self::Place(place)),
            Ok(_) => Ok(Self::Through(place)),
            Err(_) => Ok(Self::Place(place)),
        }
    }
}

/// What a file or a folder is when somebody took it away meanwhile.
pub fn vanished() -> io::Error {
    io::Error::new(
        io::ErrorKind::NotFound,
        "it was moved or removed while it was being written; what was written is lost",
    )
}

/// Waits until names in a folder are on the disk, where the system can.
pub fn sync_folder(folder: Option<&Path>) {
    if let Some(Ok(folder)) = folder.map(File::open) {
        // Some file systems have no such thing for folders.
        _ = folder.sync_all();
    }
}

fn copy_from_start(from: &mut File, to: &mut impl io::Write) -> io::Result<()> {
    from.rewind()?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        match from.read(&mut buffer)? {
            0 => return to.flush(),
            count => to.write_all(&buffer[..count])?,
        }
    }
}

fn is_there() -> io::Error {
    let kind = io::ErrorKind::AlreadyExists;
    io::Error::new(kind, "a file of that name is there already, and stays")
}

fn io_error(path: &Path, error: io::Error) -> OutputError {
    OutputError::Io {
        path: path.to_owned(),
        error,
    }
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::os::unix::fs::{PermissionsExt as _, symlink};

    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn write(path: &Path, text: &str) -> Result<(), OutputError> {
        let mut file = NewFile::create(path)?;
        file.write(text.as_bytes())?;
        file.finish()
    }

    #[test]
    fn a_name_is_for_what_is_whole_and_no_other_file_is_touched() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.csv");
        let mut file = NewFile::create(&path).unwrap();
        file.write(b"half").unwrap();
        let temporary = file.temporary_path().to_owned();
        assert!(temporary.starts_with(path.parent().unwrap()) && !path.exists());
        assert_eq!(temporary.extension(), path.extension());
        drop(file);
        assert_eq!(names_in(path.parent().unwrap()), [""; 0]);
        write(&path, "whole").unwrap();
        write(&path, "again").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "again");
        assert_eq!(names_in(path.parent().unwrap()), ["a.csv"]);
    }

    #[test]
    fn links_stay_and_rights_stay() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("real.csv"), "old").unwrap();
        fs::set_permissions(at("real.csv"), fs::Permissions::from_mode(0o640)).unwrap();
        symlink("real.csv", at("link.csv")).unwrap();
        symlink("deep/none.csv", at("dangling.csv")).unwrap();
        write(&at("link.csv"), "new").unwrap();
        write(&at("dangling.csv"), "new").unwrap();
        assert!(at("link.csv").is_symlink() && at("dangling.csv").is_symlink());
        for name in ["real.csv", "deep/none.csv"] {
            assert_eq!(fs::read_to_string(at(name)).unwrap(), "new");
        }
        let mode = fs::metadata(at("real.csv")).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);
    }

    #[test]
    fn devices_stay_devices() {
        use std::os::unix::fs::FileTypeExt as _;
        write(Path::new("/dev/null"), "nothing").unwrap();
        let null = fs::metadata("/dev/null").unwrap().file_type();
        assert!(null.is_char_device());
    }

    #[test]
    fn what_somebody_took_away_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out/a.csv");
        let file = NewFile::create(&path).unwrap();
        let temporary = file.temporary_path().to_owned();
        fs::remove_dir_all(folder.path().join("out")).unwrap();
        let text = file.finish().unwrap_err().to_string();
        assert!(text.contains("a.csv: "), "{text}");
        assert!(!path.exists());

        let file = NewFile::create(&path).unwrap();
        let planted = file.temporary_path().to_owned();
        assert_ne!(planted, temporary);
        fs::remove_file(&planted).unwrap();
        fs::write(&planted, "not ours").unwrap();
        assert!(file.finish().is_err());
        assert!(!path.exists());
    }
}
