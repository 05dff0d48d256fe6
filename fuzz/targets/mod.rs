//! What is fuzzed: a reader each, from bytes. `fuzz/main.rs` gives it bytes that a fuzzer makes up, the tests its seeds.

mod beside_a_scene;
mod bundle;
mod calibration;
mod camera_frame;
mod decoder_talk;
mod dictionary;
mod edits;
mod exr;
mod geometry;
mod glb;
mod gltf;
mod hdr;
mod known_scene;
mod mtl;
mod obj;
mod picture;
mod ply;
mod poses;
mod poses_file;
mod response;
mod results;
mod room;
mod scene;
mod stl;
mod texture;
mod times;

use beside_a_scene::{beside, choice, file, mesh, probe, scene as read_scene, text};

/// A reader as a function of bytes: they may be refused, and must not panic.
pub type Target = fn(&[u8]);

/// All targets by their names, which those of their folders in `fuzz/seeds` are.
pub const TARGETS: [(&str, Target); 25] = [
    ("scene", scene::run),
    ("bundle", bundle::run),
    ("dictionary", dictionary::run),
    ("obj", obj::run),
    ("ply", ply::run),
    ("stl", stl::run),
    ("gltf", gltf::run),
    ("glb", glb::run),
    ("mtl", mtl::run),
    ("hdr", hdr::run),
    ("exr", exr::run),
    ("texture", texture::run),
    ("calibration", calibration::run),
    ("poses", poses::run),
    ("poses_file", poses_file::run),
    ("times", times::run),
    ("response", response::run),
    ("picture", picture::run),
    ("camera_frame", camera_frame::run),
    ("decoder_talk", decoder_talk::run),
    ("results", results::run),
    ("room", room::run),
    ("edits", edits::run),
    ("geometry", geometry::run),
    ("known_scene", known_scene::run),
];
