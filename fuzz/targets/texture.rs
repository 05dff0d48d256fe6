//! Pictures on things: PNG, JPEG and WebP, by their first bytes.

const MESH: &[u8] =
    b"mtllib pictured.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";

pub fn run(bytes: &[u8]) {
    let name = match bytes {
        [0xff, ..] => "a.jpg",
        [b'R', ..] => "a.webp",
        _ => "a.png",
    };
    super::file(name, bytes);
    super::file(
        "pictured.mtl",
        format!("newmtl a\nmap_Kd {name}\n").as_bytes(),
    );
    super::mesh("pictured.obj", MESH);
}
