//! Lights of some size, held against the many small ones that they are.

use glam::{DVec2, DVec3};
use gnomon::geometry::bounds::Bounds;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::pieces::Onlooking;
use gnomon::light::{Light, Rect, Shape};
use gnomon::render::{REAL, Shown};
use gnomon::scene::format::LightKind;
use gnomon::scene::{Scene, SceneLight};

use crate::common::{Picture, Stage, look_at, project_file};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [160, 120],
    focal_px: DVec2::splat(180.0),
    center_px: DVec2::new(79.5, 59.5),
    distortion: Distortion::NONE,
};

/// The scene that ships, under other lights of which each is so many pieces at most.
fn scene(lights: Vec<Light>, light_samples: u32) -> Scene {
    let file = project_file("config/lamp.toml");
    let mut scene = Scene::load(&file).expect("the scene of the demo");
    scene.lights = lights.into_iter().map(SceneLight::from).collect();
    scene.shadows.samples = 1;
    scene.shadows.light_samples = light_samples;
    // (What things reflect of a light is gathered from other places of it than these.)
    scene.shadows.ambient_samples = 0;
    scene
}

fn drawn(scene: &Scene) -> (Picture, Vec<u8>) {
    let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
    let camera_from_world = look_at(DVec3::new(0.1, -0.5, 0.4), DVec3::new(0.03, 0.0, 0.03));
    let nodes = scene.camera_from_nodes(&[Some(camera_from_world)], 0.0);
    renderer.draw(&nodes, Shown::Composite);
    let picture = Picture::new(renderer.read_picture().expect("a picture"));
    (picture, renderer.layers().expect("layers").role)
}

/// A light of each kind that has a size.
fn lights() -> Vec<Light> {
    let lamp = |shape| Light::Point {
        position_m: DVec3::new(-0.26, 0.24, 0.46),
        intensity: DVec3::ONE,
        shape,
    };
    let facing = DVec3::new(0.26, -0.24, -0.46).normalize();
    let rect = Rect::upright(facing, DVec3::Z, DVec2::new(0.2, 0.1));
    let sun = Light::Directional {
        direction: DVec3::new(0.3, -0.3, -0.5).normalize(),
        irradiance: DVec3::splat(3.0),
        angle_rad: 0.1,
    };
    let of_kind = |(_, kind)| match kind {
        LightKind::Point | LightKind::Spot => None,
        LightKind::Directional => Some(sun),
        LightKind::Sphere => Some(lamp(Shape::Sphere { radius_m: 0.06 })),
        LightKind::Rect => Some(lamp(Shape::Rect(rect))),
    };
    LightKind::BY_NAME.into_iter().filter_map(of_kind).collect()
}

/// From where a light is looked at in the scene.
fn onlooking(light: &Light) -> Onlooking {
    let virtuals = scene(vec![*light], 1).virtuals;
    let visible = virtuals.iter().filter(|object| object.visible);
    let corners = visible.flat_map(|object| object.positions_in_anchor(&object.mesh));
    let bounds = Bounds::around(corners.map(|corner| corner.as_dvec3()));
    Onlooking::of(light, &bounds.expect("virtual things"))
}

#[test]
fn a_light_of_some_size_shades_as_its_pieces_do() {
    for light in lights() {
        let (whole, role) = drawn(&scene(vec![light], 16));
        // Each of them is one light, that casts one shadow.
        let (pieces, _) = drawn(&scene(light.pieces(16, onlooking(&light)), 1));
        let (mut changed, mut worst) = (0, 0);
        for index in (0..role.len()).filter(|&index| role[index] == REAL) {
            let [a, b] = [&whole, &pieces].map(|picture| picture.pixel(index));
            changed += usize::from(a != [255; 3]);
            let off = a.iter().zip(b).map(|(a, b)| a.abs_diff(b)).max();
            worst = worst.max(off.unwrap_or(0));
        }
        assert!(changed > 100, "{light:?}: {changed} changed");
        // (One piece of 16 is 16 levels and more; the whole light's closed form and its pieces' sum differ by a percent.)
        assert!(worst <= 5, "{light:?}: {worst} levels off");
    }
}

#[test]
fn any_number_of_pieces_is_drawn() {
    for light in lights() {
        for count in [1, 2, 3, 5] {
            let (picture, role) = drawn(&scene(vec![light], count));
            let shaded = (0..role.len())
                .filter(|&index| role[index] == REAL && picture.pixel(index) != [255; 3])
                .count();
            assert!(shaded > 100, "{light:?} of {count}: {shaded}");
        }
    }
}
