//! Pictures on things: PNG, JPEG and WebP, by their first bytes.
#![no_main]

const MESH: &[u8] = b"mtllib pictured.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl a\nf 1/1 2/1 3/1\n";

gnomon_fuzz::target!(|bytes: &[u8]| {
    let name = match bytes {
        [0xff, ..] => "a.jpg",
        [b'R', ..] => "a.webp",
        _ => "a.png",
    };
    gnomon_fuzz::file(name, bytes);
    gnomon_fuzz::file("pictured.mtl", format!("newmtl a\nmap_Kd {name}\n").as_bytes());
    gnomon_fuzz::mesh("pictured.obj", MESH);
});
