//! Dictionaries of markers.
#![no_main]

const SCENE: &str = "[tracking]\ndetector = \"aruco\"\n[[marker]]\nname = \"card\"\nfamily = \"own.yml\"\nid = 0\nsize_m = 0.03\n";

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::beside("own.yml", bytes, SCENE));
