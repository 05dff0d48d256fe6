//! Shafts held against closed forms, brute force and what light has to do: rooms, hierarchies, and pictures of the room that
//! ships. How near pictures come to the truth is in accuracy.rs.

use std::borrow::Cow;
use std::f32::consts::PI;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::Path;
use std::sync::OnceLock;

use crate::common::{gpu, project_file, random::Random};
use glam::{DAffine3, DVec3, Vec3};
use gnomon::app::truth::key_frames;
use gnomon::capture::{Frame, load_calibration};
use gnomon::geometry::bounds::Bounds;
use gnomon::light::probe::Probe;
use gnomon::light::{Material, reflectance};
use gnomon::render::{Layers, Renderer, Shown, VIRTUAL};
use gnomon::scene::{Difference, Scene};
use gnomon::shafts::bounding::Aabb;
use gnomon::shafts::patches::RoomTriangle;
use gnomon::shafts::placed_probe::PlacedProbe;
use gnomon::shafts::room::{Room, RoomOptions};
use gnomon::shafts::room_transport::RoomTransport;

const OPTIONS: RoomOptions = RoomOptions {
    patches: 600,
    source_power: 1.0,
    receivers_per_leaf: 8,
    least_part: 0.02,
};

/// The faces of a box, seen from within.
pub(super) fn inside_of(low: Vec3, high: Vec3, albedo: Option<f32>) -> Vec<RoomTriangle> {
    let corner = |x: usize, y: usize, z: usize| {
        let pick = |index: usize, axis: usize| [low, high][index][axis];
        Vec3::new(pick(x, 0), pick(y, 1), pick(z, 2))
    };
    let quads = [
        [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)],
        [(0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)],
        [(0, 0, 0), (0, 0, 1), (1, 0, 1), (1, 0, 0)],
        [(0, 1, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1)],
        [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)],
        [(1, 0, 0), (1, 0, 1), (1, 1, 1), (1, 1, 0)],
    ];
    let triangles = (0..).zip(quads).flat_map(|(piece, quad)| {
        let [a, b, c, d] = quad.map(|(x, y, z)| corner(x, y, z));
        [[a, b, c], [a, c, d]].map(|corners| RoomTriangle {
            corners,
            albedo: albedo.map(Vec3::splat),
            piece,
        })
    });
    triangles.collect()
}

fn bounds(low: DVec3, high: DVec3) -> Bounds {
    Bounds { low, high }
}

#[test]
fn a_room_of_one_brightness_lights_every_place_with_pi_times_it() {
    let color = Vec3::new(1.0, 0.5, 0.25);
    let probe = Probe::new([64, 32], vec![color; 64 * 32]).expect("a probe");
    let room = Room {
        triangles: inside_of(
            Vec3::new(-1.0, -1.2, -0.5),
            Vec3::new(1.1, 1.0, 1.3),
            Some(0.4),
        ),
        standing: 0,
        compact: Vec::new(),
        things: vec![bounds(DVec3::splat(-0.1), DVec3::splat(0.1))],
        options: OPTIONS,
        probe: PlacedProbe {
            probe: Cow::Borrowed(&probe),
            position_m: DVec3::ZERO,
            exposure: 2.0,
            beyond_m: 0.0,
        },
    };
    let prepared = room.transport();
    let expected = color * 2.0 * PI;
    for (vertex, irradiance) in prepared.patches.vertices.iter().zip(&prepared.irradiance) {
        let error = (*irradiance / expected - 1.0).abs().max_element();
        assert!(error < 0.02, "{}: {irradiance}", vertex.position);
    }
    let mut random = Random::new(3);
    for _ in 0..50 {
        let mut part = |size: f64| random.between(-size, size) as f32;
        let place = Vec3::new(part(0.2), part(0.2), part(0.2));
        let normal = Vec3::new(part(1.0), part(1.0), part(1.0)).normalize();
        let irradiance = prepared.volume.irradiance(place, normal);
        let error = (irradiance / expected - 1.0).abs().max_element();
        assert!(error < 0.01, "{place} {normal}: {irradiance}");
    }
}

/// The room that ships, coarsely.
fn coarse_scene() -> Scene {
    let mut scene = Scene::load(&project_file("config/room.toml")).expect("the room");
    scene.shadows.shafts.patches = 600;
    scene
}

fn coarse_room() -> &'static RoomTransport {
    static ROOM: OnceLock<RoomTransport> = OnceLock::new();
    ROOM.get_or_init(|| {
        let scene = coarse_scene();
        scene
            .room(scene.probe.as_ref().expect("a probe"))
            .transport()
    })
}

#[test]
fn no_source_that_a_box_hides_and_no_receiver_that_notices_is_missed() {
    let room = coarse_room();
    let mut random = Random::new(17);
    let center = |patch: u32| room.patches.center(&room.patches.patches[patch as usize]);
    let mut hidden = 0;
    for _ in 0..30 {
        let mut part = |low: f64, high: f64| random.between(low, high) as f32;
        let low = Vec3::new(part(-0.4, 0.4), part(-0.4, 0.4), part(0.0, 0.4));
        let high = low + Vec3::new(part(0.01, 0.2), part(0.01, 0.2), part(0.01, 0.2));
        let tested = Aabb::around([low, high]);
        let marks = room.mark(&[tested]);
        let sources = marks.sources(&room.sources);
        let receivers = marks.receivers(&room.receivers);
        for (patch, receiver) in room.patches.patches.iter().enumerate() {
            for &vertex in &receiver.vertices {
                let to = room.patches.vertices[vertex as usize].position;
                let row = room.transfers.row(vertex as usize);
                for (source, &from) in room.sources.patches.iter().enumerate() {
                    if row[source] > 0.0 && crosses(center(from), to, &tested) {
                        hidden += 1;
                        assert!(
                            sources[source] && receivers[patch],
                            "{tested:?}: {source} {patch}"
                        );
                    }
                }
            }
        }
    }
    assert!(hidden > 1000, "{hidden}");
    let outside = Aabb::around([Vec3::splat(3.0), Vec3::splat(3.5)]);
    let marks = room.mark(&[outside]);
    assert!(!marks.sources(&room.sources).contains(&true));
    assert!(!marks.receivers(&room.receivers).contains(&true));
}

fn crosses(a: Vec3, b: Vec3, bounds: &Aabb) -> bool {
    let (mut first, mut last) = (0.0_f32, 1.0_f32);
    for axis in 0..3 {
        let way = b[axis] - a[axis];
        let [one, other] = [bounds.min, bounds.max].map(|face| (face[axis] - a[axis]) / way);
        first = first.max(one.min(other));
        last = last.min(one.max(other));
    }
    first <= last
}

struct Seen {
    picture: Vec<u8>,
    layers: Layers,
}

impl Seen {
    /// Mean of the gain's green over real pixels that it darkens.
    fn darkest(&self) -> f32 {
        let real = self.layers.gain.iter().zip(&self.layers.role);
        let gains = real.filter(|(_, role)| **role != VIRTUAL);
        gains.map(|(gain, _)| gain[1]).fold(1.0, f32::min)
    }

    /// Mean level of green on virtual pixels.
    fn virtual_level(&self) -> f64 {
        let pixels = self.picture.chunks_exact(4).zip(&self.layers.role);
        let levels = pixels.filter(|(_, role)| **role == VIRTUAL);
        let levels: Vec<f64> = levels.map(|(pixel, _)| f64::from(pixel[1])).collect();
        levels.iter().sum::<f64>() / levels.len() as f64
    }
}

fn frame() -> &'static (Frame, Vec<Option<DAffine3>>) {
    static FRAME: OnceLock<(Frame, Vec<Option<DAffine3>>)> = OnceLock::new();
    FRAME.get_or_init(|| {
        let folder = project_file("recordings/room");
        let mut keys = key_frames(&folder, &coarse_scene().anchors).expect("key frames");
        keys.swap_remove(0)
    })
}

fn renderer(scene: &Scene) -> Renderer {
    let calibration = project_file("recordings/room/camera.toml");
    let intrinsics = load_calibration(Path::new(&calibration)).expect("the calibration");
    let mut renderer =
        gnomon::app::precomputed::renderer(gpu(), scene, intrinsics).expect("a renderer");
    renderer.upload(&frame().0).expect("an uploaded frame");
    renderer
}

fn seen(renderer: &mut Renderer) -> Seen {
    renderer.draw(&frame().1, Shown::Composite);
    Seen {
        picture: renderer.read_picture().expect("a picture"),
        layers: renderer.layers().expect("layers"),
    }
}

#[test]
fn what_rests_is_drawn_the_same_bit_for_bit_also_after_it_moved_and_came_back() {
    let scene = coarse_scene();
    let mut renderer = renderer(&scene);
    let first = seen(&mut renderer).picture;
    assert!(first == seen(&mut renderer).picture);
    let mut moved = scene.clone();
    moved.virtuals[0].anchor_from_object.translation.x += 0.03;
    assert!(renderer.follow(&moved));
    let there = seen(&mut renderer).picture;
    assert!(there != first);
    // As if it had always stood there, but for patches that are cut by where things first stood.
    let anew = seen(&mut self::renderer(&moved)).picture;
    let differences = there.iter().zip(&anew).map(|(a, b)| a.abs_diff(*b));
    let far = differences.filter(|difference| *difference > 8).count();
    assert!(far < there.len() / 1000, "{far} of {}", there.len());
    assert!(renderer.follow(&scene));
    assert!(first == seen(&mut renderer).picture);
    // Another light is another room.
    let mut brighter = scene.clone();
    brighter.probe.as_mut().expect("a probe").exposure *= 2.0;
    assert!(!renderer.follow(&brighter));
}

#[test]
fn a_thing_that_is_lifted_from_the_table_takes_its_shadow_along() {
    let mut scene = coarse_scene();
    scene.virtuals.truncate(1);
    let mut renderer = renderer(&scene);
    let mut before = 0.0;
    for height_m in [0.0, 0.02, 0.06, 0.15] {
        let mut lifted = scene.clone();
        lifted.virtuals[0].anchor_from_object.translation.z += height_m;
        assert!(renderer.follow(&lifted));
        let darkest = seen(&mut renderer).darkest();
        assert!(darkest > before, "{height_m} m: {darkest} after {before}");
        before = darkest;
    }
    assert!(before > 0.8, "{before}");
}

#[test]
fn gloss_in_a_room_of_one_brightness_is_what_the_brdf_makes_of_it() {
    // All around the same radiance, which the camera's exposure makes 0.5.
    let mut scene = coarse_scene();
    let probe = scene.probe.as_mut().expect("a probe");
    probe.probe = Probe::new([64, 32], vec![Vec3::ONE; 64 * 32]).expect("a probe");
    probe.exposure = 0.5;
    // A ball high above the table, in nobody's way.
    scene.virtuals.remove(0);
    scene.phantoms.retain(|phantom| phantom.name == "table");
    scene.phantoms[0].materials[0].albedo = DVec3::ONE;
    let ball = &mut scene.virtuals[0];
    ball.anchor_from_object.translation.z = 0.12;
    ball.casts = false;
    for roughness in [0.05, 0.3, 1.0] {
        let material = Material {
            roughness: Some(roughness),
            ..Material::matt(DVec3::new(0.6, 0.3, 0.1))
        };
        scene.virtuals[0].materials = vec![material];
        let (frame, poses) = frame();
        let seen = seen(&mut renderer(&scene));
        let camera_from_world = poses[0].expect("a pose");
        let center =
            camera_from_world.transform_point3(scene.virtuals[0].anchor_from_object.translation);
        // Where the line from the camera to the ball's middle meets it, it faces the camera.
        let [x, y] = load_calibration(&project_file("recordings/room/camera.toml"))
            .map(|it| (it.focal_px * center.truncate() / center.z + it.center_px).to_array())
            .expect("the calibration")
            .map(|at| at.round() as usize);
        let pixel = 4 * (y * frame.size_px[0] as usize + x);
        let level = |channel: usize| f64::from(seen.picture[pixel + channel]) / 255.0;
        let linear = DVec3::from_array(
            [0, 1, 2].map(|channel| ((level(channel) + 0.055) / 1.055).powf(2.4)),
        );
        let expected = 0.5 * reflected_of_everywhere(&material);
        let error = (linear / expected - 1.0).abs().max_element();
        assert!(error < 0.06, "{roughness}: {linear}, not {expected}");
    }
}

#[test]
fn the_ways_to_take_light_away_agree_where_the_video_is_what_the_model_says() {
    // All around the same radiance, which the camera's exposure makes 0.5, and all that is real is as bright.
    let mut scene = coarse_scene();
    let probe = scene.probe.as_mut().expect("a probe");
    probe.probe = Probe::new([64, 32], vec![Vec3::ONE; 64 * 32]).expect("a probe");
    probe.exposure = 0.5;
    scene.phantoms.retain(|phantom| phantom.name == "table");
    scene.phantoms[0].materials[0].albedo = DVec3::ONE;
    // Above the table, and black: it throws nothing back.
    scene.virtuals.truncate(1);
    scene.virtuals[0].anchor_from_object.translation.z += 0.03;
    for material in &mut scene.virtuals[0].materials {
        material.albedo = DVec3::ZERO;
    }
    // Where a pixel is in part virtual, levels and light have different means.
    scene.shadows.samples = 1;
    let (frame, _) = frame();
    let recorded = Frame {
        rgba: frame.rgba.iter().map(|_| 188).collect(),
        ..frame.clone()
    };
    let mut seen_with = |difference| {
        scene.shadows.shafts.difference = difference;
        let mut renderer = renderer(&scene);
        renderer.upload(&recorded).expect("an uploaded frame");
        seen(&mut renderer)
    };
    let ratio = seen_with(Difference::Ratio);
    // The levels that the shadow takes, and how far another way is beside what is expected of it where those are taken.
    let held_against = |other: &Seen, expected: fn(f64) -> [f64; 2]| {
        let pixels = ratio
            .picture
            .chunks_exact(4)
            .zip(other.picture.chunks_exact(4));
        let real = pixels
            .zip(&ratio.layers.role)
            .filter(|(_, role)| **role != VIRTUAL);
        let shaded: Vec<(f64, f64)> = real
            .filter(|((pixel, _), _)| pixel[1] < 180)
            .map(|((pixel, other), _)| {
                let level = f64::from(pixel[1]);
                let [low, high] = expected(level);
                let other = f64::from(other[1]);
                (188.0 - level, other - other.clamp(low, high))
            })
            .collect();
        assert!(shaded.len() > 1000, "{}", shaded.len());
        let rms = |of: fn(&(f64, f64)) -> f64| {
            let squares = shaded.iter().map(|both| of(both).powi(2));
            (squares.sum::<f64>() / shaded.len() as f64).sqrt()
        };
        (rms(|both| both.0), rms(|both| both.1))
    };
    let (taken, off) = held_against(&seen_with(Difference::Subtract), |level| [level; 2]);
    assert!(off < 0.6, "of {taken} levels {off} are off");
    // Each set's transfers lead from all light down to half of it: the first are at the slope that the encoding has at all light,
    // the last at that which it has at half.
    let by_transfers = |level: f64| {
        let hidden = 0.5 - ((level / 255.0 + 0.055) / 1.055).powf(2.4);
        let at_slope_of = |linear: f64| hidden * 255.0 * 1.055 / 2.4 * linear.powf(1.0 / 2.4 - 1.0);
        [0.25, 0.5].map(|linear| 188.0 - at_slope_of(linear))
    };
    let (taken, off) = held_against(&seen_with(Difference::Encoded), by_transfers);
    assert!(off < 0.6, "of {taken} levels {off} are off");
}

/// What a surface that faces the camera sends there of light 1 from everywhere.
fn reflected_of_everywhere(material: &Material) -> DVec3 {
    let steps = 600;
    let mut sum = DVec3::ZERO;
    for i in 0..steps {
        let polar = (f64::from(i) + 0.5) / f64::from(steps) * FRAC_PI_2;
        let (sine, cosine) = polar.sin_cos();
        let to_light = DVec3::new(sine, 0.0, cosine);
        // Seen straight on, the azimuth does not matter.
        let ring = TAU * sine * FRAC_PI_2 / f64::from(steps);
        sum += reflectance(material, DVec3::Z, to_light, DVec3::Z) * cosine * ring;
    }
    sum
}

#[test]
fn a_probe_without_a_room_lights_from_afar() {
    // As bright all around, and ten degrees about a direction far brighter.
    let to_light = DVec3::new(0.6, 0.0, 0.8);
    let size_px = [256_u32, 128];
    let texel = |index: u32| {
        let (column, row) = (index % size_px[0], index / size_px[0]);
        let polar = (f64::from(row) + 0.5) / f64::from(size_px[1]) * std::f64::consts::PI;
        let azimuth = (f64::from(column) + 0.5) / f64::from(size_px[0]) * TAU - TAU / 2.0;
        let direction = DVec3::new(
            polar.sin() * azimuth.cos(),
            polar.sin() * azimuth.sin(),
            polar.cos(),
        );
        let is_bright = direction.dot(to_light) > 10_f64.to_radians().cos();
        Vec3::splat(if is_bright { 40.0 } else { 1.0 })
    };
    let pixels = (0..size_px[0] * size_px[1]).map(texel).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let text = std::fs::read_to_string(project_file("config/room.toml")).expect("the room");
    let (without_room, _) = text.split_once("\n[[room]]").expect("a room");
    let root = env!("CARGO_MANIFEST_DIR");
    let text = without_room
        .replace("\"recordings/", &format!("\"{root}/recordings/"))
        .replace("\"models/", &format!("\"{root}/models/"));
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, text).expect("a scene");
    let mut scene = Scene::load(&path).expect("a scene without a room");
    scene.shadows.shafts.patches = 2000;
    let probe = scene.probe.as_mut().expect("a probe");
    assert!(probe.is_far);
    let size = size_px.map(|side| side as usize);
    probe.probe = Probe::new(size, pixels).expect("a probe");
    scene.phantoms.retain(|phantom| phantom.name == "table");
    scene.virtuals.retain(|thing| thing.name == "ball");
    let ball_m = DVec3::new(0.0, 0.0, 0.05);
    scene.virtuals[0].anchor_from_object.translation = ball_m;

    let room = scene
        .room(scene.probe.as_ref().expect("a probe"))
        .transport();
    let exposure = scene.probe.as_ref().expect("a probe").exposure;
    // What a table sees of both: the sky, and a disc of a bright one.
    let disc = 39.0 * TAU / 2.0 * 10_f64.to_radians().sin().powi(2) * to_light.z;
    let expected = exposure * (TAU / 2.0 + disc);
    let near = room.patches.vertices.iter().zip(&room.irradiance);
    let near = near.filter(|(vertex, _)| vertex.position.length() < 0.2 && vertex.normal.z > 0.9);
    let near: Vec<f32> = near.map(|(_, irradiance)| irradiance.x).collect();
    assert!(near.len() > 3);
    for irradiance in near {
        let error = (f64::from(irradiance) / expected - 1.0).abs();
        assert!(error < 0.1, "{irradiance}, not {expected}");
    }

    let layers = seen(&mut renderer(&scene)).layers;
    let (frame, poses) = frame();
    let camera_from_world = poses[0].expect("a pose");
    let intrinsics = load_calibration(&project_file("recordings/room/camera.toml"));
    let intrinsics = intrinsics.expect("the calibration");
    let gain_at = |place: DVec3| {
        let place = camera_from_world.transform_point3(place);
        let pixel = intrinsics.focal_px * place.truncate() / place.z + intrinsics.center_px;
        let [x, y] = pixel.to_array().map(|at| at.round() as usize);
        layers.gain[y * frame.size_px[0] as usize + x][1]
    };
    let aside = DVec3::new(0.6 / 0.8 * ball_m.z, 0.0, 0.0);
    let in_shadow = gain_at(-aside);
    let lit = gain_at(aside + DVec3::X * 0.03);
    let left = 1.0 - disc / (TAU / 2.0 + disc);
    assert!(
        f64::from(in_shadow) < left + 0.15 && lit > 0.85,
        "{in_shadow} and {lit}; without the disc {left} is left"
    );
}

#[test]
fn a_virtual_ball_is_darker_under_a_real_desk() {
    let mut scene = coarse_scene();
    scene.virtuals.remove(0);
    let open = seen(&mut renderer(&scene)).virtual_level();
    // The house's walls as a desk over the ball, seen past its edge.
    let desk = &mut scene.phantoms[2];
    assert_eq!(desk.name, "house");
    let to_desk = DAffine3::from_scale(DVec3::new(5.0, 4.0, 0.2));
    desk.anchor_from_object = DAffine3::from_translation(DVec3::new(-0.03, 0.055, 0.05)) * to_desk;
    let covered = seen(&mut renderer(&scene)).virtual_level();
    assert!(covered < 0.8 * open, "{covered} under it, {open} without");
}
