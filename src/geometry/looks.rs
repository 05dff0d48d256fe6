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
    /// What moves it, where its model has a rig.
    pub held_by: RigPoint,
}

/// A place on a model's surface by the vertices of its rig that it lies between: one, or up to three of a triangle.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RigPoint {
    /// Numbers of vertices of the rig.
    pub vertices: [u32; 3],
    /// How much of each; their sum is 1, or 0 where there is no rig.
    pub weights: [f32; 3],
}

impl RigPoint {
    /// A vertex itself.
    pub fn at(vertex: u32) -> Self {
        Self {
            vertices: [vertex; 3],
            weights: [1.0, 0.0, 0.0],
        }
    }

    /// The vertices that count, with their weights.
    pub fn parts(&self) -> impl Iterator<Item = (u32, f32)> {
        let parts = self.vertices.into_iter().zip(self.weights);
        parts.filter(|(_, weight)| *weight != 0.0)
    }

    /// A place between places of one triangle.
    fn blended(points: [&Self; 3], weights: [f32; 3]) -> Self {
        let mut blended = Self::default();
        let mut count = 0;
        for (point, share) in points.into_iter().zip(weights) {
            for (vertex, weight) in point.parts().filter(|_| share != 0.0) {
                let known = (0..count).find(|&slot| blended.vertices[slot] == vertex);
                // (A triangle has no fourth vertex.)
                let slot = known.unwrap_or(count.min(2));
                count = count.max(slot + 1);
                blended.vertices[slot] = vertex;
                blended.weights[slot] += share * weight;
            }
        }
        blended
    }
}

impl Default for CornerLook {
    /// White, at the texture's origin.
    fn default() -> Self {
        Self {
            uv: [Vec2::ZERO; 2],
            color: Vec4::ONE,
            tangent: Vec4::ZERO,
            held_by: RigPoint::default(),
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
            held_by: RigPoint::blended(looks.map(|look| &look.held_by), weights),
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
pub(super) fn weights(point: DVec3, [a, b, c]: [DVec3; 3]) -> [f64; 3] {
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
