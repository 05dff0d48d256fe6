//! The sources of light in a kd-tree down to one patch (Gibson et al. 2003, section 6).

use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::bounding::Aabb;

/// A source of light before it has its place in the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PatchSource {
    /// Index of its patch.
    pub patch: u32,
    /// Corners of its patch, metres.
    pub corners: [Vec3; 3],
    /// Luminous power, in any unit.
    pub power: f32,
    /// Luminance, in any unit.
    pub luminance: f32,
}

/// A node: the sources `first..last` in the tree's order.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SourceNode {
    /// First source.
    pub first: u32,
    /// Past the last source.
    pub last: u32,
    /// Both children; a node of one source has none.
    pub children: Option<[u32; 2]>,
    /// Around its patches.
    pub bounds: Aabb,
}

/// The tree; the root is node 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct SourceTree {
    /// All nodes; children come after their parents.
    pub nodes: Vec<SourceNode>,
    /// Patches in the tree's order.
    pub patches: Vec<u32>,
}

impl SourceTree {
    /// Sorts sources into a tree: those that differ much in brightness are parted first, so that no lamp is one with the
    /// ceiling that it hangs from; then those that stand apart.
    pub fn new(mut sources: Vec<PatchSource>) -> Self {
        let mut tree = Self::default();
        if !sources.is_empty() {
            tree.build(&mut sources, 0);
        }
        tree.patches = sources.iter().map(|source| source.patch).collect();
        tree
    }

    fn build(&mut self, sources: &mut [PatchSource], first: u32) -> u32 {
        let index = self.nodes.len() as u32;
        self.nodes.push(SourceNode {
            first,
            last: first + sources.len() as u32,
            children: None,
            bounds: Aabb::around(sources.iter().flat_map(|source| source.corners)),
        });
        if sources.len() > 1 {
            let cut = cut_by_brightness(sources).unwrap_or_else(|| cut(sources));
            let (low, high) = sources.split_at_mut(cut);
            let low_node = self.build(low, first);
            let high_node = self.build(high, first + cut as u32);
            self.nodes[index as usize].children = Some([low_node, high_node]);
        }
        index
    }
}

/// Brightest over darkest of sources that may stay together.
const LARGEST_CONTRAST: f32 = 4.0;

/// Sorts sources by brightness where they differ much, and returns where to cut: at the mean of their magnitudes.
fn cut_by_brightness(sources: &mut [PatchSource]) -> Option<usize> {
    let luminances = || sources.iter().map(|source| source.luminance.max(1e-12));
    let (darkest, brightest) = (
        luminances().fold(f32::MAX, f32::min),
        luminances().fold(0.0, f32::max),
    );
    (brightest > LARGEST_CONTRAST * darkest).then(|| {
        let limit = (brightest * darkest).sqrt();
        sources.sort_by(|one, other| one.luminance.total_cmp(&other.luminance));
        let dark = sources.partition_point(|source| source.luminance < limit);
        dark.clamp(1, sources.len() - 1)
    })
}

/// Sorts sources along the axis, and returns where to cut, so that both parts are as narrow as can be: the sum of their
/// second moments by power is least.
fn cut(sources: &mut [PatchSource]) -> usize {
    let middle = |source: &PatchSource| source.corners.iter().sum::<Vec3>() / 3.0;
    let mut best = (f64::INFINITY, 0, 1);
    for axis in 0..3 {
        sources.sort_by(|one, other| middle(one)[axis].total_cmp(&middle(other)[axis]));
        let forth: Vec<f64> = moments(sources.iter()).collect();
        let back: Vec<f64> = moments(sources.iter().rev()).collect();
        for count in 1..sources.len() {
            let moments = forth[count - 1] + back[sources.len() - count - 1];
            if moments < best.0 {
                best = (moments, axis, count);
            }
        }
    }
    let (_, axis, count) = best;
    sources.sort_by(|one, other| middle(one)[axis].total_cmp(&middle(other)[axis]));
    count
}

/// Second moments by power of the first source, the first two, and so on, each about its own middle.
fn moments<'a>(sources: impl Iterator<Item = &'a PatchSource>) -> impl Iterator<Item = f64> {
    let (mut power, mut first, mut second) = (0.0, DVec3::ZERO, 0.0);
    sources.map(move |source| {
        let middle = (source.corners.iter().sum::<Vec3>() / 3.0).as_dvec3();
        let weight = f64::from(source.power).max(1e-12);
        power += weight;
        first += middle * weight;
        second += middle.length_squared() * weight;
        second - first.length_squared() / power
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources() -> Vec<PatchSource> {
        (0..37)
            .map(|index| {
                let place = Vec3::new((index * 7 % 11) as f32, (index * 5 % 13) as f32, 2.0);
                PatchSource {
                    patch: index,
                    corners: [place, place + Vec3::X, place + Vec3::Y],
                    power: 1.0 + (index * 3 % 5) as f32,
                    luminance: 1.0,
                }
            })
            .collect()
    }

    #[test]
    fn every_source_is_once_among_the_leaves_and_in_all_nodes_above() {
        let tree = SourceTree::new(sources());
        let mut patches = tree.patches.clone();
        patches.sort_unstable();
        assert_eq!(patches, (0..37).collect::<Vec<_>>());
        assert_eq!(tree.nodes.len(), 2 * 37 - 1);
        for node in &tree.nodes {
            match node.children {
                None => assert_eq!(node.last, node.first + 1),
                Some([low, high]) => {
                    let (low, high) = (tree.nodes[low as usize], tree.nodes[high as usize]);
                    assert_eq!(
                        (node.first, low.last, node.last),
                        (low.first, high.first, high.last)
                    );
                    assert!(node.bounds.min.cmple(low.bounds.min).all());
                    assert!(node.bounds.max.cmpge(high.bounds.max).all());
                }
            }
        }
        assert!(SourceTree::new(Vec::new()).nodes.is_empty());
    }

    #[test]
    fn a_lamp_is_parted_from_the_ceiling_around_it() {
        let mut sources = sources();
        let lamp = [3, 11, 20];
        for &patch in &lamp {
            sources[patch as usize].luminance = 50.0;
        }
        let tree = SourceTree::new(sources);
        let children = tree.nodes[0].children.expect("children");
        let bright = &tree.nodes[children[1] as usize];
        let mut found = tree.patches[bright.first as usize..bright.last as usize].to_vec();
        found.sort_unstable();
        assert_eq!(found, lamp);
    }

    #[test]
    fn groups_that_stand_apart_are_parted() {
        let mut sources = sources();
        let far = [2, 5, 30, 31];
        for &patch in &far {
            let source = &mut sources[patch as usize];
            source.corners = source.corners.map(|corner| corner * 0.1 + Vec3::Y * 40.0);
        }
        let tree = SourceTree::new(sources);
        let children = tree.nodes[0].children.expect("children");
        let parts = children.map(|child| {
            let node = &tree.nodes[child as usize];
            let mut patches = tree.patches[node.first as usize..node.last as usize].to_vec();
            patches.sort_unstable();
            patches
        });
        assert!(parts.contains(&far.to_vec()), "{parts:?}");
    }
}
