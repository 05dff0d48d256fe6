//! Radiance HDR (Ward's RGBE and XYZE pictures), as its header says: the `image` crate reads the pixels, the rest of the
//! header is read here.

use std::io::BufReader;

use glam::{DMat3, DVec2, Vec3};
use image::ImageDecoder;
use image::codecs::hdr::HdrDecoder;

use super::{Pixels, checked_size};
use crate::light::chromaticities::{Chromaticities, EQUAL_ENERGY_WHITE, SRGB, srgb_from_xyz};

/// Primaries as near to sRGB's as programs round them.
const SAME_CHROMATICITY: f64 = 2e-3;

/// What a header says of the pixels.
struct Header {
    /// Pixels are divided by it: the product of all EXPOSURE lines.
    exposure: f64,
    /// And by this: the product of all COLORCORR lines.
    color_correction: [f64; 3],
    primaries: Option<Chromaticities>,
    is_xyz: bool,
    lines: Axis,
    along_a_line: Axis,
    /// Bytes before the pixels.
    length: usize,
    notes: Vec<String>,
}

/// One of the two parts of the line that says how pixels are ordered.
#[derive(Clone, Copy)]
struct Axis {
    is_vertical: bool,
    /// To the left, or downwards: `-` in the file.
    is_negative: bool,
    count: usize,
}

/// Pixels in linear sRGB, the upper row first.
///
/// # Errors
/// Words that follow a path: a header that says nothing sensible, sizes that the file cannot hold, broken pixels.
pub fn read(bytes: &[u8]) -> Result<Pixels, String> {
    let header = header(bytes).map_err(|what| format!("broken as Radiance HDR: {what}"))?;
    let (lines, along) = (header.lines, header.along_a_line);
    let rest = &bytes[header.length..];
    let size_px = match lines.is_vertical {
        true => checked_size(along.count, lines.count, rest.len())?,
        false => checked_size(lines.count, along.count, rest.len())?,
    };
    let count = size_px[0] * size_px[1];
    // The decoder knows one order and one header.
    let plain = format!(
        "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {} +X {}\n",
        lines.count, along.count
    );
    let whole = [plain.as_bytes(), rest].concat();
    let broken = |error: image::ImageError| format!("broken as Radiance HDR: {error}");
    let decoder = HdrDecoder::new(BufReader::new(whole.as_slice())).map_err(broken)?;
    let mut stored = vec![Vec3::ZERO; count];
    decoder
        .read_image(bytemuck::cast_slice_mut(&mut stored))
        .map_err(broken)?;

    if let Some(matrix) = header.srgb_from_file()? {
        for pixel in &mut stored {
            *pixel = (matrix * pixel.as_dvec3()).as_vec3();
        }
    }
    if (lines.is_vertical, lines.is_negative, along.is_negative) == (true, true, false) {
        return Ok(Pixels {
            size_px,
            pixels: stored,
            notes: header.notes,
        });
    }
    let mut pixels = vec![Vec3::ZERO; count];
    for (index, pixel) in stored.into_iter().enumerate() {
        let line = lines.place(index / along.count);
        let at = along.place(index % along.count);
        let [row, column] = match lines.is_vertical {
            true => [line, at],
            false => [at, line],
        };
        pixels[row * size_px[0] + column] = pixel;
    }
    Ok(Pixels {
        size_px,
        pixels,
        notes: header.notes,
    })
}

impl Axis {
    /// Row from the top, or column from the left, of the pixel with this number along the axis. (Radiance's Y points up.)
    fn place(self, index: usize) -> usize {
        match self.is_vertical == self.is_negative {
            true => index,
            false => self.count - 1 - index,
        }
    }
}

impl Header {
    /// Linear sRGB from what is in the file; `None` where that is it.
    fn srgb_from_file(&self) -> Result<Option<DMat3>, String> {
        let colours = match (self.is_xyz, &self.primaries) {
            (true, _) => srgb_from_xyz(EQUAL_ENERGY_WHITE),
            (false, None) => Some(DMat3::IDENTITY),
            (false, Some(primaries)) if is_srgb(primaries) => Some(DMat3::IDENTITY),
            (false, Some(primaries)) => primaries.srgb_from_these(),
        };
        let colours = colours
            .ok_or("its PRIMARIES span no colours: eight numbers of the CIE diagram are meant")?;
        let scale = self
            .color_correction
            .map(|part| 1.0 / (part * self.exposure));
        let whole = colours * DMat3::from_diagonal(scale.into());
        Ok((whole != DMat3::IDENTITY).then_some(whole))
    }
}

fn is_srgb(primaries: &Chromaticities) -> bool {
    let near = |one: DVec2, other: DVec2| (one - other).abs().max_element() < SAME_CHROMATICITY;
    let pairs = primaries.primaries.into_iter().zip(SRGB.primaries);
    near(primaries.white, SRGB.white) && pairs.into_iter().all(|(one, other)| near(one, other))
}

fn header(bytes: &[u8]) -> Result<Header, String> {
    let mut header = Header {
        exposure: 1.0,
        color_correction: [1.0; 3],
        primaries: None,
        is_xyz: false,
        lines: Axis {
            is_vertical: true,
            is_negative: true,
            count: 0,
        },
        along_a_line: Axis {
            is_vertical: false,
            is_negative: false,
            count: 0,
        },
        length: 0,
        notes: Vec::new(),
    };
    let mut lines = Lines { bytes, at: 0 };
    lines.next().ok_or("it is empty")?;
    loop {
        let line = lines.next().ok_or("its header has no end")?;
        if line.is_empty() {
            break;
        }
        let Some((key, value)) = line.split_once('=') else {
            // A comment, or the command that made the picture.
            continue;
        };
        // (What begins with a blank is of pictures that this one was made of.)
        header.take(key.trim_end(), value.trim())?;
    }
    let order = lines
        .next()
        .ok_or("its header does not say how large it is")?;
    let parts: Vec<&str> = order.split_whitespace().collect();
    let &[first, first_count, second, second_count] = parts.as_slice() else {
        return Err(format!("not a size: {order:?}; as in \"-Y 512 +X 1024\""));
    };
    header.lines = axis(first, first_count)?;
    header.along_a_line = axis(second, second_count)?;
    if header.lines.is_vertical == header.along_a_line.is_vertical {
        return Err(format!("not a size: {order:?}; as in \"-Y 512 +X 1024\""));
    }
    header.length = lines.at;
    Ok(header)
}

impl Header {
    fn take(&mut self, key: &str, value: &str) -> Result<(), String> {
        match key {
            "FORMAT" => match value {
                "32-bit_rle_rgbe" => self.is_xyz = false,
                "32-bit_rle_xyze" => self.is_xyz = true,
                _ => {
                    return Err(format!(
                        "FORMAT={value}; allowed: 32-bit_rle_rgbe, 32-bit_rle_xyze"
                    ));
                }
            },
            // Several stand for their product. Real files have EXPOSURE=0, which means nothing.
            "EXPOSURE" => match numbers(value) {
                Some([exposure]) if is_a_factor(exposure) => self.exposure *= exposure,
                _ => self.passed_over(key, value),
            },
            "COLORCORR" => match numbers::<3>(value) {
                Some(factors) if factors.into_iter().all(is_a_factor) => {
                    for (product, factor) in self.color_correction.iter_mut().zip(factors) {
                        *product *= factor;
                    }
                }
                _ => self.passed_over(key, value),
            },
            "PRIMARIES" => match numbers(value) {
                Some([rx, ry, gx, gy, bx, by, wx, wy]) => {
                    self.primaries = Some(Chromaticities {
                        primaries: [[rx, ry], [gx, gy], [bx, by]].map(DVec2::from_array),
                        white: DVec2::new(wx, wy),
                    });
                }
                _ => self.passed_over(key, value),
            },
            _ => {}
        }
        Ok(())
    }

    fn passed_over(&mut self, key: &str, value: &str) {
        self.notes.push(format!(
            "{key}={value} in its header means nothing and is passed over"
        ));
    }
}

fn is_a_factor(number: f64) -> bool {
    number.is_finite() && (1e-30..1e30).contains(&number)
}

fn numbers<const N: usize>(value: &str) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = value
        .split_whitespace()
        .map(|word| word.parse().ok())
        .collect();
    numbers?.try_into().ok()
}

fn axis(name: &str, count: &str) -> Result<Axis, String> {
    let (is_vertical, is_negative) = match name {
        "-Y" => (true, true),
        "+Y" => (true, false),
        "-X" => (false, true),
        "+X" => (false, false),
        _ => return Err(format!("not an axis: {name:?}; allowed: -Y, +Y, -X, +X")),
    };
    let count = count
        .parse()
        .ok()
        .filter(|count| *count > 0)
        .ok_or_else(|| format!("not a count of pixels: {count:?}"))?;
    Ok(Axis {
        is_vertical,
        is_negative,
        count,
    })
}

/// Lines of a header, which is text up to where the pixels begin.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Lines<'_> {
    /// The longest line that a header may have.
    const LONGEST: usize = 4096;

    fn next(&mut self) -> Option<String> {
        let rest = self.bytes.get(self.at..)?;
        let end = rest
            .iter()
            .take(Self::LONGEST)
            .position(|&byte| byte == b'\n')?;
        self.at += end + 1;
        let line = String::from_utf8_lossy(&rest[..end]);
        Some(line.trim_end_matches('\r').to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns of three rows; each pixel is a power of two of its own.
    fn file(header: &str, order: &str) -> Vec<u8> {
        let mut bytes = format!("{header}\n\n{order}\n").into_bytes();
        for index in 0..6 {
            bytes.extend([128, 64, 32, 129 + index]);
        }
        bytes
    }

    fn pixels(header: &str, order: &str) -> (Vec<Vec3>, [usize; 2]) {
        let read = read(&file(header, order)).unwrap();
        (read.pixels, read.size_px)
    }

    const PLAIN: &str = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe";

    #[test]
    fn any_magic_word_and_exposure_and_correction_are_taken_as_they_are_meant() {
        let (plain, size_px) = pixels(PLAIN, "-Y 3 +X 2");
        assert_eq!(size_px, [2, 3]);
        assert!((plain[0].x - 1.0).abs() < 0.01, "{plain:?}");
        let same = |header: &str, factor: Vec3| {
            let (found, _) = pixels(header, "-Y 3 +X 2");
            for (found, plain) in found.iter().zip(&plain) {
                assert!(
                    found.abs_diff_eq(*plain * factor, 1e-6 * plain.x),
                    "{header}"
                );
            }
        };
        same("#?RGBE\nFORMAT=32-bit_rle_rgbe", Vec3::ONE);
        same("#?AUTOPANO\r\n# made by a program\r", Vec3::ONE);
        same(&format!("{PLAIN}\nEXPOSURE=4"), Vec3::splat(0.25));
        same(
            &format!("{PLAIN}\nEXPOSURE= 4.0\nEXPOSURE=0.5"),
            Vec3::splat(0.5),
        );
        same(&format!("{PLAIN}\nEXPOSURE=0"), Vec3::ONE);
        // A picture that this one was made of, whose exposure is in the pixels.
        same(&format!("{PLAIN}\n\tEXPOSURE=4"), Vec3::ONE);
        same(
            &format!("{PLAIN}\nCOLORCORR= 2 1 .5"),
            Vec3::new(0.5, 1.0, 2.0),
        );
        same(
            &format!("{PLAIN}\nPRIMARIES=.64 .33 .3 .6 .15 .06 .3127 .329"),
            Vec3::ONE,
        );
        let told = read(&file(&format!("{PLAIN}\nEXPOSURE=0"), "-Y 3 +X 2")).unwrap();
        assert_eq!(told.notes.len(), 1);
    }

    #[test]
    fn grey_stays_grey_in_other_primaries_and_in_xyz() {
        let grey = |header: &str| {
            let mut bytes = format!("{header}\n\n-Y 1 +X 1\n").into_bytes();
            bytes.extend([128, 128, 128, 129]);
            read(&bytes).unwrap().pixels[0]
        };
        for header in [
            "#?RADIANCE\nPRIMARIES= 0.640 0.330 0.290 0.600 0.150 0.060 0.333 0.333",
            "#?RADIANCE\nFORMAT=32-bit_rle_xyze",
        ] {
            let found = grey(header);
            assert!(found.abs_diff_eq(Vec3::splat(found.y), 2e-3), "{found}");
        }
    }

    #[test]
    fn pixels_lie_as_the_header_orders_them() {
        // Powers of two by row from the top and column from the left.
        let ordered = |order: &str| -> Vec<i32> {
            let (pixels, _) = pixels(PLAIN, order);
            pixels
                .iter()
                .map(|pixel| pixel.x.log2().round() as i32)
                .collect()
        };
        assert_eq!(ordered("-Y 3 +X 2"), [0, 1, 2, 3, 4, 5]);
        assert_eq!(ordered("+Y 3 +X 2"), [4, 5, 2, 3, 0, 1]);
        assert_eq!(ordered("-Y 3 -X 2"), [1, 0, 3, 2, 5, 4]);
        assert_eq!(ordered("+Y 3 -X 2"), [5, 4, 3, 2, 1, 0]);
        // Columns first.
        assert_eq!(ordered("+X 2 -Y 3"), [0, 3, 1, 4, 2, 5]);
        assert_eq!(ordered("-X 2 +Y 3"), [5, 2, 4, 1, 3, 0]);
    }

    #[test]
    fn headers_that_lie_are_errors_and_cost_nothing() {
        let refused = |bytes: &[u8], word: &str| {
            let text = read(bytes).unwrap_err();
            assert!(text.contains(word), "{text:?} lacks {word:?}");
        };
        refused(b"#?RADIANCE\n\n-Y 8192 +X 16384\n\x02\x02", "cut off");
        refused(b"#?RADIANCE\n\n-Y 99999 +X 99999\n", "too many");
        refused(
            b"#?RADIANCE\n\n-Y 99999999999 +X 99999999999\n",
            "can be counted",
        );
        refused(b"#?RADIANCE\n\n-Y 2 -Y 2\n", "not a size");
        refused(b"#?RADIANCE\n\n-Y -2 +X 2\n", "not a count");
        refused(
            b"#?RADIANCE\nFORMAT=32-bit_float\n\n-Y 2 +X 2\n",
            "32-bit_rle_rgbe",
        );
        refused(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n", "no end");
        refused(&[&b"#?RADIANCE\n"[..], &[b'a'; 9000]].concat(), "no end");
        let line = b"#?RADIANCE\nPRIMARIES=.1 .1 .2 .2 .3 .3 .2 .2\n\n-Y 1 +X 1\n\x80\x80\x80\x81";
        refused(line, "PRIMARIES");
    }
}
