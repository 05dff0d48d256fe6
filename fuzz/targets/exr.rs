//! Light probes: .exr.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| gnomon_fuzz::probe("a.exr", bytes));
