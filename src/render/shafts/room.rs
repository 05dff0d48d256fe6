//! The room of a scene as shafts take it.

use std::hash::{DefaultHasher, Hash, Hasher};

use glam::Vec3;

use crate::geometry::bounds::Bounds;
use crate::scene::{Object, ProbeScene, Scene};
use crate::shafts::patches::RoomTriangle;
use crate::shafts::prepared::{Options, PlacedProbe, Prepared};

use super::super::anchor_geometry::reflectors;

/// All that the light of a scene's room depends on.
pub struct Room<'a> {
    /// The table and phantoms that stand in the world, and the parts of the room. Phantoms on moving anchors have no part
    /// in it.
    pub triangles: Vec<RoomTriangle>,
    /// Around what is there to be lit: all phantoms that cast, and the virtual things, where they are.
    pub things: Vec<Bounds>,
    /// How finely it is worked out.
    pub options: Options,
    /// The light.
    pub probe: PlacedProbe<'a>,
}

impl<'a> Room<'a> {
    /// The room of a scene with a probe.
    pub fn of(scene: &Scene, probe: &'a ProbeScene) -> Self {
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
        let things = standing().filter(|object| object.casts).filter_map(bounds);
        let settings = &scene.shadows.shafts;
        Self {
            triangles,
            things: things.chain(virtual_bounds(scene)).collect(),
            options: Options {
                patches: settings.patches as usize,
                source_power: settings.source_power,
                receivers_per_leaf: settings.receivers_per_leaf as usize,
                least_part: settings.least_part,
            },
            probe: PlacedProbe {
                probe: &probe.probe,
                position_m: probe.position_m,
                exposure: probe.exposure as f32,
            },
        }
    }

    /// Works its light out: seconds.
    pub fn prepare(&self) -> Prepared {
        Prepared::new(&self.triangles, self.probe, &self.things, &self.options)
    }

    /// Rooms with the same key have the same light wherever their things stand.
    pub fn surfaces_key(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for triangle in &self.triangles {
            hash_vectors(&mut hasher, &triangle.corners);
            hash_vectors(&mut hasher, triangle.albedo.as_slice());
            hasher.write_u32(triangle.piece);
        }
        let Options {
            patches,
            source_power,
            receivers_per_leaf,
            least_part,
        } = self.options;
        for number in [patches, receivers_per_leaf] {
            hasher.write_usize(number);
        }
        let PlacedProbe {
            probe,
            position_m,
            exposure,
        } = self.probe;
        hash_numbers(&mut hasher, [source_power, least_part, f64::from(exposure)]);
        hash_numbers(&mut hasher, position_m.to_array());
        probe.size_px().hash(&mut hasher);
        hash_vectors(&mut hasher, probe.pixels());
        hasher.finish()
    }

    /// Rooms with the same key are the same.
    pub fn key(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        hasher.write_u64(self.surfaces_key());
        for Bounds { low, high } in &self.things {
            hash_numbers(&mut hasher, low.to_array());
            hash_numbers(&mut hasher, high.to_array());
        }
        hasher.finish()
    }
}

fn hash_numbers(hasher: &mut impl Hasher, numbers: impl IntoIterator<Item = f64>) {
    for number in numbers {
        hasher.write_u64(number.to_bits());
    }
}

fn hash_vectors(hasher: &mut impl Hasher, vectors: &[Vec3]) {
    hasher.write_usize(vectors.len());
    hasher.write(bytemuck::cast_slice(vectors));
}

/// Around each visible virtual thing that stands in the world, in its space.
pub(super) fn virtual_bounds(scene: &Scene) -> impl Iterator<Item = Bounds> {
    let virtuals = scene
        .virtuals
        .iter()
        .filter(|object| object.visible && object.anchor == 0);
    virtuals.filter_map(bounds)
}

fn bounds(object: &Object) -> Option<Bounds> {
    let positions = object.mesh.positions.iter();
    Bounds::around(positions.map(|position| {
        object
            .anchor_from_object
            .transform_point3(position.as_dvec3())
    }))
}
