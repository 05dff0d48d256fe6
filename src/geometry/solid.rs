//! Whether a mesh bounds a solid: closed, its triangles turned outwards, and no part of it cut by itself. From outside
//! only the outside of such a mesh is seen (Jordan & Brouwer: each part has an inside and an outside). If fans of triangles
//! over its holes would close it so, its inside is seen through them alone.

use std::collections::HashMap;

use glam::DVec3;

use super::mesh::Mesh;
use super::soup::{Sets, by_edge, edge_uses};

/// The holes of a mesh, as triangles, wound as its own are, with which each of its parts bounds a solid; none if it does
/// so by itself. Parts may cut or hold one another. `None` if there is no such solid, and in doubt.
pub fn holes(mesh: &Mesh) -> Option<Vec<[DVec3; 3]>> {
    let mut positions: Vec<DVec3> = mesh.positions.iter().map(|p| p.as_dvec3()).collect();
    let mut triangles = mesh.triangles.clone();
    for rim in rims(&triangles)? {
        let sum: DVec3 = rim.iter().map(|&index| positions[index as usize]).sum();
        let middle = positions.len() as u32;
        positions.push(sum / rim.len() as f64);
        let next = rim.iter().cycle().skip(1);
        triangles.extend(
            rim.iter()
                .zip(next)
                .map(|(&one, &next)| [one, next, middle]),
        );
    }
    let place = |triangle: &[u32; 3]| triangle.map(|index| positions[index as usize]);
    let corners: Vec<[DVec3; 3]> = triangles.iter().map(place).collect();
    let part_of = parts(&triangles, positions.len());
    let mut volumes_m3 = vec![0.0; triangles.len()];
    for ([a, b, c], &part) in corners.iter().zip(&part_of) {
        volumes_m3[part] += a.dot(b.cross(*c)) / 6.0;
    }
    // An inward part is a cavity, or has no solid to be one of.
    let outward = !triangles.is_empty() && part_of.iter().all(|&part| volumes_m3[part] > 0.0);
    (outward && !cuts_itself(&triangles, &corners, &part_of))
        .then(|| corners[mesh.triangles.len()..].to_vec())
}

/// The closed lines of open edges, in the direction in which a triangle beyond them would pass them; `None` where an edge
/// is not passed as often one way as the other, but for these, or where such lines touch.
fn rims(triangles: &[[u32; 3]]) -> Option<Vec<Vec<u32>>> {
    let uses = edge_uses(triangles.iter().copied());
    let mut next_of = HashMap::new();
    let mut starts = Vec::new();
    for around in by_edge(&uses) {
        let balance: i64 = around.iter().map(|used| used.sign()).sum();
        let [low, high] = around[0].ends();
        let (from, to) = match balance {
            0 => continue,
            1 => (high, low),
            -1 => (low, high),
            _ => return None,
        };
        if next_of.insert(from, to).is_some() {
            return None;
        }
        starts.push(from);
    }
    let mut rims = Vec::new();
    for start in starts {
        let mut rim = Vec::new();
        let mut at = start;
        while let Some(next) = next_of.remove(&at) {
            rim.push(at);
            at = next;
        }
        if at != start {
            return None;
        }
        if !rim.is_empty() {
            rims.push(rim);
        }
    }
    Some(rims)
}

/// For each triangle the number of the first of those that it is joined to.
fn parts(triangles: &[[u32; 3]], position_count: usize) -> Vec<usize> {
    // Triangles that share a vertex without an edge are rare, and to take them for one part is to doubt more.
    let mut joined = Sets::new(position_count);
    for &[a, b, c] in triangles {
        joined.join(a, b);
        joined.join(a, c);
    }
    let mut number_of = vec![usize::MAX; position_count];
    let numbered = triangles.iter().enumerate();
    numbered
        .map(|(triangle, [a, _, _])| {
            let number = &mut number_of[joined.least(*a) as usize];
            *number = (*number).min(triangle);
            *number
        })
        .collect()
}

/// Whether two triangles of one part meet elsewhere than at vertices that they share.
fn cuts_itself(triangles: &[[u32; 3]], corners: &[[DVec3; 3]], part_of: &[usize]) -> bool {
    let low = |triangle: usize| {
        corners[triangle]
            .iter()
            .copied()
            .fold(DVec3::MAX, DVec3::min)
    };
    let high = |triangle: usize| {
        corners[triangle]
            .iter()
            .copied()
            .fold(DVec3::MIN, DVec3::max)
    };
    let boxes: Vec<(DVec3, DVec3)> = (0..corners.len()).map(|t| (low(t), high(t))).collect();
    let mut from_left: Vec<usize> = (0..corners.len()).collect();
    from_left.sort_by(|&one, &other| boxes[one].0.x.total_cmp(&boxes[other].0.x));
    // A sweep along x: those that are not left behind yet.
    let mut active: Vec<usize> = Vec::new();
    for triangle in from_left {
        let (low, high) = boxes[triangle];
        active.retain(|&other| boxes[other].1.x >= low.x);
        for &other in &active {
            let (other_low, other_high) = boxes[other];
            let apart = other_low.y > high.y
                || other_high.y < low.y
                || other_low.z > high.z
                || other_high.z < low.z;
            if !apart && part_of[triangle] == part_of[other] {
                let indices = [triangles[triangle], triangles[other]];
                if meet(indices, [&corners[triangle], &corners[other]]) {
                    return true;
                }
            }
        }
        active.push(triangle);
    }
    false
}

/// Whether an edge of one triangle that has no vertex of the other meets it.
fn meet(indices: [[u32; 3]; 2], corners: [&[DVec3; 3]; 2]) -> bool {
    let shared = |vertex: &u32| indices[0].contains(vertex) && indices[1].contains(vertex);
    if indices[0].iter().filter(|vertex| shared(vertex)).count() > 1 {
        // Neighbours: at worst folded on to each other, which encloses nothing.
        return false;
    }
    [(0, 1), (1, 0)].into_iter().any(|(edges, face)| {
        (0..3).any(|corner| {
            let next = (corner + 1) % 3;
            let touches = |corner: usize| indices[face].contains(&indices[edges][corner]);
            !touches(corner)
                && !touches(next)
                && crosses(corners[edges][corner], corners[edges][next], corners[face])
        })
    })
}

/// Whether a segment meets a triangle; true in doubt.
fn crosses(from: DVec3, to: DVec3, [a, b, c]: &[DVec3; 3]) -> bool {
    /// Rounding, as a part of the lengths involved. What single precision makes of a mesh's places does not count: a
    /// part that it turns inside out is too small for a pixel.
    const DOUBT: f64 = 1e-12;
    let normal = (*b - *a).cross(*c - *a);
    let (above, below) = (normal.dot(from - *a), normal.dot(to - *a));
    let doubt = DOUBT * normal.length() * ((from - *a).length() + (to - *a).length());
    let beside = (above > doubt && below > doubt) || (above < -doubt && below < -doubt);
    // What meets in one plane encloses nothing.
    let within = above.abs() <= doubt && below.abs() <= doubt;
    if beside || within {
        return false;
    }
    let way = to - from;
    let sides = [(a, b), (b, c), (c, a)].map(|(one, other)| {
        let volume = way.cross(*one - from).dot(*other - from);
        let doubt = DOUBT * way.length() * (*one - from).length() * (*other - from).length();
        (volume > doubt, volume < -doubt)
    });
    let left = sides.iter().any(|(left, _)| *left);
    let right = sides.iter().any(|(_, right)| *right);
    !(left && right)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::mesh::tests::welded as mesh;
    use glam::Vec3;

    fn is_solid(mesh: &Mesh) -> bool {
        holes(mesh).is_some_and(|holes| holes.is_empty())
    }

    /// A prism over a closed line of points (x, y), counter-clockwise where it bounds a solid.
    fn prism(outline: &[[f32; 2]], low_z: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let count = outline.len() as u32;
        let at = |z: f32| outline.iter().map(move |&[x, y]| Vec3::new(x, y, z));
        let middle = outline
            .iter()
            .map(|&[x, y]| Vec3::new(x, y, 0.0))
            .sum::<Vec3>()
            / count as f32;
        let mut positions: Vec<Vec3> = at(low_z).chain(at(low_z + 1.0)).collect();
        positions.extend([middle + Vec3::Z * low_z, middle + Vec3::Z * (low_z + 1.0)]);
        let triangles = (0..count).flat_map(|one| {
            let next = (one + 1) % count;
            [
                [one, next, count + next],
                [one, count + next, count + one],
                [next, one, 2 * count],
                [count + one, count + next, 2 * count + 1],
            ]
        });
        (positions, triangles.collect())
    }

    const SQUARE: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];

    #[test]
    fn a_box_is_solid_and_so_are_two_that_cut_each_other() {
        let (mut positions, mut triangles) = prism(&SQUARE, 0.0);
        assert!(is_solid(&mesh(&positions, &triangles)));
        let (others, more) = prism(&SQUARE.map(|[x, y]| [x + 0.3, y + 0.4]), 0.2);
        let first = positions.len() as u32;
        positions.extend(others);
        triangles.extend(more.iter().map(|t| t.map(|index| first + index)));
        assert!(is_solid(&mesh(&positions, &triangles)));
    }

    #[test]
    fn what_is_open_or_crosses_itself_is_not_solid() {
        let (positions, triangles) = prism(&SQUARE, 0.0);
        assert!(!is_solid(&mesh(&positions, &triangles[1..])));
        // A figure of eight: one lobe is turned inside out, though more of it is not.
        let eight = [[0.0, 0.0], [3.0, 2.0], [3.0, 0.0], [0.0, 3.0]];
        let (positions, triangles) = prism(&eight, 0.0);
        assert!(!is_solid(&mesh(&positions, &triangles)));
        assert!(!is_solid(&Mesh::default()));
    }

    #[test]
    fn a_box_with_open_ends_is_solid_but_for_them() {
        let (positions, triangles) = prism(&SQUARE, 0.0);
        // Without the bottom and the top: two rims of four edges.
        let open = |index: &usize| index % 4 < 2;
        let sides = (0..triangles.len())
            .filter(open)
            .map(|index| triangles[index]);
        let found = holes(&mesh(&positions, &sides.collect::<Vec<_>>())).expect("holes");
        assert_eq!(found.len(), 8);
        for [a, b, c] in found {
            let outward = (b - a).cross(c - a).normalize();
            let up = if a.z > 0.5 { 1.0 } else { -1.0 };
            assert!((outward - DVec3::Z * up).length() < 1e-12, "{a} {b} {c}");
        }
        // A lid that no solid lies under.
        assert!(holes(&mesh(&positions, &triangles[2..3])).is_none());
    }

    #[test]
    fn an_edge_through_a_face_is_found_however_it_lies() {
        let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let inside = DVec3::new(0.2, 0.3, 0.0);
        let up = DVec3::new(0.1, -0.05, 0.7);
        assert!(crosses(inside - up, inside + up, &face));
        assert!(crosses(inside + up, inside - up, &face));
        assert!(!crosses(inside + up, inside + 2.0 * up, &face));
        let beside = DVec3::new(0.7, 0.7, 0.0);
        assert!(!crosses(beside - up, beside + up, &face));
        assert!(!crosses(inside, inside + 0.1 * DVec3::X, &face));
        // On an edge: in doubt.
        assert!(crosses(
            DVec3::new(0.5, 0.0, -1.0),
            DVec3::new(0.5, 0.0, 1.0),
            &face
        ));
    }
}
