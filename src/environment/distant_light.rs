//! A probe's light as it comes from afar: as regions, whose shadows are drawn, and as harmonics, for what a thing hides from
//! itself.

use glam::{DVec3, Vec3};

use crate::light::harmonics::basis;
use crate::light::probe::Probe;
use crate::light::regions::{FINEST_PX, Region, regions};

use super::self_occlusion::{TRANSFER_DEGREE, TRANSFERS, open_transfer};

/// Of even numbers, so that no cell lies on both sides of the horizon.
const COARSE_PX: [usize; 2] = [48, 24];
/// Normals of which it is known what harmonics do not tell, ...
const NORMALS_PX: [usize; 2] = [96, 48];
/// ... and the cells that are summed up for that at most.
const SUMMED_PX: [usize; 2] = [128, 64];

/// Light from all directions, the same everywhere.
#[derive(Debug, Clone, PartialEq)]
pub struct DistantLight {
    /// Its parts, each as a light from one direction (the W of Tamura et al. 2005, section 4.2.1), linear radiance up to the
    /// camera's exposure.
    pub regions: Vec<Region>,
    /// Coefficients of its radiance, world space (L of their equation 2).
    pub harmonics: [DVec3; TRANSFERS],
    /// Its radiance, in cells about as large as the part of the sky that a ray stands for.
    pub coarse: Probe,
    /// For each normal the irradiance that the harmonics do not tell.
    beyond_harmonics: Probe,
}

impl Default for DistantLight {
    fn default() -> Self {
        Self {
            regions: Vec::new(),
            harmonics: [DVec3::ZERO; TRANSFERS],
            coarse: Probe::default(),
            beyond_harmonics: Probe::default(),
        }
    }
}

impl DistantLight {
    /// Of a probe's radiance times `exposure`, in `count` regions.
    pub fn new(probe: &Probe, exposure: f64, count_of_regions: usize) -> Self {
        let regions = regions(probe, count_of_regions);
        let exposed = |region: Region| Region {
            irradiance: region.irradiance * exposure,
            ..region
        };
        let probe = probe.at_most(FINEST_PX);
        let harmonics = harmonics(&probe, exposure);
        Self {
            coarse: coarse_radiance(&probe, exposure),
            regions: regions.into_iter().map(exposed).collect(),
            beyond_harmonics: beyond(&harmonics, &probe, exposure),
            harmonics,
        }
    }

    /// Irradiance of a surface with a unit normal that nothing hides, less what [`DistantLight::harmonics`] say of it: few of them
    /// let the light of a lamp run over the edge of what it reaches.
    pub fn beyond_harmonics(&self, normal: Vec3) -> Vec3 {
        self.beyond_harmonics.radiance(normal.as_dvec3())
    }
}

/// For each normal the irradiance of a probe's radiance times `exposure`, less that of its harmonics.
fn beyond(harmonics: &[DVec3; TRANSFERS], probe: &Probe, exposure: f64) -> Probe {
    let lit = probe.coarser(SUMMED_PX);
    let parts = lit.rays().map(|(direction, radiance, solid_angle)| {
        (
            direction.as_vec3(),
            radiance * (exposure * solid_angle) as f32,
        )
    });
    let parts: Vec<(Vec3, Vec3)> = parts.collect();
    Probe::by_direction(NORMALS_PX, |normal| {
        let facing = normal.as_vec3();
        let arriving = parts.iter();
        let exact: Vec3 = arriving
            .map(|(direction, light)| *light * direction.dot(facing).max(0.0))
            .sum();
        let parts = open_transfer(normal).into_iter().zip(harmonics);
        let told: DVec3 = parts.map(|(part, radiance)| *radiance * part).sum();
        exact - told.as_vec3()
    })
}

/// A probe's radiance times `exposure`, in cells about as large as the part of the sky that a ray stands for.
fn coarse_radiance(probe: &Probe, exposure: f64) -> Probe {
    probe.coarser(COARSE_PX).exposed(exposure as f32)
}

/// The integral of radiance times each harmonic.
fn harmonics(probe: &Probe, exposure: f64) -> [DVec3; TRANSFERS] {
    let mut sums = [DVec3::ZERO; TRANSFERS];
    for (direction, radiance, solid_angle) in probe.rays() {
        let light = radiance.as_dvec3() * (exposure * solid_angle);
        for (sum, value) in sums.iter_mut().zip(basis(direction, TRANSFER_DEGREE)) {
            *sum += light * value;
        }
    }
    sums
}
