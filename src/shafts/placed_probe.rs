//! A probe in its room.

use std::borrow::Cow;

use glam::{DVec3, Vec3};

use crate::geometry::ray_caster::RayCaster;
use crate::light::probe::Probe;

/// A probe, and where it was taken.
#[derive(Clone)]
pub struct PlacedProbe<'a> {
    /// Radiance by direction.
    pub probe: Cow<'a, Probe>,
    /// Where it was taken, metres.
    pub position_m: DVec3,
    /// Display white over the probe's unit of radiance.
    pub exposure: f32,
}

impl PlacedProbe<'_> {
    /// Radiance of a place that the probe sees.
    pub fn radiance_of(&self, place: Vec3) -> Vec3 {
        self.probe.radiance(place.as_dvec3() - self.position_m) * self.exposure
    }

    /// Whether nothing of a room lies between.
    pub(super) fn sees(&self, caster: &RayCaster, place: Vec3) -> bool {
        let origin = self.position_m.as_vec3();
        !caster.is_hidden(origin, place - origin, 1.0 - 1e-4)
    }
}
