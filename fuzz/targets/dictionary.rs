//! Dictionaries of markers.

const SCENE: &str = "[tracking]\ndetector = \"aruco\"\n[[marker]]\nname = \"card\"\nfamily = \"own.yml\"\nid = 0\nsize_m = 0.03\n";

pub fn run(bytes: &[u8]) {
    super::beside("own.yml", bytes, SCENE);
}
