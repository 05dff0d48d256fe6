//! Shapes that the scene's file gives without a mesh.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};
use gnomon::geometry::bounds::Bounds;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::render::{Renderer, Shown, VIRTUAL};
use gnomon::scene::{Object, Scene, ShapeKind};

use super::{HEAD, load, load_in, project, summary};
use crate::common::{Stage, look_at};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(360.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: Distortion::NONE,
};

fn virtual_of(keys: &str) -> Object {
    let text = format!("[[virtual]]\nname = \"v\"\n{keys}\n");
    load(&text).unwrap().virtuals.remove(0)
}

fn phantom_of(keys: &str) -> Object {
    let text = format!("[[phantom]]\nname = \"p\"\n{keys}\n");
    load(&text).unwrap().phantoms.remove(0)
}

#[test]
fn each_shape_is_as_large_as_its_numbers_and_stands_on_its_origin() {
    let round = |radius: f64| [-radius, -radius, radius, radius];
    // (key, what it is, x0 y0 x1 y1, z0 and z1, volume)
    type Row = (&'static str, ShapeKind, [f64; 4], [f64; 2], f64);
    let shapes: [Row; 10] = [
        (
            "box_m = [0.2, 0.1, 0.05]",
            ShapeKind::Box,
            [-0.1, -0.05, 0.1, 0.05],
            [0.0, 0.05],
            0.001,
        ),
        (
            "box_m = [0.1, -0.2, -0.3, 0.2, 0.1, 0.4]",
            ShapeKind::Box,
            [0.1, -0.2, 0.2, 0.1],
            [-0.3, 0.4],
            0.021,
        ),
        (
            "cylinder_m = [0.04, 0.1]",
            ShapeKind::Cylinder,
            round(0.04),
            [0.0, 0.1],
            PI * 0.0016 * 0.1,
        ),
        (
            "cone_m = [0.03, 0.09]",
            ShapeKind::Cone,
            round(0.03),
            [0.0, 0.09],
            PI * 0.0009 * 0.03,
        ),
        (
            "sphere_m = 0.03",
            ShapeKind::Sphere,
            round(0.03),
            [0.0, 0.06],
            PI * 4.0 / 3.0 * 2.7e-5,
        ),
        (
            "rect_m = [0.3, 0.2]",
            ShapeKind::Rectangle,
            [-0.15, -0.1, 0.15, 0.1],
            [0.0, 0.0],
            0.0,
        ),
        (
            "rect_m = [0, -0.1, 0.3, 0.2]",
            ShapeKind::Rectangle,
            [0.0, -0.1, 0.3, 0.2],
            [0.0, 0.0],
            0.0,
        ),
        (
            "prism = { height_m = 0.02, outline_m = [[0, 0], [0.04, 0.04], [0, 0.03], [-0.04, 0.04]] }",
            ShapeKind::Prism,
            [-0.04, 0.0, 0.04, 0.04],
            [0.0, 0.02],
            0.0012 * 0.02,
        ),
        (
            "revolved = { profile_m = [[0.02, 0], [0.02, 0.05]] }",
            ShapeKind::Revolved,
            round(0.02),
            [0.0, 0.05],
            PI * 0.0004 * 0.05,
        ),
        (
            "revolved = { profile_m = [[0.03, 0], [0.05, 0], [0.05, 0.02], [0.03, 0]] }",
            ShapeKind::Revolved,
            round(0.05),
            [0.0, 0.02],
            2.0 * PI * (0.13 / 3.0) * 0.0002,
        ),
    ];
    for (keys, kind, [x0, y0, x1, y1], [z0, z1], volume_m3) in shapes {
        let (low, high) = (DVec3::new(x0, y0, z0), DVec3::new(x1, y1, z1));
        for object in [virtual_of(keys), phantom_of(keys)] {
            assert_eq!(object.shape, kind);
            hold_size(&object, keys, [low, high], volume_m3);
            assert!(object.notes.is_empty() && object.materials.len() == 1);
        }
    }
}

/// Holds a thing's bounds and volume; without a volume it is open.
fn hold_size(object: &Object, keys: &str, [low, high]: [DVec3; 2], volume_m3: f64) {
    let places = object.mesh.positions.iter().map(|place| place.as_dvec3());
    let bounds = Bounds::around(places).unwrap();
    assert!(bounds.low.distance(low) < 1e-7, "{keys}: {}", bounds.low);
    assert!(bounds.high.distance(high) < 1e-7, "{keys}: {}", bounds.high);
    assert_eq!(object.mesh_report.closed, volume_m3 > 0.0, "{keys}");
    let found = if volume_m3 > 0.0 {
        object.mesh.signed_volume_m3()
    } else {
        0.0
    };
    // What is inscribed has that much less.
    let least = volume_m3 * (1.0 - 1.2e-3);
    let is_right = (least..=volume_m3 * (1.0 + 1e-6)).contains(&found);
    assert!(is_right, "{keys}: {found} {volume_m3}");
}

#[test]
fn a_shape_is_made_of_what_the_scene_says_and_stands_where_it_says() {
    let keys = "cylinder_m = [0.04, 0.1]\nmaterial = { albedo = [0.1, 0.2, 0.3], roughness = 0.2 }\n\
                position_m = [0.1, 0, 0]\nrotation_deg = [90, 0, 0]\nscale = [2, 1, -1]\nturn_deg_per_s = 90\n";
    let object = virtual_of(keys);
    assert_eq!(object.materials[0].albedo, DVec3::new(0.1, 0.2, 0.3));
    assert_eq!(object.materials[0].roughness, Some(0.2));
    assert!(object.motion.is_some());
    // Mirrored, so wound the other way in its own space.
    assert!(object.mesh.signed_volume_m3() < 0.0);
    let top = object.anchor_from_object.transform_point3(DVec3::Z * 0.1);
    assert!(top.distance(DVec3::new(0.1, 0.1, 0.0)) < 1e-9, "{top}");

    // A phantom has flat normals, whatever it is.
    let phantom = phantom_of("cylinder_m = [0.04, 0.1]");
    let is_flat = |normals: &[glam::Vec3; 3]| normals[0] == normals[1] && normals[1] == normals[2];
    assert!(phantom.mesh.corner_normals.iter().all(is_flat));
    // Corners of an outline look round where they turn by little, and what is round always does.
    let octagon: Vec<String> = (0..8)
        .map(|step| {
            let at = DVec2::from_angle(f64::from(step) * PI / 4.0) * 0.05;
            format!("[{}, {}]", at.x, at.y)
        })
        .collect();
    let prism = format!(
        "prism = {{ height_m = 0.1, outline_m = [{}] }}",
        octagon.join(", ")
    );
    for (smooth_deg, is_round) in [(30.0, false), (50.0, true)] {
        let prism = virtual_of(&format!("{prism}\nsmooth_deg = {smooth_deg}"));
        let sides = prism
            .mesh
            .corner_normals
            .iter()
            .filter(|normals| normals[0].z.abs() < 0.5);
        assert_eq!(!sides.clone().all(is_flat), is_round, "{smooth_deg}");
        assert_eq!(sides.count(), 16);
    }
    let wall = virtual_of("cylinder_m = [0.04, 0.1]\nsmooth_deg = 0");
    assert!(!wall.mesh.corner_normals.iter().all(is_flat));
}

#[test]
fn check_tells_what_a_thing_is() {
    let scene = load(
        "[[phantom]]\nname = \"book\"\nbox_m = [0.15, 0.21, 0.03]\n\
         [[virtual]]\nname = \"mug\"\nrevolved = { profile_m = [[0, 0], [0.04, 0], [0.04, 0.1], [0.036, 0.1], [0.036, 0.005], [0, 0.005]] }\n\
         [[virtual]]\nname = \"cube\"\nmesh = \"models/cube.obj\"\n",
    );
    let told = summary(&scene.unwrap());
    for part in [
        "book  on table  15 cm x 21 cm x 3 cm",
        "box of 12 triangles, closed",
        "revolved profile of 768 triangles, closed",
        "  12 triangles, closed",
    ] {
        assert!(told.contains(part), "{part}:\n{told}");
    }
}

fn picture(scene: Scene, camera_from_world: DAffine3) -> (Vec<u8>, Vec<u8>) {
    let mut renderer: Renderer = Stage::of_scene(scene).renderer(CAMERA);
    renderer.draw(&[Some(camera_from_world)], Shown::Composite);
    let role = renderer.layers().expect("layers").role;
    (renderer.read_picture().expect("a picture"), role)
}

const LIT: &str = "[table]\nrect_m = [-1, -1, 1, 1]\n[[light]]\nkind = \"point\"\nposition_m = [-0.3, 0.2, 0.5]\n\
                   intensity = 1\n[ambient]\nradiance = 0.1\n";

#[test]
fn a_box_gives_the_picture_of_the_same_box_in_a_file() {
    let project = project();
    // (Gathered light depends on how a surface is cut into triangles, by less than a level.)
    // A file of the unit cube, its sides in another order, scaled and moved to where the box stands.
    let things = |thing: &str, block: &str| {
        format!(
            "{HEAD}{LIT}[shadows]\nambient_samples = 0\n[[virtual]]\nname = \"v\"\n{thing}\nrotation_deg = [0, 0, 30]\n\
             material = {{ albedo = [0.7, 0.3, 0.1] }}\n[[phantom]]\nname = \"p\"\n{block}\nposition_m = [0.1, -0.1, 0]\n"
        )
    };
    let cube = "v -.5 -.5 0\nv .5 -.5 0\nv -.5 .5 0\nv .5 .5 0\nv -.5 -.5 1\nv .5 -.5 1\nv -.5 .5 1\nv .5 .5 1\n\
                f 5 6 8 7\nf 2 4 8 6\nf 1 5 7 3\nf 3 7 8 4\nf 1 2 6 5\nf 1 3 4 2\n";
    std::fs::write(project.path().join("models/unit.obj"), cube).unwrap();
    let of_box = things(
        "box_m = [0.125, 0.0625, 0.25]",
        "box_m = [0.0625, 0.0625, 0.125]",
    );
    let of_mesh = things(
        "mesh = \"models/unit.obj\"\nscale = [0.125, 0.0625, 0.25]",
        "mesh = \"models/unit.obj\"\nscale = [0.0625, 0.0625, 0.125]",
    );
    let camera = look_at(DVec3::new(0.3, -0.5, 0.4), DVec3::new(0.0, 0.0, 0.08));
    let [one, other] =
        [of_box, of_mesh].map(|text| picture(load_in(&project, &text).unwrap(), camera));
    assert!(one.1.iter().filter(|role| **role == VIRTUAL).count() > 1000);
    assert_eq!(one.1, other.1, "the same pixels");
    assert_eq!(one.0, other.0, "the same picture");
    // And again.
    let text = things(
        "box_m = [0.125, 0.0625, 0.25]",
        "box_m = [0.0625, 0.0625, 0.125]",
    );
    assert_eq!(picture(load_in(&project, &text).unwrap(), camera).0, one.0);
}

/// Whether a ray from outside meets a cylinder about z that stands on z = 0.
fn meets_cylinder(from: DVec3, way: DVec3, radius: f64, height: f64) -> bool {
    let (a, b, c) = (
        way.truncate().length_squared(),
        from.truncate().dot(way.truncate()),
        from.truncate().length_squared() - radius * radius,
    );
    let root = b * b - a * c;
    if root < 0.0 {
        return false;
    }
    let wall = [(-b - root.sqrt()) / a, (-b + root.sqrt()) / a];
    let heights = [-from.z / way.z, (height - from.z) / way.z];
    let enters = wall[0].max(heights[0].min(heights[1]));
    enters < wall[1].min(heights[0].max(heights[1]))
}

fn meets_ball(from: DVec3, way: DVec3, center: DVec3, radius: f64) -> bool {
    let way = way.normalize();
    let to_center = center - from;
    (to_center - way * to_center.dot(way)).length() < radius
}

#[test]
fn outlines_of_what_is_round_are_those_of_the_formula() {
    let camera = look_at(DVec3::new(0.1, -0.3, 0.25), DVec3::new(0.0, 0.0, 0.05));
    let from = camera.inverse().translation;
    type Meets = Box<dyn Fn(DVec3) -> bool>;
    let cylinder: Meets = Box::new(move |way| meets_cylinder(from, way, 0.06, 0.1));
    let ball: Meets = Box::new(move |way| meets_ball(from, way, DVec3::Z * 0.06, 0.06));
    for (keys, meets) in [
        ("cylinder_m = [0.06, 0.1]", cylinder),
        ("sphere_m = 0.06", ball),
    ] {
        for quality in ["accurate", "balanced"] {
            let text = format!(
                "{LIT}[shadows]\nquality = \"{quality}\"\n[[virtual]]\nname = \"v\"\n{keys}\n"
            );
            let (_, role) = picture(load(&text).unwrap(), camera);
            let at = |offset_px: DVec2, index: usize| {
                let pixel = DVec2::new((index % 320) as f64, (index / 320) as f64) + offset_px;
                let plane = (pixel - CAMERA.center_px) / CAMERA.focal_px;
                meets(camera.inverse().transform_vector3(plane.extend(1.0)))
            };
            let (mut inside, mut off, mut far_off) = (0, 0, 0);
            for (index, role) in role.iter().enumerate() {
                let expected = at(DVec2::ZERO, index);
                inside += usize::from(expected);
                if (*role == VIRTUAL) == expected {
                    continue;
                }
                off += 1;
                // What differs lies on the outline, within a sixth of a pixel; where a coarser version may stand, within half.
                let reach = if quality == "accurate" { 0.17 } else { 0.5 };
                let around =
                    (0..16).map(|step| DVec2::from_angle(f64::from(step) * PI / 8.0) * reach);
                far_off += usize::from(
                    !around
                        .into_iter()
                        .any(|offset| at(offset, index) != expected),
                );
            }
            assert!(inside > 8000, "{keys}: {inside}");
            assert!(
                far_off == 0 && off < 40,
                "{keys}, {quality}: {off} pixels, {far_off} of them far"
            );
        }
    }
}
