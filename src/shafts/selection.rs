//! n sources that stand for all that may be hidden (Gibson et al. 2003, section 8): nodes of the source tree. The light of
//! all is kept.

use std::collections::BinaryHeap;

use glam::{DMat3, DVec3, Mat3, Vec3};

use super::source_tree::{SourceNode, SourceTree};

/// The part of receivers' light, on the average, below which nodes of sources are not cut: less than a level of 255.
pub const LEAST_WEIGHT: f32 = 1.0 / 2048.0;

/// One shadow for all of a node is half as wrong as it can be where the node is seen as wide as this, in parts of its distance: the
/// wider it is the more the shadow is off, until none of it is left.
const HALF_AS_WRONG: f32 = 0.1;

/// A source as it weighs in the present frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeighedSource {
    /// Centre of its patch, metres.
    pub center: Vec3,
    /// Second moments of its patch about the centre, square metres.
    pub spread: Mat3,
    /// Mean luminance that it gives the receivers; 0 where nothing can hide it.
    pub weight: f32,
}

/// A node that stands for the marked sources in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Representative {
    /// Its sources in the tree's order.
    pub first: u32,
    /// Past its last source.
    pub last: u32,
    /// Their middle, by weight.
    pub position: Vec3,
    /// Second moments about the middle, by weight, square metres.
    pub spread: Mat3,
    /// Sum of their weights.
    pub weight: f32,
}

#[derive(PartialEq)]
struct Candidate {
    priority: f32,
    node: u32,
}

impl Eq for Candidate {}

impl Ord for Candidate {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let by_priority = self.priority.total_cmp(&other.priority);
        by_priority.then(other.node.cmp(&self.node))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Sums over the first sources of the tree, none to all: any node's moments are a difference.
struct MomentSums(Vec<Moments>);

#[derive(Clone, Copy)]
struct Moments {
    weight: f64,
    first: DVec3,
    second: DMat3,
}

impl MomentSums {
    fn new(sources: &[WeighedSource]) -> Self {
        let mut sum = Moments {
            weight: 0.0,
            first: DVec3::ZERO,
            second: DMat3::ZERO,
        };
        let mut sums = vec![sum];
        for source in sources {
            let (weight, center) = (f64::from(source.weight), source.center.as_dvec3());
            sum.weight += weight;
            sum.first += center * weight;
            sum.second += (source.spread.as_dmat3() + outer(center)) * weight;
            sums.push(sum);
        }
        Self(sums)
    }

    fn representative(&self, node: &SourceNode) -> Representative {
        let (low, high) = (self.0[node.first as usize], self.0[node.last as usize]);
        let weight = high.weight - low.weight;
        let share = weight.max(f64::MIN_POSITIVE).recip();
        let position = (high.first - low.first) * share;
        let spread = (high.second - low.second) * share - outer(position);
        Representative {
            first: node.first,
            last: node.last,
            position: position.as_vec3(),
            spread: spread.as_mat3(),
            weight: weight as f32,
        }
    }
}

fn outer(vector: DVec3) -> DMat3 {
    DMat3::from_cols(vector * vector.x, vector * vector.y, vector * vector.z)
}

/// Up to `count` representatives for the sources, which come in the tree's order, as they are seen from `casters`. A node
/// is cut by what one shadow for all of it does wrong: its weight times a part that grows with how wide it is seen, for the
/// shadow of a narrow node is right however bright it is. Nodes below `least` there are not cut: no eye could tell.
pub fn representatives(
    tree: &SourceTree,
    sources: &[WeighedSource],
    count: usize,
    least: f32,
    casters: Vec3,
) -> Vec<Representative> {
    let sums = MomentSums::new(sources);
    let all = sums.0[sources.len()].weight;
    if count == 0 || tree.nodes.is_empty() || all <= 0.0 {
        return Vec::new();
    }
    let candidate = |node: u32| {
        let one = sums.representative(&tree.nodes[node as usize]);
        let distance = one.position.distance_squared(casters).max(1e-9);
        let width = (one.spread_trace() / (2.0 * distance)).sqrt();
        let priority = one.weight * width / (width + HALF_AS_WRONG);
        Candidate { priority, node }
    };
    let weight = |node: u32| sums.representative(&tree.nodes[node as usize]).weight;
    let mut open = BinaryHeap::from([candidate(0)]);
    let mut closed = Vec::new();
    while open.len() + closed.len() < count {
        let Some(Candidate { priority, node }) = open.pop() else {
            break;
        };
        match tree.nodes[node as usize].children {
            Some(children) if priority > least => {
                // What differences of sums leave of nothing is nothing.
                let lit = children
                    .into_iter()
                    .filter(|&child| f64::from(weight(child)) > 1e-12 * all);
                open.extend(lit.map(candidate));
            }
            _ => closed.push(node),
        }
    }
    let mut nodes: Vec<u32> = open
        .into_iter()
        .map(|candidate| candidate.node)
        .chain(closed)
        .collect();
    nodes.sort_unstable_by_key(|&node| tree.nodes[node as usize].first);
    nodes
        .into_iter()
        .map(|node| sums.representative(&tree.nodes[node as usize]))
        .collect()
}

impl Representative {
    /// Sum of its variances along all axes, square metres.
    pub fn spread_trace(&self) -> f32 {
        (self.spread.x_axis.x + self.spread.y_axis.y + self.spread.z_axis.z).max(0.0)
    }
}

/// Second moments of a triangle about its centre, square metres.
pub fn triangle_spread(corners: [Vec3; 3]) -> Mat3 {
    let center = corners.iter().sum::<Vec3>() / 3.0;
    corners.iter().fold(Mat3::ZERO, |sum, corner| {
        let off = *corner - center;
        sum + Mat3::from_cols(off * off.x, off * off.y, off * off.z) * (1.0 / 12.0)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shafts::source_tree::PatchSource;

    const CASTERS: Vec3 = Vec3::new(5.0, 6.0, -1.0);

    fn scene() -> (SourceTree, Vec<WeighedSource>) {
        let corners = |index: u32| {
            let place = Vec3::new((index * 7 % 11) as f32, (index * 5 % 13) as f32, 2.0);
            [place, place + Vec3::X * 0.1, place + Vec3::Y * 0.1]
        };
        let sources = (0..60).map(|patch| PatchSource {
            patch,
            corners: corners(patch),
            power: 1.0 + (patch * 3 % 5) as f32,
            luminance: 1.0,
        });
        let tree = SourceTree::new(sources.collect());
        let weighed = tree.patches.iter().map(|&patch| WeighedSource {
            center: corners(patch).iter().sum::<Vec3>() / 3.0,
            spread: triangle_spread(corners(patch)),
            weight: if patch % 4 == 0 {
                0.0
            } else {
                0.5 + patch as f32
            },
        });
        let weighed = weighed.collect();
        (tree, weighed)
    }

    #[test]
    fn any_cut_keeps_the_light_of_all_sources() {
        let (tree, sources) = scene();
        let all: f32 = sources.iter().map(|source| source.weight).sum();
        for count in [1, 2, 7, 20, 45, 1000] {
            let chosen = representatives(&tree, &sources, count, 0.0, CASTERS);
            let sum: f32 = chosen.iter().map(|one| one.weight).sum();
            assert!((sum / all - 1.0).abs() < 1e-5, "{count}");
            // 45 of them are lit.
            assert_eq!(chosen.len(), count.min(45));
            let mut last = 0;
            for one in &chosen {
                assert!(one.first >= last && one.weight > 0.0);
                last = one.last;
            }
            // The middle of all middles is that of one representative alone.
            let middle: Vec3 = chosen
                .iter()
                .map(|one| one.position * (one.weight / all))
                .sum();
            let root = representatives(&tree, &sources, 1, 0.0, CASTERS)[0];
            assert!(middle.distance(root.position) < 1e-3);
        }
        assert!(representatives(&tree, &sources, 0, 0.0, CASTERS).is_empty());
    }

    #[test]
    fn what_one_shadow_does_most_wrong_is_cut_first_and_what_nobody_sees_never() {
        let (tree, sources) = scene();
        let few = representatives(&tree, &sources, 12, 0.0, CASTERS);
        let many = representatives(&tree, &sources, 13, 0.0, CASTERS);
        let cut: Vec<_> = few.iter().filter(|one| !many.contains(one)).collect();
        assert_eq!(cut.len(), 1);
        let wrong = |one: &Representative| {
            let members = &sources[one.first as usize..one.last as usize];
            let spread: f32 = members
                .iter()
                .map(|source| source.weight * source.center.distance_squared(one.position))
                .sum();
            (one.weight * spread / 2.0).sqrt() / one.position.distance(CASTERS)
        };
        let largest = few.iter().map(wrong).fold(0.0, f32::max);
        assert!(
            wrong(cut[0]) > 0.95 * largest,
            "{} {largest}",
            wrong(cut[0])
        );
        let coarse = representatives(&tree, &sources, 1000, 20.0, CASTERS);
        assert!((2..40).contains(&coarse.len()), "{}", coarse.len());
    }

    #[test]
    fn moments_are_those_of_the_marked_sources() {
        let (tree, sources) = scene();
        let one = representatives(&tree, &sources, 1, 0.0, CASTERS)[0];
        let all: f32 = sources.iter().map(|source| source.weight).sum();
        let mean: Vec3 = sources.iter().map(|s| s.center * (s.weight / all)).sum();
        let variance: f32 = sources
            .iter()
            .map(|s| (s.spread.x_axis.x + (s.center.x - mean.x).powi(2)) * s.weight / all)
            .sum();
        assert!(one.position.distance(mean) < 1e-4);
        assert!((one.spread.x_axis.x / variance - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_triangles_second_moments_are_those_of_its_area() {
        // Of the right triangle with legs 1: the variance along a leg is 1/18, the covariance -1/36.
        let spread = triangle_spread([Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert!((spread.x_axis.x - 1.0 / 18.0).abs() < 1e-6);
        assert!((spread.x_axis.y + 1.0 / 36.0).abs() < 1e-6);
    }
}
