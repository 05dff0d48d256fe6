//! The frame with what lets light through: without it first, then layer by layer, the farthest first.

use glam::DAffine3;

use super::super::gpu_scene::world_from;
use super::super::opacity_map::brightest;
use super::super::shown::Shown;
use super::super::translucent::{SeenOpacity, Translucent};
use super::Renderer;

impl Renderer {
    /// Draws the uploaded picture with what stands on the nodes, whose poses come as [`Scene::camera_from_nodes`] gives
    /// them; where nothing moves by itself these are the anchors, in the scene's order. Without
    /// the world's pose nobody knows where the light comes from, and the video is shown alone.
    ///
    /// [`Scene::camera_from_nodes`]: crate::scene::Scene::camera_from_nodes
    pub fn draw(&mut self, camera_from_node: &[Option<DAffine3>], shown: Shown) {
        let mut nodes = self.without_layers(camera_from_node);
        self.draw_once(&nodes, shown);
        self.opaque_nodes = None;
        let layers = self.farthest_first(camera_from_node);
        if layers.is_empty() || shown != Shown::Composite {
            return;
        }
        let translucent = self.translucent.take();
        let translucent = translucent
            .unwrap_or_else(|| Translucent::new(&self.gpu, &self.gpu_scene, &self.picture));
        translucent.begin(&self.gpu, &self.gpu_scene, &self.picture);
        let mut stale = self.stale;
        let mut pass_names = std::mem::take(&mut self.pass_names);
        for index in layers {
            let (node, opacity) = self.layer_opacity(index, camera_from_node);
            nodes[node] = camera_from_node[self.layers[index].stands_on];
            self.gpu_scene.set_unseen(Some(node));
            self.draw_once(&nodes, shown);
            pass_names.append(&mut self.pass_names);
            translucent.keep_shadow(&self.gpu, &self.picture);
            self.gpu_scene.set_unseen(None);
            self.draw_once(&nodes, shown);
            pass_names.append(&mut self.pass_names);
            translucent.add(&self.gpu, &self.gpu_scene, &opacity);
            pass_names.extend(["opacity", "translucent"]);
            stale = stale.union(self.stale);
            nodes[node] = None;
        }
        translucent.finish(&self.gpu, &self.picture);
        self.translucent = Some(translucent);
        (self.stale, self.pass_names) = (stale, pass_names);
        self.opaque_nodes = Some(nodes);
    }

    /// Draws what is opaque once more beside the picture, where layers came after it: it is what a frame's layers for tests tell
    /// of.
    pub(super) fn redraw_opaque(&mut self) {
        if let Some(nodes) = self.opaque_nodes.take() {
            let (stale, pass_names) = (self.stale, self.pass_names.clone());
            self.draw_once(&nodes, self.shown);
            if let Some(translucent) = &self.translucent {
                translucent.finish(&self.gpu, &self.picture);
            }
            (self.stale, self.pass_names) = (stale.union(self.stale), pass_names);
        }
    }

    /// Poses of all nodes, of which none of a layer is there.
    pub(super) fn without_layers(&self, given: &[Option<DAffine3>]) -> Vec<Option<DAffine3>> {
        let mut nodes = given.to_vec();
        nodes.extend(self.layers.iter().map(|_| None));
        nodes
    }

    /// A layer's node, and what it takes of the light.
    fn layer_opacity(
        &mut self,
        index: usize,
        camera_from_node: &[Option<DAffine3>],
    ) -> (usize, SeenOpacity) {
        let layer = &mut self.layers[index];
        let mut opacity = SeenOpacity {
            mean: layer.opacity,
            by_place: None,
        };
        let poses = [layer.stands_on, 0].map(|node| camera_from_node[node]);
        if let [Some(camera_from_layer), Some(camera_from_world)] = poses {
            let world_from_layer = world_from(&camera_from_world, &camera_from_layer);
            let place = world_from_layer.transform_point3(layer.middle);
            let lights = self.gpu_scene.shining();
            let light = brightest(&lights, place, &world_from_layer.inverse());
            let map = light.and_then(|light| layer.opacity_map(light));
            opacity.by_place = map.map(|map| {
                let map_from_camera = map.map_from_camera(&camera_from_layer);
                (map, map_from_camera)
            });
        }
        (layer.node, opacity)
    }

    /// The layers that are there, by the distance of their middles from the camera.
    fn farthest_first(&self, camera_from_node: &[Option<DAffine3>]) -> Vec<usize> {
        if camera_from_node.first().copied().flatten().is_none() {
            return Vec::new();
        }
        let layers = self.layers.iter().enumerate();
        let mut placed: Vec<(f64, usize)> = layers
            .filter(|(_, layer)| layer.visible)
            .filter_map(|(index, layer)| {
                let camera_from_layer = camera_from_node[layer.stands_on]?;
                let middle = camera_from_layer.transform_point3(layer.middle);
                Some((middle.length(), index))
            })
            .collect();
        placed.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        placed.into_iter().map(|(_, index)| index).collect()
    }
}
