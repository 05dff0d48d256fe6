//! What is found where a file should be: pages, pointers and packages that a download leaves behind, told by their first bytes.

/// How a picture of HEVC begins after four bytes (ISO/IEC 23008-12, annex B).
const HEIC_BRANDS: [&[u8; 8]; 4] = [b"ftypheic", b"ftypheix", b"ftypheim", b"ftypheis"];

/// How pictures of AV1 begin there, and those that say no more than that they are one of the family.
const AVIF_BRANDS: [&[u8; 8]; 3] = [b"ftypavif", b"ftypavis", b"ftypmif1"];

/// What lies there in words, with what to do; `None` where it may be the file itself.
pub fn in_place_of(bytes: &[u8]) -> Option<&'static str> {
    let head = &bytes[..bytes.len().min(256)];
    let text = String::from_utf8_lossy(head);
    let text = text
        .trim_start_matches('\u{feff}')
        .trim_start()
        .to_ascii_lowercase();
    let begins = |signs: &[&[u8]]| signs.iter().any(|sign| head.starts_with(sign));
    if text.starts_with("version https://git-lfs") {
        Some("a pointer of Git LFS in the file's place: git lfs pull brings the file")
    } else if text.starts_with("<!doctype html") || text.starts_with("<html") {
        Some("a page of the web in the file's place: download the file itself")
    } else if begins(&[b"\x1f\x8b"]) {
        Some("packed by gzip: unpack it (gunzip)")
    } else if begins(&[
        b"PK\x03\x04",
        b"7z\xbc\xaf\x27\x1c",
        b"Rar!\x1a\x07",
        b"BZh9",
        b"\xfd7zXZ\0",
    ]) {
        Some("an archive: unpack it")
    } else if HEIC_BRANDS
        .iter()
        .any(|brand| head.get(4..12) == Some(&brand[..]))
    {
        Some("a HEIC picture: such pictures have to be saved as JPEG or PNG first")
    } else if AVIF_BRANDS
        .iter()
        .any(|brand| head.get(4..12) == Some(&brand[..]))
    {
        Some("an AVIF or HEIF picture: such pictures have to be saved as JPEG or PNG first")
    } else if begins(&[b"\xff\x0a", b"\0\0\0\x0cJXL \r\n\x87\n"]) {
        Some("a JPEG XL picture: such pictures have to be saved as JPEG or PNG first")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_downloads_leave_is_told_apart() {
        for (bytes, word) in [
            (
                &b"version https://git-lfs.github.com/spec/v1\noid"[..],
                "Git LFS",
            ),
            (b"\xef\xbb\xbf \n<!DOCTYPE html>", "page"),
            (b"\x1f\x8b\x08", "gunzip"),
            (b"PK\x03\x04", "archive"),
            (b"\0\0\0\x1cftypheic\0\0\0\0mif1", "HEIC"),
            (b"\0\0\0\x20ftypavif\0\0\0\0avif", "AVIF"),
            (b"\0\0\0\x0cJXL \r\n\x87\n", "JPEG XL"),
        ] {
            assert!(
                in_place_of(bytes).is_some_and(|said| said.contains(word)),
                "{word}"
            );
        }
        for bytes in [
            &b""[..],
            b"v 0 0 0",
            b"<?xml version",
            b"#?RADIANCE",
            b"\x89PNG",
        ] {
            assert_eq!(in_place_of(bytes), None);
        }
    }
}
