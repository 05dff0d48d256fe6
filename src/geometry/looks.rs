//! What corners of triangles have for textures and colours, and how it follows a mesh that is mended.

use std::collections::HashMap;

use glam::{DVec3, Vec2, Vec3, Vec4, Vec4Swizzles as _};

use super::soup::{Face, RawTriangle};

/// What a corner of a triangle has besides its place and normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CornerLook {
    /// Texture coordinates of both sets; v grows downwards in the picture.
    pub uv: [Vec2; 2],
    /// Linear RGBA by which the material's colour and opacity are multiplied.
    pub color: Vec4,
    /// Unit direction in object space in which u of the normal map grows, and in w the side (±1) to which v does; 0 where
    /// there is none.
    pub tangent: Vec4,
}

impl Default for CornerLook {
    /// White, at the texture's origin.
    fn default() -> Self {
        Self {
            uv: [Vec2::ZERO; 2],
            color: Vec4::ONE,
            tangent: Vec4::ZERO,
        }
    }
}

impl CornerLook {
    /// The sum of looks, weighted.
    pub fn blended(looks: [&Self; 3], weights: [f32; 3]) -> Self {
        let pairs = || looks.into_iter().zip(weights);
        let uv = |set: usize| pairs().map(|(look, weight)| look.uv[set] * weight).sum();
        let tangent: Vec3 = pairs()
            .map(|(look, weight)| look.tangent.xyz() * weight)
            .sum();
        Self {
            uv: [uv(0), uv(1)],
            color: pairs().map(|(look, weight)| look.color * weight).sum(),
            tangent: tangent.normalize_or_zero().extend(looks[0].tangent.w),
        }
    }
}

/// The looks of raw triangles.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RawLooks {
    /// What corners may have, each once.
    pub looks: Vec<CornerLook>,
    /// Indices into `looks` for the corners of each raw triangle; empty where there are no looks.
    pub corners: Vec<[u32; 3]>,
}

/// A corner of a cut triangle that lies as near as this to one of the raw triangle's is that corner.
const AT_CORNER: f64 = 0.999;

/// The looks of faces that raw triangles have become, and for each face's corners their indices.
pub(super) fn looks_of_faces(
    given: &RawLooks,
    (raw_positions, raw): (&[Vec3], &[RawTriangle]),
    (positions, faces): (&[Vec3], &[Face]),
) -> (Vec<CornerLook>, Vec<[u32; 3]>) {
    if given.corners.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let mut looks = Vec::new();
    // Of the given ones those that are used, in the order of their use.
    let mut kept: HashMap<u32, u32> = HashMap::new();
    let mut next = |look: CornerLook| {
        looks.push(look);
        looks.len() as u32 - 1
    };
    let corner_looks = faces
        .iter()
        .map(|face| {
            let source = face.front.source as usize;
            let own = given.corners[source];
            let corners = raw[source]
                .vertices
                .map(|vertex| raw_positions[vertex as usize].as_dvec3());
            face.vertices.map(|vertex| {
                let weights = weights(positions[vertex as usize].as_dvec3(), corners);
                match (0..3).find(|&corner| weights[corner] >= AT_CORNER) {
                    Some(corner) => *kept
                        .entry(own[corner])
                        .or_insert_with(|| next(given.looks[own[corner] as usize])),
                    None => {
                        let looks = own.map(|look| &given.looks[look as usize]);
                        next(CornerLook::blended(
                            looks,
                            weights.map(|weight| weight as f32),
                        ))
                    }
                }
            })
        })
        .collect();
    (looks, corner_looks)
}

/// Barycentric coordinates of the point of a triangle that is nearest to a point of its plane; the nearest corner's in a
/// triangle without area.
fn weights(point: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
    // Exact where it matters most.
    for (corner, place) in [a, b, c].into_iter().enumerate() {
        if place == point {
            return std::array::from_fn(|index| f64::from(u8::from(index == corner)));
        }
    }
    let normal = (b - a).cross(c - a);
    let twice_area = normal.length_squared();
    let part = |from: DVec3, to: DVec3| (to - from).cross(point - from).dot(normal) / twice_area;
    let weights = [part(b, c), part(c, a), part(a, b)];
    if weights.iter().all(|weight| weight.is_finite()) {
        let weights = weights.map(|weight| weight.clamp(0.0, 1.0));
        let sum: f64 = weights.iter().sum();
        if sum > 0.0 {
            return weights.map(|weight| weight / sum);
        }
    }
    let nearest = [a, b, c].map(|corner| corner.distance(point));
    let least = nearest.iter().copied().fold(f64::INFINITY, f64::min);
    let first = nearest.iter().position(|&distance| distance == least);
    std::array::from_fn(|index| f64::from(u8::from(Some(index) == first)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::Mesh;

    fn look(u: f32, v: f32) -> CornerLook {
        CornerLook {
            uv: [Vec2::new(u, v); 2],
            color: Vec4::new(u, v, 0.0, 1.0),
            ..CornerLook::default()
        }
    }

    fn raw(vertices: [u32; 3]) -> RawTriangle {
        RawTriangle {
            vertices,
            normals: [None; 3],
            material: 0,
        }
    }

    #[test]
    fn places_are_merged_and_seams_stay() {
        // A square of two triangles with vertices of their own: along the diagonal u jumps.
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::ONE,
            Vec3::ZERO,
            Vec3::ONE,
            Vec3::Y,
        ];
        let looks = RawLooks {
            looks: vec![
                look(0.0, 0.0),
                look(1.0, 0.0),
                look(1.0, 1.0),
                look(0.5, 0.0),
                look(0.5, 1.0),
                look(0.0, 1.0),
            ],
            corners: vec![[0, 1, 2], [3, 4, 5]],
        };
        let triangles = [raw([0, 1, 2]), raw([3, 4, 5])];
        let (mesh, report) = Mesh::weld_with_looks(&positions, &triangles, &looks, 0.5);
        assert_eq!((mesh.positions.len(), report.merged_vertices), (4, 2));
        for (triangle, corners) in mesh.corner_looks.iter().enumerate() {
            let found = corners.map(|index| mesh.looks[index as usize].uv[0]);
            let given = looks.corners[triangle].map(|index| looks.looks[index as usize].uv[0]);
            let is_there = |uv: &Vec2| given.contains(uv);
            assert!(found.iter().all(is_there), "{found:?}");
        }
        // In a mirrored placement each corner keeps its own.
        let turned = mesh.clone().with_winding_reversed();
        for (triangle, corners) in turned.triangles.iter().enumerate() {
            for (corner, vertex) in corners.iter().enumerate() {
                let before = mesh.triangles[triangle].iter().position(|v| v == vertex);
                let before = before.expect("the same vertices");
                assert_eq!(
                    turned.corner_looks[triangle][corner],
                    mesh.corner_looks[triangle][before]
                );
            }
        }
    }

    #[test]
    fn a_cut_triangle_has_what_lies_between() {
        // The long triangle is cut where the two short ones meet.
        let positions = [Vec3::ZERO, Vec3::X * 4.0, Vec3::Y, Vec3::NEG_Y, Vec3::X];
        let given = |place: Vec3| look(place.x / 4.0, place.y);
        let triangles = [raw([0, 1, 2]), raw([0, 3, 4]), raw([4, 3, 1])];
        let looks = RawLooks {
            looks: positions.map(given).to_vec(),
            corners: triangles.map(|triangle| triangle.vertices).to_vec(),
        };
        let (mesh, report) = Mesh::weld_with_looks(&positions, &triangles, &looks, 0.0);
        assert_eq!(report.splits, 1);
        for (triangle, corners) in mesh.triangles.iter().zip(&mesh.corner_looks) {
            for (vertex, index) in triangle.iter().zip(corners) {
                let expected = given(mesh.positions[*vertex as usize]).uv[0];
                let found = mesh.looks[*index as usize].uv[0];
                assert!(found.distance(expected) < 1e-6, "{found} {expected}");
            }
        }
    }
}
