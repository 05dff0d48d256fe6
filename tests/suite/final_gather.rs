//! What virtual things hide of the ambient light from real ones and reflect on to them, held against closed forms and rays.

use std::f64::consts::PI;

use glam::{DAffine3, DVec2, DVec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::geometry::ray_caster::RayCaster;
use gnomon::light::Light;
use gnomon::render::{REAL, Shown};
use gnomon::scene::{Bounces, Object, Scene};

use crate::common::shapes::{cuboid, rectangle};
use crate::common::{Stage, flat_mesh, look_at, object, scene};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [160, 120],
    focal_px: DVec2::splat(170.0),
    center_px: DVec2::new(79.5, 59.5),
    distortion: Distortion::NONE,
};
const AMBIENT: f64 = 0.2;
const TABLE_ALBEDO: f64 = 0.5;

fn thing(name: &str, soup: crate::common::shapes::Soup, albedo: f64, at: DVec3) -> Object {
    let mesh = flat_mesh(soup.positions, soup.triangles);
    let place = DAffine3::from_translation(at);
    object(name, mesh, DVec3::splat(albedo), place)
}

/// Things on a wide table in ambient light.
fn on_table(phantoms: Vec<Object>, virtuals: Vec<Object>, lights: Vec<Light>) -> Scene {
    let table = rectangle([-1.0, -1.0], [1.0, 1.0]);
    let mut table = thing("table", table, TABLE_ALBEDO, DVec3::ZERO);
    table.casts = false;
    let phantoms = std::iter::once(table).chain(phantoms).collect();
    let mut scene = scene(phantoms, virtuals, lights, AMBIENT);
    scene.shadows.samples = 1;
    scene.shadows.ambient_samples = 512;
    // As the closed forms have it.
    scene.bounces = Bounces::Estimated;
    scene
}

struct Drawn {
    gain: Vec<[f32; 3]>,
    role: Vec<u8>,
    camera_from_world: DAffine3,
}

impl Drawn {
    fn new(scene: &Scene, eye: DVec3) -> Self {
        let camera_from_world = look_at(eye, DVec3::new(0.0, 0.0, 0.0));
        let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
        renderer.draw(&[Some(camera_from_world)], Shown::Composite);
        let layers = renderer.layers().expect("layers");
        Self {
            gain: layers.gain,
            role: layers.role,
            camera_from_world,
        }
    }

    /// The place on the table that a pixel's centre shows.
    fn place(&self, index: usize) -> DVec3 {
        let pixel = DVec2::new((index % 160) as f64, (index / 160) as f64);
        let world_from_camera = self.camera_from_world.inverse();
        let way = ((pixel - CAMERA.center_px) / CAMERA.focal_px).extend(1.0);
        let way = world_from_camera.transform_vector3(way);
        let eye = world_from_camera.translation;
        eye - way * (eye.z / way.z)
    }

    /// Of the pixel that shows a place the place that its centre shows, and its green gain; `None` where that is not real.
    fn gain_at(&self, place: DVec3) -> Option<(DVec3, f64)> {
        let seen = self.camera_from_world.transform_point3(place);
        let pixel = CAMERA.focal_px * seen.truncate() / seen.z + CAMERA.center_px;
        let [column, row] = pixel.round().to_array();
        if !(0.0..160.0).contains(&column) || !(0.0..120.0).contains(&row) {
            return None;
        }
        let index = row as usize * 160 + column as usize;
        let gain = f64::from(self.gain[index][1]);
        (self.role[index] == REAL).then(|| (self.place(index), gain))
    }
}

/// Form factor from a place facing up to a level rectangle above it, from its corner straight above (Howell's catalogue, B-4).
fn of_corner(a: f64, b: f64, height: f64) -> f64 {
    let (x, y) = (a / height, b / height);
    let part = |x: f64, y: f64| x / (1.0 + x * x).sqrt() * (y / (1.0 + x * x).sqrt()).atan();
    (part(x, y) + part(y, x)) / (2.0 * PI)
}

/// The same to a square of a half side, whose middle is (x, y) beside straight above.
fn of_square(half: f64, x: f64, y: f64, height: f64) -> f64 {
    let signed = |a: f64, b: f64| (a * b).signum() * of_corner(a.abs(), b.abs(), height);
    let (right, left, back, front) = (x + half, x - half, y + half, y - half);
    signed(right, back) - signed(left, back) - signed(right, front) + signed(left, front)
}

#[test]
fn a_black_plate_hides_its_form_factor_of_the_ambient_light() {
    let (half, height) = (0.08, 0.1);
    let plate = cuboid([-0.08, -0.08, 0.0], [0.08, 0.08, 0.0002]);
    let plate = thing("plate", plate, 0.0, DVec3::new(0.0, 0.0, height));
    let drawn = Drawn::new(
        &on_table(Vec::new(), vec![plate], Vec::new()),
        DVec3::new(0.0, -0.7, 0.22),
    );
    let mut count = 0;
    for step in -20..=20 {
        let place = DVec3::new(0.015 * f64::from(step), -0.03, 0.0);
        let Some((place, gain)) = drawn.gain_at(place) else {
            continue;
        };
        let expected = 1.0 - of_square(half, -place.x, -place.y, height);
        assert!(
            (gain - expected).abs() < 0.012,
            "{place}: {gain}, not {expected}"
        );
        count += 1;
    }
    assert!(count > 30, "{count}");
}

#[test]
fn a_lit_plate_lights_the_table_below_it_by_its_form_factor() {
    // Light from below, which no table up there is in the way of, is reflected by the plate alone.
    let (half, height, albedo) = (0.08, 0.1, 0.8);
    let plate = cuboid([-0.08, -0.08, 0.0], [0.08, 0.08, 0.0002]);
    let plate = thing("plate", plate, albedo, DVec3::new(0.0, 0.0, height));
    let irradiance = 2.0;
    let lamp = Light::directional(DVec3::Z, DVec3::splat(irradiance));
    let drawn = Drawn::new(
        &on_table(Vec::new(), vec![plate], vec![lamp]),
        DVec3::new(0.0, -0.7, 0.22),
    );
    // It reflects the light and the ambient light, and hides the ambient light.
    let change = albedo * (AMBIENT + irradiance / PI) / AMBIENT - 1.0;
    let mut count = 0;
    for step in -20..=20 {
        let place = DVec3::new(0.015 * f64::from(step), -0.03, 0.0);
        let Some((place, gain)) = drawn.gain_at(place) else {
            continue;
        };
        let expected = 1.0 + change * of_square(half, -place.x, -place.y, height);
        let off = (gain - expected).abs();
        assert!(
            off < 0.012 * change.max(1.0),
            "{place}: {gain}, not {expected}"
        );
        count += 1;
    }
    assert!(count > 30, "{count}");
}

/// Part of the ambient light that black things leave to a place of the table, by many rays.
fn left(casters: &[&RayCaster], place: DVec3) -> f64 {
    const RAYS: usize = 20_000;
    let start = (place + DVec3::Z * 1e-5).as_vec3();
    let open = (0..RAYS).filter(|&index| {
        let radius = ((index as f64 + 0.5) / RAYS as f64).sqrt();
        let (sine, cosine) = (2.399_963_229_728_653 * index as f64).sin_cos();
        let height = (1.0 - radius * radius).sqrt();
        let way = DVec3::new(radius * cosine, radius * sine, height).as_vec3();
        !casters
            .iter()
            .any(|it| it.is_hidden(start, way, f32::INFINITY))
    });
    open.count() as f64 / RAYS as f64
}

fn caster(things: &[Object]) -> RayCaster {
    let triangles = things.iter().filter(|thing| thing.casts).flat_map(|thing| {
        let positions = thing.positions_in_anchor(&thing.mesh);
        let triangles = thing.mesh.triangles.iter();
        let triangles = triangles.map(|it| it.map(|index| positions[index as usize]));
        triangles.collect::<Vec<_>>()
    });
    RayCaster::new(&triangles.collect::<Vec<_>>())
}

/// A virtual box that stands on the table beside a real one, all black.
fn beside() -> Scene {
    let post = thing(
        "post",
        cuboid([-0.03, -0.03, 0.0], [0.03, 0.03, 0.12]),
        0.0,
        DVec3::ZERO,
    );
    let real = cuboid([0.0, -0.05, 0.0], [0.05, 0.05, 0.08]);
    let real = thing("crate", real, 0.0, DVec3::new(0.07, 0.02, 0.0));
    on_table(vec![real], vec![post], Vec::new())
}

#[test]
fn what_stands_on_the_table_darkens_it_up_to_where_they_touch() {
    let scene = beside();
    let drawn = Drawn::new(&scene, DVec3::new(-0.35, -0.45, 0.5));
    let [real, virtuals] = [&scene.phantoms, &scene.virtuals].map(|things| caster(things));
    let (mut squares, mut count) = (0.0, 0);
    for index in 0..drawn.gain.len() {
        if drawn.role[index] != REAL {
            continue;
        }
        let place = drawn.place(index);
        let eye = drawn.camera_from_world.inverse().translation;
        let is_table = !real.is_hidden(eye.as_vec3(), (place - eye).as_vec3(), 0.999);
        if !is_table || place.truncate().length() > 0.25 || index % 5 != 0 {
            continue;
        }
        let expected = left(&[&real, &virtuals], place) / left(&[&real], place);
        let off = f64::from(drawn.gain[index][1]) - expected;
        // Within a part's edge of what it touches light is not known better.
        assert!(
            off.abs() < 0.08,
            "{place}: {} not {expected}",
            drawn.gain[index][1]
        );
        squares += off * off;
        count += 1;
    }
    let rms = (squares / f64::from(count)).sqrt();
    assert!(count > 300 && rms < 0.012, "{count} pixels: {rms}");
}

#[test]
fn nothing_changes_by_a_level_where_nothing_virtual_is_near() {
    let drawn = Drawn::new(&beside(), DVec3::new(-0.7, -0.9, 1.1));
    let places = (-9..=9).flat_map(|x| (-9..=9).map(move |y| (x, y)));
    let places = places.map(|(x, y)| DVec3::new(0.1 * f64::from(x), 0.1 * f64::from(y), 0.0));
    let far = places.filter(|place| place.length() > 0.6);
    let gains: Vec<f64> = far
        .filter_map(|place| Some(drawn.gain_at(place)?.1))
        .collect();
    assert!(
        gains.len() > 20 && gains.iter().all(|&gain| gain > 0.998 && gain <= 1.0),
        "{gains:?}"
    );
}

#[test]
fn a_scene_without_it_keeps_its_ambient_light() {
    let mut scene = beside();
    scene.shadows.ambient_samples = 0;
    let drawn = Drawn::new(&scene, DVec3::new(-0.35, -0.45, 0.5));
    assert!(drawn.gain.iter().all(|gain| *gain == [1.0; 3]));
}
