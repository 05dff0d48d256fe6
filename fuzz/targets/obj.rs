//! Meshes: .obj.

pub fn run(bytes: &[u8]) {
    super::mesh("a.obj", bytes);
}
