//! Files get their names when they are whole; until then they have another.

use std::path::{Path, PathBuf};

use super::output_error::OutputError;

/// The name under which a file is written before it is whole: `lamp.mp4` as `lamp.partial.mp4`.
pub(super) fn partial_path(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!("{stem}.partial.{extension}"))
}

/// Makes the folder that `path` is to lie in.
pub(super) fn make_parent(path: &Path) -> Result<(), OutputError> {
    let Some(parent) = path
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty())
    else {
        return Ok(());
    };
    std::fs::create_dir_all(parent).map_err(|error| OutputError::Io {
        path: parent.to_owned(),
        error,
    })
}
