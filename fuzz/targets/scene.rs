//! Scene files.

use std::path::Path;

pub fn run(bytes: &[u8]) {
    let text = super::text(bytes);
    super::read_scene(Path::new("/nowhere/scene.toml"), text);
}
