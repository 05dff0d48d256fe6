//! Tangents where a file has a normal map but none: MikkTSpace, as glTF 2.0 section 3.7.2.1 wants it.

use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{Vec2, Vec3, Vec4};

/// What MikkTSpace asks of triangles.
struct Triangles<'a> {
    triangles: &'a [[u32; 3]],
    positions: &'a [Vec3],
    normals: &'a [[Vec3; 3]],
    uv: &'a [Vec2],
    tangents: Vec<[Vec4; 3]>,
}

/// A tangent for each corner of each triangle; zero where there is none. `normals` are those of corners, the rest of
/// vertices.
pub(super) fn made_tangents(
    triangles: &[[u32; 3]],
    positions: &[Vec3],
    normals: &[[Vec3; 3]],
    uv: &[Vec2],
) -> Vec<[Vec4; 3]> {
    let none = vec![[Vec4::ZERO; 3]; triangles.len()];
    let mut asked = Triangles {
        triangles,
        positions,
        normals,
        uv,
        tangents: none.clone(),
    };
    match generate_tangents(&mut asked) {
        Ok(()) => asked.tangents,
        Err(_) => none,
    }
}

impl Triangles<'_> {
    fn vertex(&self, face: usize, corner: usize) -> usize {
        self.triangles[face][corner] as usize
    }
}

impl Geometry for Triangles<'_> {
    fn num_faces(&self) -> usize {
        self.triangles.len()
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, corner: usize) -> [f32; 3] {
        self.positions[self.vertex(face, corner)].to_array()
    }

    fn normal(&self, face: usize, corner: usize) -> [f32; 3] {
        self.normals[face][corner].to_array()
    }

    fn tex_coord(&self, face: usize, corner: usize) -> [f32; 2] {
        self.uv[self.vertex(face, corner)].to_array()
    }

    fn set_tangent(&mut self, found: Option<TangentSpace>, face: usize, corner: usize) {
        if let Some(found) = found {
            // MikkTSpace's bitangent goes as v grows, which is downwards in glTF's pictures; their normals' y is upwards.
            let [x, y, z, side] = found.tangent_encoded();
            self.tangents[face][corner] = Vec4::new(x, y, z, -side);
        }
    }
}
