//! The node tree: where each node of the scene stands.

use glam::{DMat4, Mat4};
use gltf::{Document, Node};

use super::file::GltfFile;
use crate::scene::error::SceneError;

/// All nodes' places, and those of the scene.
pub(super) struct Nodes<'a> {
    /// For each node of the file.
    pub scene_from_node: Vec<DMat4>,
    /// The nodes of the scene, parents first.
    pub of_scene: Vec<PlacedNode<'a>>,
}

/// A node of the scene.
pub(super) struct PlacedNode<'a> {
    pub node: Node<'a>,
    pub scene_from_node: DMat4,
}

impl<'a> PlacedNode<'a> {
    pub fn mesh(&self) -> Option<gltf::Mesh<'a>> {
        self.node.mesh()
    }
}

/// Walks the trees; a node has one parent at most and is not its own ancestor.
pub(super) fn placed<'a>(
    file: &GltfFile<'_>,
    document: &'a Document,
) -> Result<Nodes<'a>, SceneError> {
    let nodes: Vec<Node<'_>> = document.nodes().collect();
    let mut has_parent = vec![false; nodes.len()];
    for node in &nodes {
        for child in node.children() {
            if std::mem::replace(&mut has_parent[child.index()], true) {
                let place = format!("nodes[{}]", child.index());
                return Err(file.error(&place, "it is the child of two nodes"));
            }
        }
    }
    let mut scene_from_node: Vec<Option<DMat4>> = vec![None; nodes.len()];
    let is_root = |node: &&Node<'_>| !has_parent[node.index()];
    let mut open: Vec<(usize, DMat4)> = nodes
        .iter()
        .filter(is_root)
        .map(|node| (node.index(), DMat4::IDENTITY))
        .collect();
    while let Some((index, scene_from_parent)) = open.pop() {
        let parent_from_node = Mat4::from_cols_array_2d(&nodes[index].transform().matrix());
        let placed = scene_from_parent * parent_from_node.as_dmat4();
        if !placed.is_finite() {
            return Err(file.error(&format!("nodes[{index}]"), "its place is not finite"));
        }
        scene_from_node[index] = Some(placed);
        open.extend(nodes[index].children().map(|child| (child.index(), placed)));
    }
    // Whoever is not reached from a root is in a circle.
    if let Some(index) = scene_from_node.iter().position(Option::is_none) {
        return Err(file.error(&format!("nodes[{index}]"), "it is its own ancestor"));
    }
    let scene_from_node: Vec<DMat4> = scene_from_node.into_iter().flatten().collect();

    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next());
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
        let children: Vec<usize> = node.children().map(|child| child.index()).collect();
        open.extend(children.into_iter().rev());
        of_scene.push(PlacedNode {
            scene_from_node: scene_from_node[index],
            node,
        });
    }
    Ok(Nodes {
        scene_from_node,
        of_scene,
    })
}
