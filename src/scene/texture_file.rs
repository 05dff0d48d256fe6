//! Pictures that lie on surfaces, from files.

use std::io::Cursor;
use std::path::Path;

use image::{ImageFormat, ImageReader};

use super::plain_file::{self, MOST_PICTURE};
use crate::light::texture::Texture;

/// Longest side of a picture that is read, pixels.
const MOST_SIDE_PX: u32 = 16384;

/// Reads a picture's file by its content, or where that does not tell (TGA) by its name.
///
/// # Errors
/// What is wrong with it, as it goes on after its name.
pub fn read(path: &Path) -> Result<Texture, String> {
    let bytes =
        plain_file::read(path, MOST_PICTURE).map_err(|error| format!("cannot be read: {error}"))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    decode(name.into_owned(), &bytes, ImageFormat::from_path(path).ok())
}

/// Decodes a picture of eight or sixteen bits; `format` is what it is where its bytes do not tell.
///
/// # Errors
/// As [`read`] has them.
pub fn decode(name: String, bytes: &[u8], format: Option<ImageFormat>) -> Result<Texture, String> {
    let failed = |error: &dyn std::fmt::Display| format!("cannot be read: {error}");
    let mut reader = ImageReader::new(Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| failed(&error))?;
    if let (None, Some(format)) = (reader.format(), format) {
        reader.set_format(format);
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MOST_SIDE_PX);
    limits.max_image_height = Some(MOST_SIDE_PX);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| failed(&error))?;
    let rgba = picture.into_rgba8();
    Ok(Texture {
        name,
        size_px: [rgba.width(), rgba.height()],
        rgba: rgba.into_raw(),
    })
}
