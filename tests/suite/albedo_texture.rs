//! `albedo_texture`: which things take a picture, and what `difference = "subtract"` makes of it, against what the video says
//! and against the path-traced truth.

use std::fs;
use std::path::Path;

use glam::{DAffine3, DVec2, DVec3, Vec3};
use gnomon::app::precomputed;
use gnomon::app::truth::sheets::is_white;
use gnomon::app::truth::{Truth, compare, draw, key_frames};
use gnomon::capture::{Frame, load_calibration};
use gnomon::geometry::camera::Intrinsics;
use gnomon::light::probe::Probe;
use gnomon::light::srgb::srgb_from_linear;
use gnomon::render::{Renderer, Shown, VIRTUAL};
use gnomon::scene::{Difference, Scene, Technique};
use image::{Rgb, RgbImage};

use crate::common::{gpu, project_file};

/// A scene in a folder, with the keys of one that ships and what is put in the place of one of its lines.
fn room_with(folder: &Path, (line, instead): (&str, &str)) -> Scene {
    let root = env!("CARGO_MANIFEST_DIR");
    let text = fs::read_to_string(project_file("config/room.toml")).unwrap();
    assert!(text.contains(line), "{line}");
    let text = text
        .replacen(line, instead, 1)
        .replace("\"recordings/", &format!("\"{root}/recordings/"))
        .replace("\"models/", &format!("\"{root}/models/"));
    let path = folder.join("scene.toml");
    fs::write(&path, text).unwrap();
    let mut scene = Scene::load(&path).unwrap();
    scene.shadows.technique = Technique::Shafts;
    scene
}

fn grey(linear: f64) -> Rgb<u8> {
    Rgb([(255.0 * srgb_from_linear(linear)).round() as u8; 3])
}

fn intrinsics() -> Intrinsics {
    load_calibration(&project_file("recordings/room/camera.toml")).unwrap()
}

/// Albedo of a table with squares of 4 cm, at a place in the world.
fn squares(place: DVec2) -> f64 {
    let number = (place / 0.04).floor();
    match (number.x + number.y).rem_euclid(2.0) == 0.0 {
        true => 0.9,
        false => 0.1,
    }
}

/// What the camera sees of the table alone, each place as bright as it reflects; and for each pixel whether the place two
/// pixels around it is of one square.
fn seen_squares(camera: &Intrinsics, camera_from_world: &DAffine3) -> (Vec<f64>, Vec<bool>) {
    let world_from_camera = camera_from_world.inverse();
    let albedo = |column: f64, row: f64| {
        let pixel = camera.undistorted_pixel(DVec2::new(column, row))?;
        let ray = camera.plane_from_pixel(pixel).extend(1.0);
        let way = world_from_camera.transform_vector3(ray);
        let start = world_from_camera.translation;
        let place = start + way * ((-0.0005 - start.z) / way.z);
        let on_table = place.x.abs() < 0.59 && place.y.abs() < 0.49 && way.z < 0.0;
        on_table.then(|| squares(place.truncate()))
    };
    let [width, height] = camera.size_px;
    let pixels = (0..height).flat_map(|row| (0..width).map(move |column| [column, row]));
    pixels
        .map(|at| {
            let [column, row] = at.map(f64::from);
            let here = albedo(column, row);
            let around = [(-2.0, -2.0), (2.0, -2.0), (-2.0, 2.0), (2.0, 2.0)];
            let alike = |(x, y)| albedo(column + x, row + y) == here;
            (
                here.unwrap_or(0.0),
                here.is_some() && around.into_iter().all(alike),
            )
        })
        .unzip()
}

/// A table with squares in a room of one brightness, and a black thing above it.
fn scene_of_squares(folder: &Path) -> Scene {
    let cloth = RgbImage::from_fn(1200, 1000, |column, row| {
        let place = DVec2::new(f64::from(column) - 599.5, 499.5 - f64::from(row));
        grey(squares(place * 0.001))
    });
    cloth.save(folder.join("cloth.png")).unwrap();
    let line = "albedo = [0.5, 0.335, 0.2]                # the mean of its wood";
    let mut scene = room_with(folder, (line, "albedo_texture = \"cloth.png\""));
    scene.shadows.shafts.patches = 600;
    let probe = scene.probe.as_mut().unwrap();
    probe.probe = Probe::new([64, 32], vec![Vec3::ONE; 64 * 32]).unwrap();
    probe.exposure = 0.5;
    scene.phantoms.retain(|phantom| phantom.name == "table");
    scene.virtuals.truncate(1);
    scene.virtuals[0].anchor_from_object.translation.z += 0.03;
    for material in &mut scene.virtuals[0].materials {
        material.albedo = DVec3::ZERO;
    }
    scene.shadows.samples = 1;
    scene
}

/// In a room of one brightness a table is as bright as it reflects: what a shadow takes away as radiance is the part that a
/// ratio takes.
#[test]
fn what_is_subtracted_from_a_pictured_table_is_the_part_that_a_ratio_takes() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene_of_squares(folder.path());
    let mean = scene.phantoms[0].albedo(0);
    assert!((mean - 0.5).abs().max_element() < 0.03, "{mean}");
    let camera = intrinsics();
    let (frame, poses) = key_frames(&project_file("recordings/room"), &scene.anchors)
        .unwrap()
        .swap_remove(0);
    let (seen, is_alike) = seen_squares(&camera, &poses[0].unwrap());
    let byte = |albedo: &f64| (255.0 * srgb_from_linear(albedo * 0.5)).round() as u8;
    let recorded = Frame {
        rgba: seen
            .iter()
            .flat_map(|albedo| {
                let byte = byte(albedo);
                [byte, byte, byte, 255]
            })
            .collect(),
        ..frame
    };
    let drawn = |scene: &Scene| {
        let mut renderer: Renderer = precomputed::renderer(gpu(), scene, camera).unwrap();
        renderer.upload(&recorded).unwrap();
        renderer.draw(&poses, Shown::Composite);
        let layers = renderer.layers().unwrap();
        (renderer.read_picture().unwrap(), layers.role)
    };
    let with = |difference, textured: bool| {
        let mut scene = scene.clone();
        scene.shadows.shafts.difference = difference;
        if !textured {
            scene.phantoms[0].materials[0].maps.color = None;
            scene.phantoms[0].materials[0].albedo = DVec3::splat(0.5);
        }
        drawn(&scene)
    };
    let (ratio, roles) = with(Difference::Ratio, true);
    let off = |other: &[u8]| {
        let (mut sum, mut count, mut taken) = (0.0, 0.0, 0.0);
        for (index, role) in roles.iter().enumerate() {
            // (Undistorting blurs the squares' edges.)
            let [before, one, other] =
                [&recorded.rgba, &ratio, other].map(|picture| f64::from(picture[4 * index + 1]));
            if *role != VIRTUAL && is_alike[index] && before - one > 2.0 {
                sum += (one - other).powi(2);
                taken += (before - one).powi(2);
                count += 1.0;
            }
        }
        assert!(count > 1000.0, "{count}");
        [(sum / count).sqrt(), (taken / count).sqrt()]
    };
    let [textured, taken] = off(&with(Difference::Subtract, true).0);
    let [flat, _] = off(&with(Difference::Subtract, false).0);
    eprintln!("of {taken} levels {textured} are off, {flat} without the picture");
    assert!(
        textured < 0.08 * taken && textured < 1.0,
        "of {taken} levels {textured} are off"
    );
    assert!(
        flat > 4.0 * textured,
        "{flat} without the picture, {textured} with it"
    );
}

/// The room's paper with its tags, as it was rendered: 0.82 where it is bare, 0.03 where it is inked.
#[test]
fn the_print_of_a_board_makes_what_is_subtracted_nearer_to_the_truth() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Scene::load(&project_file("config/room.toml")).unwrap();
    let markers = &scene.anchors[0].markers;
    let print = RgbImage::from_fn(2100, 1485, |column, row| {
        let place = DVec2::new(f64::from(column) - 1049.5, 742.0 - f64::from(row)) * 2e-4;
        let inked = markers
            .iter()
            .any(|marker| is_white(marker, place) == Some(false));
        grey(if inked { 0.03 } else { 0.82 })
    });
    print.save(folder.path().join("print.png")).unwrap();
    let line = "material = { albedo = 0.82 }";
    let instead = "material = { albedo_texture = \"print.png\" }";
    let recording = project_file("recordings/room");
    let errors = |scene: &Scene, difference| {
        let mut scene = scene.clone();
        scene.shadows.technique = Technique::Shafts;
        scene.shadows.shafts.difference = difference;
        scene.shadows.shafts.sources = Some(50);
        let mut renderer = precomputed::renderer(gpu(), &scene, intrinsics()).unwrap();
        let keys = key_frames(&recording, &scene.anchors).unwrap();
        let errors = keys.iter().map(|(frame, poses)| {
            let drawn = draw(&mut renderer, frame, poses).unwrap();
            let truth = Truth::open(&recording, frame.index).unwrap();
            compare(frame.index, &truth, &drawn).unwrap()
        });
        let errors: Vec<_> = errors.collect();
        let count = errors.len() as f64;
        let mean =
            |of: fn(&gnomon::app::truth::Errors) -> f64| errors.iter().map(of).sum::<f64>() / count;
        [mean(|e| e.change_real), mean(|e| e.factor)]
    };
    let printed = room_with(folder.path(), (line, instead));
    let [plain, pictured] = [&scene, &printed].map(|scene| errors(scene, Difference::Subtract));
    let ratio = errors(&scene, Difference::Ratio);
    eprintln!("way,change,factor\nratio,{ratio:?}\nsubtract,{plain:?}\npictured,{pictured:?}");
    assert!(
        pictured[0] < plain[0],
        "{pictured:?}, {plain:?} without the print"
    );
    assert!(
        pictured[1] < plain[1],
        "{pictured:?}, {plain:?} without the print"
    );
}

const SCENE: &str =
    "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 0\nsize_m = 0.05\n";

#[test]
fn a_picture_lies_on_what_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    RgbImage::from_pixel(2, 2, Rgb([188, 188, 188]))
        .save(folder.path().join("half.png"))
        .unwrap();
    fs::write(folder.path().join("none.png"), "no picture").unwrap();
    let uv = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n";
    fs::write(folder.path().join("uv.obj"), uv).unwrap();
    let read = |text: &str| Scene::read(&path, &format!("{SCENE}{text}"));
    let albedo = |text: &str| {
        let reading = read(text);
        assert!(
            reading.files.contains(&folder.path().join("half.png")),
            "{text}"
        );
        let scene = reading.scene.unwrap();
        let object = scene.phantoms.iter().chain(&scene.virtuals).next().unwrap();
        // (What lies below a layer; that mirrors some light beside it.)
        let mut object = object.clone();
        let materials = object.materials.iter_mut();
        materials.for_each(|material| material.roughness = None);
        (object.albedo(0).x * 100.0).round()
    };
    let texture = "albedo_texture = \"half.png\"";
    for (text, percent) in [
        (format!("[table]\nrect_m = [0, 0, 1, 1]\n{texture}\n"), 50.0),
        (
            format!("[table]\nrect_m = [0, 0, 1, 1]\nalbedo = 0.5\n{texture}\n"),
            25.0,
        ),
        (
            format!("[[phantom]]\nname = \"p\"\nrect_m = [0.2, 0.3]\nmaterial = {{ {texture} }}\n"),
            50.0,
        ),
        (
            format!(
                "[[virtual]]\nname = \"p\"\nmesh = \"uv.obj\"\nmaterial = {{ {texture}, roughness = 0.5 }}\n"
            ),
            50.0,
        ),
    ] {
        assert_eq!(albedo(&text), percent, "{text}");
    }
    for (text, said) in [
        (
            "[[phantom]]\nname = \"p\"\nbox_m = [1, 1, 1]\nmaterial = { albedo_texture = \"half.png\" }\n",
            "a box has no texture coordinates",
        ),
        (
            "[[phantom]]\nname = \"p\"\nmesh = \"models/sphere.obj\"\nmaterial = { albedo_texture = \"half.png\" }\n",
            "no texture coordinates; allowed: the table, rect_m",
        ),
        (
            "[table]\nrect_m = [0, 0, 1, 1]\nalbedo_texture = \"none.png\"\n",
            "none.png cannot be read",
        ),
        (
            "[table]\nrect_m = [0, 0, 1, 1]\nalbedo_texture = \"away.png\"\n",
            "no such file",
        ),
        (
            "[table]\nrect_m = [0, 0, 1, 1]\nalbedo_texture = 3\n",
            "text",
        ),
    ] {
        let text = text.replace(
            "models/",
            &format!("{}/models/", env!("CARGO_MANIFEST_DIR")),
        );
        let error = read(&text).scene.unwrap_err().to_string();
        assert!(
            error.contains(said) && error.contains("scene.toml:"),
            "{error}"
        );
    }
}
