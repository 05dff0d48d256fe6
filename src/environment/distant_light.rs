//! A probe's light as it comes from afar: as regions, whose shadows are drawn, and as harmonics, for what a thing hides from
//! itself.

use glam::DVec3;

use crate::light::harmonics::basis;
use crate::light::probe::Probe;
use crate::light::regions::{Region, regions};

use super::self_occlusion::{TRANSFER_DEGREE, TRANSFERS};

/// Of even numbers, so that no cell lies on both sides of the horizon.
const COARSE_PX: [usize; 2] = [48, 24];

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
}

impl Default for DistantLight {
    fn default() -> Self {
        Self {
            regions: Vec::new(),
            harmonics: [DVec3::ZERO; TRANSFERS],
            coarse: Probe::default(),
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
        Self {
            coarse: coarse_radiance(probe, exposure),
            regions: regions.into_iter().map(exposed).collect(),
            harmonics: harmonics(probe, exposure),
        }
    }
}

/// A probe's radiance times `exposure`, in cells about as large as the part of the sky that a ray stands for.
pub fn coarse_radiance(probe: &Probe, exposure: f64) -> Probe {
    let mut coarse = probe.coarser(COARSE_PX);
    coarse.scale(exposure as f32);
    coarse
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
