//! What lets light through, taken out of a scene's things: layers that are drawn one over the other.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::bounds::Bounds;
use crate::light::Material;
use crate::light::material::{Coverage, Encoding};
use crate::scene::{Motion, Object, Scene};

/// Parts of a thing that hang together in no place are layers of their own, up to this number; with more, such as leaves,
/// they are one.
const MOST_PARTS: usize = 4;
/// What is nowhere less opaque is opaque.
const OPAQUE: f64 = 0.99;
/// Places at which the opacity of a part is looked at, about.
const MOST_SAMPLES: f64 = 20_000.0;

/// A scene whose things are opaque, but for those that are layers.
pub(super) struct LayeredScene<'a> {
    /// With a thing more for each layer, after the others, each on a node of its own after the others.
    pub scene: Cow<'a, Scene>,
    pub layers: Vec<TranslucentLayer>,
}

/// A thing, or a part of one, that lets light through.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TranslucentLayer {
    /// The node that it stands on, and that by which it is there or not.
    pub stands_on: usize,
    pub node: usize,
    /// Part of the light that it takes on the average over its surface.
    pub opacity: f64,
    /// Its middle in its node's space, metres.
    pub middle: DVec3,
    pub visible: bool,
}

impl<'a> LayeredScene<'a> {
    /// Takes layers out of a scene.
    pub fn new(scene: &'a Scene) -> Self {
        let mut layered = Self {
            scene: Cow::Borrowed(scene),
            layers: Vec::new(),
        };
        for (index, thing) in scene.virtuals.iter().enumerate() {
            layered.take_out_of(index, thing);
        }
        layered
    }

    fn take_out_of(&mut self, index: usize, thing: &Object) {
        let is_translucent = |triangle: &usize| {
            let material = thing.mesh.triangle_materials[*triangle];
            thing.materials[material as usize].coverage == Coverage::Blend
        };
        let all = 0..thing.mesh.triangles.len();
        let triangles: Vec<usize> = all.clone().filter(is_translucent).collect();
        if triangles.is_empty() {
            return;
        }
        let mut parts = thing.mesh.separate(&triangles);
        if parts.len() > MOST_PARTS {
            parts = vec![triangles];
        }
        let mut is_left = vec![true; all.len()];
        for part in &parts {
            let Some(opacity) = mean_opacity(thing, part) else {
                continue;
            };
            part.iter().for_each(|&triangle| is_left[triangle] = false);
            self.add(thing, part, opacity);
        }
        let left: Vec<usize> = all.filter(|&triangle| is_left[triangle]).collect();
        if left.len() < is_left.len() {
            let rest = &mut self.scene.to_mut().virtuals[index];
            rest.visible &= !left.is_empty();
            // (A thing of no triangles is none.)
            if !left.is_empty() {
                rest.mesh = Arc::new(thing.mesh.part(&left));
            }
        }
    }

    fn add(&mut self, thing: &Object, part: &[usize], opacity: f64) {
        let node = self.scene.node_count();
        let layer = Object {
            mesh: Arc::new(thing.mesh.part(part)),
            anchor: node,
            motion: Some(Motion::none(thing.stands_on())),
            ..thing.clone()
        };
        self.layers.push(TranslucentLayer {
            stands_on: thing.anchor,
            node,
            opacity,
            middle: middle(&layer),
            visible: thing.visible,
        });
        self.scene.to_mut().virtuals.push(layer);
    }
}

/// The middle of a thing in its node's space, metres.
pub(super) fn middle(thing: &Object) -> DVec3 {
    let positions = thing.positions_in_anchor(&thing.mesh);
    let bounds = Bounds::around(positions.iter().map(|position| position.as_dvec3()));
    bounds.map_or(DVec3::ZERO, |bounds| 0.5 * (bounds.low + bounds.high))
}

/// The mean opacity of some of a thing's triangles by their area; `None` where they are opaque.
fn mean_opacity(thing: &Object, triangles: &[usize]) -> Option<f64> {
    let rows = (2.0 * MOST_SAMPLES / triangles.len() as f64).sqrt();
    let rows = (rows as u32).clamp(1, 48);
    let (mut sum, mut whole, mut least) = (0.0, 0.0, 1.0_f64);
    for &triangle in triangles {
        let corners = thing.mesh.triangles[triangle];
        let [a, b, c] = corners.map(|it| thing.mesh.positions[it as usize].as_dvec3());
        let area = (b - a).cross(c - a).length();
        let opacities = opacities(thing, triangle, rows);
        sum += area * opacities.iter().sum::<f64>() / opacities.len() as f64;
        whole += area;
        least = opacities.into_iter().fold(least, f64::min);
    }
    (least < OPAQUE && whole > 0.0).then(|| sum / whole)
}

/// The opacity of a triangle in the middles of small ones, of which `rows` lie along each of its sides.
fn opacities(thing: &Object, triangle: usize, rows: u32) -> Vec<f64> {
    let material = &thing.materials[thing.mesh.triangle_materials[triangle] as usize];
    if material.coverage != Coverage::Blend {
        return vec![1.0];
    }
    let Some(looks) = thing.mesh.corner_looks.get(triangle) else {
        return vec![material.opacity];
    };
    let looks = looks.map(|look| thing.mesh.looks[look as usize]);
    let step = 1.0 / rows as f32;
    let cells = (0..rows).flat_map(|row| (0..rows - row).map(move |column| (row, column)));
    let places = cells.map(|(row, column)| {
        let (first, second) = (row as f32 + 1.0 / 3.0, column as f32 + 1.0 / 3.0);
        [first * step, second * step]
    });
    places
        .map(|[first, second]| {
            let weights = [1.0 - first - second, first, second];
            let mixed = |of: &dyn Fn(usize) -> glam::Vec4| {
                (0..3)
                    .map(|corner| of(corner) * weights[corner])
                    .sum::<glam::Vec4>()
            };
            let uv = mixed(&|corner| {
                let [first, second] = looks[corner].uv;
                glam::Vec4::new(first.x, first.y, second.x, second.y)
            });
            let color = mixed(&|corner| looks[corner].color);
            opacity_at(thing, material, [uv.x, uv.y, uv.z, uv.w]) * f64::from(color.w)
        })
        .map(|opacity| opacity.clamp(0.0, 1.0))
        .collect()
}

fn opacity_at(thing: &Object, material: &Material, [u_0, v_0, u_1, v_1]: [f32; 4]) -> f64 {
    let map = material.maps.color;
    let picture = map.and_then(|map| Some((map, thing.textures.get(map.texture as usize)?)));
    let of_picture = picture.map_or(1.0, |(map, texture)| {
        let uv = match map.uv_set {
            0 => glam::Vec2::new(u_0, v_0),
            _ => glam::Vec2::new(u_1, v_1),
        };
        texture.sample(&map, uv, Encoding::Linear).w
    });
    material.opacity * of_picture
}
