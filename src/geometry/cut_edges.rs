//! Meshes of which some edges are halved: finer ones of the same shape, without gaps.

use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::looks::CornerLook;
use super::mesh::Mesh;
use super::subdivide::cut_triangle;

/// An edge as the numbers of its ends' positions, the smaller first.
pub type Edge = [u32; 2];

/// The edge between two positions.
pub fn edge(a: u32, b: u32) -> Edge {
    [a.min(b), a.max(b)]
}

/// A corner of a triangle that is cut.
#[derive(Clone, Copy)]
struct CutCorner {
    vertex: u32,
    place: Vec3,
    normal: Vec3,
    look: u32,
}

impl Mesh {
    /// The mesh with edges halved, and the triangles on either side of them cut. New corners have what lies between those of
    /// the edge; edges that the mesh does not have are passed over. Not for meshes that a rig moves.
    pub fn with_edges_cut(&self, edges: &HashSet<Edge>) -> Self {
        let mut cut = Self {
            positions: self.positions.clone(),
            looks: self.looks.clone(),
            ..Self::default()
        };
        let mut vertices = HashMap::new();
        let mut looks = HashMap::new();
        let mut middle = |a: CutCorner, b: CutCorner| {
            let place = 0.5 * (a.place + b.place);
            let vertex = *vertices.entry(edge(a.vertex, b.vertex)).or_insert_with(|| {
                cut.positions.push(place);
                cut.positions.len() as u32 - 1
            });
            let look = match cut.looks.is_empty() {
                true => 0,
                false => *looks.entry(edge(a.look, b.look)).or_insert_with(|| {
                    let [of_a, of_b] = [a.look, b.look].map(|look| cut.looks[look as usize]);
                    cut.looks.push(between(&of_a, &of_b));
                    cut.looks.len() as u32 - 1
                }),
            };
            CutCorner {
                vertex,
                place,
                normal: (a.normal + b.normal).try_normalize().unwrap_or(a.normal),
                look,
            }
        };
        let mut parts = Vec::new();
        for (number, triangle) in self.triangles.iter().enumerate() {
            let look_of = self.corner_looks.get(number).copied().unwrap_or_default();
            let corners = [0, 1, 2].map(|corner| CutCorner {
                vertex: triangle[corner],
                place: self.positions[triangle[corner] as usize],
                normal: self.corner_normals[number][corner],
                look: look_of[corner],
            });
            let [a, b, c] = *triangle;
            let is_cut = [edge(a, b), edge(b, c), edge(c, a)].map(|it| edges.contains(&it));
            let mut of_triangle = Vec::new();
            cut_triangle(
                corners,
                is_cut,
                &|it: CutCorner| it.place,
                &mut middle,
                &mut of_triangle,
            );
            parts.extend(of_triangle.into_iter().map(|part| (number, part)));
        }
        for (number, part) in parts {
            cut.triangles.push(part.map(|corner| corner.vertex));
            cut.corner_normals.push(part.map(|corner| corner.normal));
            cut.triangle_materials.push(self.triangle_materials[number]);
            if !self.corner_looks.is_empty() {
                cut.corner_looks.push(part.map(|corner| corner.look));
            }
        }
        cut
    }
}

/// What a corner in the middle of an edge has.
fn between(a: &CornerLook, b: &CornerLook) -> CornerLook {
    let along = (a.tangent + b.tangent).truncate();
    let along = along.try_normalize().unwrap_or(a.tangent.truncate());
    CornerLook {
        uv: [0, 1].map(|set| 0.5 * (a.uv[set] + b.uv[set])),
        color: 0.5 * (a.color + b.color),
        tangent: along.extend(a.tangent.w),
        held_by: a.held_by,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;
    use crate::geometry::mesh::tests::welded;
    use glam::{Vec2, Vec4};

    fn cube() -> Mesh {
        let (positions, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
        welded(&positions, &triangles)
    }

    #[test]
    fn a_closed_mesh_stays_closed_flat_and_as_large() {
        let mut mesh = cube();
        for step in 0..3 {
            // Some edges of each, without order.
            let all = mesh
                .triangles
                .iter()
                .flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]);
            let cut: HashSet<Edge> = all
                .filter(|[a, b]| (a * 7 + b * 3 + step) % 3 != 0)
                .collect();
            let finer = mesh.with_edges_cut(&cut);
            assert!(finer.triangles.len() > mesh.triangles.len());
            mesh = finer;
            assert!(mesh.closed_and_consistent());
            assert!((mesh.signed_volume_m3() - 1.0).abs() < 1e-6);
            for (triangle, normals) in mesh.triangles.iter().zip(&mesh.corner_normals) {
                let [a, b, c] = triangle.map(|index| mesh.positions[index as usize]);
                let outward = (b - a).cross(c - a).normalize();
                assert!(normals.iter().all(|normal| normal.distance(outward) < 1e-6));
            }
        }
    }

    #[test]
    fn new_corners_lie_between_the_ends_in_all_that_they_have() {
        let look = |u: f32| CornerLook {
            uv: [Vec2::new(u, 1.0); 2],
            color: Vec4::splat(u),
            tangent: Vec4::new(1.0, 0.0, 0.0, -1.0),
            held_by: Default::default(),
        };
        let mesh = Mesh {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            triangles: vec![[0, 1, 2]],
            corner_normals: vec![[Vec3::Z; 3]],
            triangle_materials: vec![4],
            looks: vec![look(0.0), look(1.0), look(3.0)],
            corner_looks: vec![[0, 1, 2]],
            held: Vec::new(),
        };
        let cut = mesh.with_edges_cut(&HashSet::from([edge(1, 0), edge(7, 9)]));
        assert_eq!(cut.triangles.len(), 2);
        assert_eq!(cut.triangle_materials, [4, 4]);
        assert_eq!(cut.positions[3], Vec3::new(0.5, 0.0, 0.0));
        let of_new = &cut.looks[3];
        assert_eq!(
            (of_new.uv[1], of_new.color, of_new.tangent.w),
            (Vec2::new(0.5, 1.0), Vec4::splat(0.5), -1.0)
        );
        assert_eq!(mesh.with_edges_cut(&HashSet::new()), mesh);
    }
}
