//! Winds triangles alike: neighbours agree on which side is outside, and what is closed has its outside outside.

use std::collections::HashMap;

use glam::{DVec3, Vec3};

use super::soup::{EdgeUse, Sets, by_edge, edge_uses};
use super::winding::winding_number;

/// Rounds in which patches at edges of more than two triangles settle.
const SETTLING_ROUNDS: usize = 8;
/// Triangles whose solid angles are summed at most to tell cavities: some tenths of a second. A mesh that needs more
/// has thousands of parts inside out, and those are taken for mistakes.
const MOST_SOLID_ANGLES: usize = 10_000_000;

/// Which triangles have to be turned so that
/// - triangles that meet at an edge of two pass it in opposite directions, where the surface is orientable (it stays as
///   it is where not, as a Moebius strip), turning as few as possible;
/// - edges with more triangles are balanced where turning a whole patch does that;
/// - each closed part faces outwards, but for a cavity: a part that faces inwards inside another.
pub(super) fn turned_triangles(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<bool> {
    let uses = edge_uses(triangles.iter().copied());
    let mut patches = SurfacePatches::flood(&uses, triangles.len());
    patches.settle(&uses);
    let parts = patches.closed_parts(&uses);
    patches.face_outwards(positions, triangles, &parts);
    patches.turned
}

/// Triangles joined over edges that have just two.
struct SurfacePatches {
    /// For each triangle whether it has to be turned.
    turned: Vec<bool>,
    patch_of: Vec<u32>,
    patches: Vec<SurfacePatch>,
}

struct SurfacePatch {
    triangles: Vec<u32>,
    orientable: bool,
}

/// What a patch passes an edge of more than two triangles by.
struct Rim {
    patch: u32,
    edge: usize,
    sum: i64,
}

impl SurfacePatches {
    fn flood(uses: &[EdgeUse], count: usize) -> Self {
        // Up to three neighbours of each triangle, and whether both pass the common edge the same way.
        let mut neighbours: Vec<[Option<(u32, bool)>; 3]> = vec![[None; 3]; count];
        let mut link = |from: &EdgeUse, to: &EdgeUse| {
            let free = neighbours[from.triangle as usize]
                .iter_mut()
                .find(|neighbour| neighbour.is_none());
            if let Some(free) = free {
                *free = Some((to.triangle, from.forward == to.forward));
            }
        };
        for around in by_edge(uses) {
            if let [one, other] = around {
                link(one, other);
                link(other, one);
            }
        }
        const NONE: u32 = u32::MAX;
        let mut flooded = Self {
            turned: vec![false; count],
            patch_of: vec![NONE; count],
            patches: Vec::new(),
        };
        for seed in 0..count as u32 {
            if flooded.patch_of[seed as usize] != NONE {
                continue;
            }
            let number = flooded.patches.len() as u32;
            flooded.patch_of[seed as usize] = number;
            let mut triangles = vec![seed];
            let mut orientable = true;
            let mut next = 0;
            while let Some(&triangle) = triangles.get(next) {
                next += 1;
                let own = flooded.turned[triangle as usize];
                for (other, same_way) in neighbours[triangle as usize].into_iter().flatten() {
                    let place = other as usize;
                    if flooded.patch_of[place] == NONE {
                        flooded.patch_of[place] = number;
                        flooded.turned[place] = own != same_way;
                        triangles.push(other);
                    } else {
                        orientable &= flooded.turned[place] == (own != same_way);
                    }
                }
            }
            let turned = triangles
                .iter()
                .filter(|&&triangle| flooded.turned[triangle as usize])
                .count();
            flooded.patches.push(SurfacePatch {
                triangles,
                orientable,
            });
            if !orientable {
                for &triangle in &flooded.patches[number as usize].triangles {
                    flooded.turned[triangle as usize] = false;
                }
            } else if 2 * turned > flooded.patches[number as usize].triangles.len() {
                flooded.turn(number);
            }
        }
        flooded
    }

    fn turn(&mut self, patch: u32) {
        for &triangle in &self.patches[patch as usize].triangles {
            self.turned[triangle as usize] ^= true;
        }
    }

    fn sign(&self, edge_use: &EdgeUse) -> i64 {
        let turned = self.turned[edge_use.triangle as usize];
        edge_use.sign() * if turned { -1 } else { 1 }
    }

    /// What each patch leaves unbalanced at edges of more than two triangles, sorted by patch.
    fn rims(&self, uses: &[EdgeUse]) -> Vec<Rim> {
        let mut rims = Vec::new();
        for (edge, around) in by_edge(uses).enumerate() {
            if around.len() <= 2 {
                continue;
            }
            let mut signs: Vec<(u32, i64)> = around
                .iter()
                .map(|edge_use| {
                    (
                        self.patch_of[edge_use.triangle as usize],
                        self.sign(edge_use),
                    )
                })
                .collect();
            signs.sort_unstable();
            for own in signs.chunk_by(|a, b| a.0 == b.0) {
                let (patch, sum) = (own[0].0, own.iter().map(|(_, sign)| sign).sum());
                if sum != 0 {
                    rims.push(Rim { patch, edge, sum });
                }
            }
        }
        rims.sort_by_key(|rim| rim.patch);
        rims
    }

    /// Turns whole patches as long as that balances edges of more than two triangles.
    fn settle(&mut self, uses: &[EdgeUse]) {
        let mut rims = self.rims(uses);
        let mut total: HashMap<usize, i64> = HashMap::new();
        for rim in &rims {
            *total.entry(rim.edge).or_default() += rim.sum;
        }
        for _ in 0..SETTLING_ROUNDS {
            let mut settled = true;
            for own in rims.chunk_by_mut(|a, b| a.patch == b.patch) {
                let patch = own[0].patch;
                let gain: i64 = own
                    .iter()
                    .map(|rim| {
                        let before = total[&rim.edge];
                        i64::from(before != 0) - i64::from(before != 2 * rim.sum)
                    })
                    .sum();
                if gain <= 0 || !self.patches[patch as usize].orientable {
                    continue;
                }
                for rim in own {
                    *total.entry(rim.edge).or_default() -= 2 * rim.sum;
                    rim.sum = -rim.sum;
                }
                self.turn(patch);
                settled = false;
            }
            if settled {
                return;
            }
        }
    }

    /// The triangles of each closed part: a patch, or several that balance each other at edges of more than two.
    fn closed_parts(&self, uses: &[EdgeUse]) -> Vec<Vec<u32>> {
        let mut parts = Sets::new(self.patches.len());
        let mut total: HashMap<usize, (u32, i64)> = HashMap::new();
        for rim in self.rims(uses) {
            let (first, sum) = total.entry(rim.edge).or_insert((rim.patch, 0));
            *sum += rim.sum;
            parts.join(*first, rim.patch);
        }
        let mut open = vec![false; self.patches.len()];
        for around in by_edge(uses).filter(|around| around.len() <= 2) {
            if around
                .iter()
                .map(|edge_use| self.sign(edge_use))
                .sum::<i64>()
                != 0
            {
                let patch = self.patch_of[around[0].triangle as usize];
                open[parts.least(patch) as usize] = true;
            }
        }
        for &(patch, sum) in total.values() {
            open[parts.least(patch) as usize] |= sum != 0;
        }
        let mut triangles: Vec<Vec<u32>> = vec![Vec::new(); self.patches.len()];
        for (number, patch) in (0..).zip(&self.patches) {
            let part = parts.least(number) as usize;
            if !open[part] {
                triangles[part].extend(&patch.triangles);
            }
        }
        triangles.retain(|part| !part.is_empty());
        triangles
    }

    /// Turns closed parts that face inwards, the largest first, and leaves those that hollow out a larger one.
    fn face_outwards(&mut self, positions: &[Vec3], triangles: &[[u32; 3]], parts: &[Vec<u32>]) {
        let mut shells: Vec<Shell> = parts
            .iter()
            .map(|part| {
                let wound = part.iter().map(|&triangle| self.wound(triangles, triangle));
                Shell::new(positions, part, wound)
            })
            .collect();
        if shells.iter().all(|shell| shell.volume_m3 >= 0.0) {
            return;
        }
        shells.sort_by(|a, b| b.volume_m3.abs().total_cmp(&a.volume_m3.abs()));
        let mut solid_angles = 0;
        for (index, shell) in shells.iter().enumerate() {
            if shell.volume_m3 >= 0.0 {
                continue;
            }
            let around = shells[..index].iter().filter(|outer| {
                let (low, high) = outer.bounds;
                low.cmple(shell.inner_point).all() && high.cmpge(shell.inner_point).all()
            });
            let mut turns = 0.0;
            for outer in around {
                solid_angles += outer.triangles.len();
                if solid_angles > MOST_SOLID_ANGLES {
                    break;
                }
                let wound = outer
                    .triangles
                    .iter()
                    .map(|&triangle| self.wound(triangles, triangle));
                turns += winding_number(positions, wound, shell.inner_point);
            }
            if turns < 0.5 {
                for &triangle in shell.triangles {
                    self.turned[triangle as usize] ^= true;
                }
            }
        }
    }

    fn wound(&self, triangles: &[[u32; 3]], triangle: u32) -> [u32; 3] {
        let [a, b, c] = triangles[triangle as usize];
        if self.turned[triangle as usize] {
            [a, c, b]
        } else {
            [a, b, c]
        }
    }
}

/// A closed part as it lies in space.
struct Shell<'a> {
    triangles: &'a [u32],
    volume_m3: f64,
    bounds: (DVec3, DVec3),
    /// A point of it that is no vertex, for others may touch it there.
    inner_point: DVec3,
}

impl<'a> Shell<'a> {
    fn new(
        positions: &[Vec3],
        triangles: &'a [u32],
        wound: impl Iterator<Item = [u32; 3]>,
    ) -> Self {
        let mut shell = Self {
            triangles,
            volume_m3: 0.0,
            bounds: (DVec3::INFINITY, DVec3::NEG_INFINITY),
            inner_point: DVec3::ZERO,
        };
        let mut origin = None;
        for corners in wound {
            let [a, b, c] = corners.map(|index| positions[index as usize].as_dvec3());
            // From a point of its own: far from the origin the terms would drown each other.
            let origin = *origin.get_or_insert_with(|| {
                shell.inner_point = (a + b + c) / 3.0;
                a
            });
            shell.volume_m3 += (a - origin).dot((b - origin).cross(c - origin)) / 6.0;
            for point in [a, b, c] {
                shell.bounds = (shell.bounds.0.min(point), shell.bounds.1.max(point));
            }
        }
        shell
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::cuboid::cuboid;
    use std::f32::consts::{PI, TAU};

    fn boxed(low: f32, high: f32, first: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (positions, triangles) = cuboid(Vec3::splat(low), Vec3::splat(high));
        let later = |corners: [u32; 3]| corners.map(|corner| first + corner);
        (positions, triangles.into_iter().map(later).collect())
    }

    fn inside_out(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        triangles.iter().map(|&[a, b, c]| [a, c, b]).collect()
    }

    fn turned(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<usize> {
        let turned = turned_triangles(positions, triangles);
        (0..triangles.len())
            .filter(|&index| turned[index])
            .collect()
    }

    #[test]
    fn whatever_is_turned_in_a_box_is_turned_back() {
        let (positions, triangles) = boxed(0.0, 1.0, 0);
        for pattern in 0..1_usize << triangles.len() {
            let mut damaged = triangles.clone();
            let wrong: Vec<usize> = (0..12).filter(|&index| pattern >> index & 1 == 1).collect();
            for &index in &wrong {
                damaged[index].swap(0, 1);
            }
            assert_eq!(turned(&positions, &damaged), wrong);
        }
    }

    #[test]
    fn an_open_sheet_turns_as_few_as_possible() {
        let positions: Vec<Vec3> = (0..12)
            .map(|index| Vec3::new((index % 2) as f32, (index / 2) as f32, 0.0))
            .collect();
        let strip: Vec<[u32; 3]> = (0..5)
            .flat_map(|row| {
                let first = 2 * row;
                [[first, first + 1, first + 3], [first, first + 3, first + 2]]
            })
            .collect();
        assert!(turned(&positions, &strip).is_empty());
        for wrong in [[0, 7], [5, 7]] {
            let mut damaged = strip.clone();
            for index in wrong {
                damaged[index].swap(1, 2);
            }
            assert_eq!(turned(&positions, &damaged), wrong);
        }
    }

    #[test]
    fn a_moebius_strip_stays() {
        let steps = 20_u32;
        let positions: Vec<Vec3> = (0..steps)
            .flat_map(|step| {
                let azimuth = TAU * step as f32 / steps as f32;
                let tilt = azimuth / 2.0;
                [-0.3, 0.3].map(|offset: f32| {
                    let radius = 1.0 + offset * tilt.cos();
                    Vec3::new(
                        radius * azimuth.cos(),
                        radius * azimuth.sin(),
                        offset * tilt.sin(),
                    )
                })
            })
            .collect();
        // After one turn the strip has swapped its rims.
        let at = |step: u32, rim: u32| match step {
            step if step == steps => 1 - rim,
            _ => 2 * step + rim,
        };
        let triangles: Vec<[u32; 3]> = (0..steps)
            .flat_map(|step| {
                let [a, b, c, d] = [at(step, 0), at(step, 1), at(step + 1, 1), at(step + 1, 0)];
                [[a, b, c], [a, c, d]]
            })
            .collect();
        assert!(turned(&positions, &triangles).is_empty());
    }

    #[test]
    fn parts_face_outwards_but_for_cavities() {
        let (outer, outer_triangles) = boxed(-2.0, 2.0, 0);
        let (inner, inner_triangles) = boxed(-1.0, 1.0, 8);
        let positions = [outer, inner].concat();
        let both = |outer: &[[u32; 3]], inner: &[[u32; 3]]| [outer, inner].concat();
        let found = |triangles: &[[u32; 3]]| turned(&positions, triangles);
        let (outer_in, inner_in) = (inside_out(&outer_triangles), inside_out(&inner_triangles));
        let first: Vec<usize> = (0..12).collect();
        assert!(found(&both(&outer_triangles, &inner_triangles)).is_empty());
        assert!(
            found(&both(&outer_triangles, &inner_in)).is_empty(),
            "a cavity"
        );
        assert_eq!(found(&both(&outer_in, &inner_triangles)), first);
        assert_eq!(found(&both(&outer_in, &inner_in)), first, "a cavity again");
        // Beside each other there is no cavity.
        let (aside, aside_triangles) = boxed(3.0, 4.0, 8);
        let positions = [&positions[..8], &aside].concat();
        let triangles = both(&outer_triangles, &inside_out(&aside_triangles));
        assert_eq!(
            turned(&positions, &triangles),
            (12..24).collect::<Vec<usize>>()
        );
    }

    #[test]
    fn boxes_that_share_an_edge_are_turned_each() {
        let (mut positions, triangles) = boxed(0.0, 1.0, 0);
        let (other, other_triangles) = boxed(1.0, 2.0, 8);
        // The second box is moved down, so that its edge (1, 1, z) is the first one's.
        positions.extend(other.iter().map(|position| *position - Vec3::Z));
        let shared = |vertex: u32| match vertex {
            8 => 3,
            12 => 7,
            _ => vertex,
        };
        let other: Vec<[u32; 3]> = other_triangles
            .iter()
            .map(|corners| corners.map(shared))
            .collect();
        let all = |first: &[[u32; 3]], second: &[[u32; 3]]| [first, second].concat();
        assert!(turned(&positions, &all(&triangles, &other)).is_empty());
        let found = turned(&positions, &all(&triangles, &inside_out(&other)));
        assert_eq!(found, (12..24).collect::<Vec<usize>>());
        let found = turned(
            &positions,
            &all(&inside_out(&triangles), &inside_out(&other)),
        );
        assert_eq!(found, (0..24).collect::<Vec<usize>>());
    }

    #[test]
    fn patches_at_an_edge_of_four_settle() {
        // Four quarters of a cross about the z axis that agree in pairs, one of them wound against them.
        let positions: Vec<Vec3> = [Vec3::ZERO, Vec3::Z]
            .into_iter()
            .chain((0..4).map(|quarter| {
                let azimuth = PI / 2.0 * quarter as f32;
                Vec3::new(azimuth.cos(), azimuth.sin(), 0.0)
            }))
            .collect();
        let balanced = [[0, 1, 2], [1, 0, 3], [0, 1, 4], [1, 0, 5]];
        assert!(turned(&positions, &balanced).is_empty());
        let mut damaged = balanced;
        damaged[2].swap(0, 1);
        assert_eq!(turned(&positions, &damaged).len(), 1);
    }
}
