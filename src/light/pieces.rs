//! A light of some size cut into small ones: from each a shadow has a sharp edge, and all together have the soft one.

use std::f64::consts::TAU;

use glam::DVec3;

use super::{Light, Rect, Shape};

impl Light {
    /// The light as `count` small ones of equal power, which together give what it gives: itself where that is 1. The first of
    /// them are the same places whatever the count, and each second one lies opposite the one before it, so that no even number
    /// has its middle elsewhere.
    ///
    /// A sphere's fill it as densely as 1 / √(radius² − distance²): so they fill the disc that it is from whatever side evenly
    /// (the three first numbers of evenly spread unit quaternions; Shoemake 1992, "Uniform random rotations"), and, being the
    /// same to all sides, light what is outside it as it does (Newton's shells).
    pub fn pieces(&self, count: usize) -> Vec<Light> {
        match count {
            0 | 1 => vec![*self],
            _ => (0..count).map(|index| self.piece(index, count)).collect(),
        }
    }

    fn piece(&self, index: usize, count: usize) -> Light {
        let share = 1.0 / count as f64;
        let smaller = share.sqrt();
        let side = if index % 2 == 0 { 1.0 } else { -1.0 };
        let spread = spread(index / 2);
        match *self {
            Self::Point {
                position_m,
                intensity,
                shape,
            } => {
                let (aside_m, shape) = match shape {
                    Shape::Point | Shape::Spot { .. } => (DVec3::ZERO, shape),
                    Shape::Sphere { radius_m } => (
                        in_sphere(spread) * radius_m,
                        Shape::Sphere {
                            radius_m: radius_m * smaller,
                        },
                    ),
                    Shape::Rect(rect) => {
                        let [width, height] = rect.half_sides_m();
                        let aside =
                            width * (2.0 * spread[0] - 1.0) + height * (2.0 * spread[1] - 1.0);
                        let size_m = rect.size_m * smaller;
                        (aside, Shape::Rect(Rect { size_m, ..rect }))
                    }
                };
                Self::Point {
                    position_m: position_m + aside_m * side,
                    intensity: intensity * share,
                    shape,
                }
            }
            Self::Directional {
                direction,
                irradiance,
                angle_rad,
            } => {
                let (x, y) = direction.any_orthonormal_pair();
                let [across, up, _] = in_sphere(spread).to_array();
                let aside = (x * across + y * up) * ((0.5 * angle_rad).sin() * side);
                let forth = (1.0 - aside.length_squared()).max(0.0).sqrt();
                // (The directions of a disc are evenly spread where their shadows on a plane across it are.)
                Self::Directional {
                    direction: aside + direction * forth,
                    // A plane across the axis gets its share, one across this direction as much more as it lies straighter.
                    irradiance: irradiance * (share / forth.max(1e-3)),
                    angle_rad: angle_rad * smaller,
                }
            }
        }
    }
}

/// Three numbers from 0 to 1, of any number of such evenly spread (Roberts 2018, "The unreasonable effectiveness of quasirandom
/// sequences": steps by the powers of the inverse of the root of x⁴ = x + 1).
fn spread(index: usize) -> [f64; 3] {
    const ROOT: f64 = 1.220_744_084_605_759_6;
    let step = index as f64 + 1.0;
    [1, 2, 3].map(|power| (0.5 + step / ROOT.powi(power)).fract())
}

/// A place in the unit sphere, see [`Light::pieces`].
fn in_sphere([u, v, w]: [f64; 3]) -> DVec3 {
    let (sine, cosine) = (TAU * v).sin_cos();
    let radius = (1.0 - u).sqrt();
    DVec3::new(radius * cosine, radius * sine, u.sqrt() * (TAU * w).sin())
}
