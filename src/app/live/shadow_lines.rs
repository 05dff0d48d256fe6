//! Where shadows begin, and the sides of their volumes, as lines in space for the window to draw.

use glam::{DAffine3, DVec3};

use crate::geometry::shadow_volume::{Caster, LightPlace};
use crate::light::Light;
use crate::scene::SceneLight;
use crate::scene::{Object, Scene};

/// Sides of volumes are drawn up to the table, but no longer than this, metres.
const LONGEST_M: f64 = 1.5;

/// The casters of a scene, prepared while they stand still.
#[derive(Default)]
pub struct ShadowLines {
    standing: Vec<(String, usize, DAffine3, bool)>,
    casters: Vec<StandingCaster>,
}

struct StandingCaster {
    anchor: usize,
    is_virtual: bool,
    /// In its anchor's space.
    caster: Caster,
}

/// An edge of an outline, and where the light that grazes it falls. In the space of its anchor, metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShadowLine {
    /// What it stands on.
    pub anchor: usize,
    /// Whether a virtual thing casts it.
    pub is_virtual: bool,
    /// The ends of the edge.
    pub edge_m: [DVec3; 2],
    /// Where the shadows of the two ends fall.
    pub shadow_m: [DVec3; 2],
}

impl ShadowLines {
    /// The outlines of all that casts, for each light, with the anchors where `world_from_anchor` has them.
    pub fn lines(
        &mut self,
        scene: &Scene,
        world_from_anchor: &[Option<DAffine3>],
    ) -> Vec<ShadowLine> {
        self.prepare(scene);
        let mut lines = Vec::new();
        for SceneLight { anchor, light } in &scene.lights {
            let Some(pose) = world_from_anchor.get(*anchor).copied().flatten() else {
                continue;
            };
            let light = light.moved(&pose);
            for standing in &self.casters {
                let pose = world_from_anchor.get(standing.anchor).copied().flatten();
                let Some(world_from_anchor) = pose else {
                    continue;
                };
                let anchor_from_world = world_from_anchor.inverse();
                let place = match light {
                    Light::Point { position_m, .. } => {
                        LightPlace::Point(anchor_from_world.transform_point3(position_m))
                    }
                    Light::Directional { direction, .. } => {
                        LightPlace::Along(anchor_from_world.transform_vector3(direction))
                    }
                };
                let cast = |point_m: DVec3| {
                    let in_world = world_from_anchor.transform_point3(point_m);
                    anchor_from_world.transform_point3(shadow_of(in_world, &light))
                };
                lines.extend(
                    standing
                        .caster
                        .outline_edges(place)
                        .into_iter()
                        .map(|edge| {
                            let edge_m = edge.map(|end| end.as_dvec3());
                            ShadowLine {
                                anchor: standing.anchor,
                                is_virtual: standing.is_virtual,
                                edge_m,
                                shadow_m: edge_m.map(cast),
                            }
                        }),
                );
            }
        }
        lines
    }

    fn prepare(&mut self, scene: &Scene) {
        let things = || scene.phantoms.iter().chain(&scene.virtuals);
        let standing: Vec<_> = things()
            .map(|thing| {
                let casts = thing.visible && thing.casts;
                let place = thing.anchor_from_object;
                (thing.name.clone(), thing.anchor, place, casts)
            })
            .collect();
        let deforms = things().any(|thing| thing.animation.is_some());
        if standing == self.standing && !deforms {
            return;
        }
        let casting = things().enumerate().filter(|(_, t)| t.visible && t.casts);
        self.casters = casting
            .map(|(index, thing)| StandingCaster {
                anchor: thing.anchor,
                is_virtual: index >= scene.phantoms.len(),
                caster: caster_of(thing),
            })
            .collect();
        self.standing = standing;
    }
}

/// A thing as it casts shadows, in its anchor's space.
pub fn caster_of(thing: &Object) -> Caster {
    let place = |position: &glam::Vec3| {
        let position = thing
            .anchor_from_object
            .transform_point3(position.as_dvec3());
        position.as_vec3()
    };
    let positions = thing.mesh.positions.iter().map(place).collect();
    Caster::new(positions, thing.mesh.triangles.clone())
}

/// Where the shadow of a point falls on the table (z = 0 of the world), or as far as it is drawn.
fn shadow_of(point_m: DVec3, light: &Light) -> DVec3 {
    let away = match *light {
        Light::Point { position_m, .. } => point_m - position_m,
        Light::Directional { direction, .. } => direction,
    };
    let away = away.normalize_or_zero();
    let to_table_m = match away.z < -1e-6 {
        true => (-point_m.z / away.z).max(0.0),
        false => LONGEST_M,
    };
    point_m + away * to_table_m.min(LONGEST_M)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn a_box_under_a_lamp_casts_from_the_outline_that_the_lamp_sees() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.toml");
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let block = root.join("models/block.obj");
        let text = format!(
            "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.04\n\
             [[virtual]]\nname = \"block\"\nmesh = {:?}\n\
             [[light]]\nkind = \"directional\"\ndirection = [0, 0, -1]\nirradiance = 1\n",
            block.to_str().unwrap()
        );
        let scene = Scene::parse(&path, &text).unwrap();
        let mut lines = ShadowLines::default();
        let found = lines.lines(&scene, &[Some(DAffine3::IDENTITY)]);
        let positions = &scene.virtuals[0].mesh.positions;
        let top_m = positions.iter().map(|p| p.z).fold(f32::MIN, f32::max);
        assert!(
            found.len() >= 4,
            "a box from above has four edges: {found:?}"
        );
        for line in &found {
            for (edge_m, shadow_m) in line.edge_m.iter().zip(line.shadow_m) {
                assert_eq!(edge_m.truncate(), shadow_m.truncate(), "straight below");
                assert!(edge_m.z <= f64::from(top_m));
                assert!(shadow_m.z.abs() < 1e-9 || edge_m.z <= 0.0);
            }
        }
        assert_eq!(lines.lines(&scene, &[None]), [], "where no anchor is seen");
        let mut hidden = scene.clone();
        hidden.virtuals[0].visible = false;
        assert_eq!(lines.lines(&hidden, &[Some(DAffine3::IDENTITY)]), []);
    }
}
