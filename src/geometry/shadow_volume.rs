//! Shadow volumes: the space that a mesh hides from a light, as a closed surface reaching to infinity
//! (Crow 1977; Everitt & Kilgard 2002, section 3; Kim, Kim & Turk 2008 for meshes that are not closed).
//!
//! The volume of one triangle is its cap turned to the light, the same cap cast to infinity, and three sides. A mesh's
//! volume is the sum over its triangles; sides that two triangles share cancel, so only edges with a net *signed
//! multiplicity* keep a side. For a closed, well-wound mesh the triangles facing the light are enough and the edges
//! that remain are its silhouette, each once.

use std::collections::HashMap;

use glam::{DVec3, Vec3, Vec4};

/// Where a light is, in the mesh's own space.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum LightPlace {
    /// A point, metres.
    Point(DVec3),
    /// Unit direction in which distant light travels.
    Along(DVec3),
}

impl LightPlace {
    /// As a homogeneous point: a distant light lies at infinity against its direction.
    fn homogeneous(self) -> (DVec3, f64) {
        match self {
            Self::Point(position) => (position, 1.0),
            Self::Along(direction) => (-direction, 0.0),
        }
    }
}

/// A mesh prepared for casting shadows: welded triangles, their planes, and which triangles meet at each edge.
#[derive(Debug, Clone)]
pub struct Caster {
    positions: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    /// Unnormalised plane of each triangle: `dot(normal, p) = offset` on it.
    planes: Vec<(DVec3, f64)>,
    /// Vertex indices of each edge, the smaller one first.
    edges: Vec<[u32; 2]>,
    /// For each edge the range of its entries in `edge_triangles`, as a start; one more at the end.
    edge_starts: Vec<u32>,
    /// Triangle, and whether it runs along the edge from the smaller index to the larger.
    edge_triangles: Vec<(u32, bool)>,
    closed: bool,
}

impl Caster {
    /// Prepares a mesh whose equal positions share one index. Any soup of triangles will do.
    pub fn new(positions: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> Self {
        let planes = triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|index| positions[index as usize].as_dvec3());
                let normal = (b - a).cross(c - a);
                (normal, normal.dot(a))
            })
            .collect();

        let mut index_of_edge: HashMap<[u32; 2], u32> = HashMap::new();
        let mut edges = Vec::new();
        let mut incidences: Vec<(u32, u32, bool)> = Vec::new();
        for (triangle_index, &[a, b, c]) in triangles.iter().enumerate() {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let key = [from.min(to), from.max(to)];
                let edge = *index_of_edge.entry(key).or_insert_with(|| {
                    edges.push(key);
                    edges.len() as u32 - 1
                });
                incidences.push((edge, triangle_index as u32, from < to));
            }
        }
        incidences.sort_unstable();
        let mut edge_starts = vec![0; edges.len() + 1];
        for &(edge, _, _) in &incidences {
            edge_starts[edge as usize + 1] += 1;
        }
        for edge in 0..edges.len() {
            edge_starts[edge + 1] += edge_starts[edge];
        }
        let edge_triangles: Vec<(u32, bool)> = incidences
            .into_iter()
            .map(|(_, triangle, forward)| (triangle, forward))
            .collect();
        let closed = !edges.is_empty()
            && edge_starts.windows(2).all(|range| {
                let around = &edge_triangles[range[0] as usize..range[1] as usize];
                around.iter().filter(|(_, forward)| *forward).count() * 2 == around.len()
            });
        Self {
            positions,
            triangles,
            planes,
            edges,
            edge_starts,
            edge_triangles,
            closed,
        }
    }

    /// Whether each edge is run along as often one way as the other, so that a ray that enters the mesh leaves it
    /// again and the triangles facing the light are enough.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Homogeneous vertices for [`Caster::volume_indices`]: the mesh's own (w = 1), then each cast away from the
    /// light to infinity (w = 0).
    pub fn volume_vertices(&self, light: LightPlace) -> Vec<Vec4> {
        let near = self.positions.iter().map(|position| position.extend(1.0));
        let far = self.positions.iter().map(|position| match light {
            LightPlace::Point(light) => (position.as_dvec3() - light).as_vec3().extend(0.0),
            LightPlace::Along(direction) => direction.as_vec3().extend(0.0),
        });
        near.chain(far).collect()
    }

    /// Triangles of the closed shadow volume, counter-clockwise seen from outside it, as indices into
    /// [`Caster::volume_vertices`].
    ///
    /// The near cap is made of the mesh's own triangles with their own vertex order, so that it covers the same
    /// pixels at the same depths as the mesh does.
    pub fn volume_indices(&self, light: LightPlace) -> Vec<u32> {
        let (light_point, light_weight) = light.homogeneous();
        // +1: the triangle casts as it is wound; -1: it casts turned over; 0: it does not cast.
        let casts: Vec<i8> = self
            .planes
            .iter()
            .map(|(normal, offset)| {
                let faces_light = normal.dot(light_point) - offset * light_weight > 0.0;
                match (faces_light, self.closed) {
                    (true, _) => 1,
                    (false, true) => 0,
                    (false, false) => -1,
                }
            })
            .collect();

        let far = self.positions.len() as u32;
        let point_light = matches!(light, LightPlace::Point(_));
        let mut indices = Vec::with_capacity(6 * self.triangles.len());
        for (&[a, b, c], &cast) in self.triangles.iter().zip(&casts) {
            let (b, c) = match cast {
                0 => continue,
                1 => (b, c),
                _ => (c, b),
            };
            indices.extend([a, b, c]);
            // Parallel light meets itself in one point at infinity: there is no far cap to draw.
            if point_light {
                indices.extend([far + a, far + c, far + b]);
            }
        }
        for (edge, &[a, b]) in self.edges.iter().enumerate() {
            let around = self.edge_starts[edge] as usize..self.edge_starts[edge + 1] as usize;
            let multiplicity: i32 = self.edge_triangles[around]
                .iter()
                .map(|&(triangle, forward)| {
                    let cast = i32::from(casts[triangle as usize]);
                    if forward { cast } else { -cast }
                })
                .sum();
            // The caps run from `from` to `to`; the side must run back.
            let (from, to) = if multiplicity > 0 { (a, b) } else { (b, a) };
            for _ in 0..multiplicity.unsigned_abs() {
                indices.extend([to, from, far + from]);
                if point_light {
                    indices.extend([to, far + from, far + to]);
                }
            }
        }
        indices
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube() -> Caster {
        let positions = (0..8)
            .map(|corner| {
                Vec3::new(
                    (corner & 1) as f32,
                    (corner >> 1 & 1) as f32,
                    (corner >> 2 & 1) as f32,
                )
            })
            .collect();
        let triangles = vec![
            [0, 2, 3],
            [0, 3, 1],
            [4, 5, 7],
            [4, 7, 6],
            [0, 1, 5],
            [0, 5, 4],
            [2, 6, 7],
            [2, 7, 3],
            [0, 4, 6],
            [0, 6, 2],
            [1, 3, 7],
            [1, 7, 5],
        ];
        Caster::new(positions, triangles)
    }

    /// How often each directed edge is used, less the uses of its opposite; all points at infinity of a distant light
    /// are one point.
    fn boundary(indices: &[u32], vertices: &[Vec4], distant: bool) -> usize {
        let name = |index: u32| {
            if distant && vertices[index as usize].w == 0.0 {
                u32::MAX
            } else {
                index
            }
        };
        let mut uses: HashMap<(u32, u32), i32> = HashMap::new();
        for triangle in indices.chunks(3) {
            for (from, to) in [(0, 1), (1, 2), (2, 0)] {
                let (from, to) = (name(triangle[from]), name(triangle[to]));
                if from != to {
                    *uses.entry((from.min(to), from.max(to))).or_default() +=
                        if from < to { 1 } else { -1 };
                }
            }
        }
        uses.values().filter(|&&count| count != 0).count()
    }

    fn lights() -> Vec<LightPlace> {
        vec![
            LightPlace::Point(DVec3::new(3.0, 2.0, 5.0)),
            LightPlace::Point(DVec3::new(0.5, 0.5, 0.5)),
            LightPlace::Point(DVec3::new(0.2, 0.3, 40.0)),
            LightPlace::Point(DVec3::new(1.0, 1.0, 2.0)),
            LightPlace::Along(DVec3::new(0.0, 0.0, -1.0)),
            LightPlace::Along(DVec3::new(0.48, -0.6, 0.64)),
        ]
    }

    #[test]
    fn the_volume_is_closed_for_every_light_and_any_soup() {
        let closed = cube();
        let mut open = cube();
        open.triangles.truncate(9);
        open.triangles.push([0, 1, 7]);
        open.triangles.push([7, 1, 3]);
        let open = Caster::new(open.positions, open.triangles);
        assert!(closed.is_closed() && !open.is_closed());
        for caster in [&closed, &open] {
            for light in lights() {
                let distant = matches!(light, LightPlace::Along(_));
                let open_edges = boundary(
                    &caster.volume_indices(light),
                    &caster.volume_vertices(light),
                    distant,
                );
                assert_eq!(open_edges, 0, "{light:?}");
            }
        }
    }

    #[test]
    fn a_cube_lit_from_above_has_the_outline_of_its_top() {
        let light = LightPlace::Along(DVec3::new(0.0, 0.0, -1.0));
        // Two triangles of cap, four sides that meet at infinity.
        assert_eq!(cube().volume_indices(light).len() / 3, 2 + 4);
    }

    #[test]
    fn the_winding_number_tells_shadow_from_light() {
        // A ray from a point in shadow, away from everything, crosses the volume once outward.
        let caster = cube();
        let light = LightPlace::Point(DVec3::new(0.4, 0.3, 5.0));
        let (vertices, indices) = (caster.volume_vertices(light), caster.volume_indices(light));
        let far = 1e4;
        let place = |index: u32| {
            let vertex = vertices[index as usize];
            if vertex.w == 0.0 {
                DVec3::new(0.4, 0.3, 5.0) + vertex.truncate().as_dvec3() * far
            } else {
                vertex.truncate().as_dvec3()
            }
        };
        let crossings = |origin: DVec3| -> i32 {
            let direction = DVec3::new(1.0, 0.123, 0.0456);
            indices
                .chunks(3)
                .map(|t| {
                    let [a, b, c] = [place(t[0]), place(t[1]), place(t[2])];
                    let normal = (b - a).cross(c - a);
                    let distance = normal.dot(a - origin) / normal.dot(direction);
                    let hit = origin + direction * distance;
                    let inside = [(a, b), (b, c), (c, a)]
                        .iter()
                        .all(|(p, q)| (*q - *p).cross(hit - *p).dot(normal) >= 0.0);
                    if distance > 0.0 && inside {
                        normal.dot(direction).signum() as i32
                    } else {
                        0
                    }
                })
                .sum()
        };
        assert_eq!(crossings(DVec3::new(0.5, 0.5, -1.0)), 1);
        assert_eq!(crossings(DVec3::new(0.5, 0.5, 2.0)), 0);
        assert_eq!(crossings(DVec3::new(-3.0, 0.5, -1.0)), 0);
    }
}
