//! What is given as a scene and is something else: told by what it is, as the text of a video says nothing.

use std::fs;
use std::io::Read as _;
use std::path::Path;

use super::mesh_format::MeshFormat;
use super::plain_file;

/// What to say of a folder, a video, a picture or a model; `None` for all else, which is read as a scene.
pub fn what_else(path: &Path) -> Option<String> {
    let metadata = fs::metadata(path).ok()?;
    let kind = match metadata.is_dir() {
        true => Kind::Folder,
        // A pipe would be waited for.
        false if metadata.is_file() => Kind::of(path, &first_bytes(path))?,
        false => return None,
    };
    let inside = path.join("scene.toml");
    if kind == Kind::Folder && inside.is_file() {
        let inside = inside.display();
        return Some(format!("a folder, not a scene; its scene is {inside}"));
    }
    let shown = path.display().to_string();
    let said = match kind {
        Kind::Model => {
            let stem = path.file_stem().unwrap_or_default().to_string_lossy();
            format!(
                "puts it on a table, [[virtual]] name = {stem:?}, mesh = {shown:?}, fit_m = 0.1"
            )
        }
        Kind::Folder | Kind::Video | Kind::Picture => {
            format!("names a recording, [camera] source = {shown:?}, and what stands on its table")
        }
    };
    let kind = kind.name();
    Some(format!(
        "a {kind}, not a scene: a scene is a text (TOML) that {said}; config/reference.toml shows all of it"
    ))
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Folder,
    Video,
    Picture,
    Model,
}

fn first_bytes(path: &Path) -> Vec<u8> {
    let mut bytes = Vec::new();
    if let Ok(file) = plain_file::open(path) {
        // What cannot be read is told of by who reads all of it.
        let _ = file.take(16).read_to_end(&mut bytes);
    }
    bytes
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Folder => "folder",
            Self::Video => "video",
            Self::Picture => "picture",
            Self::Model => "model",
        }
    }

    /// The kind of a file by its first bytes, as the formats' specifications have them; that of a model, which may be any
    /// text, by its name.
    fn of(path: &Path, bytes: &[u8]) -> Option<Self> {
        let extension = path.extension().unwrap_or_default();
        let names_model = MeshFormat::all_extensions()
            .iter()
            .any(|model| extension.eq_ignore_ascii_case(model));
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
            || at(0, b"#?RGBE")
            || at(0, &[0x76, 0x2f, 0x31, 0x01])
            || at(0, b"RIFF") && at(8, b"WEBP")
            || at(0, b"II*\0")
            || at(0, b"MM\0*");
        let model = names_model || at(0, b"glTF");
        let kinds = [
            (model, Self::Model),
            (video, Self::Video),
            (picture, Self::Picture),
        ];
        let found = kinds.into_iter().find(|(is_it, _)| *is_it);
        found.map(|(_, kind)| kind)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_are_told_by_their_first_bytes() {
        let kind_of = |bytes: &[u8]| Kind::of(Path::new("a"), bytes);
        assert_eq!(kind_of(b"\0\0\0 ftypisom"), Some(Kind::Video));
        assert_eq!(kind_of(b"RIFF....AVI LIST"), Some(Kind::Video));
        assert_eq!(kind_of(b"\x89PNG\r\n\x1a\n"), Some(Kind::Picture));
        assert_eq!(kind_of(b"glTF\x02\0\0\0"), Some(Kind::Model));
        assert_eq!(kind_of(b"[camera]\nsource ="), None);
        assert_eq!(kind_of(b""), None);
    }

    #[test]
    fn a_model_is_told_how_it_gets_on_to_a_table() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("Old Chair.OBJ");
        fs::write(&path, "v 0 0 0\n").unwrap();
        let said = what_else(&path).unwrap();
        assert!(said.starts_with("a model, not a scene"), "{said}");
        let thing = format!(
            "[[virtual]] name = \"Old Chair\", mesh = {:?}",
            path.display().to_string()
        );
        assert!(said.contains(&thing), "{said}");
    }
}
