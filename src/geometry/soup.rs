//! Triangles on their way into a mesh, and which of them meet at each edge.

use glam::{DVec3, Vec3};

/// A triangle as a file has it, before welding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RawTriangle {
    /// Indices into the raw positions.
    pub vertices: [u32; 3],
    /// Normals that the file gives; they need not have unit length, and a zero one counts as missing.
    pub normals: [Option<Vec3>; 3],
    /// Index into the list of materials.
    pub material: u32,
}

/// What one side of a face looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Side {
    /// At the face's vertices, in their order; `None` where a normal has to be made.
    pub normals: [Option<Vec3>; 3],
    /// Index into the list of materials.
    pub material: u32,
    /// Number of the raw triangle that it is, or is a part of.
    pub source: u32,
}

/// A triangle, seen from one side or, where the file has it in both orientations, from two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Face {
    /// Indices of its positions, counter-clockwise seen from the front.
    pub vertices: [u32; 3],
    /// The side that is seen counter-clockwise.
    pub front: Side,
    /// The triangle the other way round; its normals follow `vertices` too.
    pub back: Option<Side>,
}

impl Face {
    /// The face the other way round, its normals unchanged and still at their vertices. Its first vertex stays first,
    /// so that both are rasterised from the same corner.
    pub fn turned(self) -> Self {
        let turned = |side: Side| Side {
            normals: [side.normals[0], side.normals[2], side.normals[1]],
            ..side
        };
        let [a, b, c] = self.vertices;
        Self {
            vertices: [a, c, b],
            front: turned(self.front),
            back: self.back.map(turned),
        }
    }

    /// Turns the front's normals if they are, as a whole, turned away from the face's.
    pub fn turn_inverted_normals(&mut self, face_normal: DVec3) {
        let normals = self.front.normals.iter().flatten();
        let agreement: f64 = normals
            .map(|normal| normal.as_dvec3().normalize_or_zero().dot(face_normal))
            .sum();
        if agreement < 0.0 {
            self.front.normals = self
                .front
                .normals
                .map(|normal| normal.map(|normal| -normal));
        }
    }
}

/// One passage of a triangle along an edge.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeUse {
    /// Smaller index above, larger below: uses of one edge stand together when sorted.
    edge: u64,
    /// The triangle's number.
    pub triangle: u32,
    /// Whether it runs from the smaller index to the larger.
    pub forward: bool,
}

impl EdgeUse {
    /// The edge's vertices, the smaller index first.
    pub fn ends(&self) -> [u32; 2] {
        [(self.edge >> 32) as u32, self.edge as u32]
    }

    /// 1 forwards, -1 backwards.
    pub fn sign(&self) -> i64 {
        if self.forward { 1 } else { -1 }
    }
}

/// All passages along edges, sorted: [`by_edge`] takes them apart.
pub(super) fn edge_uses(triangles: impl IntoIterator<Item = [u32; 3]>) -> Vec<EdgeUse> {
    let mut uses: Vec<EdgeUse> = triangles
        .into_iter()
        .zip(0..)
        .flat_map(|([a, b, c], triangle)| {
            [(a, b), (b, c), (c, a)].map(|(from, to)| EdgeUse {
                edge: u64::from(from.min(to)) << 32 | u64::from(from.max(to)),
                triangle,
                forward: from < to,
            })
        })
        .collect();
    uses.sort_unstable();
    uses
}

/// The uses of each edge.
pub(super) fn by_edge(uses: &[EdgeUse]) -> impl Iterator<Item = &[EdgeUse]> {
    uses.chunk_by(|a, b| a.edge == b.edge)
}

/// Edges that are not passed as often one way as the other.
pub(super) fn unbalanced_edges(uses: &[EdgeUse]) -> usize {
    by_edge(uses)
        .filter(|around| around.iter().map(EdgeUse::sign).sum::<i64>() != 0)
        .count()
}

/// Edges with an odd number of triangles: no choice of windings balances them.
pub(super) fn odd_edges(faces: &[Face]) -> usize {
    by_edge(&edge_uses(faces.iter().map(|face| face.vertices)))
        .filter(|around| around.len() % 2 == 1)
        .count()
}

/// Disjoint sets of numbers from 0; each is named by its least member.
pub(super) struct Sets(Vec<u32>);

impl Sets {
    /// Every number by itself.
    pub fn new(count: usize) -> Self {
        Self((0..count as u32).collect())
    }

    /// The least member of a number's set.
    pub fn least(&mut self, number: u32) -> u32 {
        let mut least = number;
        while self.0[least as usize] != least {
            // Halving the path keeps later walks short.
            self.0[least as usize] = self.0[self.0[least as usize] as usize];
            least = self.0[least as usize];
        }
        least
    }

    /// Makes one set of two.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.least(a), self.least(b));
        self.0[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_counted_and_balanced() {
        let uses = edge_uses([[0, 1, 2], [2, 1, 3], [1, 2, 4]]);
        let counts: Vec<([u32; 2], usize)> = by_edge(&uses)
            .map(|around| (around[0].ends(), around.len()))
            .collect();
        let once = [[0, 1], [0, 2], [1, 3], [1, 4], [2, 3], [2, 4]];
        assert_eq!(counts.len(), 7);
        assert!(once.iter().all(|&edge| counts.contains(&(edge, 1))));
        assert!(counts.contains(&([1, 2], 3)));
        assert_eq!(unbalanced_edges(&uses), 7);
        assert_eq!(unbalanced_edges(&edge_uses([[0, 1, 2], [2, 1, 0]])), 0);
    }

    #[test]
    fn sets_are_named_by_their_least_member() {
        let mut sets = Sets::new(6);
        for (a, b) in [(5, 4), (4, 2), (1, 0)] {
            sets.join(a, b);
        }
        let names: Vec<u32> = (0..6).map(|number| sets.least(number)).collect();
        assert_eq!(names, [0, 0, 2, 3, 2, 2]);
    }
}
