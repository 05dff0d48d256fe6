//! A scene as the floors below take it: what reflects light, what hides it, and the room around.

use glam::Vec3;

use super::{Object, ProbeScene, Scene, SplitLight};
use crate::geometry::bounds::Bounds;
use crate::geometry::mesh::Mesh;
use crate::light::bounce::Reflector;
use crate::shafts::casters::Occluder;
use crate::shafts::patches::RoomTriangle;
use crate::shafts::room::Room;
use crate::shafts::room_transport::{PlacedProbe, RoomOptions};

impl Object {
    /// The positions of its mesh, or of a coarser one, in its anchor's space.
    pub fn positions_in_anchor(&self, mesh: &Mesh) -> Vec<Vec3> {
        let place = |position: &Vec3| {
            self.anchor_from_object
                .transform_point3(position.as_dvec3())
                .as_vec3()
        };
        mesh.positions.iter().map(place).collect()
    }

    /// Its triangles as what light meets there, in its anchor's space.
    pub fn reflectors(&self) -> impl Iterator<Item = Reflector> {
        let mesh = &self.mesh;
        let positions = self.positions_in_anchor(mesh);
        mesh.triangles
            .iter()
            .zip(&mesh.triangle_materials)
            .map(move |(triangle, &material)| Reflector {
                corners: triangle.map(|index| positions[index as usize]),
                albedo: self.materials[material as usize].albedo,
            })
    }

    /// The smallest box around it, in its anchor's space; `None` without triangles.
    pub(super) fn bounds_in_anchor(&self) -> Option<Bounds> {
        let positions = self.mesh.positions.iter();
        Bounds::around(positions.map(|position| {
            self.anchor_from_object
                .transform_point3(position.as_dvec3())
        }))
    }
}

impl Scene {
    /// What of a scene with a probe its room's light depends on.
    pub fn room<'a>(&self, probe: &'a ProbeScene) -> Room<'a> {
        let standing = || {
            self.phantoms
                .iter()
                .filter(|object| object.visible && object.anchor == 0)
        };
        let mut triangles: Vec<RoomTriangle> = Vec::new();
        for (piece, object) in (0..).zip(standing()) {
            triangles.extend(object.reflectors().map(|reflector| RoomTriangle {
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
        let things = standing()
            .filter(|object| object.casts)
            .filter_map(Object::bounds_in_anchor);
        let settings = &self.shadows.shafts;
        let SplitLight { compact, rest, .. } = self.split_light(probe);
        Room {
            triangles,
            standing: first,
            things: things.chain(self.virtual_bounds()).collect(),
            options: RoomOptions {
                patches: settings.patches as usize,
                source_power: settings.source_power,
                receivers_per_leaf: settings.receivers_per_leaf as usize,
                least_part: settings.least_part,
            },
            probe: PlacedProbe {
                probe: rest,
                position_m: probe.position_m,
                exposure: probe.exposure as f32,
            },
            compact,
        }
    }

    /// The boxes around the visible virtual things that stand in the world.
    pub fn virtual_bounds(&self) -> impl Iterator<Item = Bounds> {
        let virtuals = self
            .virtuals
            .iter()
            .filter(|object| object.visible && object.anchor == 0);
        virtuals.filter_map(Object::bounds_in_anchor)
    }

    /// The virtual things as they hide a room's light.
    pub fn occluders(&self) -> Vec<Occluder<'_>> {
        let virtuals = self.virtuals.iter().map(|object| Occluder {
            mesh: &object.mesh,
            materials: &object.materials,
            anchor: object.anchor,
            anchor_from_object: object.anchor_from_object,
            casts: object.casts,
            visible: object.visible,
        });
        virtuals.collect()
    }
}
