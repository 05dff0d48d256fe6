//! Things that move by themselves, held against closed forms and against the same things where they have got to.

use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::render::{Renderer, Shown, VIRTUAL};
use gnomon::scene::Scene;

use crate::common::{Picture, Stage, look_at, project_file};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(360.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: Distortion::NONE,
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
    // (Where things move light is gathered at fewer points.)
    scene.shadows.ambient_samples = 0;
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

/// Over a white video.
fn renderer(scene: &Scene) -> Renderer {
    Stage::of_scene(scene.clone()).renderer(CAMERA)
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

/// A scene with one thing, a box on a marker, with these keys.
fn of_one(kind: &str, keys: &str) -> Scene {
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\nmarkers = [{{ id = 0, size_m = 0.045, center_m = [0, 0] }}]\n\
         [[marker]]\nname = \"card\"\nid = 1\nsize_m = 0.045\n[[light]]\nkind = \"point\"\nposition_m = [-0.2, 0.1, 0.5]\nintensity = 1\n\
         [table]\nrect_m = [-1, -1, 1, 1]\n[[{kind}]]\nname = \"it\"\non = \"card\"\nbox_m = [0.06, 0.04, 0.03]\n{keys}"
    );
    Scene::parse(&project_file("config/one.toml"), &text).expect("a scene")
}

/// Where a point of the thing is at a time, in its marker's frame.
fn on_card(scene: &Scene, point: DVec3, time_s: f64) -> DVec3 {
    let moving = scene.phantoms.iter().chain(&scene.virtuals);
    let object = moving.last().expect("a thing");
    // The marker stands somewhere else than the board.
    let camera_from_card = DAffine3::from_rotation_translation(
        DQuat::from_rotation_x(0.7),
        DVec3::new(0.2, -0.1, 0.9),
    );
    let anchors = [Some(DAffine3::IDENTITY), Some(camera_from_card)];
    let nodes = scene.camera_from_nodes(&anchors, time_s);
    let camera_from_node = nodes[object.anchor].expect("a place");
    let card_from_object =
        camera_from_card.inverse() * camera_from_node * object.anchor_from_object;
    card_from_object.transform_point3(point)
}

#[test]
fn things_of_both_kinds_turn_and_travel_as_the_formulas_say() {
    let corner = DVec3::new(0.03, 0.02, 0.03);
    let place = DVec3::new(0.1, 0.05, 0.0);
    let placed = "position_m = [0.1, 0.05, 0]\nrotation_deg = [0, 0, 15]\n";
    let about_z = |degrees: f64| DQuat::from_rotation_z(degrees.to_radians());
    for kind in ["phantom", "virtual"] {
        // A number is a turn about z, three are an axis times the speed: Rodrigues' formula.
        let number = of_one(kind, &format!("{placed}turn_deg_per_s = -48\n"));
        let axis = of_one(kind, &format!("{placed}turn_deg_per_s = [30, 0, 40]\n"));
        let unit = DVec3::new(0.6, 0.0, 0.8);
        // To and fro between two places, two seconds each way, with half a turn.
        let path = "path = [{ time_s = 1 }, { time_s = 3, position_m = [0.2, -0.1, 0.04], rotation_deg = [0, 0, 180] }]\n\
                    path_end = \"return\"\n";
        let path = of_one(kind, &format!("{placed}{path}"));
        let both = of_one(
            kind,
            &format!(
                "{placed}turn_deg_per_s = 90\npath = [{{ time_s = 0 }}, {{ time_s = 4, position_m = [0.4, 0, 0] }}]\npath_end = \"repeat\"\n"
            ),
        );
        for time_s in [0.0, 0.25, 1.0, 2.5, 3.0, 4.5, 77.125] {
            let arm = about_z(15.0) * corner;
            let expected = place + about_z(-48.0 * time_s) * arm;
            assert!(on_card(&number, corner, time_s).distance(expected) < 1e-12);

            let (sine, cosine) = (50.0 * time_s).to_radians().sin_cos();
            let turned =
                arm * cosine + unit.cross(arm) * sine + unit * unit.dot(arm) * (1.0 - cosine);
            assert!(on_card(&axis, corner, time_s).distance(place + turned) < 1e-12);

            let since_s = (time_s - 1.0_f64).max(0.0) % 4.0;
            let part = 1.0 - (since_s - 2.0).abs() / 2.0;
            let expected = place + DVec3::new(0.2, -0.1, 0.04) * part + about_z(180.0 * part) * arm;
            assert!(
                on_card(&path, corner, time_s).distance(expected) < 1e-12,
                "{time_s}"
            );

            let expected = place + DVec3::X * 0.1 * (time_s % 4.0) + about_z(90.0 * time_s) * arm;
            assert!(
                on_card(&both, corner, time_s).distance(expected) < 1e-12,
                "{time_s}"
            );
        }
    }
}

#[test]
fn a_replay_of_what_moves_repeats_bit_for_bit() {
    let keys = "turn_deg_per_s = [10, 20, 70]\npath = [{ time_s = 0 }, { time_s = 0.7, position_m = [0.05, 0, 0.02] }]\npath_end = \"repeat\"\n";
    let scene = of_one("virtual", keys);
    let camera = look_at(DVec3::new(0.1, -0.5, 0.4), DVec3::ZERO);
    let mut shown = Vec::new();
    // Frame by frame, and once more in a renderer that sees every other frame alone.
    for step in [1, 2] {
        let mut renderer = renderer(&scene);
        for frame in (0..9).step_by(step) {
            let time_s = f64::from(frame) / 30.0;
            let nodes = scene.camera_from_nodes(&[Some(camera), Some(camera)], time_s);
            renderer.draw(&nodes, Shown::Composite);
            shown.push((frame, renderer.read_picture().expect("a picture")));
        }
    }
    let (every, some) = shown.split_at(9);
    for (frame, picture) in some {
        assert_eq!(picture, &every[*frame as usize].1, "frame {frame}");
    }
    assert_ne!(every[0].1, every[8].1);
}
