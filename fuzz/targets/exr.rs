//! Light probes: .exr.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::probe("a.exr", bytes));
