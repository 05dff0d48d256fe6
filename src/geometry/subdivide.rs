//! Cuts triangles until their edges are as short as wanted, without gaps: whether an edge is cut depends on the edge alone, so
//! the triangles on either side of it agree.

use glam::Vec3;

/// A corner: its place, and its unit normal.
pub type Corner = (Vec3, Vec3);

/// Edges are halved so many times at most.
const MOST_HALVINGS: usize = 24;

/// The triangles' parts, of which no edge is longer than `longest_m` says of it, unless they became `most` before that.
///
/// `longest_m` is asked for an edge's ends in the order of their coordinates. Normals in between are of unit length.
pub fn subdivided(
    triangles: Vec<[Corner; 3]>,
    longest_m: impl Fn(Vec3, Vec3) -> f32,
    most: usize,
) -> Vec<[Corner; 3]> {
    let is_cut = |(a, _): Corner, (b, _): Corner| {
        let [low, high] = match a.to_array() <= b.to_array() {
            true => [a, b],
            false => [b, a],
        };
        low.distance(high) > longest_m(low, high)
    };
    let mut whole = Vec::new();
    let mut open = triangles;
    for _ in 0..MOST_HALVINGS {
        let mut parts = Vec::new();
        for [a, b, c] in open {
            match [is_cut(a, b), is_cut(b, c), is_cut(c, a)] {
                [false, false, false] => whole.push([a, b, c]),
                cut => cut_triangle([a, b, c], cut, &|(place, _)| place, &mut middle, &mut parts),
            }
        }
        open = parts;
        if open.is_empty() || whole.len() + open.len() >= most {
            break;
        }
    }
    whole.extend(open);
    whole
}

/// Appends the parts of a triangle of which some edges (from the first corner to the second, and so on) are halved; `place` says
/// where a corner is, `middle` gives the corner between two.
pub(super) fn cut_triangle<C: Copy>(
    [a, b, c]: [C; 3],
    cut: [bool; 3],
    place: &impl Fn(C) -> Vec3,
    middle: &mut impl FnMut(C, C) -> C,
    parts: &mut Vec<[C; 3]>,
) {
    let squared = |from: C, to: C| place(from).distance_squared(place(to));
    match cut {
        [true, true, true] => {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            parts.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        [true, false, false] => {
            let ab = middle(a, b);
            parts.extend([[a, ab, c], [ab, b, c]]);
        }
        [false, true, true] => {
            let (bc, ca) = (middle(b, c), middle(c, a));
            parts.push([ca, bc, c]);
            match squared(a, bc) < squared(b, ca) {
                true => parts.extend([[a, b, bc], [a, bc, ca]]),
                false => parts.extend([[a, b, ca], [b, bc, ca]]),
            }
        }
        [false, false, false] => parts.push([a, b, c]),
        // The others are these, turned.
        [first, second, third] => {
            cut_triangle([b, c, a], [second, third, first], place, middle, parts);
        }
    }
}

fn middle((a, of_a): Corner, (b, of_b): Corner) -> Corner {
    let normal = (of_a + of_b).try_normalize().unwrap_or(of_a);
    (0.5 * (a + b), normal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;
    use std::collections::HashMap;

    fn cube() -> Vec<[Corner; 3]> {
        let (positions, triangles) = cuboid(Vec3::ZERO, Vec3::ONE);
        let corner = |index: u32| positions[index as usize];
        triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(corner);
                let normal = (b - a).cross(c - a).normalize();
                [a, b, c].map(|place| (place, normal))
            })
            .collect()
    }

    /// Finer towards a corner of the cube.
    fn graded(a: Vec3, b: Vec3) -> f32 {
        0.02 + 0.3 * a.min_element().max(b.min_element()).max(0.0)
    }

    #[test]
    fn a_closed_surface_stays_closed_and_as_large() {
        let parts = subdivided(cube(), graded, 1_000_000);
        let mut uses: HashMap<[[u32; 3]; 2], i32> = HashMap::new();
        let bits = |place: Vec3| (place + 0.0).to_array().map(f32::to_bits);
        let mut area = 0.0;
        for [(a, _), (b, _), (c, _)] in &parts {
            area += 0.5 * f64::from((b - a).cross(c - a).length());
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *uses.entry([bits(*from), bits(*to)]).or_default() += 1;
            }
        }
        for ([from, to], count) in &uses {
            assert_eq!(Some(count), uses.get(&[*to, *from]));
        }
        let whole: f64 = cube()
            .iter()
            .map(|[(a, _), (b, _), (c, _)]| 0.5 * f64::from((b - a).cross(c - a).length()))
            .sum();
        assert!((area - whole).abs() < 1e-5 * whole, "{area} {whole}");
    }

    #[test]
    fn edges_are_as_short_as_wanted_or_the_triangles_are_enough() {
        let parts = subdivided(cube(), graded, 1_000_000);
        for [(a, _), (b, _), (c, _)] in &parts {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let [low, high] = match from.to_array() <= to.to_array() {
                    true => [*from, *to],
                    false => [*to, *from],
                };
                assert!(low.distance(high) <= graded(low, high));
            }
        }
        let few = subdivided(cube(), |_, _| 0.0, 100);
        assert!(few.len() >= 100 && few.len() <= 400, "{}", few.len());
    }
}
