//! Animations of glTF files as a scene plays them: closed forms, what a scene may ask for, and files that are wrong.

use glam::{DQuat, DVec3, Vec3};
use gnomon::app::jobs::check;
use gnomon::scene::{Object, Scene};
use serde_json::{Value, json};
use std::f64::consts::FRAC_PI_2;

use crate::common::rigs::{LEANING, bar, bent_part, hinge, morphing_box};

/// A scene with a file as its only thing, with these keys.
pub fn scene_of(kind: &str, model: &Value, keys: &str) -> Result<Scene, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.gltf"), model.to_string()).unwrap();
    let path = folder.path().join("scene.toml");
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n\
         [[{kind}]]\nname = \"it\"\nmesh = \"a.gltf\"\n{keys}"
    );
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).map_err(|error| error.to_string())
}

fn thing_of(model: &Value, keys: &str) -> Object {
    let scene = scene_of("virtual", model, keys).unwrap();
    scene.virtuals.into_iter().next().unwrap()
}

/// The shape at a time, and that in which it was read.
fn shapes(model: &Value, keys: &str, time_s: f64) -> (Object, Object) {
    let still = thing_of(model, keys);
    let mut moved = still.clone();
    moved.take_shape(time_s);
    (still, moved)
}

/// From the file's axes to the mesh's.
fn upright(place: DVec3) -> DVec3 {
    DVec3::new(place.x, -place.z, place.y)
}

fn from_upright(place: Vec3) -> DVec3 {
    let place = place.as_dvec3();
    DVec3::new(place.x, place.z, -place.y)
}

/// Where a vertex of the bar is, bent by an angle.
fn on_bar(place: DVec3, angle_rad: f64) -> DVec3 {
    let part = bent_part(place.y);
    let turned = DVec3::Y + DQuat::from_rotation_z(angle_rad) * (place - DVec3::Y);
    place * (1.0 - part) + turned * part
}

#[test]
fn a_skinned_bar_bends_as_its_closed_form_says() {
    for (time_s, angle_rad) in [
        (0.0, 0.0),
        (0.5, FRAC_PI_2 / 2.0),
        (1.0, FRAC_PI_2),
        (1.75, FRAC_PI_2 / 4.0),
        // It begins again after two seconds.
        (2.5, FRAC_PI_2 / 2.0),
    ] {
        let (still, moved) = shapes(&bar(), "animation = \"Bend\"\nsmooth_deg = 0\n", time_s);
        assert_eq!(moved.mesh.positions.len(), 36);
        assert!(moved.mesh.closed_and_consistent());
        for (rest, found) in still.mesh.positions.iter().zip(&moved.mesh.positions) {
            let expected = upright(on_bar(from_upright(*rest), angle_rad));
            let off = found.as_dvec3().distance(expected);
            assert!(off < 1e-6, "{time_s} s: {found} for {expected}");
        }
        // Flat faces stand on their triangles.
        let triangles = moved.mesh.triangles.iter().zip(&moved.mesh.corner_normals);
        for (triangle, normals) in triangles {
            let [a, b, c] = triangle.map(|it| moved.mesh.positions[it as usize]);
            let normal = (b - a).cross(c - a).normalize();
            assert!(normals.iter().all(|it| it.distance(normal) < 1e-5));
        }
    }
}

#[test]
fn a_box_morphs_along_the_spline_and_a_phantom_as_well() {
    for kind in ["virtual", "phantom"] {
        let scene = scene_of(kind, &morphing_box(), "animation = 0\nfit_m = 0.5\n").unwrap();
        for time_s in [0.0, 0.125, 0.25, 0.5, 0.875] {
            let shaped = scene.shaped_at(time_s);
            let mut things = shaped.phantoms.iter().chain(&shaped.virtuals);
            let positions = &things.next().unwrap().mesh.positions;
            // Hermite's spline between 0 and 1 without slopes.
            let part = 1.0 - (2.0 * time_s - 1.0).abs();
            let weight = part * part * (3.0 - 2.0 * part);
            let highest = positions.iter().map(|place| place.z).fold(0.0, f32::max);
            let expected = 0.5 * (1.0 + f64::from(LEANING[1]) * weight);
            let off = (f64::from(highest) - expected).abs();
            assert!(off < 1e-6, "{kind} {time_s} s: {highest} for {expected}");
        }
    }
}

#[test]
fn parts_that_touch_at_rest_part_in_motion() {
    let (still, opened) = shapes(
        &hinge(),
        "animation = 0\nanimation_loop = false\nsmooth_deg = 0\n",
        1.0,
    );
    // Two boxes, of which none lends the other its corners: eight each, and both closed.
    assert_eq!(still.mesh.positions.len(), 16);
    assert!(opened.mesh.closed_and_consistent());
    let opened_to = |corner: DVec3| {
        let expected = upright(corner);
        let found = opened.mesh.positions.iter();
        found
            .map(|place| place.as_dvec3().distance(expected))
            .fold(f64::INFINITY, f64::min)
    };
    // The lid stands up at the edge, the box lies as it lay.
    for corner in [
        [0.0, 1.4, 1.0],
        [-0.4, 1.4, 0.0],
        [1.0, 0.4, 1.0],
        [0.0, 0.0, 0.0],
    ] {
        assert!(opened_to(DVec3::from_array(corner)) < 1e-6, "{corner:?}");
    }
    let volume = opened.mesh.signed_volume_m3();
    assert!((volume - 0.8).abs() < 1e-6, "{volume}");
}

#[test]
fn speed_and_loop_say_which_moment_is_shown() {
    let height = |keys: &str, time_s: f64| {
        let (_, moved) = shapes(&bar(), &format!("animation = \"Bend\"\n{keys}"), time_s);
        let places = moved.mesh.positions.iter();
        places.map(|place| place.z).fold(0.0, f32::max)
    };
    let at = |time_s: f64| height("", time_s);
    for (keys, time_s, same_as) in [
        ("animation_speed = 2\n", 0.25, 0.5),
        ("animation_speed = -1\n", 0.5, 1.5),
        ("animation_speed = 0\n", 0.7, 0.0),
        ("animation_speed = 0.5\nanimation_loop = false\n", 2.0, 1.0),
        ("animation_loop = false\n", 77.0, 0.0),
        ("animation_speed = -1\nanimation_loop = false\n", 1.0, 1.0),
        ("animation_speed = -1\nanimation_loop = false\n", 9.0, 0.0),
    ] {
        let (found, expected) = (height(keys, time_s), at(same_as));
        assert!(
            (found - expected).abs() < 1e-6,
            "{keys}: {found} {expected}"
        );
    }
    assert!(at(0.0) > at(1.0) + 0.5);
    // What has ended stays as it ends: the jump's last key, not its first.
    let jumped = shapes(
        &hinge(),
        "animation = \"Jump\"\nanimation_loop = false\n",
        5.0,
    )
    .1;
    let highest = jumped
        .mesh
        .positions
        .iter()
        .map(|place| place.z)
        .fold(0.0, f32::max);
    assert!((highest - 1.3).abs() < 1e-6, "{highest}");
}

#[test]
fn what_a_scene_asks_for_amiss_is_told_with_what_there_is() {
    let of = |model: &Value, keys: &str| scene_of("virtual", model, keys).unwrap_err();
    let none = json!({"asset": {"version": "2.0"}, "nodes": [{}], "scenes": [{"nodes": [0]}]});
    for (model, keys, expected) in [
        (
            bar(),
            "animation = \"Walk\"\n",
            "allowed: those of its file: 0 \"Bend\"",
        ),
        (hinge(), "animation = 2\n", "0, 1 \"Jump\""),
        (hinge(), "animation = -1\n", "animation"),
        (hinge(), "animation = true\n", "animation"),
        (none, "animation = 0\n", "its file has no animation"),
        (bar(), "animation_speed = 2\n", "nothing plays"),
        (bar(), "animation_loop = false\n", "nothing plays"),
        (bar(), "animation = 0\nanimation_speed = 1e9\n", "1000"),
        (bar(), "animation = 0\nbox_m = [1, 1, 1]\n", "box_m"),
    ] {
        let message = of(&model, keys);
        let place = "scene.toml:";
        assert!(
            message.contains(expected) && message.contains(place),
            "{keys}: {message}"
        );
    }
    let text = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n\
                [[virtual]]\nname = \"it\"\nbox_m = [1, 1, 1]\nanimation = \"Walk\"\n";
    let message = Scene::parse("scene.toml".as_ref(), text)
        .unwrap_err()
        .to_string();
    assert!(message.contains("it is of a glTF file"), "{message}");
}

#[test]
fn check_tells_what_there_is_and_what_plays() {
    let told = |keys: &str| check::summary(&scene_of("virtual", &hinge(), keys).unwrap());
    assert!(
        told("").contains("animations 0 1 s, 1 \"Jump\" 1 s"),
        "{}",
        told("")
    );
    let plays = told("animation = \"Jump\"\nanimation_speed = -2\nanimation_loop = false\n");
    let expected = "1 \"Jump\" 1 s (plays at -2 times its speed, once)";
    assert!(plays.contains(expected), "{plays}");
    assert!(!plays.contains("moves by itself"));
}

#[test]
fn without_an_animation_a_file_is_in_its_rest_pose_and_its_animations_are_not_looked_into() {
    let mut broken = bar();
    broken["animations"][0]["samplers"][0]["output"] = json!(0);
    let (still, moved) = shapes(&broken, "", 1.0);
    assert_eq!(still.mesh, moved.mesh);
    assert!(still.animation.is_none() && still.motion.is_none());
}

#[test]
fn hostile_animations_are_errors_with_their_place() {
    type Spoil = fn(&mut Value);
    let spoiled: [(&str, Spoil, &str); 15] = [
        (
            "joint",
            |j| j["skins"][0]["joints"] = json!([1]),
            "joint 1 of 1",
        ),
        (
            "binds",
            |j| j["accessors"][4]["count"] = json!(1),
            "skins[0]",
        ),
        (
            "lengths",
            |j| j["accessors"][5]["count"] = json!(2),
            "animations[0].samplers[0].input: 3 values; 2 are expected for its 2 keys",
        ),
        (
            "spline",
            |j| j["animations"][0]["samplers"][0]["interpolation"] = json!("CUBICSPLINE"),
            "9 are expected for its 3 keys",
        ),
        ("no keys", |j| j["accessors"][5]["count"] = json!(0), ""),
        (
            "one time twice",
            // The times' numbers: what is read twice is no later.
            |j| {
                j["accessors"][5]["sparse"] = json!({"count": 1,
                "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 5, "byteOffset": 8}})
            },
            "animations[0].samplers[0].input: key 1 is not later than the one before it",
        ),
        (
            "kind of turns",
            |j| j["animations"][0]["samplers"][0]["output"] = json!(0),
            "animations[0].samplers[0].output: accessors[0]",
        ),
        (
            "kind of times",
            |j| j["animations"][0]["samplers"][0]["input"] = json!(0),
            "animations[0].samplers[0].input: accessors[0]",
        ),
        (
            "sampler",
            |j| j["animations"][0]["channels"][0]["sampler"] = json!(7),
            "animations[0].channels[0].sampler",
        ),
        (
            "node",
            |j| j["animations"][0]["channels"][0]["target"]["node"] = json!(70),
            "animations[0].channels[0].target.node",
        ),
        (
            "path",
            |j| j["animations"][0]["channels"][0]["target"]["path"] = json!("pointer"),
            "animations[0].channels[0].target.path: not read; allowed: translation",
        ),
        (
            "nothing but a pointer",
            |j| {
                let target = json!({"path": "pointer"});
                j["animations"][0]["channels"] = json!([{"sampler": 0, "target": target}]);
            },
            "animations[0]: no channel of it moves a node",
        ),
        (
            "weights of nothing",
            |j| {
                j["animations"][0]["channels"][0]["target"]["path"] = json!("weights");
                j["animations"][0]["samplers"][0]["output"] = json!(5);
            },
            "nodes[2] has no morph targets",
        ),
        (
            "twice",
            |j| {
                let channel = j["animations"][0]["channels"][0].clone();
                j["animations"][0]["channels"] = json!([channel, channel]);
            },
            "animations[0].channels[1]: nodes[2] has two channels",
        ),
        (
            "circle",
            |j| j["nodes"][2]["children"] = json!([1]),
            "its own ancestor",
        ),
    ];
    for (name, spoil, expected) in spoiled {
        let mut model = bar();
        spoil(&mut model);
        let message = scene_of("virtual", &model, "animation = 0\n").unwrap_err();
        let is_told = message.contains("a.gltf") && message.contains(expected);
        assert!(is_told, "{name}: {message}");
    }
}

/// Numbers of the bar's turns and times, as they lie in its file, made to what is none.
#[test]
fn numbers_that_are_none_are_told() {
    use base64::Engine as _;
    use base64::engine::general_purpose::STANDARD;
    for (accessor, number, value, expected) in [
        (5, 1, f32::NAN, "accessors[5]: element 1 is not finite"),
        (5, 0, -1.0, "key 0 has a time that is below 0"),
        (6, 2, f32::INFINITY, "accessors[6]: element 0 is not finite"),
    ] {
        let mut model = bar();
        let view = model["accessors"][accessor]["bufferView"].as_u64().unwrap() as usize;
        let offset = model["bufferViews"][view]["byteOffset"].as_u64().unwrap() as usize;
        let uri = model["buffers"][0]["uri"].as_str().unwrap().to_owned();
        let mut data = STANDARD
            .decode(uri.strip_prefix("data:;base64,").unwrap())
            .unwrap();
        let place = offset + 4 * number;
        data[place..place + 4].copy_from_slice(&f32::to_le_bytes(value));
        let uri = format!("data:;base64,{}", STANDARD.encode(&data));
        model["buffers"][0]["uri"] = json!(uri);
        let message = scene_of("virtual", &model, "animation = 0\n").unwrap_err();
        assert!(message.contains(expected), "{message}");
    }
}

/// Whatever is changed in a file, it is read or refused; and what is read can be shown at any time.
#[test]
fn a_spoiled_animation_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let mut random = fastrand::Rng::with_seed(11);
    let mut read = 0;
    for round in 0..900 {
        let model = match round % 3 {
            0 => bar(),
            1 => morphing_box(),
            _ => hinge(),
        };
        let mut bytes = model.to_string().into_bytes();
        for _ in 0..random.usize(1..4) {
            let at = random.usize(..bytes.len());
            // Other numbers, letters and brackets at times where there are some.
            bytes[at] = match bytes[at] {
                b'0'..=b'9' => random.u8(b'0'..=b'9'),
                b'A'..=b'Z' | b'a'..=b'z' => random.u8(b'A'..=b'z'),
                _ => random.u8(..),
            };
        }
        std::fs::write(folder.path().join("a.gltf"), &bytes).unwrap();
        let text = "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n\
                    [[virtual]]\nname = \"it\"\nmesh = \"a.gltf\"\nanimation = 0\nanimation_speed = 0.7\n";
        std::fs::write(&path, text).unwrap();
        let Ok(scene) = Scene::load(&path) else {
            continue;
        };
        read += 1;
        for time_s in [0.0, 0.3, 1.7, 1e7] {
            let shaped = scene.shaped_at(time_s);
            let mesh = &shaped.virtuals[0].mesh;
            assert!(mesh.positions.iter().all(|place| place.is_finite()));
            let normals = mesh.corner_normals.iter().flatten();
            assert!(normals.into_iter().all(|normal| normal.is_finite()));
        }
    }
    assert!(read > 100, "{read}");
}
