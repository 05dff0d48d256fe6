//! A light of some size cut into small ones: from each a shadow has a sharp edge, and all together have the soft one.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use crate::geometry::bounds::Bounds;

use super::Light;

/// Places that a light of some size shines from on what rays meet.
const PLACES_OF_A_LIGHT: usize = 8;
/// Steps by it, of any number, lie evenly spread over a circle.
const GOLDEN: f64 = 0.618_033_988_749_895;

/// From where a light is looked at by what its shadows fall on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Onlooking {
    /// From the light there, unit length.
    pub way: DVec3,
    /// 0 where all look at it from there, 1 where they may from all around.
    pub breadth: f64,
    /// The light's radius as a part of its distance.
    pub size: f64,
}

impl Onlooking {
    /// From all around.
    pub const ALL_AROUND: Self = Self {
        way: DVec3::Z,
        breadth: 1.0,
        size: 0.0,
    };
    /// Half of the angle within which a disc stands for a sphere (narrower by 3 % there), radians, and from which on it does not.
    const NARROW_AND_BROAD_RAD: [f64; 2] = [0.25, 0.7];
    /// How large as a part of its distance a sphere is for which a disc stands, and one for which none does.
    const SMALL_AND_LARGE: [f64; 2] = [0.4, 0.7];

    /// Of a light whose shadows are those of what stands within a box.
    pub fn of(light: &Light, casters: &Bounds) -> Self {
        match light {
            Light::Point { position_m, .. } => {
                let extents = light.half_extents().into_iter();
                let radius_m = extents.map(|extent| extent.length()).fold(0.0, f64::max);
                Self::from_within(casters, *position_m, radius_m)
            }
            Light::Directional { .. } => Self::ALL_AROUND,
        }
    }

    /// From somewhere within a box, at a light within a sphere.
    fn from_within(bounds: &Bounds, light: DVec3, radius_m: f64) -> Self {
        let middle = 0.5 * (bounds.low + bounds.high);
        // (Rounding in what tells where things are is not to turn the light.)
        let way = (middle - light).normalize_or_zero();
        let way = ((way * 1e6).round() + DVec3::ZERO).normalize_or_zero();
        let aside = |corner: DVec3| way.angle_between(corner - light);
        let widest_rad = bounds.corners().map(aside).into_iter().fold(0.0, f64::max);
        if way == DVec3::ZERO || !widest_rad.is_finite() {
            return Self::ALL_AROUND;
        }
        let nearest_m = bounds.distance(light).max(f64::MIN_POSITIVE);
        let part = |of: f64, [least, most]: [f64; 2]| (of - least) / (most - least);
        let by_angle = part(widest_rad, Self::NARROW_AND_BROAD_RAD);
        let by_size = part(radius_m / nearest_m, Self::SMALL_AND_LARGE);
        let middle_m = middle.distance(light);
        Self {
            way,
            breadth: by_angle.max(by_size).clamp(0.0, 1.0),
            size: (radius_m / middle_m.max(f64::MIN_POSITIVE)).min(1.0),
        }
    }
}

impl Light {
    /// The light as `count` small ones of equal power, which together give what it gives: itself where that is 1. They lie in
    /// pairs opposite each other, so that no even number has its middle elsewhere.
    ///
    /// A sphere's lie evenly on the disc that it is from where it is looked at. Where that is from many sides, they fill it as
    /// densely as 1 / √(radius² − distance²): so they fill the disc that it is from whatever side evenly, and, being the same to
    /// all sides, light what is outside it as it does (Newton's shells).
    pub fn pieces(&self, count: usize, onlooking: Onlooking) -> Vec<Light> {
        match count {
            0 | 1 => vec![*self],
            _ => (0..count)
                .map(|index| self.piece(index, count, onlooking))
                .collect(),
        }
    }

    /// The places that a light shines from on what rays meet: a few for one of some size.
    pub fn shining_from(&self) -> Vec<Light> {
        match self.has_size() {
            true => self.pieces(PLACES_OF_A_LIGHT, Onlooking::ALL_AROUND),
            false => vec![*self],
        }
    }

    fn piece(&self, index: usize, count: usize, onlooking: Onlooking) -> Light {
        let share = 1.0 / count as f64;
        match *self {
            Self::Point {
                position_m,
                intensity,
                shape,
            } => {
                let (aside_m, shape) = shape.piece(index, count, onlooking);
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
                let [across, up] = in_disc(index, count);
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

/// One of `count` places evenly spread over the square from −1 to 1: a lattice by the golden ratio, alike on opposite sides of
/// the middle. By what the pieces there have a size of their own they lie nearer the middle, so that their spread is the square's.
pub(super) fn in_square(index: usize, count: usize) -> [f64; 2] {
    let count = count as f64;
    let from_middle = index as f64 - 0.5 * (count - 1.0);
    let shrunk = (1.0 - 1.0 / count).sqrt();
    let part = (GOLDEN * from_middle + 0.5).rem_euclid(1.0);
    [2.0 * from_middle / count, 2.0 * part - 1.0].map(|part| part * shrunk)
}

/// One of `count` places evenly spread over the unit disc: a spiral by the golden ratio (Vogel 1979, "A better way to construct
/// the sunflower head") and the places opposite; of an odd number the last is the middle.
pub(super) fn in_disc(index: usize, count: usize) -> [f64; 2] {
    let (pairs, pair) = (count / 2, index / 2);
    if pair == pairs {
        return [0.0; 2];
    }
    let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let radius = ((pair as f64 + 0.5) / pairs as f64).sqrt();
    let (sine, cosine) = (PI * (pair as f64 * GOLDEN).fract()).sin_cos();
    [side * radius * cosine, side * radius * sine]
}

/// One of `count` places in the unit sphere, see [`Light::pieces`]: those of the disc, each as far before or behind it as the
/// third number of an evenly spread unit quaternion is whose first two are on the disc.
///
/// A disc alone stands nearer than the sphere's middle, by as much as makes it as bright as the sphere: at a distance h in place
/// of 1, 2 (1 − h / √(h² + size²)) / size² is 1 for h ≈ 1 − 3 size² / 8.
pub(super) fn in_sphere(index: usize, count: usize, onlooking: Onlooking) -> DVec3 {
    /// The square of the inverse of the root of x³ = x + 1: how far what is behind has turned from pair to pair.
    const PLASTIC: f64 = 0.569_840_290_998_053_3;
    let Onlooking { way, breadth, size } = onlooking;
    let [across, up] = in_disc(index, count);
    let (x, y) = way.any_orthonormal_pair();
    let most = (1.0 - across * across - up * up).max(0.0).sqrt();
    let side = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
    let depth = side * most * (TAU * (0.5 + (index / 2) as f64 * PLASTIC).fract()).sin();
    let nearer = 0.375 * size;
    x * across + y * up + way * (breadth * depth + (1.0 - breadth) * nearer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::{Rect, Shape, irradiance};
    use glam::DVec2;

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
                let pieces = light.pieces(count, Onlooking::ALL_AROUND);
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

    /// By how much of a disc at most the part of it on one side of a line is off that of some of its places.
    fn unevenness(places: &[DVec3], way: DVec3) -> f64 {
        let count = places.len() as f64;
        let mut along: Vec<f64> = places.iter().map(|place| place.dot(way)).collect();
        along.sort_by(f64::total_cmp);
        let off = along.iter().enumerate().map(|(index, &at)| {
            // The part of a disc on one side of a line.
            let part = 0.5 + (at * (1.0 - at * at).max(0.0).sqrt() + at.asin()) / PI;
            let counted = (index as f64 + 0.5) / count;
            (part - counted).abs()
        });
        off.fold(0.0, f64::max)
    }

    fn places(count: usize, onlooking: Onlooking) -> Vec<DVec3> {
        (0..count)
            .map(|index| in_sphere(index, count, onlooking))
            .collect()
    }

    #[test]
    fn a_disc_in_place_of_a_large_sphere_gives_what_the_sphere_gives() {
        let shape = Shape::Sphere { radius_m: 0.3 };
        let sphere = lamp(shape);
        let Light::Point { position_m, .. } = sphere else {
            return;
        };
        let place = DVec3::new(0.4, 0.1, -0.4);
        let bounds = Bounds {
            low: place - 0.01,
            high: place + 0.01,
        };
        let onlooking = Onlooking::from_within(&bounds, position_m, 0.3);
        assert_eq!(onlooking.breadth, 0.0);
        let pieces = sphere.pieces(64, onlooking);
        for normal in [-onlooking.way, DVec3::Z, -DVec3::X] {
            let gives = |light: &Light| irradiance(light, place, normal).x;
            let (whole, sum) = (gives(&sphere), pieces.iter().map(gives).sum::<f64>());
            assert!((sum / whole - 1.0).abs() < 0.02, "{normal}: {sum} {whole}");
        }
    }

    #[test]
    fn a_sphere_fills_its_disc_evenly_from_every_side() {
        let places = places(256, Onlooking::ALL_AROUND);
        for way in [
            DVec3::X,
            DVec3::Y,
            DVec3::Z,
            DVec3::new(1.0, -2.0, 0.5),
            DVec3::ONE,
        ] {
            let off = unevenness(&places, way.normalize());
            assert!(off < 0.03, "{way}: {off}");
        }
    }

    #[test]
    fn a_sphere_that_is_looked_at_from_one_side_is_an_even_disc() {
        let bounds = Bounds {
            low: DVec3::new(0.3, 0.2, 0.0),
            high: DVec3::new(0.4, 0.3, 0.1),
        };
        let light = DVec3::new(0.1, -0.4, 0.9);
        let onlooking = Onlooking::from_within(&bounds, light, 0.05);
        assert_eq!(onlooking.breadth, 0.0);
        let (x, y) = onlooking.way.any_orthonormal_pair();
        let nearer = 0.375 * onlooking.size;
        for count in [16, 64, 65] {
            let places = places(count, onlooking);
            assert!(
                places
                    .iter()
                    .all(|place| (place.dot(onlooking.way) - nearer).abs() < 1e-9)
            );
            for step in 0..32 {
                let (sine, cosine) = (PI * f64::from(step) / 32.0).sin_cos();
                let off = unevenness(&places, x * cosine + y * sine);
                // (Numbers of a line's own spacing at most, of which one place is half of one.)
                assert!(off * count as f64 <= 2.5, "{count} {step}: {off}");
            }
        }
        // From beside it, and amid what it lights, it is a sphere.
        let beside = Onlooking::from_within(&bounds, DVec3::new(0.35, 0.25, 0.12), 0.001);
        assert_eq!(beside.breadth, 1.0);
        let large = Onlooking::from_within(&bounds, light, 0.8);
        assert_eq!(large.breadth, 1.0);
        let amid = Onlooking::from_within(&bounds, DVec3::new(0.35, 0.25, 0.05), 0.001);
        assert_eq!(amid.breadth, 1.0);
    }
}
