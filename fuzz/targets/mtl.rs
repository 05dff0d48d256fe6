//! Materials of OBJ files.

const MESH: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";

pub fn run(bytes: &[u8]) {
    super::file("a.mtl", bytes);
    super::mesh("with_materials.obj", MESH);
}
