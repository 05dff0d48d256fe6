//! The files that a glTF file names, and the same glTF file with other names there.

use std::borrow::Cow;
use std::path::Path;

use gltf::Glb;
use serde_json::Value;

use super::file::file_of_uri;

/// A glTF file's bytes, binary or not, with each file beside it by the name that `name_of` gives it; data in the file itself
/// stays. `path` is where it lies. What is no glTF stays as it is.
///
/// # Errors
/// What `name_of` fails with.
pub fn with_files_named<E>(
    path: &Path,
    bytes: &[u8],
    mut name_of: impl FnMut(&Path) -> Result<String, E>,
) -> Result<Vec<u8>, E> {
    let glb = bytes.starts_with(b"glTF").then(|| Glb::from_slice(bytes));
    let glb = match glb {
        Some(Ok(glb)) => Some(glb),
        Some(Err(_)) => return Ok(bytes.to_vec()),
        None => None,
    };
    let text = glb.as_ref().map_or(bytes, |glb| &glb.json);
    let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
    let Ok(mut json) = serde_json::from_slice::<Value>(text) else {
        return Ok(bytes.to_vec());
    };
    let mut is_renamed = false;
    for list in ["buffers", "images"] {
        let entries = json.get_mut(list).and_then(Value::as_array_mut);
        for uri in entries
            .into_iter()
            .flatten()
            .filter_map(|entry| entry.get_mut("uri"))
        {
            let named = uri.as_str().filter(|uri| !uri.starts_with("data:"));
            let Some(file) = named.and_then(|uri| file_of_uri(path, uri).ok()) else {
                continue;
            };
            // (A picture that no material uses may be missing.)
            if file.is_file() {
                *uri = Value::String(name_of(&file)?);
                is_renamed = true;
            }
        }
    }
    if !is_renamed {
        return Ok(bytes.to_vec());
    }
    let text = json.to_string().into_bytes();
    let Some(mut glb) = glb else {
        return Ok(text);
    };
    glb.json = Cow::Owned(text);
    Ok(glb.to_vec().unwrap_or_else(|_| bytes.to_vec()))
}
