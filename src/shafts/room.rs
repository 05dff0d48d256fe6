//! What the light of a room is worked out from.

use std::hash::{DefaultHasher, Hash, Hasher};

use glam::Vec3;

use crate::geometry::bounds::Bounds;
use crate::light::Light;

use super::patches::RoomTriangle;
use super::placed_probe::PlacedProbe;

/// The fineness in which a room is worked out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoomOptions {
    /// Patches, about.
    pub patches: usize,
    /// Part of all power that the sources send out, the brightest first, in (0, 1].
    pub source_power: f64,
    /// Patches in a leaf of the receivers' octree.
    pub receivers_per_leaf: usize,
    /// Shafts that bring every vertex less than this part of its light are cut no further.
    pub least_part: f64,
}

/// All that the light of a scene's room depends on.
pub struct Room<'a> {
    /// The table and phantoms that stand in the world, and the parts of the room. Phantoms on moving anchors have no part
    /// in it.
    pub triangles: Vec<RoomTriangle>,
    /// The table's and the phantoms' pieces come before this one.
    pub standing: u32,
    /// Around what is there to be lit: all phantoms that cast, and the virtual things, where they are.
    pub things: Vec<Bounds>,
    /// How finely it is worked out.
    pub options: RoomOptions,
    /// The broad light.
    pub probe: PlacedProbe<'a>,
    /// Lights that are drawn by themselves, and whose light is reflected like the other.
    pub compact: Vec<Light>,
}

impl Room<'_> {
    /// Rooms with the same key have the same light wherever their things stand.
    pub fn surfaces_key(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        for triangle in &self.triangles {
            hash_vectors(&mut hasher, &triangle.corners);
            hash_vectors(&mut hasher, triangle.albedo.as_slice());
            hasher.write_u32(triangle.piece);
        }
        let RoomOptions {
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
            beyond_m,
        } = &self.probe;
        hash_numbers(
            &mut hasher,
            [
                source_power,
                least_part,
                f64::from(*exposure),
                f64::from(*beyond_m),
            ],
        );
        hash_numbers(&mut hasher, position_m.to_array());
        probe.size_px().hash(&mut hasher);
        hash_vectors(&mut hasher, probe.pixels());
        hasher.write(format!("{:?}", self.compact).as_bytes());
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
