//! Values that are allowed but hardly meant: markers as large as houses, virtual things in the dark.

use glam::{DVec3, Vec3};

use crate::geometry::bounds::Bounds;
use crate::light::{Light, irradiance};
use crate::scene::{EnvironmentSettings, Marker, Object, Scene, ShadowTechnique};

/// Nobody prints larger markers, metres.
const LARGEST_MARKER_M: f64 = 2.0;

/// Nobody has a lamp farther from the table that is too dim to be seen there, metres.
const FARTHEST_LAMP_M: f64 = 20.0;
/// Irradiance below which a lamp does nothing that a picture could show.
const LEAST_IRRADIANCE: f64 = 1e-3;

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
    let world = scene.anchors.first();
    let is_flat = world.is_some_and(|world| world.markers.iter().all(Marker::is_in_plane));
    for (number, light) in scene.lights.iter().enumerate() {
        if light.anchor == 0 {
            warnings.extend(too_far(number, light.light));
            let behind = is_flat.then(|| from_behind(number, light.light)).flatten();
            warnings.extend(behind.or_else(|| past_everything(scene, number, light.light)));
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

/// A lamp that is too far away for its strength.
fn too_far(number: usize, light: Light) -> Option<String> {
    let Light::Point {
        position_m,
        intensity,
        ..
    } = light
    else {
        return None;
    };
    let distance_m = position_m.length();
    let irradiance = intensity.max_element() / distance_m.powi(2);
    let [x, y, z] = (position_m / 1000.0).to_array();
    (distance_m > FARTHEST_LAMP_M && irradiance < LEAST_IRRADIANCE).then(|| {
        format!(
            "light {number} is {distance_m:.0} m away and too dim to be seen from there: position_m is in metres; was [{x}, {y}, \
             {z}] meant?"
        )
    })
}

/// A light from behind the markers of the world, which lie on a table or hang on a wall.
fn from_behind(number: usize, light: Light) -> Option<String> {
    let (key, z, is_behind) = match light {
        Light::Point { position_m, .. } => ("position_m", position_m.z, position_m.z < 0.0),
        Light::Directional { direction, .. } => ("direction", direction.z, direction.z > 0.0),
    };
    is_behind.then(|| {
        format!(
            "light {number} comes from behind the markers and lights nothing that lies beside them: its {key} has z = {z:.2}; z \
             points out of their printed side, and a direction is the way that light goes"
        )
    })
}

/// A lamp in whose light lies nothing of the world, neither things nor markers.
fn past_everything(scene: &Scene, number: usize, light: Light) -> Option<String> {
    let Light::Point {
        position_m,
        intensity,
        ..
    } = light
    else {
        return None;
    };
    let things = scene.phantoms.iter().chain(&scene.virtuals);
    let things = things.filter(|thing| thing.visible && thing.anchor == 0);
    let markers = scene
        .anchors
        .iter()
        .take(1)
        .flat_map(|world| &world.markers);
    let places = things
        .filter_map(Object::bounds_in_anchor)
        .flat_map(|bounds| places_in(&bounds))
        .chain(markers.flat_map(Marker::corners_m));
    let is_lit = |place: DVec3| {
        let toward = (position_m - place).normalize_or_zero();
        irradiance(&light, place, toward) != DVec3::ZERO
    };
    (intensity != DVec3::ZERO && !places.into_iter().any(is_lit)).then(|| {
        format!(
            "light {number} shines past everything: no thing and no marker lies in its light; its direction is the way that light \
             goes"
        )
    })
}

/// Places all over a box.
fn places_in(bounds: &Bounds) -> Vec<DVec3> {
    const SIDE: usize = 5;
    let part = |index: usize| index as f64 / (SIDE - 1) as f64;
    let (low, size) = (bounds.low, bounds.high - bounds.low);
    (0..SIDE * SIDE * SIDE)
        .map(|k| {
            low + size * DVec3::new(part(k % SIDE), part(k / SIDE % SIDE), part(k / SIDE / SIDE))
        })
        .collect()
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
