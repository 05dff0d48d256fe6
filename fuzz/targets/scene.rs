//! Scene files.
#![no_main]

use std::path::Path;

gnomon_fuzz::target!(|text: &str| {
    gnomon_fuzz::scene(Path::new("/nowhere/scene.toml"), text);
});
