//! Values that are allowed but hardly meant: markers as large as houses, virtual things in the dark.

use glam::{DVec3, Vec3};

use crate::light::Light;
use crate::scene::{EnvironmentSettings, Scene, ShadowTechnique};

/// Nobody prints larger markers, metres.
const LARGEST_MARKER_M: f64 = 2.0;

/// What there is to warn of.
pub fn warnings(scene: &Scene) -> Vec<String> {
    let mut warnings = Vec::new();
    for anchor in &scene.anchors {
        let large = anchor
            .markers
            .iter()
            .find(|marker| marker.size_m > LARGEST_MARKER_M);
        if let Some(marker) = large {
            warnings.push(format!(
                "marker {} of \"{}\" is {} m large: size_m is in metres; was {} meant?",
                marker.id,
                anchor.name,
                marker.size_m,
                marker.size_m / 1000.0
            ));
        }
    }
    let shows = scene.virtuals.iter().any(|thing| thing.visible);
    if shows && is_dark(scene) {
        warnings.push(
            "nothing lights the scene: virtual things are black; give a [[light]], [ambient] or a [probe]"
                .to_owned(),
        );
    }
    warnings.extend(unused_light(scene));
    let technique = scene.chosen_technique().0;
    let is_set = scene.shadows.environment != EnvironmentSettings::default();
    if is_set && technique != ShadowTechnique::Environment {
        warnings.push(format!(
            "[environment] is not used: it is for technique environment, and this scene's is {}",
            technique.name()
        ));
    }
    warnings
}

/// Of the light from all around what the technique does not take.
fn unused_light(scene: &Scene) -> Option<String> {
    scene.probe.as_ref()?;
    let has_ambient = scene.ambient_radiance != DVec3::ZERO;
    match takes_probe(scene) {
        true => has_ambient.then(|| {
            "[ambient] radiance is not used: all light from around comes from the probe".to_owned()
        }),
        false => Some(format!(
            "the probe is not used: technique = \"{}\" takes the lights and the [ambient] light alone",
            scene.chosen_technique().0.name()
        )),
    }
}

fn takes_probe(scene: &Scene) -> bool {
    scene.probe.is_some() && scene.chosen_technique().0.takes_probe()
}

fn is_dark(scene: &Scene) -> bool {
    let shines = scene.lights.iter().any(|light| {
        let strength = match light.light {
            Light::Point { intensity, .. } => intensity,
            Light::Directional { irradiance, .. } => irradiance,
        };
        strength != DVec3::ZERO
    });
    let mut materials = scene.virtuals.iter().flat_map(|thing| &thing.materials);
    let glows = materials.any(|material| material.emission != DVec3::ZERO);
    let probe = scene.probe.as_ref().filter(|_| takes_probe(scene));
    let is_around = match probe {
        Some(probe) => probe
            .probe
            .pixels()
            .iter()
            .any(|pixel| *pixel != Vec3::ZERO),
        None => scene.ambient_radiance != DVec3::ZERO,
    };
    !shines && !glows && !is_around
}
