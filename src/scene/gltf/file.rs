//! A glTF file as it lies on disk: its JSON, checked, and the bytes of its buffers.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::alphabet;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use gltf::json::validation::{Error as Fault, Validate as _};
use gltf::json::{self, Root};
use gltf::{Document, Glb};
use serde_json::Value;

use super::meshopt_views::{self, CompressedView};
use super::{extensions, lenient};
use crate::scene::error::SceneError;
use crate::scene::obj::files::named_file;
use crate::scene::plain_file::{self, MOST_MESH};

/// With or without the signs at its end, which some exporters leave out.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &alphabet::STANDARD,
    GeneralPurposeConfig::new().with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// What is said of a file of the format's first version.
const VERSION_1: &str = "glTF of version 1; version 2 is read (any viewer saves it so)";

/// A file that was read, with what was told of it so far.
pub(super) struct GltfFile<'a> {
    pub path: &'a Path,
    pub document: Document,
    pub buffers: Vec<Vec<u8>>,
    /// Views that were compressed, by their numbers.
    unpacked_views: HashMap<usize, Vec<u8>>,
    /// Bytes of the file and of all that it names: what else takes memory is held against it.
    pub bytes: usize,
    /// Sentences for the user, each once.
    pub notes: Vec<String>,
}

impl<'a> GltfFile<'a> {
    /// Reads JSON and buffers; `note_read` is told of each other file.
    pub fn read(
        path: &'a Path,
        bytes: &[u8],
        note_read: &dyn Fn(&Path),
    ) -> Result<Self, SceneError> {
        let failed = |message: String| SceneError::of_file(path, message);
        let (text, binary) = parts(bytes).map_err(failed)?;
        let mut notes = Vec::new();
        let mut root = parsed(path, &text, &mut notes)?;
        extensions::check(&root, &mut notes).map_err(failed)?;
        // They were checked; the crate knows fewer of them.
        root.extensions_required.clear();
        give_bounds(&mut root).map_err(failed)?;
        let document =
            checked(root).map_err(|error| failed(format!("not a valid glTF file: {error}")))?;
        let mut file = Self {
            path,
            bytes: bytes.len(),
            buffers: Vec::new(),
            unpacked_views: HashMap::new(),
            notes,
            document,
        };
        let mut binary = binary.map(Cow::into_owned);
        for buffer in file.document.clone().buffers() {
            let place = format!("buffers[{}]", buffer.index());
            // What was compressed has a stand-in, which need not be there.
            let is_stand_in = meshopt_views::NAMES.iter().any(|name| {
                let said = buffer.extension_value(name);
                said.is_some_and(|said| said["fallback"] == Value::Bool(true))
            });
            if is_stand_in {
                file.buffers.push(Vec::new());
                continue;
            }
            let found = match buffer.source() {
                gltf::buffer::Source::Bin => binary.take().ok_or_else(|| {
                    failed(format!("{place}: no uri, and the file has no binary chunk"))
                })?,
                gltf::buffer::Source::Uri(uri) => file.resource(&place, uri, note_read)?,
            };
            if found.len() < buffer.length() {
                return Err(failed(format!(
                    "{place}: {} bytes, but byteLength says {}",
                    found.len(),
                    buffer.length()
                )));
            }
            file.buffers.push(found);
        }
        file.unpack_views()?;
        Ok(file)
    }

    /// Decompresses the views that say that they are compressed.
    fn unpack_views(&mut self) -> Result<(), SceneError> {
        let mut total = 0_usize;
        for view in self.document.clone().views() {
            let mut said = meshopt_views::NAMES
                .iter()
                .filter_map(|name| view.extension_value(name));
            let Some(said) = said.next() else { continue };
            let place = format!("bufferViews[{}]", view.index());
            let mut unpacked = || {
                let view = CompressedView::of(said)?;
                total = total.saturating_add(view.length()?);
                if total as u64 > MOST_MESH {
                    return Err(format!(
                        "more than {MOST_MESH} bytes when they are unpacked"
                    ));
                }
                let end = view.byte_offset.checked_add(view.byte_length);
                let buffer = self.buffers.get(view.buffer);
                let packed = end.and_then(|end| buffer?.get(view.byte_offset..end));
                view.decoded(packed.ok_or("it reaches beyond its buffer")?)
            };
            let unpacked = unpacked().map_err(|message| self.error(&place, message))?;
            self.bytes += unpacked.len();
            self.unpacked_views.insert(view.index(), unpacked);
        }
        Ok(())
    }

    /// An error of a place in the file.
    pub fn error(&self, place: &str, message: impl std::fmt::Display) -> SceneError {
        SceneError::of_file(self.path, format!("{place}: {message}"))
    }

    /// Tells something, once.
    pub fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// What a `uri` names: data in itself, or a file beside this one.
    pub fn resource(
        &mut self,
        place: &str,
        uri: &str,
        note_read: &dyn Fn(&Path),
    ) -> Result<Vec<u8>, SceneError> {
        let bytes = match uri.strip_prefix("data:") {
            Some(data) => from_data_uri(data).map_err(|message| self.error(place, message))?,
            None => {
                let path =
                    file_of_uri(self.path, uri).map_err(|message| self.error(place, message))?;
                note_read(&path);
                let shown = path.display().to_string();
                plain_file::read(&path, MOST_MESH).map_err(|error| {
                    self.error(place, format!("\"{shown}\" cannot be read: {error}"))
                })?
            }
        };
        self.bytes += bytes.len();
        Ok(bytes)
    }

    /// The bytes of a view of a buffer.
    pub fn view(&self, place: &str, view: &gltf::buffer::View<'_>) -> Result<&[u8], SceneError> {
        if let Some(unpacked) = self.unpacked_views.get(&view.index()) {
            return Ok(unpacked);
        }
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length());
        end.and_then(|end| buffer.get(view.offset()..end))
            .ok_or_else(|| {
                let message = format!(
                    "bufferViews[{}] reaches beyond its buffer of {} bytes",
                    view.index(),
                    buffer.len()
                );
                self.error(place, message)
            })
    }
}

/// The file that a relative URI names, beside the one that names it. Where it is not there as it is written, it is looked for as
/// [`named_file`] does: exporters write other systems' paths; and then without a query or a fragment (RFC 3986, section 3), which
/// web servers are given with it. `file:` before an absolute path is no more than the path.
///
/// # Errors
/// A URI with another scheme or a host; one that is no text.
pub(super) fn file_of_uri(beside: &Path, uri: &str) -> Result<PathBuf, String> {
    let uri = without_file_scheme(uri);
    let has_scheme = uri.split_once(':').is_some_and(|(scheme, _)| {
        // (`C:` is a disk.)
        scheme.len() > 1 && scheme.chars().all(|c| c.is_ascii_alphanumeric())
    });
    if has_scheme || uri.starts_with("//") {
        return Err(format!(
            "\"{uri}\" is not beside the file; download it and name it by a relative path"
        ));
    }
    let folder = beside.parent().unwrap_or(Path::new(""));
    let written = decoded(uri)?;
    if let Some(file) = file_as_written(folder, uri, &written) {
        return Ok(file);
    }
    let path = uri.split(['?', '#']).next().unwrap_or_default();
    let found = match path.is_empty() || path == uri {
        true => None,
        false => file_as_written(folder, path, &decoded(path)?),
    };
    Ok(found.unwrap_or_else(|| folder.join(&*written)))
}

/// The absolute path of a URI of this machine's files (RFC 8089); any other as it is.
fn without_file_scheme(uri: &str) -> &str {
    let scheme = uri
        .get(..5)
        .filter(|scheme| scheme.eq_ignore_ascii_case("file:"));
    let rest = scheme.map(|_| &uri[5..]);
    let path = rest.map(|rest| {
        let local = rest.strip_prefix("//localhost/").map(|_| &rest[11..]);
        local.or(rest.strip_prefix("//")).unwrap_or(rest)
    });
    path.filter(|path| path.starts_with('/') && !path.starts_with("//"))
        .unwrap_or(uri)
}

fn decoded(uri: &str) -> Result<Cow<'_, str>, String> {
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8();
    decoded.map_err(|_| format!("\"{uri}\" is no text"))
}

fn file_as_written(folder: &Path, uri: &str, name: &str) -> Option<PathBuf> {
    let plain = folder.join(name);
    match plain.is_file() {
        true => Some(plain),
        false => named_file(folder, uri).or_else(|| named_file(folder, name)),
    }
}

/// The JSON and the binary chunk.
type Parts<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// A file's parts.
fn parts(bytes: &[u8]) -> Result<Parts<'_>, String> {
    if !bytes.starts_with(b"glTF") {
        return Ok((Cow::Borrowed(bytes), None));
    }
    // The crate takes it from the length without looking.
    let head = size_of::<[u32; 3]>();
    let length = bytes.get(8..head).and_then(|length| length.try_into().ok());
    match length.map(u32::from_le_bytes) {
        Some(length) if length as usize >= head => {}
        Some(length) => return Err(format!("not a whole .glb file: its length is {length}")),
        None => return Err("not a whole .glb file: it ends in its head".to_owned()),
    }
    // Chunks of another version are others, so the version is asked for first.
    match u32::from_le_bytes([bytes[4], bytes[5], bytes[6], bytes[7]]) {
        2 => {}
        1 => return Err(VERSION_1.to_owned()),
        version => return Err(format!("glTF of version {version}; version 2 is read")),
    }
    let glb = Glb::from_slice(bytes).map_err(|error| format!("not a whole .glb file: {error}"))?;
    Ok((glb.json, glb.bin))
}

/// The JSON as the crate knows it, with what does not matter mended.
fn parsed(path: &Path, text: &[u8], notes: &mut Vec<String>) -> Result<Root, SceneError> {
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    // Some fill up the chunk with zeros where the format wants spaces.
    let text = text.trim_ascii_end();
    let end = text
        .iter()
        .rposition(|byte| *byte != 0)
        .map_or(0, |last| last + 1);
    let text = &text[..end];
    if let Ok(mut value) = serde_json::from_slice::<Value>(text) {
        // Its lists were tables.
        if ["meshes", "nodes", "accessors"]
            .iter()
            .any(|key| value[key].is_object())
        {
            return Err(SceneError::of_file(path, VERSION_1));
        }
        if lenient::mend(&mut value, notes) {
            return json::deserialize::from_value(value)
                .map_err(|error| SceneError::of_file(path, format!("not glTF: {error}")));
        }
    }
    json::deserialize::from_slice(text).map_err(|error| {
        let message = format!("not glTF: {error}");
        match std::str::from_utf8(text) {
            Ok(text) if error.line() > 0 && text.len() < 1 << 20 => {
                let before: usize = text
                    .split_inclusive('\n')
                    .take(error.line() - 1)
                    .map(str::len)
                    .sum();
                let at = before + error.column().saturating_sub(1);
                SceneError::at(path, text, at..at + 1, message)
            }
            _ => SceneError::of_file(path, message),
        }
    })
}

/// The document of a JSON, with what the crate checks of it but for one thing: an accessor without a view is all zeros.
fn checked(root: Root) -> Result<Document, gltf::Error> {
    let mut faults = Vec::new();
    root.validate(&root, json::Path::new, &mut |path, fault| {
        faults.push((path(), fault));
    });
    faults.retain(|(path, fault)| {
        let of_zeros =
            path.as_str().starts_with("accessors[") && path.as_str().ends_with("].bufferView");
        !of_zeros || *fault != Fault::Missing
    });
    match faults.is_empty() {
        true => Ok(Document::from_json_without_validation(root)),
        false => Err(gltf::Error::Validation(faults)),
    }
}

/// Gives positions bounds where exporters have left them out: nothing here reads them.
///
/// # Errors
/// Positions that are not there, at which the crate would stop.
fn give_bounds(root: &mut Root) -> Result<(), String> {
    let is_position = |semantic: &json::validation::Checked<gltf::Semantic>| {
        let json::validation::Checked::Valid(semantic) = semantic else {
            return false;
        };
        *semantic == gltf::Semantic::Positions
    };
    for (mesh, primitives) in root.meshes.iter().enumerate() {
        for (primitive, given) in primitives.primitives.iter().enumerate() {
            let attributes = given.attributes.iter();
            for (_, index) in attributes.filter(|(semantic, _)| is_position(semantic)) {
                let (index, count) = (index.value(), root.accessors.len());
                let Some(accessor) = root.accessors.get_mut(index) else {
                    return Err(format!(
                        "meshes[{mesh}].primitives[{primitive}].attributes.POSITION: accessors[{index}] of {count}"
                    ));
                };
                let zero = || json::serialize::to_value([0.0; 3]).ok();
                if accessor.min.is_none() || accessor.max.is_none() {
                    (accessor.min, accessor.max) = (zero(), zero());
                }
            }
        }
    }
    Ok(())
}

fn from_data_uri(data: &str) -> Result<Vec<u8>, String> {
    let Some((kind, content)) = data.split_once(',') else {
        return Err("a data URI without a comma".to_owned());
    };
    match kind.ends_with(";base64") {
        true => BASE64
            .decode(content.split_ascii_whitespace().collect::<String>())
            .map_err(|error| format!("a data URI that is not base64: {error}")),
        false => Ok(percent_encoding::percent_decode_str(content).collect()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn queries_and_file_schemes_are_what_servers_and_exporters_add() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["g.bin", "h#1.bin", "a b.bin"] {
            std::fs::write(folder.path().join(name), b"").unwrap();
        }
        let beside = folder.path().join("a.gltf");
        let named = |uri: &str| file_of_uri(&beside, uri);
        for (uri, name) in [
            ("g.bin?v=3", "g.bin"),
            ("g.bin#t", "g.bin"),
            ("g.bin?v=3#t", "g.bin"),
            ("a%20b.bin?v=a/b", "a b.bin"),
            ("h#1.bin", "h#1.bin"),
            ("h%231.bin?v", "h#1.bin"),
        ] {
            assert_eq!(named(uri), Ok(folder.path().join(name)), "{uri}");
        }
        let absolute = folder.path().join("g.bin").display().to_string();
        for before in ["", "file:", "file://", "FILE://localhost"] {
            let found = named(&format!("{before}{absolute}"));
            assert_eq!(found, Ok(absolute.clone().into()), "{before}");
        }
        for uri in [
            "file://elsewhere/g.bin",
            "//elsewhere/g.bin",
            "https://a.b/g.bin",
        ] {
            assert!(named(uri).is_err(), "{uri}");
        }
        assert_eq!(named("none.bin?v"), Ok(folder.path().join("none.bin?v")));
    }
}
