//! Poses that replace the tracker.

use gnomon::app::files::poses_file::GivenPoses;
use gnomon::scene::Anchor;

pub fn run(bytes: &[u8]) {
    let anchors = ["table", "card"].map(|name| Anchor {
        name: name.to_owned(),
        markers: Vec::new(),
    });
    let poses = GivenPoses::read(&super::file("poses.csv", bytes), &anchors);
    if let Ok(poses) = poses {
        let _ = poses.of_frame(0);
    }
}
