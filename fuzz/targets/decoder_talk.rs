//! What ffmpeg and ffprobe say of videos.
#![no_main]

use gnomon::capture::video::log::meaning;
use gnomon::capture::video::probe::{Packets, header_of};

gnomon_fuzz::target!(|text: &str| {
    let _ = text.lines().map(meaning).count();
    let _ = header_of(text);
    Packets::of_answer(text).map(|packets| packets.between(Some(0.0), Some(1e9)))
});
