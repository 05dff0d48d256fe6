//! Files that OBJ and MTL files name, as they are found on this machine.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// The file that a name means in the folder of who names it. Where it is not there as it is written, `\` is taken for `/`,
/// letters for capitals (Windows does not tell them apart), and of another machine's path the last part.
pub fn named_file(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.trim().trim_matches('"');
    if name.is_empty() {
        return None;
    }
    let slashed = name.replace('\\', "/");
    let last = slashed.rsplit('/').next().unwrap_or_default().to_owned();
    [name, slashed.as_str(), last.as_str()]
        .into_iter()
        .filter(|name| !name.is_empty())
        .find_map(|name| {
            let plain = [folder.join(name), folder.join(raw_name(name))];
            let plain = plain.into_iter().find(|path| path.is_file());
            plain.or_else(|| in_any_case(folder, name))
        })
}

/// A name as Latin-1 bytes, where it can be that: the name of a file on disk need not be UTF-8.
#[cfg(unix)]
fn raw_name(name: &str) -> OsString {
    use std::os::unix::ffi::OsStringExt as _;
    let bytes: Option<Vec<u8>> = name
        .chars()
        .map(|c| u8::try_from(u32::from(c)).ok())
        .collect();
    bytes.map_or_else(|| name.into(), OsString::from_vec)
}

#[cfg(not(unix))]
fn raw_name(name: &str) -> OsString {
    name.into()
}

/// The file below a folder by a relative path whose letters may be capitals there or not.
fn in_any_case(folder: &Path, name: &str) -> Option<PathBuf> {
    let mut found = folder.to_owned();
    for part in name.split('/').filter(|part| !matches!(*part, "" | ".")) {
        let plain = found.join(part);
        if part == ".." || plain.exists() {
            found = plain;
            continue;
        }
        let place = if found.as_os_str().is_empty() {
            Path::new(".")
        } else {
            &found
        };
        let wanted = part.to_lowercase();
        let mut alike: Vec<OsString> = std::fs::read_dir(place)
            .ok()?
            .filter_map(|entry| Some(entry.ok()?.file_name()))
            .filter(|entry| entry.to_string_lossy().to_lowercase() == wanted)
            .collect();
        // Of several the same one each time.
        alike.sort();
        found = found.join(alike.first()?);
    }
    found.is_file().then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_found_as_windows_would() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        std::fs::create_dir(here.join("Maps")).unwrap();
        for name in ["Maps/Red Wall.PNG", "a.mtl", "A.mtl"] {
            std::fs::write(here.join(name), "").unwrap();
        }
        let found = |name: &str| named_file(here, name);
        let wall = Some(here.join("Maps/Red Wall.PNG"));
        for name in [
            "Maps/Red Wall.PNG",
            "maps\\red wall.png",
            ".\\MAPS\\RED WALL.png",
            "\"Maps/red wall.png\"",
        ] {
            assert_eq!(found(name), wall, "{name}");
        }
        assert_eq!(found("C:\\Users\\me\\A.MTL"), Some(here.join("A.mtl")));
        assert_eq!(found("a.mtl"), Some(here.join("a.mtl")));
        assert_eq!(found("Maps"), None, "a folder");
        assert_eq!(found(""), None);
        assert_eq!(found("b.mtl"), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_name_that_is_not_utf8_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(raw_name("grün.mtl"));
        std::fs::write(&path, "").unwrap();
        assert_eq!(named_file(folder.path(), "grün.mtl"), Some(path));
    }
}
