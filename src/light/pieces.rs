//! A light of some size cut into small ones: from each a shadow has a sharp edge, and all together have the soft one.

use std::f64::consts::TAU;

use glam::DVec3;

use super::Light;

impl Light {
    /// The light as `count` small ones of equal power, which together give what it gives: itself where that is 1. They lie in
    /// pairs opposite each other, so that no even number has its middle elsewhere.
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
        match *self {
            Self::Point {
                position_m,
                intensity,
                shape,
            } => {
                let (aside_m, shape) = shape.piece(index, count);
                Self::Point {
                    position_m: position_m + aside_m,
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
                let [across, up, _] = in_sphere(index).to_array();
                let aside = (x * across + y * up) * (0.5 * angle_rad).sin();
                let forth = (1.0 - aside.length_squared()).max(0.0).sqrt();
                // (The directions of a disc are evenly spread where their shadows on a plane across it are.)
                Self::Directional {
                    direction: aside + direction * forth,
                    // A plane across the axis gets its share, one across this direction as much more as it lies straighter.
                    irradiance: irradiance * (share / forth.max(1e-3)),
                    angle_rad: angle_rad * share.sqrt(),
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

/// One of `count` places evenly spread over the square from −1 to 1: a lattice by the golden ratio, alike on opposite sides of
/// the middle. By what the pieces there have a size of their own they lie nearer the middle, so that their spread is the square's.
pub(super) fn in_square(index: usize, count: usize) -> [f64; 2] {
    const GOLDEN: f64 = 0.618_033_988_749_895;
    let count = count as f64;
    let from_middle = index as f64 - 0.5 * (count - 1.0);
    let shrunk = (1.0 - 1.0 / count).sqrt();
    let part = (GOLDEN * from_middle + 0.5).rem_euclid(1.0);
    [2.0 * from_middle / count, 2.0 * part - 1.0].map(|part| part * shrunk)
}

/// One of any number of places in the unit sphere, see [`Light::pieces`]: each second one lies opposite to the one before.
pub(super) fn in_sphere(index: usize) -> DVec3 {
    let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let [u, v, w] = spread(index / 2);
    let (sine, cosine) = (TAU * v).sin_cos();
    let radius = (1.0 - u).sqrt();
    side * DVec3::new(radius * cosine, radius * sine, u.sqrt() * (TAU * w).sin())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{Rect, Shape, irradiance};
    use glam::DVec2;
    use std::f64::consts::PI;

    fn lamp(shape: Shape) -> Light {
        Light::Point {
            position_m: DVec3::new(0.1, -0.2, 0.5),
            intensity: DVec3::ONE,
            shape,
        }
    }

    fn rect() -> Rect {
        Rect::upright(
            DVec3::new(-0.3, 0.4, -1.0).normalize(),
            DVec3::Z,
            DVec2::new(0.3, 0.2),
        )
    }

    /// A shape of each kind, one after the other.
    fn shapes() -> impl Iterator<Item = Shape> {
        std::iter::successors(Some(Shape::Point), |before| match before {
            Shape::Point => Some(Shape::Spot {
                direction: rect().facing,
                inner_rad: 0.3,
                outer_rad: 0.6,
            }),
            Shape::Spot { .. } => Some(Shape::Sphere { radius_m: 0.05 }),
            Shape::Sphere { .. } => Some(Shape::Rect(rect())),
            Shape::Rect(_) => None,
        })
    }

    /// By what a light is off that is cut into pieces, at some places on planes that are tilted.
    fn worst_off(light: &Light, count: usize) -> f64 {
        let mut worst: f64 = 0.0;
        for place in [
            DVec3::ZERO,
            DVec3::new(0.3, 0.1, 0.0),
            DVec3::new(-0.2, -0.4, 0.2),
        ] {
            for normal in [
                DVec3::Z,
                DVec3::new(0.6, 0.0, 0.8),
                DVec3::new(-0.5, 0.5, 0.7),
            ] {
                let normal = normal.normalize();
                let whole = irradiance(light, place, normal).x;
                let pieces = light.pieces(count);
                let sum: f64 = pieces
                    .iter()
                    .map(|piece| irradiance(piece, place, normal).x)
                    .sum();
                worst = worst.max((sum / whole - 1.0).abs());
            }
        }
        worst
    }

    #[test]
    fn pieces_together_give_what_the_light_gives() {
        let sun = Light::Directional {
            direction: DVec3::new(0.3, 0.2, -1.0).normalize(),
            irradiance: DVec3::ONE,
            angle_rad: 0.2,
        };
        let sized = shapes().filter(Shape::has_size).map(lamp);
        for light in sized.chain([sun]) {
            assert!(
                worst_off(&light, 16) < 0.02,
                "{light:?}: {}",
                worst_off(&light, 16)
            );
            assert!(
                worst_off(&light, 64) < 0.005,
                "{light:?}: {}",
                worst_off(&light, 64)
            );
        }
    }

    #[test]
    fn a_sphere_fills_its_disc_evenly_from_every_side() {
        let sphere = lamp(Shape::Sphere { radius_m: 1.0 });
        let Light::Point { position_m, .. } = sphere else {
            return;
        };
        let count = 256;
        let places: Vec<DVec3> = (sphere.pieces(count).iter())
            .filter_map(|piece| match piece {
                Light::Point {
                    position_m: place, ..
                } => Some(*place - position_m),
                Light::Directional { .. } => None,
            })
            .collect();
        for way in [
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            DVec3::new(1.0, -2.0, 0.5),
            DVec3::ONE,
        ] {
            let way = way.normalize();
            let mut along: Vec<f64> = places.iter().map(|place| place.dot(way)).collect();
            along.sort_by(f64::total_cmp);
            for (index, &at) in along.iter().enumerate() {
                // The part of a disc on one side of a line.
                let part = 0.5 + (at * (1.0 - at * at).max(0.0).sqrt() + at.asin()) / PI;
                let counted = (index as f64 + 0.5) / count as f64;
                assert!((part - counted).abs() < 0.03, "{way}: {part} {counted}");
            }
        }
    }
}
