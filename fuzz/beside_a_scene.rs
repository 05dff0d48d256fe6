//! What all targets share: bytes as files that a scene names, in a folder that each process has to itself.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use gnomon::scene::Scene;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

const WORLD: &str = "[[marker]]\nname = \"card\"\nid = 0\nsize_m = 0.05\n";

/// A file of some bytes; the last one of the same name is gone.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| tempfile::tempdir().expect("a folder"));
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("a file");
        path
    })
}

/// Reads a scene that has a virtual thing of these bytes; it may be refused, and must not panic.
pub fn mesh(name: &str, bytes: &[u8]) {
    let path = file(name, bytes);
    let thing = format!("{WORLD}[[virtual]]\nname = \"thing\"\nmesh = \"{name}\"\nfit_m = 0.1\n");
    scene(&path.with_file_name("scene.toml"), &thing);
}

/// Reads a scene that has a probe of these bytes.
pub fn probe(name: &str, bytes: &[u8]) {
    let path = file(name, bytes);
    let probe = format!("{WORLD}[probe]\nimage = \"{name}\"\nkind = \"panorama\"\nposition_m = [0, 0, 0.1]\n");
    scene(&path.with_file_name("scene.toml"), &probe);
}

/// Reads a scene.
pub fn scene(path: &Path, text: &str) {
    let _ = Scene::parse(path, text);
}
