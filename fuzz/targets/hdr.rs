//! Light probes: .hdr.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::probe("a.hdr", bytes));
