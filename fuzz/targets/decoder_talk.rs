//! What ffmpeg and ffprobe say of videos.

use gnomon::capture::video::log::meaning;
use gnomon::capture::video::probe::{Packets, header_of};

pub fn run(bytes: &[u8]) {
    let text = super::text(bytes);
    let _ = text.lines().map(meaning).count();
    let _ = header_of(text);
    if let Some(packets) = Packets::of_answer(text) {
        let _ = packets.between(Some(0.0), Some(1e9));
    }
}
