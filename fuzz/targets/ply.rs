//! Meshes: .ply.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| gnomon_fuzz::mesh("a.ply", bytes));
