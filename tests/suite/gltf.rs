//! glTF files as the program reads them: written here byte by byte, with known answers, and hostile ones.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use gnomon::light::material::{Coverage, Shading, Wrap};
use gnomon::scene::mesh_format::MeshFormat;
use gnomon::scene::{Object, Scene};
use serde_json::{Value, json};

/// A scene with a file as its only virtual thing.
fn read_file(path: &Path, key: &str) -> Result<Object, String> {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene.toml");
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.04\n\
         [[{key}]]\nname = \"t\"\nmesh = '{}'\n",
        path.display()
    );
    std::fs::write(&scene, text).unwrap();
    let scene = Scene::load(&scene).map_err(|error| error.to_string())?;
    let things = scene.phantoms.into_iter().chain(scene.virtuals);
    Ok(things.last().unwrap())
}

fn read(json: &Value, files: &[(&str, &[u8])]) -> Result<Object, String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    read_file(&path, "virtual")
}

/// Numbers as little-endian bytes.
fn bytes(numbers: &[f32]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|number| number.to_le_bytes())
        .collect()
}

/// A square of four vertices with texture coordinates and colours, interleaved, drawn as a strip; one byte an index.
fn square() -> (Value, Vec<u8>) {
    let mut data = Vec::new();
    for (x, y) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)] {
        data.extend(bytes(&[x, y, 0.0, x, 1.0 - y]));
        data.extend([255, 0, 51, 255]);
    }
    data.extend([0, 1, 2, 3]);
    let json = json!({
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "a%20b.bin", "byteLength": 100}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96, "byteStride": 24},
            {"buffer": 0, "byteOffset": 96, "byteLength": 4}
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
            {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 0, "byteOffset": 20, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4"},
            {"bufferView": 1, "componentType": 5121, "count": 4, "type": "SCALAR"}
        ],
        "materials": [{
            "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 0.25], "metallicFactor": 0.75, "roughnessFactor": 0.5},
            "alphaMode": "MASK", "alphaCutoff": 0.125, "emissiveFactor": [1, 0.5, 0],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 4}, "KHR_materials_unlit": {}}
        }],
        "extensionsUsed": ["KHR_materials_emissive_strength", "KHR_materials_unlit", "KHR_materials_clearcoat"],
        "meshes": [{"primitives": [{
            "attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 2}, "indices": 3, "mode": 5, "material": 0
        }]}],
        "nodes": [{"children": [1], "translation": [0, 0, 5]}, {"mesh": 0, "scale": [2, 2, 2]}],
        "scenes": [{"nodes": [0]}],
        "scene": 0
    });
    (json, data)
}

#[test]
fn a_strip_in_a_tree_is_where_it_belongs() {
    let (json, data) = square();
    let thing = read(&json, &[("a b.bin", &data)]).unwrap();
    assert_eq!(
        (thing.mesh.triangles.len(), thing.mesh.positions.len()),
        (2, 4)
    );
    for (triangle, looks) in thing.mesh.triangles.iter().zip(&thing.mesh.corner_looks) {
        for (&vertex, &look) in triangle.iter().zip(looks) {
            // The file's (x, y, 0), twice as large and 5 in front, with its y up.
            let place = thing.mesh.positions[vertex as usize];
            assert_eq!(place.y, -5.0);
            let look = thing.mesh.looks[look as usize];
            assert_eq!(look.uv[0], Vec2::new(place.x / 2.0, 1.0 - place.z / 2.0));
            assert!((look.color - glam::Vec4::new(1.0, 0.0, 0.2, 1.0)).length() < 1e-6);
        }
    }
    // Both faces look where the file's z points.
    let normals = thing.mesh.corner_normals.iter().flatten();
    assert!(
        normals
            .into_iter()
            .all(|normal| normal.distance(Vec3::NEG_Y) < 1e-6)
    );
    let [material] = thing.materials[..] else {
        panic!("one material");
    };
    assert_eq!(material.albedo, DVec3::splat(0.5));
    assert_eq!((material.metallic, material.roughness), (0.75, Some(0.25)));
    // Nothing of it is below the cutoff, so the mask cuts nothing out.
    assert_eq!(material.coverage, Coverage::Opaque);
    assert_eq!((material.opacity, material.shading), (0.25, Shading::Unlit));
    assert_eq!(material.emission, DVec3::new(4.0, 2.0, 0.0));
    assert!((thing.albedo(0) - DVec3::new(0.5, 0.0, 0.1)).length() < 1e-6);
    assert!(
        thing
            .notes
            .iter()
            .any(|note| note.contains("KHR_materials_clearcoat"))
    );
}

#[test]
fn sparse_elements_replace_and_skins_and_morphs_rest() {
    let (mut json, mut data) = square();
    // Vertex 3 moves to (1, 2, 0); then a morph of half of (0, 0, 2) for all.
    data.extend([3, 0, 0, 0]);
    data.extend(bytes(&[1.0, 2.0, 0.0]));
    data.extend(bytes(&[0.0, 0.0, 2.0].repeat(4)));
    data.extend([0; 16]);
    data.extend(bytes(&[1.0, 0.0, 0.0, 0.0].repeat(4)));
    json["buffers"][0]["byteLength"] = json!(data.len());
    let views = json["bufferViews"].as_array_mut().unwrap();
    for (offset, length) in [(100, 4), (104, 12), (116, 48), (164, 16), (180, 64)] {
        views.push(json!({"buffer": 0, "byteOffset": offset, "byteLength": length}));
    }
    json["accessors"][0]["sparse"] = json!({"count": 1,
        "indices": {"bufferView": 2, "componentType": 5121}, "values": {"bufferView": 3}});
    let accessors = json["accessors"].as_array_mut().unwrap();
    accessors.push(json!({"bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC3"}));
    accessors.push(json!({"bufferView": 5, "componentType": 5121, "count": 4, "type": "VEC4"}));
    accessors.push(json!({"bufferView": 6, "componentType": 5126, "count": 4, "type": "VEC4"}));
    let primitive = &mut json["meshes"][0]["primitives"][0];
    primitive["targets"] = json!([{"POSITION": 4}]);
    primitive["attributes"]["JOINTS_0"] = json!(5);
    primitive["attributes"]["WEIGHTS_0"] = json!(6);
    json["meshes"][0]["weights"] = json!([0.5]);
    json["skins"] = json!([{"joints": [2]}]);
    json["nodes"][1]["skin"] = json!(0);
    json["nodes"]
        .as_array_mut()
        .unwrap()
        .push(json!({"translation": [10, 0, 0]}));
    json["scenes"][0]["nodes"] = json!([0, 2]);
    let thing = read(&json, &[("a b.bin", &data)]).unwrap();
    // The joint holds it, and its own node does not.
    let places = &thing.mesh.positions;
    assert!(places.contains(&Vec3::new(11.0, -1.0, 2.0)), "{places:?}");
    assert!(places.contains(&Vec3::new(10.0, -1.0, 0.0)), "{places:?}");
}

#[test]
fn textures_are_read_with_their_transforms() {
    let (mut json, data) = square();
    let mut png = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([255 * x as u8, 0, 0, 255]));
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    json["images"] = json!([{"uri": "p.png"}]);
    json["samplers"] = json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]);
    json["textures"] = json!([{"source": 0, "sampler": 0}]);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({"index": 0,
        "extensions": {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 0.0, "scale": [0.25, 1]}}});
    json["materials"][0]["normalTexture"] = json!({"index": 0, "scale": 0.5});
    let files: [(&str, &[u8]); 2] = [("a b.bin", &data), ("p.png", png.get_ref())];
    let thing = read(&json, &files).unwrap();
    assert_eq!(thing.textures.len(), 1, "each picture once");
    let maps = thing.materials[0].maps;
    let color = maps.color.unwrap();
    assert_eq!(color.wrap, [Wrap::Clamp, Wrap::Mirror]);
    assert_eq!(
        color.picture_from_corner.transform_point2(Vec2::ONE),
        Vec2::new(0.75, 1.0)
    );
    assert_eq!(maps.normal_scale, 0.5);
    // Its right half lies on it, times the corners' red.
    assert!((thing.albedo(0).x - 0.5).abs() < 1e-6);
    // u grows along x; v grows against the file's y, so the bitangent is turned.
    for look in &thing.mesh.looks {
        assert!(
            look.tangent.truncate().distance(Vec3::X) < 1e-5,
            "{}",
            look.tangent
        );
        // The picture's top lies where z is high: so does a normal's y, which is across the face's (-y) and u.
        assert_eq!(look.tangent.w, 1.0);
    }
    // Without it the thing has its shape, and the picture's name is told; in capitals and with Windows' strokes it is found.
    let missing = read(&json, &files[..1]).unwrap();
    assert!(missing.textures.is_empty());
    assert_eq!(missing.mesh.triangles.len(), 2);
    let told = missing.notes.join("\n");
    assert!(
        told.contains("images[0]") && told.contains("p.png"),
        "{told}"
    );
    for uri in ["P.PNG", "textures\\p.png", "C:\\me\\p.png"] {
        json["images"] = json!([{"uri": uri}]);
        assert_eq!(read(&json, &files).unwrap().textures.len(), 1, "{uri}");
    }
}

#[test]
fn hostile_files_are_errors_with_their_place() {
    type Spoiled = (&'static str, fn(&mut Value), &'static str);
    let spoiled: [Spoiled; 15] = [
        (
            "required",
            |j| j["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]),
            "KHR_draco_mesh_compression",
        ),
        (
            "unknown",
            |j| j["extensionsRequired"] = json!(["X_y"]),
            "\"X_y\" is not read",
        ),
        (
            "length",
            |j| j["buffers"][0]["byteLength"] = json!(1_u64 << 40),
            "buffers[0]: 100 bytes",
        ),
        (
            "view",
            |j| j["bufferViews"][0]["byteLength"] = json!(101),
            "bufferViews[0] reaches beyond",
        ),
        (
            "count",
            |j| j["accessors"][0]["count"] = json!(u32::MAX),
            "reach beyond a view",
        ),
        (
            "overflow",
            |j| j["accessors"][0]["byteOffset"] = json!(u64::MAX / 2),
            "reach beyond a view",
        ),
        (
            "zeros",
            |j| {
                j["accessors"][0] = json!({"componentType": 5126, "count": 1_u64 << 40, "type": "VEC3",
                "min": [0, 0, 0], "max": [0, 0, 0],
                    "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121}, "values": {"bufferView": 0}}});
            },
            "without a view",
        ),
        (
            "kind",
            |j| j["accessors"][0]["type"] = json!("MAT4"),
            "accessors[0]",
        ),
        (
            "positions",
            |j| j["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(77),
            "meshes[0].primitives[0].attributes.POSITION: accessors[77] of 4",
        ),
        (
            "circle",
            |j| j["nodes"][1]["children"] = json!([0]),
            "its own ancestor",
        ),
        (
            "parents",
            |j| j["nodes"][1]["children"] = json!([1]),
            "nodes[1]",
        ),
        (
            "place",
            |j| {
                j["nodes"][0]["scale"] = json!([1e5, 1e5, 1e5]);
                j["nodes"][1]["scale"] = json!([1e38, 1e38, 1e38]);
            },
            "infinity",
        ),
        (
            "remote",
            |j| j["buffers"][0]["uri"] = json!("https://a.b/c.bin"),
            "not beside the file",
        ),
        (
            "data",
            |j| j["buffers"][0]["uri"] = json!("data:;base64,@@"),
            "not base64",
        ),
        (
            "missing",
            |j| j["buffers"][0]["uri"] = json!("none.bin"),
            "none.bin",
        ),
    ];
    for (name, spoil, expected) in spoiled {
        let (mut json, data) = square();
        spoil(&mut json);
        let message = read(&json, &[("a b.bin", &data)]).unwrap_err();
        assert!(message.contains("a.gltf"), "{name}: {message}");
        assert!(message.contains(expected), "{name}: {message}");
    }
}

#[test]
fn indices_out_of_range_and_numbers_that_are_none_are_errors_with_their_place() {
    let (json, mut data) = square();
    data[99] = 4;
    let message = read(&json, &[("a b.bin", &data)]).unwrap_err();
    assert!(message.contains("index 3 is 4, of 4 vertices"), "{message}");
    data[99] = 3;
    data[0..4].copy_from_slice(&f32::NAN.to_le_bytes());
    let message = read(&json, &[("a b.bin", &data)]).unwrap_err();
    assert!(message.contains("element 0 is not finite"), "{message}");
}

/// A file that no thing can be made of says what it is of instead.
#[test]
fn what_has_no_surface_or_another_version_is_told_as_such() {
    for (modes, part) in [
        ([0, 0], "no triangles: it is a cloud of points"),
        ([1, 3], "no triangles: it is made of lines"),
        ([0, 2], "no triangles: it is made of points and lines"),
    ] {
        let (mut json, data) = square();
        json["meshes"][0]["primitives"] =
            json!(modes.map(|mode| json!({"attributes": {"POSITION": 0}, "mode": mode})));
        let message = read(&json, &[("a b.bin", &data)]).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
    // The first version's one chunk has its kind behind its length as a number.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    for (version, part) in [
        (1, "glTF of version 1; version 2 is read"),
        (3, "glTF of version 3"),
    ] {
        let mut bytes = b"glTF".to_vec();
        bytes.extend([version, 28, 8, 0].map(u32::to_le_bytes).concat());
        bytes.extend(b"{\"a\": 1}");
        std::fs::write(&path, bytes).unwrap();
        let message = read_file(&path, "virtual").unwrap_err();
        assert!(message.contains(part), "{message}");
    }
}

fn png(picture: &image::RgbaImage) -> Vec<u8> {
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// Pictures lie by coordinates that are not there: that is told once.
#[test]
fn pictures_without_texture_coordinates_are_told() {
    let (mut json, data) = square();
    let picture = png(&image::RgbaImage::from_pixel(
        1,
        1,
        image::Rgba([9, 9, 9, 255]),
    ));
    let files: [(&str, &[u8]); 2] = [("a b.bin", &data), ("p.png", &picture)];
    json["images"] = json!([{"uri": "p.png"}]);
    json["textures"] = json!([{"source": 0}]);
    let told = |json: &Value| read(json, &files).unwrap().notes.join("\n");
    for (map, of) in [
        ("pbrMetallicRoughness", "baseColorTexture"),
        ("normalTexture", ""),
    ] {
        let mut json = json.clone();
        match of {
            "" => json["materials"][0][map] = json!({"index": 0}),
            of => json["materials"][0][map][of] = json!({"index": 0}),
        }
        assert!(!told(&json).contains("TEXCOORD"), "{map}");
        let primitive = json["meshes"][0]["primitives"][0].clone();
        json["meshes"][0]["primitives"]
            .as_array_mut()
            .unwrap()
            .push(primitive);
        for primitive in json["meshes"][0]["primitives"].as_array_mut().unwrap() {
            primitive["attributes"]
                .as_object_mut()
                .unwrap()
                .remove("TEXCOORD_0");
        }
        let notes = told(&json);
        let expected = "meshes[0].primitives[0]: TEXCOORD_0 is not there, and pictures lie by it: each of them is of one \
                        colour (and 1 more such)";
        assert!(notes.contains(expected), "{notes}");
    }
    json["materials"][0]["emissiveTexture"] = json!({"index": 0, "texCoord": 1});
    let notes = told(&json);
    assert!(
        notes.contains("primitives[0]: TEXCOORD_1 is not there"),
        "{notes}"
    );
}

/// Red paint, and polished gold beside it, say in metal and roughness what they are, by texels or by factors.
#[test]
fn specular_and_glossiness_become_metal_and_roughness_texel_by_texel() {
    const EXTENSION: &str = "KHR_materials_pbrSpecularGlossiness";
    let (mut json, data) = square();
    let row = |left: [u8; 4], right: [u8; 4]| {
        png(&image::RgbaImage::from_fn(2, 1, |x, _| {
            image::Rgba([left, right][x as usize])
        }))
    };
    // (56 is 0.04 of sRGB: what dielectrics mirror.)
    let diffuse = row([200, 0, 0, 99], [0, 0, 0, 255]);
    let layer = row([56, 56, 56, 64], [255, 200, 80, 255]);
    let files: [(&str, &[u8]); 3] = [("a b.bin", &data), ("d.png", &diffuse), ("s.png", &layer)];
    json["images"] = json!([{"uri": "d.png"}, {"uri": "s.png"}]);
    json["textures"] = json!([{"source": 0}, {"source": 1}]);
    json["extensionsUsed"] = json!([EXTENSION]);
    json["materials"][0] = json!({"extensions": {EXTENSION: {
        "diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}}}});
    let thing = read(&json, &files).unwrap();
    assert!(thing.notes.is_empty(), "{:?}", thing.notes);
    let material = thing.materials[0];
    assert_eq!((material.albedo, material.metallic), (DVec3::ONE, 1.0));
    assert_eq!(material.roughness, Some(1.0));
    let maps = material.maps;
    let picture = |map: Option<gnomon::light::material::Map>| {
        &thing.textures[map.expect("a map").texture as usize].rgba
    };
    let close = |found: &[u8], expected: [u8; 4]| {
        let mut pairs = found.iter().zip(expected);
        assert!(
            pairs.all(|(a, b)| a.abs_diff(b) <= 2),
            "{found:?} {expected:?}"
        );
    };
    let (color, layer) = (picture(maps.color), picture(maps.metallic));
    close(&color[..4], [200, 0, 0, 99]);
    close(&color[4..], [255, 200, 80, 255]);
    close(&layer[..4], [255, 191, 0, 255]);
    close(&layer[4..], [255, 0, 255, 255]);
    assert_eq!(maps.roughness, maps.metallic);
    // A material of the same pictures and factors is of the same ones made.
    let again = json["materials"][0].clone();
    json["materials"].as_array_mut().unwrap().push(again);
    let mut primitive = json["meshes"][0]["primitives"][0].clone();
    primitive["material"] = json!(1);
    json["meshes"][0]["primitives"]
        .as_array_mut()
        .unwrap()
        .push(primitive);
    assert_eq!(read(&json, &files).unwrap().textures.len(), 2);
    // A picture of paint alone, below a dielectric's layer, stays as it is.
    json["materials"][0]["extensions"][EXTENSION] = json!({"diffuseTexture": {"index": 0},
        "specularFactor": [0.03, 0.03, 0.03], "glossinessFactor": 0.5});
    let paint = read(&json, &files).unwrap();
    assert_eq!(
        (paint.materials[0].metallic, paint.materials[0].roughness),
        (0.0, Some(0.25))
    );
    assert!(paint.materials[0].maps.color.is_some() && paint.materials[0].maps.metallic.is_none());
}

/// What exporters write that no shape depends on: the thing is the same.
#[test]
fn what_does_not_matter_refuses_no_model() {
    type Spoiled = (&'static str, fn(&mut Value));
    let spoiled: [Spoiled; 16] = [
        ("extras", |j| {
            j["nodes"][0]["extras"] = json!(5);
            j["extras"] = json!("made by hand");
        }),
        ("attributes", |j| {
            j["meshes"][0]["primitives"][0]["attributes"]["_BATCHID"] = json!(1);
            j["meshes"][0]["primitives"][0]["attributes"]["THICKNESS"] = json!(1);
        }),
        ("scenes", |j| {
            j["scenes"] = json!([{"nodes": [0]}, {"name": "empty"}])
        }),
        ("cameras", |j| {
            j["cameras"] = json!([{"type": "perspective", "perspective": {"yfov": -1}}]);
            j["nodes"][0]["camera"] = json!(7);
        }),
        ("strides", |j| j["bufferViews"][1]["byteStride"] = json!(0)),
        ("strides of what indices are long", |j| {
            j["bufferViews"][1]["byteStride"] = json!(1)
        }),
        // As Blender writes a shape key that moves nothing.
        ("a morph of zeros that lie nowhere", |j| {
            let zeros = json!({"componentType": 5126, "count": 4, "type": "VEC3"});
            j["accessors"].as_array_mut().unwrap().push(zeros);
            j["meshes"][0]["primitives"][0]["targets"] = json!([{"POSITION": 4}]);
            j["meshes"][0]["weights"] = json!([0.5]);
        }),
        ("a primitive of nothing", |j| {
            let nothing = json!({"componentType": 5126, "count": 0, "type": "VEC3"});
            j["accessors"].as_array_mut().unwrap().push(nothing);
            let primitives = j["meshes"][0]["primitives"].as_array_mut().unwrap();
            primitives.push(json!({"attributes": {"POSITION": 4}, "material": 0}));
        }),
        ("a pointer", |j| {
            let target = json!({"path": "pointer",
                "extensions": {"KHR_animation_pointer": {"pointer": "/materials/0/alphaCutoff"}}});
            j["animations"] = json!([{"channels": [{"sampler": 0, "target": target}],
                "samplers": [{"input": 3, "output": 3}]}]);
        }),
        ("a channel without a node", |j| {
            j["animations"] = json!([{"channels": [{"sampler": 0, "target": {"path": "scale"}}],
                "samplers": [{"input": 3, "output": 0}]}]);
        }),
        (
            "samplers",
            |j| {
                j["samplers"] =
                    json!([{"wrapS": 10496, "wrapT": 5, "magFilter": 9987, "minFilter": 0}])
            },
        ),
        ("alpha", |j| {
            j["materials"]
                .as_array_mut()
                .unwrap()
                .push(json!({"alphaMode": "blend"}));
        }),
        ("required", |j| {
            j["extensionsRequired"] = json!(["KHR_materials_transmission", "KHR_lights_punctual"])
        }),
        ("hidden", |j| {
            j["nodes"].as_array_mut().unwrap().push(
                json!({"mesh": 0, "translation": [9, 9, 9], "extensions": {"KHR_node_visibility": {"visible": false}}}),
            );
            j["scenes"][0]["nodes"] = json!([0, 2]);
        }),
        ("capitals", |j| j["buffers"][0]["uri"] = json!("A%20B.BIN")),
        ("padding", |j| j["buffers"][0]["uri"] = json!(".\\a b.bin")),
    ];
    let (json, data) = square();
    let expected = read(&json, &[("a b.bin", &data)]).unwrap();
    for (name, spoil) in spoiled {
        let mut json = json.clone();
        spoil(&mut json);
        let thing =
            read(&json, &[("a b.bin", &data)]).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(thing.mesh, expected.mesh, "{name}");
    }
}

/// Normals and texture coordinates that are no numbers are made anew or passed over.
#[test]
fn texture_coordinates_that_are_no_numbers_are_told_and_refuse_no_model() {
    let (json, mut broken) = square();
    broken[12..16].copy_from_slice(&f32::NAN.to_le_bytes());
    let thing = read(&json, &[("a b.bin", &broken)]).unwrap();
    assert_eq!(thing.mesh.triangles.len(), 2);
    let told = thing.notes.join("\n");
    assert!(
        told.contains("TEXCOORD_0: 1 of 4 are no finite numbers"),
        "{told}"
    );
}

/// Packed by gltfpack from an OBJ file: the same places, to what sixteen bits hold.
#[test]
fn what_meshoptimizer_packed_is_the_same_model() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    let packed = read_file(&folder.join("tests/models/tin_meshopt.glb"), "phantom").unwrap();
    let plain = read_file(&folder.join("models/tin.obj"), "phantom").unwrap();
    assert_eq!(packed.mesh.triangles.len(), plain.mesh.triangles.len());
    // (Of an OBJ file z points up, of a glTF file y.)
    let upright = |at: Vec3| Vec3::new(at.x, at.z, -at.y);
    let size = plain
        .mesh
        .positions
        .iter()
        .fold(0.0_f32, |size, at| size.max(at.abs().max_element()));
    for at in &packed.mesh.positions {
        let near = plain
            .mesh
            .positions
            .iter()
            .map(|there| there.distance(upright(*at)));
        let off = near.fold(f32::MAX, f32::min);
        assert!(off < 2e-4 * size, "{at} is off by {off} of {size}");
    }
}

#[test]
fn packed_views_that_lie_are_errors_with_their_place() {
    let folder = tempfile::tempdir().unwrap();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/models/tin_meshopt.glb");
    let whole = std::fs::read(file).unwrap();
    let path = folder.path().join("a.glb");
    // As long as before, so that all lengths in the file stay true.
    for (from, to, part) in [
        (
            "\"count\":576}",
            "\"count\":575}",
            "575 indices are no triangles",
        ),
        (
            "\"byteLength\":430",
            "\"byteLength\":400",
            "bufferViews[0]: ATTRIBUTES of 98 elements are broken",
        ),
        (
            "\"mode\":\"TRIANGLES\"",
            "\"mode\":\"TRIANGLEZ\"",
            "TRIANGLEZ is not known",
        ),
        (
            "\"byteStride\":2,",
            "\"byteStride\":3,",
            "byteStride 3 is not allowed",
        ),
        (
            "\"byteLength\":430",
            "\"byteLength\":999",
            "reaches beyond its buffer",
        ),
    ] {
        let at = whole
            .windows(from.len())
            .position(|part| part == from.as_bytes());
        let mut bytes = whole.clone();
        bytes[at.unwrap()..][..to.len()].copy_from_slice(to.as_bytes());
        std::fs::write(&path, &bytes).unwrap();
        let message = read_file(&path, "virtual").unwrap_err();
        assert!(
            message.contains("a.glb") && message.contains(part),
            "{to}: {message}"
        );
    }
    let mut random = fastrand::Rng::with_seed(3);
    for _ in 0..200 {
        let mut bytes = whole.clone();
        for _ in 0..random.usize(1..6) {
            let at = random.usize(bytes.len() - 700..bytes.len());
            bytes[at] = random.u8(..);
        }
        std::fs::write(&path, &bytes).unwrap();
        // Whatever it says of it.
        let _ = read_file(&path, "virtual");
    }
}

#[test]
fn a_spoiled_binary_file_never_panics() {
    let (mut json, data) = square();
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut whole = b"glTF\x02\0\0\0".to_vec();
    let length = 12 + 8 + text.len() + 8 + data.len();
    whole.extend((length as u32).to_le_bytes());
    whole.extend((text.len() as u32).to_le_bytes());
    whole.extend(b"JSON");
    whole.extend(&text);
    whole.extend((data.len() as u32).to_le_bytes());
    whole.extend(b"BIN\0");
    whole.extend(&data);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.glb");
    let written = |bytes: &[u8]| {
        std::fs::write(&path, bytes).unwrap();
        read_file(&path, "virtual")
    };
    assert_eq!(written(&whole).unwrap().mesh.triangles.len(), 2);
    // Lengths that are less than the head's own, found by fuzzing.
    for length in [0, 11_u32] {
        let mut bytes = whole.clone();
        bytes[8..12].copy_from_slice(&length.to_le_bytes());
        let message = written(&bytes).unwrap_err();
        assert!(
            message.contains(&format!("its length is {length}")),
            "{message}"
        );
    }
    assert!(
        written(&whole[..9])
            .unwrap_err()
            .contains("ends in its head")
    );
    let mut random = fastrand::Rng::with_seed(7);
    for _ in 0..300 {
        let mut bytes = whole.clone();
        for _ in 0..random.usize(1..4) {
            let at = random.usize(..bytes.len());
            bytes[at] = random.u8(..);
        }
        bytes.truncate(random.usize(bytes.len() / 2..=bytes.len()));
        // Whatever it says of it.
        let _ = written(&bytes);
    }
    for cut in (0..whole.len()).step_by(13) {
        assert!(written(&whole[..cut]).is_err());
    }
}

#[cfg_attr(not(has_shared), ignore = "../shared is not here")]
#[test]
fn khronos_samples_are_read() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/models/gltf");
    // Triangles and pictures as the files' own JSON has them.
    for (name, triangles, pictures) in [
        ("AlphaBlendModeTest", 0, 9),
        ("BoxTextured", 12, 1),
        ("BoxVertexColors", 12, 0),
        ("CesiumMan", 4672, 1),
        ("CesiumMilkTruck", 0, 1),
        ("DamagedHelmet", 15_452, 5),
        ("Duck", 4212, 1),
        ("Fox", 576, 1),
    ] {
        let path = folder.join(name).with_extension("glb");
        for key in ["virtual", "phantom"] {
            let thing = read_file(&path, key).unwrap();
            let dropped =
                thing.mesh_report.dropped_without_area + thing.mesh_report.dropped_duplicates;
            let found = thing.mesh.triangles.len() + dropped - thing.mesh_report.splits;
            assert!(triangles == 0 || found == triangles, "{name}: {found}");
            assert!(
                thing.textures.len() == pictures,
                "{name}: {}",
                thing.textures.len()
            );
            assert!(
                thing
                    .mesh
                    .corner_normals
                    .iter()
                    .flatten()
                    .all(|n| n.is_finite())
            );
        }
    }
}

/// What fuzzing began with and what it found, of all kinds of meshes: read or refused, and counted right.
#[test]
fn what_fuzzing_found_is_read_or_refused() {
    let mut seen = 0;
    for extension in MeshFormat::all_extensions() {
        let folder = crate::common::project_file("fuzz/seeds").join(extension);
        for entry in std::fs::read_dir(&folder).unwrap() {
            let path = entry.unwrap().path();
            seen += 1;
            if let Ok(thing) = read_file(&path, "virtual") {
                let report = thing.mesh_report;
                let few = [
                    report.dropped_without_area,
                    report.dropped_duplicates,
                    report.splits,
                ];
                assert!(
                    few.iter().all(|&count| count < 1000),
                    "{}: {report:?}",
                    path.display()
                );
            }
        }
    }
    assert!(seen > 8, "{seen}");
}
