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
    /// What it saw is farther away than this, metres: what stands nearer now hides nothing of it. 0 in a room.
    pub beyond_m: f32,
}

impl PlacedProbe<'_> {
    /// Radiance of a place that the probe sees.
    pub fn radiance_of(&self, place: Vec3) -> Vec3 {
        self.probe.radiance(place.as_dvec3() - self.position_m) * self.exposure
    }

    /// Whether it saw a place: nothing of a room lies between.
    pub(super) fn sees(&self, caster: &RayCaster, place: Vec3) -> bool {
        let start = self.start(place - self.position_m.as_vec3());
        let way = place - self.position_m.as_vec3();
        way.length() > self.beyond_m && !caster.is_hidden(start, place - start, 1.0 - 1e-4)
    }

    /// Where light from a direction was on its way before anything that is near could hide it.
    pub(super) fn start(&self, direction: Vec3) -> Vec3 {
        self.position_m.as_vec3() + direction.normalize_or_zero() * self.beyond_m
    }
}
