//! Triangle meshes as plain values.

use glam::Vec3;

/// An indexed triangle mesh in object space, metres.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Mesh {
    pub positions: Vec<Vec3>,
    /// Indices into `positions`, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// A unit normal for each corner of each triangle: as the file gives them, else made where missing.
    pub corner_normals: Vec<[Vec3; 3]>,
    /// Index of each triangle's material, in the list that came with the mesh.
    pub triangle_materials: Vec<u32>,
}
