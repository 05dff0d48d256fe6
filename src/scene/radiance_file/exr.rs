//! OpenEXR, as its header says: one layer of red, green and blue (or of luminance alone) within its display window.

use std::collections::BTreeMap;
use std::io::Cursor;

use exr::block::UncompressedBlock;
use exr::block::lines::LineRef;
use exr::block::reader::ChunksReader;
use exr::meta::attribute::{Chromaticities as Attribute, SampleType};
use exr::meta::header::Header;
use exr::prelude::Vec2;
use glam::{DMat3, DVec2, Vec3};
use half::f16;

use super::{Pixels, checked_size};
use crate::light::chromaticities::Chromaticities;

/// Layers that an error lists.
const LISTED: usize = 8;

/// Where a layer's colours are.
struct Layer {
    /// The part of the file.
    part: usize,
    /// In words, as `layer` may say it; empty where the channels are called R, G and B alone.
    name: String,
    /// Indices among the part's channels: red, green, blue; three times the same where there is luminance alone.
    channels: [usize; 3],
}

/// Pixels in linear sRGB, the upper row first.
///
/// # Errors
/// Words that follow a path: broken, no colours, several layers and none asked for, sizes that the file cannot hold.
pub fn read(bytes: Vec<u8>, wanted: Option<&str>) -> Result<Pixels, String> {
    let broken = |error: exr::error::Error| match error {
        exr::error::Error::NotSupported(what) => format!("not read of OpenEXR: {what}"),
        error => format!("broken as OpenEXR: {error}"),
    };
    let length = bytes.len();
    let reader = exr::block::read(Cursor::new(bytes), false).map_err(broken)?;
    let layers = layers(reader.headers());
    let Layer { part, channels, .. } = chosen(layers, wanted)?;
    let header = reader.headers()[part].clone();
    let window = header.shared_attributes.display_window;
    let size_px = checked_size(window.size.width(), window.size.height(), length)?;
    checked_size(
        header.layer_size.width(),
        header.layer_size.height(),
        length,
    )?;
    let corner = header.own_attributes.layer_position - window.position;
    let inside = [
        overlap(corner.x(), header.layer_size.width(), size_px[0]),
        overlap(corner.y(), header.layer_size.height(), size_px[1]),
    ];
    let held = (inside[0] * inside[1]) as f64 / (size_px[0] * size_px[1]) as f64;
    if held == 0.0 {
        return Err(
            "its data window lies beside its display window: nothing of the picture is in the file"
                .to_owned(),
        );
    }
    let mut canvas = Canvas {
        size_px,
        corner,
        channels,
        pixels: vec![Vec3::ZERO; size_px[0] * size_px[1]],
    };
    let full = Vec2(0, 0);
    let mut chunks = reader
        .filter_chunks(false, |_, _, block| {
            block.layer == part && block.level == full
        })
        .map_err(broken)?;
    while let Some(chunk) = chunks.next() {
        let chunk = chunk.map_err(broken)?;
        let block = UncompressedBlock::decompress_chunk(chunk, chunks.meta_data(), false)
            .map_err(broken)?;
        for line in block.lines(&header.channels) {
            let kind = header.channels.list[line.location.channel].sample_type;
            canvas.put_line(line, kind).map_err(broken)?;
        }
    }
    let mut pixels = canvas.pixels;
    let is_colour = channels[0] != channels[1];
    if let (Some(primaries), true) = (header.shared_attributes.chromaticities, is_colour) {
        let matrix = srgb_from(primaries)
            .ok_or("its chromaticities span no colours: places in the CIE diagram are meant")?;
        if !matrix.abs_diff_eq(DMat3::IDENTITY, 1e-3) {
            for pixel in &mut pixels {
                *pixel = (matrix * pixel.as_dvec3()).as_vec3();
            }
        }
    }
    Ok(Pixels {
        size_px,
        pixels,
        notes: missing(held).into_iter().collect(),
    })
}

/// The pixels of a display window, while those of the data window are read into it.
struct Canvas {
    size_px: [usize; 2],
    /// Where the data window begins in the display window.
    corner: Vec2<i32>,
    /// As in [`Layer`].
    channels: [usize; 3],
    pixels: Vec<Vec3>,
}

impl Canvas {
    /// Puts what a line has of one channel where it belongs; what lies beside the display window, nowhere.
    fn put_line(&mut self, line: LineRef<'_>, kind: SampleType) -> exr::error::UnitResult {
        let channel = line.location.channel;
        let colours: Vec<usize> = (0..3)
            .filter(|&colour| self.channels[colour] == channel)
            .collect();
        let row = self.corner.y() + line.location.position.y() as i32;
        let row = usize::try_from(row)
            .ok()
            .filter(|row| *row < self.size_px[1]);
        let (Some(row), false) = (row, colours.is_empty()) else {
            return Ok(());
        };
        let first = self.corner.x() + line.location.position.x() as i32;
        let mut put = |at: usize, value: f32| {
            let column = usize::try_from(first + at as i32).ok();
            if let Some(column) = column.filter(|at| *at < self.size_px[0]) {
                for &colour in &colours {
                    self.pixels[row * self.size_px[0] + column][colour] = value;
                }
            }
        };
        match kind {
            SampleType::F16 => {
                for (at, value) in line.read_samples::<f16>().enumerate() {
                    put(at, value?.to_f32());
                }
            }
            SampleType::F32 => {
                for (at, value) in line.read_samples::<f32>().enumerate() {
                    put(at, value?);
                }
            }
            SampleType::U32 => {
                for (at, value) in line.read_samples::<u32>().enumerate() {
                    put(at, value? as f32);
                }
            }
        }
        Ok(())
    }
}

/// How many of a picture's `count` columns or rows so many from a place on cover.
fn overlap(from: i32, covering: usize, count: usize) -> usize {
    let (from, count) = (i64::from(from), count as i64);
    let to = from.saturating_add(i64::try_from(covering).unwrap_or(i64::MAX));
    usize::try_from(to.min(count) - from.max(0)).unwrap_or(0)
}

/// What to say of a file that holds a part of its picture.
fn missing(part: f64) -> Option<String> {
    (part < 1.0).then(|| {
        format!(
            "{:.0} % of the picture (its display window) is not in the file (its data window), and is black",
            (100.0 * (1.0 - part)).max(1.0)
        )
    })
}

fn srgb_from(attribute: Attribute) -> Option<DMat3> {
    let place = |at: Vec2<f32>| DVec2::new(f64::from(at.x()), f64::from(at.y()));
    Chromaticities {
        primaries: [attribute.red, attribute.green, attribute.blue].map(place),
        white: place(attribute.white),
    }
    .srgb_from_these()
}

/// All layers of colours, or else of luminance, in the order of the file.
fn layers(headers: &[Header]) -> Vec<Layer> {
    let mut colours = Vec::new();
    let mut greys = Vec::new();
    for (part, header) in headers
        .iter()
        .enumerate()
        .filter(|(_, header)| !header.deep)
    {
        let of_part = header.own_attributes.layer_name.as_ref();
        let of_part = of_part.map_or_else(String::new, ToString::to_string);
        let mut named: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for (index, channel) in header.channels.list.iter().enumerate() {
            // Chroma at half resolution is no colour of a pixel.
            if channel.sampling != Vec2(1, 1) {
                continue;
            }
            let whole = channel.name.to_string();
            let (group, colour) = whole.rsplit_once('.').unwrap_or(("", &whole));
            let channels = named.entry(group.to_owned()).or_default();
            channels.insert(colour.to_uppercase(), index);
        }
        for (group, channels) in named {
            // A file of one part by a name of its own has one layer all the same.
            let name = match (headers.len() > 1, of_part.as_str(), group.as_str()) {
                (false, ..) | (true, "", _) => group.clone(),
                (true, part, "") => part.to_owned(),
                (true, part, group) if group.starts_with(part) => group.to_owned(),
                (true, part, group) => format!("{part}.{group}"),
            };
            let index =
                |names: [&str; 2]| names.iter().find_map(|name| channels.get(*name)).copied();
            let rgb = [["R", "RED"], ["G", "GREEN"], ["B", "BLUE"]].map(index);
            match (rgb, index(["Y", "LUMINANCE"])) {
                ([Some(red), Some(green), Some(blue)], _) => colours.push(Layer {
                    part,
                    name,
                    channels: [red, green, blue],
                }),
                (_, Some(luminance)) if channels.len() <= 2 => greys.push(Layer {
                    part,
                    name,
                    channels: [luminance; 3],
                }),
                _ => {}
            }
        }
    }
    if colours.is_empty() { greys } else { colours }
}

/// The layer by a name; without one that of the file itself, what a renderer calls combined, or the only one.
fn chosen(mut layers: Vec<Layer>, wanted: Option<&str>) -> Result<Layer, String> {
    let listed = || {
        let names: Vec<String> = layers
            .iter()
            .map(|layer| format!("{:?}", layer.name))
            .collect();
        match names.get(LISTED) {
            Some(_) => format!(
                "{} and {} more",
                names[..LISTED].join(", "),
                names.len() - LISTED
            ),
            None => names.join(", "),
        }
    };
    let is_combined = |layer: &Layer| layer.name.to_lowercase().ends_with("combined");
    let place = match wanted {
        _ if layers.is_empty() => {
            return Err(
                "no layer with red, green and blue (chroma at half resolution, depth or ids are no radiance)"
                    .to_owned(),
            );
        }
        Some(wanted) => match layers.iter().position(|layer| layer.name == wanted) {
            Some(place) => place,
            None => {
                return Err(format!(
                    "no layer by the name of {wanted:?}; there are: {}",
                    listed()
                ));
            }
        },
        None => match layers.iter().position(|layer| layer.name.is_empty()) {
            Some(place) => place,
            None if layers.len() == 1 => 0,
            None => match layers.iter().filter(|layer| is_combined(layer)).count() {
                1 => layers.iter().position(is_combined).unwrap_or(0),
                _ => {
                    return Err(format!(
                        "several layers: {}; which one is meant says `layer`",
                        listed()
                    ));
                }
            },
        },
    };
    Ok(layers.swap_remove(place))
}

#[cfg(test)]
mod tests {
    use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image};
    use exr::meta::attribute::{IntegerBounds, Text};
    use exr::meta::header::{ImageAttributes, LayerAttributes};
    use exr::prelude::WritableImage;

    use super::*;

    fn file(
        layers: Vec<exr::image::Layer<AnyChannels<FlatSamples>>>,
        window: IntegerBounds,
    ) -> Vec<u8> {
        let mut attributes = ImageAttributes::new(window);
        attributes.chromaticities = None;
        let mut bytes = Vec::new();
        Image::from_layers(attributes, layers)
            .write()
            .to_buffered(Cursor::new(&mut bytes))
            .unwrap();
        bytes
    }

    /// 4 x 2 pixels: all red channels 1, green 2, blue 4, times `scale`.
    fn layer(
        name: Option<&str>,
        prefix: &str,
        scale: f32,
    ) -> exr::image::Layer<AnyChannels<FlatSamples>> {
        let channel = |name: &str, value: f32| {
            AnyChannel::new(
                Text::new_or_panic(format!("{prefix}{name}").as_str()),
                FlatSamples::F32(vec![value * scale; 8]),
            )
        };
        let channels = AnyChannels::sort(
            [channel("R", 1.0), channel("G", 2.0), channel("B", 4.0)]
                .into_iter()
                .collect(),
        );
        let attributes = LayerAttributes {
            layer_name: name.map(Text::new_or_panic),
            ..LayerAttributes::default()
        };
        exr::image::Layer::new((4, 2), attributes, Encoding::FAST_LOSSLESS, channels)
    }

    fn whole() -> IntegerBounds {
        IntegerBounds::from_dimensions((4, 2))
    }

    #[test]
    fn the_layer_is_the_only_one_the_combined_one_or_the_one_asked_for() {
        let colour = |bytes: &[u8], wanted: Option<&str>| {
            read(bytes.to_vec(), wanted).map(|read| read.pixels[7])
        };
        let rgb = Vec3::new(1.0, 2.0, 4.0);
        let combined = file(vec![layer(None, "ViewLayer.Combined.", 1.0)], whole());
        assert_eq!(colour(&combined, None), Ok(rgb));
        let several = file(
            vec![
                layer(Some("Scene.Diffuse"), "Scene.Diffuse.", 2.0),
                layer(Some("Scene.Combined"), "Scene.Combined.", 1.0),
                layer(Some("left"), "", 3.0),
            ],
            whole(),
        );
        assert_eq!(colour(&several, None), Ok(rgb));
        assert_eq!(colour(&several, Some("Scene.Diffuse")), Ok(2.0 * rgb));
        assert_eq!(colour(&several, Some("left")), Ok(3.0 * rgb));
        let error = colour(&several, Some("right")).unwrap_err();
        assert!(
            error.contains("\"left\"") && error.contains("\"right\""),
            "{error}"
        );
        let doubtful = file(
            vec![layer(Some("left"), "", 1.0), layer(Some("right"), "", 1.0)],
            whole(),
        );
        let error = colour(&doubtful, None).unwrap_err();
        assert!(
            error.contains("several layers") && error.contains("`layer`"),
            "{error}"
        );
    }

    #[test]
    fn a_data_window_lies_where_it_is_in_the_display_window() {
        let mut cropped = layer(None, "", 1.0);
        cropped.attributes.layer_position = Vec2(3, -1);
        let read = read(
            file(vec![cropped], IntegerBounds::from_dimensions((6, 4))),
            None,
        )
        .unwrap();
        assert_eq!(read.size_px, [6, 4]);
        let lit: Vec<usize> = (0..24)
            .filter(|&index| read.pixels[index] != Vec3::ZERO)
            .collect();
        assert_eq!(
            lit,
            [3, 4, 5],
            "one row and three columns of it are in the window"
        );
        assert!(read.notes[0].contains("88 %"), "{:?}", read.notes);
    }

    #[test]
    fn a_data_window_beside_the_display_window_holds_nothing() {
        let mut beside = layer(None, "", 1.0);
        beside.attributes.layer_position = Vec2(100, -50);
        let refused = read(file(vec![beside], whole()), None).unwrap_err();
        assert!(refused.contains("nothing of the picture"), "{refused}");
    }

    #[test]
    fn headers_that_lie_are_errors_and_cost_nothing() {
        let mut bytes = file(vec![layer(None, "", 1.0)], whole());
        // The windows are told in the header, low and high corners.
        let place = |name: &[u8], bytes: &[u8]| {
            bytes
                .windows(name.len())
                .position(|window| window == name)
                .unwrap()
                + name.len()
        };
        for name in [&b"dataWindow\0box2i\0"[..], &b"displayWindow\0box2i\0"[..]] {
            let corner = place(name, &bytes) + 4 + 8;
            bytes[corner..corner + 4].copy_from_slice(&9999_i32.to_le_bytes());
            bytes[corner + 4..corner + 8].copy_from_slice(&9999_i32.to_le_bytes());
        }
        let error = read(bytes, None).err().unwrap();
        assert!(
            error.contains("cut off") || error.contains("broken"),
            "{error}"
        );
    }
}
