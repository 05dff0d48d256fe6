//! Poses that replace the tracker.
#![no_main]

use gnomon::app::files::poses_file::GivenPoses;
use gnomon::scene::Anchor;

gnomon_fuzz::target!(|bytes: &[u8]| {
    let anchors = ["table", "card"].map(|name| Anchor {
        name: name.to_owned(),
        markers: Vec::new(),
    });
    let poses = GivenPoses::read(&gnomon_fuzz::file("poses.csv", bytes), &anchors);
    poses.map(|poses| poses.of_frame(0))
});
