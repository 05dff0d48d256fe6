//! What a lens does to the plane z = 1: OpenCV's models, with their derivatives and inverses.

use std::f64::consts::FRAC_PI_2;

use glam::{DMat2, DMat3, DVec2, DVec3};

/// A lens's distortion, as OpenCV's module `calib3d` defines it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Distortion {
    /// Brown's polynomial: `k1 k2 p1 p2 k3`.
    Polynomial([f64; 5]),
    /// The rational model with thin prisms and a tilted sensor: `k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty`.
    Rational([f64; 14]),
    /// A fisheye, whose radius is the angle (equidistant) times a polynomial of its square: `k1 k2 k3 k4`
    /// (Kannala and Brandt, "A generic camera model and calibration method", 2006).
    Fisheye([f64; 4]),
}

/// Newton's rounds until an inverse is given up.
const ROUNDS: usize = 60;
/// Relative change at which an inverse is found.
const TOLERANCE: f64 = 1e-12;

impl Distortion {
    /// A lens that does nothing.
    pub const NONE: Self = Self::Polynomial([0.0; 5]);

    /// Whether a picture through the lens is another than the ideal one.
    pub fn distorts(&self) -> bool {
        match self {
            Self::Polynomial(coefficients) => *coefficients != [0.0; 5],
            Self::Rational(coefficients) => *coefficients != [0.0; 14],
            Self::Fisheye(_) => true,
        }
    }

    /// The coefficients in OpenCV's order.
    pub fn coefficients(&self) -> &[f64] {
        match self {
            Self::Polynomial(coefficients) => coefficients,
            Self::Rational(coefficients) => coefficients,
            Self::Fisheye(coefficients) => coefficients,
        }
    }

    /// The place on the plane z = 1 where the lens shows a point of it.
    pub fn distort(&self, point: DVec2) -> DVec2 {
        match self {
            Self::Polynomial(coefficients) => polynomial(coefficients, point),
            Self::Rational(coefficients) => {
                let bent = rational(coefficients, point);
                match tilt(coefficients) {
                    Some(tilt) => on_plane(tilt * bent.extend(1.0)),
                    None => bent,
                }
            }
            Self::Fisheye(coefficients) => {
                let radius = point.length();
                let angle = radius.atan();
                // At the axis the radius is the angle.
                if radius < 1e-9 {
                    return point;
                }
                point * (fisheye_radius(coefficients, angle) / radius)
            }
        }
    }

    /// The derivative of [`Self::distort`] by the point.
    pub fn jacobian(&self, point: DVec2) -> DMat2 {
        match self {
            Self::Polynomial(coefficients) => polynomial_jacobian(coefficients, point),
            Self::Rational(coefficients) => {
                let bend = rational_jacobian(coefficients, point);
                let Some(tilt) = tilt(coefficients) else {
                    return bend;
                };
                let place = tilt * rational(coefficients, point).extend(1.0);
                let seen = on_plane(place);
                let column = |axis: DVec3| (axis.truncate() - seen * axis.z) / place.z;
                DMat2::from_cols(column(tilt.x_axis), column(tilt.y_axis)) * bend
            }
            Self::Fisheye(coefficients) => {
                let r2 = point.length_squared();
                if r2 < 1e-12 {
                    return DMat2::IDENTITY;
                }
                let radius = r2.sqrt();
                let angle = radius.atan();
                let scale = fisheye_radius(coefficients, angle) / radius;
                let slope = (fisheye_slope(coefficients, angle) / (1.0 + r2) - scale) / r2;
                let outer = DMat2::from_cols(point * point.x, point * point.y);
                DMat2::from_diagonal(DVec2::splat(scale)) + outer * slope
            }
        }
    }

    /// The point of the plane z = 1 that the lens shows at a place, to the last digits; `None` where there is none, or
    /// only one beyond the place where the model turns back on itself.
    ///
    /// OpenCV's `undistortPoints` stops after five rounds of a fixed-point iteration, tenths of a pixel short in a wide
    /// lens's corners.
    pub fn undistort(&self, target: DVec2) -> Option<DVec2> {
        match self {
            Self::Fisheye(coefficients) => undistort_fisheye(coefficients, target),
            Self::Polynomial(_) | Self::Rational(_) => self.undistort_by_newton(target),
        }
    }

    fn undistort_by_newton(&self, target: DVec2) -> Option<DVec2> {
        let mut point = target;
        let mut off = self.distort(point) - target;
        for _ in 0..ROUNDS {
            let mut step = self.jacobian(point).inverse() * off;
            if !step.is_finite() {
                return None;
            }
            let mut next = self.distort(point - step) - target;
            // A step over a fold is too long.
            let mut halvings = 0;
            while next.length_squared().is_nan() || next.length() > 2.0 * off.length() + TOLERANCE {
                step *= 0.5;
                next = self.distort(point - step) - target;
                halvings += 1;
                if halvings > 30 {
                    return None;
                }
            }
            point -= step;
            off = next;
            if step.length() < TOLERANCE * (1.0 + point.length()) {
                return self.is_unfolded_up_to(point).then_some(point);
            }
        }
        None
    }

    /// Whether the map from the axis to a point turns back nowhere: a mirrored map has a determinant below 0, and one
    /// that is folded twice lies behind such a one.
    fn is_unfolded_up_to(&self, point: DVec2) -> bool {
        const STEPS: u32 = 16;
        (1..=STEPS).all(|step| {
            let jacobian = self.jacobian(point * (f64::from(step) / f64::from(STEPS)));
            jacobian.determinant() > 0.0 && jacobian.x_axis.x + jacobian.y_axis.y > 0.0
        })
    }
}

fn polynomial(&[k1, k2, p1, p2, k3]: &[f64; 5], point: DVec2) -> DVec2 {
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    DVec2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
    )
}

fn polynomial_jacobian(&[k1, k2, p1, p2, k3]: &[f64; 5], point: DVec2) -> DMat2 {
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    let slope = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3));
    let mixed = x * y * slope + 2.0 * (p1 * x + p2 * y);
    DMat2::from_cols(
        DVec2::new(radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed),
        DVec2::new(mixed, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x),
    )
}

/// All of the rational model but the tilt.
fn rational(coefficients: &[f64; 14], point: DVec2) -> DVec2 {
    let &[k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, _, _] = coefficients;
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)));
    DVec2::new(
        x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x) + r2 * (s1 + r2 * s2),
        y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y + r2 * (s3 + r2 * s4),
    )
}

fn rational_jacobian(coefficients: &[f64; 14], point: DVec2) -> DMat2 {
    let &[k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, _, _] = coefficients;
    let (x, y) = (point.x, point.y);
    let r2 = point.length_squared();
    let below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
    let radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below;
    let above_slope = k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3);
    let below_slope = k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6);
    let slope = 2.0 * (above_slope - radial * below_slope) / below;
    let mixed = x * y * slope + 2.0 * (p1 * x + p2 * y);
    let prism = 2.0 * DVec2::new(s1 + 2.0 * s2 * r2, s3 + 2.0 * s4 * r2);
    DMat2::from_cols(
        DVec2::new(radial + x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x, mixed) + prism * x,
        DVec2::new(mixed, radial + y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x) + prism * y,
    )
}

/// The homography of a sensor that is tilted about x and then y (OpenCV's `computeTiltProjectionMatrix`; Louhichi et
/// al., "A mathematical model for a tilted sensor", 2007); `None` for one that is not.
pub fn tilt(coefficients: &[f64; 14]) -> Option<DMat3> {
    let [about_x_rad, about_y_rad] = [coefficients[12], coefficients[13]];
    if about_x_rad == 0.0 && about_y_rad == 0.0 {
        return None;
    }
    // OpenCV's matrices turn against the right-hand rule.
    let turn = DMat3::from_rotation_y(-about_y_rad) * DMat3::from_rotation_x(-about_x_rad);
    let axis = turn.z_axis;
    let on_to_sensor = DMat3::from_cols(
        DVec3::new(axis.z, 0.0, 0.0),
        DVec3::new(0.0, axis.z, 0.0),
        DVec3::new(-axis.x, -axis.y, 1.0),
    );
    Some(on_to_sensor * turn)
}

fn fisheye_radius(&[k1, k2, k3, k4]: &[f64; 4], angle: f64) -> f64 {
    let a2 = angle * angle;
    angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4))))
}

fn fisheye_slope(&[k1, k2, k3, k4]: &[f64; 4], angle: f64) -> f64 {
    let a2 = angle * angle;
    1.0 + a2 * (3.0 * k1 + a2 * (5.0 * k2 + a2 * (7.0 * k3 + a2 * 9.0 * k4)))
}

/// The angle is sought outwards from the axis, where the radius grows; from 90° on no plane shows the ray.
fn undistort_fisheye(coefficients: &[f64; 4], target: DVec2) -> Option<DVec2> {
    const STEPS: u32 = 64;
    let radius = target.length();
    if radius < 1e-9 {
        return Some(target);
    }
    let mut low = 0.0;
    for step in 1..=STEPS {
        let high = FRAC_PI_2 * f64::from(step) / f64::from(STEPS);
        if fisheye_radius(coefficients, high) >= radius {
            let angle = angle_between(coefficients, radius, low, high);
            return (angle < FRAC_PI_2 - 1e-6).then(|| target * (angle.tan() / radius));
        }
        if fisheye_slope(coefficients, high) <= 0.0 {
            return None;
        }
        low = high;
    }
    None
}

/// The angle of a radius, between one that is too small and one that is not; Newton's method, halving where that
/// leaves the interval.
fn angle_between(coefficients: &[f64; 4], radius: f64, mut low: f64, mut high: f64) -> f64 {
    let mut angle = 0.5 * (low + high);
    for _ in 0..ROUNDS {
        let off = fisheye_radius(coefficients, angle) - radius;
        if off > 0.0 {
            high = angle;
        } else {
            low = angle;
        }
        let newton = angle - off / fisheye_slope(coefficients, angle);
        let next = if (low..=high).contains(&newton) {
            newton
        } else {
            0.5 * (low + high)
        };
        let step = (next - angle).abs();
        angle = next;
        if step < 1e-15 {
            break;
        }
    }
    angle
}

/// The point of the plane z = 1 under homogeneous coordinates.
fn on_plane(place: DVec3) -> DVec2 {
    place.truncate() / place.z
}
