//! How far two surfaces lie apart: the two-sided (Hausdorff) distance, and its mean over what outlines show.
//!
//! Distances to a triangle are exact, the points they are taken from are samples. Two facts tell where none is needed.
//! The distance to one triangle is convex, so a piece whose corners are all near the same triangle lies nowhere farther
//! from it than at a corner; and between two points the distance changes by no more than the points are apart.

use std::ops::Range;

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::triangle::Triangle;
use rayon::prelude::*;

use super::mesh::Mesh;
use super::normals::face_normal;
use super::triangle_tree::triangle_tree;

/// The largest distance is searched to this part of itself, which is then added.
const TOLERANCE: f64 = 0.02;
/// In search of the largest distance the most promising pieces of triangles are cut in four, so many in each of so many
/// rounds. That proves it where surfaces lie as far apart as their triangles are long; where they lie nearer, it is
/// the largest of samples that are dense where it matters.
const CUTS: usize = 256;
const ROUNDS: usize = 8;
/// An edge is cut into at least and at most so many pieces where its ends do not tell all.
const PIECES: [f64; 2] = [2.0, 6.0];
/// A triangle whose squared double area is below this part of its sides' squared product counts as three edges.
const NEEDLE_SQUARED: f64 = 1e-20;
/// Triangles in a leaf: fewer than for rays, since a search for the nearest ends in more leaves.
const LEAF_TRIANGLES: u32 = 2;
/// Among triangles that lie in each other's boxes, as long ones that cross do, a search looks at most of them. Where it looks at
/// more boxes than these on the average…
const MOST_STEPS: u64 = 1000;
/// …and all searches together at more than these, it is given up: that would take the square of the triangles' number.
const MOST_WORK: u64 = 30_000_000;
/// Searches from which the average is told.
const TRIED: usize = 256;
/// Items of work that are done in one go. It is fixed, so that the result is the same on every machine.
const CHUNK: usize = 128;

/// Whether somebody still waits for what takes long: never again, once it has said no.
pub type GoesOn<'a> = &'a (dyn Fn() -> bool + Sync);

/// How far the points of each of two surfaces lie from the other surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfaceDistance {
    /// No point of either lies farther from the other, metres; what samples can miss is added.
    pub max_m: f64,
    /// Mean over the points that outlines show, all directions of view counted alike; of both sides the larger, metres.
    pub outline_mean_m: f64,
}

/// A mesh ready to be measured.
pub struct SampledSurface {
    positions: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Indices into `edges`: those that begin at each corner.
    triangle_edges: Vec<[u32; 3]>,
    edges: Vec<SurfaceEdge>,
    mean_edge_m: f64,
    nearest: NearestTriangle,
}

struct SurfaceEdge {
    ends: [u32; 2],
    /// Part of all directions of view in which it belongs to the outline: the angle between its faces over π; all where
    /// it has not just two.
    outline_share: f64,
}

/// Distances along an edge.
struct Along {
    mean_m: f64,
    peak_m: f64,
}

/// A piece of a triangle.
#[derive(Clone, Copy)]
struct Piece {
    corners: [DVec3; 3],
    near: [Near; 3],
    /// The largest distance that is known on it.
    peak_m: f64,
}

impl SampledSurface {
    /// Prepares a mesh; `None` if it has no triangle, or a position that is not finite.
    pub fn new(mesh: &Mesh) -> Option<Self> {
        let finite = mesh.positions.iter().all(|position| position.is_finite());
        if mesh.triangles.is_empty() || !finite {
            return None;
        }
        let positions: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3()).collect();
        let (edges, triangle_edges) = edges(mesh);
        let total_m: f64 = edges.iter().map(|edge| length(&positions, edge.ends)).sum();
        Some(Self {
            mean_edge_m: total_m / edges.len() as f64,
            nearest: NearestTriangle::new(mesh),
            triangles: mesh.triangles.clone(),
            positions,
            triangle_edges,
            edges,
        })
    }

    /// How far the two lie apart; `None` where `goes_on` says that nobody waits for it any more, or where the triangles lie so that
    /// it would take the square of their number.
    pub fn distance_to(&self, other: &Self, goes_on: GoesOn<'_>) -> Option<SurfaceDistance> {
        if self.is_too_long(other) || other.is_too_long(self) {
            return None;
        }
        let forth = self.one_sided(other, goes_on)?;
        let back = other.one_sided(self, goes_on)?;
        Some(SurfaceDistance {
            max_m: forth.max_m.max(back.max_m),
            outline_mean_m: forth.outline_mean_m.max(back.outline_mean_m),
        })
    }

    /// Whether the searches in the other surface would look at too much; told from some of them, the same on every machine.
    fn is_too_long(&self, other: &Self) -> bool {
        const SEARCHES_AN_EDGE: usize = 4;
        let edges = self.edges.iter().step_by(self.edges.len().div_ceil(TRIED));
        let mut search = other.nearest.search();
        let mut tried = 0;
        for edge in edges {
            let [one, two] = edge.ends.map(|end| self.positions[end as usize]);
            search.nearest(one.lerp(two, 1.0 / 3.0));
            tried += 1;
        }
        let steps = search.steps / tried;
        steps > MOST_STEPS && steps * (SEARCHES_AN_EDGE * self.edges.len()) as u64 > MOST_WORK
    }

    fn one_sided(&self, other: &Self, goes_on: GoesOn<'_>) -> Option<SurfaceDistance> {
        let at_vertices = in_parallel(self.positions.len(), goes_on, |vertices| {
            let mut search = other.nearest.search();
            self.positions[vertices]
                .iter()
                .map(|point| search.nearest(*point))
                .collect()
        });
        // What is cut short is not to be looked into.
        goes_on().then_some(())?;
        let along_edges = in_parallel(self.edges.len(), goes_on, |edges| {
            let mut search = other.nearest.search();
            self.edges[edges]
                .iter()
                .map(|edge| self.along(edge, &at_vertices, other, &mut search))
                .collect()
        });
        goes_on().then_some(())?;
        let on_edges_m = along_edges
            .iter()
            .fold(0.0, |most: f64, along| most.max(along.peak_m));
        let pieces = in_parallel(self.triangles.len(), goes_on, |triangles| {
            let mut search = other.nearest.search();
            triangles
                .map(|triangle| {
                    self.piece(triangle, &at_vertices, &along_edges, other, &mut search)
                })
                .filter(|piece| piece.bound_m() > on_edges_m)
                .collect()
        });
        let max_m = largest(on_edges_m, pieces, &other.nearest);

        let (mut weighted, mut weight) = (0.0, 0.0);
        for (edge, along) in self.edges.iter().zip(&along_edges) {
            let outline_m = edge.outline_share * length(&self.positions, edge.ends);
            weighted += outline_m * along.mean_m;
            weight += outline_m;
        }
        goes_on().then_some(SurfaceDistance {
            max_m: max_m * (1.0 + TOLERANCE),
            outline_mean_m: if weight > 0.0 { weighted / weight } else { 0.0 },
        })
    }

    fn along(
        &self,
        edge: &SurfaceEdge,
        at_vertices: &[Near],
        other: &Self,
        search: &mut NearestSearch,
    ) -> Along {
        let near = edge.ends.map(|end| at_vertices[end as usize]);
        let ends = edge.ends.map(|end| self.positions[end as usize]);
        let ends_m = near.map(|near| near.distance_m);
        let mut pieces = other.pieces((ends[1] - ends[0]).length());
        if pieces > 1.0 && other.nearest.convex_over(&ends, &near) {
            pieces = 1.0;
        }
        let mut along = Along {
            mean_m: (ends_m[0] + ends_m[1]) / 2.0,
            peak_m: ends_m[0].max(ends_m[1]),
        };
        for piece in 1..pieces as u32 {
            let at = f64::from(piece) / pieces;
            let distance_m = search.nearest(ends[0].lerp(ends[1], at)).distance_m;
            along.mean_m += distance_m;
            along.peak_m = along.peak_m.max(distance_m);
        }
        along.mean_m /= pieces;
        along
    }

    /// A whole triangle, sampled as densely as the other surface has vertices.
    fn piece(
        &self,
        triangle: usize,
        at_vertices: &[Near],
        along_edges: &[Along],
        other: &Self,
        search: &mut NearestSearch,
    ) -> Piece {
        let mut piece = Piece {
            corners: self.triangles[triangle].map(|corner| self.positions[corner as usize]),
            near: self.triangles[triangle].map(|corner| at_vertices[corner as usize]),
            peak_m: self.triangle_edges[triangle]
                .iter()
                .fold(0.0, |most, &edge| {
                    most.max(along_edges[edge as usize].peak_m)
                }),
        };
        let pieces = other.pieces(piece.longest_m());
        // Two pieces leave no point within.
        if pieces > 2.0 && !other.nearest.convex_over(&piece.corners, &piece.near) {
            let [a, b, c] = piece.corners;
            for first in 1..pieces as u32 {
                for second in 1..pieces as u32 - first {
                    let [x, y] = [first, second].map(|part| f64::from(part) / pieces);
                    let point = a + (b - a) * x + (c - a) * y;
                    piece.peak_m = piece.peak_m.max(search.nearest(point).distance_m);
                }
            }
        }
        piece
    }

    /// Into how many pieces a length is cut, so that they are no longer than this surface's own edges; what is much
    /// shorter is left whole.
    fn pieces(&self, length_m: f64) -> f64 {
        let edges = length_m / self.mean_edge_m;
        if edges < 0.5 {
            1.0
        } else {
            edges.ceil().clamp(PIECES[0], PIECES[1])
        }
    }
}

impl Piece {
    fn longest_m(&self) -> f64 {
        let [a, b, c] = self.corners;
        let squared = (b - a).length_squared().max((c - b).length_squared());
        squared.max((a - c).length_squared()).sqrt()
    }

    /// No point of it is farther: none lies farther from its nearest corner than the longest side over √3.
    fn bound_m(&self) -> f64 {
        self.at_corners_m(f64::max) + self.longest_m() / 3.0_f64.sqrt()
    }

    /// A guess at what may be found on it: more where the distance changes much.
    fn promise_m(&self) -> f64 {
        self.peak_m + (self.peak_m - self.at_corners_m(f64::min)) / 2.0
    }

    fn at_corners_m(&self, pick: impl Fn(f64, f64) -> f64) -> f64 {
        let [a, b, c] = self.near.map(|near| near.distance_m);
        pick(a, pick(b, c))
    }

    /// The piece's four parts, cut at the middles of its sides; none if no point of it is farther than its corners.
    fn cut(&self, to: &NearestTriangle, search: &mut NearestSearch) -> Vec<Self> {
        if to.convex_over(&self.corners, &self.near) {
            return Vec::new();
        }
        let [a, b, c] = [0, 1, 2].map(|corner| (self.corners[corner], self.near[corner]));
        let mut middle = |one: DVec3, two: DVec3| {
            let point = (one + two) / 2.0;
            (point, search.nearest(point))
        };
        let (ab, bc, ca) = (middle(a.0, b.0), middle(b.0, c.0), middle(c.0, a.0));
        let part = |parts: [(DVec3, Near); 3]| {
            let near = parts.map(|(_, near)| near);
            Self {
                corners: parts.map(|(corner, _)| corner),
                near,
                peak_m: near
                    .iter()
                    .fold(0.0, |most, near| most.max(near.distance_m)),
            }
        };
        vec![
            part([a, ab, ca]),
            part([ab, b, bc]),
            part([ca, bc, c]),
            part([ab, bc, ca]),
        ]
    }
}

/// The largest distance on any of the pieces, or `known_m` if that is larger.
fn largest(known_m: f64, mut open: Vec<Piece>, to: &NearestTriangle) -> f64 {
    let most_of = |least_m: f64, pieces: &[Piece]| {
        pieces
            .iter()
            .fold(least_m, |most, piece| most.max(piece.peak_m))
    };
    let by_promise = |one: &Piece, two: &Piece| two.promise_m().total_cmp(&one.promise_m());
    let mut most_m = most_of(known_m, &open);
    for round in 0..ROUNDS {
        open.retain(|piece| piece.bound_m() > most_m * (1.0 + TOLERANCE));
        // What cannot come to be cut need not be kept.
        let left = (ROUNDS - round) * CUTS;
        if left < open.len() {
            open.select_nth_unstable_by(left, by_promise);
            open.truncate(left);
        }
        open.sort_unstable_by(by_promise);
        let uncut = open.split_off(CUTS.min(open.len()));
        open = in_parallel(open.len(), &|| true, |range| {
            let mut search = to.search();
            open[range]
                .iter()
                .flat_map(|piece| piece.cut(to, &mut search))
                .collect()
        });
        most_m = most_of(most_m, &open);
        open.extend(uncut);
    }
    most_m
}

fn length(positions: &[DVec3], ends: [u32; 2]) -> f64 {
    (positions[ends[1] as usize] - positions[ends[0] as usize]).length()
}

/// The edges, each once, and for each triangle the indices of the edges that begin at its corners.
fn edges(mesh: &Mesh) -> (Vec<SurfaceEdge>, Vec<[u32; 3]>) {
    let normals: Vec<DVec3> = mesh
        .triangles
        .iter()
        .map(|triangle| face_normal(&mesh.positions, *triangle))
        .collect();
    // Ends, the smaller first; whether the triangle runs from the larger to the smaller; triangle and corner.
    let mut sides: Vec<([u32; 2], bool, u32, usize)> = Vec::with_capacity(3 * normals.len());
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        for corner in 0..3 {
            let (from, to) = (corners[corner], corners[(corner + 1) % 3]);
            sides.push((
                [from.min(to), from.max(to)],
                from > to,
                triangle as u32,
                corner,
            ));
        }
    }
    sides.sort_unstable();
    let mut edges = Vec::with_capacity(sides.len() / 2);
    let mut triangle_edges = vec![[0; 3]; normals.len()];
    for around in sides.chunk_by(|one, two| one.0 == two.0) {
        for &(_, _, triangle, corner) in around {
            triangle_edges[triangle as usize][corner] = edges.len() as u32;
        }
        let outline_share = match *around {
            [(_, one_turned, one, _), (_, two_turned, two, _)] => {
                let [one, two] = [one, two].map(|triangle| normals[triangle as usize]);
                let two = if one_turned == two_turned { -two } else { two };
                one.cross(two).length().atan2(one.dot(two)) / std::f64::consts::PI
            }
            _ => 1.0,
        };
        edges.push(SurfaceEdge {
            ends: around[0].0,
            outline_share,
        });
    }
    (edges, triangle_edges)
}

/// Triangles in a hierarchy of boxes.
pub(super) struct NearestTriangle {
    /// In the order of the hierarchy's leaves.
    corners: Vec<[DVec3; 3]>,
    hierarchy: Bvh2,
}

/// The triangle nearest to a point.
#[derive(Clone, Copy)]
pub(super) struct Near {
    /// How far off it is.
    pub distance_m: f64,
    /// Index into [`NearestTriangle::corners`].
    triangle: usize,
}

/// Searches one after another, each beginning with what the last one found: points come in runs of neighbours.
pub(super) struct NearestSearch<'a> {
    triangles: &'a NearestTriangle,
    last: usize,
    /// Nodes, with the squared distances of their boxes.
    pending: Vec<(u32, f32)>,
    /// Nodes that were looked at.
    steps: u64,
}

impl NearestTriangle {
    /// `mesh` has triangles, with finite corners.
    pub fn new(mesh: &Mesh) -> Self {
        let corners = |triangle: &[u32; 3]| triangle.map(|corner| mesh.positions[corner as usize]);
        let triangles: Vec<Triangle> = mesh
            .triangles
            .iter()
            .map(|triangle| {
                let [v0, v1, v2] = corners(triangle).map(Into::into);
                Triangle { v0, v1, v2 }
            })
            .collect();
        let params = BvhBuildParams {
            max_prims_per_leaf: LEAF_TRIANGLES,
            ..BvhBuildParams::fast_build()
        };
        let hierarchy = triangle_tree(&triangles, params);
        let in_order =
            |&index: &u32| corners(&mesh.triangles[index as usize]).map(|corner| corner.as_dvec3());
        Self {
            corners: hierarchy.primitive_indices.iter().map(in_order).collect(),
            hierarchy,
        }
    }

    /// The triangle's number in the mesh.
    pub fn in_mesh(&self, near: Near) -> usize {
        self.hierarchy.primitive_indices[near.triangle] as usize
    }

    /// A search for triangles that are nearest to points.
    pub fn search(&self) -> NearestSearch<'_> {
        NearestSearch {
            triangles: self,
            last: 0,
            pending: Vec::new(),
            steps: 0,
        }
    }

    /// Whether the distance from the hull of `points` is nowhere larger than at one of them, because one triangle is
    /// near enough to all.
    fn convex_over(&self, points: &[DVec3], near: &[Near]) -> bool {
        let most_m = near
            .iter()
            .fold(0.0, |most: f64, near| most.max(near.distance_m));
        near.iter().any(|candidate| {
            points.iter().zip(near).all(|(point, near)| {
                near.triangle == candidate.triangle
                    || distance_squared(*point, &self.corners[candidate.triangle])
                        <= most_m * most_m
            })
        })
    }
}

impl NearestSearch<'_> {
    /// The triangle nearest to a finite point.
    pub fn nearest(&mut self, point: DVec3) -> Near {
        let nodes = &self.triangles.hierarchy.nodes;
        // Boxes are compared in single precision, with the slack that makes up for its rounding.
        let rounded = point.as_vec3a();
        let slack = 4.0 * f64::from(f32::EPSILON) * point.abs().max_element();
        let limit = |least: f64| {
            let reach = least.sqrt() + slack;
            (reach * reach * (1.0 + 8.0 * f64::from(f32::EPSILON))) as f32
        };
        let box_distance_squared = |node: usize| {
            let bounds = nodes[node].aabb();
            (bounds.min - rounded)
                .max(rounded - bounds.max)
                .max(Vec3A::ZERO)
                .length_squared()
        };
        let mut triangle = self.last;
        let mut least = distance_squared(point, &self.triangles.corners[triangle]);
        let mut box_limit = limit(least);
        self.pending.push((0, 0.0));
        while let Some((node, box_distance)) = self.pending.pop() {
            if least == 0.0 || box_distance > box_limit {
                continue;
            }
            self.steps += 1;
            let node = &nodes[node as usize];
            let first = node.first_index as usize;
            if node.is_leaf() {
                for leaf in first..first + node.prim_count as usize {
                    let distance = distance_squared(point, &self.triangles.corners[leaf]);
                    if distance < least {
                        (least, triangle) = (distance, leaf);
                        box_limit = limit(least);
                    }
                }
                continue;
            }
            let mut nearer = (first as u32, box_distance_squared(first));
            let mut farther = (first as u32 + 1, box_distance_squared(first + 1));
            if farther.1 < nearer.1 {
                (nearer, farther) = (farther, nearer);
            }
            for child in [farther, nearer] {
                if child.1 <= box_limit {
                    self.pending.push(child);
                }
            }
        }
        self.last = triangle;
        Near {
            distance_m: least.sqrt(),
            triangle,
        }
    }
}

/// Squared distance from a point to a triangle, which may have no area.
fn distance_squared(point: DVec3, [a, b, c]: &[DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let area_squared = normal.length_squared();
    let has_area =
        area_squared > NEEDLE_SQUARED * (b - a).length_squared() * (c - a).length_squared();
    let beside = |from: DVec3, to: DVec3| {
        let (along, away) = (to - from, point - from);
        if has_area && normal.cross(along).dot(away) >= 0.0 {
            return f64::INFINITY;
        }
        let length_squared = along.length_squared();
        let share = if length_squared > 0.0 {
            (away.dot(along) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (away - along * share).length_squared()
    };
    // The nearest point lies on an edge that the point is beyond; where there is none, it is the foot on the plane.
    let to_edges = beside(*a, *b).min(beside(*b, *c)).min(beside(*c, *a));
    if to_edges < f64::INFINITY {
        return to_edges;
    }
    let height = normal.dot(point - a);
    height * height / area_squared
}

/// Does `work` on the ranges that make up `0..count`, on all cores, and joins the results in their order; from where `goes_on` says
/// no, there are none.
fn in_parallel<T: Send>(
    count: usize,
    goes_on: GoesOn<'_>,
    work: impl Fn(Range<usize>) -> Vec<T> + Sync,
) -> Vec<T> {
    let chunks = (0..count.div_ceil(CHUNK)).into_par_iter();
    chunks
        .flat_map_iter(|chunk| match goes_on() {
            true => work(chunk * CHUNK..count.min((chunk + 1) * CHUNK)),
            false => Vec::new(),
        })
        .collect()
}

#[cfg(test)]
mod tests;
