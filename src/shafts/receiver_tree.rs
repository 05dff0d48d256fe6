//! The receivers of light in an octree with several patches to a leaf (Gibson et al. 2003, section 6).

use glam::Vec3;
use serde::{Deserialize, Serialize};

use super::bounding::Aabb;
use super::patches::RoomPatches;

/// A node: the patches `first..last` in the tree's order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReceiverNode {
    pub first: u32,
    pub last: u32,
    /// Empty in a leaf.
    pub children: Vec<u32>,
    pub bounds: Aabb,
    /// Vertices of its patches, each once.
    pub vertices: Vec<u32>,
}

/// The tree; the root is node 0.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ReceiverTree {
    /// Children come after their parents.
    pub nodes: Vec<ReceiverNode>,
    /// Patches in the tree's order.
    pub patches: Vec<u32>,
}

impl ReceiverTree {
    /// Sorts patches into octants until at most `leaf` of them are together.
    pub fn new(patches: &RoomPatches, leaf: usize) -> Self {
        let mut order: Vec<u32> = (0..patches.patches.len() as u32).collect();
        let mut tree = Self::default();
        if !order.is_empty() {
            tree.build(patches, &mut order, 0, leaf.max(1));
        }
        tree.patches = order;
        tree
    }

    fn build(&mut self, patches: &RoomPatches, order: &mut [u32], first: u32, leaf: usize) -> u32 {
        let index = self.nodes.len() as u32;
        let triangles = order.iter().map(|&patch| &patches.patches[patch as usize]);
        let bounds = Aabb::around(triangles.clone().flat_map(|patch| patches.corners(patch)));
        let mut vertices: Vec<u32> = triangles.flat_map(|patch| patch.vertices).collect();
        vertices.sort_unstable();
        vertices.dedup();
        self.nodes.push(ReceiverNode {
            first,
            last: first + order.len() as u32,
            children: Vec::new(),
            bounds,
            vertices,
        });
        if order.len() > leaf {
            let center = |patch: u32| patches.center(&patches.patches[patch as usize]);
            let around = Aabb::around(order.iter().map(|&patch| center(patch)));
            let middle = around.min.midpoint(around.max);
            let octant = |patch: u32| octant(center(patch), middle);
            order.sort_by_key(|&patch| octant(patch));
            let apart = octant(order[0]) != octant(order[order.len() - 1]);
            let mut children = Vec::new();
            let mut start = first;
            // Patches with one middle stay together, unless by number.
            let chunks: Vec<usize> = match apart {
                true => order
                    .chunk_by(|&one, &other| octant(one) == octant(other))
                    .map(<[u32]>::len)
                    .collect(),
                false => vec![order.len() / 2, order.len() - order.len() / 2],
            };
            let mut rest = order;
            for length in chunks {
                let (chunk, others) = rest.split_at_mut(length);
                children.push(self.build(patches, chunk, start, leaf));
                start += length as u32;
                rest = others;
            }
            self.nodes[index as usize].children = children;
        }
        index
    }
}

fn octant(point: Vec3, middle: Vec3) -> u32 {
    point.cmpge(middle).bitmask()
}
