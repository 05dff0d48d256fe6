//! Rigs: what moves the vertices of a model over time. A tree of nodes whose places clips change, meshes that stand on nodes or
//! are held by joints (skins), and targets that meshes morph to (glTF 2.0, sections 3.5.3, 3.7.2.2, 3.7.3.1 and 3.11).

pub mod posed;
pub mod sampler;
pub mod surface;

use glam::{DMat4, DQuat, DVec3};
use rayon::prelude::*;

use sampler::Sampler;
use surface::RigSurface;

/// A tree of nodes, or several.
#[derive(Debug, Clone, Default)]
pub struct NodeTree {
    nodes: Vec<RigNode>,
    /// All of them, parents first.
    order: Vec<usize>,
}

/// A node in its rest pose.
#[derive(Debug, Clone)]
pub struct RigNode {
    /// What it stands on.
    pub parent: Option<usize>,
    /// Where it stands there.
    pub parent_from_node: DMat4,
    /// The same in parts: what clips change.
    pub parts: NodeParts,
    /// Weights of the morph targets of its mesh.
    pub weights: Vec<f64>,
}

/// Where a node stands on its parent: scale, then turn, then move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NodeParts {
    /// In the parent's space.
    pub translation: DVec3,
    /// A unit quaternion.
    pub rotation: DQuat,
    /// Along the node's own axes.
    pub scale: DVec3,
}

/// An animation.
#[derive(Debug, Clone, PartialEq)]
pub struct Clip {
    /// What it changes.
    pub channels: Vec<Channel>,
    /// When its last key is, seconds.
    pub duration_s: f64,
}

/// What one node does over time.
#[derive(Debug, Clone, PartialEq)]
pub struct Channel {
    /// Number of the node.
    pub node: usize,
    /// What of it changes.
    pub track: Track,
}

/// A part of a node over time.
#[derive(Debug, Clone, PartialEq)]
pub enum Track {
    /// Its place.
    Translation(Sampler<DVec3>),
    /// Its turn.
    Rotation(Sampler<DQuat>),
    /// Its scale.
    Scale(Sampler<DVec3>),
    /// Weights of its mesh's morph targets.
    Weights(Sampler<Vec<f64>>),
}

impl Track {
    /// When its last key is, seconds.
    pub fn end_s(&self) -> f64 {
        match self {
            Self::Translation(sampler) | Self::Scale(sampler) => sampler.end_s(),
            Self::Rotation(sampler) => sampler.end_s(),
            Self::Weights(sampler) => sampler.end_s(),
        }
    }
}

/// All nodes at one moment.
#[derive(Debug, Clone, PartialEq)]
pub struct NodePose {
    /// Where each node is.
    pub scene_from_node: Vec<DMat4>,
    /// Weights of the morph targets of each node's mesh.
    pub weights: Vec<Vec<f64>>,
}

impl NodeTree {
    /// A tree of these nodes; `None` where one is its own ancestor or stands on what is not there, with its number.
    ///
    /// # Errors
    /// The number of such a node.
    pub fn new(nodes: Vec<RigNode>) -> Result<Self, usize> {
        let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
        let mut order = Vec::with_capacity(nodes.len());
        for (number, node) in nodes.iter().enumerate() {
            match node.parent {
                Some(parent) => children.get_mut(parent).ok_or(number)?.push(number),
                None => order.push(number),
            }
        }
        let mut next = 0;
        while let Some(&number) = order.get(next) {
            order.append(&mut children[number]);
            next += 1;
        }
        // Whoever is not reached from a root is in a circle.
        let mut is_met = vec![false; nodes.len()];
        order.iter().for_each(|&number| is_met[number] = true);
        match is_met.iter().position(|is_met| !is_met) {
            Some(number) => Err(number),
            None => Ok(Self { nodes, order }),
        }
    }

    /// All nodes at rest, or at a time of a clip, seconds.
    pub fn pose(&self, clip: Option<(&Clip, f64)>) -> NodePose {
        let mut parts: Vec<Option<NodeParts>> = vec![None; self.nodes.len()];
        let mut weights: Vec<Vec<f64>> =
            self.nodes.iter().map(|node| node.weights.clone()).collect();
        if let Some((clip, time_s)) = clip {
            for Channel { node, track } in &clip.channels {
                let moved = || parts[*node].unwrap_or(self.nodes[*node].parts);
                match track {
                    Track::Translation(sampler) => {
                        let translation = sampler.at(time_s);
                        parts[*node] = Some(NodeParts {
                            translation,
                            ..moved()
                        });
                    }
                    Track::Rotation(sampler) => {
                        let rotation = sampler.at(time_s);
                        parts[*node] = Some(NodeParts {
                            rotation,
                            ..moved()
                        });
                    }
                    Track::Scale(sampler) => {
                        let scale = sampler.at(time_s);
                        parts[*node] = Some(NodeParts { scale, ..moved() });
                    }
                    Track::Weights(sampler) => weights[*node] = sampler.at(time_s),
                }
            }
        }
        let mut scene_from_node = vec![DMat4::IDENTITY; self.nodes.len()];
        for &number in &self.order {
            let node = &self.nodes[number];
            let parent_from_node = parts[number].map_or(node.parent_from_node, |parts| {
                DMat4::from_scale_rotation_translation(
                    parts.scale,
                    parts.rotation,
                    parts.translation,
                )
            });
            scene_from_node[number] = match node.parent {
                Some(parent) => scene_from_node[parent] * parent_from_node,
                None => parent_from_node,
            };
        }
        NodePose {
            scene_from_node,
            weights,
        }
    }
}

/// A model that moves: its nodes, and the surfaces that they move.
#[derive(Debug, Clone, Default)]
pub struct Rig {
    /// What moves.
    pub tree: NodeTree,
    /// What is moved. Vertices are numbered through all of them.
    pub surfaces: Vec<RigSurface>,
}

/// A rig's vertices at one moment, by their numbers, in the space of its scene.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RigVertices {
    /// Where they are.
    pub positions: Vec<DVec3>,
    /// Unit normals; `None` where the file has none.
    pub normals: Vec<Option<DVec3>>,
    /// What carries them there from their meshes.
    pub scene_from_mesh: Vec<DMat4>,
}

impl Rig {
    /// All vertices at rest, or at a time of a clip, seconds.
    pub fn vertices(&self, clip: Option<(&Clip, f64)>) -> RigVertices {
        let pose = self.tree.pose(clip);
        let placed: Vec<RigVertices> = (self.surfaces.par_iter())
            .map(|surface| surface.placed(&pose))
            .collect();
        let mut all = RigVertices::default();
        for mut placed in placed {
            all.positions.append(&mut placed.positions);
            all.normals.append(&mut placed.normals);
            all.scene_from_mesh.append(&mut placed.scene_from_mesh);
        }
        all
    }
}

#[cfg(test)]
mod tests;
