//! The composite, as users get it, in random scenes and in those where it was once wrong: every pixel against rays in
//! double precision.

mod common;

use common::composite::{Expected, Verdict};
use common::random::{Random, random_camera, random_stage};
use common::{Picture, Stage, frame_of};
use gnomon::app::truth::ray_cast::View;
use gnomon::render::Renderer;

const CAMERAS: usize = 2;

/// Draws a stage over white and over noise, and holds both.
fn judge(stage: &Stage, renderer: &mut Renderer, view: View) -> Verdict {
    let size_px = view.intrinsics.size_px;
    let mut random = Random::new(99);
    let noise = frame_of(size_px, |_| random.below(256) as u8);
    renderer.upload(&noise).expect("an uploaded frame");
    let noisy = stage.picture(renderer, view.camera_from_world);
    let white = frame_of(size_px, |_| 255);
    renderer.upload(&white).expect("an uploaded frame");
    let picture: Picture = stage.picture(renderer, view.camera_from_world);
    Expected::new(stage, view).judge(&picture, Some((&noisy, &noise.rgba)))
}

fn seeds(count: u64) -> std::ops::Range<u64> {
    let only: Option<u64> = std::env::var("GNOMON_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok());
    only.map_or(0..count, |seed| seed..seed + 1)
}

#[test]
fn random_scenes() {
    let count =
        std::env::var("GNOMON_SCENES").map_or(100, |count| count.parse().expect("a number"));
    let mut sum = Verdict::default();
    let mut failures = Vec::new();
    for seed in seeds(count) {
        let mut random = Random::new(seed);
        let (stage, places, intrinsics) = random_stage(&mut random, seed % 2 == 1);
        let mut renderer = stage.renderer(intrinsics);
        for camera in 0..CAMERAS {
            let view = View {
                intrinsics,
                camera_from_world: random_camera(&mut random, &places, &stage.scene.lights),
            };
            let verdict = judge(&stage, &mut renderer, view);
            if verdict.wrong > 0 {
                failures.push(format!(
                    "seed {seed}, camera {camera}, {} samples, {} lights: {} wrong\n    {}",
                    stage.scene.shadows.samples,
                    stage.scene.lights.len(),
                    verdict.wrong,
                    verdict
                        .first
                        .iter()
                        .take(3)
                        .cloned()
                        .collect::<Vec<_>>()
                        .join("\n    ")
                ));
            }
            sum.join(&verdict);
        }
    }
    eprintln!("{}", sum.summary());
    assert!(
        failures.is_empty(),
        "{} pictures:\n{}",
        failures.len(),
        failures.join("\n")
    );
}
