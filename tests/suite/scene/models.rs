//! Models as other programs write them: small files that were once refused or came out grey.

use std::fs;
use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3, Vec4Swizzles as _};
use gnomon::app::scene_warnings::warnings;
use gnomon::light::material::{Coverage, Shading};
use gnomon::scene::{Object, Scene};

use super::{HEAD, load_in, project};

/// A virtual thing of a file, and the warnings of its scene.
fn thing(path: &Path, added: &str) -> Result<(Object, Vec<String>), String> {
    let project = project();
    let text = format!(
        "{HEAD}[ambient]\nradiance = 0.5\n[[virtual]]\nname = \"v\"\nmesh = {path:?}\n{added}"
    );
    let mut scene: Scene = load_in(&project, &text).map_err(|error| error.to_string())?;
    let warnings = warnings(&scene);
    Ok((scene.virtuals.remove(0), warnings))
}

fn case(name: &str) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    root.join("../shared/cases/meshes").join(name).join("a.obj")
}

/// The albedo of each material, by its name.
fn albedos(object: &Object) -> Vec<(&str, [f64; 3])> {
    let names = object.material_names.iter().map(String::as_str);
    let albedos = object.materials.iter().map(|it| it.albedo.to_array());
    names.zip(albedos).collect()
}

const RED: [f64; 3] = [0.8, 0.02, 0.02];
const GREY: [f64; 3] = [0.5; 3];

#[cfg_attr(not(has_shared), ignore = "needs ../shared")]
#[test]
fn odd_files_are_what_other_programs_show() {
    let red: &[(&str, [f64; 3])] = &[("red", RED)];
    let grey: &[(&str, [f64; 3])] = &[("", GREY)];
    for (name, expected, note) in [
        ("m_continuation", red, None),
        ("m_trail_comment", red, None),
        ("m_usemtl_tab", red, None),
        ("m_mtl_bom", red, None),
        ("m_mapkd_empty", red, None),
        ("m_kd_gt1", &[("red", [1.0, 0.02, 0.02])], None),
        ("m_vn_nan", red, None),
        (
            "m_f2",
            red,
            Some("a.obj:11: f: a face of fewer than three corners is left out"),
        ),
        (
            "m_mtllib_two",
            red,
            Some("a.obj:1: mtllib: no such file as \"b.mtl\""),
        ),
        ("m_latin1", &[("é", RED), ("è", [0.02, 0.8, 0.02])], None),
        (
            "m_usemtl_unknown",
            grey,
            Some("a.obj:10: usemtl: no material \"purple\" in a.mtl; it is grey"),
        ),
        (
            "m_usemtl_empty",
            grey,
            Some("a.obj:10: usemtl: names no material"),
        ),
        (
            "m_mtl_missing",
            grey,
            Some("a.obj:1: mtllib: no such file as \"gone.mtl\""),
        ),
        (
            "m_textured",
            &[("red", [1.0; 3])],
            Some("a.mtl:3: map_Kd: no such file as \"red.png\"; not used"),
        ),
    ] {
        let (object, warnings) = thing(&case(name), "").unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(object.mesh.triangles.len(), 12, "{name}");
        assert!(object.mesh_report.closed, "{name}");
        assert!(
            (object.mesh.signed_volume_m3() - 0.06_f64.powi(3)).abs() < 1e-9,
            "{name}"
        );
        if name == "m_latin1" {
            let [first, second] = &object.materials[..] else {
                panic!("two materials")
            };
            assert_eq!(
                [first.albedo.to_array(), second.albedo.to_array()],
                [expected[0].1, expected[1].1]
            );
        } else {
            assert_eq!(albedos(&object), expected, "{name}");
        }
        match note {
            Some(note) => {
                let told: Vec<&String> = warnings.iter().filter(|it| it.contains(note)).collect();
                assert_eq!(told.len(), 1, "{name}: once: {warnings:?}");
            }
            None => assert_eq!(warnings, [""; 0], "{name}"),
        }
    }
}

#[cfg_attr(not(has_shared), ignore = "needs ../shared")]
#[test]
fn what_materials_and_vertices_say_arrives() {
    let material = |name: &str| thing(&case(name), "").unwrap().0.materials[0];
    assert_eq!(material("m_transparent").opacity, 0.2);
    assert_eq!(material("m_emissive").emission, DVec3::X);
    let metal = material("m_metal");
    assert_eq!((metal.metallic, metal.roughness), (1.0, Some(0.2 * 0.2)));

    let (colored, _) = thing(&case("m_vcol"), "").unwrap();
    let linear = |encoded: f64| ((encoded + 0.055) / 1.055).powf(2.4);
    let expected = DVec3::new(linear(0.8), 0.02 / 12.92, 0.02 / 12.92).as_vec3();
    assert_eq!(colored.materials[0].albedo, DVec3::ONE);
    for corner in colored.mesh.corner_looks.as_flattened() {
        let color = colored.mesh.looks[*corner as usize].color.xyz();
        assert!(color.distance(expected) < 1e-6, "{color}");
    }
    let (seven, _) = thing(&case("m_vcol7_varying"), "").unwrap();
    assert!((seven.mesh.signed_volume_m3() - 0.06_f64.powi(3)).abs() < 1e-9);
    let reds = seven.mesh.looks.iter().map(|look| look.color.x);
    assert!(
        reds.clone()
            .any(|red| (f64::from(red) - linear(0.3)).abs() < 1e-6)
    );

    // The letter C, 2 cm thick.
    let (concave, _) = thing(&case("g_concave"), "").unwrap();
    assert!(concave.mesh_report.closed);
    let volume = (0.08 * 0.08 - 0.06 * 0.04) * 0.02;
    assert!((concave.mesh.signed_volume_m3() - volume).abs() < 1e-9);
}

#[cfg_attr(not(has_shared), ignore = "needs ../shared")]
#[test]
fn a_size_that_is_hardly_meant_is_doubted() {
    let (_, warnings) = thing(&case("g_mm"), "").unwrap();
    let doubt = "\"v\" is 60 m long: if its file is in millimetres, write scale = 0.001; or its longest side as fit_m";
    assert_eq!(warnings, [doubt]);
    let (fitted, warnings) = thing(&case("g_mm"), "fit_m = 0.06\n").unwrap();
    assert_eq!(warnings, [""; 0]);
    let most = fitted
        .mesh
        .positions
        .iter()
        .copied()
        .fold(Vec3::MIN, Vec3::max);
    assert!(most.distance(Vec3::new(0.03, 0.03, 0.06)) < 1e-7, "{most}");
    assert_eq!(thing(&case("g_mm"), "scale = 0.001\n").unwrap().1, [""; 0]);
    let (_, tiny) = thing(&case("m_f2"), "fit_m = 1e-4\n").unwrap();
    assert!(
        tiny.iter().any(|it| it.contains("\"v\" is 0.1 mm long")),
        "{tiny:?}"
    );
}

/// A pyramid in the file's way.
fn write_pyramid(path: &Path, head: &str, between: &str) {
    let text = format!(
        "{head}f 4 3 2 1\n{between}f 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\nv 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nv .05 .05 .1\n"
    );
    fs::write(path, text).unwrap();
}

#[test]
fn files_of_other_machines_are_found_and_what_comes_later_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    fs::create_dir(here.join("Maps")).unwrap();
    let picture = image::RgbImage::from_pixel(2, 2, image::Rgb([255, 0, 0]));
    picture.save(here.join("Maps/Red Wall.PNG")).unwrap();
    let mtl = "newmtl Wall #1\r\nKd 0 0 0\r\nmap_Kd -s 2 2 1 maps\\red wall.png\r\nnewmtl b\r\nKd .5\r\nTr 0.25\r\n";
    fs::write(here.join("Wall.MTL"), mtl).unwrap();
    let path = here.join("a.obj");
    write_pyramid(
        &path,
        "mtllib C:\\models\\wall.mtl\nusemtl Wall #1\n",
        "usemtl b # glass\n",
    );
    let (object, warnings) = thing(&path, "").unwrap();
    // (The pyramid has no coordinates for its picture.)
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(warnings[0].contains("a.obj:3: vt: texture coordinates"));
    assert!(object.mesh_report.closed);
    assert_eq!(albedos(&object), [("Wall #1", [1.0; 3]), ("b", [0.5; 3])]);
    assert_eq!(object.materials[1].opacity, 0.75);
    assert_eq!(object.materials[1].coverage, Coverage::Blend);
    let map = object.materials[0].maps.color.unwrap();
    assert_eq!(object.textures[map.texture as usize].size_px, [2, 2]);
    assert_eq!(&object.textures[0].rgba[..4], [255, 0, 0, 255]);
}

/// What a material library and the lines before the faces make of a pyramid.
fn of_library(here: &Path, mtl: &str, head: &str) -> (Object, Vec<String>) {
    fs::write(here.join("a.mtl"), mtl).unwrap();
    let path = here.join("a.obj");
    write_pyramid(&path, head, "");
    thing(&path, "").unwrap()
}

/// Exporters of scans and games name the colours' picture as that of opacity too, and so do not make the thing half clear by it.
#[test]
fn the_colours_picture_as_opacity_means_its_alpha() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let picture = image::RgbImage::from_pixel(2, 2, image::Rgb([200, 40, 40]));
    picture.save(here.join("plain.png")).unwrap();
    let leaves = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([9, 99, 9, 255 * x as u8]));
    leaves.save(here.join("leaves.png")).unwrap();
    // A square whose left half is where the leaves are not.
    let square = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let path = here.join("square.obj");
    fs::write(&path, square).unwrap();
    let with = |picture: &str| {
        let mtl = format!("newmtl a\nKd 1 1 1\nmap_d {picture}\nmap_Kd {picture}\n");
        fs::write(here.join("a.mtl"), mtl).unwrap();
        thing(&path, "").unwrap()
    };
    let area = |object: &Object| -> f32 {
        let triangles = object.mesh.triangles.iter();
        let corners = |triangle: &[u32; 3]| triangle.map(|at| object.mesh.positions[at as usize]);
        let areas = triangles
            .map(corners)
            .map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0);
        areas.sum()
    };
    let (plain, warnings) = with("plain.png");
    assert_eq!(plain.materials[0].coverage, Coverage::Opaque);
    assert_eq!(&plain.textures[0].rgba[..4], [200, 40, 40, 255]);
    assert!((area(&plain) - 0.01).abs() < 1e-6);
    let told = "a.mtl:3: map_d: the picture of the colours, which has no alpha";
    assert!(warnings[0].contains(told), "{warnings:?}");
    let (leaves, warnings) = with("leaves.png");
    assert!((area(&leaves) - 0.005).abs() < 2e-4, "{}", area(&leaves));
    assert!(!warnings.iter().any(|warning| warning.contains("map_d")));
}

/// Roughness and metal come as pictures, as numbers or not at all, and with either the rest is a PBR renderer's.
#[test]
fn a_picture_of_roughness_or_metal_says_as_much_as_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    let grey = image::GrayImage::from_pixel(2, 2, image::Luma([128]));
    grey.save(here.join("grey.png")).unwrap();
    let square = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv .1 0 0\nv .1 .1 0\nv 0 .1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\n";
    let path = here.join("square.obj");
    fs::write(&path, square).unwrap();
    let with = |record: &str| {
        fs::write(
            here.join("a.mtl"),
            format!("newmtl a\nKd 1 1 1\n{record}\n"),
        )
        .unwrap();
        let (object, _) = thing(&path, "").unwrap();
        object.materials[0]
    };
    for (record, shading, roughness, metallic) in [
        ("", Shading::Lit, None, 0.0),
        ("Pr .5", Shading::Principled, Some(0.25), 0.0),
        ("map_Pr grey.png", Shading::Principled, Some(1.0), 0.0),
        ("Pr 0\nmap_Pr grey.png", Shading::Principled, Some(1.0), 0.0),
        ("map_Pm grey.png", Shading::Principled, None, 1.0),
        ("map_Pr gone.png", Shading::Lit, None, 0.0),
    ] {
        let material = with(record);
        assert_eq!(material.shading, shading, "{record}");
        assert_eq!(material.roughness, roughness, "{record}");
        assert_eq!(material.metallic, metallic, "{record}");
        let has_map = record.contains("grey");
        let maps = material.maps;
        assert_eq!(
            maps.roughness.or(maps.metallic).is_some(),
            has_map,
            "{record}"
        );
    }
}

/// Scanners' programs write a library and no `usemtl`.
#[test]
fn without_usemtl_a_material_alone_is_meant_and_one_of_several_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path();
    for (mtl, albedo, told) in [
        (
            "newmtl scan\nKd .8 .02 .02\n",
            RED,
            "a.obj:1: there is no usemtl: all is of \"scan\"",
        ),
        (
            "newmtl a\nKd .8 .02 .02\nnewmtl b\n",
            GREY,
            "a.obj:1: there is no usemtl: which of the 2 materials in a.mtl is meant? it is grey",
        ),
    ] {
        let (object, warnings) = of_library(here, mtl, "mtllib a.mtl\n");
        assert_eq!(object.materials[0].albedo.to_array(), albedo);
        assert!(warnings[0].contains(told), "{warnings:?}");
    }
}

#[test]
fn what_cannot_be_meant_is_a_mistake_with_its_place() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.obj");
    for (text, part) in [
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 \\\n 4\n",
            "a.obj:4:7: f: vertex 4 does not exist; the file has 3",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 0\n",
            "a.obj:4:7: f: vertex 0 does not exist; 3 vertices are known by this line",
        ),
        (
            "v 0 0 0\rv 1 0 0\rv 0 1 0\rf 1 2 -4\r",
            "a.obj:4:7: f: vertex -4 does not exist",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n",
            "a.obj:4:7: f: x is not a face's corner; allowed: v, v/vt, v//vn or v/vt/vn",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1/1/1 2 3\n",
            "a.obj:4:3: f: 1/1/1/1 is not a face's corner",
        ),
        (
            "v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n",
            "a.obj:2:1: v: no place, and a face needs it",
        ),
        (
            "v 0 0 0\nv 1e9 0 0\nv 0 1 0\nf 1 2 3\n",
            "a.obj:2:1: v: no place",
        ),
    ] {
        fs::write(&path, text).unwrap();
        let message = thing(&path, "").map(|_| ()).unwrap_err();
        assert!(message.contains(part), "{message}");
    }
    // What no face needs may be anything.
    fs::write(
        &path,
        "v 0 0 0\nv 1 0 0\nv nan 0 0\nv 0 1 0\nvn 0 0\nf 1/0/9 2//1 4\n",
    )
    .unwrap();
    let (object, warnings) = thing(&path, "").unwrap();
    assert_eq!(object.mesh.triangles.len(), 1);
    assert_eq!(warnings.len(), 1, "{warnings:?}");
    assert!(
        warnings[0].contains("a.obj:6: vn: normals that are not there"),
        "{warnings:?}"
    );
}
