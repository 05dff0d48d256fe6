//! Levels of detail: coarser versions of a mesh, with a measured bound on how far any outline of them is off, and the
//! choice among them by the pixel.
//!
//! If no point of either of two surfaces lies farther than e from the other, then so it is for their projections, from
//! wherever they are seen: where one covers a point of the picture and the other does not, the outline of the latter
//! passes within the projection of e. A shadow's edge is an outline seen from the light. Hence a level may stand for
//! its mesh as long as e stays below the pixel that counts, and nothing but e has to be known of it. The simplifier's
//! own estimate is no such bound; e is measured. Where pictures or colours lie on a mesh, e counts how far these slide as well
//! (`picture_shift`).

mod picture_shift;

use std::collections::{HashMap, HashSet};

use glam::{DVec3, Vec3};
use meshopt::{SimplifyOptions, VertexDataAdapter, simplify_with_attributes_and_locks};

use super::bounds::Bounds;
use super::mesh::{CornerLook, Mesh};
use super::normals::face_normal;
use super::soup::{by_edge, edge_uses};
use super::surface_distance::{GoesOn, SampledSurface};
use picture_shift::{Charts, PictureShift};

/// A coarser version of a mesh. Its vertices are some of the mesh's.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// Closed if the mesh is.
    pub mesh: Mesh,
    /// No point of either surface lies farther from the other, so no outline is off by more, metres; as
    /// [`SampledSurface::distance_to`] finds it. Nor does a picture on it slide by more.
    pub max_error_m: f64,
    /// How far outlines are off on the average over their length and over all directions of view, metres.
    pub mean_error_m: f64,
    /// Longest edge of the triangles that bend smoothly into a neighbour, metres: so far may the line move at which they
    /// turn away from a light.
    pub largest_facet_m: f64,
}

/// Below so many triangles a mesh has no levels: there is nothing to save.
const WORTH_IT: usize = 500;
/// No level has fewer triangles.
const FEWEST: usize = 32;
/// A level must have at most this part of the triangles of the one before, else the chain ends.
const LARGEST_PART: f64 = 0.8;
/// The largest error, as a part of the mesh's diagonal.
const LARGEST_ERROR: f64 = 0.05;
/// What a unit of difference between normals counts for, against a displacement by the mesh's size.
const NORMAL_WEIGHT: f32 = 0.05;
/// The same of how far a picture slides.
const PICTURE_WEIGHT: f64 = 3.0;
/// The same of a unit of difference between colours at corners.
const COLOR_WEIGHT: f32 = 0.2;
/// Colours at corners are nowhere off by more, of 1.
const LARGEST_COLOR_ERROR: f32 = 0.04;
/// Where more triangles than these share an edge, as the pages of a book do, there are no levels: the simplifier takes the square
/// of their number.
const MOST_ON_AN_EDGE: usize = 2000;
/// Where more corners than these meet in a vertex, ...
const MOST_CORNERS: usize = 256;
/// ... those whose faces are turned alike to a part of this count as one.
const DIRECTION_STEPS: f64 = 16.0;
/// The mean error may be this part of the largest one that a pixel allows: a mask is right to 0.02 % only if its edges
/// are right to a tenth of a pixel nearly everywhere.
const MEAN_TO_MAX: f64 = 1.0 / 12.0;

/// Ever coarser versions of a mesh, each with about half the triangles of the one before; the mesh itself is not among
/// them. Any soup of triangles will do: a version that is no good is left out.
pub fn levels(mesh: &Mesh) -> Vec<Level> {
    levels_while(mesh, &|| true)
}

/// The same, as far as it is when `goes_on` says no.
pub fn levels_while(mesh: &Mesh, goes_on: GoesOn<'_>) -> Vec<Level> {
    if mesh.triangles.len() < WORTH_IT || has_crowded_edge(mesh) {
        return Vec::new();
    }
    chain(mesh, FEWEST, goes_on)
}

/// Whether a level may stand for its mesh where outlines, in the picture or of its shadow, are off by `max_px` at most
/// and by `mean_px` on the average.
pub fn is_close_enough(max_px: f64, mean_px: f64, max_silhouette_error_px: f64) -> bool {
    max_px < max_silhouette_error_px && mean_px < max_silhouette_error_px * MEAN_TO_MAX
}

fn chain(mesh: &Mesh, fewest: usize, goes_on: GoesOn<'_>) -> Vec<Level> {
    let mut levels = Vec::new();
    let bounds = Bounds::around(mesh.positions.iter().map(|position| position.as_dvec3()));
    let (Some(surface), Some(bounds)) = (SampledSurface::new(mesh), bounds) else {
        return levels;
    };
    let largest_error_m = LARGEST_ERROR * (bounds.high - bounds.low).length();
    let closed = mesh.closed_and_consistent();
    let simplifier = Simplifier::new(mesh);
    let charts = (!mesh.looks.is_empty()).then(|| Charts::new(&simplifier));
    let mut indices = simplifier.indices.clone();
    loop {
        let count = indices.len() / 3;
        if count / 2 < fewest || !goes_on() {
            return levels;
        }
        indices = simplifier.simplified(&indices, count / 2);
        if indices.len() / 3 > (count as f64 * LARGEST_PART) as usize || indices.is_empty() {
            return levels;
        }
        let Some(coarse) = simplifier.mesh(&indices) else {
            continue;
        };
        if coarse.closed_and_consistent() != closed {
            continue;
        }
        let Some(distance) =
            SampledSurface::new(&coarse).and_then(|coarse| surface.distance_to(&coarse, goes_on))
        else {
            return levels;
        };
        let shift = charts
            .as_ref()
            .map(|charts| charts.shift(&indices, goes_on));
        let shift = shift.unwrap_or(PictureShift::NONE);
        if !goes_on() {
            return levels;
        }
        let max_error_m = distance.max_m.max(shift.max_m);
        if max_error_m > largest_error_m || shift.color > LARGEST_COLOR_ERROR {
            return levels;
        }
        levels.push(Level {
            largest_facet_m: largest_facet_m(&coarse),
            mesh: coarse,
            max_error_m,
            mean_error_m: distance.outline_mean_m,
        });
    }
}

fn has_crowded_edge(mesh: &Mesh) -> bool {
    let uses = edge_uses(mesh.triangles.iter().copied());
    by_edge(&uses).any(|around| around.len() > MOST_ON_AN_EDGE)
}

fn largest_facet_m(mesh: &Mesh) -> f64 {
    /// Cosines of the angles between neighbours' normals: from flat to a crease, 0.3° to 30°.
    const BENDS: std::ops::Range<f64> = 0.866..0.999_986;
    let normal = |triangle: u32| face_normal(&mesh.positions, mesh.triangles[triangle as usize]);
    let longest_edge_m = |triangle: u32| {
        let corner = |index: u32| mesh.positions[index as usize].as_dvec3();
        let [a, b, c] = mesh.triangles[triangle as usize].map(corner);
        a.distance(b).max(b.distance(c)).max(c.distance(a))
    };
    let uses = edge_uses(mesh.triangles.iter().copied());
    by_edge(&uses)
        .filter_map(|around| match around {
            [one, other] => Some([one.triangle, other.triangle]),
            _ => None,
        })
        .filter(|[one, other]| BENDS.contains(&normal(*one).dot(normal(*other))))
        .flatten()
        .map(longest_edge_m)
        .fold(0.0, f64::max)
}

/// A mesh as the simplifier takes it. A vertex is a position with a material, texture coordinates and a colour, so that materials
/// and what lies on them keep their borders; the simplifier knows by itself which vertices share a position and keeps them
/// together.
struct Simplifier<'a> {
    source: &'a Mesh,
    /// Index of each vertex's position.
    vertex_positions: Vec<u32>,
    vertex_materials: Vec<u32>,
    positions: Vec<[f32; 3]>,
    /// Mean normal at each vertex, and then the texture coordinates of both sets and the colour that the simplifier is to keep, all
    /// weighted.
    attributes: Vec<f32>,
    /// For each vertex what its corners have for pictures and colours, but for tangents; empty where the mesh has none.
    looks: Vec<CornerLook>,
    indices: Vec<u32>,
    face_normals: Vec<DVec3>,
    /// 1 where each corner has the normal of its face, as phantoms do, -1 where each has the opposite, as mirrored
    /// phantoms do; `None` otherwise.
    flat: Option<f64>,
    /// For each vertex its corners, or such as stand for them, from `corner_starts[vertex]` on: triangle and corner.
    corners: Vec<(u32, usize)>,
    corner_starts: Vec<usize>,
}

impl<'a> Simplifier<'a> {
    fn new(source: &'a Mesh) -> Self {
        let keyed = keyed_corners(source);
        let uv_scale = uv_scale(source);
        let mut vertex_positions = Vec::new();
        let mut vertex_materials = Vec::new();
        let mut attributes = Vec::new();
        let mut looks = Vec::new();
        let mut indices = vec![0; keyed.len()];
        let mut corner_starts = vec![0];
        for vertex in keyed.chunk_by(|one, two| one.0 == two.0) {
            let mut sum = Vec3::ZERO;
            for &(_, triangle, corner) in vertex {
                indices[3 * triangle as usize + corner] = vertex_positions.len() as u32;
                sum += source.corner_normals[triangle as usize][corner];
            }
            let ([position, material, _], triangle, corner) = vertex[0];
            vertex_positions.push(position);
            vertex_materials.push(material);
            attributes.extend((sum.normalize_or_zero() * NORMAL_WEIGHT).to_array());
            if let Some(corners) = source.corner_looks.get(triangle as usize) {
                let look = source.looks[corners[corner] as usize];
                let uv = look.uv.map(|uv| (uv * uv_scale).to_array());
                attributes.extend(uv.as_flattened());
                attributes.extend((look.color * COLOR_WEIGHT).to_array());
                looks.push(look);
            }
            corner_starts.push(corner_starts[corner_starts.len() - 1] + vertex.len());
        }
        let face_normals: Vec<DVec3> = source
            .triangles
            .iter()
            .map(|triangle| face_normal(&source.positions, *triangle))
            .collect();
        let flat = [1.0, -1.0].into_iter().find(|side| {
            let own = |face: DVec3, corners: &[Vec3; 3]| {
                face == DVec3::ZERO || *corners == [(face * *side).as_vec3(); 3]
            };
            face_normals
                .iter()
                .zip(&source.corner_normals)
                .all(|(face, corners)| own(*face, corners))
        });
        Self {
            positions: vertex_positions
                .iter()
                .map(|&position| source.positions[position as usize].to_array())
                .collect(),
            source,
            vertex_positions,
            vertex_materials,
            attributes,
            looks,
            indices,
            face_normals,
            flat,
            corners: keyed
                .into_iter()
                .map(|(_, triangle, corner)| (triangle, corner))
                .collect(),
            corner_starts,
        }
        .with_fewer_corners()
    }

    /// With one corner of each direction alone at vertices where many triangles meet, as in a disc's middle: each triangle there
    /// looks through all of them.
    fn with_fewer_corners(mut self) -> Self {
        let mut corners = Vec::with_capacity(self.corners.len());
        let mut starts = vec![0];
        for range in self.corner_starts.windows(2) {
            let all = &self.corners[range[0]..range[1]];
            let mut directions = HashSet::new();
            let is_new = |&&(triangle, _): &&(u32, usize)| {
                let direction = self.face_normals[triangle as usize] * DIRECTION_STEPS;
                directions.insert(direction.round().as_ivec3())
            };
            match all.len() > MOST_CORNERS {
                true => corners.extend(all.iter().filter(is_new)),
                false => corners.extend(all),
            }
            starts.push(corners.len());
        }
        (self.corners, self.corner_starts) = (corners, starts);
        self
    }

    /// Indices of a coarser mesh with about `triangles` triangles.
    fn simplified(&self, indices: &[u32], triangles: usize) -> Vec<u32> {
        let positions = VertexDataAdapter::new(
            bytemuck::cast_slice(&self.positions),
            size_of::<[f32; 3]>(),
            0,
        );
        let Ok(positions) = positions else {
            return Vec::new();
        };
        let parts = self.attributes.len() / self.positions.len();
        simplify_with_attributes_and_locks(
            indices,
            &positions,
            &self.attributes,
            &vec![1.0; parts],
            parts * size_of::<f32>(),
            &vec![false; self.positions.len()],
            3 * triangles,
            // The error is measured afterwards.
            f32::MAX,
            SimplifyOptions::None,
            None,
        )
    }

    /// The mesh of these triangles, with the source's normals and materials; `None` if a triangle mixes materials.
    fn mesh(&self, indices: &[u32]) -> Option<Mesh> {
        // The source is mended already, and wound as its placement wants it.
        let (triangles, _) = indices.as_chunks::<3>();
        let mut mesh = Mesh {
            positions: self.source.positions.clone(),
            ..Mesh::default()
        };
        for &vertices in triangles {
            let corners = vertices.map(|vertex| self.vertex_positions[vertex as usize]);
            let [material, second, third] =
                vertices.map(|vertex| self.vertex_materials[vertex as usize]);
            if material != second || material != third {
                return None;
            }
            let face = face_normal(&self.source.positions, corners);
            mesh.triangles.push(corners);
            mesh.triangle_materials.push(material);
            let sources = vertices.map(|vertex| self.likest_corner(vertex, face));
            let normal = |(triangle, corner): (u32, usize)| match self.flat {
                Some(side) => (face * side).as_vec3(),
                None => self.source.corner_normals[triangle as usize][corner],
            };
            mesh.corner_normals.push(sources.map(normal));
            if !self.looks.is_empty() {
                mesh.corner_looks.push(
                    sources.map(|(triangle, corner)| {
                        self.source.corner_looks[triangle as usize][corner]
                    }),
                );
            }
        }
        mesh.looks.clone_from(&self.source.looks);
        Some(mesh.without_unused_positions().without_unused_looks())
    }

    /// Of the source's corners at a vertex the one whose face is turned most like `face`: so creases stay, and what is smooth
    /// stays smooth.
    fn likest_corner(&self, vertex: u32, face: DVec3) -> (u32, usize) {
        let [start, end] = [vertex, vertex + 1].map(|vertex| self.corner_starts[vertex as usize]);
        let likeness =
            |(triangle, _): &(u32, usize)| self.face_normals[*triangle as usize].dot(face);
        self.corners[start..end]
            .iter()
            .max_by(|one, two| likeness(one).total_cmp(&likeness(two)))
            .copied()
            .unwrap_or_default()
    }
}

/// Each corner with what makes its vertex (position, material, and the number of its texture coordinates and colour among all),
/// its triangle and its place there; in the order of the vertices.
fn keyed_corners(source: &Mesh) -> Vec<([u32; 3], u32, usize)> {
    let mut numbers: HashMap<[u32; 8], u32> = HashMap::new();
    let look_numbers: Vec<u32> = source
        .looks
        .iter()
        .map(|look| {
            let [[a, b], [c, d]] = look.uv.map(|uv| uv.to_array());
            let [red, green, blue, alpha] = look.color.to_array();
            let next = numbers.len() as u32;
            // (Adding 0 makes 0 of -0.)
            let key = [a, b, c, d, red, green, blue, alpha].map(|part| (part + 0.0).to_bits());
            *numbers.entry(key).or_insert(next)
        })
        .collect();
    let mut keyed = Vec::with_capacity(3 * source.triangles.len());
    for (triangle, corners) in source.triangles.iter().enumerate() {
        let material = source.triangle_materials[triangle];
        for (corner, &position) in corners.iter().enumerate() {
            let looks = source.corner_looks.get(triangle);
            let look = looks.map_or(0, |looks| look_numbers[looks[corner] as usize]);
            keyed.push(([position, material, look], triangle as u32, corner));
        }
    }
    keyed.sort_unstable();
    keyed
}

/// Metres of a mesh for a unit of texture coordinates, on the average; 0 where it has none.
fn metres_of_picture(source: &Mesh) -> f64 {
    let (mut uv_area, mut area) = (0.0, 0.0);
    for (triangle, looks) in source.triangles.iter().zip(&source.corner_looks) {
        let [a, b, c] = triangle.map(|index| source.positions[index as usize].as_dvec3());
        let [u, v, w] = looks.map(|look| source.looks[look as usize].uv[0].as_dvec2());
        area += (b - a).cross(c - a).length();
        uv_area += (v - u).perp_dot(w - u).abs();
    }
    let metres = (area / uv_area).sqrt();
    if metres.is_finite() { metres } else { 0.0 }
}

/// What a unit of texture coordinates counts for, against a displacement by the mesh's size: as far as the picture slides, over
/// that size.
fn uv_scale(source: &Mesh) -> f32 {
    let around = Bounds::around(source.positions.iter().map(|position| position.as_dvec3()));
    let size = around.map_or(0.0, |around| (around.high - around.low).max_element());
    match size > 0.0 {
        true => (PICTURE_WEIGHT * metres_of_picture(source) / size) as f32,
        false => 0.0,
    }
}

#[cfg(test)]
mod tests;
