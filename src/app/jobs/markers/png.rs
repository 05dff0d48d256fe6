//! A page as PNG that says its resolution, so that it prints in its true size. A pixel that an edge goes through gets the
//! light that its white part throws back: edges lie where they should to a fraction of a pixel.

use anyhow::Result;
use opencv::core::{Mat, Point, Scalar};
use opencv::imgproc;

use super::page::{Page, Rect, Text};
use crate::app::files::made_by::SOFTWARE;
use crate::light::srgb::srgb_level;

const MM_PER_INCH: f64 = 25.4;
const FONT: i32 = imgproc::FONT_HERSHEY_SIMPLEX;
/// Height of a capital and thickness of a stroke, as parts of the size of the type.
const CAPITAL: f64 = 0.7;
const STROKE: f64 = 0.08;

/// The whole file: grey, 8 bits.
///
/// # Errors
/// A failure of OpenCV, which letters, or of the encoder.
pub fn bytes(page: &Page, dpi: f64) -> Result<Vec<u8>> {
    let pixels_per_mm = dpi / MM_PER_INCH;
    let ([width, height], mut grey) = shapes(page, pixels_per_mm);
    let mut picture = Mat::new_rows_cols_with_data_mut(height as i32, width as i32, &mut grey)?;
    for text in &page.texts {
        letter(&mut picture, text, pixels_per_mm)?;
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.add_text_chunk("Software".to_owned(), SOFTWARE.to_owned())?;
    let per_metre = (pixels_per_mm * 1000.0).round() as u32;
    encoder.set_pixel_dims(Some(png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&grey)?;
    writer.finish()?;
    Ok(bytes)
}

/// Width, height and grey levels, rows from the top, of all but the small print.
fn shapes(page: &Page, pixels_per_mm: f64) -> ([u32; 2], Vec<u8>) {
    let size_px = page.size_mm.map(|mm| (mm * pixels_per_mm).round() as u32);
    let [width, height] = size_px.map(|side| side as usize);
    let mut black = vec![0.0_f32; width * height];
    for shape in &page.blacks {
        add(&mut black, width, &shape.outline, pixels_per_mm, 1.0);
        for hole in &shape.holes {
            add(&mut black, width, hole, pixels_per_mm, -1.0);
        }
    }
    let levels = black
        .into_iter()
        .map(|black| srgb_level(1.0 - black))
        .collect();
    (size_px, levels)
}

/// Adds the area that a rectangle covers of each pixel.
fn add(black: &mut [f32], width: usize, rect: &Rect, pixels_per_mm: f64, sign: f32) {
    let height = black.len() / width.max(1);
    let range = |axis: usize, most: usize| {
        let low = (rect.at[axis] * pixels_per_mm).clamp(0.0, most as f64);
        let high = ((rect.at[axis] + rect.size[axis]) * pixels_per_mm).clamp(0.0, most as f64);
        (low, high)
    };
    let ((left, right), (top, bottom)) = (range(0, width), range(1, height));
    let covered = |pixel: usize, low: f64, high: f64| {
        let (from, to) = (low.max(pixel as f64), high.min(pixel as f64 + 1.0));
        (to - from).max(0.0) as f32
    };
    for y in top as usize..(bottom.ceil() as usize).min(height) {
        let share = sign * covered(y, top, bottom);
        for x in left as usize..(right.ceil() as usize).min(width) {
            black[y * width + x] += share * covered(x, left, right);
        }
    }
}

fn letter(
    picture: &mut impl opencv::core::ToInputOutputArray,
    text: &Text,
    pixels_per_mm: f64,
) -> opencv::Result<()> {
    let size_px = text.size_mm * pixels_per_mm;
    let thickness = (STROKE * size_px).round().max(1.0) as i32;
    let height_px = (CAPITAL * size_px).round().max(1.0) as i32;
    let scale = imgproc::get_font_scale_from_height(FONT, height_px, thickness)?;
    let [x, y] = text.at.map(|at| (at * pixels_per_mm).round() as i32);
    imgproc::put_text(
        picture,
        &text.text,
        Point::new(x, y),
        FONT,
        scale,
        Scalar::all(0.0),
        thickness,
        imgproc::LINE_AA,
        false,
    )
}
