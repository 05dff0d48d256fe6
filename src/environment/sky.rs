//! Light from all around as it is gathered: what comes from everywhere alike, and what comes from single directions.

use glam::{DVec3, Vec3};

use crate::light::probe::Probe;
use crate::light::radiance9::Radiance9;
use crate::light::regions::{FINEST_PX, Region, regions};

use super::distant_light::coarse_radiance;

/// Of so many rays that a scene asks for one looks for what things reflect, where the sky's light has directions of its own.
const RAYS_FOR_ONE: usize = 4;

/// Light from afar.
#[derive(Debug, Clone)]
pub struct Sky {
    /// From everywhere.
    pub radiance: Vec3,
    /// Of regions of like power, each from one direction: a bright part of the sky gets many of them.
    pub sources: Vec<Region>,
    harmonics: Radiance9,
    /// Its radiance by direction.
    coarse: Probe,
}

impl Sky {
    /// A probe's radiance times `exposure`, from about so many directions over each hemisphere.
    pub fn new(probe: &Probe, exposure: f64, rays: usize) -> Self {
        let mut sources = regions(probe, 2 * rays);
        let mut harmonics = Radiance9::default();
        for source in &mut sources {
            source.irradiance *= exposure;
        }
        let probe = probe.at_most(FINEST_PX);
        for (direction, radiance, solid_angle) in probe.rays() {
            let light = radiance.as_dvec3() * (exposure * solid_angle);
            harmonics.add(direction.as_vec3(), light.as_vec3());
        }
        Self {
            radiance: Vec3::ZERO,
            sources,
            harmonics,
            coarse: coarse_radiance(&probe, exposure),
        }
    }

    /// The same radiance from everywhere.
    pub fn constant(radiance: DVec3) -> Self {
        let mut harmonics = Radiance9::default();
        // (The harmonic of degree 0 over the sphere.)
        harmonics.0[0] = (radiance * (4.0 * std::f64::consts::PI).sqrt()).as_vec3();
        Self {
            radiance: radiance.as_vec3(),
            sources: Vec::new(),
            harmonics,
            coarse: Probe::of_one_radiance(radiance.as_vec3()),
        }
    }

    /// Rays over a hemisphere, of so many that are asked for.
    pub fn rays(&self, asked_for: usize) -> usize {
        match self.sources.is_empty() {
            true => asked_for,
            false => asked_for.div_ceil(RAYS_FOR_ONE),
        }
    }

    /// Mean radiance around a direction.
    pub fn radiance_from(&self, direction: Vec3) -> Vec3 {
        self.coarse.radiance(direction.as_dvec3())
    }

    /// Irradiance of a surface with a unit normal that sees all of it.
    pub fn irradiance(&self, normal: Vec3) -> Vec3 {
        self.harmonics.irradiance(normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    #[test]
    fn one_radiance_gives_all_surfaces_pi_times_it() {
        let radiance = Vec3::new(0.5, 1.0, 2.0);
        let constant = Sky::constant(radiance.as_dvec3());
        let probe = Probe::new([64, 32], vec![0.25 * radiance; 64 * 32]).expect("pixels");
        let sky = Sky::new(&probe, 4.0, 256);
        for way in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)] {
            for found in [constant.irradiance(way), sky.irradiance(way)] {
                assert!((found / PI).distance(radiance) < 0.01, "{found}");
            }
            let of_sources = sky.sources.iter().map(|source| {
                let cosine = source.toward.as_vec3().dot(way).max(0.0);
                source.irradiance.as_vec3() * cosine
            });
            let found = of_sources.sum::<Vec3>() / PI;
            assert!(found.distance(radiance) < 0.03, "{way}: {found}");
        }
    }
}
