//! A picture of what a calibration rests on: the corners of all views, coloured by how far off they are, and the parts of
//! the picture that have none.

use opencv::core::{CV_8UC4, Mat, Point, Rect, Scalar, Size};
use opencv::imgproc;
use opencv::prelude::*;

use super::{CalibrateError, Calibration};

/// 8-bit RGBA, rows from the top.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CoveragePicture {
    /// Width and height.
    pub size_px: [u32; 2],
    /// The pixels.
    pub rgba: Vec<u8>,
}

/// Width that small pictures are blown up to, at least.
const LEAST_WIDTH_PX: u32 = 800;
/// Below the picture: what the colours mean.
const LEGEND_PX: i32 = 44;
/// The scale of colours reaches so many times the root mean square error.
const SCALE_TIMES: f64 = 3.0;
const PAPER: [f64; 3] = [246.0, 246.0, 242.0];
const LACKING: [f64; 3] = [250.0, 214.0, 206.0];
const LINE: [f64; 3] = [205.0, 205.0, 200.0];
const INK: [f64; 3] = [40.0, 40.0, 40.0];

/// Draws it.
///
/// # Errors
/// A failure of OpenCV.
pub fn coverage_picture(calibration: &Calibration) -> Result<CoveragePicture, CalibrateError> {
    let [width, height] = calibration.intrinsics.size_px;
    let zoom = LEAST_WIDTH_PX.div_ceil(width).max(1);
    let size = Size::new((width * zoom) as i32, (height * zoom) as i32);
    let sheet = Size::new(size.width, size.height + LEGEND_PX);
    let mut picture = Mat::new_size_with_default(sheet, CV_8UC4, color(PAPER))?;
    draw_cells(&mut picture, size, calibration)?;
    let scale_px = SCALE_TIMES * calibration.rms_px;
    for (pixel, off_px) in calibration.views.iter().flat_map(|view| &view.residuals) {
        // The middle of a pixel's block of `zoom` x `zoom`.
        let middle = (*pixel + 0.5) * f64::from(zoom) - 0.5;
        let center = Point::new(middle.x.round() as i32, middle.y.round() as i32);
        let color = ramp(off_px.length() / scale_px);
        imgproc::circle(
            &mut picture,
            center,
            4,
            color,
            imgproc::FILLED,
            imgproc::LINE_AA,
            0,
        )?;
    }
    draw_legend(&mut picture, size, calibration, scale_px)?;
    Ok(CoveragePicture {
        size_px: [sheet.width as u32, sheet.height as u32],
        rgba: picture.data_bytes()?.to_vec(),
    })
}

/// A grid; cells without a corner are tinted.
fn draw_cells(picture: &mut Mat, size: Size, calibration: &Calibration) -> opencv::Result<()> {
    let coverage = &calibration.coverage;
    let (columns, rows) = (coverage.columns as i32, coverage.rows as i32);
    for (cell, &views) in coverage.views.iter().enumerate() {
        let (column, row) = (cell as i32 % columns, cell as i32 / columns);
        let (left, top) = (column * size.width / columns, row * size.height / rows);
        let (right, bottom) = (
            (column + 1) * size.width / columns,
            (row + 1) * size.height / rows,
        );
        let place = Rect::new(left, top, right - left, bottom - top);
        if views == 0 {
            imgproc::rectangle(
                picture,
                place,
                color(LACKING),
                imgproc::FILLED,
                imgproc::LINE_8,
                0,
            )?;
        }
        imgproc::rectangle(picture, place, color(LINE), 1, imgproc::LINE_8, 0)?;
    }
    Ok(())
}

fn draw_legend(
    picture: &mut Mat,
    size: Size,
    calibration: &Calibration,
    scale_px: f64,
) -> opencv::Result<()> {
    const BAR_PX: i32 = 200;
    let top = size.height + 14;
    for x in 0..BAR_PX {
        let share = f64::from(x) / f64::from(BAR_PX);
        let place = Rect::new(12 + x, top, 1, 16);
        imgproc::rectangle(
            picture,
            place,
            ramp(share),
            imgproc::FILLED,
            imgproc::LINE_8,
            0,
        )?;
    }
    let says = format!(
        "off by 0 to {scale_px:.2} px;  {} views, {:.3} px rms;  tinted: no corner yet",
        calibration.views.len(),
        calibration.rms_px
    );
    let start = Point::new(BAR_PX + 24, top + 13);
    let font = imgproc::FONT_HERSHEY_SIMPLEX;
    imgproc::put_text(
        picture,
        &says,
        start,
        font,
        0.45,
        color(INK),
        1,
        imgproc::LINE_AA,
        false,
    )
}

/// Green over yellow to red, and red beyond.
fn ramp(share: f64) -> Scalar {
    let share = share.clamp(0.0, 1.0);
    let (red, green) = ((2.0 * share).min(1.0), (2.0 - 2.0 * share).min(1.0));
    color([30.0 + 190.0 * red, 30.0 + 140.0 * green, 40.0])
}

fn color([red, green, blue]: [f64; 3]) -> Scalar {
    Scalar::new(red, green, blue, 255.0)
}
