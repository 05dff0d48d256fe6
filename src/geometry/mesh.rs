//! Triangle meshes as plain values: welded, so that a closed mesh is closed in its indices too.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::normals::{face_normal, made_normals};

/// An indexed triangle mesh in object space, metres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    /// No position stands here twice, and each is a corner of a triangle.
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// A unit normal for each corner of each triangle: as the file gives them, else made where missing.
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Index of each triangle's material, in the list that came with the mesh.
    pub triangle_materials: Vec<u32>,
}

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

/// What [`Mesh::weld`] found and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshReport {
    /// Vertices that fell together with another at the same place.
    pub merged_vertices: usize,
    /// Triangles without area that were left out.
    pub dropped_triangles: usize,
    /// Edges that are not passed as often one way as the other.
    pub open_edges: usize,
    /// The mesh bounds a volume: it has triangles and no open edge.
    pub closed: bool,
}

impl Mesh {
    /// Builds a mesh from raw triangles: merges vertices at exactly the same place, leaves out triangles without area,
    /// and makes the missing normals by averaging over the faces within `crease_rad` (0: flat).
    ///
    /// A needle, whose corners differ but lie on a line, is left out only if that opens no edge: in a closed mesh it
    /// may be all that joins its neighbours, and a closed shadow volume needs the join.
    ///
    /// # Panics
    /// If a triangle names a vertex that `raw_positions` does not have.
    pub fn weld(
        raw_positions: &[Vec3],
        raw: &[RawTriangle],
        crease_rad: f64,
    ) -> (Self, MeshReport) {
        let mut welded = Welder::new(raw_positions.len());
        let mut corners: Vec<([u32; 3], &RawTriangle)> = Vec::with_capacity(raw.len());
        for triangle in raw {
            let indices = triangle
                .vertices
                .map(|vertex| welded.index(raw_positions, vertex));
            corners.push((indices, triangle));
        }
        let merged_vertices = welded.used - welded.positions.len();
        let positions = welded.positions;

        corners.retain(|([a, b, c], _)| a != b && b != c && c != a);
        let with_needles = open_edge_count(corners.iter().map(|(indices, _)| *indices));
        let has_area = |indices: &[u32; 3]| face_normal(&positions, *indices) != DVec3::ZERO;
        let without_needles = open_edge_count(
            corners
                .iter()
                .map(|(indices, _)| *indices)
                .filter(|indices| has_area(indices)),
        );
        if without_needles <= with_needles {
            corners.retain(|(indices, _)| has_area(indices));
        }

        let triangles: Vec<[u32; 3]> = corners.iter().map(|(indices, _)| *indices).collect();
        let made = made_normals(&positions, &triangles, crease_rad);
        let corner_normals = corners
            .iter()
            .zip(made)
            .map(|((_, raw), made)| {
                std::array::from_fn(|corner| {
                    let given =
                        raw.normals[corner].map(|normal| normal.as_dvec3().normalize_or_zero());
                    match given {
                        Some(normal) if normal != DVec3::ZERO => normal.as_vec3(),
                        _ => made[corner],
                    }
                })
            })
            .collect();
        let triangle_materials = corners.iter().map(|(_, raw)| raw.material).collect();
        let dropped_triangles = raw.len() - triangles.len();
        let mesh = Self {
            positions,
            triangles,
            corner_normals,
            triangle_materials,
        }
        .without_unused_positions();
        let open_edges = mesh.open_edge_count();
        let closed = open_edges == 0 && !mesh.triangles.is_empty();
        (
            mesh,
            MeshReport {
                merged_vertices,
                dropped_triangles,
                open_edges,
                closed,
            },
        )
    }

    /// Edges that are not passed as often one way as the other; 0 for a mesh that bounds a volume.
    pub fn open_edge_count(&self) -> usize {
        open_edge_count(self.triangles.iter().copied())
    }

    /// Whether each edge is passed as often one way as the other: the mesh is closed and its triangles agree on
    /// which side is outside.
    pub fn closed_and_consistent(&self) -> bool {
        !self.triangles.is_empty() && self.open_edge_count() == 0
    }

    /// Volume within a closed mesh, cubic metres; negative if its triangles face inwards.
    pub fn signed_volume_m3(&self) -> f64 {
        let volume = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|&index| self.positions[index as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        };
        self.triangles.iter().map(volume).sum()
    }

    /// The mesh with the winding of each triangle turned round; the corners keep their normals.
    pub fn with_winding_reversed(mut self) -> Self {
        self.triangles
            .iter_mut()
            .for_each(|corners| corners.swap(1, 2));
        self.corner_normals
            .iter_mut()
            .for_each(|normals| normals.swap(1, 2));
        self
    }

    fn without_unused_positions(mut self) -> Self {
        let mut new_index = vec![u32::MAX; self.positions.len()];
        let mut kept = Vec::with_capacity(self.positions.len());
        for index in self.triangles.iter_mut().flatten() {
            let old = *index as usize;
            if new_index[old] == u32::MAX {
                new_index[old] = kept.len() as u32;
                kept.push(self.positions[old]);
            }
            *index = new_index[old];
        }
        self.positions = kept;
        self
    }
}

/// Gives vertices at the same place the same index, in the order of their first use.
struct Welder {
    positions: Vec<Vec3>,
    index_at: HashMap<[u32; 3], u32>,
    index_of_raw: Vec<Option<u32>>,
    used: usize,
}

impl Welder {
    fn new(raw_count: usize) -> Self {
        Self {
            positions: Vec::new(),
            index_at: HashMap::new(),
            index_of_raw: vec![None; raw_count],
            used: 0,
        }
    }

    fn index(&mut self, raw_positions: &[Vec3], raw: u32) -> u32 {
        let known = &mut self.index_of_raw[raw as usize];
        if let Some(index) = *known {
            return index;
        }
        // Adding 0 makes 0 of -0, which is the same place.
        let position = raw_positions[raw as usize] + Vec3::ZERO;
        let next = self.positions.len() as u32;
        let index = *self
            .index_at
            .entry(position.to_array().map(f32::to_bits))
            .or_insert(next);
        if index == next {
            self.positions.push(position);
        }
        self.used += 1;
        *known = Some(index);
        index
    }
}

fn open_edge_count(triangles: impl Iterator<Item = [u32; 3]>) -> usize {
    let mut balance: HashMap<(u32, u32), i64> = HashMap::new();
    for [a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *balance.entry((from.min(to), from.max(to))).or_default() +=
                if from < to { 1 } else { -1 };
        }
    }
    balance.values().filter(|&&passes| passes != 0).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw(vertices: [u32; 3]) -> RawTriangle {
        RawTriangle {
            vertices,
            normals: [None; 3],
            material: 0,
        }
    }

    /// A tetrahedron whose triangles share no vertex.
    fn loose_tetrahedron() -> (Vec<Vec3>, Vec<RawTriangle>) {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let positions = faces
            .iter()
            .flatten()
            .map(|&corner| corners[corner as usize])
            .collect();
        (
            positions,
            (0..4)
                .map(|face| raw([3 * face, 3 * face + 1, 3 * face + 2]))
                .collect(),
        )
    }

    #[test]
    fn welding_closes_what_is_closed_in_space() {
        let (mut positions, triangles) = loose_tetrahedron();
        positions[0] = Vec3::new(-0.0, 0.0, -0.0);
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            report,
            MeshReport {
                merged_vertices: 8,
                dropped_triangles: 0,
                open_edges: 0,
                closed: true
            }
        );
        assert_eq!(mesh.positions.len(), 4);
        assert!(mesh.closed_and_consistent());
        assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);
        let reversed = mesh.with_winding_reversed();
        assert!(reversed.closed_and_consistent());
        assert!((reversed.signed_volume_m3() + 1.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn a_missing_or_turned_triangle_opens_three_edges() {
        let (positions, mut triangles) = loose_tetrahedron();
        triangles[3].vertices.swap(0, 1);
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            (
                report.open_edges,
                report.closed,
                mesh.closed_and_consistent()
            ),
            (3, false, false)
        );
        triangles.pop();
        assert_eq!(Mesh::weld(&positions, &triangles, 0.0).1.open_edges, 3);
        assert!(!Mesh::default().closed_and_consistent());
    }

    #[test]
    fn triangles_without_area_go_unless_they_join_their_neighbours() {
        let (mut positions, mut triangles) = loose_tetrahedron();
        triangles.push(raw([0, 0, 1]));
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            (
                mesh.triangles.len(),
                report.dropped_triangles,
                report.closed
            ),
            (4, 1, true)
        );

        // The edge from (1,0,0) to (0,1,0) of the last face gets a vertex in its middle, and a needle fills the gap.
        positions.push(Vec3::new(0.5, 0.5, 0.0));
        triangles[3] = raw([1, 12, 11]);
        triangles[4] = raw([12, 2, 11]);
        let [x, y, z] = [9, 10, 11];
        triangles[3].vertices = [x, 12, z];
        triangles[4].vertices = [12, y, z];
        triangles.push(raw([x, y, 12]));
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            (
                mesh.triangles.len(),
                report.dropped_triangles,
                report.closed
            ),
            (6, 0, true)
        );

        // By itself it joins nothing.
        let line = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        let (mesh, report) = Mesh::weld(&line, &[raw([0, 1, 2])], 0.0);
        assert_eq!(
            (
                mesh.positions.len(),
                mesh.triangles.len(),
                report.dropped_triangles
            ),
            (0, 0, 1)
        );
        assert!(!report.closed);
    }

    #[test]
    fn given_normals_are_made_unit_and_zero_ones_are_replaced() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y];
        let normals = [Some(Vec3::new(0.0, 3.0, 4.0)), Some(Vec3::ZERO), None];
        let triangle = RawTriangle {
            vertices: [0, 1, 2],
            normals,
            material: 0,
        };
        let (mesh, _) = Mesh::weld(&positions, &[triangle], 0.0);
        assert_eq!(
            mesh.corner_normals[0],
            [Vec3::new(0.0, 0.6, 0.8), Vec3::Z, Vec3::Z]
        );
    }
}
