//! The outline of the selected thing as the camera sees it, as lines in space for the window to draw.

use glam::{DAffine3, DVec3};

use super::shadow_lines::caster_of;
use crate::geometry::shadow_volume::{Caster, LightPlace};
use crate::scene::Object;

/// The selected thing, prepared while it stands still.
#[derive(Default)]
pub struct SelectedOutline {
    prepared: Option<(Placed, Caster)>,
}

/// What the preparation depends on.
#[derive(Debug, Clone, PartialEq)]
struct Placed {
    name: String,
    anchor_from_object: DAffine3,
    triangles: usize,
}

impl SelectedOutline {
    /// The edges between what the camera sees of a thing and what it does not, in its anchor's space, metres. What a camera
    /// sees is what a lamp in its place would light.
    pub fn edges_m(&mut self, thing: &Object, camera_from_anchor: &DAffine3) -> Vec<[DVec3; 2]> {
        let placed = Placed {
            name: thing.name.clone(),
            anchor_from_object: thing.anchor_from_object,
            triangles: thing.mesh.triangles.len(),
        };
        // (What plays is another in each frame.)
        let is_prepared = thing.animation.is_none()
            && self
                .prepared
                .as_ref()
                .is_some_and(|(known, _)| *known == placed);
        if !is_prepared {
            self.prepared = Some((placed, caster_of(thing)));
        }
        let eye_m = camera_from_anchor.inverse().translation;
        let edges = self.prepared.iter().flat_map(|(_, caster)| {
            let edges = caster.outline_edges(LightPlace::Point(eye_m));
            edges.into_iter().map(|edge| edge.map(|end| end.as_dvec3()))
        });
        edges.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;
    use glam::DMat3;
    use std::path::Path;

    #[test]
    fn a_box_from_above_has_the_outline_of_its_top_and_a_card_its_own() {
        let text = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.04\n\
                    [[virtual]]\nname = \"box\"\nbox_m = [0.1, 0.06, 0.04]\n\
                    [[virtual]]\nname = \"card\"\nrect_m = [0.1, 0.06]\n";
        let scene = Scene::parse(Path::new("a.toml"), text).expect("a scene");
        let down = DMat3::from_cols(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z);
        let camera_from_anchor = DAffine3::from_mat3_translation(down, DVec3::Z * 0.5);
        let mut outline = SelectedOutline::default();
        for (thing, top_m) in [(&scene.virtuals[0], 0.04), (&scene.virtuals[1], 0.0)] {
            let edges = outline.edges_m(thing, &camera_from_anchor);
            let length_m: f64 = edges.iter().map(|[a, b]| a.distance(*b)).sum();
            assert!((length_m - 0.32).abs() < 1e-6, "{}: {length_m}", thing.name);
            for end in edges.iter().flatten() {
                assert!((end.z - top_m).abs() < 1e-6, "{}: {end}", thing.name);
            }
        }
    }
}
