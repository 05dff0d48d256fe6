//! How far pictures and colours slide on a coarser version of a mesh: the texture deviation of Cohen, Olano & Manocha 1998
//! (*Appearance-Preserving Simplification*), at the vertices that went.

use glam::{DVec2, DVec3, Vec2, Vec4};
use rayon::prelude::*;

use super::{Simplifier, metres_of_picture};
use crate::geometry::bounds::Bounds;
use crate::geometry::looks::weights;
use crate::geometry::mesh::Mesh;
use crate::geometry::surface_distance::{GoesOn, NearestTriangle};

/// Vertices that are looked at in one go.
const CHUNK: usize = 1024;

/// How far what lies on a surface is off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PictureShift {
    /// How far a picture slides, metres.
    pub max_m: f64,
    /// The largest difference between colours at corners, of 1.
    pub color: f32,
}

impl PictureShift {
    /// Nothing is off.
    pub const NONE: Self = Self {
        max_m: 0.0,
        color: 0.0,
    };

    fn max(self, other: Self) -> Self {
        Self {
            max_m: self.max_m.max(other.max_m),
            color: self.color.max(other.color),
        }
    }
}

/// A mesh's charts: the parts over which a picture goes on without a seam.
pub struct Charts<'a> {
    simplifier: &'a Simplifier<'a>,
    /// For each vertex the number of its chart.
    of_vertex: Vec<usize>,
    /// The vertices of each chart.
    vertices: Vec<Vec<u32>>,
    /// Metres of the mesh for a unit of texture coordinates, on the average.
    metres_of_picture: f64,
}

impl<'a> Charts<'a> {
    /// The charts of a mesh as the simplifier takes it.
    pub fn new(simplifier: &'a Simplifier<'a>) -> Self {
        let count = simplifier.vertex_positions.len();
        let mut root: Vec<usize> = (0..count).collect();
        for triangle in simplifier.indices.as_chunks::<3>().0 {
            let [a, b, c] = triangle.map(|vertex| root_of(&mut root, vertex as usize));
            let least = a.min(b).min(c);
            for joined in [a, b, c] {
                root[joined] = least;
            }
        }
        let (mut number, mut vertices) = (vec![usize::MAX; count], Vec::new());
        let mut of_vertex = Vec::with_capacity(count);
        for vertex in 0..count {
            let root = root_of(&mut root, vertex);
            if number[root] == usize::MAX {
                number[root] = vertices.len();
                vertices.push(Vec::new());
            }
            vertices[number[root]].push(vertex as u32);
            of_vertex.push(number[root]);
        }
        Self {
            simplifier,
            of_vertex,
            vertices,
            metres_of_picture: metres_of_picture(simplifier.source),
        }
    }

    /// How far what lies on the mesh is off on a coarser one, whose vertices these are, three for each triangle.
    /// Anything, where `goes_on` says no.
    pub fn shift(&self, coarse: &[u32], goes_on: GoesOn<'_>) -> PictureShift {
        let mut triangles: Vec<Vec<[u32; 3]>> = vec![Vec::new(); self.vertices.len()];
        let mut stays = vec![false; self.of_vertex.len()];
        for triangle in coarse.as_chunks::<3>().0 {
            triangles[self.of_vertex[triangle[0] as usize]].push(*triangle);
            triangle
                .iter()
                .for_each(|&vertex| stays[vertex as usize] = true);
        }
        let charts = self.vertices.par_iter().zip(&triangles);
        let shifts = charts.map(|(vertices, coarse)| {
            let gone = || vertices.iter().filter(|vertex| !stays[**vertex as usize]);
            match (gone().next(), coarse.is_empty()) {
                (None, _) => PictureShift::NONE,
                (Some(_), true) => self.of_lost_chart(vertices),
                (Some(_), false) => self.in_chart((vertices, &stays), coarse, goes_on),
            }
        });
        shifts.reduce(|| PictureShift::NONE, PictureShift::max)
    }

    fn place(&self, vertex: u32) -> DVec3 {
        let position = self.simplifier.vertex_positions[vertex as usize];
        self.simplifier.source.positions[position as usize].as_dvec3()
    }

    /// What a chart showed that is not there any more is off by its size.
    fn of_lost_chart(&self, vertices: &[u32]) -> PictureShift {
        let bounds = Bounds::around(vertices.iter().map(|&vertex| self.place(vertex)));
        PictureShift {
            max_m: bounds.map_or(0.0, |bounds| (bounds.high - bounds.low).length()),
            ..PictureShift::NONE
        }
    }

    /// At those of a chart's vertices that went, on the triangles that are left of it.
    fn in_chart(
        &self,
        (vertices, stays): (&[u32], &[bool]),
        coarse: &[[u32; 3]],
        goes_on: GoesOn<'_>,
    ) -> PictureShift {
        let nearest = |place: &dyn Fn(u32) -> DVec3| {
            let corners = coarse.iter().flatten().map(|&vertex| place(vertex));
            NearestTriangle::new(&Mesh {
                positions: corners.map(|corner| corner.as_vec3()).collect(),
                triangles: (0..coarse.len() as u32)
                    .map(|at| [0, 1, 2].map(|it| 3 * at + it))
                    .collect(),
                ..Mesh::default()
            })
        };
        let in_space = nearest(&|vertex| self.place(vertex));
        // What shows one texel is nowhere off, a set that a file does not have among it; and of triangles that all lie in one
        // place none can be found faster than by asking each.
        let in_pictures = [0, 1].map(|set| {
            let shows_more = self.shows_more_than_a_texel(vertices, set);
            shows_more.then(|| nearest(&|vertex| self.in_picture(vertex, set)))
        });
        let shifts = vertices.par_chunks(CHUNK).map(|vertices| {
            if !goes_on() {
                return PictureShift::NONE;
            }
            let mut search = in_space.search();
            let mut searches =
                (in_pictures.each_ref()).map(|set| set.as_ref().map(|set| (set, set.search())));
            let gone = vertices.iter().filter(|vertex| !stays[**vertex as usize]);
            let shifts = gone.map(|&vertex| {
                let at = in_space.in_mesh(search.nearest(self.place(vertex)));
                let (near, color) = self.beside(vertex, coarse[at]);
                let mut of_set = |set: usize| {
                    let Some((in_picture, search)) = &mut searches[set] else {
                        return 0.0;
                    };
                    let found = search.nearest(self.in_picture(vertex, set));
                    let triangle = coarse[in_picture.in_mesh(found)];
                    near[set].min(found.distance_m + self.shown_m(vertex, triangle, set))
                };
                PictureShift {
                    max_m: of_set(0).max(of_set(1)),
                    color,
                }
            });
            shifts.fold(PictureShift::NONE, PictureShift::max)
        });
        shifts.reduce(|| PictureShift::NONE, PictureShift::max)
    }

    fn shows_more_than_a_texel(&self, vertices: &[u32], set: usize) -> bool {
        let uv = |vertex: &u32| self.simplifier.looks[*vertex as usize].uv[set];
        let least = vertices.iter().map(uv).fold(Vec2::INFINITY, Vec2::min);
        let most = vertices.iter().map(uv).fold(Vec2::NEG_INFINITY, Vec2::max);
        f64::from((most - least).max_element()) > UNSEEN
    }

    /// A vertex's texture coordinates as a place on the picture, as large as it lies on the mesh.
    fn in_picture(&self, vertex: u32, set: usize) -> DVec3 {
        let uv = self.simplifier.looks[vertex as usize].uv[set];
        uv.as_dvec2().extend(0.0) * self.metres_of_picture
    }

    /// How far a vertex is from where a coarse triangle shows what it showed: right but where a picture lies on a chart twice.
    fn shown_m(&self, vertex: u32, triangle: [u32; 3], set: usize) -> f64 {
        let corners = triangle.map(|corner| self.in_picture(corner, set));
        let weights = weights(self.in_picture(vertex, set), corners);
        let shown: DVec3 = (0..3)
            .map(|at| self.place(triangle[at]) * weights[at])
            .sum();
        shown.distance(self.place(vertex))
    }

    /// How far on the coarse triangle that is nearest to a vertex it is to what the vertex showed, by each set of texture
    /// coordinates, and how far the colour is off: right but where the triangle lies across a seam.
    fn beside(&self, vertex: u32, triangle: [u32; 3]) -> ([f64; 2], f32) {
        let corners = triangle.map(|corner| self.place(corner));
        let weights = weights(self.place(vertex), corners);
        let own = &self.simplifier.looks[vertex as usize];
        let looks = triangle.map(|corner| &self.simplifier.looks[corner as usize]);
        let color: Vec4 = (0..3).map(|at| looks[at].color * weights[at] as f32).sum();
        let of_set = |set: usize| {
            let uv = looks.map(|look| look.uv[set].as_dvec2());
            let there: DVec2 = (0..3).map(|at| uv[at] * weights[at]).sum();
            slid_m(own.uv[set].as_dvec2() - there, uv, corners)
        };
        ([0, 1].map(of_set), (color - own.color).abs().max_element())
    }
}

/// Texture coordinates that differ by less than this show the same: some two texels of most pictures.
const UNSEEN: f64 = 1.0 / 1024.0;

/// How far it is on a triangle's plane to where texture coordinates differ by so much, metres; without end where they are
/// everywhere the same.
fn slid_m(difference: DVec2, [u, v, w]: [DVec2; 3], [a, b, c]: [DVec3; 3]) -> f64 {
    let beyond = (difference.abs() - UNSEEN).max(DVec2::ZERO);
    let difference = beyond * difference.signum();
    if difference == DVec2::ZERO {
        return 0.0;
    }
    let (along, across) = (v - u, w - u);
    let area = along.perp_dot(across);
    let [first, second] = [
        difference.perp_dot(across) / area,
        along.perp_dot(difference) / area,
    ];
    let slid_m = ((b - a) * first + (c - a) * second).length();
    if slid_m.is_finite() {
        slid_m
    } else {
        f64::INFINITY
    }
}

/// The least vertex that is known to be joined to one.
fn root_of(root: &mut [usize], mut vertex: usize) -> usize {
    while root[vertex] != vertex {
        root[vertex] = root[root[vertex]];
        vertex = root[vertex];
    }
    vertex
}
