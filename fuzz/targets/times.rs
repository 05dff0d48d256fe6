//! Times of a session's frames.

use gnomon::capture::FrameSource;

const PICTURE: &[u8] = b"P6 1 1 255\n\0\0\0";

pub fn run(bytes: &[u8]) {
    super::file("session/000000.ppm", PICTURE);
    let path = super::file("session/times.csv", bytes);
    let folder = path.parent().and_then(|folder| folder.to_str());
    let source = folder.map(FrameSource::open);
    if let Some(Ok(mut source)) = source {
        assert!(source.fps() > 0.0 && source.fps().is_finite());
        let frame = source.next_frame();
        assert!(frame.is_ok_and(|frame| frame.is_some_and(|frame| frame.time_secs.is_finite())));
    }
}
