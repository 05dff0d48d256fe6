//! What targets share: bytes as files that a scene names, in a folder that each thread has to itself.

use std::cell::OnceCell;
use std::path::{Path, PathBuf};

use gnomon::scene::Scene;

thread_local! {
    static FOLDER: OnceCell<tempfile::TempDir> = const { OnceCell::new() };
}

/// What each scene begins with.
pub const CAMERA: &str = "[camera]\nsource = \"webcam:0\"\n";
const MARKER: &str = "[[marker]]\nname = \"card\"\nid = 0\nsize_m = 0.05\n";
const MESH: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

/// A file of some bytes; the last one of the same name is gone.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    FOLDER.with(|folder| {
        let folder = folder.get_or_init(|| {
            let folder = tempfile::tempdir().expect("a folder");
            // A scene that is refused for what it is would leave all files unread.
            std::fs::write(folder.path().join("good.obj"), MESH).expect("a file");
            let scene = Scene::parse(
                &folder.path().join("good.toml"),
                &scene_with_mesh("good.obj"),
            );
            assert!(
                scene.is_ok(),
                "{}",
                scene.err().map_or(String::new(), |error| error.to_string())
            );
            folder
        });
        let path = folder.path().join(name);
        if let Some(parent) = path.parent() {
            std::fs::create_dir_all(parent).expect("a folder");
        }
        std::fs::write(&path, bytes).expect("a file");
        path
    })
}

/// Reads a scene that has a virtual thing of these bytes; it may be refused, and must not panic.
pub fn mesh(name: &str, bytes: &[u8]) {
    let path = file(name, bytes);
    scene(&path.with_file_name("scene.toml"), &scene_with_mesh(name));
}

fn scene_with_mesh(name: &str) -> String {
    format!("{CAMERA}{MARKER}[[virtual]]\nname = \"thing\"\nmesh = \"{name}\"\nfit_m = 0.1\n")
}

/// Reads a scene that has a probe of these bytes.
pub fn probe(name: &str, bytes: &[u8]) {
    let path = file(name, bytes);
    let probe = format!(
        "{CAMERA}{MARKER}[probe]\nimage = \"{name}\"\nkind = \"panorama\"\nposition_m = [0, 0, 0.1]\n"
    );
    scene(&path.with_file_name("scene.toml"), &probe);
}

/// Reads a scene that is this text, after its camera, beside a file of these bytes.
pub fn beside(name: &str, bytes: &[u8], text: &str) {
    let path = file(name, bytes);
    scene(
        &path.with_file_name("scene.toml"),
        &format!("{CAMERA}{text}"),
    );
}

/// Reads a scene.
pub fn scene(path: &Path, text: &str) {
    let _ = Scene::parse(path, text);
}

/// The first byte, a digit in the seeds, as a choice of so many, and the rest.
pub fn choice(input: &[u8], of: usize) -> Option<(usize, &[u8])> {
    let (first, rest) = input.split_first()?;
    Some((usize::from(first.wrapping_sub(b'0')) % of, rest))
}

/// The bytes as text, as far as they are.
pub fn text(bytes: &[u8]) -> &str {
    match std::str::from_utf8(bytes) {
        Ok(text) => text,
        Err(error) => std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or_default(),
    }
}
