//! Whether a file ends before its video does, where ffmpeg does not complain of that: containers whose last frame ends the
//! file, or whose end has a mark. What cannot be told is taken to be whole.

use std::fs::File;
use std::io::{BufRead as _, BufReader, Read as _, Seek as _, SeekFrom};
use std::path::Path;

/// Whether the file is cut off.
pub(super) fn is_cut_off(path: &Path) -> bool {
    let ends_early = || {
        let file = File::open(path).ok()?;
        let length = file.metadata().ok()?.len();
        let mut reader = BufReader::new(file);
        let head = reader.fill_buf().ok()?;
        match head {
            [b'R', b'I', b'F', b'F', ..] => is_cut_riff(head, length),
            [b'Y', b'U', b'V', b'4', b'M', b'P', b'E', b'G', b'2', ..] => {
                is_cut_y4m(&mut reader, length)
            }
            [b'G', b'I', b'F', b'8', ..] => is_cut_gif(&mut reader),
            [b'O', b'g', b'g', b'S', ..] => is_cut_ogg(&mut reader, length),
            _ => None,
        }
    };
    ends_early().unwrap_or(false)
}

/// AVI: its head says how long it is, but where it was written as a stream.
fn is_cut_riff(head: &[u8], length: u64) -> Option<bool> {
    let said = u32::from_le_bytes(head.get(4..8)?.try_into().ok()?);
    let knows = said != 0 && said != u32::MAX;
    Some(knows && length < u64::from(said) + 8)
}

/// YUV4MPEG2: all frames are of one size, each after a line of its own.
fn is_cut_y4m(reader: &mut BufReader<File>, length: u64) -> Option<bool> {
    let head = line(reader)?;
    let frame_bytes = y4m_frame_bytes(&head)?;
    let mut at = head.len() as u64 + 1;
    while at < length {
        let Some(head) = line(reader) else {
            return Some(true);
        };
        if !head.starts_with("FRAME") {
            return None;
        }
        at = at
            .checked_add(head.len() as u64 + 1)?
            .checked_add(frame_bytes)?;
        reader
            .seek_relative(i64::try_from(frame_bytes).ok()?)
            .ok()?;
    }
    Some(at > length)
}

/// Bytes of a frame, from the file's first line (yuv4mpeg(5)); `None` where its colours are others than those below.
fn y4m_frame_bytes(head: &str) -> Option<u64> {
    let value = |key: char| {
        head.split(' ')
            .skip(1)
            .find_map(|word| word.strip_prefix(key))
    };
    let side = |key| value(key)?.parse::<u32>().ok().map(u64::from);
    let (width, height) = (side('W')?, side('H')?);
    let (half_width, half_height) = (width.div_ceil(2), height.div_ceil(2));
    let colours = value('C').unwrap_or("420");
    let (kind, depth) = match colours.split_once('p') {
        Some((kind, depth)) if depth.parse::<u32>().is_ok() => (kind, depth.parse().ok()?),
        _ => (colours, 8),
    };
    let chroma = match kind {
        "420" | "420jpeg" | "420mpeg2" | "420paldv" => half_width * half_height,
        "422" => half_width * height,
        "411" => width.div_ceil(4) * height,
        "444" => width * height,
        "mono" => 0,
        _ => return None,
    };
    let samples = width.checked_mul(height)?.checked_add(2 * chroma)?;
    Some(if depth > 8 { 2 * samples } else { samples })
}

/// A line without its end; `None` where the file ends in it.
fn line(reader: &mut BufReader<File>) -> Option<String> {
    const LONGEST: u64 = 1024;
    let mut bytes = Vec::new();
    reader.take(LONGEST).read_until(b'\n', &mut bytes).ok()?;
    (bytes.pop()? == b'\n').then_some(())?;
    String::from_utf8(bytes).ok()
}

/// GIF: blocks, and a mark at their end (GIF89a, section 27).
fn is_cut_gif(reader: &mut BufReader<File>) -> Option<bool> {
    const HEAD: usize = 13;
    // Of a table of colours, in the byte that tells of it.
    let table_bytes = |flags: u8| match flags & 0x80 {
        0 => 0,
        _ => 3_i64 << ((flags & 7) + 1),
    };
    let mut walk = GifWalk { reader };
    let Some(head) = walk.bytes::<HEAD>() else {
        return Some(true);
    };
    walk.skip(table_bytes(head[10]))?;
    loop {
        let Some([kind]) = walk.bytes() else {
            return Some(true);
        };
        let before_parts = match kind {
            0x3b => return Some(false),
            0x21 => walk.bytes::<1>().map(|_| 0),
            // A picture's place, its table, and how its codes begin.
            0x2c => walk.bytes::<9>().map(|place| table_bytes(place[8]) + 1),
            _ => return None,
        };
        let Some(before_parts) = before_parts else {
            return Some(true);
        };
        walk.skip(before_parts)?;
        loop {
            match walk.bytes() {
                None => return Some(true),
                Some([0]) => break,
                Some([part]) => walk.skip(i64::from(part))?,
            }
        }
    }
}

struct GifWalk<'a> {
    reader: &'a mut BufReader<File>,
}

impl GifWalk<'_> {
    /// `None` where the file ends.
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let mut bytes = [0; N];
        self.reader.read_exact(&mut bytes).ok()?;
        Some(bytes)
    }

    fn skip(&mut self, bytes: i64) -> Option<()> {
        self.reader.seek_relative(bytes).ok()
    }
}

/// Ogg: the last page of all is the last one of its stream, and says so (RFC 3533, section 6).
fn is_cut_ogg(reader: &mut BufReader<File>, length: u64) -> Option<bool> {
    /// A page's head, its 255 parts' lengths, and these parts.
    const LONGEST_PAGE: u64 = 27 + 255 + 255 * 255;
    const LAST_OF_STREAM: u8 = 4;
    let from = length.saturating_sub(LONGEST_PAGE);
    reader.seek(SeekFrom::Start(from)).ok()?;
    let mut end = Vec::new();
    reader.take(LONGEST_PAGE).read_to_end(&mut end).ok()?;
    let at = end.windows(4).rposition(|bytes| bytes == b"OggS")?;
    let page = &end[at..];
    let (Some(&flags), Some(&parts)) = (page.get(5), page.get(26)) else {
        return Some(true);
    };
    let Some(lengths) = page.get(27..27 + usize::from(parts)) else {
        return Some(true);
    };
    let content: usize = lengths.iter().map(|&part| usize::from(part)).sum();
    let is_whole = page.len() >= 27 + lengths.len() + content;
    Some(!is_whole || flags & LAST_OF_STREAM == 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the file of these bytes is cut off.
    fn is_cut(bytes: &[u8]) -> bool {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, bytes).unwrap();
        is_cut_off(&path)
    }

    fn y4m(colours: &str, frame_bytes: usize) -> Vec<u8> {
        let mut bytes = format!("YUV4MPEG2 W5 H3 F30:1 Ip {colours}\n").into_bytes();
        for head in ["FRAME\n", "FRAME Ip\n", "FRAME\n"] {
            bytes.extend(head.as_bytes());
            bytes.extend(vec![b'\n'; frame_bytes]);
        }
        bytes
    }

    #[test]
    fn y4m_ends_with_a_frame() {
        for (colours, frame_bytes) in [
            ("A0:0", 27),
            ("C420jpeg XYSCSS=420JPEG", 27),
            ("C422", 33),
            ("C444", 45),
            ("C411", 27),
            ("Cmono", 15),
            ("C420p10 XYSCSS=420P10", 54),
        ] {
            let whole = y4m(colours, frame_bytes);
            assert!(!is_cut(&whole), "{colours}");
            for lost in [1, frame_bytes, frame_bytes + 1, frame_bytes + 5] {
                assert!(is_cut(&whole[..whole.len() - lost]), "{colours} {lost}");
            }
            let after_a_frame = whole.len() - frame_bytes - 6;
            assert!(!is_cut(&whole[..after_a_frame]), "nothing tells");
        }
        assert!(!is_cut(&y4m("C444alpha", 9)), "colours that are not known");
    }

    #[test]
    fn gif_ends_with_its_mark() {
        let mut whole = Vec::new();
        {
            let mut encoder = image::codecs::gif::GifEncoder::new(&mut whole);
            for level in [0, 90] {
                let picture = image::RgbaImage::from_fn(30, 20, |x, y| {
                    image::Rgba([level, (x * 8) as u8, (x * y) as u8, 255])
                });
                encoder.encode_frame(image::Frame::new(picture)).unwrap();
            }
        }
        assert!(!is_cut(&whole));
        for end in 14..whole.len() {
            assert!(is_cut(&whole[..end]), "{end}");
        }
        whole.extend([0; 9]);
        assert!(!is_cut(&whole), "what follows is its program's");
    }

    #[test]
    fn ogg_ends_with_the_last_page_of_a_stream() {
        let page = |flags: u8, content: &[u8]| {
            let mut page = b"OggS\0".to_vec();
            page.push(flags);
            page.extend([0; 20]);
            page.extend([1, content.len() as u8]);
            page.extend(content);
            page
        };
        let first = [page(2, &[7; 100]), page(0, &[8; 200])].concat();
        let whole = [&first[..], &page(4, &[9; 50])].concat();
        assert!(!is_cut(&whole));
        assert!(is_cut(&first));
        for lost in [1, 50, 51, 60, 90] {
            assert!(is_cut(&whole[..whole.len() - lost]), "{lost}");
        }
    }

    #[test]
    fn avi_is_as_long_as_it_says_and_other_files_are_whole() {
        let whole = [&b"RIFF\x0c\0\0\0AVI "[..], &[0; 8]].concat();
        assert!(!is_cut(&whole));
        assert!(is_cut(&whole[..19]));
        assert!(!is_cut(b"RIFF\0\0\0\0AVI "), "written as a stream");
        assert!(!is_cut(b"\0\0\0\x18ftypmp42") && !is_cut(b""));
    }
}
