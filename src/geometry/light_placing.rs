//! Where a light must be that casts shadows where they are seen.
//!
//! The light is looked for as a direction and an inverse distance, seen from among the casters: that is as good for a
//! lamp as for the sun, and how sure the inverse distance is tells them apart. What is made small are pixels between
//! where shadows are seen and where they would fall (Levenberg-Marquardt).

use glam::{DAffine3, DMat3, DVec2, DVec3};

use super::camera::Intrinsics;
use super::least_squares::{LevenbergMarquardt, NormalEquations, Problem};
use super::matrix::dot;

/// A camera and where it stands, for pictures that are undistorted.
#[derive(Debug, Clone, Copy)]
pub struct PosedCamera {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Where it stands.
    pub camera_from_world: DAffine3,
}

impl PosedCamera {
    /// The undistorted pixel of a point in the world; `None` behind the camera.
    pub fn pixel(&self, world_m: DVec3) -> Option<DVec2> {
        let in_camera_m = self.camera_from_world.transform_point3(world_m);
        self.intrinsics.undistorted_pixel_of(in_camera_m)
    }

    /// The camera's place and the unit direction of the ray through an undistorted pixel, in the world.
    pub fn ray(&self, undistorted_px: DVec2) -> (DVec3, DVec3) {
        let world_from_camera = self.camera_from_world.inverse();
        let direction = self.intrinsics.plane_from_pixel(undistorted_px).extend(1.0);
        (
            world_from_camera.translation,
            world_from_camera.transform_vector3(direction).normalize(),
        )
    }
}

/// A surface around a point, in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Facet {
    /// A point of it, metres.
    pub point_m: DVec3,
    /// The surface's unit normal.
    pub normal: DVec3,
}

/// A point of a caster, and where its shadow is seen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowPair {
    /// What casts, in the world, metres.
    pub caster_m: DVec3,
    /// What catches.
    pub receiver: Facet,
    /// Where the shadow is seen, undistorted.
    pub shadow_px: DVec2,
    /// A unit vector where the shadow is known along it alone (an edge); `None`: both ways (a tip).
    pub along: Option<DVec2>,
}

/// A light anywhere, as far as infinity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FarLight {
    /// From where it is looked at, metres.
    pub center_m: DVec3,
    /// The unit direction in which it stands.
    pub towards: DVec3,
    /// Inverse of its distance, 1/m; 0 is infinitely far.
    pub inverse_distance: f64,
}

impl FarLight {
    /// Towards the light from a point, of any length.
    pub fn way_from(&self, point_m: DVec3) -> DVec3 {
        self.towards + self.inverse_distance * (self.center_m - point_m)
    }

    /// Where the shadow of a point falls on a plane; `None` where it does not.
    pub fn shadow_of(&self, caster_m: DVec3, receiver: &Facet) -> Option<DVec3> {
        let way = self.way_from(caster_m);
        let climb = receiver.normal.dot(way);
        let height_m = receiver.normal.dot(caster_m - receiver.point_m);
        (climb > 1e-9 && height_m > 0.0).then(|| caster_m - way * (height_m / climb))
    }

    /// Where it stands; `None` if that is infinitely far.
    pub fn position_m(&self) -> Option<DVec3> {
        (self.inverse_distance > 0.0).then(|| self.center_m + self.towards / self.inverse_distance)
    }

    /// Moved by two tangents of its direction and by an inverse distance.
    fn moved(&self, by: DVec3) -> Self {
        let (right, up) = self.towards.any_orthonormal_pair();
        Self {
            towards: (self.towards + right * by.x + up * by.y).normalize(),
            inverse_distance: self.inverse_distance + by.z,
            ..*self
        }
    }
}

/// What a light may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightFreedom {
    /// At any distance.
    Point,
    /// Infinitely far.
    Directional,
}

impl LightFreedom {
    /// 1 for each of two tangents of the light's direction and its inverse distance that may change, else 0.
    fn axes(self) -> DVec3 {
        match self {
            Self::Point => DVec3::ONE,
            Self::Directional => DVec3::new(1.0, 1.0, 0.0),
        }
    }
}

/// A light that was placed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlacedLight {
    /// The light.
    pub light: FarLight,
    /// Root mean square of what is left, pixels.
    pub rms_px: f64,
    /// Covariance of its direction's two tangents and its inverse distance, for pixels known to one pixel.
    pub covariance: DMat3,
}

impl PlacedLight {
    /// Covariance of its position in the world for shadows known to `sigma_px`, square metres; `None` for one that is
    /// infinitely far.
    pub fn position_covariance(&self, sigma_px: f64) -> Option<DMat3> {
        self.light.position_m()?;
        let (right, up) = self.light.towards.any_orthonormal_pair();
        let distance_m = 1.0 / self.light.inverse_distance;
        let spread = DMat3::from_cols(
            right * distance_m,
            up * distance_m,
            -self.light.towards * (distance_m * distance_m),
        );
        Some(spread * self.covariance * spread.transpose() * (sigma_px * sigma_px))
    }

    /// Standard deviation of its direction for shadows known to `sigma_px`, radians.
    pub fn direction_sigma_rad(&self, sigma_px: f64) -> f64 {
        (self.covariance.x_axis.x + self.covariance.y_axis.y).sqrt() * sigma_px
    }
}

/// Why a light cannot be placed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Unplaced {
    /// One pair gives a direction, two a place.
    #[error("{found} of the {needed} pairs of a vertex and its shadow that this light needs")]
    TooFewPairs {
        /// How many there are.
        found: usize,
        /// How many it takes.
        needed: usize,
    },
    /// A shadow lies where its vertex cannot cast one.
    #[error("pair {0}: no light casts this vertex's shadow there; is it the right vertex?")]
    NotItsShadow(usize),
    /// The ways of light are as good as parallel.
    #[error(
        "the ways of the light are as good as parallel: it is too far to tell; take a directional light"
    )]
    TooFar(FarLight),
    /// The pairs say the same twice, or lie too close to each other.
    #[error("the pairs do not fix the light; take vertices farther apart and higher")]
    Undecided,
}

/// The number of standard deviations that an inverse distance must be, for a light not to be infinitely far.
const SURE: f64 = 3.0;

/// Places a light by pairs whose pixels are known to `sigma_px`.
///
/// # Errors
/// Why the pairs fix none.
pub fn place_light(
    camera: &PosedCamera,
    pairs: &[ShadowPair],
    freedom: LightFreedom,
    sigma_px: f64,
) -> Result<PlacedLight, Unplaced> {
    let needed = match freedom {
        LightFreedom::Point => 2,
        LightFreedom::Directional => 1,
    };
    if pairs.len() < needed {
        return Err(Unplaced::TooFewPairs {
            found: pairs.len(),
            needed,
        });
    }
    let mut towards = DVec3::ZERO;
    for (index, pair) in pairs.iter().enumerate() {
        let way = pair.caster_m - pair.receiver.point_m;
        if way.dot(pair.receiver.normal) <= 1e-3 * way.length() {
            return Err(Unplaced::NotItsShadow(index));
        }
        towards += way.normalize();
    }
    let start = FarLight {
        center_m: pairs.iter().map(|pair| pair.caster_m).sum::<DVec3>() / pairs.len() as f64,
        towards: towards.normalize_or_zero(),
        inverse_distance: 0.0,
    };
    let weights = vec![1.0; pairs.len()];
    let placed = refine(camera, pairs, &weights, start, freedom).ok_or(Unplaced::Undecided)?;
    if freedom == LightFreedom::Point {
        let sigma = placed.covariance.z_axis.z.sqrt() * sigma_px;
        if placed.light.inverse_distance < SURE * sigma {
            return Err(Unplaced::TooFar(placed.light));
        }
    }
    Ok(placed)
}

/// Moves a light to where weighted pairs fit it best; `None` where they do not fix it.
pub fn refine(
    camera: &PosedCamera,
    pairs: &[ShadowPair],
    weights: &[f64],
    start: FarLight,
    freedom: LightFreedom,
) -> Option<PlacedLight> {
    const METHOD: LevenbergMarquardt = LevenbergMarquardt {
        first_damping: 1e-6,
        rounds: 50,
        least_gain: 0.0,
    };
    let found = METHOD.minimize(ShadowFit {
        camera,
        pairs,
        weights,
        freedom,
        light: start,
    })?;
    let equations = found.problem.linearized()?;
    let normal = DMat3::from_cols_array_2d(&equations.matrix.0);
    // Scaled, so that what is small is so for its units alone.
    let unit = DMat3::from_diagonal(normal.diagonal().map(|entry| entry.sqrt().recip()));
    let scaled = unit * normal * unit;
    if !scaled.is_finite() || scaled.determinant() < 1e-9 {
        return None;
    }
    let free = DMat3::from_diagonal(freedom.axes());
    let total: f64 = weights.iter().sum();
    Some(PlacedLight {
        light: found.problem.light,
        rms_px: (found.cost / total.max(1e-12)).sqrt(),
        covariance: free * (unit * scaled.inverse() * unit) * free,
    })
}

/// A light that is moved to where its shadows are seen.
struct ShadowFit<'a> {
    camera: &'a PosedCamera,
    pairs: &'a [ShadowPair],
    weights: &'a [f64],
    freedom: LightFreedom,
    light: FarLight,
}

impl ShadowFit<'_> {
    /// Pixels between where a light's shadows would fall and where they are seen, times the roots of their weights; `None`
    /// where one falls nowhere.
    fn residuals(&self, light: &FarLight) -> Option<Vec<f64>> {
        let mut residuals = Vec::with_capacity(2 * self.pairs.len());
        for (pair, weight) in self.pairs.iter().zip(self.weights) {
            let shadow_m = light.shadow_of(pair.caster_m, &pair.receiver)?;
            let off_px = (self.camera.pixel(shadow_m)? - pair.shadow_px) * weight.sqrt();
            match pair.along {
                Some(along) => residuals.push(off_px.dot(along)),
                None => residuals.extend(off_px.to_array()),
            }
        }
        Some(residuals)
    }

    /// The derivative of the residuals along an axis of the light's freedom.
    fn slopes(&self, axis: DVec3) -> Option<Vec<f64>> {
        const STEP: f64 = 1e-6;
        let step = axis * self.freedom.axes() * STEP;
        let ahead = self.residuals(&self.light.moved(step))?;
        let behind = self.residuals(&self.light.moved(-step))?;
        let slope = |(a, b): (&f64, &f64)| (a - b) / (2.0 * STEP);
        Some(ahead.iter().zip(&behind).map(slope).collect())
    }
}

impl Problem for ShadowFit<'_> {
    type Linearized = NormalEquations<3>;

    fn cost(&self) -> Option<f64> {
        let residuals = self.residuals(&self.light)?;
        let cost = dot(&residuals, &residuals);
        cost.is_finite().then_some(cost)
    }

    fn linearized(&self) -> Option<NormalEquations<3>> {
        let residuals = self.residuals(&self.light)?;
        let [x, y, z] = DVec3::AXES.map(|axis| self.slopes(axis));
        let (x, y, z) = (x?, y?, z?);
        let mut equations = NormalEquations::ZERO;
        for (k, residual) in residuals.iter().enumerate() {
            equations.add(&[x[k], y[k], z[k]], -residual);
        }
        if self.freedom == LightFreedom::Directional {
            equations.add_prior(2, 0.0, 1.0);
        }
        Some(equations)
    }

    fn moved(&self, step: &[f64; 3]) -> Self {
        Self {
            light: self.light.moved(DVec3::from(*step)),
            ..*self
        }
    }

    fn is_negligible(&self, step: &[f64; 3]) -> bool {
        DVec3::from(*step).abs().max_element() < 1e-10
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::camera::Distortion;
    use glam::DQuat;

    const TABLE: Facet = Facet {
        point_m: DVec3::ZERO,
        normal: DVec3::Z,
    };

    fn camera() -> PosedCamera {
        PosedCamera {
            intrinsics: Intrinsics {
                size_px: [640, 480],
                focal_px: DVec2::new(615.0, 613.0),
                center_px: DVec2::new(321.0, 238.0),
                distortion: Distortion::NONE,
            },
            camera_from_world: DAffine3::from_rotation_translation(
                DQuat::from_rotation_x(2.3),
                DVec3::new(0.02, 0.03, 0.7),
            ),
        }
    }

    /// The pairs that a lamp makes on the table, by similar triangles.
    fn pairs(lamp_m: DVec3, vertices: &[DVec3]) -> Vec<ShadowPair> {
        let pair = |&caster_m: &DVec3| {
            let share = caster_m.z / (lamp_m.z - caster_m.z);
            let shadow_m = caster_m + (caster_m - lamp_m) * share;
            ShadowPair {
                caster_m,
                receiver: Facet {
                    point_m: shadow_m,
                    ..TABLE
                },
                shadow_px: camera().pixel(shadow_m).unwrap(),
                along: None,
            }
        };
        vertices.iter().map(pair).collect()
    }

    const VERTICES: [DVec3; 3] = [
        DVec3::new(0.03, 0.02, 0.08),
        DVec3::new(-0.06, 0.05, 0.05),
        DVec3::new(0.1, -0.05, 0.06),
    ];

    #[test]
    fn two_pairs_give_a_lamp_and_one_the_sun() {
        for lamp_m in [DVec3::new(-0.26, 0.24, 0.46), DVec3::new(0.4, -0.1, 0.3)] {
            for count in 2..=3 {
                let pairs = pairs(lamp_m, &VERTICES[..count]);
                let placed = place_light(&camera(), &pairs, LightFreedom::Point, 1.0).unwrap();
                let found_m = placed.light.position_m().unwrap();
                assert!((found_m - lamp_m).length() < 1e-7, "{found_m}");
                assert!(placed.rms_px < 1e-6);
            }
        }
        let far_m = DVec3::new(-3e7, 2e7, 5e7);
        let sun = pairs(far_m, &VERTICES[..1]);
        let placed = place_light(&camera(), &sun, LightFreedom::Directional, 1.0).unwrap();
        assert!(placed.light.towards.angle_between(far_m.normalize()) < 1e-7);
        assert_eq!(placed.light.position_m(), None);
    }

    #[test]
    fn the_covariance_is_what_many_noisy_clicks_scatter_by() {
        let lamp_m = DVec3::new(-0.26, 0.24, 0.46);
        let exact = pairs(lamp_m, &VERTICES);
        let predicted = place_light(&camera(), &exact, LightFreedom::Point, 0.2)
            .unwrap()
            .position_covariance(0.2)
            .unwrap();
        let mut state = 1_u64;
        let mut uniform = || {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        // The sum of twelve: variance 1.
        let mut normal = || (0..12).map(|_| uniform()).sum::<f64>() - 6.0;
        let mut scatter = DMat3::ZERO;
        const ROUNDS: usize = 600;
        for _ in 0..ROUNDS {
            let mut noisy = exact.clone();
            for pair in &mut noisy {
                pair.shadow_px += 0.2 * DVec2::new(normal(), normal());
            }
            let placed = place_light(&camera(), &noisy, LightFreedom::Point, 0.2).unwrap();
            let off_m = placed.light.position_m().unwrap() - lamp_m;
            scatter += DMat3::from_cols(off_m * off_m.x, off_m * off_m.y, off_m * off_m.z)
                * (1.0 / ROUNDS as f64);
        }
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let ratio = axis.dot(scatter * axis) / axis.dot(predicted * axis);
            assert!((0.8..1.25).contains(&ratio), "{axis}: {ratio}");
        }
    }

    #[test]
    fn what_does_not_fix_a_light_is_refused() {
        let refused = |pairs: &[ShadowPair], freedom| {
            place_light(&camera(), pairs, freedom, 1.0).unwrap_err()
        };
        let near = pairs(DVec3::new(-0.2, 0.2, 0.4), &VERTICES);
        let too_few = Unplaced::TooFewPairs {
            found: 1,
            needed: 2,
        };
        assert_eq!(refused(&near[..1], LightFreedom::Point), too_few);
        assert_eq!(
            refused(&[near[0]; 2], LightFreedom::Point),
            Unplaced::Undecided
        );
        let far = refused(
            &pairs(DVec3::new(-9.0, 6.0, 20.0), &VERTICES),
            LightFreedom::Point,
        );
        let Unplaced::TooFar(light) = far else {
            panic!("{far}")
        };
        assert!(light.towards.angle_between(DVec3::new(-9.0, 6.0, 20.0)) < 0.02);
        let mut below = near.clone();
        below[1].caster_m.z = -0.01;
        assert_eq!(
            refused(&below, LightFreedom::Point),
            Unplaced::NotItsShadow(1)
        );
    }
}
