//! Whether a JPEG is whole: decoders fill up what a file has lost, and say nothing that could be asked for.

const END_OF_IMAGE: u8 = 0xd9;

/// Whether the file ends before its picture does. What follows the picture is its camera's own; a small picture within a segment
/// has an end of its own, which is not meant.
pub(super) fn is_cut_off(jpeg: &[u8]) -> bool {
    let mut place = 2;
    while let Some((at, marker)) = next_marker(jpeg, place) {
        place = match (marker, jpeg.get(at + 2..at + 4)) {
            (END_OF_IMAGE, _) => return false,
            // The codes of a scan follow its header, up to the next marker.
            (_, Some(&[high, low])) => at + 2 + usize::from(u16::from_be_bytes([high, low])),
            _ => return true,
        };
    }
    true
}

/// Where the next marker is that has a segment or ends the picture, and which it is. Within codes 0xff is followed by 0, and marks
/// of restarts have nothing with them (ITU-T T.81 | ISO 10918-1, annex B.1).
fn next_marker(jpeg: &[u8], from: usize) -> Option<(usize, u8)> {
    let is_marker = |pair: &[u8]| {
        let is_alone = matches!(pair[1], 0x00 | 0x01 | 0xd0..=0xd7 | 0xff);
        pair[0] == 0xff && !is_alone
    };
    let at = from + jpeg.get(from..)?.windows(2).position(is_marker)?;
    Some((at, jpeg[at + 1]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_the_picture_is_found_whatever_is_around_it() {
        let mut jpeg = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(64, 48, |x, y| image::Rgb([(x * y) as u8; 3]));
        picture
            .write_to(&mut jpeg, image::ImageFormat::Jpeg)
            .unwrap();
        let jpeg = jpeg.into_inner();
        assert!(!is_cut_off(&jpeg));
        for end in 0..jpeg.len() {
            assert!(is_cut_off(&jpeg[..end]), "{end}");
        }
        let with_more = [&jpeg[..], &[0; 9]].concat();
        assert!(!is_cut_off(&with_more));
        // A small picture in a segment, as EXIF has it.
        let head = [&jpeg[..2], &[0xff, 0xe1, 0, 6, 0xff, END_OF_IMAGE, 9, 9]].concat();
        let with_small = [&head[..], &jpeg[2..]].concat();
        assert!(!is_cut_off(&with_small));
        assert!(is_cut_off(&with_small[..with_small.len() - 4]));
    }
}
