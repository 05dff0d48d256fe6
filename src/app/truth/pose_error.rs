//! How far poses are off, in the pixels that somebody who looks at the picture sees.

use glam::{DAffine3, DVec2, DVec3};

use crate::app::stages::stats::quantile;
use crate::geometry::camera::Intrinsics;

/// Places about an anchor where virtual things stand, metres in its frame.
const PLACES_M: [DVec3; 4] = [
    DVec3::ZERO,
    DVec3::new(0.0, 0.0, 0.08),
    DVec3::new(0.08, 0.05, 0.0),
    DVec3::new(-0.08, 0.05, 0.05),
];

/// By how much a pose that was found moves each of four places about the anchor in the undistorted picture.
pub fn shifts_px(intrinsics: &Intrinsics, found: &DAffine3, truth: &DAffine3) -> [DVec2; 4] {
    let pixel = |camera_from_anchor: &DAffine3, place_m: DVec3| {
        let in_camera = camera_from_anchor.transform_point3(place_m);
        intrinsics.pixel_from_plane(in_camera.truncate() / in_camera.z)
    };
    PLACES_M.map(|place_m| pixel(found, place_m) - pixel(truth, place_m))
}

/// The errors of an anchor's poses, frame by frame.
#[derive(Debug, Clone, Default)]
pub struct PoseErrors {
    frames: Vec<Option<[DVec2; 4]>>,
}

impl PoseErrors {
    /// Adds the next frame: [`shifts_px`], or `None` without a pose.
    pub fn add(&mut self, shifts_px: Option<[DVec2; 4]>) {
        self.frames.push(shifts_px);
    }

    /// Frames with a pose, percent of all.
    pub fn with_pose_pct(&self) -> f64 {
        100.0 * self.frames.iter().flatten().count() as f64 / self.frames.len().max(1) as f64
    }

    /// The shift that so large a part of the frames with a pose keeps, each the mean of its places; `None` without one.
    pub fn shift_px(&self, part: f64) -> Option<f64> {
        let means: Vec<f64> = self.frames.iter().flatten().map(mean_length).collect();
        (!means.is_empty()).then(|| quantile(&means, part))
    }

    /// What the eye sees as jitter: the root mean square of how much the shift changes from a frame to the next, the
    /// mean of the places; `None` without two poses in a row.
    pub fn jitter_px(&self) -> Option<f64> {
        let neighbours = self.frames.windows(2);
        let squares: Vec<f64> = neighbours
            .filter_map(|pair| {
                let (before, after) = (pair[0].as_ref()?, pair[1].as_ref()?);
                let change: [DVec2; 4] = std::array::from_fn(|place| after[place] - before[place]);
                Some(mean_length(&change).powi(2))
            })
            .collect();
        (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
    }
}

fn mean_length(shifts: &[DVec2; 4]) -> f64 {
    shifts.iter().map(|shift| shift.length()).sum::<f64>() / shifts.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;

    const CAMERA: Intrinsics = Intrinsics {
        size_px: [640, 480],
        focal_px: DVec2::new(600.0, 500.0),
        center_px: DVec2::new(320.0, 240.0),
        distortion: Distortion::NONE,
    };

    /// A table that lies square before the camera: what is 1 mm aside is focal_px / depth mm aside in the picture.
    #[test]
    fn shift_of_a_translation_is_focal_length_over_depth() {
        let at = |x: f64| DAffine3::from_translation(DVec3::new(x, 0.0, 2.0));
        let shifts = shifts_px(&CAMERA, &at(0.001), &at(0.0));
        let depths_m = [2.0, 2.08, 2.0, 2.05];
        for (shift, depth_m) in shifts.iter().zip(depths_m) {
            let expected = DVec2::new(0.6 / depth_m, 0.0);
            assert!(shift.distance(expected) < 1e-9, "{shift} {expected}");
        }
    }

    #[test]
    fn jitter_is_change_and_not_shift() {
        let all = |x: f64| Some([DVec2::new(x, 0.0); 4]);
        let mut errors = PoseErrors::default();
        [all(1.0), all(1.0), None, all(5.0), all(2.0), all(6.0)]
            .into_iter()
            .for_each(|frame| errors.add(frame));
        // Changes of 0, 3 and 4; those beside the gap do not count.
        let expected = (25.0_f64 / 3.0).sqrt();
        assert!((errors.jitter_px().unwrap() - expected).abs() < 1e-12);
        assert_eq!(errors.shift_px(0.5), Some(2.0));
        assert!((errors.with_pose_pct() - 500.0 / 6.0).abs() < 1e-12);
        assert_eq!(PoseErrors::default().jitter_px(), None);
    }
}
