//! Meshes: .gltf.

pub fn run(bytes: &[u8]) {
    super::mesh("a.gltf", bytes);
}
