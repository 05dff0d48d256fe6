//! Light probes: .hdr.

pub fn run(bytes: &[u8]) {
    super::probe("a.hdr", bytes);
}
