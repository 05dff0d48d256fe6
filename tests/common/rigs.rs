//! Small models that move, written byte by byte as glTF: a bar that two joints bend, a box that morphs, a hinge of two boxes.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gnomon::geometry::cuboid::SIDES;
use serde_json::{Value, json};

/// A glTF file that is being written.
#[derive(Default)]
pub struct GltfFile {
    data: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl GltfFile {
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let offset = self.data.len();
        self.views
            .push(json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}));
        self.data.extend_from_slice(bytes);
        self.views.len() - 1
    }

    /// An accessor of tuples of numbers.
    pub fn floats<const N: usize>(&mut self, tuples: &[[f32; N]]) -> usize {
        let kind = match N {
            1 => "SCALAR",
            3 => "VEC3",
            4 => "VEC4",
            16 => "MAT4",
            _ => panic!("no such kind"),
        };
        let bytes: Vec<u8> = (tuples.as_flattened().iter())
            .flat_map(|number| number.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        let mut accessor =
            json!({"bufferView": view, "componentType": 5126, "count": tuples.len(), "type": kind});
        if N == 1 {
            let numbers = tuples.iter().map(|tuple| tuple[0]);
            let finite = numbers.filter(|number| number.is_finite());
            accessor["max"] = json!([finite.fold(0.0, f32::max)]);
            accessor["min"] = json!([0.0]);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// An accessor of whole numbers of 16 bits.
    pub fn shorts<const N: usize>(&mut self, tuples: &[[u16; N]]) -> usize {
        let kind = if N == 1 { "SCALAR" } else { "VEC4" };
        let bytes: Vec<u8> = (tuples.as_flattened().iter())
            .flat_map(|number| number.to_le_bytes())
            .collect();
        let view = self.view(&bytes);
        self.accessors.push(
            json!({"bufferView": view, "componentType": 5123, "count": tuples.len(), "type": kind}),
        );
        self.accessors.len() - 1
    }

    /// The whole file, with what else it has.
    pub fn finished(self, rest: &Value) -> Value {
        let uri = format!("data:;base64,{}", STANDARD.encode(&self.data));
        let mut json = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"uri": uri, "byteLength": self.data.len()}],
            "bufferViews": self.views,
            "accessors": self.accessors,
            "scene": 0
        });
        for (key, value) in rest.as_object().expect("an object") {
            json[key] = value.clone();
        }
        json
    }
}

/// Two triangles for each four corners, counter-clockwise seen from outside.
fn quads(corners: &[[u16; 4]]) -> Vec<[u16; 1]> {
    let triangles = corners.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]);
    triangles.map(|index| [index]).collect()
}

/// A quarter turn about z.
const QUARTER: [f32; 4] = [
    0.0,
    0.0,
    std::f32::consts::FRAC_1_SQRT_2,
    std::f32::consts::FRAC_1_SQRT_2,
];
/// No turn.
const NONE: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// How much of a bar's cross-section at a height its upper joint holds.
pub fn bent_part(height: f64) -> f64 {
    (height - 0.5).clamp(0.0, 1.0)
}

/// A bar of 0.4 x 2 x 0.4 that stands at the origin. Its upper joint, half way up, turns by 90 degrees about z in a second, and
/// back in another ("Bend").
pub fn bar() -> Value {
    let mut file = GltfFile::default();
    let rings = 9_u16;
    let ring = |number: u16| {
        let y = f32::from(number) / 4.0;
        [
            [-0.2, y, -0.2],
            [-0.2, y, 0.2],
            [0.2, y, 0.2],
            [0.2, y, -0.2],
        ]
    };
    let positions: Vec<[f32; 3]> = (0..rings).flat_map(ring).collect();
    let joints: Vec<[u16; 4]> = positions.iter().map(|_| [0, 1, 0, 0]).collect();
    let weights: Vec<[f32; 4]> = positions
        .iter()
        .map(|&[_, y, _]| {
            let part = bent_part(f64::from(y)) as f32;
            [1.0 - part, part, 0.0, 0.0]
        })
        .collect();
    let mut sides: Vec<[u16; 4]> = (0..rings - 1)
        .flat_map(|ring| {
            (0..4).map(move |side| {
                let (low, high) = (4 * ring, 4 * ring + 4);
                let next = (side + 1) % 4;
                [low + side, low + next, high + next, high + side]
            })
        })
        .collect();
    let top = 4 * (rings - 1);
    sides.extend([[3, 2, 1, 0], [top, top + 1, top + 2, top + 3]]);
    let mut down = [0.0; 16];
    for diagonal in [0, 5, 10, 15] {
        down[diagonal] = 1.0;
    }
    let same = down;
    down[13] = -1.0;
    let accessors = [
        file.floats(&positions),
        file.shorts(&joints),
        file.floats(&weights),
        file.shorts(&quads(&sides)),
        file.floats(&[same, down]),
        file.floats(&[[0.0], [1.0], [2.0]]),
        file.floats(&[NONE, QUARTER, NONE]),
    ];
    let [position, joint, weight, indices, binds, times, turns] = accessors;
    file.finished(&json!({
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": position, "JOINTS_0": joint, "WEIGHTS_0": weight}, "indices": indices
        }]}],
        "nodes": [{"mesh": 0, "skin": 0}, {"children": [2]}, {"translation": [0, 1, 0]}],
        "skins": [{"joints": [1, 2], "inverseBindMatrices": binds}],
        "scenes": [{"nodes": [0, 1]}],
        "animations": [{"name": "Bend",
            "samplers": [{"input": times, "output": turns}],
            "channels": [{"sampler": 0, "target": {"node": 2, "path": "rotation"}}]}]
    }))
}

/// The corners of a box, and its sides.
fn cuboid([x, y, z]: [f32; 3]) -> (Vec<[f32; 3]>, Vec<[u16; 1]>) {
    let positions = (0..8_u8).map(|corner| {
        let bit = |number: u8, length: f32| {
            if corner >> number & 1 == 1 {
                length
            } else {
                0.0
            }
        };
        [bit(0, x), bit(1, y), bit(2, z)]
    });
    let sides = SIDES.map(|side| side.map(|corner| corner as u16));
    (positions.collect(), quads(&sides))
}

/// How far the top of the box that morphs goes.
pub const LEANING: [f32; 3] = [0.5, 0.75, 0.25];

/// A box from the origin to 1 whose top leans and rises ("Lean": by splines, half a second each way, without tangents).
pub fn morphing_box() -> Value {
    let mut file = GltfFile::default();
    let (positions, indices) = cuboid([1.0; 3]);
    let moves: Vec<[f32; 3]> = positions
        .iter()
        .map(|&[_, y, _]| if y > 0.5 { LEANING } else { [0.0; 3] })
        .collect();
    let keys: Vec<[f32; 1]> = [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
        .map(|it| [it])
        .to_vec();
    let [position, indices, moves, times, keys] = [
        file.floats(&positions),
        file.shorts(&indices),
        file.floats(&moves),
        file.floats(&[[0.0], [0.5], [1.0]]),
        file.floats(&keys),
    ];
    file.finished(&json!({
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": position}, "indices": indices, "targets": [{"POSITION": moves}]
        }]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "animations": [{"name": "Lean",
            "samplers": [{"input": times, "output": keys, "interpolation": "CUBICSPLINE"}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}]}]
    }))
}

/// A box of 1 x 0.4 x 1 and its lid, which is like it and lies on it at rest. It opens about its edge at x = 0 by 90 degrees in
/// the first animation, which has no name, and leaps up by 0.5 after a second in the second, "Jump".
pub fn hinge() -> Value {
    let mut file = GltfFile::default();
    let (positions, indices) = cuboid([1.0, 0.4, 1.0]);
    let [position, indices, times, turns, places] = [
        file.floats(&positions),
        file.shorts(&indices),
        file.floats(&[[0.0], [1.0]]),
        file.floats(&[NONE, QUARTER]),
        file.floats(&[[0.0, 0.4, 0.0], [0.0, 0.9, 0.0]]),
    ];
    file.finished(&json!({
        "meshes": [{"primitives": [{"attributes": {"POSITION": position}, "indices": indices}]}],
        "nodes": [{"mesh": 0, "children": [1]}, {"mesh": 0, "translation": [0, 0.4, 0]}],
        "scenes": [{"nodes": [0]}],
        "animations": [
            {"samplers": [{"input": times, "output": turns}],
             "channels": [{"sampler": 0, "target": {"node": 1, "path": "rotation"}}]},
            {"name": "Jump", "samplers": [{"input": times, "output": places, "interpolation": "STEP"}],
             "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}]}
        ]
    }))
}
