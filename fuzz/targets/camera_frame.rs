//! Pictures as drivers of cameras hand them out.

use gnomon::capture::live::decode::{RawPicture, Tolerance, rgba_of};
use gnomon::scene::PixelFormat;

// The choice is the format; width, height and padding come next.
pub fn run(input: &[u8]) {
    let formats = PixelFormat::BY_NAME;
    let (format, rest) = super::choice(input, formats.len()).unwrap_or_default();
    if let Some(([width, height, padding], bytes)) = rest.split_first_chunk() {
        let (width, height) = (u32::from(*width), u32::from(*height));
        let picture = RawPicture {
            bytes,
            pixels: formats[format].1,
            size_px: [width, height],
            stride_bytes: match padding {
                0 => 0,
                _ => (width + u32::from(*padding)) as usize,
            },
        };
        for tolerance in [Tolerance::Strict, Tolerance::Lenient] {
            if let Some(([width, height], rgba)) = rgba_of(picture, tolerance) {
                assert_eq!(rgba.len(), width as usize * height as usize * 4);
            }
        }
    }
}
