//! True poses of sessions.

use gnomon::app::truth::TruePoses;

pub fn run(bytes: &[u8]) {
    let path = super::file("truth.json", bytes);
    let poses = path.parent().map(TruePoses::read);
    if let Some(Ok(poses)) = poses {
        let _ = poses.camera_from_anchors(0, &[]);
    }
}
