//! Single pictures: PNGs of frames and layers, EXR for depth, Radiance HDR and EXR for probes. Each is written beside its place and then moved there.

use std::fs::{self, File};
use std::io::{BufWriter, Cursor, Write};
use std::path::Path;

use exr::prelude::WritableImage;
use glam::Vec3;
use image::codecs::hdr::HdrEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};

use super::output_error::OutputError;
use super::partial_files::{make_parent, partial_path};

/// Writes 8-bit RGBA as an 8-bit RGB PNG; alpha is dropped.
pub fn write_rgb_png(path: &Path, size_px: [u32; 2], rgba: &[u8]) -> Result<(), OutputError> {
    let rgb: Vec<u8> = rgba
        .chunks_exact(4)
        .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
        .collect();
    // Photographs: one cheap filter is as good as trying all.
    write_png(path, size_px, &rgb, ExtendedColorType::Rgb8, FilterType::Up)
}

/// Writes an 8-bit grey PNG (masks, roles).
pub fn write_grey_png(path: &Path, size_px: [u32; 2], grey: &[u8]) -> Result<(), OutputError> {
    write_png(
        path,
        size_px,
        grey,
        ExtendedColorType::L8,
        FilterType::NoFilter,
    )
}

/// Writes a 16-bit RGB PNG (gain), three values a pixel.
pub fn write_rgb16_png(path: &Path, size_px: [u32; 2], rgb: &[u16]) -> Result<(), OutputError> {
    write_png(
        path,
        size_px,
        bytemuck::cast_slice(rgb),
        ExtendedColorType::Rgb16,
        FilterType::Up,
    )
}

/// Writes one 32-bit float a pixel as an EXR whose only channel is `Y` (depth).
pub fn write_float_exr(path: &Path, size_px: [u32; 2], values: &[f32]) -> Result<(), OutputError> {
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
    let image = exr::image::Image::from_channels((width, height), channels);
    write_exr(path, |bytes| {
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
    match radiance_format(path)? {
        RadianceFormat::Hdr => write_whole(path, |writer| {
            let rgb: Vec<image::Rgb<f32>> = rgb
                .iter()
                .map(|pixel| image::Rgb(pixel.to_array()))
                .collect();
            HdrEncoder::new(writer)
                .encode(&rgb, width, height)
                .map_err(|error| match error {
                    image::ImageError::IoError(error) => io_error(path, error),
                    error => refuse(path, error.to_string()),
                })
        }),
        RadianceFormat::Exr => {
            let pixel_at =
                |position: exr::math::Vec2<usize>| rgb[position.y() * width + position.x()].into();
            let channels = exr::image::SpecificChannels::rgb::<f32, f32, f32>(pixel_at);
            let image = exr::image::Image::from_channels((width, height), channels);
            write_exr(path, |bytes| {
                image.write().non_parallel().to_buffered(bytes)
            })
        }
    }
}

/// How radiance is written.
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

/// Writes bytes that are a whole file (PDF).
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), OutputError> {
    write_whole(path, |writer| {
        writer
            .write_all(bytes)
            .map_err(|error| io_error(path, error))
    })
}

/// Writes text (poses, statistics).
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    write_whole(path, |writer| {
        writer
            .write_all(text.as_bytes())
            .map_err(|error| io_error(path, error))
    })
}

/// The format is written with seeks, so it is made in memory first.
fn write_exr(
    path: &Path,
    encode: impl FnOnce(&mut Cursor<Vec<u8>>) -> exr::error::UnitResult,
) -> Result<(), OutputError> {
    let mut bytes = Cursor::new(Vec::new());
    encode(&mut bytes).map_err(|error| refuse(path, error.to_string()))?;
    write_bytes(path, bytes.get_ref())
}

fn write_png(
    path: &Path,
    size_px: [u32; 2],
    bytes: &[u8],
    color: ExtendedColorType,
    filter: FilterType,
) -> Result<(), OutputError> {
    let expected =
        size_px[0] as usize * size_px[1] as usize * usize::from(color.bits_per_pixel() / 8);
    if bytes.len() != expected {
        return Err(refuse(
            path,
            "the picture's size and its data disagree".to_owned(),
        ));
    }
    write_whole(path, |writer| {
        PngEncoder::new_with_quality(writer, CompressionType::Fast, filter)
            .write_image(bytes, size_px[0], size_px[1], color)
            .map_err(|error| match error {
                image::ImageError::IoError(error) => io_error(path, error),
                error => refuse(path, error.to_string()),
            })
    })
}

/// Writes a file whole or not at all.
fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> Result<(), OutputError>,
) -> Result<(), OutputError> {
    make_parent(path)?;
    let partial = partial_path(path);
    let written = File::create(&partial)
        .map_err(|error| io_error(path, error))
        .and_then(|file| {
            let mut writer = BufWriter::new(file);
            write(&mut writer)?;
            writer.flush().map_err(|error| io_error(path, error))
        });
    let moved =
        written.and_then(|()| fs::rename(&partial, path).map_err(|error| io_error(path, error)));
    if moved.is_err() {
        // Best effort: the first error is the one to tell.
        _ = fs::remove_file(&partial);
    }
    moved
}

fn io_error(path: &Path, error: std::io::Error) -> OutputError {
    OutputError::Io {
        path: path.to_owned(),
        error,
    }
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

    #[test]
    fn layers_come_back_as_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/000007_gain.png");
        let gain: Vec<u16> = (0..7 * 5 * 3).map(|value| value * 600 + 1).collect();
        write_rgb16_png(&path, [7, 5], &gain).unwrap();
        assert_eq!(image::open(&path).unwrap().into_rgb16().into_raw(), gain);

        let role: Vec<u8> = (0..35).map(|value| value * 7).collect();
        write_grey_png(&path, [7, 5], &role).unwrap();
        assert_eq!(image::open(&path).unwrap().into_luma8().into_raw(), role);

        let path = folder.path().join("000007_depth.exr");
        let depth: Vec<f32> = (0..35).map(|value| 0.1 + value as f32).chain([]).collect();
        write_float_exr(&path, [7, 5], &depth).unwrap();
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
        assert!(write_grey_png(&path, [7, 5], &[0; 34]).is_err());
        fs::create_dir(&path).unwrap();
        let text = write_grey_png(&path, [7, 5], &[0; 35])
            .unwrap_err()
            .to_string();
        assert!(text.contains("a.png"), "{text}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
