//! Which file a path means, whatever it is called: links followed, and known again by the file system's own numbers.

use std::ffi::OsStr;
use std::fs::{self, File, Metadata};
use std::io;
use std::path::{Component, Path, PathBuf};

/// Links after which a path is taken for a circle, as Linux does.
const MOST_LINKS: u32 = 40;

/// A file or a folder. Two are equal if writing to one changes the other.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum FileIdentity {
    /// Of what is there (Unix): the device and the number on it, which hard links share.
    #[cfg(unix)]
    There {
        /// The file system.
        device: u64,
        /// Its number on it.
        inode: u64,
    },
    /// Where it will be, without links.
    Place(PathBuf),
}

impl FileIdentity {
    /// What a path means, through links; also where nothing is yet.
    ///
    /// # Errors
    /// Links in a circle, or a working folder that is gone.
    pub fn of(path: &Path) -> io::Result<Self> {
        if let Ok(metadata) = fs::metadata(path) {
            return Self::of_metadata(path, &metadata);
        }
        // Folders that are made on the way make a way of `new/../there`.
        let place = real_place(path)?;
        match fs::metadata(&place) {
            Ok(metadata) => Self::of_metadata(&place, &metadata),
            Err(_) => Ok(Self::Place(place)),
        }
    }

    /// Of a file that is open under this name.
    ///
    /// # Errors
    /// What the system says.
    pub fn of_file(path: &Path, file: &File) -> io::Result<Self> {
        Self::of_metadata(path, &file.metadata()?)
    }

    #[cfg(unix)]
    fn of_metadata(_path: &Path, metadata: &Metadata) -> io::Result<Self> {
        use std::os::unix::fs::MetadataExt as _;
        Ok(Self::There {
            device: metadata.dev(),
            inode: metadata.ino(),
        })
    }

    #[cfg(not(unix))]
    fn of_metadata(path: &Path, _metadata: &Metadata) -> io::Result<Self> {
        path.canonicalize().map(Self::Place)
    }

    /// Of this process's own output.
    #[cfg(unix)]
    pub fn of_stdout() -> io::Result<Self> {
        use std::os::fd::AsFd as _;
        let stdout = io::stdout().as_fd().try_clone_to_owned()?;
        Self::of_file(Path::new("-"), &File::from(stdout))
    }

    /// Of this process's own output.
    #[cfg(not(unix))]
    pub fn of_stdout() -> io::Result<Self> {
        Ok(Self::Place(PathBuf::from("-")))
    }
}

/// Whether an open file is still what a path means.
pub fn is_at(path: &Path, file: &File) -> bool {
    let own = FileIdentity::of_file(path, file).ok();
    own.is_some() && own == FileIdentity::of(path).ok()
}

/// A path without links, `.` and `..`, as the system takes it; also where the file, or the folders before it, are not there
/// yet.
///
/// # Errors
/// Links in a circle, or a working folder that is gone.
pub fn real_place(path: &Path) -> io::Result<PathBuf> {
    let mut real = match path.is_absolute() {
        true => PathBuf::new(),
        false => std::env::current_dir()?,
    };
    follow(&mut real, path, &mut 0)?;
    Ok(real)
}

fn follow(real: &mut PathBuf, path: &Path, links: &mut u32) -> io::Result<()> {
    for component in path.components() {
        match component {
            // These begin anew.
            Component::Prefix(_) | Component::RootDir => real.push(component),
            Component::CurDir => {}
            // What is before has no links any more.
            Component::ParentDir => _ = real.pop(),
            Component::Normal(name) => match fs::read_link(real.join(name)) {
                Ok(target) if !is_descriptor(real) => {
                    *links += 1;
                    if *links > MOST_LINKS {
                        return Err(io::Error::other("links lead in a circle"));
                    }
                    follow(real, &target, links)?;
                }
                _ => real.push(name),
            },
        }
    }
    Ok(())
}

/// Whether a folder is Linux's list of a process's open files, whose links name what has no path.
fn is_descriptor(folder: &Path) -> bool {
    folder.starts_with("/proc") && folder.file_name() == Some(OsStr::new("fd"))
}

/// Whether a real place is an open file of a process (`/dev/stdout` leads to one): to be written through.
pub fn is_open_file(place: &Path) -> bool {
    place.parent().is_some_and(is_descriptor)
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn one_file_is_one_file_by_any_name() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir_all(at("a/b")).unwrap();
        fs::write(at("a/file"), "x").unwrap();
        fs::hard_link(at("a/file"), at("hard")).unwrap();
        symlink("a/file", at("soft")).unwrap();
        symlink("a/b", at("short")).unwrap();
        symlink("none/yet", at("dangling")).unwrap();
        symlink("circle", at("circle")).unwrap();
        let of = |name: &str| FileIdentity::of(&at(name)).unwrap();
        for same in ["hard", "soft", "a/b/../file", "a/./file", "short/../file"] {
            assert_eq!(of("a/file"), of(same), "{same}");
        }
        assert_ne!(of("a/file"), of("a/b"));
        for (one, other) in [
            ("dangling", "none/yet"),
            ("new", "new/deep/../../new"),
            ("short/new", "a/b/new"),
            ("a/new", "short/../new"),
        ] {
            assert_eq!(of(one), of(other), "{one}");
        }
        assert_ne!(of("new"), of("a/new"));
        assert!(FileIdentity::of(&at("circle")).is_err());
        assert_eq!(of("a/file"), of("new/../a/file"));
    }
}
