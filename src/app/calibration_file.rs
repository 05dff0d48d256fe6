//! Calibrations as gnomon writes them: the TOML that `capture::calibration` reads, with every digit.

use crate::geometry::camera::Intrinsics;

/// The file's text.
pub fn calibration_text(intrinsics: &Intrinsics) -> String {
    let Intrinsics {
        size_px: [width, height],
        focal_px,
        center_px,
        distortion: [k1, k2, p1, p2, k3],
    } = intrinsics;
    // `?` writes as many digits as tell the number from its neighbours, and a point in each.
    format!(
        "size_px = [{width}, {height}]\n\
         focal_px = [{:?}, {:?}]\n\
         center_px = [{:?}, {:?}]\n\
         distortion = [{k1:?}, {k2:?}, {p1:?}, {p2:?}, {k3:?}]    # k1, k2, p1, p2, k3\n",
        focal_px.x, focal_px.y, center_px.x, center_px.y
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::capture::load_calibration;
    use glam::DVec2;

    #[test]
    fn what_is_written_is_read_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("camera.toml");
        let intrinsics = Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::new(615.1 / 3.0, 600.0),
            center_px: DVec2::new(321.4, 1e-7),
            distortion: [0.1 + 0.2, -0.19, 1.0 / 3e9, 0.0, 5e-324],
        };
        std::fs::write(&path, calibration_text(&intrinsics)).unwrap();
        assert_eq!(load_calibration(&path).unwrap(), intrinsics);
    }
}
