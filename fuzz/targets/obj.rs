//! Meshes: .obj.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::mesh("a.obj", bytes));
