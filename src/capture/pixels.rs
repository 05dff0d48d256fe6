//! From OpenCV's pictures to plain pixels.

use opencv::core::{Mat, MatTraitConst, Vec4b};
use opencv::imgproc;

/// Width and height of a picture.
pub(super) fn size_of(picture: &Mat) -> [u32; 2] {
    [picture.cols().unsigned_abs(), picture.rows().unsigned_abs()]
}

/// 8-bit RGBA of an 8-bit BGR picture.
pub(super) fn rgba_from_bgr(bgr: &Mat) -> opencv::Result<Vec<u8>> {
    let mut rgba = vec![0; bgr.total() * 4];
    let mut target = Mat::new_rows_cols_with_bytes_mut::<Vec4b>(bgr.rows(), bgr.cols(), &mut rgba)?;
    imgproc::cvt_color_def(bgr, &mut target, imgproc::COLOR_BGR2RGBA)?;
    drop(target);
    Ok(rgba)
}
