//! A surface of a rig: vertices that morph, and that a node carries or joints hold.

use std::collections::HashMap;

use glam::{DMat3, DMat4, DVec3};
use rayon::prelude::*;

use super::{NodePose, RigVertices};

/// Vertices in the space of their mesh, and what moves them.
#[derive(Debug, Clone)]
pub struct RigSurface {
    /// Where they are before they are morphed.
    pub positions: Vec<DVec3>,
    /// Their normals; `None` where there are none.
    pub normals: Vec<Option<DVec3>>,
    /// What they morph to.
    pub targets: Vec<MorphTarget>,
    /// The node whose mesh they are of: it has the weights of the targets.
    pub node: usize,
    /// What they follow.
    pub holding: Holding,
}

/// What is added to vertices, by a weight.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MorphTarget {
    /// To their places; none where it changes none.
    pub positions: Vec<DVec3>,
    /// To their normals; none where it changes none.
    pub normals: Vec<DVec3>,
}

/// What vertices follow.
#[derive(Debug, Clone)]
pub enum Holding {
    /// Their own node.
    Node,
    /// Joints of a skin.
    Joints(Joints),
}

/// A skin, and how it holds vertices.
#[derive(Debug, Clone)]
pub struct Joints {
    /// Number of the skin: joints are known by it and their own number.
    pub skin: usize,
    /// Each joint's node, and the joint's space from the mesh's.
    pub joints: Vec<(usize, DMat4)>,
    /// For each vertex its joints with their weights, of which any may be none.
    pub holds: Vec<Vec<(u32, f64)>>,
}

impl RigSurface {
    /// Its vertices where a pose has them.
    pub fn placed(&self, pose: &NodePose) -> RigVertices {
        let (morphed, normals) = self.morphed(&pose.weights[self.node]);
        let scene_from_mesh = self.scene_from_mesh(pose);
        let positions = morphed.par_iter().zip(&scene_from_mesh);
        let placed_normals = normals.par_iter().zip(&scene_from_mesh);
        RigVertices {
            positions: positions
                .map(|(position, scene_from_mesh)| scene_from_mesh.transform_point3(*position))
                .collect(),
            normals: placed_normals
                .map(|(normal, scene_from_mesh)| {
                    let turned = |normal| normal_from_mesh(scene_from_mesh) * normal;
                    normal.map(|normal| turned(normal).normalize_or_zero())
                })
                .collect(),
            scene_from_mesh,
        }
    }

    /// Places and normals with the targets that count.
    fn morphed(&self, weights: &[f64]) -> (Vec<DVec3>, Vec<Option<DVec3>>) {
        let (mut positions, mut normals) = (self.positions.clone(), self.normals.clone());
        let weighted = self.targets.iter().zip(weights);
        for (target, &weight) in weighted.filter(|(_, weight)| **weight != 0.0) {
            for (position, by) in positions.iter_mut().zip(&target.positions) {
                *position += *by * weight;
            }
            for (normal, by) in normals.iter_mut().zip(&target.normals) {
                if let Some(normal) = normal {
                    *normal += *by * weight;
                }
            }
        }
        (positions, normals)
    }

    /// For each vertex what carries it: for one that joints hold the mean of their matrices.
    fn scene_from_mesh(&self, pose: &NodePose) -> Vec<DMat4> {
        let Joints { joints, holds, .. } = match &self.holding {
            Holding::Node => {
                return vec![pose.scene_from_node[self.node]; self.positions.len()];
            }
            Holding::Joints(joints) => joints,
        };
        let of_joints: Vec<DMat4> = joints
            .iter()
            .map(|(node, joint_from_mesh)| pose.scene_from_node[*node] * *joint_from_mesh)
            .collect();
        // A vertex that nothing holds stays with the first joint.
        let first = of_joints.first().copied().unwrap_or(DMat4::IDENTITY);
        let mean = |holds: &Vec<(u32, f64)>| {
            let (mut sum, mut all) = (DMat4::ZERO, 0.0);
            for &(joint, weight) in holds {
                sum += of_joints[joint as usize] * weight;
                all += weight;
            }
            match all > 0.0 {
                true => sum * f64::recip(all),
                false => first,
            }
        };
        holds.par_iter().map(mean).collect()
    }
}

/// Cofactors: normals keep standing on their surface whatever the scale, and on its outside in a mirror.
fn normal_from_mesh(scene_from_mesh: &DMat4) -> DMat3 {
    let linear = DMat3::from_mat4(*scene_from_mesh);
    let cofactors = DMat3::from_cols(
        linear.y_axis.cross(linear.z_axis),
        linear.z_axis.cross(linear.x_axis),
        linear.x_axis.cross(linear.y_axis),
    );
    match linear.determinant() < 0.0 {
        true => cofactors * -1.0,
        false => cofactors,
    }
}

/// Numbers for vertices that are always in one place, whatever the pose: those may be one vertex of a mesh.
#[derive(Debug, Default)]
pub struct AlwaysTogether {
    known: HashMap<Vec<u64>, u32>,
}

impl AlwaysTogether {
    /// For each vertex of a surface the number of those that it goes with.
    pub fn numbers(&mut self, surface: &RigSurface) -> Vec<u32> {
        let vertices = 0..surface.positions.len();
        let keys = vertices.map(|vertex| moved_by(surface, vertex));
        let mut numbers = Vec::with_capacity(surface.positions.len());
        for key in keys {
            let next = self.known.len() as u32;
            numbers.push(*self.known.entry(key).or_insert(next));
        }
        numbers
    }
}

/// All that a vertex's place depends on, so written that it is the same where that is.
fn moved_by(surface: &RigSurface, vertex: usize) -> Vec<u64> {
    // (A sum with 0 makes one of both zeros.)
    let bits = |place: DVec3| (place + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut key = bits(surface.positions[vertex]).to_vec();
    let moves = surface.targets.iter();
    let moves = moves.map(|target| target.positions.get(vertex).copied());
    let moves: Vec<DVec3> = moves.map(Option::unwrap_or_default).collect();
    let morphs = moves.iter().any(|by| *by != DVec3::ZERO);
    key.push(u64::from(morphs));
    if morphs {
        key.push(surface.node as u64);
        key.extend(moves.into_iter().flat_map(bits));
    }
    match &surface.holding {
        Holding::Node => key.extend([0, surface.node as u64]),
        Holding::Joints(joints) => {
            let mut holds = joints.holds[vertex].clone();
            holds.sort_by(|(one, a), (other, b)| one.cmp(other).then(a.total_cmp(b)));
            key.extend([1, joints.skin as u64]);
            key.extend(
                holds
                    .into_iter()
                    .flat_map(|(joint, weight)| [u64::from(joint), weight.to_bits()]),
            );
        }
    }
    key
}
