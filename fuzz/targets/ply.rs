//! Meshes: .ply.

pub fn run(bytes: &[u8]) {
    super::mesh("a.ply", bytes);
}
