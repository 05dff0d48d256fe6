//! The sources of light in a kd-tree down to one patch (Gibson et al. 2003, section 6).

use glam::Vec3;

/// A source of light before it has its place in the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    /// Index of its patch.
    pub patch: u32,
    /// Corners of its patch, metres.
    pub corners: [Vec3; 3],
    /// Luminous power, in any unit.
    pub power: f32,
}

/// A box, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoxM {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl BoxM {
    /// Around points; without any, one that holds nothing.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        let empty = Self {
            min: Vec3::MAX,
            max: Vec3::MIN,
        };
        points.into_iter().fold(empty, |bounds, point| Self {
            min: bounds.min.min(point),
            max: bounds.max.max(point),
        })
    }

    /// Whether both have a point in common.
    pub fn touches(&self, other: &Self) -> bool {
        self.min.cmple(other.max).all() && self.max.cmpge(other.min).all()
    }

    /// Length of the diagonal.
    pub fn diagonal(&self) -> f32 {
        self.min.distance(self.max)
    }
}

/// A node: the sources `first..last` in the tree's order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceNode {
    /// First source.
    pub first: u32,
    /// Past the last source.
    pub last: u32,
    /// Both children; a node of one source has none.
    pub children: Option<[u32; 2]>,
    /// Around its patches.
    pub bounds: BoxM,
}

/// The tree; the root is node 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SourceTree {
    /// All nodes; children come after their parents.
    pub nodes: Vec<SourceNode>,
    /// Patches in the tree's order.
    pub patches: Vec<u32>,
}

impl SourceTree {
    /// Sorts sources into a tree, whose halves have about the same power.
    pub fn new(mut sources: Vec<Source>) -> Self {
        let mut tree = Self::default();
        if !sources.is_empty() {
            tree.build(&mut sources, 0);
        }
        tree.patches = sources.iter().map(|source| source.patch).collect();
        tree
    }

    fn build(&mut self, sources: &mut [Source], first: u32) -> u32 {
        let index = self.nodes.len() as u32;
        self.nodes.push(SourceNode {
            first,
            last: first + sources.len() as u32,
            children: None,
            bounds: BoxM::around(sources.iter().flat_map(|source| source.corners)),
        });
        if sources.len() > 1 {
            let cut = cut(sources);
            let (low, high) = sources.split_at_mut(cut);
            let low_node = self.build(low, first);
            let high_node = self.build(high, first + cut as u32);
            self.nodes[index as usize].children = Some([low_node, high_node]);
        }
        index
    }
}

/// Sorts sources along the axis in which their power is spread most, and returns where to cut: at half of the power.
fn cut(sources: &mut [Source]) -> usize {
    let middle = |source: &Source| source.corners.iter().sum::<Vec3>() / 3.0;
    let power: f32 = sources.iter().map(|source| source.power).sum();
    let weighted = |value: &dyn Fn(&Source) -> Vec3| {
        let sum: Vec3 = sources
            .iter()
            .map(|source| value(source) * source.power)
            .sum();
        sum / power.max(f32::MIN_POSITIVE)
    };
    let mean = weighted(&middle);
    let spread = weighted(&|source| (middle(source) - mean).powf(2.0));
    let axis = spread.max_position();
    sources.sort_by(|one, other| middle(one)[axis].total_cmp(&middle(other)[axis]));
    let mut sum = 0.0;
    let below_half = sources.iter().take_while(|source| {
        sum += source.power;
        sum <= power / 2.0
    });
    below_half.count().clamp(1, sources.len() - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources() -> Vec<Source> {
        (0..37)
            .map(|index| {
                let place = Vec3::new((index * 7 % 11) as f32, (index * 5 % 13) as f32, 2.0);
                Source {
                    patch: index,
                    corners: [place, place + Vec3::X, place + Vec3::Y],
                    power: 1.0 + (index * 3 % 5) as f32,
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
    fn halves_have_about_the_same_power() {
        let sources = sources();
        let power_of = |patch: u32| sources[patch as usize].power;
        let tree = SourceTree::new(sources.clone());
        let power = |node: &SourceNode| -> f32 {
            let range = node.first as usize..node.last as usize;
            tree.patches[range]
                .iter()
                .map(|&patch| power_of(patch))
                .sum()
        };
        for node in &tree.nodes {
            if let Some([low, high]) = node.children {
                let (low, high) = (&tree.nodes[low as usize], &tree.nodes[high as usize]);
                // No farther apart than by the largest source.
                assert!((power(low) - power(high)).abs() <= 2.0 * 5.0);
            }
        }
    }
}
