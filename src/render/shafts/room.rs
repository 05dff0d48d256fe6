//! The room of a scene as shafts take it, worked out once.

use glam::Vec3;

use crate::geometry::bounds::Bounds;
use crate::scene::{Object, ProbeScene, Scene};
use crate::shafts::patches::RoomTriangle;
use crate::shafts::prepared::{Options, PlacedProbe, Prepared};

use super::super::anchor_geometry::reflectors;

/// Works the light of a scene's room out. Phantoms on moving anchors have no part in it.
pub fn prepare(scene: &Scene, probe: &ProbeScene) -> Prepared {
    let standing = || {
        scene
            .phantoms
            .iter()
            .filter(|object| object.visible && object.anchor == 0)
    };
    let mut triangles: Vec<RoomTriangle> = Vec::new();
    for (piece, object) in (0..).zip(standing()) {
        triangles.extend(reflectors(object).map(|reflector| RoomTriangle {
            corners: reflector.corners,
            albedo: Some(reflector.albedo.as_vec3()),
            piece,
        }));
    }
    let first = standing().count() as u32;
    for (piece, part) in (first..).zip(&probe.room) {
        let triangle = |&(corners, albedo): &([Vec3; 3], Option<Vec3>)| RoomTriangle {
            corners,
            albedo,
            piece,
        };
        triangles.extend(part.triangles.iter().map(triangle));
    }
    let virtuals = scene
        .virtuals
        .iter()
        .filter(|object| object.visible && object.anchor == 0);
    let things: Vec<Bounds> = standing()
        .filter(|object| object.casts)
        .chain(virtuals)
        .filter_map(bounds)
        .collect();
    let settings = &scene.shadows.shafts;
    Prepared::new(
        &triangles,
        PlacedProbe {
            probe: &probe.probe,
            position_m: probe.position_m,
            exposure: probe.exposure as f32,
        },
        &things,
        &Options {
            patches: settings.patches as usize,
            source_power: settings.source_power,
            receivers_per_leaf: settings.receivers_per_leaf as usize,
            least_part: settings.least_part,
        },
    )
}

fn bounds(object: &Object) -> Option<Bounds> {
    let positions = object.mesh.positions.iter();
    Bounds::around(positions.map(|position| {
        object
            .anchor_from_object
            .transform_point3(position.as_dvec3())
    }))
}
