//! Triangle meshes as plain values: welded, so that a closed mesh is closed in its indices too.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::looks::looks_of_faces;
pub use super::looks::{CornerLook, RawLooks, RigPoint};
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
    /// For each corner of each triangle what holds it, where the mesh follows a rig; else empty.
    pub held: Vec<[HeldCorner; 3]>,
}

/// How a corner of a triangle follows a rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldCorner {
    /// Where it is.
    pub point: RigPoint,
    /// Where its normal comes from.
    pub normal: HeldNormal,
}

/// Where the normal of a corner that follows a rig comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeldNormal {
    /// From the rig's vertices.
    OfRig,
    /// From them, but towards the other side: the triangle was turned over.
    OfRigTurned,
    /// From the faces around it.
    OfFaces,
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
        let at = |vertex: u32| {
            // Adding 0 makes 0 of -0, which is the same place.
            let place = raw_positions[vertex as usize] + Vec3::ZERO;
            place.to_array().map(f32::to_bits)
        };
        let faces = welder.faces(raw_positions, raw, at);
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
        let report = MeshReport {
            merged_vertices: exactly_merged + merged_vertices,
            dropped_without_area: (raw.len() + splits)
                .saturating_sub(dropped_duplicates + mesh.triangles.len()),
            dropped_duplicates,
            splits,
            turned_triangles,
            ..mesh.topology()
        };
        (mesh, report)
    }

    /// The mesh of a model that a rig moves, of whose looks each says what holds it. Vertices are one where `together` has
    /// one number for them: not where they lie in one place at rest, if they may part. Nothing is mended and nothing left out,
    /// for what has no area at rest may get one.
    ///
    /// # Panics
    /// If a triangle names a vertex or a look that is not there.
    pub fn weld_moving(
        raw_positions: &[Vec3],
        raw: &[RawTriangle],
        looks: &RawLooks,
        together: &[u32],
        crease_rad: f64,
    ) -> (Self, MeshReport) {
        let mut welder = Welder::new(raw_positions.len());
        let number = |vertex: u32| [together[vertex as usize], 0, 0];
        let mut faces = welder.faces(raw_positions, raw, number);
        let merged_vertices = welder.used - welder.positions.len();
        let positions = std::mem::take(&mut welder.positions);
        let turned_triangles = orient(&positions, &mut faces);
        // Nothing was cut: each corner is one of its raw triangle's.
        let raw_corner = |face: &Face, corner: usize| {
            let vertices = raw[face.front.source as usize].vertices;
            let is_it =
                |&vertex: &u32| welder.index_of_raw[vertex as usize] == Some(face.vertices[corner]);
            vertices.iter().position(is_it).unwrap_or(corner)
        };
        let corner_looks: Vec<[u32; 3]> = faces
            .iter()
            .map(|face| {
                let own = looks.corners[face.front.source as usize];
                [0, 1, 2].map(|corner| own[raw_corner(face, corner)])
            })
            .collect();
        let held = faces.iter().zip(&corner_looks).map(|(face, own)| {
            let raw = &raw[face.front.source as usize];
            [0, 1, 2].map(|corner| HeldCorner {
                point: looks.looks[own[corner] as usize].held_by,
                normal: held_normal(face, raw, corner),
            })
        });
        let held = held.collect();
        let mesh = Self {
            held,
            looks: looks.looks.clone(),
            corner_looks,
            ..Self::from_faces(positions, &faces, crease_rad)
        };
        let report = MeshReport {
            merged_vertices,
            dropped_without_area: raw.len() - mesh.triangles.len(),
            turned_triangles,
            ..mesh.topology()
        };
        (mesh, report)
    }

    /// What a report says of how its triangles hang together.
    fn topology(&self) -> MeshReport {
        let uses = edge_uses(self.triangles.iter().copied());
        let open_edges = unbalanced_edges(&uses);
        MeshReport {
            open_edges,
            crowded_edges: by_edge(&uses).filter(|around| around.len() > 2).count(),
            components: component_count(&uses, self.triangles.len()),
            closed: open_edges == 0 && !self.triangles.is_empty(),
            ..MeshReport::default()
        }
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
        self.held.iter_mut().for_each(|held| held.swap(1, 2));
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
        self.positions = used(&self.positions, self.triangles.as_flattened_mut());
        self
    }

    /// Leaves out the looks that no corner has.
    pub(super) fn without_unused_looks(mut self) -> Self {
        self.looks = used(&self.looks, self.corner_looks.as_flattened_mut());
        self
    }
}

/// The values that indices name, in the order in which they are first named; the indices are made to fit.
fn used<T: Copy>(values: &[T], indices: &mut [u32]) -> Vec<T> {
    let mut new_index = vec![u32::MAX; values.len()];
    let mut kept = Vec::new();
    for index in indices {
        let old = *index as usize;
        if new_index[old] == u32::MAX {
            new_index[old] = kept.len() as u32;
            kept.push(values[old]);
        }
        *index = new_index[old];
    }
    kept
}

/// Where the normal of a face's corner comes from; `raw` is the triangle that the face was.
fn held_normal(face: &Face, raw: &RawTriangle, corner: usize) -> HeldNormal {
    let is_as_given = (face.front.normals.iter()).all(|normal| raw.normals.contains(normal));
    match face.front.normals[corner] {
        None => HeldNormal::OfFaces,
        Some(_) if is_as_given => HeldNormal::OfRig,
        Some(_) => HeldNormal::OfRigTurned,
    }
}

/// Gives vertices that are one the same index, in the order of their first use.
struct Welder {
    positions: Vec<Vec3>,
    index_of_key: HashMap<[u32; 3], u32>,
    index_of_raw: Vec<Option<u32>>,
    used: usize,
}

impl Welder {
    fn new(raw_count: usize) -> Self {
        Self {
            positions: Vec::new(),
            index_of_key: HashMap::new(),
            index_of_raw: vec![None; raw_count],
            used: 0,
        }
    }

    /// Raw triangles as faces; vertices with one key are one. What then has fewer than three is left out.
    fn faces(
        &mut self,
        raw_positions: &[Vec3],
        raw: &[RawTriangle],
        key_of: impl Fn(u32) -> [u32; 3],
    ) -> Vec<Face> {
        let faces = raw.iter().zip(0..).map(|(triangle, source)| Face {
            vertices: triangle
                .vertices
                .map(|vertex| self.index(raw_positions, vertex, &key_of)),
            front: Side {
                normals: triangle.normals,
                material: triangle.material,
                source,
            },
            back: None,
        });
        faces
            .filter(|face| has_three_vertices(face.vertices))
            .collect()
    }

    fn index(
        &mut self,
        raw_positions: &[Vec3],
        raw: u32,
        key_of: &impl Fn(u32) -> [u32; 3],
    ) -> u32 {
        let known = &mut self.index_of_raw[raw as usize];
        if let Some(index) = *known {
            return index;
        }
        let next = self.positions.len() as u32;
        let index = *self.index_of_key.entry(key_of(raw)).or_insert(next);
        if index == next {
            // (0 and -0 are one place.)
            self.positions
                .push(raw_positions[raw as usize] + Vec3::ZERO);
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
pub(crate) mod tests;
