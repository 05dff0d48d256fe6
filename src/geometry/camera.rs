//! The pinhole camera with a lens before it.

use glam::{DMat2, DVec2, DVec3, Mat4, Vec4};

pub use super::lens::Distortion;

/// Pixels of the longest side of a picture: libapriltag ends the program on a longer one.
pub const MOST_SIDE_PX: u32 = 32_767;

/// Intrinsics of a camera: the matrix K and the lens distortion, both as OpenCV defines them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// Focal lengths in pixels.
    pub focal_px: DVec2,
    /// Principal point in pixels; an integer coordinate is a pixel's centre.
    pub center_px: DVec2,
    /// What the lens does.
    pub distortion: Distortion,
}

/// A point as a camera sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProjectedPoint {
    /// Where it is in the picture.
    pub pixel: DVec2,
    /// The derivative of the pixel by the point's x, y and z in camera space, pixels per metre.
    pub by_place: [DVec2; 3],
}

impl ProjectedPoint {
    /// The derivative by the place in camera space of how far the pixel lies along a direction of the picture.
    #[inline]
    pub fn gradient(&self, direction: DVec2) -> DVec3 {
        DVec3::from(self.by_place.map(|column| column.dot(direction)))
    }

    /// The derivatives by the place in camera space of the pixel's x and y.
    #[inline]
    pub fn gradients(&self) -> [DVec3; 2] {
        let [x, y, z] = self.by_place;
        [DVec3::new(x.x, y.x, z.x), DVec3::new(x.y, y.y, z.y)]
    }

    /// The step in the picture, pixels, for one of the point in camera space, metres.
    #[inline]
    pub fn step_px(&self, step_m: DVec3) -> DVec2 {
        let [x, y, z] = self.by_place;
        x * step_m.x + y * step_m.y + z * step_m.z
    }
}

impl Intrinsics {
    /// The depth from which on a point is in front of the camera, metres.
    const NEAREST_M: f64 = 1e-6;

    /// The point of the plane z = 1 on the ray of a point in camera space; `None` behind the camera.
    #[inline]
    fn plane_from_camera(in_camera_m: DVec3) -> Option<DVec2> {
        (in_camera_m.z > Self::NEAREST_M).then(|| in_camera_m.truncate() / in_camera_m.z)
    }

    /// The undistorted pixel of a point in camera space; `None` behind the camera.
    #[inline]
    pub fn undistorted_pixel_of(&self, in_camera_m: DVec3) -> Option<DVec2> {
        Some(self.pixel_from_plane(Self::plane_from_camera(in_camera_m)?))
    }

    /// The distorted pixel of a point in camera space; `None` behind the camera.
    #[inline]
    pub fn pixel_of(&self, in_camera_m: DVec3) -> Option<DVec2> {
        let point = Self::plane_from_camera(in_camera_m)?;
        Some(self.pixel_from_plane(self.distort(point)))
    }

    /// The undistorted pixel of a point in camera space, with its derivative; `None` behind the camera.
    #[inline]
    pub fn project_undistorted(&self, in_camera_m: DVec3) -> Option<ProjectedPoint> {
        let point = Self::plane_from_camera(in_camera_m)?;
        let scale = self.focal_px / in_camera_m.z;
        Some(ProjectedPoint {
            pixel: self.pixel_from_plane(point),
            by_place: [
                DVec2::new(scale.x, 0.0),
                DVec2::new(0.0, scale.y),
                -(scale * point),
            ],
        })
    }

    /// The distorted pixel of a point in camera space, with its derivative; `None` behind the camera.
    #[inline]
    pub fn project(&self, in_camera_m: DVec3) -> Option<ProjectedPoint> {
        let point = Self::plane_from_camera(in_camera_m)?;
        let lens = self.distortion_jacobian(point);
        let scale = DMat2::from_diagonal(self.focal_px / in_camera_m.z) * lens;
        Some(ProjectedPoint {
            pixel: self.pixel_from_plane(self.distort(point)),
            by_place: [scale.x_axis, scale.y_axis, -(scale * point)],
        })
    }

    /// Applies the lens distortion to a point of the plane z = 1 in camera space.
    pub fn distort(&self, point: DVec2) -> DVec2 {
        self.distortion.distort(point)
    }

    /// The derivative of [`Self::distort`] by the point.
    pub fn distortion_jacobian(&self, point: DVec2) -> DMat2 {
        self.distortion.jacobian(point)
    }

    /// The undistorted pixel of a distorted one, to the last digits; `None` where the distortion model folds and has no
    /// inverse.
    pub fn undistorted_pixel(&self, distorted_px: DVec2) -> Option<DVec2> {
        let point = self
            .distortion
            .undistort(self.plane_from_pixel(distorted_px))?;
        Some(self.pixel_from_plane(point))
    }

    /// The pixel of a point of the plane z = 1, without distortion.
    pub fn pixel_from_plane(&self, point: DVec2) -> DVec2 {
        point * self.focal_px + self.center_px
    }

    /// The point of the plane z = 1 under an undistorted pixel.
    pub fn plane_from_pixel(&self, pixel: DVec2) -> DVec2 {
        (pixel - self.center_px) / self.focal_px
    }

    /// Projection from camera space (x right, y down, z forward) to wgpu's clip space, reversed depth with the far
    /// plane at infinity: depth is `near_m / z`, and directions (w = 0) land at depth 0 exactly, so that shadow
    /// volumes extruded to infinity are never clipped.
    pub fn clip_from_camera(&self, near_m: f32) -> Mat4 {
        let [width, height] = self.size_px.map(f64::from);
        // A pixel's integer coordinate is its centre here; in clip space the picture's edge is at ±1.
        let x_scale = 2.0 * self.focal_px.x / width;
        let y_scale = 2.0 * self.focal_px.y / height;
        let x_shift = 2.0 * (self.center_px.x + 0.5) / width - 1.0;
        let y_shift = 2.0 * (self.center_px.y + 0.5) / height - 1.0;
        Mat4::from_cols(
            Vec4::new(x_scale as f32, 0.0, 0.0, 0.0),
            Vec4::new(0.0, -y_scale as f32, 0.0, 0.0),
            Vec4::new(x_shift as f32, -y_shift as f32, 0.0, 1.0),
            Vec4::new(0.0, 0.0, near_m, 0.0),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(distortion: [f64; 5]) -> Intrinsics {
        Intrinsics {
            size_px: [640, 480],
            focal_px: DVec2::new(615.0, 613.0),
            center_px: DVec2::new(321.4, 238.2),
            distortion: Distortion::Polynomial(distortion),
        }
    }

    const WIDE: [f64; 5] = [-0.35, 0.15, -0.002, 0.001, -0.03];

    #[test]
    fn undistorting_inverts_distorting() {
        for distortion in [[0.0; 5], [0.08, -0.19, 0.0008, -0.0005, 0.05], WIDE] {
            let camera = camera(distortion);
            for pixel in [(0.0, 0.0), (639.0, 0.0), (320.0, 240.0), (17.0, 461.0)].map(DVec2::from)
            {
                let undistorted = camera.undistorted_pixel(pixel).unwrap();
                let back =
                    camera.pixel_from_plane(camera.distort(camera.plane_from_pixel(undistorted)));
                assert!(
                    (back - pixel).length() < 1e-9,
                    "{pixel} came back as {back}"
                );
            }
        }
    }

    #[test]
    fn no_point_is_made_up_where_the_model_folds() {
        // r (1 - r²/2) never exceeds 0.55, the picture's corner lies at 0.65.
        let camera = camera([-0.5, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(camera.undistorted_pixel(DVec2::ZERO), None);
    }

    #[test]
    fn projections_are_similar_triangles() {
        let camera = camera([0.0; 5]);
        let place_m = DVec3::new(0.2, -0.1, 2.0);
        let expected_px = DVec2::new(321.4 + 61.5, 238.2 - 30.65);
        for found in [
            camera.pixel_of(place_m),
            camera.undistorted_pixel_of(place_m),
            camera.project(place_m).map(|found| found.pixel),
            camera.project_undistorted(place_m).map(|found| found.pixel),
        ] {
            assert!(found.unwrap().distance(expected_px) < 1e-12);
        }
        assert_eq!(camera.pixel_of(-place_m), None);
        assert_eq!(camera.undistorted_pixel_of(DVec3::X), None);
    }

    #[test]
    fn derivatives_are_what_small_steps_make() {
        const STEP_M: f64 = 1e-6;
        let place_m = DVec3::new(0.21, -0.13, 0.6);
        let (bent, straight) = (camera(WIDE), camera([0.0; 5]));
        for (camera, found) in [
            (bent, bent.project(place_m)),
            (straight, straight.project_undistorted(place_m)),
        ] {
            let found = found.unwrap();
            let moved = |by: DVec3| camera.pixel_of(place_m + by).unwrap();
            for (axis, derivative) in DVec3::AXES.into_iter().zip(found.by_place) {
                let step_m = axis * STEP_M;
                let slope = (moved(step_m) - moved(-step_m)) / (2.0 * STEP_M);
                assert!(slope.distance(derivative) < 1e-4, "{slope} {derivative}");
                assert_eq!(found.step_px(axis), derivative);
                assert_eq!(found.gradient(DVec2::Y).dot(axis), derivative.y);
                assert_eq!(found.gradients()[0].dot(axis), derivative.x);
            }
        }
    }
}
