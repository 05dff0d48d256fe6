//! What is given as a scene and is something else: told by what it is, as the text of a video says nothing.

use std::fs::{self, File};
use std::io::Read as _;
use std::path::Path;

/// What to say of a folder, a video or a picture; `None` for all else, which is read as a scene.
pub fn what_else(path: &Path) -> Option<String> {
    let metadata = fs::metadata(path).ok()?;
    let kind = match metadata.is_dir() {
        true => "folder",
        // A pipe would be waited for.
        false if metadata.is_file() => kind_of(&first_bytes(path))?,
        false => return None,
    };
    let inside = path.join("scene.toml");
    Some(match kind == "folder" && inside.is_file() {
        true => format!("a folder, not a scene; its scene is {}", inside.display()),
        false => format!(
            "a {kind}, not a scene: a scene is a text (TOML) that names a recording, [camera] source = {:?}, and what \
             stands on its table; config/reference.toml shows all of it",
            path.display().to_string()
        ),
    })
}

fn first_bytes(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Ok(file) = File::open(path) {
        // What cannot be read is told of by who reads all of it.
        let _ = file.take(16).read_to_end(&mut bytes);
    }
    bytes
}

/// The kind of a file by its first bytes, as the formats' specifications have them.
fn kind_of(bytes: &[u8]) -> Option<&'static str> {
    let at = |place: usize, expected: &[u8]| {
        bytes
            .get(place..)
            .is_some_and(|rest| rest.starts_with(expected))
    };
    let video = at(4, b"ftyp")
        || at(4, b"moov")
        || at(4, b"mdat")
        || at(0, &[0x1a, 0x45, 0xdf, 0xa3])
        || at(0, b"RIFF") && at(8, b"AVI ")
        || at(0, &[0, 0, 1, 0xba])
        || at(0, b"OggS");
    let picture = at(0, b"\x89PNG")
        || at(0, &[0xff, 0xd8, 0xff])
        || at(0, b"#?RADIANCE")
        || at(0, &[0x76, 0x2f, 0x31, 0x01])
        || at(0, b"RIFF") && at(8, b"WEBP")
        || at(0, b"II*\0")
        || at(0, b"MM\0*");
    match (video, picture) {
        (true, _) => Some("video"),
        (_, true) => Some("picture"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_their_first_bytes() {
        assert_eq!(kind_of(b"\0\0\0 ftypisom"), Some("video"));
        assert_eq!(kind_of(b"RIFF....AVI LIST"), Some("video"));
        assert_eq!(kind_of(b"\x89PNG\r\n\x1a\n"), Some("picture"));
        assert_eq!(kind_of(b"[camera]\nsource ="), None);
        assert_eq!(kind_of(b""), None);
    }
}
