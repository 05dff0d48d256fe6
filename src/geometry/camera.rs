//! The pinhole camera with OpenCV's lens distortion.

use glam::{DVec2, Mat4, Vec4};

/// Intrinsics of a camera: the matrix K and the lens distortion, both as OpenCV defines them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intrinsics {
    /// Width and height in pixels.
    pub size_px: [u32; 2],
    /// Focal lengths in pixels.
    pub focal_px: DVec2,
    /// Principal point in pixels; an integer coordinate is a pixel's centre.
    pub center_px: DVec2,
    /// `k1 k2 p1 p2 k3`.
    pub distortion: [f64; 5],
}

impl Intrinsics {
    /// Applies the lens distortion to a point of the plane z = 1 in camera space.
    pub fn distort(&self, point: DVec2) -> DVec2 {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let (x, y) = (point.x, point.y);
        let r2 = point.length_squared();
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        DVec2::new(
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
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
