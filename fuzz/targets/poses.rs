//! True poses of sessions.
#![no_main]

use gnomon::app::truth::TruePoses;

gnomon_fuzz::target!(|bytes: &[u8]| {
    let path = gnomon_fuzz::file("truth.json", bytes);
    let poses = path.parent().map(TruePoses::read);
    if let Some(Ok(poses)) = poses {
        let _ = poses.camera_from_anchors(0, &[]);
    }
});
