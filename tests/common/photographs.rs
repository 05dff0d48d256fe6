//! Photographs with real markers; they lie beside the project and are not shipped with it.

use std::path::{Path, PathBuf};

use gnomon::app::truth::photographs::{self, Photographs, Still};
use gnomon::capture::Frame;

/// A folder of photographs beside the project; tests that ask for it are ignored without `cfg(has_shared)`.
pub fn photographs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../shared/real")
        .join(name)
}

/// Photographs of a name that the charts have too, with the markers that people see in them.
#[allow(dead_code)] // Each test uses its own part.
pub fn known(name: &str) -> (&'static Photographs, Vec<Still>) {
    let known = photographs::ALL.iter().find(|known| known.name == name);
    let known = known.expect("known photographs");
    let stills = known.read().unwrap_or_else(|error| panic!("{error:#}"));
    (known, stills)
}

pub fn read_photograph(path: &Path) -> Frame {
    photographs::read_picture(path).unwrap_or_else(|error| panic!("{error:#}"))
}

/// The PNG and JPEG files of a folder, sorted by name.
pub fn pictures_in(folder: &Path) -> Vec<PathBuf> {
    let names = photographs::pictures_in(folder).unwrap_or_else(|error| panic!("{error:#}"));
    names.into_iter().map(|name| folder.join(name)).collect()
}
