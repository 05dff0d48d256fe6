//! Rooms that were kept on disk.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon::app::precomputed::room_of_bytes(bytes, &[]));
