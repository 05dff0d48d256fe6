//! Picture files that hold more than one picture, of which the first is read.

use image::ImageFormat;

use crate::scene::tiff_header;

/// How many pictures a file of this format holds, copies for small screens not counted.
pub(super) fn count(format: ImageFormat, bytes: &[u8]) -> u32 {
    match format {
        ImageFormat::Tiff => tiff_header::pictures(bytes).max(1),
        ImageFormat::Png => frames_of_png(bytes).unwrap_or(1),
        _ => 1,
    }
}

/// The frames of an animated PNG, whose number stands before the first picture (PNG, third edition, 11.3.2.1).
fn frames_of_png(bytes: &[u8]) -> Option<u32> {
    const SIGNATURE: usize = 8;
    let mut rest = bytes.get(SIGNATURE..)?;
    loop {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (kind, content) = after.split_first_chunk::<4>()?;
        match kind {
            b"acTL" => return Some(u32::from_be_bytes(*content.first_chunk()?)),
            b"IDAT" => return None,
            // The check sum follows.
            _ => rest = content.get(u32::from_be_bytes(*length) as usize + 4..)?,
        }
    }
}

/// Whether a WebP is animated: its head says so (RFC 9649, section 2.7).
pub(super) fn is_animated_webp(bytes: &[u8]) -> bool {
    const ANIMATED: u8 = 2;
    let is_webp = bytes.starts_with(b"RIFF") && bytes.get(8..16) == Some(b"WEBPVP8X");
    is_webp && bytes.get(20).is_some_and(|flags| flags & ANIMATED != 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_animations_are_counted() {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::GrayImage::new(4, 3);
        picture.write_to(&mut bytes, ImageFormat::Png).unwrap();
        let plain = bytes.into_inner();
        assert_eq!(count(ImageFormat::Png, &plain), 1);
        // After the head's 25 bytes.
        let control = b"\0\0\0\x08acTL\0\0\0\x03\0\0\0\0\x01\x02\x03\x04";
        let animated = [&plain[..33], control, &plain[33..]].concat();
        assert_eq!(count(ImageFormat::Png, &animated), 3);
        for end in 0..animated.len() {
            count(ImageFormat::Png, &animated[..end]);
        }
        assert!(is_animated_webp(b"RIFF....WEBPVP8X\x0a\0\0\0\x12"));
        assert!(!is_animated_webp(b"RIFF....WEBPVP8X\x0a\0\0\0\x10"));
        assert!(!is_animated_webp(&plain) && !is_animated_webp(b"RIFF"));
    }
}
