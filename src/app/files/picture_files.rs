//! Single pictures: PNGs of frames and layers, EXR for depth, Radiance HDR and EXR for probes. Each is there whole or not at all.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::WritableImage;
use glam::Vec3;
use image::codecs::hdr::HdrEncoder;
use png::{BitDepth, ColorType, Compression, Filter};

use super::made_by::SOFTWARE;
use super::new_file::NewFile;
use super::output_error::OutputError;

/// Writes 8-bit RGBA as an 8-bit RGB PNG; alpha is dropped.
pub fn write_rgb_png(path: &Path, size_px: [u32; 2], rgba: &[u8]) -> Result<(), OutputError> {
    write_bytes(path, &rgb_png(path, size_px, rgba)?)
}

/// The same as small as can be: for what is made once and kept in a repository, as charts are.
pub fn write_small_rgb_png(path: &Path, size_px: [u32; 2], rgba: &[u8]) -> Result<(), OutputError> {
    let rgb = rgb_of(rgba);
    let samples = (ColorType::Rgb, BitDepth::Eight, &rgb[..]);
    let bytes = png(
        path,
        size_px,
        samples,
        (Filter::Adaptive, Compression::High),
    )?;
    write_bytes(path, &bytes)
}

/// An 8-bit RGB PNG of 8-bit RGBA; alpha is dropped. `path` is for messages, here as below.
pub fn rgb_png(path: &Path, size_px: [u32; 2], rgba: &[u8]) -> Result<Vec<u8>, OutputError> {
    let rgb = rgb_of(rgba);
    // Photographs: one cheap filter is as good as trying all.
    let samples = (ColorType::Rgb, BitDepth::Eight, &rgb[..]);
    png(path, size_px, samples, (Filter::Up, Compression::Fast))
}

fn rgb_of(rgba: &[u8]) -> Vec<u8> {
    let pixels = rgba.chunks_exact(4);
    pixels
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect()
}

/// An 8-bit grey PNG (masks, roles).
pub fn grey_png(path: &Path, size_px: [u32; 2], grey: &[u8]) -> Result<Vec<u8>, OutputError> {
    let samples = (ColorType::Grayscale, BitDepth::Eight, grey);
    png(
        path,
        size_px,
        samples,
        (Filter::NoFilter, Compression::Fast),
    )
}

/// A 16-bit RGB PNG (gain), three values a pixel.
pub fn rgb16_png(path: &Path, size_px: [u32; 2], rgb: &[u16]) -> Result<Vec<u8>, OutputError> {
    let bytes: Vec<u8> = rgb.iter().flat_map(|value| value.to_be_bytes()).collect();
    let samples = (ColorType::Rgb, BitDepth::Sixteen, &bytes[..]);
    png(path, size_px, samples, (Filter::Up, Compression::Fast))
}

/// One 32-bit float a pixel as an EXR whose only channel is `Y` (depth).
pub fn float_exr(path: &Path, size_px: [u32; 2], values: &[f32]) -> Result<Vec<u8>, OutputError> {
    let [width, height] = size_px.map(|side| side as usize);
    if values.len() != width * height {
        return Err(refuse(
            path,
            "the picture's size and its data disagree".to_owned(),
        ));
    }
    let value_at =
        |position: exr::math::Vec2<usize>| (values[position.y() * width + position.x()],);
    let channels = exr::image::SpecificChannels::build()
        .with_channel("Y")
        .with_pixel_fn(value_at);
    let mut image = exr::image::Image::from_channels((width, height), channels);
    image.layer_data.attributes.software_name = Some(SOFTWARE.into());
    exr_bytes(path, |bytes| {
        image.write().non_parallel().to_buffered(bytes)
    })
}

/// Writes linear radiance, RGB, as Radiance HDR (.hdr, one exponent a pixel) or OpenEXR (.exr, 32-bit floats).
pub fn write_radiance(path: &Path, size_px: [usize; 2], rgb: &[Vec3]) -> Result<(), OutputError> {
    let [width, height] = size_px;
    if rgb.len() != width * height {
        return Err(refuse(
            path,
            "the picture's size and its data disagree".to_owned(),
        ));
    }
    let bytes = match radiance_format(path)? {
        RadianceFormat::Hdr => {
            let rgb: Vec<image::Rgb<f32>> = rgb
                .iter()
                .map(|pixel| image::Rgb(pixel.to_array()))
                .collect();
            let mut bytes = Vec::new();
            HdrEncoder::new(&mut bytes)
                .encode(&rgb, width, height)
                .map_err(|error| refuse(path, error.to_string()))?;
            // The encoder's head has no place for more.
            let first_line = bytes.iter().position(|&byte| byte == b'\n');
            let after = first_line.map_or(0, |end| end + 1);
            bytes.splice(after..after, format!("SOFTWARE={SOFTWARE}\n").into_bytes());
            bytes
        }
        RadianceFormat::Exr => {
            let pixel_at =
                |position: exr::math::Vec2<usize>| rgb[position.y() * width + position.x()].into();
            let channels = exr::image::SpecificChannels::rgb::<f32, f32, f32>(pixel_at);
            let mut image = exr::image::Image::from_channels((width, height), channels);
            image.layer_data.attributes.software_name = Some(SOFTWARE.into());
            exr_bytes(path, |bytes| {
                image.write().non_parallel().to_buffered(bytes)
            })?
        }
    };
    write_bytes(path, &bytes)
}

/// A file format for radiance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RadianceFormat {
    /// Radiance HDR.
    Hdr,
    /// OpenEXR.
    Exr,
}

/// By the file's extension.
///
/// # Errors
/// Another extension.
pub fn radiance_format(path: &Path) -> Result<RadianceFormat, OutputError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_ascii_lowercase().as_str() {
        "hdr" => Ok(RadianceFormat::Hdr),
        "exr" => Ok(RadianceFormat::Exr),
        _ => Err(refuse(
            path,
            "probes are written as .hdr (Radiance) or .exr (OpenEXR)".to_owned(),
        )),
    }
}

/// Writes bytes that are a whole file.
///
/// # Errors
/// As [`NewFile`].
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut file = NewFile::create(path)?;
    file.write(bytes)?;
    file.finish()
}

/// Writes bytes that are a whole file under a name that nothing has.
///
/// # Errors
/// As [`NewFile::create_first`].
pub fn write_first(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    let mut file = NewFile::create_first(path)?;
    file.write(bytes)?;
    file.finish()
}

/// Writes text (poses, statistics).
///
/// # Errors
/// As [`NewFile`].
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    write_bytes(path, text.as_bytes())
}

/// The format is written with seeks, so it is made in memory.
fn exr_bytes(
    path: &Path,
    encode: impl FnOnce(&mut Cursor<Vec<u8>>) -> exr::error::UnitResult,
) -> Result<Vec<u8>, OutputError> {
    let mut bytes = Cursor::new(Vec::new());
    encode(&mut bytes).map_err(|error| refuse(path, error.to_string()))?;
    Ok(bytes.into_inner())
}

fn png(
    path: &Path,
    size_px: [u32; 2],
    (color, depth, samples): (ColorType, BitDepth, &[u8]),
    (filter, compression): (Filter, Compression),
) -> Result<Vec<u8>, OutputError> {
    let bytes_per_pixel = color.samples() * usize::from(depth as u8) / 8;
    if samples.len() != size_px[0] as usize * size_px[1] as usize * bytes_per_pixel {
        return Err(refuse(
            path,
            "the picture's size and its data disagree".to_owned(),
        ));
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size_px[0], size_px[1]);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(compression);
    encoder.set_filter(filter);
    let written = encoder
        .add_text_chunk("Software".to_owned(), SOFTWARE.to_owned())
        .and_then(|()| encoder.write_header())
        .and_then(|mut writer| {
            writer.write_image_data(samples)?;
            writer.finish()
        });
    written.map_err(|error| refuse(path, error.to_string()))?;
    Ok(bytes)
}

fn refuse(path: &Path, message: String) -> OutputError {
    OutputError::Picture {
        path: path.to_owned(),
        message,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn layers_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/000007_gain.png");
        let gain: Vec<u16> = (0..7 * 5 * 3).map(|value| value * 600 + 1).collect();
        write_bytes(&path, &rgb16_png(&path, [7, 5], &gain).unwrap()).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb16().into_raw(), gain);

        let role: Vec<u8> = (0..35).map(|value| value * 7).collect();
        write_bytes(&path, &grey_png(&path, [7, 5], &role).unwrap()).unwrap();
        assert_eq!(image::open(&path).unwrap().into_luma8().into_raw(), role);

        let path = folder.path().join("000007_depth.exr");
        let depth: Vec<f32> = (0..35).map(|value| 0.1 + value as f32).chain([]).collect();
        write_bytes(&path, &float_exr(&path, [7, 5], &depth).unwrap()).unwrap();
        let back = exr::prelude::read_first_flat_layer_from_file(&path).unwrap();
        let channels = &back.layer_data.channel_data.list;
        assert_eq!(
            (channels.len(), channels[0].name.to_string().as_str()),
            (1, "Y")
        );
        assert_eq!(
            channels[0].sample_data.values_as_f32().collect::<Vec<_>>(),
            depth
        );
    }

    #[test]
    fn what_fails_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        assert!(write_rgb_png(&path, [7, 5], &[0; 4 * 34]).is_err());
        fs::create_dir(&path).unwrap();
        let text = write_rgb_png(&path, [7, 5], &[0; 4 * 35])
            .unwrap_err()
            .to_string();
        assert!(text.contains("a.png"), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
