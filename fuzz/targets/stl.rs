//! Meshes: .stl.

pub fn run(bytes: &[u8]) {
    super::mesh("a.stl", bytes);
}
