//! Meshes made finer where what a thing hides from itself varies too fast between its corners (Křivánek, Pattanaik & Žára 2004):
//! edges along which transfer is not what lies between its ends are halved, again and again.

use std::collections::{HashMap, HashSet};
use std::f64::consts::PI;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::geometry::cut_edges::{Edge, edge};
use crate::geometry::mesh::Mesh;

use super::self_occlusion::{OwnRays, OwnSpace, TRANSFERS, directions};

/// Edges shorter than this part of a thing's size are left whole: a thing that is as fine as that is fine enough.
const SHORTEST_PART: f64 = 1.0 / 24.0;
/// Where a surface enters a solid, as a floor does below a wall that was put on it, it is cut down to this part: what lies inside
/// has no light to mix in.
const SHORTEST_PART_INTO_SOLID: f64 = 1.0 / 192.0;
/// Edges longer than this part are halved whatever a thing hides from itself: what stands around it reflects light, which varies
/// from end to end.
const LONGEST_PART: f64 = 1.0 / 6.0;
/// Transfer may be off by this part of that of a place from which nothing is hidden, root mean square over all lights.
const OFF: f64 = 0.04;
/// Rays from each place that is looked at.
const RAYS: usize = 1024;
/// Part of the way to its triangle's middle at which a place is looked at: what stands on an edge would see into the other face.
const INSET: f32 = 0.05;
/// Edges are halved so many times at most, ...
const MOST_HALVINGS: usize = 9;
/// ... and no more are where so many triangles have come in, or would at once.
const MOST_ADDED: usize = 8192;
/// Of more triangles than these no transfer is looked at, which would take minutes; edges that are too long are halved.
const MOST_LOOKED_AT: usize = 16_384;

/// The edges that are halved, one set after the other, each of the mesh that the one before left.
pub type Cuts = Vec<Vec<Edge>>;

/// A place on a mesh, and its normal.
type Place = (Vec3, Vec3);

/// The transfer of a place.
type Transfer = [f32; TRANSFERS];

/// Whether a mesh has edges that [`cuts`] would look at.
pub fn is_coarse(mesh: &Mesh, space: &OwnSpace) -> bool {
    let shortest = (SHORTEST_PART * space.size(mesh)) as f32;
    let mut triangles = mesh.triangles.iter();
    mesh.held.is_empty() && triangles.any(|it| longest(mesh, space, it) > shortest)
}

/// The edges to halve so that transfer between corners is as rays find it there; `None` where `goes_on` said no before they were
/// found.
pub fn cuts(mesh: &Mesh, space: &OwnSpace, goes_on: &(dyn Fn() -> bool + Sync)) -> Option<Cuts> {
    let mut cuts = Cuts::new();
    if !is_coarse(mesh, space) {
        return Some(cuts);
    }
    let looking = Looking {
        space,
        rays: OwnRays::new(mesh, space),
        size: space.size(mesh),
        directions: directions(RAYS),
        normal_matrix: space.own_from_object.inverse().transpose(),
    };
    let most = mesh.triangles.len() + MOST_ADDED;
    let mut finer = mesh.clone();
    // (A triangle that is whole and even once is so later.)
    let mut even: HashSet<[u32; 3]> = HashSet::new();
    for _ in 0..MOST_HALVINGS {
        if finer.triangles.len() >= most {
            break;
        }
        let numbers: Vec<usize> = (0..finer.triangles.len())
            .filter(|&number| !even.contains(&finer.triangles[number]))
            .collect();
        let are_few = numbers.len() <= MOST_LOOKED_AT;
        let looked_at: Vec<Vec<Edge>> = numbers
            .par_iter()
            .map(|&number| goes_on().then(|| looking.uneven_edges(&finer, number, are_few)))
            .collect::<Option<_>>()?;
        for (&number, uneven) in numbers.iter().zip(&looked_at) {
            if uneven.is_empty() {
                even.insert(finer.triangles[number]);
            }
        }
        let edges: HashSet<Edge> = looked_at.into_iter().flatten().collect();
        if edges.is_empty() || edges.len() > MOST_ADDED {
            break;
        }
        finer = finer.with_edges_cut(&edges);
        let mut edges: Vec<Edge> = edges.into_iter().collect();
        edges.sort_unstable();
        cuts.push(edges);
    }
    Some(cuts)
}

/// The mesh with edges halved as [`cuts`] says.
pub fn finer(mesh: &Mesh, cuts: &Cuts) -> Mesh {
    let cut = |mesh: Mesh, edges: &Vec<Edge>| {
        let edges: HashSet<Edge> = edges.iter().copied().collect();
        mesh.with_edges_cut(&edges)
    };
    cuts.iter().fold(mesh.clone(), cut)
}

/// The longest edge of a triangle in its thing's own space.
fn longest(mesh: &Mesh, space: &OwnSpace, triangle: &[u32; 3]) -> f32 {
    let [a, b, c] = triangle.map(|index| space.place(mesh.positions[index as usize]));
    a.distance(b).max(b.distance(c)).max(c.distance(a))
}

/// How transfer is looked at.
struct Looking<'a> {
    space: &'a OwnSpace,
    rays: OwnRays,
    size: f64,
    directions: Vec<(DVec3, Vec<f64>)>,
    normal_matrix: glam::DMat3,
}

impl Looking<'_> {
    /// The edges of a triangle that are too long, or else, if they are looked at, along which, or on whose side, transfer is not
    /// what lies between the corners.
    fn uneven_edges(&self, mesh: &Mesh, number: usize, are_looked_at: bool) -> Vec<Edge> {
        let triangle = mesh.triangles[number];
        let normals = mesh.corner_normals[number];
        let corners: [Place; 3] = std::array::from_fn(|corner| {
            let position = mesh.positions[triangle[corner] as usize];
            (self.space.place(position), normals[corner])
        });
        let are_buried = [0, 1, 2].map(|corner| self.is_buried(&corners, corner));
        let shortest_part = match are_buried {
            [true, true, true] => return Vec::new(),
            [false, false, false] => SHORTEST_PART,
            _ => SHORTEST_PART_INTO_SOLID,
        };
        let shortest = shortest_part * self.size;
        let sides = [(0, 1), (1, 2), (2, 0)];
        let length = |(a, b): (usize, usize)| f64::from(corners[a].0.distance(corners[b].0));
        let long_enough = sides.into_iter().filter(|&side| length(side) > shortest);
        let long_enough: Vec<(usize, usize)> = long_enough.collect();
        if long_enough.is_empty() {
            return Vec::new();
        }
        let is_too_long = |side: &&(usize, usize)| length(**side) > LONGEST_PART * self.size;
        let too_long: Vec<Edge> = long_enough
            .iter()
            .filter(is_too_long)
            .map(|&(a, b)| edge(triangle[a], triangle[b]))
            .collect();
        if !too_long.is_empty() || !are_looked_at {
            return too_long;
        }
        let mut known: HashMap<[u8; 3], Transfer> = HashMap::new();
        // Places by how many eighths of each corner they have.
        let mut transfer = |parts: [u8; 3]| {
            let found = known.entry(parts);
            *found
                .or_insert_with(|| self.transfer(&corners, parts.map(|part| f32::from(part) / 8.0)))
        };
        let ends = [[8, 0, 0], [0, 8, 0], [0, 0, 8]].map(&mut transfer);
        let mut is_even = |parts: [u8; 3]| {
            let weights = parts.map(|part| f32::from(part) / 8.0);
            is_between(&transfer(parts), &ends, weights)
        };
        // What lies amid a face is seen from no edge.
        let is_even_amid = is_even([3, 3, 2]) && is_even([2, 3, 3]) && is_even([3, 2, 3]);
        let mut uneven = |&(a, b): &(usize, usize)| {
            let mut middle = [0; 3];
            (middle[a], middle[b]) = (4, 4);
            !is_even_amid || !is_even(middle)
        };
        let uneven = long_enough.iter().filter(|side| uneven(side));
        uneven
            .map(|&(a, b)| edge(triangle[a], triangle[b]))
            .collect()
    }

    /// Whether a corner lies in a solid that the surface has around it.
    fn is_buried(&self, corners: &[Place; 3], corner: usize) -> bool {
        let mut weights = [0.0; 3];
        weights[corner] = 1.0;
        let (place, normal) = self.between(corners, weights);
        let [a, b, c] = corners.map(|(place, _)| place.as_dvec3());
        let is_turned = (b - a).cross(c - a).dot(normal) < 0.0;
        self.rays.is_buried(place, normal, is_turned)
    }

    /// The transfer of a place between a triangle's corners.
    fn transfer(&self, corners: &[Place; 3], weights: [f32; 3]) -> Transfer {
        let (place, normal) = self.between(corners, weights);
        self.rays
            .occlusion(place, normal, &self.directions)
            .transfer
    }

    /// A place between a triangle's corners, a little off its edges, and the unit normal there.
    fn between(&self, corners: &[Place; 3], weights: [f32; 3]) -> (DVec3, DVec3) {
        let mixed = |of: fn(&Place) -> Vec3| -> Vec3 {
            corners
                .iter()
                .zip(weights)
                .map(|(corner, weight)| of(corner) * weight)
                .sum()
        };
        let middle = corners.iter().map(|(place, _)| *place).sum::<Vec3>() / 3.0;
        let place = mixed(|(place, _)| *place).lerp(middle, INSET);
        let normal = self.normal_matrix * mixed(|(_, normal)| *normal).as_dvec3();
        (place.as_dvec3(), normal.normalize_or_zero())
    }
}

/// Whether transfer is about what lies between that of three corners.
fn is_between(found: &Transfer, corners: &[Transfer; 3], weights: [f32; 3]) -> bool {
    let squares = (0..TRANSFERS).map(|index| {
        let parts = corners.iter().zip(weights);
        let between: f32 = parts.map(|(corner, weight)| corner[index] * weight).sum();
        f64::from(found[index] - between).powi(2)
    });
    // The square of a cosine over the hemisphere.
    squares.sum::<f64>() < OFF * OFF * 2.0 * PI / 3.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::self_occlusion::OwnSurface;
    use crate::geometry::cuboid::cuboid;
    use crate::geometry::mesh::tests::welded;
    use glam::{DAffine3, DMat3};

    /// A floor and a wall, open at their backs.
    fn corner() -> Mesh {
        let positions = [
            Vec3::ZERO,
            Vec3::X,
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::Y,
            Vec3::Z,
            Vec3::new(0.0, 1.0, 1.0),
        ];
        welded(&positions, &[[0, 1, 2], [0, 2, 3], [0, 3, 5], [0, 5, 4]])
    }

    /// How far transfer between the corners of a mesh is off what rays find, at places on the floor, root mean square as a part of
    /// what a place has from which nothing is hidden.
    fn off(mesh: &Mesh, whole: &Mesh) -> f64 {
        let space = OwnSpace::new(&DAffine3::IDENTITY);
        let looking = Looking {
            space: &space,
            rays: OwnRays::new(whole, &space),
            size: space.size(whole),
            directions: directions(RAYS),
            normal_matrix: DMat3::IDENTITY,
        };
        let (mut squares, mut count) = (0.0, 0.0);
        for (number, triangle) in mesh.triangles.iter().enumerate() {
            let normals = mesh.corner_normals[number];
            let corners = [0, 1, 2].map(|it| (mesh.positions[triangle[it] as usize], normals[it]));
            if normals[0].z < 0.9 {
                continue;
            }
            let [a, b, c] = corners.map(|(place, _)| place);
            let area = f64::from((b - a).cross(c - a).length());
            let ends = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
            let ends = ends.map(|weights| looking.transfer(&corners, weights));
            for step in 0..12 {
                let (u, v) = ((step as f32 * 0.618) % 1.0, (step as f32 + 0.5) / 12.0);
                let weights = [1.0 - u.sqrt(), u.sqrt() * (1.0 - v), u.sqrt() * v];
                let found = looking.transfer(&corners, weights);
                let far = (0..TRANSFERS).map(|index| {
                    let between: f32 = (0..3).map(|end| ends[end][index] * weights[end]).sum();
                    f64::from(found[index] - between).powi(2)
                });
                squares += area * far.sum::<f64>();
                count += area;
            }
        }
        (squares / count / (2.0 * PI / 3.0)).sqrt()
    }

    #[test]
    fn between_the_corners_of_a_finer_mesh_is_what_rays_find() {
        let whole = corner();
        let space = OwnSpace::new(&DAffine3::IDENTITY);
        let cuts = cuts(&whole, &space, &|| true).expect("nobody stops it");
        let finer = finer(&whole, &cuts);
        let [before, after] = [&whole, &finer].map(|mesh| off(mesh, &whole));
        assert!(after < OFF && after < 0.3 * before, "{before} {after}");
        assert!(finer.triangles.len() < 1000, "{}", finer.triangles.len());
        assert_eq!(super::cuts(&whole, &space, &|| false), None);
    }

    #[test]
    fn what_hides_nothing_from_itself_is_cut_for_what_is_around_alone() {
        let (positions, triangles) = crate::geometry::cuboid::cuboid(Vec3::ZERO, Vec3::ONE);
        let cube = welded(&positions, &triangles);
        let space = OwnSpace::new(&DAffine3::from_rotation_x(0.4));
        let cuts = cuts(&cube, &space, &|| true).expect("nobody stops it");
        let finer = finer(&cube, &cuts);
        // Quarters of its sides, of which no edge is longer than a sixth of its diagonal, √3.
        assert_eq!(finer.triangles.len(), 6 * 2 * 4 * 4 * 2);
    }

    /// A floor of two triangles, and a wall that was put on it, whose foot no edge of the floor follows.
    fn wall_on_floor() -> Mesh {
        let (mut positions, mut triangles) =
            cuboid(Vec3::new(0.48, 0.0, 0.0), Vec3::new(0.56, 1.0, 0.6));
        let first = positions.len() as u32;
        positions.extend([Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
        triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
        welded(&positions, &triangles)
    }

    #[test]
    fn what_is_buried_below_a_wall_darkens_nothing_beside_it() {
        let mesh = wall_on_floor();
        let space = OwnSpace::new(&DAffine3::IDENTITY);
        let cuts = cuts(&mesh, &space, &|| true).expect("nobody stops it");
        let finer = finer(&mesh, &cuts);
        let surface = OwnSurface::new(&mesh, std::iter::once(&finer), &space);
        let occlusions = surface.self_occlusions();
        let rays = OwnRays::new(&mesh, &space);
        let directions = directions(RAYS);
        let (mut squares, mut count) = (0.0, 0.0);
        for (number, triangle) in finer.triangles.iter().enumerate() {
            let places = triangle.map(|corner| finer.positions[corner as usize]);
            let normal = finer.corner_normals[number][0];
            let is_floor = normal.z > 0.9 && places.iter().all(|place| place.z == 0.0);
            let middle = places.iter().sum::<Vec3>() / 3.0;
            let is_below_wall = (0.47..=0.57).contains(&middle.x);
            if !is_floor || is_below_wall {
                continue;
            }
            let found = [0, 1, 2].map(|corner| {
                let point = surface.point_of_corner[3 * number + corner];
                f64::from(occlusions[point].transfer[0]) / 3.0
            });
            let expected = rays.occlusion(middle.as_dvec3(), DVec3::Z, &directions);
            let off = found.iter().sum::<f64>() - f64::from(expected.transfer[0]);
            let [a, b, c] = places;
            let area = f64::from((b - a).cross(c - a).length());
            squares += area * off * off;
            count += area;
        }
        // (What sees all of one light has a transfer of 0.89.)
        let off = (squares / count).sqrt() / 0.89;
        assert!(off < 0.02, "{off}, {} triangles", finer.triangles.len());
    }
}
