//! Materials of OBJ files.
#![no_main]

const MESH: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";

gnomon_fuzz::target!(|bytes: &[u8]| {
    gnomon_fuzz::file("a.mtl", bytes);
    gnomon_fuzz::mesh("with_materials.obj", MESH)
});
