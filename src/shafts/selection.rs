//! n sources that stand for all that may be hidden (Gibson et al. 2003, section 8): nodes of the source tree. The light of
//! all is kept.

use glam::{DMat3, DVec3, Mat3, Vec3};

use super::source_tree::{SourceNode, SourceTree};

/// The part of receivers' light, on the average, below which nodes of sources are not cut: less than a level of 255.
pub const LEAST_WEIGHT: f32 = 1.0 / 2048.0;

/// One shadow for all of a node is half as wrong as it can be where the node is seen as wide as this, in parts of its distance: the
/// wider it is the more the shadow is off, until none of it is left.
const HALF_AS_WRONG: f32 = 0.2;

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

/// Up to `count` representatives for the sources, which come in the tree's order, as they are seen from `casters`: of all ways to
/// cut the tree into so many nodes the one that does least wrong, all in all. Nodes that do less than `least` wrong as one are
/// not cut: no eye could tell.
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
    // What differences of sums leave of nothing is nothing.
    let lit = |one: &Representative| f64::from(one.weight) > 1e-12 * all;
    let nodes = tree.nodes.iter();
    let nodes = nodes.map(|node| Some(sums.representative(node)).filter(lit));
    let nodes: Vec<Option<Representative>> = nodes.collect();
    let cuts = LeastWrong::new(tree, &nodes, (count, least), casters);
    let best = (1..cuts.of[0].len()).min_by(|&one, &other| {
        let [one, other] = [one, other].map(|count| cuts.of[0][count]);
        one.total_cmp(&other)
    });
    let mut chosen = Vec::new();
    cuts.choose(0, best.unwrap_or(1), &mut chosen);
    chosen.into_iter().filter_map(|node| nodes[node]).collect()
}

/// For each node of a tree, and each number of nodes that it may be cut into, what the best of these cuts does wrong.
struct LeastWrong<'a> {
    tree: &'a SourceTree,
    of: Vec<Vec<f32>>,
}

impl<'a> LeastWrong<'a> {
    fn new(
        tree: &'a SourceTree,
        nodes: &[Option<Representative>],
        (most, least): (usize, f32),
        casters: Vec3,
    ) -> Self {
        let mut of = vec![Vec::new(); nodes.len()];
        // (Children come after their parents.)
        for (index, node) in nodes.iter().enumerate().rev() {
            let Some(one) = node else {
                of[index] = vec![0.0];
                continue;
            };
            let as_one = one.wrong(casters);
            let mut wrong = vec![f32::INFINITY, as_one];
            let children = tree.nodes[index].children;
            if let Some(children) = children.filter(|_| as_one > least) {
                let [low, high] = children.map(|child| &of[child as usize]);
                let largest = (low.len() + high.len() - 2).min(most);
                wrong.resize(wrong.len().max(largest + 1), f32::INFINITY);
                for (low_count, of_low) in low.iter().enumerate() {
                    // (Only of a node without light are none a cut.)
                    for (high_count, of_high) in high.iter().enumerate() {
                        let count = low_count + high_count;
                        if count > largest {
                            break;
                        }
                        wrong[count] = wrong[count].min(of_low + of_high);
                    }
                }
            }
            of[index] = wrong;
        }
        Self { tree, of }
    }

    /// Adds the nodes of the best cut of a node into `count`, in the tree's order.
    fn choose(&self, node: usize, count: usize, chosen: &mut Vec<usize>) {
        if count == 0 {
            return;
        }
        let wrong = self.of[node][count];
        let cut = self.tree.nodes[node].children.and_then(|children| {
            let [low, high] = children.map(|child| &self.of[child as usize]);
            let of_high = |of_low: usize| high.get(count.checked_sub(of_low)?).copied();
            let is_best = |of_low: &usize| {
                of_high(*of_low).is_some_and(|of_high| low[*of_low] + of_high <= wrong)
            };
            let of_low = (0..low.len()).find(is_best)?;
            Some([(children[0], of_low), (children[1], count - of_low)])
        });
        match cut {
            Some(parts) => {
                for (child, count) in parts {
                    self.choose(child as usize, count, chosen);
                }
            }
            None => chosen.push(node),
        }
    }
}

impl Representative {
    /// How wrong one shadow for all of it is: its weight times a part that grows with how wide it is seen from `casters`, for the
    /// shadow of a narrow node is right however bright it is.
    fn wrong(&self, casters: Vec3) -> f32 {
        let distance = self.position.distance_squared(casters).max(1e-9);
        let width = (self.spread_trace() / (2.0 * distance)).sqrt();
        self.weight * width / (width + HALF_AS_WRONG)
    }

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

    /// What each cut of a node into lit nodes does wrong, with how many these are.
    fn all_cuts(tree: &SourceTree, sources: &[WeighedSource], node: usize) -> Vec<(usize, f32)> {
        let sums = MomentSums::new(sources);
        let one = sums.representative(&tree.nodes[node]);
        if one.weight < 1e-6 {
            return vec![(0, 0.0)];
        }
        let mut cuts = vec![(1, one.wrong(CASTERS))];
        if let Some(children) = tree.nodes[node].children {
            let [low, high] = children.map(|child| all_cuts(tree, sources, child as usize));
            for (low_count, of_low) in low {
                let both = high
                    .iter()
                    .map(|(count, wrong)| (low_count + count, of_low + wrong));
                cuts.extend(both);
            }
        }
        cuts
    }

    #[test]
    fn no_other_cut_into_as_many_nodes_does_less_wrong() {
        let (tree, sources) = scene();
        // A part of the tree that has few enough cuts to try all.
        let part = (0..tree.nodes.len()).find(|&node| {
            let node = &tree.nodes[node];
            (10..16).contains(&(node.last - node.first))
        });
        let part = tree.nodes[part.expect("a small part")];
        let sources: Vec<WeighedSource> = sources
            .iter()
            .enumerate()
            .map(|(index, source)| {
                let is_in = (part.first..part.last).contains(&(index as u32));
                WeighedSource {
                    weight: if is_in { source.weight } else { 0.0 },
                    ..*source
                }
            })
            .collect();
        let cuts = all_cuts(&tree, &sources, 0);
        assert!(cuts.len() > 100, "{}", cuts.len());
        for count in 1..12 {
            let chosen = representatives(&tree, &sources, count, 0.0, CASTERS);
            let wrong: f32 = chosen.iter().map(|one| one.wrong(CASTERS)).sum();
            let best = cuts.iter().filter(|cut| cut.0 <= count);
            let best = best.map(|cut| cut.1).fold(f32::INFINITY, f32::min);
            assert!(chosen.len() <= count);
            assert!(
                (wrong - best).abs() < 1e-4 * best.max(1e-3),
                "{count}: {wrong} {best}"
            );
        }
    }

    #[test]
    fn what_nobody_sees_is_not_cut() {
        let (tree, sources) = scene();
        let coarse = representatives(&tree, &sources, 1000, 20.0, CASTERS);
        assert!((2..40).contains(&coarse.len()), "{}", coarse.len());
        let fine = representatives(&tree, &sources, 1000, 0.0, CASTERS);
        assert!(fine.len() > coarse.len());
        // All that was left as one does no more than that wrong, or is one patch.
        for one in &coarse {
            assert!(one.wrong(CASTERS) <= 20.0 || one.last - one.first == 1);
        }
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
