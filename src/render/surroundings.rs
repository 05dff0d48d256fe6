//! The ambient light as lights from many directions, whose shadows are drawn, and what a real surface loses where a virtual thing
//! is in the way: the ambient light from there, less what the thing sends instead.

use std::f64::consts::PI;

use glam::DVec3;

use crate::light::pieces::surroundings;
use crate::light::{Light, irradiance};
use crate::scene::{Object, Scene};

use super::light_piece::LitBy;

/// For each direction its light, and what is lost of it behind virtual things; none where a room or nothing shines.
pub(super) fn hidden_surroundings(scene: &Scene, lit_by: LitBy) -> Vec<[Light; 2]> {
    let count = scene.shadows.ambient_samples as usize;
    let ambient = scene.ambient_radiance;
    if lit_by == LitBy::Room || ambient == DVec3::ZERO {
        return Vec::new();
    }
    let facets = facets(scene);
    // From above, for tables lie flat.
    let lights = surroundings(DVec3::Z, ambient, count).into_iter();
    lights
        .map(|light| match light {
            Light::Directional {
                direction,
                irradiance,
                ..
            } => {
                let per_radiance = irradiance.max_element() / ambient.max_element();
                let lost = (ambient - sent(&facets, direction, ambient)) * per_radiance;
                [light, Light::directional(direction, lost)]
            }
            Light::Point { .. } => [light; 2],
        })
        .collect()
}

/// A triangle of a virtual thing.
struct Facet {
    /// As long as twice its area.
    outward: DVec3,
    /// Radiance that the lights have it send out.
    lit: DVec3,
    albedo: DVec3,
}

/// The triangles of all virtual things, as if those on moving anchors stood in the world.
fn facets(scene: &Scene) -> Vec<Facet> {
    let lights = scene.world_lights();
    let shown = scene
        .virtuals
        .iter()
        .filter(|thing| thing.visible && thing.casts);
    shown
        .flat_map(Object::reflectors)
        .map(|reflector| {
            let [a, b, c] = reflector.corners.map(|corner| corner.as_dvec3());
            let outward = (b - a).cross(c - a);
            let normal = outward.normalize_or_zero();
            let given = lights
                .iter()
                .map(|light| irradiance(light, (a + b + c) / 3.0, normal));
            Facet {
                outward,
                lit: reflector.albedo / PI * given.sum::<DVec3>(),
                albedo: reflector.albedo,
            }
        })
        .collect()
}

/// The mean radiance that virtual things send along a direction: of the lights, shadows aside, and of half the ambient light.
fn sent(facets: &[Facet], direction: DVec3, ambient: DVec3) -> DVec3 {
    let mut sum = DVec3::ZERO;
    let mut seen = 0.0;
    for facet in facets {
        let part = facet.outward.dot(direction).max(0.0);
        sum += (facet.lit + 0.5 * facet.albedo * ambient) * part;
        seen += part;
    }
    sum / f64::max(seen, 1e-12)
}
