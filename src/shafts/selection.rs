//! n sources that stand for all that may be hidden (Gibson et al. 2003, section 8): nodes of the source tree, the one with
//! the largest transfer cut first. The light of all is kept.

use std::collections::BinaryHeap;

use glam::{Mat3, Vec3};

use super::source_tree::SourceTree;

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

/// Up to `count` representatives for the sources, which come in the tree's order. Nodes whose sources weigh less than
/// `least_weight` together are not cut: no eye could tell.
pub fn representatives(
    tree: &SourceTree,
    sources: &[WeighedSource],
    count: usize,
    least_weight: f32,
) -> Vec<Representative> {
    let Some(root) = tree.nodes.first() else {
        return Vec::new();
    };
    let mut sums = vec![0.0_f64];
    for source in sources {
        sums.push(sums[sums.len() - 1] + f64::from(source.weight));
    }
    let weight = |node: u32| {
        let node = &tree.nodes[node as usize];
        (sums[node.last as usize] - sums[node.first as usize]) as f32
    };
    if count == 0 || sums[root.last as usize] <= 0.0 {
        return Vec::new();
    }
    let candidate = |node: u32| Candidate {
        priority: weight(node),
        node,
    };
    let mut open = BinaryHeap::from([candidate(0)]);
    let mut closed = Vec::new();
    while open.len() + closed.len() < count {
        let Some(Candidate { priority, node }) = open.pop() else {
            break;
        };
        match tree.nodes[node as usize].children {
            Some(children) if priority > least_weight => {
                let lit = children.into_iter().filter(|&child| weight(child) > 0.0);
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
    let represent = |node: u32| {
        let node = &tree.nodes[node as usize];
        let range = node.first as usize..node.last as usize;
        represent(&sources[range], node.first, node.last)
    };
    nodes.into_iter().map(represent).collect()
}

fn represent(sources: &[WeighedSource], first: u32, last: u32) -> Representative {
    let weight: f32 = sources.iter().map(|source| source.weight).sum();
    let share = weight.max(f32::MIN_POSITIVE).recip();
    let middle = sources
        .iter()
        .map(|source| source.center * (source.weight * share));
    let position: Vec3 = middle.sum();
    let spread = sources.iter().fold(Mat3::ZERO, |sum, source| {
        let off = source.center - position;
        let about = Mat3::from_cols(off * off.x, off * off.y, off * off.z);
        sum + (source.spread + about) * (source.weight * share)
    });
    Representative {
        first,
        last,
        position,
        spread,
        weight,
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
    use crate::shafts::source_tree::Source;

    fn scene() -> (SourceTree, Vec<WeighedSource>) {
        let corners = |index: u32| {
            let place = Vec3::new((index * 7 % 11) as f32, (index * 5 % 13) as f32, 2.0);
            [place, place + Vec3::X * 0.1, place + Vec3::Y * 0.1]
        };
        let sources = (0..60).map(|patch| Source {
            patch,
            corners: corners(patch),
            power: 1.0 + (patch * 3 % 5) as f32,
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
            let chosen = representatives(&tree, &sources, count, 0.0);
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
            let root = representatives(&tree, &sources, 1, 0.0)[0];
            assert!(middle.distance(root.position) < 1e-3);
        }
        assert!(representatives(&tree, &sources, 0, 0.0).is_empty());
    }

    #[test]
    fn the_largest_transfer_is_cut_first_and_what_nobody_sees_never() {
        let (tree, sources) = scene();
        let few = representatives(&tree, &sources, 12, 0.0);
        let many = representatives(&tree, &sources, 13, 0.0);
        let cut = few.iter().filter(|one| !many.contains(one));
        let cut: Vec<_> = cut.collect();
        assert_eq!(cut.len(), 1);
        let largest = few
            .iter()
            .filter(|one| one.last - one.first > 1)
            .map(|one| one.weight)
            .fold(0.0, f32::max);
        assert_eq!(cut[0].weight, largest);
        let coarse = representatives(&tree, &sources, 1000, 200.0);
        assert!(coarse.len() < 20 && coarse.iter().all(|one| one.weight <= 200.0));
    }

    #[test]
    fn a_triangles_second_moments_are_those_of_its_area() {
        // Of the right triangle with legs 1: the variance along a leg is 1/18, the covariance -1/36.
        let spread = triangle_spread([Vec3::ZERO, Vec3::X, Vec3::Y]);
        assert!((spread.x_axis.x - 1.0 / 18.0).abs() < 1e-6);
        assert!((spread.x_axis.y + 1.0 / 36.0).abs() < 1e-6);
    }
}
