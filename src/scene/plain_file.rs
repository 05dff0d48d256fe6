//! Reading whole files that somebody else may have named: plain files alone, and no more of them than their kind ever has.

use std::fs::File;
use std::io::{self, ErrorKind, Read as _};
use std::path::Path;

/// Bytes of the largest scene, material library, dictionary, calibration or list that is read.
pub const MOST_TEXT: u64 = 64 << 20;
/// Bytes of the largest mesh that is read.
pub const MOST_MESH: u64 = 1 << 30;
/// Bytes of the largest picture that is read.
pub const MOST_PICTURE: u64 = 1 << 30;

/// All of a plain file, of no more than `most` bytes.
///
/// # Errors
/// What opening and reading say; a device, a pipe or a folder (which is not opened, for a pipe waits for somebody who
/// writes); a file that is larger.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = open(path)?;
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    // One more, for a file may grow.
    file.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most {
        let length = length.max(bytes.len() as u64);
        let message = format!("{length} bytes are too many; at most {most}");
        return Err(io::Error::new(ErrorKind::InvalidData, message));
    }
    Ok(bytes)
}

/// Opens a plain file.
///
/// # Errors
/// As [`read`] has them.
pub fn open(path: &Path) -> io::Result<File> {
    match std::fs::metadata(path)?.is_file() {
        true => File::open(path),
        false => Err(not_plain()),
    }
}

/// The error of what is no plain file.
pub fn not_plain() -> io::Error {
    io::Error::new(ErrorKind::InvalidData, "not a plain file")
}

/// The same of UTF-8 text, of no more than [`MOST_TEXT`] bytes, without the byte order mark that spreadsheets put before it.
///
/// # Errors
/// As [`read`] has them; what is not UTF-8.
pub fn read_text(path: &Path) -> io::Result<String> {
    const MARK: &[u8] = "\u{feff}".as_bytes();
    let mut bytes = read(path, MOST_TEXT)?;
    if bytes.starts_with(MARK) {
        bytes.drain(..MARK.len());
    }
    String::from_utf8(bytes)
        .map_err(|error| io::Error::new(ErrorKind::InvalidData, format!("not UTF-8 text: {error}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_files_up_to_a_size_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "twelve bytes").unwrap();
        assert_eq!(read(&path, 12).unwrap(), b"twelve bytes");
        assert_eq!(read_text(&path).unwrap(), "twelve bytes");
        let error = read(&path, 11).unwrap_err();
        assert_eq!(error.to_string(), "12 bytes are too many; at most 11");
        let missing = read(&folder.path().join("b"), 12).unwrap_err();
        assert_eq!(missing.kind(), ErrorKind::NotFound);
        std::fs::write(&path, [0xff, 0xfe]).unwrap();
        assert!(read_text(&path).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn devices_pipes_and_folders_are_not_waited_for() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        let mode = rustix::fs::Mode::RUSR | rustix::fs::Mode::WUSR;
        rustix::fs::mkfifoat(rustix::fs::CWD, &pipe, mode).unwrap();
        for path in [pipe.as_path(), folder.path(), Path::new("/dev/zero")] {
            let error = read(path, 12).unwrap_err();
            assert_eq!(error.to_string(), "not a plain file", "{}", path.display());
        }
    }
}
