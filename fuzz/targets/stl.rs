//! Meshes: .stl.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::mesh("a.stl", bytes));
