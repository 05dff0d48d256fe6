//! Levels of detail as they are seen: a camera that trembles about the switch between two, and what coarser things do to
//! their shadows on themselves.

use crate::common::{Stage, Thing, lamp, linear_of_level, look_at, shapes};
use glam::{DVec2, DVec3, Vec3};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::render::Renderer;
use gnomon::scene::{Shortcut, Shortcuts};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [320, 240],
    focal_px: DVec2::splat(650.0),
    center_px: DVec2::new(159.5, 119.5),
    distortion: Distortion::NONE,
};
const MIDDLE: DVec3 = DVec3::new(0.0, 0.0, 0.06);
/// So many levels of 255 nobody sees.
const UNSEEN: u8 = 3;
/// Of the light that makes a pixel white.
const LARGEST_LIGHT_OFF: f64 = 0.02;

fn stage(thing: Thing) -> Stage {
    let table = Thing::made(shapes::rectangle([-0.4, -0.4], [0.4, 0.4]));
    let lights = vec![lamp([-0.35, 0.15, 0.6], [0.7; 3])];
    let mut stage = Stage::new(
        &[table],
        &[thing.at(MIDDLE.to_array())],
        None,
        lights,
        DVec3::splat(0.05),
    );
    stage.scene.shadows.samples = 4;
    stage
}

/// From so far away, metres.
fn draw(stage: &Stage, renderer: &mut Renderer, distance_m: f64) -> Vec<u8> {
    let eye = MIDDLE + DVec3::new(0.05, -0.8, 0.6) * distance_m;
    stage.picture(renderer, look_at(eye, MIDDLE)).rgba
}

fn changed(one: &[u8], other: &[u8]) -> usize {
    let differs = |(a, b): &(&u8, &u8)| a.abs_diff(**b) > UNSEEN;
    let pixels = one.chunks(4).zip(other.chunks(4));
    pixels
        .filter(|(one, other)| one.iter().zip(*other).any(|pair| differs(&pair)))
        .count()
}

#[test]
fn a_camera_that_trembles_about_a_switch_sees_no_flicker() {
    let mut stage = stage(Thing::made(shapes::torus(0.05, 0.02, 120, 60)));
    let mut renderer = stage.renderer(CAMERA);
    let triangles_at = |renderer: &mut Renderer, stage: &Stage, distance_m| {
        draw(stage, renderer, distance_m);
        renderer.triangles()
    };
    // Where it becomes coarser on the way back, to a hundredth of a millimetre.
    let finest = triangles_at(&mut renderer, &stage, 0.3);
    let (mut near_m, mut far_m) = (0.3, 12.0);
    assert!(triangles_at(&mut renderer, &stage, far_m) < finest);
    while far_m - near_m > 1e-5 {
        let middle_m = 0.5 * (near_m + far_m);
        // Always from close by, where it is at its finest.
        triangles_at(&mut renderer, &stage, 0.3);
        match triangles_at(&mut renderer, &stage, middle_m) == finest {
            true => near_m = middle_m,
            false => far_m = middle_m,
        }
    }
    let tremble = |stage: &Stage| -> usize {
        let mut renderer = stage.renderer(CAMERA);
        draw(stage, &mut renderer, 0.3);
        let mut before: Option<Vec<u8>> = None;
        let mut most = 0;
        for step in 0..12 {
            // 0.02 px of what is 0.1 m off the middle.
            let off_m = if step % 2 == 0 { 3e-4 } else { -3e-4 } * far_m * far_m;
            let picture = draw(stage, &mut renderer, far_m + off_m);
            // The first switch is one, and stays.
            if let (Some(before), true) = (&before, step > 1) {
                most = most.max(changed(before, &picture));
            }
            before = Some(picture);
        }
        most
    };
    let with_levels = tremble(&stage);
    stage.scene.shadows.without = Shortcuts::NONE.with(Shortcut::Levels, true);
    let exact = tremble(&stage);
    eprintln!("switch at {far_m:.4} m: {with_levels} pixels change, {exact} with exact levels");
    assert!(
        with_levels <= exact + exact / 10 + 2,
        "{with_levels} for {exact}"
    );
}

/// A pixel may have the light of a neighbour, for edges may move by half a pixel; where light grazes they move farther, but
/// there is as much less light to lose.
#[test]
fn shadows_on_the_thing_itself_lose_no_more_light_than_outlines() {
    // A ball of bumps that shade each other.
    let ball = shapes::sphere(0.05, 130, 260);
    let bumps = |at: Vec3| {
        let towards = at.normalize();
        let height = (towards * 23.0).sin();
        at * (1.0 + 0.06 * height.x * height.y + 0.05 * height.z)
    };
    let bumpy = shapes::Soup {
        normals: None,
        ..ball.map(bumps)
    };
    let mut stage = stage(Thing::made(bumpy));
    let mut coarser = stage.renderer(CAMERA);
    stage.scene.shadows.without = Shortcuts::NONE.with(Shortcut::Levels, true);
    let mut exact = stage.renderer(CAMERA);
    let mut were_coarser = 0;
    for distance_m in [0.4, 0.8, 1.0, 1.6, 2.4, 3.0, 4.0, 5.0, 6.0, 8.0] {
        let found = draw(&stage, &mut coarser, distance_m);
        let triangles = coarser.triangles();
        let expected = draw(&stage, &mut exact, distance_m);
        were_coarser += usize::from(triangles < exact.triangles());
        let [width, height] = CAMERA.size_px.map(|side| side as usize);
        let linear = |level: u8| linear_of_level(f64::from(level));
        let off = (0..width * height).map(|index| {
            let (x, y) = (index % width, index / width);
            let (mut low, mut high) = ([u8::MAX; 3], [0; 3]);
            for row in y.saturating_sub(1)..(y + 2).min(height) {
                for column in x.saturating_sub(1)..(x + 2).min(width) {
                    for channel in 0..3 {
                        let value = expected[4 * (row * width + column) + channel];
                        low[channel] = low[channel].min(value);
                        high[channel] = high[channel].max(value);
                    }
                }
            }
            let off = (0..3).map(|channel| {
                let value = linear(found[4 * index + channel]);
                (linear(low[channel]) - value).max(value - linear(high[channel]))
            });
            off.fold(0.0, f64::max)
        });
        let off: Vec<f64> = off.filter(|&off| off > LARGEST_LIGHT_OFF).collect();
        let most = off.iter().copied().fold(0.0, f64::max);
        eprintln!(
            "{distance_m} m: {triangles} triangles, {} pixels off, by {most:.3} at most",
            off.len()
        );
        assert!(off.len() <= 2 && most < 0.05, "at {distance_m} m: {off:?}");
    }
    assert!(
        were_coarser >= 2,
        "coarser in {were_coarser} pictures alone"
    );
}
