//! Triangle meshes as plain values: welded, so that a closed mesh is closed in its indices too.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::looks::looks_of_faces;
pub use super::looks::{CornerLook, RawLooks};
use super::mend::{Mended, has_three_vertices, mend, restore_backs};
use super::normals::{face_normal, made_normals};
use super::orient::turned_triangles;
pub use super::soup::RawTriangle;
use super::soup::{EdgeUse, Face, Sets, Side, by_edge, edge_uses, unbalanced_edges};
use super::winding::winding_number;

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
    /// What corners have for textures and colours; empty where nothing asks for it.
    pub looks: Vec<CornerLook>,
    /// Indices into `looks` for each corner of each triangle; empty with them.
    pub corner_looks: Vec<[u32; 3]>,
}

/// What [`Mesh::weld`] found and did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MeshReport {
    /// Vertices that fell together with another, at the same place or within rounding of it.
    pub merged_vertices: usize,
    /// Triangles that were left out for having no area.
    pub dropped_without_area: usize,
    /// Triangles that were left out because another has the same vertices, the same way round or the other.
    pub dropped_duplicates: usize,
    /// Cuts through triangles at vertices that lie on their edges.
    pub splits: usize,
    /// Triangles that were turned over, to agree with their neighbours or to face outwards.
    pub turned_triangles: usize,
    /// Edges that are not passed as often one way as the other.
    pub open_edges: usize,
    /// Edges at which more than two triangles meet.
    pub crowded_edges: usize,
    /// Parts that have no edge in common.
    pub components: usize,
    /// The mesh bounds a volume: it has triangles and no open edge.
    pub closed: bool,
}

impl Mesh {
    /// Builds a mesh from raw triangles. Vertices at exactly the same place are merged, triangles without area and
    /// duplicates left out. If that leaves edges with an odd number of triangles, vertices within a hundred-thousandth
    /// of the mesh's size are merged too, and triangles cut at vertices that lie on their edges, where it closes such
    /// edges. Then triangles are wound like their neighbours and closed parts outwards, and the missing normals made by
    /// averaging over the faces within `crease_rad` (0: flat).
    ///
    /// Triangles that are there in both orientations keep both only where one alone would leave more edges open: a
    /// sheet of two sides is closed. A triangle without area stays if it is all that joins its neighbours.
    ///
    /// # Panics
    /// If a triangle names a vertex that `raw_positions` does not have.
    pub fn weld(
        raw_positions: &[Vec3],
        raw: &[RawTriangle],
        crease_rad: f64,
    ) -> (Self, MeshReport) {
        Self::weld_with_looks(raw_positions, raw, &RawLooks::default(), crease_rad)
    }

    /// [`Mesh::weld`] of triangles whose corners have texture coordinates, colours or tangents. Places are merged whatever
    /// these are, and where a triangle is cut they are interpolated.
    ///
    /// # Panics
    /// If a triangle names a vertex that `raw_positions` does not have, or a look that is not in `looks`.
    pub fn weld_with_looks(
        raw_positions: &[Vec3],
        raw: &[RawTriangle],
        looks: &RawLooks,
        crease_rad: f64,
    ) -> (Self, MeshReport) {
        let mut welder = Welder::new(raw_positions.len());
        let faces: Vec<Face> = raw
            .iter()
            .zip(0..)
            .map(|(triangle, source)| Face {
                vertices: triangle
                    .vertices
                    .map(|vertex| welder.index(raw_positions, vertex)),
                front: Side {
                    normals: triangle.normals,
                    material: triangle.material,
                    source,
                },
                back: None,
            })
            .filter(|face| has_three_vertices(face.vertices))
            .collect();
        let exactly_merged = welder.used - welder.positions.len();
        let positions = welder.positions;
        let Mended {
            mut faces,
            merged_vertices,
            duplicates,
            splits,
            ..
        } = mend(&positions, faces);
        let turned_triangles = orient(&positions, &mut faces);
        let restored = restore_backs(&positions, &mut faces);

        let (looks, corner_looks) =
            looks_of_faces(looks, (raw_positions, raw), (&positions, &faces));
        let mesh = Self {
            looks,
            corner_looks,
            ..Self::from_faces(positions, &faces, crease_rad)
        };
        // A back that was cut with its front comes again once for each piece.
        let splits = splits + restored.saturating_sub(duplicates);
        let dropped_duplicates = duplicates.saturating_sub(restored);
        let uses = edge_uses(mesh.triangles.iter().copied());
        let open_edges = unbalanced_edges(&uses);
        let report = MeshReport {
            merged_vertices: exactly_merged + merged_vertices,
            dropped_without_area: (raw.len() + splits)
                .saturating_sub(dropped_duplicates + mesh.triangles.len()),
            dropped_duplicates,
            splits,
            turned_triangles,
            open_edges,
            crowded_edges: by_edge(&uses).filter(|around| around.len() > 2).count(),
            components: component_count(&uses, mesh.triangles.len()),
            closed: open_edges == 0 && !mesh.triangles.is_empty(),
        };
        (mesh, report)
    }

    fn from_faces(positions: Vec<Vec3>, faces: &[Face], crease_rad: f64) -> Self {
        let triangles: Vec<[u32; 3]> = faces.iter().map(|face| face.vertices).collect();
        let made = made_normals(&positions, &triangles, crease_rad);
        let corner_normals = faces
            .iter()
            .zip(made)
            .map(|(face, made)| {
                std::array::from_fn(|corner| {
                    let given = face.front.normals[corner]
                        .map(|normal| normal.as_dvec3().normalize_or_zero());
                    match given {
                        Some(normal) if normal != DVec3::ZERO => normal.as_vec3(),
                        _ => made[corner],
                    }
                })
            })
            .collect();
        Self {
            positions,
            triangles,
            corner_normals,
            triangle_materials: faces.iter().map(|face| face.front.material).collect(),
            ..Self::default()
        }
        .without_unused_positions()
    }

    /// How often the mesh winds around a point of its space: 1 in a closed mesh, 0 outside (see [`winding_number`]).
    pub fn winding_number(&self, point: DVec3) -> f64 {
        winding_number(&self.positions, self.triangles.iter().copied(), point)
    }

    /// Edges that are not passed as often one way as the other; 0 for a mesh that bounds a volume.
    pub fn open_edge_count(&self) -> usize {
        unbalanced_edges(&edge_uses(self.triangles.iter().copied()))
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
        self.corner_looks
            .iter_mut()
            .for_each(|looks| looks.swap(1, 2));
        self
    }

    /// The shape and its materials alone, without what textures and colours need.
    pub fn without_looks(&self) -> Self {
        Self {
            looks: Vec::new(),
            corner_looks: Vec::new(),
            ..self.clone()
        }
    }

    pub(super) fn without_unused_positions(mut self) -> Self {
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

/// Turns faces over where [`turned_triangles`] says so, and tells how many. Where the file has a face both ways round,
/// turning is a choice between the two and does not count.
fn orient(positions: &[Vec3], faces: &mut [Face]) -> usize {
    let triangles: Vec<[u32; 3]> = faces.iter().map(|face| face.vertices).collect();
    let turned = turned_triangles(positions, &triangles);
    let mut count = 0;
    for (face, _) in faces.iter_mut().zip(turned).filter(|(_, turned)| *turned) {
        match face.back {
            Some(back) => (face.front, face.back) = (back, Some(face.front)),
            None => count += 1,
        }
        *face = face.turned();
        face.turn_inverted_normals(face_normal(positions, face.vertices));
    }
    count
}

/// Parts that have no edge in common.
fn component_count(uses: &[EdgeUse], triangles: usize) -> usize {
    let mut parts = Sets::new(triangles);
    for around in by_edge(uses) {
        for other in &around[1..] {
            parts.join(around[0].triangle, other.triangle);
        }
    }
    (0..triangles as u32)
        .filter(|&triangle| parts.least(triangle) == triangle)
        .count()
}

#[cfg(test)]
mod looks_tests;

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
                components: 1,
                closed: true,
                ..MeshReport::default()
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
    fn a_missing_triangle_opens_three_edges_and_a_turned_one_is_turned_back() {
        let (positions, mut triangles) = loose_tetrahedron();
        triangles[3].vertices.swap(0, 1);
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert!(report.closed && mesh.closed_and_consistent());
        assert_eq!(report.turned_triangles, 1);
        triangles.pop();
        let report = Mesh::weld(&positions, &triangles, 0.0).1;
        assert_eq!((report.open_edges, report.closed), (3, false));
        assert!(!Mesh::default().closed_and_consistent());
    }

    #[test]
    fn triangles_without_area_go() {
        let (mut positions, mut triangles) = loose_tetrahedron();
        triangles.push(raw([0, 0, 1]));
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            (
                mesh.triangles.len(),
                report.dropped_without_area,
                report.closed
            ),
            (4, 1, true)
        );

        // The edge from (1,0,0) to (0,1,0) of the last face gets a vertex in its middle, and a needle fills the gap:
        // the face on the other side is cut there instead.
        positions.push(Vec3::new(0.5, 0.5, 0.0));
        let [x, y, z] = [9, 10, 11];
        triangles[3].vertices = [x, 12, z];
        triangles[4] = raw([12, y, z]);
        triangles.push(raw([x, y, 12]));
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            report,
            MeshReport {
                merged_vertices: 8,
                dropped_without_area: 1,
                splits: 1,
                components: 1,
                closed: true,
                ..MeshReport::default()
            }
        );
        assert_eq!(mesh.triangles.len(), 6);
        assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);

        // By itself it joins nothing.
        let line = [Vec3::ZERO, Vec3::X, Vec3::X * 2.0];
        let (mesh, report) = Mesh::weld(&line, &[raw([0, 1, 2])], 0.0);
        assert_eq!(
            (
                mesh.positions.len(),
                mesh.triangles.len(),
                report.dropped_without_area
            ),
            (0, 0, 1)
        );
        assert!(!report.closed);
    }

    #[test]
    fn normals_turn_with_their_triangle_unless_they_were_right() {
        let (positions, mut triangles) = loose_tetrahedron();
        for triangle in &mut triangles {
            let [a, b, c] = triangle.vertices.map(|vertex| positions[vertex as usize]);
            triangle.normals = [Some((b - a).cross(c - a)); 3];
        }
        let outward = Mesh::weld(&positions, &triangles, 0.0).0;
        // All inside out, and of two triangles the normals too.
        for triangle in &mut triangles {
            triangle.vertices.swap(0, 1);
        }
        for triangle in &mut triangles[..2] {
            triangle.normals = triangle.normals.map(|normal| normal.map(|normal| -normal));
        }
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!((report.turned_triangles, report.closed), (4, true));
        assert_eq!(mesh.corner_normals, outward.corner_normals);
        assert!((mesh.signed_volume_m3() - 1.0 / 6.0).abs() < 1e-12);
    }

    #[test]
    fn of_a_face_that_is_there_both_ways_round_a_closed_mesh_keeps_the_outer_one() {
        let (positions, mut triangles) = loose_tetrahedron();
        let mut outer = triangles[3];
        outer.normals = [Some(Vec3::ONE); 3];
        outer.material = 1;
        triangles[3].vertices.swap(0, 1);
        triangles.push(outer);
        triangles.push(triangles[0]);
        let (mesh, report) = Mesh::weld(&positions, &triangles, 0.0);
        assert_eq!(
            report,
            MeshReport {
                merged_vertices: 8,
                dropped_duplicates: 2,
                components: 1,
                closed: true,
                ..MeshReport::default()
            }
        );
        assert_eq!(mesh.triangle_materials, [0, 0, 0, 1]);
        assert_eq!(mesh.corner_normals[3], [Vec3::ONE.normalize(); 3]);
    }

    #[test]
    fn a_sheet_of_two_sides_is_closed_and_has_a_normal_on_each() {
        let positions = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(1.0, 1.0, 0.0)];
        let sides = [[0, 1, 2], [1, 3, 2], [2, 1, 0], [2, 3, 1]].map(raw);
        let (mesh, report) = Mesh::weld(&positions, &sides, 0.0);
        assert_eq!((report.open_edges, report.closed), (0, true));
        assert_eq!((report.dropped_duplicates, report.crowded_edges), (0, 1));
        let up = mesh
            .corner_normals
            .iter()
            .filter(|normals| **normals == [Vec3::Z; 3]);
        let down = mesh
            .corner_normals
            .iter()
            .filter(|normals| **normals == [-Vec3::Z; 3]);
        assert_eq!((up.count(), down.count()), (2, 2));
    }

    #[test]
    fn it_winds_once_around_its_inside() {
        let (positions, triangles) = loose_tetrahedron();
        let mesh = Mesh::weld(&positions, &triangles, 0.0).0;
        assert!((mesh.winding_number(DVec3::splat(0.1)) - 1.0).abs() < 1e-12);
        assert!(mesh.winding_number(DVec3::splat(0.4)).abs() < 1e-12);
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

    /// Marsaglia's xorshift: the same soups in each run.
    struct Random(u64);

    impl Random {
        fn below(&mut self, end: u32) -> u32 {
            self.0 ^= self.0 << 13;
            self.0 ^= self.0 >> 7;
            self.0 ^= self.0 << 17;
            (self.0 % u64::from(end)) as u32
        }

        fn point(&mut self) -> DVec3 {
            DVec3::from_array([(); 3].map(|()| {
                let share = f64::from(self.below(1 << 30)) / f64::from(1 << 30);
                3.0 * share - 0.5
            }))
        }
    }

    fn passes_through(positions: &[Vec3], corners: [u32; 3], from: DVec3, to: DVec3) -> bool {
        let [a, b, c] = corners.map(|index| positions[index as usize].as_dvec3());
        let side = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
        let around = [(a, b), (b, c), (c, a)].map(|(p, q)| side(from, to, p, q));
        let one_way = around.iter().all(|&s| s > 0.0) || around.iter().all(|&s| s < 0.0);
        one_way && side(a, b, c, from) * side(a, b, c, to) < 0.0
    }

    #[test]
    fn mending_never_changes_what_lies_between_two_points() {
        // On a grid of 27 points all goes wrong at once: needles, duplicates, sheets of two sides, fins, vertices on
        // edges.
        let positions: Vec<Vec3> = (0..27)
            .map(|index| {
                Vec3::new(
                    (index % 3) as f32,
                    (index / 3 % 3) as f32,
                    (index / 9) as f32,
                )
            })
            .collect();
        let mut random = Random(3);
        let (mut splits, mut duplicates, mut turned, mut hidden) = (0, 0, 0, 0);
        for soup in 0..400 {
            let triangles: Vec<RawTriangle> = (0..1 + random.below(60))
                .map(|_| raw([random.below(27), random.below(27), random.below(27)]))
                .collect();
            let (mesh, report) = Mesh::weld(&positions, &triangles, 0.5);
            splits += report.splits;
            duplicates += report.dropped_duplicates;
            turned += report.turned_triangles;
            assert_eq!(report.open_edges, mesh.open_edge_count());
            for _ in 0..40 {
                let (from, to) = (random.point(), random.point());
                let before = triangles
                    .iter()
                    .any(|triangle| passes_through(&positions, triangle.vertices, from, to));
                let after = mesh
                    .triangles
                    .iter()
                    .any(|&corners| passes_through(&mesh.positions, corners, from, to));
                assert_eq!(before, after, "soup {soup}: {from} to {to}");
                hidden += usize::from(before);
            }
        }
        assert!(splits > 100 && duplicates > 10 && turned > 1000 && hidden > 2000);
    }
}
