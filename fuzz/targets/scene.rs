//! Scene files.
#![no_main]

use std::path::Path;

libfuzzer_sys::fuzz_target!(|text: &str| {
    gnomon_fuzz::scene(Path::new("/nowhere/scene.toml"), text);
});
