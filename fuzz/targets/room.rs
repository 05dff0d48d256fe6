//! Rooms that were kept on disk.
#![no_main]

gnomon_fuzz::target!(|bytes: &[u8]| gnomon::app::room_transport_cache::of_bytes(bytes, &[]));
