//! What a thing hides of light from afar from itself, corner by corner, as harmonics (Sloan et al. 2002; Tamura et al. 2005,
//! equations 1 and 11): worked out once, whichever way the thing is turned later.

use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::ray_caster::RayCaster;
use crate::light::harmonics::{basis, count, sphere};

/// Degree of the harmonics of what arrives: 36 of them, as in the paper's section 7.
pub const TRANSFER_DEGREE: usize = 5;
/// Degree of those of visibility: 16, as the paper has them for glossy surfaces.
pub const VISIBILITY_DEGREE: usize = 3;
/// How many harmonics there are of either.
pub const TRANSFERS: usize = count(TRANSFER_DEGREE);
/// See [`TRANSFERS`].
pub const VISIBILITIES: usize = count(VISIBILITY_DEGREE);
/// Rays from a corner, half of them above its surface.
const RAYS: usize = 512;

/// What harmonics of even surroundings with radiance 1 a diffuse surface turns into irradiance, degree by degree (Ramamoorthi &
/// Hanrahan 2001, equation 8).
const COSINE_LOBE: [f64; TRANSFER_DEGREE + 1] =
    [PI, 2.0 * PI / 3.0, PI / 4.0, 0.0, -PI / 24.0, 0.0];

/// A corner's self-occlusion, in its thing's anchor's space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SelfOcclusion {
    /// Irradiance of the corner for each harmonic of radiance (π times T of Tamura et al. 2005, equation 1).
    pub transfer: [f32; TRANSFERS],
    /// Whether each direction is open, 1 or 0. Only directions above the surface matter; below it the function goes on as its
    /// own mirror image, so that a corner that nothing hides has no edge in it.
    pub visibility: [f32; VISIBILITIES],
}

/// Of corners (place and unit normal); `caster` says for each of them what its thing is, and how far above it rays start,
/// metres.
pub fn self_occlusions<'a>(
    corners: &[(DVec3, DVec3)],
    caster: impl Fn(usize) -> (&'a RayCaster, f64) + Sync,
) -> Vec<SelfOcclusion> {
    self_occlusions_by(RAYS, corners, caster)
}

/// The same by another number of rays from each corner, half of them above its surface.
pub fn self_occlusions_by<'a>(
    ray_count: usize,
    corners: &[(DVec3, DVec3)],
    caster: impl Fn(usize) -> (&'a RayCaster, f64) + Sync,
) -> Vec<SelfOcclusion> {
    let rays: Vec<(DVec3, Vec<f64>)> = sphere(ray_count)
        .map(|direction| (direction, basis(direction, TRANSFER_DEGREE)))
        .collect();
    let of_corner = |(number, &(place, normal)): (usize, &(DVec3, DVec3))| {
        let (caster, offset_m) = caster(number);
        let start = (place + normal * offset_m).as_vec3();
        occlusion(start, normal, &rays, caster)
    };
    corners.par_iter().enumerate().map(of_corner).collect()
}

/// What nothing hides, less what the thing does: so the error of the rays is in the hidden part alone.
fn occlusion(
    start: Vec3,
    normal: DVec3,
    rays: &[(DVec3, Vec<f64>)],
    caster: &RayCaster,
) -> SelfOcclusion {
    let mut transfer = [0.0; TRANSFERS];
    let mut visibility = [0.0; VISIBILITIES];
    for (l, lobe) in COSINE_LOBE.into_iter().enumerate() {
        let band = l * l..(l + 1) * (l + 1);
        let values = basis(normal, TRANSFER_DEGREE);
        for (sum, value) in transfer[band.clone()].iter_mut().zip(&values[band]) {
            *sum = lobe * value;
        }
    }
    // The harmonic of degree 0 of a constant 1.
    visibility[0] = (4.0 * PI).sqrt();
    let weight = 4.0 * PI / rays.len() as f64;
    for (direction, values) in rays {
        let up = direction.dot(normal);
        let above = match up > 0.0 {
            true => *direction,
            false => *direction - normal * (2.0 * up),
        };
        if !caster.is_hidden(start, above.as_vec3(), f32::INFINITY) {
            continue;
        }
        for (sum, value) in visibility.iter_mut().zip(values) {
            *sum -= weight * value;
        }
        if up > 0.0 {
            for (sum, value) in transfer.iter_mut().zip(values) {
                *sum -= weight * up * value;
            }
        }
    }
    SelfOcclusion {
        transfer: transfer.map(|sum| sum as f32),
        visibility: visibility.map(|sum| sum as f32),
    }
}

impl SelfOcclusion {
    /// Irradiance of the corner from radiance whose coefficients are in the same space (Tamura et al. 2005, equation 2); never
    /// negative, which a sum of few harmonics may be.
    pub fn irradiance(&self, radiance: &[DVec3; TRANSFERS]) -> Vec3 {
        let parts = self.transfer.iter().zip(radiance);
        let sum: DVec3 = parts
            .map(|(&part, &radiance)| radiance * f64::from(part))
            .sum();
        sum.max(DVec3::ZERO).as_vec3()
    }
}
