//! Things that move by themselves, held against the same things where they have got to.

use glam::{DVec2, DVec3};
use gnomon::geometry::camera::Intrinsics;
use gnomon::render::{Renderer, Shown, VIRTUAL};
use gnomon::scene::Scene;

use crate::common::{Picture, frame_of, gpu, look_at, project_file};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(360.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: [0.0; 5],
};
/// A picture, and what each of its pixels belongs to.
struct Shot {
    picture: Picture,
    role: Vec<u8>,
}

/// The scene that ships, with keys after its tin's and its torus's places.
fn scene(tin: &str, torus: &str) -> Scene {
    let file = project_file("config/lamp.toml");
    let text = std::fs::read_to_string(&file).expect("the scene of the demo");
    let text = text
        .replace("position_m = [0.085, -0.028, 0.0]\n", tin)
        .replace(
            "position_m = [0.022, 0.0, 0.036]\nrotation_deg = [70, 0, 35]\n",
            torus,
        );
    let mut scene = Scene::parse(&file, &text).expect("a scene");
    // With more, a pixel on an edge has something of both.
    scene.shadows.samples = 1;
    scene
}

fn shot(renderer: &mut Renderer, scene: &Scene, time_s: f64) -> Shot {
    let camera_from_world = look_at(DVec3::new(0.1, -0.5, 0.4), DVec3::new(0.03, 0.0, 0.03));
    let nodes = scene.camera_from_nodes(&[Some(camera_from_world)], time_s);
    renderer.draw(&nodes, Shown::Composite);
    Shot {
        picture: Picture::new(renderer.read_picture().expect("a picture")),
        role: renderer.layers().expect("layers").role,
    }
}

fn renderer(scene: &Scene) -> Renderer {
    let mut renderer = Renderer::new(gpu(), scene, CAMERA).expect("a renderer");
    let frame = frame_of(CAMERA.size_px, |_| 255);
    renderer.upload(&frame).expect("an uploaded frame");
    renderer
}

/// Real pixels that differ by more than rounding. (What surroundings reflect on to a virtual thing is not gathered anew
/// for one that moves.)
fn differing(one: &Shot, other: &Shot) -> usize {
    let pixels = 0..one.role.len();
    pixels
        .filter(|&index| {
            let [a, b] = [one, other].map(|shot| shot.picture.pixel(index));
            let off = a.iter().zip(b).any(|(a, b)| a.abs_diff(b) > 2);
            one.role[index] != other.role[index] || off && one.role[index] != VIRTUAL
        })
        .count()
}

#[test]
fn what_has_moved_is_shown_and_shades_as_if_it_stood_there() {
    let moving = scene(
        "position_m = [0.085, -0.028, 0.0]\n\
         path = [{ time_s = 1, position_m = [0, 0, 0] }, { time_s = 3, position_m = [0.04, 0.02, 0.01] }]\n",
        "position_m = [0.022, 0.0, 0.036]\nrotation_deg = [70, 0, 35]\nturn_deg_per_s = 20\n",
    );
    assert_eq!((moving.anchors.len(), moving.node_count()), (1, 3));
    let mut drawn = renderer(&moving);
    let before = shot(&mut drawn, &moving, 0.0);
    let standing = [
        // (time, how far along its path the tin is, how far the torus is turned)
        (0.0, 0.0, 0.0),
        (1.5, 0.25, 30.0),
        (2.5, 0.75, 50.0),
        (9.0, 1.0, 180.0),
    ];
    for (time_s, part, turned_deg) in standing {
        let place = DVec3::new(0.085, -0.028, 0.0) + DVec3::new(0.04, 0.02, 0.01) * part;
        let still = scene(
            &format!("position_m = [{}, {}, {}]\n", place.x, place.y, place.z),
            &format!(
                "position_m = [0.022, 0.0, 0.036]\nrotation_deg = [70, 0, {}]\n",
                35.0 + turned_deg
            ),
        );
        assert_eq!(still.node_count(), 1);
        let expected = shot(&mut renderer(&still), &still, time_s);
        let found = shot(&mut drawn, &moving, time_s);
        // A vertex that is rounded otherwise moves an edge by a hair.
        let off = differing(&found, &expected);
        assert!(off <= 8, "{off} pixels at {time_s} s");
        let moved = differing(&found, &before);
        assert_eq!(
            moved > 300,
            time_s > 0.0,
            "{moved} pixels have changed at {time_s} s"
        );
        // The same time gives the same picture again.
        let again = shot(&mut drawn, &moving, time_s);
        assert_eq!(again.picture.rgba, found.picture.rgba);
    }
}
