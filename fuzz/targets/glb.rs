//! Meshes: .glb.

pub fn run(bytes: &[u8]) {
    super::mesh("a.glb", bytes);
}
