//! Light probes: .exr.

pub fn run(bytes: &[u8]) {
    super::probe("a.exr", bytes);
}
