//! Raw frames with their times as a Matroska stream (RFC 9559): what an encoder reads from a pipe. A frame is a cluster of
//! its own, so nothing is known beforehand and nothing is held back.

use std::io::{self, Write};

/// Nanoseconds of a tick of the stream's time stamps: finer than those of any container that is written.
const TICK_NANOS: u64 = 1000;
/// Size of an element that ends when the stream does.
const UNKNOWN_SIZE: [u8; 8] = [0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff];

/// The beginning of a stream of 8-bit RGBA with a nominal rate.
pub(super) fn write_head(out: &mut impl Write, size_px: [u32; 2], fps: f64) -> io::Result<()> {
    let number = |id: &[u8], value: u64| element(id, &value.to_be_bytes());
    let ebml = [
        number(&[0x42, 0x86], 1),            // EBMLVersion
        number(&[0x42, 0xf7], 1),            // EBMLReadVersion
        number(&[0x42, 0xf2], 4),            // EBMLMaxIDLength
        number(&[0x42, 0xf3], 8),            // EBMLMaxSizeLength
        element(&[0x42, 0x82], b"matroska"), // DocType
        number(&[0x42, 0x87], 4),            // DocTypeVersion
        number(&[0x42, 0x85], 2),            // DocTypeReadVersion
    ];
    let info = [
        number(&[0x2a, 0xd7, 0xb1], TICK_NANOS), // TimestampScale
        element(&[0x4d, 0x80], b"gnomon"),       // MuxingApp
        element(&[0x57, 0x41], b"gnomon"),       // WritingApp
    ];
    let video = [
        number(&[0xb0], u64::from(size_px[0])), // PixelWidth
        number(&[0xba], u64::from(size_px[1])), // PixelHeight
        element(&[0x2e, 0xb5, 0x24], b"RGBA"),  // UncompressedFourCC
    ];
    let entry = [
        number(&[0xd7], 1),                                      // TrackNumber
        number(&[0x73, 0xc5], 1),                                // TrackUID
        number(&[0x83], 1),                                      // TrackType: video
        element(&[0x86], b"V_UNCOMPRESSED"),                     // CodecID
        number(&[0x23, 0xe3, 0x83], (1e9 / fps).round() as u64), // DefaultDuration
        element(&[0xe0], &video.concat()),                       // Video
    ];
    out.write_all(&element(&[0x1a, 0x45, 0xdf, 0xa3], &ebml.concat()))?;
    out.write_all(&[0x18, 0x53, 0x80, 0x67])?; // Segment
    out.write_all(&UNKNOWN_SIZE)?;
    out.write_all(&element(&[0x15, 0x49, 0xa9, 0x66], &info.concat()))?;
    let tracks = element(&[0xae], &entry.concat());
    out.write_all(&element(&[0x16, 0x54, 0xae, 0x6b], &tracks))
}

/// A frame and its time since the first.
pub(super) fn write_frame(out: &mut impl Write, time_secs: f64, rgba: &[u8]) -> io::Result<()> {
    let ticks = (time_secs * 1e9 / TICK_NANOS as f64).round() as u64;
    let timestamp = element(&[0xe7], &ticks.to_be_bytes());
    // Track 1, at the cluster's own time, a key frame.
    let block_head = [0x81, 0, 0, 0x80];
    let block_bytes = block_head.len() + rgba.len();
    let mut head = vec![0x1f, 0x43, 0xb6, 0x75]; // Cluster
    head.extend(size(timestamp.len() + 1 + 8 + block_bytes));
    head.extend(timestamp);
    head.push(0xa3); // SimpleBlock
    head.extend(size(block_bytes));
    head.extend(block_head);
    out.write_all(&head)?;
    out.write_all(rgba)
}

fn element(id: &[u8], content: &[u8]) -> Vec<u8> {
    [id, &size(content.len()), content].concat()
}

/// A size in eight bytes, of which the first bit of the first byte says so.
fn size(bytes: usize) -> [u8; 8] {
    (bytes as u64 | 1 << 56).to_be_bytes()
}
