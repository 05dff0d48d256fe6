//! The MTL files that an OBJ file names in its `mtllib` records, and both with other names for the files that they name.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::super::error::SceneError;
use super::super::notes::Notes;
use super::super::plain_file::{self, MOST_TEXT};
use super::super::raw_model::GivenMaterial;
use super::files::named_file;
use super::material::Converter;
use super::mtl::{self, map, map_role};
use super::text::{decoded, records, without_comment};
use crate::light::texture::Texture;

/// The materials of all libraries of a mesh.
#[derive(Debug, Default)]
pub struct Libraries {
    /// In the order of the files.
    pub materials: Vec<GivenMaterial>,
    /// What their maps name.
    pub textures: Vec<Arc<Texture>>,
    index_of: HashMap<String, usize>,
    names: Vec<String>,
}

impl Libraries {
    /// Reads the libraries that records name; each of these with the byte of the mesh's text where it is.
    ///
    /// # Errors
    /// A library that is there and cannot be read.
    pub fn read(
        mesh: &Path,
        text: &str,
        named: &[(String, usize)],
        notes: &mut Notes,
        note_read: &dyn Fn(&Path),
    ) -> Result<Self, SceneError> {
        let folder = mesh.parent().unwrap_or(Path::new(""));
        let mut known: Vec<PathBuf> = Vec::new();
        let mut found = Self::default();
        let mut converter = Converter::default();
        for (names, at) in named {
            for library in libraries(folder, names) {
                let path = match library {
                    Ok(path) => path,
                    Err(name) => {
                        note_read(&folder.join(&name));
                        let message = format!("mtllib: no such file as \"{name}\"");
                        notes.add_at(mesh, text, *at, message);
                        continue;
                    }
                };
                if known.contains(&path) {
                    continue;
                }
                note_read(&path);
                found.add(&path, &mut converter, notes, note_read)?;
                known.push(path);
            }
        }
        if let Some(told) = converter.pictures.told() {
            notes.add_of(mesh, told);
        }
        found.textures = converter.pictures.into_pictures();
        Ok(found)
    }

    fn add(
        &mut self,
        path: &Path,
        converter: &mut Converter,
        notes: &mut Notes,
        note_read: &dyn Fn(&Path),
    ) -> Result<(), SceneError> {
        let bytes = plain_file::read(path, MOST_TEXT).map_err(|error| {
            SceneError::of_file(path, format!("the material file cannot be read: {error}"))
        })?;
        let text = decoded(&bytes);
        for material in mtl::read(path, &text, notes) {
            let index = self.materials.len();
            // Of the same name the first holds, as in a list that is searched.
            self.index_of.entry(material.name.clone()).or_insert(index);
            let given = converter.material(material, (path, &text), notes, note_read);
            self.materials.push(given);
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        self.names.push(name.into_owned());
        Ok(())
    }

    /// The material that a name means: as it stands, or without the comment behind it on either side, or without its quotes and
    /// capitals.
    pub fn find(&self, name: &str) -> Option<usize> {
        let name = name.trim();
        let exact = |name: &str| self.index_of.get(name).copied();
        exact(name)
            .or_else(|| exact(without_comment(name)))
            .or_else(|| {
                let mut names = self.materials.iter().map(|material| &material.name);
                names.position(|known| without_comment(known) == without_comment(name))
            })
            .or_else(|| {
                let plain = |name: &str| without_comment(name).trim_matches('"').to_lowercase();
                let mut names = self.materials.iter().map(|material| &material.name);
                names.position(|known| plain(known) == plain(name))
            })
    }

    /// Whether there is a material.
    pub fn are_there(&self) -> bool {
        !self.materials.is_empty()
    }

    /// Their files' names.
    pub fn told(&self) -> String {
        self.names.join(" and ")
    }
}

/// The files that one `mtllib` record means, in a mesh's folder: a name may have spaces, and a record several names, so the
/// whole of it where there is such a file, else each word; the name of what is not there.
fn libraries(folder: &Path, names: &str) -> Vec<Result<PathBuf, String>> {
    let whole = named_file(folder, names);
    let whole = whole.or_else(|| named_file(folder, without_comment(names)));
    if let Some(whole) = whole {
        return vec![Ok(whole)];
    }
    let names = without_comment(names);
    let words: Vec<Result<PathBuf, String>> = names
        .split_whitespace()
        .map(|word| named_file(folder, word).ok_or_else(|| word.to_owned()))
        .collect();
    match words.iter().any(Result::is_ok) || words.is_empty() {
        true => words,
        false => vec![Err(names.to_owned())],
    }
}

/// An OBJ file's bytes with a record for each of its material libraries, by the name that `name_of` gives it; as UTF-8. A
/// library that is not there keeps its record as a comment. `mesh` is where the file lies.
///
/// # Errors
/// What `name_of` fails with.
pub fn with_libraries_named<E>(
    mesh: &Path,
    bytes: &[u8],
    mut name_of: impl FnMut(&Path) -> Result<String, E>,
) -> Result<Vec<u8>, E> {
    let folder = mesh.parent().unwrap_or(Path::new(""));
    with_records(bytes, |record| {
        if !record.keyword().eq_ignore_ascii_case("mtllib") {
            return Ok(None);
        }
        let mut renamed = String::new();
        for library in libraries(folder, record.rest()) {
            renamed += &match library {
                Ok(library) => format!("mtllib {}\n", name_of(&library)?),
                Err(name) => format!("# not there: mtllib {name}\n"),
            };
        }
        Ok(Some(renamed))
    })
}

/// An MTL file's bytes with the names that `name_of` gives to its pictures; as UTF-8. A picture that is not there keeps its
/// record as a comment. `library` is where the file lies.
///
/// # Errors
/// What `name_of` fails with.
pub fn with_maps_named<E>(
    library: &Path,
    bytes: &[u8],
    mut name_of: impl FnMut(&Path) -> Result<String, E>,
) -> Result<Vec<u8>, E> {
    let folder = library.parent().unwrap_or(Path::new(""));
    with_records(bytes, |record| {
        let Some(role) = map_role(record.keyword()) else {
            return Ok(None);
        };
        let written = map(record, role).file;
        if written.is_empty() {
            return Ok(None);
        }
        let line = record.line.trim();
        let options = line.rfind(&written).map_or(line, |at| &line[..at]);
        let options = options.trim_end().trim_end_matches('"').trim();
        Ok(Some(match named_file(folder, &written) {
            Some(path) => format!("{options} {}\n", name_of(&path)?),
            None => format!("# not there: {line}\n"),
        }))
    })
}

/// A text's bytes with other lines where `renamed` gives some, each with its line end.
fn with_records<E>(
    bytes: &[u8],
    mut renamed: impl FnMut(&super::text::Record) -> Result<Option<String>, E>,
) -> Result<Vec<u8>, E> {
    let text = decoded(bytes);
    let mut written = String::with_capacity(text.len());
    for record in records(&text) {
        match renamed(&record)? {
            Some(line) => written += &line,
            None => written += &text[record.start..record.end],
        }
    }
    Ok(written.into_bytes())
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
        let text = b"\xef\xbb\xbfmtllib one.mtl two.mtl\r\n# \xff\nmtllib With Space.mtl # old\n  mtllib\tnone.mtl\nmtllibrary\nmtllib \\\n two.mtl\nv 0 0 0";
        let mut asked = Vec::new();
        let renamed = with_libraries_named(&mesh, text, |library| {
            asked.push(library.to_owned());
            Ok::<_, Infallible>(format!("m{}", asked.len()))
        })
        .unwrap();
        assert_eq!(
            String::from_utf8(renamed).unwrap(),
            "mtllib m1\nmtllib m2\n# ÿ\nmtllib m3\n# not there: mtllib none.mtl\nmtllibrary\nmtllib m4\nv 0 0 0"
        );
        let expected = ["one.mtl", "two.mtl", "with space.mtl", "two.mtl"];
        assert_eq!(asked, expected.map(|name| folder.path().join(name)));
    }

    #[test]
    fn pictures_get_other_names_behind_their_options() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("Red Wall.png"), "").unwrap();
        let text = "newmtl a\nmap_Kd -s 2 2 1 red wall.PNG # red\nbump -bm 2 none.png\nmap_d \"Red Wall.png\"\nmap_Ke\nKd 1 1 1";
        let path = folder.path().join("a.mtl");
        let renamed = with_maps_named(&path, text.as_bytes(), |_| {
            Ok::<_, Infallible>("p.png".to_owned())
        });
        assert_eq!(
            String::from_utf8(renamed.unwrap()).unwrap(),
            "newmtl a\nmap_Kd -s 2 2 1 p.png\n# not there: bump -bm 2 none.png\nmap_d p.png\nmap_Ke\nKd 1 1 1"
        );
    }
}
