//! The MTL files that an OBJ file names in its `mtllib` records, and the same OBJ file with other names there.

use std::path::{Path, PathBuf};

/// The files that one `mtllib` record means, in a mesh's folder: a name may have spaces, and a record several names, so
/// the whole of it where there is such a file, else each word. Whether they are there is another question.
pub fn libraries(folder: &Path, names: &str) -> Vec<PathBuf> {
    let whole = folder.join(names);
    let words: Vec<&str> = names.split_whitespace().collect();
    match words.len() {
        0 => Vec::new(),
        1 => vec![whole],
        _ if whole.is_file() => vec![whole],
        _ => words.iter().map(|word| folder.join(word)).collect(),
    }
}

/// An OBJ file's bytes with a record for each of its material libraries, by the name that `name_of` gives it. A library
/// that is not there keeps its record as a comment. `mesh` is where the file lies.
///
/// # Errors
/// What `name_of` fails with.
pub fn with_libraries_named<E>(
    mesh: &Path,
    bytes: &[u8],
    mut name_of: impl FnMut(&Path) -> Result<String, E>,
) -> Result<Vec<u8>, E> {
    let folder = mesh.parent().unwrap_or(Path::new(""));
    let mut renamed = Vec::with_capacity(bytes.len());
    for line in bytes.split_inclusive(|&byte| byte == b'\n') {
        // Names and comments may be in another encoding; what is no such record stays as it is, byte by byte.
        let text = String::from_utf8_lossy(line);
        let Some(names) = names_of(&text) else {
            renamed.extend_from_slice(line);
            continue;
        };
        let mut found = false;
        for library in libraries(folder, names) {
            if library.is_file() {
                found = true;
                renamed.extend(format!("mtllib {}\n", name_of(&library)?).bytes());
            }
        }
        if !found {
            renamed.extend(format!("# not there: mtllib {names}\n").bytes());
        }
    }
    Ok(renamed)
}

/// What an `mtllib` record names; `None` for any other line.
fn names_of(line: &str) -> Option<&str> {
    let line = line.trim_start_matches('\u{feff}').trim();
    let names = line.strip_prefix("mtllib")?;
    (names.is_empty() || names.starts_with(char::is_whitespace)).then(|| names.trim())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::convert::Infallible;

    #[test]
    fn every_library_gets_its_own_record_and_the_rest_stays() {
        let folder = tempfile::tempdir().unwrap();
        let mesh = folder.path().join("a.obj");
        for name in ["one.mtl", "two.mtl", "with space.mtl"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let text = b"\xef\xbb\xbfmtllib one.mtl two.mtl\r\n# \xff\nmtllib with space.mtl\n  mtllib\tnone.mtl\nmtllibrary\nv 0 0 0";
        let mut asked = Vec::new();
        let renamed = with_libraries_named(&mesh, text, |library| {
            asked.push(library.to_owned());
            Ok::<_, Infallible>(format!("m{}", asked.len()))
        })
        .unwrap();
        assert_eq!(
            renamed,
            b"mtllib m1\nmtllib m2\n# \xff\nmtllib m3\n# not there: mtllib none.mtl\nmtllibrary\nv 0 0 0"
        );
        let expected = ["one.mtl", "two.mtl", "with space.mtl"];
        assert_eq!(asked, expected.map(|name| folder.path().join(name)));
    }
}
