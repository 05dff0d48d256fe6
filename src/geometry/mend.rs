//! Closes what a file left open though its maker meant it closed: repeated faces, vertices that miss each other by a
//! rounding, vertices in the middle of a neighbour's edge. Only edges with an odd number of triangles are mended, so a
//! mesh without any stays as it is.

use std::collections::{HashMap, VecDeque};

use glam::{DVec3, Vec3};

use super::normals::face_normal;
use super::soup::{EdgeUse, Face, Sets, Side, by_edge, edge_uses, odd_edges};

/// Edges and vertices within this part of the mesh's diagonal may meet: a hundredth of a pixel where the mesh fills a
/// picture of a thousand.
const NEAR_IN_MESH: f64 = 1e-5;
/// No vertex moves by more than this part of the edges that bring it to its partner: small parts stay apart.
const NEAR_IN_EDGE: f64 = 0.02;
/// How far a vertex may lie from the edge that it splits, as a part of its distance from the edge's nearer end.
const OFF_EDGE: f64 = 0.01;
/// Two triangles whose directions away from their common edge are closer than this (cosine) lie flat on each other:
/// two sides of a sheet, not neighbours.
const FOLDED: f64 = 0.999;
/// A mended triangle's normal stays this close to what it was (cosine).
const SAME_NORMAL: f64 = 0.9;
/// Rounds in which merges that spoil a triangle are taken back, before all are.
const KEEPING_ROUNDS: usize = 8;
/// Candidates that are tried at one place; more are no accident of rounding, and time stays in proportion to the mesh.
const MOST_CANDIDATES: usize = 64;

/// Faces after mending, and what was done.
#[derive(Debug, Default)]
pub(super) struct Mended {
    pub faces: Vec<Face>,
    /// Vertices that were moved on to another one.
    pub merged_vertices: usize,
    /// Faces that went because another has the same vertices, whichever way round.
    pub duplicates: usize,
    /// Cuts at vertices on a face's edge.
    pub splits: usize,
    /// Edges with an odd number of triangles that are left.
    pub odd_edges: usize,
}

/// Mends faces, none of which has a vertex twice.
///
/// Faces without area go, and if edges stay open then also those whose height is lost in their coordinates' rounding;
/// but what closes most edges is done, for in an indexed mesh a needle may be all that joins its neighbours.
pub(super) fn mend(positions: &[Vec3], faces: Vec<Face>) -> Mended {
    let no_area = |face: &Face| face_normal(positions, face.vertices) == DVec3::ZERO;
    let rounding = |face: &Face| no_area(face) || is_lost_in_rounding(positions, face.vertices);
    let mut best: Option<Mended> = None;
    let mut tried = usize::MAX;
    for left_out in [&no_area as &dyn Fn(&Face) -> bool, &rounding, &|_| false] {
        let kept: Vec<Face> = faces
            .iter()
            .filter(|face| !left_out(face))
            .copied()
            .collect();
        if kept.len() == tried {
            continue;
        }
        tried = kept.len();
        let mended = mend_kept(positions, kept);
        let closed = mended.odd_edges == 0;
        if best
            .as_ref()
            .is_none_or(|best| mended.odd_edges < best.odd_edges)
        {
            best = Some(mended);
        }
        // All faces at once count as tried where none was left out.
        if closed || tried == faces.len() {
            break;
        }
    }
    best.unwrap_or_default()
}

/// Whether a triangle is lower than the step between single-precision numbers of its coordinates' size.
fn is_lost_in_rounding(positions: &[Vec3], corners: [u32; 3]) -> bool {
    let [a, b, c] = corners.map(|index| positions[index as usize].as_dvec3());
    let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
    let farthest = a.abs().max(b.abs()).max(c.abs()).max_element();
    (b - a).cross(c - a).length() <= f64::from(f32::EPSILON) * farthest * longest
}

fn mend_kept(positions: &[Vec3], faces: Vec<Face>) -> Mended {
    let (faces, duplicates) = without_duplicates(faces);
    let mut mended = Mended {
        odd_edges: odd_edges(&faces),
        duplicates,
        faces,
        ..Mended::default()
    };
    if mended.odd_edges > 0 {
        mended.merge_near_vertices(positions);
    }
    if mended.odd_edges > 0 {
        mended.splits = split_at_vertices_on_edges(positions, &mut mended.faces);
        if mended.splits > 0 {
            mended.odd_edges = odd_edges(&mended.faces);
        }
    }
    mended
}

impl Mended {
    /// Merges open edges that lie on each other but for a rounding, if that leaves fewer of them.
    fn merge_near_vertices(&mut self, positions: &[Vec3]) {
        let Some(new_index) = near_vertices(positions, &self.faces) else {
            return;
        };
        let merged: Vec<Face> = self
            .faces
            .iter()
            .map(|face| Face {
                vertices: face.vertices.map(|vertex| new_index[vertex as usize]),
                ..*face
            })
            .filter(|face| has_three_vertices(face.vertices))
            .collect();
        let (merged, duplicates) = without_duplicates(merged);
        let odd_edges = odd_edges(&merged);
        if odd_edges < self.odd_edges {
            self.faces = merged;
            self.odd_edges = odd_edges;
            self.duplicates += duplicates;
            self.merged_vertices += (0..)
                .zip(&new_index)
                .filter(|(old, new)| old != *new)
                .count();
        }
    }
}

/// Whether no vertex of a face occurs twice.
pub(super) fn has_three_vertices([a, b, c]: [u32; 3]) -> bool {
    a != b && b != c && c != a
}

/// Keeps one face of those with the same three vertices, the first; one the other way round becomes its back. Also
/// says how many went.
fn without_duplicates(faces: Vec<Face>) -> (Vec<Face>, usize) {
    let count = faces.len();
    let mut kept: Vec<Face> = Vec::with_capacity(count);
    let mut index_of: HashMap<[u32; 3], usize> = HashMap::with_capacity(count);
    for face in faces {
        let mut key = face.vertices;
        key.sort_unstable();
        let index = *index_of.entry(key).or_insert(kept.len());
        let Some(first) = kept.get_mut(index) else {
            kept.push(face);
            continue;
        };
        // Where in `face` each vertex of `first` is.
        let places = first.vertices.map(|vertex| {
            (0..3)
                .find(|&place| face.vertices[place] == vertex)
                .unwrap_or(0)
        });
        let same_way = (places[0] + 1) % 3 == places[1];
        let seen_behind = if same_way {
            face.back
        } else {
            Some(face.front)
        };
        first.back = first.back.or(seen_behind.map(|side| Side {
            normals: places.map(|place| side.normals[place]),
            ..side
        }));
    }
    let dropped = count - kept.len();
    (kept, dropped)
}

/// An edge with one triangle.
struct OpenEdge {
    ends: [u32; 2],
    face: u32,
    middle: DVec3,
    /// Away from the edge in its triangle's plane, unit length.
    inwards: DVec3,
    /// How far another edge's ends may lie from this one's.
    near: f64,
}

/// For each vertex the one that takes its place; `None` if no open edge has a partner.
///
/// Whole edges are paired, each other's nearest, and not where their triangles would lie on each other: so the two
/// sides of a thin sheet, and things that only come close, stay apart.
fn near_vertices(positions: &[Vec3], faces: &[Face]) -> Option<Vec<u32>> {
    let at = |vertex: u32| positions[vertex as usize].as_dvec3();
    let uses = edge_uses(faces.iter().map(|face| face.vertices));
    let near_in_mesh = NEAR_IN_MESH * diagonal(positions, faces);
    let edges: Vec<OpenEdge> = by_edge(&uses)
        .filter_map(|around| match around {
            [only] => open_edge(positions, faces, only, near_in_mesh),
            _ => None,
        })
        .collect();
    let cells = Cells::new(&edges);

    // A pair's distance, and whether the ends match crosswise.
    let distance = |a: &OpenEdge, b: &OpenEdge| {
        let ends = |b0: u32, b1: u32| {
            let first = at(a.ends[0]).distance(at(b0));
            first.max(at(a.ends[1]).distance(at(b1)))
        };
        let (along, across) = (ends(b.ends[0], b.ends[1]), ends(b.ends[1], b.ends[0]));
        (along.min(across), across < along)
    };
    let nearest = |index: usize| {
        let edge = &edges[index];
        let mut best: Option<(f64, u32)> = None;
        cells.visit(edge, |other_index| {
            let other = &edges[other_index as usize];
            if other.face == edge.face || edge.inwards.dot(other.inwards) > FOLDED {
                return;
            }
            let (apart, _) = distance(edge, other);
            let closer = best.is_none_or(|best| (apart, other_index) < best);
            if apart <= edge.near.min(other.near) && closer {
                best = Some((apart, other_index));
            }
        });
        best.map(|(_, other)| other as usize)
    };
    let partners: Vec<Option<usize>> = (0..edges.len()).map(nearest).collect();
    let mut sets = Sets::new(positions.len());
    let mut paired = false;
    for (index, partner) in partners.iter().enumerate() {
        let Some(partner) = partner.filter(|&partner| partner > index) else {
            continue;
        };
        if partners[partner] != Some(index) {
            continue;
        }
        let (edge, other) = (&edges[index], &edges[partner]);
        let [mut first, mut second] = other.ends;
        if distance(edge, other).1 {
            (first, second) = (second, first);
        }
        sets.join(edge.ends[0], first);
        sets.join(edge.ends[1], second);
        paired = true;
    }
    paired.then(|| {
        let mut new_index: Vec<u32> = (0..positions.len() as u32)
            .map(|vertex| sets.least(vertex))
            .collect();
        keep_areas(positions, faces, &mut new_index);
        new_index
    })
}

fn open_edge(
    positions: &[Vec3],
    faces: &[Face],
    edge_use: &EdgeUse,
    near_in_mesh: f64,
) -> Option<OpenEdge> {
    let at = |vertex: u32| positions[vertex as usize].as_dvec3();
    let ends = edge_use.ends();
    let corners = faces[edge_use.triangle as usize].vertices;
    let apex = corners.into_iter().find(|vertex| !ends.contains(vertex))?;
    let (from, to) = (at(ends[0]), at(ends[1]));
    let along = (to - from).try_normalize()?;
    let inwards = (at(apex) - from).reject_from_normalized(along);
    Some(OpenEdge {
        ends,
        face: edge_use.triangle,
        middle: (from + to) / 2.0,
        inwards: inwards.try_normalize()?,
        near: near_in_mesh.min(NEAR_IN_EDGE * from.distance(to)),
    })
}

/// Takes back what would rob a triangle of its area or turn it.
fn keep_areas(positions: &[Vec3], faces: &[Face], new_index: &mut [u32]) {
    for _ in 0..KEEPING_ROUNDS {
        let mut spoilt: Vec<u32> = Vec::new();
        for face in faces {
            let moved = face.vertices.map(|vertex| new_index[vertex as usize]);
            if moved == face.vertices {
                continue;
            }
            let before = face_normal(positions, face.vertices);
            let after = face_normal(positions, moved);
            if before != DVec3::ZERO && before.dot(after) < SAME_NORMAL {
                spoilt.extend(moved);
            }
        }
        if spoilt.is_empty() {
            return;
        }
        // What is taken back here may spoil a triangle elsewhere that had moved with it.
        spoilt.sort_unstable();
        for (vertex, new) in (0..).zip(new_index.iter_mut()) {
            if spoilt.binary_search(new).is_ok() {
                *new = vertex;
            }
        }
    }
    for (vertex, new) in (0..).zip(new_index.iter_mut()) {
        *new = vertex;
    }
}

/// Open edges by the place of their middles, in grids that are as fine as the edges' reach.
struct Cells {
    /// The last edge of each cell.
    last_in: HashMap<(i32, [i64; 3]), u32>,
    /// For each edge another one in the same cell.
    before: Vec<Option<u32>>,
}

impl Cells {
    fn new(edges: &[OpenEdge]) -> Self {
        let mut last_in = HashMap::with_capacity(edges.len());
        let before = (0..)
            .zip(edges)
            .map(|(index, edge)| {
                let level = level(edge.near);
                last_in.insert((level, cell(edge.middle, level)), index)
            })
            .collect();
        Self { last_in, before }
    }

    /// Calls `found` with the edges whose middle may lie within reach of an edge's, itself among them.
    fn visit(&self, edge: &OpenEdge, mut found: impl FnMut(u32)) {
        // Partners' lengths differ by two reaches at most.
        let slack = 1.0 + 4.0 * NEAR_IN_EDGE;
        let (lowest, highest) = (level(edge.near / slack), level(edge.near * slack));
        for level in lowest..=highest {
            let low = cell(edge.middle - edge.near, level);
            let high = cell(edge.middle + edge.near, level);
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    for z in low[2]..=high[2] {
                        let mut next = self.last_in.get(&(level, [x, y, z])).copied();
                        for _ in 0..MOST_CANDIDATES {
                            let Some(index) = next else { break };
                            found(index);
                            next = self.before[index as usize];
                        }
                    }
                }
            }
        }
    }
}

/// Reaches from 2^level to twice that share a grid.
fn level(near: f64) -> i32 {
    near.log2().floor() as i32
}

/// A cell is at least twice a reach wide, so an edge's reach touches two along each axis at most.
fn cell(point: DVec3, level: i32) -> [i64; 3] {
    let width = 2.0_f64.powi(level + 2);
    (point / width)
        .floor()
        .to_array()
        .map(|number| number as i64)
}

/// Length of the diagonal of the box around all faces.
fn diagonal(positions: &[Vec3], faces: &[Face]) -> f64 {
    let corners = faces.iter().flat_map(|face| face.vertices);
    let points = corners.map(|vertex| positions[vertex as usize].as_dvec3());
    let (low, high) = points.fold(
        (DVec3::INFINITY, DVec3::NEG_INFINITY),
        |(low, high), point| (low.min(point), high.max(point)),
    );
    if low.cmple(high).all() {
        low.distance(high)
    } else {
        0.0
    }
}

/// Splits faces where an open edge passes through the end of another one that starts where it starts; says how many
/// cuts were made. A chain of short edges along a long one is worked off from its ends.
fn split_at_vertices_on_edges(positions: &[Vec3], faces: &mut Vec<Face>) -> usize {
    let off_in_mesh = NEAR_IN_MESH * diagonal(positions, faces);
    let mut edges = EdgeFaces::new(faces);
    let mut queue: VecDeque<[u32; 2]> = VecDeque::new();
    for around in by_edge(&edge_uses(faces.iter().map(|face| face.vertices))) {
        if let [only] = around {
            queue.push_back(only.ends());
            edges.remember(only.ends());
        }
    }
    let mut splits = 0;
    while let Some([a, b]) = queue.pop_front() {
        let Some(index) = edges.only_face([a, b]) else {
            continue;
        };
        let face = faces[index];
        let split = [(a, b), (b, a)].into_iter().find_map(|(start, end)| {
            edges.once_open_from(start).find_map(|vertex| {
                let fits = vertex != end
                    && lies_between(positions, vertex, [start, end], off_in_mesh)
                    && edges.only_face([start, vertex]).is_some();
                let halves = fits.then(|| split_face(positions, &face, [a, b], vertex));
                Some((vertex, halves??))
            })
        });
        // Each cut closes two open edges and opens one at most, so the queue runs dry.
        let Some((vertex, halves)) = split else {
            continue;
        };
        edges.remove(face.vertices, index);
        edges.add(halves[0].vertices, index);
        edges.add(halves[1].vertices, faces.len());
        faces[index] = halves[0];
        faces.push(halves[1]);
        splits += 1;
        for end in [a, b] {
            if edges.only_face([vertex, end]).is_some() {
                edges.remember([vertex, end]);
                queue.push_back([vertex, end]);
                // The new edge may be what another one waits for.
                for start in [end, vertex] {
                    queue.extend(edges.once_open_from(start).map(|other| [start, other]));
                }
            }
        }
    }
    splits
}

/// Whether a vertex lies on an edge, away from its ends.
fn lies_between(positions: &[Vec3], vertex: u32, [a, b]: [u32; 2], off_in_mesh: f64) -> bool {
    let [point, a, b] = [vertex, a, b].map(|index| positions[index as usize].as_dvec3());
    let length = a.distance(b);
    let along = (b - a) / length;
    let from_a = (point - a).dot(along);
    let from_end = from_a.min(length - from_a);
    let off = (point - a).reject_from_normalized(along).length();
    from_end > 0.0 && off <= off_in_mesh.min(OFF_EDGE * from_end)
}

/// The two parts of a face that is cut from a vertex on its edge `ab` to the opposite corner; `None` if one would have
/// no area or lie otherwise than the face.
fn split_face(positions: &[Vec3], face: &Face, [a, b]: [u32; 2], vertex: u32) -> Option<[Face; 2]> {
    let apex = (0..3).find(|&corner| ![a, b].contains(&face.vertices[corner]))?;
    let (from, to) = ((apex + 1) % 3, (apex + 2) % 3);
    let at = |index: u32| positions[index as usize].as_dvec3();
    let (start, end) = (at(face.vertices[from]), at(face.vertices[to]));
    let share = (at(vertex).distance(start) / end.distance(start)) as f32;
    let half = |replaced: usize| {
        let cut = |side: Side| {
            let between = side.normals[from]
                .zip(side.normals[to])
                .map(|(from, to)| from.normalize_or_zero().lerp(to.normalize_or_zero(), share));
            let mut normals = side.normals;
            normals[replaced] = between;
            Side { normals, ..side }
        };
        let mut vertices = face.vertices;
        vertices[replaced] = vertex;
        Face {
            vertices,
            front: cut(face.front),
            back: face.back.map(cut),
        }
    };
    let halves = [half(to), half(from)];
    let normal = face_normal(positions, face.vertices);
    let lies_in_face =
        |half: &Face| face_normal(positions, half.vertices).dot(normal) >= SAME_NORMAL;
    halves.iter().all(lies_in_face).then_some(halves)
}

/// Which faces have an edge, as they change.
struct EdgeFaces {
    /// How many have it, and all their numbers combined by exclusive or: the number itself where it is one.
    faces_at: HashMap<[u32; 2], (u32, usize)>,
    /// For each vertex the other ends of edges that were open at some time.
    ends_from: HashMap<u32, Vec<u32>>,
}

impl EdgeFaces {
    fn new(faces: &[Face]) -> Self {
        let mut edges = Self {
            faces_at: HashMap::with_capacity(2 * faces.len()),
            ends_from: HashMap::new(),
        };
        for (index, face) in faces.iter().enumerate() {
            edges.add(face.vertices, index);
        }
        edges
    }

    fn add(&mut self, [a, b, c]: [u32; 3], face: usize) {
        for ends in [[a, b], [b, c], [c, a]] {
            let (count, numbers) = self.faces_at.entry(sorted(ends)).or_default();
            *count += 1;
            *numbers ^= face;
        }
    }

    fn remove(&mut self, [a, b, c]: [u32; 3], face: usize) {
        for ends in [[a, b], [b, c], [c, a]] {
            if let Some((count, numbers)) = self.faces_at.get_mut(&sorted(ends)) {
                *count -= 1;
                *numbers ^= face;
            }
        }
    }

    /// The face of an open edge; `None` for edges with none or more.
    fn only_face(&self, ends: [u32; 2]) -> Option<usize> {
        match self.faces_at.get(&sorted(ends)) {
            Some(&(1, face)) => Some(face),
            _ => None,
        }
    }

    fn remember(&mut self, [a, b]: [u32; 2]) {
        self.ends_from.entry(a).or_default().push(b);
        self.ends_from.entry(b).or_default().push(a);
    }

    /// Other ends of edges from a vertex that were open at some time.
    fn once_open_from(&self, vertex: u32) -> impl Iterator<Item = u32> {
        let ends = self.ends_from.get(&vertex).map_or(&[][..], Vec::as_slice);
        ends.iter().take(MOST_CANDIDATES).copied()
    }
}

fn sorted([a, b]: [u32; 2]) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

/// Gives the backs that [`mend`] took from two-sided faces back where the faces alone do not balance their edges: a
/// sheet of two sides stays closed, a closed mesh loses what it has twice. Says how many faces came back.
pub(super) fn restore_backs(positions: &[Vec3], faces: &mut Vec<Face>) -> usize {
    if faces.iter().all(|face| face.back.is_none()) {
        return 0;
    }
    // Neighbours with two sides come back together, and by themselves they balance; it is their rim that counts.
    let uses = edge_uses(faces.iter().map(|face| face.vertices));
    let two_sided = |edge_use: &&EdgeUse| faces[edge_use.triangle as usize].back.is_some();
    let mut groups = Sets::new(faces.len());
    for around in by_edge(&uses) {
        let mut with_back = around.iter().filter(two_sided);
        if let Some(first) = with_back.next() {
            with_back.for_each(|other| groups.join(first.triangle, other.triangle));
        }
    }
    let mut gains: HashMap<u32, i64> = HashMap::new();
    for around in by_edge(&uses) {
        // All two-sided faces at an edge are of one group.
        let Some(first) = around.iter().find(two_sided) else {
            continue;
        };
        let all: i64 = around.iter().map(EdgeUse::sign).sum();
        let group: i64 = around.iter().filter(two_sided).map(EdgeUse::sign).sum();
        let closed = i64::from(all != 0) - i64::from(all != group);
        *gains.entry(groups.least(first.triangle)).or_default() += closed;
    }
    let mut restored = Vec::new();
    for (index, face) in (0..).zip(faces.iter_mut()) {
        let Some(back) = face.back.take() else {
            continue;
        };
        if gains[&groups.least(index)] > 0 {
            let mut behind = Face {
                front: back,
                ..*face
            }
            .turned();
            behind.turn_inverted_normals(face_normal(positions, behind.vertices));
            restored.push(behind);
        }
    }
    faces.extend_from_slice(&restored);
    restored.len()
}

#[cfg(test)]
mod tests;
