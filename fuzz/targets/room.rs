//! Rooms that were kept on disk.

pub fn run(bytes: &[u8]) {
    let _ = gnomon::app::precomputed::room_of_bytes(bytes, &[]);
}
