//! Ways to one picture: depth-pass is taken where it gives what depth-fail gives, bit for bit, and one light and one sample
//! are shaded straight into the picture as they would be by way of sums.

use crate::common::random::{Random, random_camera, random_stage};
use crate::common::{
    Picture, Stage, Thing, lamp, look_at, project_file, shapes, stability_row, sun,
};
use glam::{DAffine3, DVec2, DVec3, Vec3};
use gnomon::geometry::camera::Intrinsics;
use gnomon::light::Light;
use gnomon::scene::VolumeCounting;

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(325.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: [0.0; 5],
};

/// Holds what both ways draw against each other, camera by camera.
fn hold(name: &str, stage: &mut Stage, intrinsics: Intrinsics, cameras: &[DAffine3]) {
    let mut shoot = |counting: VolumeCounting| -> Vec<_> {
        stage.scene.shadows.counting = counting;
        let mut renderer = stage.renderer(intrinsics);
        let shot = |camera: &DAffine3| stage.shoot(&mut renderer, *camera);
        cameras.iter().map(shot).collect()
    };
    let (chosen, depth_fail) = (
        shoot(VolumeCounting::Auto),
        shoot(VolumeCounting::DepthFail),
    );
    for (camera, (ours, theirs)) in chosen.iter().zip(&depth_fail).enumerate() {
        let differing = |of: usize, a: &[u8], b: &[u8]| {
            let pairs = a.chunks(of).zip(b.chunks(of));
            pairs.filter(|(one, other)| one != other).count()
        };
        let picture = differing(4, &ours.0.rgba, &theirs.0.rgba);
        assert_eq!(picture, 0, "{name}, camera {camera}: pixels of the picture");
        let lights = ours.1.shadow.iter().zip(&theirs.1.shadow);
        for (light, (one, other)) in lights.enumerate() {
            let bits = differing(1, one, other);
            assert_eq!(bits, 0, "{name}, camera {camera}: bits of light {light}");
        }
        assert!(ours.1 == theirs.1, "{name}, camera {camera}: layers");
    }
}

#[test]
fn random_scenes_look_the_same_counted_either_way() {
    for seed in 0..80 {
        let mut random = Random::new(1000 + seed);
        let (mut stage, places, intrinsics) = random_stage(&mut random, seed % 2 == 0);
        let lights = stage.scene.world_lights();
        let cameras: Vec<DAffine3> = (0..6)
            .map(|_| random_camera(&mut random, &places, &lights))
            .collect();
        hold(&format!("seed {seed}"), &mut stage, intrinsics, &cameras);
    }
}

/// From all around, through the volume's sides and out again.
#[test]
fn a_flight_through_a_shadow_looks_the_same_counted_either_way() {
    let row = stability_row(&project_file("tests/stability"), "base");
    let mut stage = row.stage;
    let cameras: Vec<DAffine3> = (0..24)
        .map(|step| {
            let turn = DVec2::from_angle(0.3 * f64::from(step));
            let radius_m = 0.08 + 0.02 * f64::from(step);
            let eye = DVec3::new(0.12, -0.05, 0.03) + (turn * radius_m).extend(0.0);
            look_at(eye, DVec3::new(0.06, -0.02, 0.03))
        })
        .collect();
    hold("base", &mut stage, row.view.intrinsics, &cameras);
}

/// Of a ball with holes depth-pass needs the inside only where it shows through them, depth-fail all of it.
#[test]
fn what_shows_through_holes_looks_the_same_counted_either_way() {
    let whole = shapes::sphere(0.03, 16, 24);
    let middle = |index: usize| {
        let corners = whole.triangles[index].map(|corner| whole.positions[corner as usize]);
        corners.iter().sum::<Vec3>().normalize()
    };
    let holes = [Vec3::new(0.6, 0.0, 0.8), Vec3::new(-0.53, -0.8, 0.28)];
    let is_hole = |index: usize| holes.iter().any(|hole| hole.dot(middle(index)) > 0.85);
    let ball = || Thing::made(whole.clone().without(is_hole)).at([0.0, 0.0, 0.05]);
    let crate_ = || Thing::made(shapes::cuboid([-0.02; 3], [0.02; 3])).at([0.07, -0.02, 0.02]);
    let table = || Thing::file("plane.obj");
    let cameras: Vec<DAffine3> = (0..18)
        .map(|step| {
            let turn = DVec2::from_angle(0.35 * f64::from(step));
            let eye = (turn * 0.3).extend(0.05 + 0.02 * f64::from(step % 9));
            look_at(eye, DVec3::new(0.02, 0.0, 0.03))
        })
        .collect();
    for (name, phantoms, virtuals) in [
        ("virtual", vec![table()], vec![ball(), crate_()]),
        ("real", vec![table(), ball()], vec![crate_()]),
    ] {
        let lights = vec![lamp([-0.25, 0.1, 0.5], [0.9; 3])];
        let card = Some(DAffine3::IDENTITY);
        let mut stage = Stage::new(&phantoms, &virtuals, card, lights, DVec3::splat(0.1));
        for samples in [1, 4] {
            stage.scene.shadows.samples = samples;
            let name = format!("{name}, {samples} samples");
            hold(&name, &mut stage, CAMERA, &cameras);
        }
    }
}

/// A second light that gives nothing makes the renderer add up.
#[test]
fn one_light_and_one_sample_need_no_sums() {
    for seed in 0..12 {
        let mut random = Random::new(500 + seed);
        let (mut stage, places, intrinsics) = random_stage(&mut random, seed % 2 == 0);
        let light = stage.scene.lights[0].light;
        let camera = random_camera(&mut random, &places, &[light]);
        let mut shoot = |lights: Vec<Light>| {
            stage.scene.shadows.samples = 1;
            stage.scene.lights = lights.into_iter().map(Into::into).collect();
            let mut renderer = stage.renderer(intrinsics);
            stage.shoot(&mut renderer, camera)
        };
        let (direct, layers) = shoot(vec![light]);
        let (summed, with_dark) = shoot(vec![light, sun([0.3, 0.2, -1.0], [0.0; 3])]);
        assert!(layers.role == with_dark.role);
        // Each pass makes its own gain of the same numbers.
        let gains = layers.gain.iter().zip(&with_dark.gain);
        let apart = gains.map(|(one, other)| (one[0] - other[0]).abs());
        let apart = apart.fold(0.0, f32::max);
        assert!(apart <= 4.0 * f32::EPSILON, "seed {seed}: {apart} apart");
        let colors = |picture: &Picture| -> Vec<[u8; 3]> {
            let pixels = 0..picture.rgba.len() / 4;
            pixels.map(|index| picture.pixel(index)).collect()
        };
        assert!(
            colors(&direct) == colors(&summed),
            "seed {seed}: the pictures differ"
        );
    }
}

/// What a frame is drawn by can be asked for.
#[test]
fn the_passes_of_a_frame_are_told() {
    let table = Thing::file("plane.obj");
    let crate_ = Thing::made(shapes::cuboid([-0.02; 3], [0.02; 3])).at([0.0, 0.0, 0.02]);
    let lights = vec![
        lamp([-0.25, 0.1, 0.5], [0.9; 3]),
        sun([0.3, 0.2, -1.0], [0.5; 3]),
    ];
    let mut stage = Stage::new(&[table], &[crate_], None, lights, DVec3::splat(0.1));
    let passes = |stage: &Stage| -> Vec<&'static str> {
        let mut renderer = stage.renderer(CAMERA);
        let camera = look_at(DVec3::new(0.2, -0.25, 0.3), DVec3::ZERO);
        stage.shoot(&mut renderer, camera);
        renderer.passes().to_vec()
    };
    stage.scene.shadows.samples = 4;
    assert_eq!(
        passes(&stage),
        ["background", "light", "light", "composite"]
    );
    stage.scene.shadows.samples = 1;
    stage.scene.lights.truncate(1);
    assert_eq!(passes(&stage), ["background", "surfaces", "shadows"]);
}
