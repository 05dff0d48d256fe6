//! What exporters write into the JSON of glTF files and nothing here depends on, mended before the `gltf` crate refuses the
//! whole file for it.

use std::collections::HashMap;

use serde_json::{Map, Value, json};

/// Semantics of attributes that the format has, and those that it numbers.
const SEMANTICS: [&str; 3] = ["POSITION", "NORMAL", "TANGENT"];
const NUMBERED_SEMANTICS: [&str; 4] = ["TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"];
/// OpenGL's old `CLAMP`, which exporters take for `CLAMP_TO_EDGE`.
const OLD_CLAMP: u64 = 10496;
const CLAMP_TO_EDGE: u64 = 33071;
const WRAPS: [u64; 3] = [CLAMP_TO_EDGE, 33648, 10497];

/// Mends a file's JSON; whether there was something to mend. `notes` gets what a user should know of it.
pub(super) fn mend(root: &mut Value, notes: &mut Vec<String>) -> bool {
    let Some(root) = root.as_object_mut() else {
        return false;
    };
    let mut is_mended = false;
    // Any value may stand there; the crate takes tables alone.
    for (_, value) in root.iter_mut() {
        is_mended |= without_extras(value);
    }
    is_mended |= root.remove("extras").is_some();
    // Cameras are passed over, so nothing that is wrong with them matters.
    is_mended |= root.remove("cameras").is_some();
    for node in entries(root, "nodes") {
        is_mended |= node.remove("camera").is_some();
    }
    for scene in entries(root, "scenes") {
        if !scene.contains_key("nodes") {
            scene.insert("nodes".to_owned(), json!([]));
            is_mended = true;
        }
    }
    for primitive in primitives(root) {
        if let Some(attributes) = primitive
            .get_mut("attributes")
            .and_then(Value::as_object_mut)
        {
            is_mended |= mend_attributes(attributes, notes);
        }
    }
    for sampler in entries(root, "samplers") {
        is_mended |= mend_sampler(sampler);
    }
    for view in entries(root, "bufferViews") {
        for key in ["byteStride", "target"] {
            if view.get(key).and_then(Value::as_u64) == Some(0) {
                view.remove(key);
                is_mended = true;
            }
        }
    }
    is_mended |= mend_strides(root);
    is_mended |= without_nodeless_channels(root, notes);
    for (number, material) in entries(root, "materials").enumerate() {
        let mode = material.get("alphaMode").and_then(Value::as_str);
        if let Some(mode) = mode.filter(|mode| !["OPAQUE", "MASK", "BLEND"].contains(mode)) {
            notes.push(format!(
                "materials[{number}].alphaMode: \"{mode}\" is none of OPAQUE, MASK and BLEND; taken for OPAQUE"
            ));
            material.remove("alphaMode");
            is_mended = true;
        }
    }
    is_mended
}

/// Takes away strides that are shorter than the format has them where they say nothing: all that is read of the view is of that
/// size, as indices are.
fn mend_strides(root: &mut Map<String, Value>) -> bool {
    let of_key = |table: &Map<String, Value>, key: &str| table.get(key).and_then(Value::as_u64);
    let mut size_of_view: HashMap<u64, Option<u64>> = HashMap::new();
    for accessor in entries(root, "accessors") {
        let Some(view) = of_key(accessor, "bufferView") else {
            continue;
        };
        let kind = accessor.get("type").and_then(Value::as_str);
        let size = match (kind, of_key(accessor, "componentType")) {
            (Some("SCALAR"), Some(5120 | 5121)) => Some(1),
            (Some("SCALAR"), Some(5122 | 5123)) | (Some("VEC2"), Some(5120 | 5121)) => Some(2),
            (Some("VEC3"), Some(5120 | 5121)) => Some(3),
            _ => None,
        };
        let known = size_of_view.entry(view).or_insert(size);
        *known = known.filter(|known| Some(*known) == size);
    }
    let mut is_mended = false;
    for (number, view) in entries(root, "bufferViews").enumerate() {
        let stride = of_key(view, "byteStride");
        let size = size_of_view.get(&(number as u64)).copied().flatten();
        if stride.is_some() && stride == size {
            view.remove("byteStride");
            is_mended = true;
        }
    }
    is_mended
}

/// Takes channels of animations away that move no node: the format says so, and those of KHR_animation_pointer move something
/// else.
fn without_nodeless_channels(root: &mut Map<String, Value>, notes: &mut Vec<String>) -> bool {
    let mut count = 0;
    for animation in entries(root, "animations") {
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
            continue;
        };
        let before = channels.len();
        channels.retain(|channel| {
            let target = channel.get("target").and_then(Value::as_object);
            target.is_none_or(|target| target.contains_key("node"))
        });
        count += before - channels.len();
    }
    if count > 0 {
        notes.push(format!(
            "channels of animations that move no node (KHR_animation_pointer) are passed over: {count}"
        ));
    }
    count > 0
}

fn entries<'a>(
    root: &'a mut Map<String, Value>,
    list: &str,
) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    let list = root.get_mut(list).and_then(Value::as_array_mut);
    list.into_iter().flatten().filter_map(Value::as_object_mut)
}

fn primitives(root: &mut Map<String, Value>) -> impl Iterator<Item = &mut Map<String, Value>> {
    entries(root, "meshes").flat_map(|mesh| entries(mesh, "primitives"))
}

/// Takes `extras` out of a value and all that is in it. (How deep it is, its parser has limited.)
fn without_extras(value: &mut Value) -> bool {
    match value {
        Value::Object(table) => {
            let mut found = table.remove("extras").is_some();
            for (_, value) in table.iter_mut() {
                found |= without_extras(value);
            }
            found
        }
        Value::Array(list) => {
            let mut found = false;
            for value in list {
                found |= without_extras(value);
            }
            found
        }
        _ => false,
    }
}

/// What an application has of its own begins with `_`; other unknown names are told.
fn mend_attributes(attributes: &mut Map<String, Value>, notes: &mut Vec<String>) -> bool {
    let is_known = |name: &str| {
        SEMANTICS.contains(&name)
            || NUMBERED_SEMANTICS.iter().any(|start| {
                let number = name.strip_prefix(start);
                number.is_some_and(|number| number.parse::<u32>().is_ok())
            })
    };
    let count = attributes.len();
    attributes.retain(|name, _| {
        if !is_known(name) && !name.starts_with('_') {
            let note = format!("the attribute {name} of vertices is not used");
            if !notes.contains(&note) {
                notes.push(note);
            }
        }
        is_known(name)
    });
    attributes.len() < count
}

fn mend_sampler(sampler: &mut Map<String, Value>) -> bool {
    let mut is_mended = false;
    for key in ["wrapS", "wrapT"] {
        let wrap = sampler.get(key).and_then(Value::as_u64);
        if wrap == Some(OLD_CLAMP) {
            sampler.insert(key.to_owned(), json!(CLAMP_TO_EDGE));
            is_mended = true;
        } else if sampler.contains_key(key) && !wrap.is_some_and(|wrap| WRAPS.contains(&wrap)) {
            sampler.remove(key);
            is_mended = true;
        }
    }
    let is_filter = |filter: u64| matches!(filter, 9728 | 9729 | 9984..=9987);
    for key in ["magFilter", "minFilter"] {
        let filter = sampler.get(key).and_then(Value::as_u64);
        let fits = filter
            .is_some_and(|filter| is_filter(filter) && (key == "minFilter" || filter <= 9729));
        if sampler.contains_key(key) && !fits {
            sampler.remove(key);
            is_mended = true;
        }
    }
    is_mended
}
