//! Boards from bundles of apriltag_ros, and YAML as such.
#![no_main]

const SCENE: &str = "[[board]]\nname = \"table\"\nbundle = \"tags.yaml\"\n";

gnomon_fuzz::target!(|bytes: &[u8]| gnomon_fuzz::beside("tags.yaml", bytes, SCENE));
