//! Where two black squares meet, by fitting what a blurred corner looks like to the light about it.
//!
//! Light is `middle + contrast · e(u) · e(v)`: u and v are the distances from the two lines along which the squares end,
//! e is an edge under a Gaussian blur. Pixels may be left out of such a fit, so it needs no square window: along the
//! squares' edges it reaches past the markers that stand beside the corner.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::DVec2;

use crate::capture::linear::linear;
use crate::geometry::least_squares::{LevenbergMarquardt, NormalEquations, Problem};

/// How far along the edges is looked; a lens bends longer ones.
const ALONG_PX: f64 = 10.0;
/// Nearer to a marker its black is smeared in.
const SMEARED_PX: f64 = 1.5;
/// A narrower stripe along an edge does not hold the edge.
const LEAST_ACROSS_PX: f64 = 0.5;
/// What stands beside an edge must be so far off for a corner to be fitted, pixels.
pub(super) const LEAST_CLEAR_PX: f64 = SMEARED_PX + LEAST_ACROSS_PX;
/// Fewer pixels are no corner.
const FEWEST_PIXELS: usize = 24;
/// Less light between black and white is none.
const LEAST_CONTRAST: f64 = 0.004;
/// What is left of the light may be this part of the contrast (root mean square): more is no corner.
const MOST_MISFIT: f64 = 0.3;
/// A corner is not farther from its guess, pixels.
const FARTHEST_PX: f64 = 3.0;
const FIRST_BLUR_PX: f64 = 1.0;
const METHOD: LevenbergMarquardt = LevenbergMarquardt {
    first_damping: 1e-3,
    rounds: 40,
    least_gain: 1e-7,
};

/// A corner as it is expected.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExpectedCorner {
    /// Its pixel.
    pub pixel: DVec2,
    /// Where the two edges lead, as vectors to the next corners along them.
    pub along_px: [DVec2; 2],
    /// What part of the way to the next corner is clear beside the edges.
    pub clear: f64,
}

impl ExpectedCorner {
    /// How far the nearest marker is from an edge, pixels.
    pub fn clear_px(&self) -> f64 {
        let [one, other] = self.along_px;
        self.clear * one.perp_dot(other).abs() / one.length().max(other.length())
    }

    /// The corner's pixel in an 8-bit grey picture; `None` where it is not seen.
    pub fn found(&self, grey: &[u8], size_px: [u32; 2]) -> Option<DVec2> {
        let pixels = self.pixels(grey, size_px)?;
        let start = CornerFit::new(&pixels, self)?;
        let found = METHOD.minimize(start)?;
        let fit = found.problem;
        let misfit = (found.cost / pixels.len() as f64).sqrt();
        let is_corner = fit.contrast > LEAST_CONTRAST && misfit < MOST_MISFIT * fit.contrast;
        let is_near = fit.off_px.length() < FARTHEST_PX.min(self.reach_px());
        (is_corner && is_near).then_some(self.pixel + fit.off_px)
    }

    fn reach_px(&self) -> f64 {
        /// Beyond the middle the next corner begins.
        const HALF: f64 = 0.5;
        let [one, other] = self.along_px;
        ALONG_PX.min(HALF * one.length().min(other.length()))
    }

    /// The light of the pixels that show the two edges and nothing else, from the expected corner; `None` where there are
    /// too few.
    fn pixels(&self, grey: &[u8], [width, height]: [u32; 2]) -> Option<Vec<(DVec2, f64)>> {
        let reach_px = self.reach_px();
        let room_px = DVec2::new(f64::from(width), f64::from(height)) - 1.0 - self.pixel;
        let room_px = self.pixel.min(room_px).min_element();
        let across_px = self.clear_px() - SMEARED_PX;
        // Also where it is no number.
        if !(room_px > reach_px && across_px >= LEAST_ACROSS_PX) {
            return None;
        }
        let normals = self.along_px.map(|along| along.perp().normalize());
        let [low, high] = [-1.0, 1.0].map(|way| (self.pixel + way * reach_px).round().as_uvec2());
        let mut pixels = Vec::new();
        for y in low.y..=high.y.min(height - 1) {
            for x in low.x..=high.x.min(width - 1) {
                let from_corner = DVec2::new(f64::from(x), f64::from(y)) - self.pixel;
                let is_beside = |normal: DVec2| normal.dot(from_corner).abs() <= across_px;
                if from_corner.length() <= reach_px && normals.into_iter().any(is_beside) {
                    let level = grey[y as usize * width as usize + x as usize];
                    pixels.push((from_corner, f64::from(linear(level))));
                }
            }
        }
        (pixels.len() >= FEWEST_PIXELS).then_some(pixels)
    }
}

/// A guess at a corner.
#[derive(Clone, Copy)]
struct CornerFit<'a> {
    /// From the expected corner, with their light.
    pixels: &'a [(DVec2, f64)],
    off_px: DVec2,
    /// Of the edges' normals.
    angles: [f64; 2],
    log_blur: f64,
    middle: f64,
    /// Half of what white has more than black.
    contrast: f64,
}

impl<'a> CornerFit<'a> {
    /// `None` where there is no black and white.
    fn new(pixels: &'a [(DVec2, f64)], expected: &ExpectedCorner) -> Option<Self> {
        let mut start = Self {
            pixels,
            off_px: DVec2::ZERO,
            angles: expected.along_px.map(|along| along.perp().to_angle()),
            log_blur: FIRST_BLUR_PX.ln(),
            middle: 0.0,
            contrast: 1.0,
        };
        // The light's levels are linear in the model.
        let mut levels = NormalEquations::<2>::ZERO;
        for &(place, light) in pixels {
            levels.add(&[1.0, start.edges(place).product()], light);
        }
        [start.middle, start.contrast] = levels.solve()?;
        if start.contrast < 0.0 {
            // The normal of one edge the other way round.
            start.angles[0] += PI;
            start.contrast = -start.contrast;
        }
        (start.contrast > LEAST_CONTRAST).then_some(start)
    }

    fn edges(&self, place: DVec2) -> Edges {
        let blur_px = self.log_blur.exp();
        let from_corner = place - self.off_px;
        let normals = self.angles.map(DVec2::from_angle);
        let across = normals.map(|normal| normal.dot(from_corner) / blur_px);
        Edges {
            from_corner,
            blur_px,
            normals,
            across,
            heights: across.map(|across| erf(across * FRAC_1_SQRT_2)),
            slopes: across.map(|across| (2.0 / PI).sqrt() * (-across * across / 2.0).exp()),
        }
    }
}

/// The two edges as a pixel sees them.
struct Edges {
    from_corner: DVec2,
    blur_px: f64,
    normals: [DVec2; 2],
    /// Distances from them, in widths of the blur.
    across: [f64; 2],
    /// From -1 to 1 across each.
    heights: [f64; 2],
    /// How these change with `across`.
    slopes: [f64; 2],
}

impl Edges {
    fn product(&self) -> f64 {
        self.heights[0] * self.heights[1]
    }

    /// How the product changes with the corner's place, the normals' angles and the blur's logarithm.
    fn gradient(&self) -> [f64; 5] {
        // By each edge's `across`.
        let [by_one, by_other] = [
            self.slopes[0] * self.heights[1],
            self.slopes[1] * self.heights[0],
        ];
        let by_place = -(by_one * self.normals[0] + by_other * self.normals[1]) / self.blur_px;
        let turned = |edge: usize| self.normals[edge].perp().dot(self.from_corner) / self.blur_px;
        [
            by_place.x,
            by_place.y,
            by_one * turned(0),
            by_other * turned(1),
            -(by_one * self.across[0] + by_other * self.across[1]),
        ]
    }
}

impl Problem for CornerFit<'_> {
    type Linearized = NormalEquations<7>;

    fn cost(&self) -> Option<f64> {
        let error = |&(place, light): &(DVec2, f64)| {
            self.middle + self.contrast * self.edges(place).product() - light
        };
        let cost: f64 = self.pixels.iter().map(|pixel| error(pixel).powi(2)).sum();
        Some(cost).filter(|cost| cost.is_finite())
    }

    fn linearized(&self) -> Option<NormalEquations<7>> {
        let mut equations = NormalEquations::ZERO;
        for &(place, light) in self.pixels {
            let edges = self.edges(place);
            let [x, y, one, other, blur] = edges.gradient().map(|by| self.contrast * by);
            let product = edges.product();
            let error = light - self.middle - self.contrast * product;
            equations.add(&[x, y, one, other, blur, 1.0, product], error);
        }
        Some(equations)
    }

    fn moved(&self, step: &[f64; 7]) -> Self {
        let [x, y, one, other, blur, middle, contrast] = *step;
        Self {
            pixels: self.pixels,
            off_px: self.off_px + DVec2::new(x, y),
            angles: [self.angles[0] + one, self.angles[1] + other],
            log_blur: self.log_blur + blur,
            middle: self.middle + middle,
            contrast: self.contrast + contrast,
        }
    }

    fn is_negligible(&self, step: &[f64; 7]) -> bool {
        const NEGLIGIBLE_PX: f64 = 1e-4;
        step[0].hypot(step[1]) < NEGLIGIBLE_PX
    }
}

/// The error function, to 1.5e-7 (M. Abramowitz and I. A. Stegun, "Handbook of Mathematical Functions", 7.1.26).
fn erf(x: f64) -> f64 {
    const TERMS: [f64; 5] = [
        1.061_405_429,
        -1.453_152_027,
        1.421_413_741,
        -0.284_496_736,
        0.254_829_592,
    ];
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let sum = TERMS.iter().fold(0.0, |sum, term| (sum + term) * t);
    (1.0 - sum * (-x * x).exp()).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::srgb::srgb_level;

    /// Grey levels of a corner between squares that are turned and sheared, under a blur, each pixel the mean of what it sees.
    fn corner_px(at_px: DVec2, along: [DVec2; 2]) -> Vec<u8> {
        const SAMPLES: u32 = 8;
        let place = |pixel: u32, sample: u32| {
            f64::from(pixel) + (f64::from(sample) + 0.5) / f64::from(SAMPLES) - 0.5
        };
        let light = |from_corner: DVec2| {
            let heights = along.map(|along| erf(along.perp().normalize().dot(from_corner) / 0.9));
            (0.4 - 0.38 * heights[0] * heights[1]) as f32
        };
        let samples = |x: u32, y: u32| {
            let all = (0..SAMPLES * SAMPLES)
                .map(|k| light(DVec2::new(place(x, k % SAMPLES), place(y, k / SAMPLES)) - at_px));
            all.sum::<f32>() / (SAMPLES * SAMPLES) as f32
        };
        (0..40 * 40)
            .map(|k| srgb_level(samples(k % 40, k / 40)))
            .collect()
    }

    #[test]
    fn a_corner_is_found_where_it_is_whatever_stands_beside_its_edges() {
        let at_px = DVec2::new(20.3, 19.6);
        for (turn, shear) in [(0.0, 0.0), (0.4, 0.2), (1.0, -0.4), (2.5, 0.3)] {
            let along = [DVec2::X, DVec2::new(shear, 1.0)]
                .map(|along| DVec2::from_angle(turn).rotate(24.0 * along));
            let mut grey = corner_px(at_px, along);
            let expected = ExpectedCorner {
                pixel: at_px + DVec2::new(-0.8, 0.6),
                along_px: along,
                clear: 0.14,
            };
            let plain_px = expected.found(&grey, [40, 40]).unwrap();
            assert!(plain_px.distance(at_px) < 0.01, "{plain_px}");
            // A marker's black in two of the quarters, as far off as is said.
            let normals = along.map(|along| along.perp().normalize());
            for (k, level) in (0..).zip(&mut grey) {
                let place = DVec2::new(f64::from(k % 40), f64::from(k / 40)) - at_px;
                let [u, v] = normals.map(|normal| normal.dot(place));
                if u * v < 0.0 && u.abs().min(v.abs()) > 0.14 * 24.0 {
                    *level = 30;
                }
            }
            let found_px = expected.found(&grey, [40, 40]).unwrap();
            assert!(found_px.distance(at_px) < 0.03, "{turn}: {found_px}");
        }
    }

    #[test]
    fn what_is_no_corner_is_not_found() {
        let along_px = [24.0 * DVec2::X, 24.0 * DVec2::Y];
        let expected = |pixel: DVec2, clear: f64| ExpectedCorner {
            pixel,
            along_px,
            clear,
        };
        let middle_px = DVec2::splat(20.0);
        let corner = corner_px(middle_px, along_px);
        assert!(expected(middle_px, 0.14).found(&corner, [40, 40]).is_some());
        // Markers too near, the picture's rim, grey, an edge alone, another corner's place.
        assert!(expected(middle_px, 0.07).found(&corner, [40, 40]).is_none());
        let rim_px = DVec2::new(8.0, 20.0);
        assert!(expected(rim_px, 0.14).found(&corner, [40, 40]).is_none());
        assert!(
            expected(middle_px, 0.14)
                .found(&[90; 1600], [40, 40])
                .is_none()
        );
        let edge: Vec<u8> = (0..1600)
            .map(|k| if k % 40 < 20 { 20 } else { 220 })
            .collect();
        assert!(expected(middle_px, 0.14).found(&edge, [40, 40]).is_none());
    }

    #[test]
    fn the_gradient_is_what_small_steps_make() {
        const STEP: f64 = 1e-5;
        let pixels = [(DVec2::new(0.7, -0.4), 0.5)];
        let fit = CornerFit {
            pixels: &pixels,
            off_px: DVec2::new(0.1, 0.2),
            angles: [0.3, 1.7],
            log_blur: 0.2,
            middle: 0.3,
            contrast: 0.2,
        };
        let product = |step: &[f64; 7]| fit.moved(step).edges(pixels[0].0).product();
        for (k, by) in fit.edges(pixels[0].0).gradient().into_iter().enumerate() {
            let step = |size: f64| std::array::from_fn(|i| if i == k { size } else { 0.0 });
            let slope = (product(&step(STEP)) - product(&step(-STEP))) / (2.0 * STEP);
            // The error function's own terms are good to 1.5e-7.
            assert!((slope - by).abs() < 1e-3, "{k}: {slope} {by}");
        }
    }
}
