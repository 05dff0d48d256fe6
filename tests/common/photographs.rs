//! Photographs with real markers; they lie beside the project and are not shipped with it.

use std::path::{Path, PathBuf};

use gnomon::capture::Frame;

/// A folder of photographs beside the project; tests that ask for it are ignored without `cfg(has_shared)`.
pub fn photographs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/real")
        .join(name)
}

pub fn read_photograph(path: &Path) -> Frame {
    let picture = image::open(path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        .to_rgba8();
    Frame {
        index: 0,
        time_secs: 0.0,
        size_px: [picture.width(), picture.height()],
        rgba: picture.into_raw(),
    }
}

/// The PNG and JPEG files of a folder, sorted by name.
pub fn pictures_in(folder: &Path) -> Vec<PathBuf> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .unwrap_or_else(|error| panic!("{}: {error}", folder.display()))
        .map(|entry| entry.expect("a file").path())
        .filter(|path| {
            let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
            ending == "png" || ending == "jpg"
        })
        .collect();
    files.sort();
    files
}
