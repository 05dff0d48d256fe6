//! The map between two planes that pictures of a plane make.

use glam::{DMat3, DVec2, DVec3};

use super::least_squares::{LevenbergMarquardt, NormalEquations, Problem};

/// Where a homography takes a point.
pub fn mapped(homography: &DMat3, point: DVec2) -> DVec2 {
    let image = *homography * point.extend(1.0);
    image.truncate() / image.z
}

/// The homography that takes the first of each pair to the second, by linear least squares: what little it lacks of
/// [`best_homography`] does not matter to what is refined later. `None` where the pairs do not determine one.
///
/// The first points are scaled ones ([`PointScale`]), so the map is determined well, and its last entry can be 1: where
/// all points are seen, their mean is.
pub fn linear_homography(pairs: &[(DVec2, DVec2)]) -> Option<DMat3> {
    Some(HomographyFit::linear(pairs)?.homography())
}

/// The homography that takes the first of each pair nearest to the second: the sum of the squared distances is least.
/// `None` where the pairs do not determine one.
pub fn best_homography(pairs: &[(DVec2, DVec2)]) -> Option<DMat3> {
    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-3,
        rounds: 50,
        least_gain: 1e-12,
    };
    let scale = PointScale::of(pairs.iter().map(|pair| pair.0));
    let scaled = |&(point, image): &(DVec2, DVec2)| (scale.scaled(point), image);
    let pairs: Vec<(DVec2, DVec2)> = pairs.iter().map(scaled).collect();
    let fit = METHOD.minimize(HomographyFit::linear(&pairs)?)?.problem;
    let best = fit.homography() * scale.unscaling().inverse();
    best.is_finite().then_some(best)
}

/// The mean of points, and their root mean square distance from it: coordinates by these are near 1, where equations are
/// well conditioned (R. Hartley, "In defense of the eight-point algorithm", 1997).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PointScale {
    mean: DVec2,
    spread: f64,
}

impl PointScale {
    /// The scale of some points.
    pub fn of(points: impl Iterator<Item = DVec2> + Clone) -> Self {
        let count = points.clone().count() as f64;
        let mean = points.clone().sum::<DVec2>() / count;
        let squares = points.map(|point| (point - mean).length_squared());
        Self {
            mean,
            spread: (squares.sum::<f64>() / count).sqrt(),
        }
    }

    /// A point in coordinates near 1.
    pub fn scaled(&self, point: DVec2) -> DVec2 {
        (point - self.mean) / self.spread
    }

    /// The map from scaled points back to these.
    fn unscaling(&self) -> DMat3 {
        DMat3::from_cols(
            DVec3::new(self.spread, 0.0, 0.0),
            DVec3::new(0.0, self.spread, 0.0),
            self.mean.extend(1.0),
        )
    }
}

/// A homography from scaled points to scaled images, whose last entry is 1.
#[derive(Clone)]
struct HomographyFit<'a> {
    /// Scaled points with images as they are.
    pairs: &'a [(DVec2, DVec2)],
    image_scale: PointScale,
    /// Row by row.
    entries: [f64; 8],
}

impl<'a> HomographyFit<'a> {
    fn linear(pairs: &'a [(DVec2, DVec2)]) -> Option<Self> {
        if pairs.len() < 4 {
            return None;
        }
        let mut fit = Self {
            pairs,
            image_scale: PointScale::of(pairs.iter().map(|pair| pair.1)),
            entries: [0.0; 8],
        };
        let mut equations = NormalEquations::<8>::ZERO;
        for (point, image) in fit.scaled_pairs() {
            let [for_x, for_y] = rows(point, image, 1.0);
            equations.add(&for_x, image.x);
            equations.add(&for_y, image.y);
        }
        fit.entries = equations.solve()?;
        Some(fit)
    }

    fn scaled_pairs(&self) -> impl Iterator<Item = (DVec2, DVec2)> {
        let pairs = self.pairs.iter();
        pairs.map(|&(point, image)| (point, self.image_scale.scaled(image)))
    }

    fn between_scaled(&self) -> DMat3 {
        let h = self.entries;
        DMat3::from_cols(
            DVec3::new(h[0], h[3], h[6]),
            DVec3::new(h[1], h[4], h[7]),
            DVec3::new(h[2], h[5], 1.0),
        )
    }

    fn homography(&self) -> DMat3 {
        self.image_scale.unscaling() * self.between_scaled()
    }
}

/// The derivatives of the image's x and y, by the entries, at a depth.
fn rows(point: DVec2, image: DVec2, depth: f64) -> [[f64; 8]; 2] {
    let (x, y) = (point.x / depth, point.y / depth);
    let one = 1.0 / depth;
    [
        [x, y, one, 0.0, 0.0, 0.0, -image.x * x, -image.x * y],
        [0.0, 0.0, 0.0, x, y, one, -image.y * x, -image.y * y],
    ]
}

impl Problem for HomographyFit<'_> {
    type Linearized = NormalEquations<8>;

    fn cost(&self) -> Option<f64> {
        let matrix = self.between_scaled();
        let squares = self
            .scaled_pairs()
            .map(|(point, image)| mapped(&matrix, point).distance_squared(image));
        let cost = squares.sum::<f64>();
        cost.is_finite().then_some(cost)
    }

    fn linearized(&self) -> Option<NormalEquations<8>> {
        let matrix = self.between_scaled();
        let mut equations = NormalEquations::ZERO;
        for (point, image) in self.scaled_pairs() {
            let found = mapped(&matrix, point);
            let depth = (matrix * point.extend(1.0)).z;
            let [for_x, for_y] = rows(point, found, depth);
            equations.add(&for_x, image.x - found.x);
            equations.add(&for_y, image.y - found.y);
        }
        Some(equations)
    }

    fn moved(&self, step: &[f64; 8]) -> Self {
        Self {
            entries: std::array::from_fn(|k| self.entries[k] + step[k]),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map with perspective.
    const KNOWN: DMat3 = DMat3::from_cols(
        DVec3::new(900.0, 80.0, 0.3),
        DVec3::new(-60.0, 850.0, -0.4),
        DVec3::new(320.0, 240.0, 1.0),
    );

    fn points() -> impl Iterator<Item = DVec2> {
        (0..35).map(|k| DVec2::new(f64::from(k % 7), f64::from(k / 7)) * 0.03)
    }

    #[test]
    fn a_known_map_comes_back() {
        let pairs: Vec<(DVec2, DVec2)> = points().map(|p| (p, mapped(&KNOWN, p))).collect();
        for some in [&pairs[..], &pairs[4..9]] {
            let scale = PointScale::of(some.iter().map(|pair| pair.0));
            let scaled: Vec<(DVec2, DVec2)> = some
                .iter()
                .map(|&(point, image)| (scale.scaled(point), image))
                .collect();
            let linear = linear_homography(&scaled).unwrap() * scale.unscaling().inverse();
            for found in [linear, best_homography(some).unwrap()] {
                let off_px =
                    |&(point, image): &(DVec2, DVec2)| mapped(&found, point).distance(image);
                assert!(pairs.iter().map(off_px).fold(0.0, f64::max) < 1e-6);
            }
        }
    }

    #[test]
    fn the_best_one_is_at_a_minimum() {
        let mut state = 7_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let pairs: Vec<(DVec2, DVec2)> = points()
            .map(|p| {
                (
                    p,
                    mapped(&KNOWN, p) + 3.0 * DVec2::new(uniform(), uniform()),
                )
            })
            .collect();
        let squares = |homography: &DMat3| -> f64 {
            let off = |&(p, image): &(DVec2, DVec2)| mapped(homography, p).distance_squared(image);
            pairs.iter().map(off).sum()
        };
        let best = best_homography(&pairs).unwrap();
        let least = squares(&best);
        assert!(least < squares(&KNOWN));
        for row in 0..3 {
            for column in 0..3 {
                for factor in [1.0 - 1e-4, 1.0 + 1e-4] {
                    let mut other = best;
                    other.col_mut(column)[row] *= factor;
                    assert!(squares(&other) >= least * (1.0 - 1e-12));
                }
            }
        }
    }

    #[test]
    fn points_on_a_line_determine_none() {
        let pairs: Vec<(DVec2, DVec2)> = (0..8)
            .map(|k| DVec2::new(f64::from(k), 2.0 * f64::from(k)))
            .map(|p| (p, p * 3.0))
            .collect();
        assert_eq!(best_homography(&pairs), None);
        assert_eq!(linear_homography(&pairs[..3]), None);
    }
}
