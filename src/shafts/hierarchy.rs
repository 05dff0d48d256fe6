//! The hierarchy of shafts (Gibson et al. 2003, sections 6 and 6.1): which sources a box may hide from which receivers.

use serde::{Deserialize, Serialize};

use super::bounding::Aabb;
use super::receiver_tree::ReceiverTree;
use super::shaft::{ShaftPlane, planes};
use super::source_tree::SourceTree;

/// All shafts, each followed by those that it is cut into.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ShaftHierarchy {
    shafts: Vec<Shaft>,
    planes: Vec<ShaftPlane>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Shaft {
    source: u32,
    receiver: u32,
    bounds: Aabb,
    /// Planes from here to the next shaft's.
    first_plane: u32,
    /// Index past all shafts that this one is cut into.
    end: u32,
}

/// The findings of traversals, by node.
#[derive(Debug, Clone, PartialEq)]
pub struct Marks {
    source_nodes: Vec<bool>,
    receiver_nodes: Vec<bool>,
}

/// Light that arrives at vertices from runs of sources.
pub struct Arriving {
    source_count: usize,
    /// For each vertex the sums of luminance from the first sources, none to all.
    sums: Vec<f64>,
    /// For each vertex the luminance of all its light.
    totals: Vec<f32>,
}

impl Arriving {
    /// From a row of luminances for each vertex (a source each, in the tree's order), and all light of each vertex.
    pub fn new<'a>(rows: impl Iterator<Item = Vec<f32>> + 'a, totals: Vec<f32>) -> Self {
        let mut sums = Vec::new();
        let mut source_count = 0;
        for row in rows {
            source_count = row.len();
            let mut sum = 0.0;
            sums.push(sum);
            sums.extend(row.iter().map(|&luminance| {
                sum += f64::from(luminance);
                sum
            }));
        }
        Self {
            source_count,
            sums,
            totals,
        }
    }

    fn of_run(&self, vertex: u32, first: u32, last: u32) -> f32 {
        let row = vertex as usize * (self.source_count + 1);
        (self.sums[row + last as usize] - self.sums[row + first as usize]) as f32
    }
}

impl ShaftHierarchy {
    /// Joins sources and receivers. A shaft that brings no vertex any light is left out; one that brings each less than
    /// `least_part` of all its light is not cut any further.
    pub fn new(
        sources: &SourceTree,
        receivers: &ReceiverTree,
        arriving: &Arriving,
        least_part: f32,
    ) -> Self {
        let mut hierarchy = Self::default();
        if !sources.nodes.is_empty() && !receivers.nodes.is_empty() {
            hierarchy.build((sources, receivers), arriving, least_part, [0, 0]);
        }
        hierarchy
    }

    fn build(
        &mut self,
        trees: (&SourceTree, &ReceiverTree),
        arriving: &Arriving,
        least_part: f32,
        [source, receiver]: [u32; 2],
    ) {
        let from = &trees.0.nodes[source as usize];
        let to = &trees.1.nodes[receiver as usize];
        let parts = to.vertices.iter().map(|&vertex| {
            let total = arriving.totals[vertex as usize];
            arriving.of_run(vertex, from.first, from.last) / total.max(f32::MIN_POSITIVE)
        });
        let most = parts.fold(0.0, f32::max);
        if most <= 0.0 {
            return;
        }
        let index = self.shafts.len();
        let (a, b) = (&from.bounds, &to.bounds);
        self.shafts.push(Shaft {
            source,
            receiver,
            bounds: Aabb::around([a.min, a.max, b.min, b.max]),
            first_plane: self.planes.len() as u32,
            end: 0,
        });
        self.planes.extend(planes(a, b));
        if most >= least_part {
            let cuts_source =
                from.children.is_some() && (to.children.is_empty() || a.diagonal() >= b.diagonal());
            if cuts_source {
                for child in from.children.into_iter().flatten() {
                    self.build(trees, arriving, least_part, [child, receiver]);
                }
            } else {
                for &child in &to.children {
                    self.build(trees, arriving, least_part, [source, child]);
                }
            }
        }
        self.shafts[index].end = self.shafts.len() as u32;
    }

    /// Number of shafts that are not cut any further.
    pub fn leaf_count(&self) -> usize {
        let ends = self.shafts.iter().zip(1..);
        ends.filter(|(shaft, next)| shaft.end == *next).count()
    }

    /// Memory that it takes, bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.shafts[..]) + size_of_val(&self.planes[..])
    }

    /// Marks the sources that things in a box may hide, and the receivers that may get their shadows.
    pub fn mark(&self, bounds: &Aabb, marks: &mut Marks) {
        let mut index = 0;
        while let Some(shaft) = self.shafts.get(index) {
            let next = self.shafts.get(index + 1);
            let last_plane = next.map_or(self.planes.len(), |next| next.first_plane as usize);
            let planes = &self.planes[shaft.first_plane as usize..last_plane];
            let reaches =
                shaft.bounds.touches(bounds) && !planes.iter().any(|plane| plane.excludes(bounds));
            if !reaches {
                index = shaft.end as usize;
                continue;
            }
            if shaft.end as usize == index + 1 {
                marks.source_nodes[shaft.source as usize] = true;
                marks.receiver_nodes[shaft.receiver as usize] = true;
            }
            index += 1;
        }
    }
}

impl Marks {
    /// Nothing is marked.
    pub fn new(sources: &SourceTree, receivers: &ReceiverTree) -> Self {
        Self {
            source_nodes: vec![false; sources.nodes.len()],
            receiver_nodes: vec![false; receivers.nodes.len()],
        }
    }

    /// For each source in the tree's order whether it is marked.
    pub fn sources(&self, tree: &SourceTree) -> Vec<bool> {
        let mut marked = vec![false; tree.patches.len()];
        let nodes = tree.nodes.iter().zip(&self.source_nodes);
        for (node, _) in nodes.filter(|(_, is_marked)| **is_marked) {
            marked[node.first as usize..node.last as usize].fill(true);
        }
        marked
    }

    /// For each patch whether it is marked as a receiver.
    pub fn receivers(&self, tree: &ReceiverTree) -> Vec<bool> {
        let mut marked = vec![false; tree.patches.len()];
        let nodes = tree.nodes.iter().zip(&self.receiver_nodes);
        for (node, _) in nodes.filter(|(_, is_marked)| **is_marked) {
            for &patch in &tree.patches[node.first as usize..node.last as usize] {
                marked[patch as usize] = true;
            }
        }
        marked
    }
}
