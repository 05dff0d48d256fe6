//! Boards from bundles of apriltag_ros, and YAML as such.

const SCENE: &str = "[[board]]\nname = \"table\"\nbundle = \"tags.yaml\"\n";

pub fn run(bytes: &[u8]) {
    super::beside("tags.yaml", bytes, SCENE);
}
