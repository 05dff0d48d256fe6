//! The real scene cut into patches: small where things stand close by and where the light is bright.

use std::collections::{HashMap, HashSet};

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::points::points_on;
use crate::geometry::bounds::Bounds;

/// A triangle of the room, the table or a phantom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoomTriangle {
    /// Counter-clockwise seen from the side that light falls on, metres.
    pub corners: [Vec3; 3],
    /// Diffuse reflectance; `None`: to be estimated.
    pub albedo: Option<Vec3>,
    /// Which thing it belongs to.
    pub piece: u32,
}

/// A corner of patches: of all those that share its place, normal and piece.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PatchVertex {
    /// Metres.
    pub position: Vec3,
    /// Unit length.
    pub normal: Vec3,
}

/// A triangle that sends and receives light as one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RoomPatch {
    /// Indices of its corners among the vertices, counter-clockwise.
    pub vertices: [u32; 3],
    /// Which thing it belongs to.
    pub piece: u32,
    /// Diffuse reflectance; `None`: to be estimated.
    pub albedo: Option<Vec3>,
}

/// The room in patches. Neighbours meet in whole edges: there is no gap between them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RoomPatches {
    /// Shared corners.
    pub vertices: Vec<PatchVertex>,
    /// The triangles.
    pub patches: Vec<RoomPatch>,
}

/// Things nearer than this to where patches matter make them no finer, metres.
const NEAREST_M: f64 = 0.04;
/// Part of the weight that darkness leaves.
const WEIGHT_OF_DARKNESS: f32 = 0.3;
/// Edges that look smaller than this from where things are stay whole, radians: a sun is then cut into a few.
const SMALLEST_EDGE: f32 = 0.005;

/// Mean brightness of some triangles, by how large they look from a distance.
fn mean_seen(
    triangles: &[RoomTriangle],
    distance: impl Fn(Vec3) -> f32,
    brightness: impl Fn(Vec3, f32) -> f32,
) -> f32 {
    const POINTS: usize = 64;
    let (mut sum, mut whole) = (0.0, 0.0);
    for &RoomTriangle { corners, .. } in triangles {
        let [a, b, c] = corners;
        let area = (b - a).cross(c - a).length() / 2.0;
        let radius = (area / POINTS as f32).sqrt() / 2.0;
        for place in points_on(corners, POINTS) {
            let looks = area / distance(place).powi(2);
            sum += looks * brightness(place, radius);
            whole += looks;
        }
    }
    sum / whole.max(f32::MIN_POSITIVE)
}

impl RoomPatches {
    /// Cuts triangles until there are about `budget` patches, never more unless there are more triangles. Edges are
    /// judged by how large they look from the nearest of `focuses`, and by the mean `brightness` (in any unit) of a ball around
    /// them, which has a centre and a radius.
    pub fn new(
        triangles: &[RoomTriangle],
        budget: usize,
        focuses: &[Bounds],
        brightness: impl Fn(Vec3, f32) -> f32,
    ) -> Self {
        let distance = |place: Vec3| {
            let point = place.as_dvec3();
            let distances = focuses
                .iter()
                .map(|focus| point.distance(point.clamp(focus.low, focus.high)));
            distances.fold(f64::INFINITY, f64::min).max(NEAREST_M) as f32
        };
        let mean = mean_seen(triangles, distance, &brightness);
        // (The balls around a triangle's edges cover it: nothing bright is missed.)
        let weight = |a: Vec3, b: Vec3| {
            let (middle, length) = (a.midpoint(b), a.distance(b));
            let looks = length / distance(middle);
            if looks < SMALLEST_EDGE {
                return 0.0;
            }
            let bright = WEIGHT_OF_DARKNESS + brightness(middle, length / 2.0) / mean.max(1e-9);
            bright.sqrt() * looks
        };
        let too_large = |limit: f32| {
            let weight = &weight;
            move |a: Vec3, b: Vec3| weight(a, b) > limit
        };
        // The limit on an edge's look that just spends the budget.
        let (mut low, mut high) = (1e-3_f32, 1e3_f32);
        let mut best = Self::cut(triangles, usize::MAX, |_, _| false).unwrap_or_default();
        for _ in 0..18 {
            let limit = (low * high).sqrt();
            match Self::cut(triangles, budget, too_large(limit)) {
                Some(patches) => {
                    if patches.patches.len() > best.patches.len() {
                        best = patches;
                    }
                    high = limit;
                }
                None => low = limit,
            }
        }
        best
    }

    /// `None` where that takes more than `most` patches.
    fn cut(
        triangles: &[RoomTriangle],
        most: usize,
        too_large: impl Fn(Vec3, Vec3) -> bool,
    ) -> Option<Self> {
        let mut result = Self::default();
        let mut welded = HashMap::new();
        for triangle in triangles {
            let [a, b, c] = triangle.corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            if normal == Vec3::ZERO {
                continue;
            }
            let vertices = triangle
                .corners
                .map(|corner| result.vertex(&mut welded, corner, normal, triangle.piece));
            result.patches.push(RoomPatch {
                vertices,
                piece: triangle.piece,
                albedo: triangle.albedo,
            });
        }
        loop {
            let marked = result.marked_edges(&too_large);
            if marked.is_empty() {
                return Some(result);
            }
            result.split(&mut welded, &marked);
            if result.patches.len() > most {
                return None;
            }
        }
    }

    fn vertex(
        &mut self,
        welded: &mut HashMap<[u32; 7], u32>,
        position: Vec3,
        normal: Vec3,
        piece: u32,
    ) -> u32 {
        let [x, y, z] = position.to_array().map(f32::to_bits);
        // Normals of one plane differ by rounding.
        let [nx, ny, nz] = normal
            .to_array()
            .map(|part| (part * 1e4).round() as i32 as u32);
        *welded
            .entry([x, y, z, nx, ny, nz, piece])
            .or_insert_with(|| {
                self.vertices.push(PatchVertex { position, normal });
                self.vertices.len() as u32 - 1
            })
    }

    /// Edges to halve, by their places: those that are too large, and the longest of every triangle that loses another,
    /// which keeps triangles from growing thin.
    fn marked_edges(&self, too_large: &impl Fn(Vec3, Vec3) -> bool) -> HashSet<EdgePlace> {
        let mut marked = HashSet::new();
        for patch in &self.patches {
            for [a, b] in self.edges(patch) {
                if too_large(a, b) {
                    marked.insert(edge_place(a, b));
                }
            }
        }
        loop {
            let before = marked.len();
            for patch in &self.patches {
                let edges = self.edges(patch);
                if edges
                    .iter()
                    .any(|[a, b]| marked.contains(&edge_place(*a, *b)))
                {
                    let length = |edge: &[Vec3; 2]| edge[0].distance_squared(edge[1]);
                    let longest = edges
                        .iter()
                        .max_by(|one, other| length(one).total_cmp(&length(other)));
                    marked.extend(longest.map(|[a, b]| edge_place(*a, *b)));
                }
            }
            if marked.len() == before {
                return marked;
            }
        }
    }

    fn edges(&self, patch: &RoomPatch) -> [[Vec3; 2]; 3] {
        let [a, b, c] = self.corners(patch);
        [[a, b], [b, c], [c, a]]
    }

    fn split(&mut self, welded: &mut HashMap<[u32; 7], u32>, marked: &HashSet<EdgePlace>) {
        for patch in std::mem::take(&mut self.patches) {
            let mut ring = Vec::with_capacity(6);
            for (corner, [a, b]) in self.edges(&patch).into_iter().enumerate() {
                ring.push((patch.vertices[corner], true));
                if marked.contains(&edge_place(a, b)) {
                    let normal = self.vertices[patch.vertices[corner] as usize].normal;
                    let middle = self.vertex(welded, middle(a, b), normal, patch.piece);
                    ring.push((middle, false));
                }
            }
            let mut push = |vertices| self.patches.push(RoomPatch { vertices, ..patch });
            let place = |index: usize| ring[index % ring.len()].0;
            match ring.len() {
                3 => push(patch.vertices),
                4 => {
                    // The corner across from the new vertex.
                    let new = ring.iter().position(|(_, old)| !old).unwrap_or(0);
                    push([place(new), place(new + 1), place(new + 2)]);
                    push([place(new), place(new + 2), place(new + 3)]);
                }
                5 => {
                    // The corner between both new vertices is cut off.
                    let tip = (0..5)
                        .find(|&at| ring[at].1 && !ring[(at + 1) % 5].1 && !ring[(at + 4) % 5].1)
                        .unwrap_or(0);
                    push([place(tip + 4), place(tip), place(tip + 1)]);
                    push([place(tip + 4), place(tip + 1), place(tip + 2)]);
                    push([place(tip + 4), place(tip + 2), place(tip + 3)]);
                }
                _ => {
                    push([place(0), place(1), place(5)]);
                    push([place(1), place(2), place(3)]);
                    push([place(3), place(4), place(5)]);
                    push([place(1), place(3), place(5)]);
                }
            }
        }
    }

    /// Places of a patch's corners.
    pub fn corners(&self, patch: &RoomPatch) -> [Vec3; 3] {
        patch
            .vertices
            .map(|vertex| self.vertices[vertex as usize].position)
    }

    /// Centre of a patch.
    pub fn center(&self, patch: &RoomPatch) -> Vec3 {
        self.corners(patch).iter().sum::<Vec3>() / 3.0
    }

    /// Area, square metres.
    pub fn area(&self, patch: &RoomPatch) -> f32 {
        let [a, b, c] = self.corners(patch);
        0.5 * (b - a).cross(c - a).length()
    }

    /// Unit normal.
    pub fn normal(&self, patch: &RoomPatch) -> Vec3 {
        self.vertices[patch.vertices[0] as usize].normal
    }
}

type EdgePlace = [[u32; 3]; 2];

/// The same for both directions.
fn edge_place(a: Vec3, b: Vec3) -> EdgePlace {
    let mut ends = [a, b].map(|end| end.to_array().map(f32::to_bits));
    ends.sort_unstable();
    ends
}

/// The same for both directions, to the bit.
fn middle(a: Vec3, b: Vec3) -> Vec3 {
    (a + b) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn square(half_m: f32, z: f32, piece: u32) -> [RoomTriangle; 2] {
        let corner = |x: f32, y: f32| Vec3::new(x * half_m, y * half_m, z);
        [
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)],
            [corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
        ]
        .map(|corners| RoomTriangle {
            corners,
            albedo: None,
            piece,
        })
    }

    #[test]
    fn a_bright_spot_is_cut_alike_wherever_the_room_s_own_triangles_lie() {
        let focus = Bounds::around([DVec3::new(0.0, 0.0, 2.0)]).expect("a point");
        // In the middle of a triangle, and aside.
        let counts = [Vec3::new(0.667, -0.667, 0.0), Vec3::new(0.667, 0.667, 0.0)].map(|spot| {
            let brightness = |place: Vec3, _| match place.distance(spot) < 0.3 {
                true => 100.0,
                false => 1.0,
            };
            let patches = RoomPatches::new(&square(2.0, 0.0, 0), 600, &[focus], brightness);
            let all = patches.patches.iter();
            let inside = all.filter(|patch| patches.center(patch).distance(spot) < 0.3);
            inside.count()
        });
        assert!(counts[0].abs_diff(counts[1]) < counts[1] / 2, "{counts:?}");
        assert!(counts[0] > 20, "{counts:?}");
    }

    #[test]
    fn patches_keep_the_area_have_no_gaps_and_are_finer_near_the_focus() {
        let focus =
            Bounds::around([DVec3::new(0.5, 0.5, 0.0), DVec3::new(0.6, 0.6, 0.1)]).expect("points");
        let patches = RoomPatches::new(&square(1.0, 0.0, 0), 500, &[focus], |_, _| 1.0);
        assert!(
            (250..=500).contains(&patches.patches.len()),
            "{}",
            patches.patches.len()
        );
        let area: f32 = patches.patches.iter().map(|p| patches.area(p)).sum();
        assert!((area - 4.0).abs() < 1e-4, "{area}");
        // Inner edges are passed once each way.
        let mut uses: HashMap<[u32; 2], i32> = HashMap::new();
        for patch in &patches.patches {
            let [a, b, c] = patch.vertices;
            for [from, to] in [[a, b], [b, c], [c, a]] {
                *uses.entry([from.min(to), from.max(to)]).or_default() +=
                    if from < to { 1 } else { -1 };
            }
        }
        for ([a, b], balance) in uses {
            let on_rim = |index: u32| {
                let position = patches.vertices[index as usize].position;
                position.x.abs().max(position.y.abs()) > 1.0 - 1e-6
            };
            assert!(balance == 0 || (on_rim(a) && on_rim(b)));
        }
        let largest = |near: bool| {
            let patches_there = patches.patches.iter().filter(|patch| {
                (patches.center(patch).distance(Vec3::new(0.55, 0.55, 0.0)) < 0.2) == near
            });
            patches_there
                .map(|patch| patches.area(patch))
                .fold(0.0, f32::max)
        };
        assert!(largest(true) * 8.0 < largest(false));
    }

    #[test]
    fn bright_places_are_cut_finer() {
        let focus = Bounds::around([DVec3::new(0.0, 0.0, 1.0)]).expect("a point");
        let brightness = |place: Vec3, _| if place.x > 0.0 { 30.0 } else { 0.1 };
        let patches = RoomPatches::new(&square(1.0, 0.0, 0), 400, &[focus], brightness);
        let bright = patches
            .patches
            .iter()
            .filter(|patch| patches.center(patch).x > 0.0);
        assert!(bright.count() * 3 > patches.patches.len() * 2);
    }

    #[test]
    fn a_budget_below_the_triangles_keeps_them() {
        let patches = RoomPatches::new(&square(1.0, 0.0, 0), 1, &[], |_, _| 1.0);
        assert_eq!(patches.patches.len(), 2);
    }
}
