//! What lets light through, taken out of a scene's things: layers that are drawn one over the other.

use std::borrow::Cow;
use std::sync::Arc;

use glam::DVec3;

use crate::geometry::bounds::Bounds;
use crate::geometry::mesh::CornerLook;
use crate::geometry::shadow_volume::LightPlace;
use crate::light::material::{Coverage, Encoding};
use crate::scene::{Motion, Object, Scene};

use super::opacity_map::OpacityMap;

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
pub(super) struct TranslucentLayer {
    /// The node that it stands on, and that by which it is there or not.
    pub stands_on: usize,
    pub node: usize,
    /// Part of the light that it takes on the average over its surface.
    pub opacity: f64,
    /// Its middle in its node's space, metres.
    pub middle: DVec3,
    pub visible: bool,
    /// All of it, on its node.
    thing: Arc<Object>,
    /// How opaque it is as the brightest light sees it; `None` where nobody has asked yet.
    seen_by_light: Option<Arc<OpacityMap>>,
}

impl TranslucentLayer {
    /// How opaque it is as a light sees it that stands so in its node's space; `None` where that stands in it.
    pub fn opacity_map(&mut self, light: LightPlace) -> Option<Arc<OpacityMap>> {
        let known = self.seen_by_light.take().filter(|map| map.is_for(light));
        self.seen_by_light = known.or_else(|| {
            let thing = &*self.thing;
            let positions = thing.positions_in_anchor(&thing.mesh);
            let opacity = |triangle, weights| opacity_between(thing, triangle, weights);
            let map = OpacityMap::new(&positions, &thing.mesh.triangles, opacity, light);
            map.map(Arc::new)
        });
        self.seen_by_light.clone()
    }

    /// Takes another shape.
    pub fn deform(&mut self, thing: &Object) {
        self.middle = middle(thing);
        self.thing = Arc::new(thing.clone());
        self.seen_by_light = None;
    }
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
            thing: Arc::new(layer.clone()),
            seen_by_light: None,
        });
        self.scene.to_mut().virtuals.push(layer);
    }
}

/// The middle of a thing in its node's space, metres.
fn middle(thing: &Object) -> DVec3 {
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
    let step = 1.0 / rows as f32;
    let cells = (0..rows).flat_map(|row| (0..rows - row).map(move |column| (row, column)));
    let places = cells.map(|(row, column)| {
        let (first, second) = (row as f32 + 1.0 / 3.0, column as f32 + 1.0 / 3.0);
        [first * step, second * step]
    });
    let opacity = |[first, second]: [f32; 2]| {
        opacity_between(thing, triangle, [1.0 - first - second, first, second])
    };
    places.map(opacity).collect()
}

/// The opacity of a place between a triangle's corners, 0 to 1.
fn opacity_between(thing: &Object, triangle: usize, weights: [f32; 3]) -> f64 {
    let material = &thing.materials[thing.mesh.triangle_materials[triangle] as usize];
    if material.coverage != Coverage::Blend {
        return 1.0;
    }
    let Some(looks) = thing.mesh.corner_looks.get(triangle) else {
        return material.opacity.clamp(0.0, 1.0);
    };
    let look = CornerLook::blended(looks.map(|look| &thing.mesh.looks[look as usize]), weights);
    let of_picture = thing.texel(material.maps.color, &look, Encoding::Linear).w;
    (material.opacity * of_picture * f64::from(look.color.w)).clamp(0.0, 1.0)
}
