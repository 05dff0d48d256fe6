//! The patches that receive a shadow of the casters; and what the casters reflect on to them, for which they are cut more
//! finely.

use std::f32::consts::FRAC_1_PI;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::bounding::Aabb;
use super::casters::PlacedCasters;
use super::difference::{Difference, Terms};
use super::intensity_transfers::encoded;
use super::room_transport::RoomTransport;
use super::selection::LEAST_WEIGHT;
use super::shadow_atlas::MappedSource;
use super::surfels::{GroupedSurfels, LitSurfel, reflected_irradiance};

/// A corner of a patch that shadows may reach: the twin of `PatchCorner` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct PatchCorner {
    /// In the world, metres.
    pub position: Vec3,
    /// Rows of the patch's three vertices.
    pub rows: [u32; 3],
    /// Weights of the first two there: 0 and 1.
    pub weights: [f32; 2],
    /// First of the patch's sources in the lists, and their number.
    pub list: [u32; 2],
}

/// A corner of a part of a patch that casters reflect light on to: the twin of `ReflectedCorner` in shafts.wgsl.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
pub struct ReflectedCorner {
    /// In the world, metres.
    pub position: Vec3,
    /// What virtual things reflect on to it, less what it loses from patches among them.
    pub irradiance: Vec3,
}

/// All that decides which patches receive a shadow.
pub struct ReceiverInputs<'a> {
    /// The room.
    pub room: &'a RoomTransport,
    /// The casters.
    pub casters: &'a PlacedCasters,
    /// Of all patches that may receive a shadow, sorted: the rows of what follows.
    pub vertices: &'a [u32],
    /// The sources that have a map.
    pub sources: &'a [MappedSource],
    /// Light from each source at each vertex, packed; rows of as many as there are sources.
    pub transfers: &'a [[u32; 2]],
    /// The casters' surfels.
    pub surfels: &'a GroupedSurfels,
    /// Irradiance that each vertex loses from patches among the casters.
    pub lost_nearby: &'a [Vec3],
    /// In which terms light is taken out of the video.
    pub terms: Terms<'a>,
}

/// The patches that receive a shadow, or light that the casters reflect.
#[derive(Default)]
pub struct ReceiverPatches {
    /// Three for each patch that a source's shadow may reach.
    pub corners: Vec<PatchCorner>,
    /// Three for each part of a patch that casters reflect light on to.
    pub reflected: Vec<ReflectedCorner>,
    /// Numbers of sources, which the corners refer to.
    pub lists: Vec<u32>,
}

impl ReceiverPatches {
    /// The box around all of them; `None` without any.
    pub fn bounds(&self) -> Option<Aabb> {
        let shadowed = self.corners.iter().map(|corner| corner.position);
        let lit = self.reflected.iter().map(|corner| corner.position);
        let is_empty = self.corners.is_empty() && self.reflected.is_empty();
        (!is_empty).then(|| Aabb::around(shadowed.chain(lit)))
    }
}

impl ReceiverInputs<'_> {
    /// The corners of some patches, those left out that neither a shadow reaches nor light that shows.
    pub fn receivers(&self, patches: &[usize]) -> ReceiverPatches {
        /// Patches that are looked at in one go.
        const CHUNK: usize = 64;
        let shares = patches.par_chunks(CHUNK).map(|patches| {
            let mut share = ReceiverPatches::default();
            for &patch in patches {
                self.add(patch, &mut share);
            }
            share
        });
        let mut all = ReceiverPatches::default();
        for share in shares.collect::<Vec<_>>() {
            let first = all.lists.len() as u32;
            all.lists.extend(share.lists);
            all.reflected.extend(share.reflected);
            all.corners
                .extend(share.corners.into_iter().map(|corner| PatchCorner {
                    list: [first + corner.list[0], corner.list[1]],
                    ..corner
                }));
        }
        all
    }

    fn add(&self, index: usize, to: &mut ReceiverPatches) {
        let room = self.room;
        let patch = &room.patches.patches[index];
        let row = |vertex: u32| self.vertices.binary_search(&vertex).unwrap_or(0) as u32;
        let rows = patch.vertices.map(row);
        let places = room.patches.corners(patch);
        let first = to.lists.len();
        let count = self.sources.len();
        to.lists.extend((0..count).filter_map(|index| {
            let arrives = |&row: &u32| self.transfers[row as usize * count + index] != [0, 0];
            let may_fall = rows.iter().any(arrives) && self.sources[index].may_shade(places);
            may_fall.then_some(index as u32)
        }));
        let list = [first as u32, (to.lists.len() - first) as u32];
        if list[1] > 0 {
            let own = [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]];
            to.corners.extend((0..3).map(|corner| PatchCorner {
                position: places[corner],
                rows,
                weights: own[corner],
                list,
            }));
        }
        self.add_reflected(index, rows, to);
    }

    /// The parts of a patch that casters reflect light on to, if any of it shows.
    fn add_reflected(&self, patch: usize, rows: [u32; 3], to: &mut ReceiverPatches) {
        let room = self.room;
        let light = &room.light[patch];
        let patch = &room.patches.patches[patch];
        let albedo = self.terms.reflectance(patch, light);
        let places = room.patches.corners(patch);
        let normal = room.patches.normal(patch);
        let lost = rows.map(|row| self.lost_nearby[row as usize]);
        let seen = self.surfels.seen_from(Aabb::around(places));
        let surfels: Vec<LitSurfel> = seen.copied().collect();
        let grid = Grid {
            count: self.casters.parts(places),
        };
        let weights: Vec<[f32; 2]> = grid.weights().collect();
        let corners: Vec<ReflectedCorner> = weights
            .iter()
            .map(|&[a, b]| {
                let c = 1.0 - a - b;
                let mean = |[at_a, at_b, at_c]: [Vec3; 3]| at_a * a + at_b * b + at_c * c;
                let position = mean(places);
                ReflectedCorner {
                    position,
                    irradiance: reflected_irradiance(position, normal, &surfels) - mean(lost),
                }
            })
            .collect();
        let least = patch
            .vertices
            .map(|vertex| room.irradiance[vertex as usize] * LEAST_WEIGHT);
        let least = least.into_iter().fold(Vec3::MAX, Vec3::min);
        let gains = |corner: &ReflectedCorner| corner.irradiance.abs().cmpgt(least).any();
        // What the camera sees of an irradiance.
        let shown = |irradiance: Vec3| irradiance * albedo * FRAC_1_PI;
        let light = |index: usize| {
            let [a, b] = weights[index];
            let of = patch
                .vertices
                .map(|vertex| room.irradiance[vertex as usize]);
            of[0] * a + of[1] * b + of[2] * (1.0 - a - b)
        };
        let in_terms = |index: usize| match (self.terms.difference, corners[index].irradiance) {
            (Difference::Ratio, reflected) => reflected,
            (Difference::Subtract, reflected) => shown(reflected),
            // The paper has shadows alone; without what the casters reflect they are far too dark.
            (Difference::Encoded, reflected) => {
                encoded(shown(light(index) + reflected)) - encoded(shown(light(index)))
            }
        };
        if corners.iter().any(gains) {
            let triangles = grid.triangles().flatten();
            to.reflected.extend(triangles.map(|index| ReflectedCorner {
                irradiance: in_terms(index),
                ..corners[index]
            }));
        }
    }
}

/// A triangle whose edges are cut into parts.
struct Grid {
    count: u32,
}

impl Grid {
    /// The weights of the triangle's first two corners at all points, row by row.
    fn weights(&self) -> impl Iterator<Item = [f32; 2]> {
        let count = self.count;
        let point = move |column: u32, row: u32| [column, row].map(|at| at as f32 / count as f32);
        (0..=count).flat_map(move |row| (0..=count - row).map(move |column| point(column, row)))
    }

    /// The points of all small triangles, wound as the large one.
    fn triangles(&self) -> impl Iterator<Item = [usize; 3]> {
        let count = self.count as usize;
        // The rows above have one point more each than the one below them.
        let index = move |column: usize, row: usize| {
            row * (count + 1) - row * row.saturating_sub(1) / 2 + column
        };
        let cell = move |row: usize, column: usize| {
            let upright = [
                index(column, row),
                index(column + 1, row),
                index(column, row + 1),
            ];
            let turned = (column + row + 1 < count).then(|| {
                [
                    index(column + 1, row),
                    index(column + 1, row + 1),
                    index(column, row + 1),
                ]
            });
            std::iter::once(upright).chain(turned)
        };
        (0..count).flat_map(move |row| (0..count - row).flat_map(move |column| cell(row, column)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_triangle_is_covered_once_by_parts_wound_as_itself() {
        for count in 1..7 {
            let grid = Grid { count };
            let weights: Vec<[f32; 2]> = grid.weights().collect();
            assert_eq!(weights.len() as u32, (count + 1) * (count + 2) / 2);
            let triangles: Vec<[usize; 3]> = grid.triangles().collect();
            assert_eq!(triangles.len() as u32, count * count);
            let mut middles: Vec<[i64; 2]> = triangles
                .iter()
                .map(|triangle| {
                    let [a, b, c] = triangle.map(|index| weights[index]);
                    let doubled = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
                    let cell = 1.0 / (count * count) as f32;
                    assert!((doubled - cell).abs() < 1e-5, "{count} {doubled}");
                    [0, 1].map(|axis| ((a[axis] + b[axis] + c[axis]) * count as f32).round() as i64)
                })
                .collect();
            middles.sort_unstable();
            middles.dedup();
            assert_eq!(middles.len(), triangles.len());
        }
    }
}
