//! The node tree: where each node of the scene stands.

use glam::{DQuat, DVec3, Mat4};
use gltf::{Document, Node};
use serde_json::Value;

use super::file::GltfFile;
use crate::geometry::rig::{NodeParts, NodePose, NodeTree, RigNode};
use crate::scene::error::SceneError;

/// All nodes, and those of the scene.
pub(super) struct Nodes<'a> {
    /// Of the file.
    pub tree: NodeTree,
    /// Where they are at rest.
    pub at_rest: NodePose,
    /// The nodes of the scene, parents first.
    pub of_scene: Vec<Node<'a>>,
}

/// Walks the trees; a node has one parent at most and is not its own ancestor.
pub(super) fn placed<'a>(
    file: &GltfFile<'_>,
    document: &'a Document,
) -> Result<Nodes<'a>, SceneError> {
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut parents: Vec<Option<usize>> = vec![None; nodes.len()];
    for node in &nodes {
        for child in node.children() {
            if parents[child.index()].replace(node.index()).is_some() {
                let place = format!("nodes[{}]", child.index());
                return Err(file.error(&place, "it is the child of two nodes"));
            }
        }
    }
    let rig_nodes = nodes.iter().map(|node| rig_node(node, &parents)).collect();
    let tree = NodeTree::new(rig_nodes).map_err(|number| {
        let place = format!("nodes[{number}]");
        file.error(&place, "it is its own ancestor")
    })?;
    let at_rest = tree.pose(None);
    let mut places = at_rest.scene_from_node.iter();
    if let Some(number) = places.position(|place| !place.is_finite()) {
        return Err(file.error(&format!("nodes[{number}]"), "its place is not finite"));
    }

    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
    let is_root = |node: &&Node<'_>| parents[node.index()].is_none();
    let mut open: Vec<usize> = match scene {
        Some(scene) => scene.nodes().map(|node| node.index()).collect(),
        None => nodes.iter().filter(is_root).map(Node::index).collect(),
    };
    open.reverse();
    let mut is_met = vec![false; nodes.len()];
    let mut of_scene = Vec::new();
    while let Some(index) = open.pop() {
        if std::mem::replace(&mut is_met[index], true) {
            let place = format!("nodes[{index}]");
            return Err(file.error(&place, "it stands twice in its scene"));
        }
        let node = nodes[index].clone();
        // What is not visible has no shadow either, nor has what hangs on it.
        let visibility = node.extension_value("KHR_node_visibility");
        if visibility.is_some_and(|said| said["visible"] == Value::Bool(false)) {
            continue;
        }
        let children: Vec<usize> = node.children().map(|child| child.index()).collect();
        open.extend(children.into_iter().rev());
        of_scene.push(node);
    }
    Ok(Nodes {
        tree,
        at_rest,
        of_scene,
    })
}

fn rig_node(node: &Node<'_>, parents: &[Option<usize>]) -> RigNode {
    let transform = node.transform();
    let matrix = Mat4::from_cols_array_2d(&transform.clone().matrix());
    let (translation, rotation, scale) = transform.decomposed();
    let in_double = |vector: [f32; 3]| DVec3::from_array(vector.map(f64::from));
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let weights = node
        .weights()
        .or(node.mesh().and_then(|mesh| mesh.weights()));
    RigNode {
        parent: parents[node.index()],
        parent_from_node: matrix.as_dmat4(),
        parts: NodeParts {
            translation: in_double(translation),
            rotation: match rotation.length_squared() > 0.0 {
                true => rotation.normalize(),
                false => DQuat::IDENTITY,
            },
            scale: in_double(scale),
        },
        // (A weight that is no number counts for nothing.)
        weights: weights
            .unwrap_or_default()
            .iter()
            .map(|&weight| {
                if weight.is_finite() {
                    weight.into()
                } else {
                    0.0
                }
            })
            .collect(),
    }
}
