//! The composite, as users get it, in random scenes and in those where it was once wrong: every pixel against rays in
//! double precision.

mod common;

use common::composite::{Expected, Verdict};
use common::degenerate::{corners_of, degenerate_camera, degenerate_case};
use common::random::{Random, random_camera, random_stage};
use common::{Picture, Stage, frame_of, gpu};
use glam::{DAffine3, DVec3};
use gnomon::app::truth::ray_cast::View;
use gnomon::render::Renderer;
use gnomon::scene::{Shortcut, Shortcuts};

const CAMERAS: usize = 2;

/// What a failure is told with.
fn described(stage: &Stage, view: &View) -> String {
    let mut text = String::new();
    let card = stage.world_from_card.unwrap_or_default();
    let real = stage
        .phantoms
        .iter()
        .map(|thing| ("real", thing, DAffine3::IDENTITY));
    let seeming = stage.virtuals.iter().map(|thing| ("virtual", thing, card));
    for (kind, thing, world_from_anchor) in real.chain(seeming) {
        let corners: Vec<DVec3> = corners_of(thing)
            .iter()
            .flatten()
            .map(|corner| world_from_anchor.transform_point3(*corner))
            .collect();
        let low = corners.iter().copied().fold(DVec3::MAX, DVec3::min);
        let high = corners.iter().copied().fold(DVec3::MIN, DVec3::max);
        text += &format!(
            "    {kind}: {} triangles from {low:.4} to {high:.4}{}{}\n",
            corners.len() / 3,
            if thing.casts { "" } else { ", casts nothing" },
            if thing.visible { "" } else { ", hidden" },
        );
    }
    for light in &stage.scene.lights {
        text += &format!("    {light:?}\n");
    }
    let eye = view.camera_from_world.inverse();
    text += &format!(
        "    from {:.4} towards {:.4}, on the card {:?}\n",
        eye.translation,
        eye.matrix3.z_axis,
        stage.world_from_card.map(|card| card.translation)
    );
    text
}

/// Draws a stage over white and over noise, and holds both; the same again without shortcuts, and the layers.
fn judge(stage: &Stage, renderer: &mut Renderer, view: View) -> Verdict {
    let mut random = Random::new(99);
    let noise = frame_of(view.intrinsics.size_px, |_| random.below(256) as u8);
    renderer.upload(&noise).expect("an uploaded frame");
    let noisy = stage.picture(renderer, view.camera_from_world);
    let white = frame_of(view.intrinsics.size_px, |_| 255);
    renderer.upload(&white).expect("an uploaded frame");
    let picture: Picture = stage.picture(renderer, view.camera_from_world);
    let expected = Expected::new(stage, view);
    let mut verdict = expected.judge(&picture, Some((&noisy, &noise.rgba)));

    let layers = renderer.layers().expect("layers");
    let (disagreements, first) = expected.disagreements(&picture, &layers);
    if disagreements > 0 {
        verdict.wrong += disagreements;
        verdict.first.push(format!(
            "layers: {disagreements} pixels: {}",
            first.unwrap_or_default()
        ));
    }
    let plain = without_shortcuts(stage, view);
    let differing = differing(&picture, &plain);
    if differing > 0 {
        verdict.wrong += differing;
        verdict.first.push(format!(
            "{differing} pixels differ from the picture without shortcuts"
        ));
    }
    verdict
}

/// With the same levels of detail, for these are meant to show in the last digits.
fn without_shortcuts(stage: &Stage, view: View) -> Picture {
    let mut scene = stage.scene.clone();
    scene.shadows.without = Shortcuts::ALL.with(Shortcut::Levels, false);
    let mut renderer = Renderer::new(gpu(), &scene, view.intrinsics).expect("a renderer");
    let white = frame_of(view.intrinsics.size_px, |_| 255);
    renderer.upload(&white).expect("an uploaded frame");
    stage.picture(&mut renderer, view.camera_from_world)
}

fn differing(one: &Picture, other: &Picture) -> usize {
    let pairs = one.rgba.chunks(4).zip(other.rgba.chunks(4));
    pairs.filter(|(one, other)| one != other).count()
}

fn seeds(count: u64) -> std::ops::Range<u64> {
    let only: Option<u64> = std::env::var("GNOMON_SEED")
        .ok()
        .and_then(|seed| seed.parse().ok());
    only.map_or(0..count, |seed| seed..seed + 1)
}

/// Of a run of many pictures.
#[derive(Default)]
struct Run {
    sum: Verdict,
    pictures: usize,
    failures: Vec<String>,
}

impl Run {
    fn add(&mut self, name: impl Fn() -> String, stage: &Stage, view: &View, verdict: &Verdict) {
        self.pictures += 1;
        if verdict.wrong > 0 {
            let first: Vec<&str> = verdict.first.iter().take(3).map(String::as_str).collect();
            self.failures.push(format!(
                "{}: {} wrong of {} changed\n{}    {}",
                name(),
                verdict.wrong,
                verdict.changed,
                described(stage, view),
                first.join("\n    ")
            ));
        }
        self.sum.join(verdict);
    }

    fn end(self) {
        eprintln!("{} pictures: {}", self.pictures, self.sum.summary());
        assert!(
            self.failures.is_empty(),
            "{} of {} pictures (run a scene by GNOMON_SEED=n):\n{}",
            self.failures.len(),
            self.pictures,
            self.failures.join("\n")
        );
    }
}

fn hold_random(count: u64) {
    let mut run = Run::default();
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
            let samples = stage.scene.shadows.samples;
            run.add(
                || format!("seed {seed}, camera {camera}, {samples} samples"),
                &stage,
                &view,
                &verdict,
            );
        }
    }
    run.end();
}

fn hold_degenerate(count: u64) {
    let mut run = Run::default();
    for seed in seeds(count) {
        let mut random = Random::new(77_000_000 + seed);
        let mut case = degenerate_case(&mut random);
        if let Ok(n) = std::env::var("GNOMON_SAMPLES") {
            case.stage.scene.shadows.samples = n.parse().unwrap();
        }
        if let Ok(n) = std::env::var("GNOMON_WITHOUT") {
            use gnomon::scene::{Shortcut, Shortcuts};
            case.stage.scene.shadows.without = if n == "all" {
                Shortcuts::ALL
            } else {
                Shortcut::BY_NAME
                    .iter()
                    .filter(|(name, _)| *name == n)
                    .map(|(_, s)| *s)
                    .collect()
            };
        }
        let mut renderer = case.stage.renderer(case.intrinsics);
        for camera in 0..CAMERAS {
            let (camera_from_world, from) = degenerate_camera(&mut random, &case);
            let view = View {
                intrinsics: case.intrinsics,
                camera_from_world,
            };
            let verdict = judge(&case.stage, &mut renderer, view);
            let samples = case.stage.scene.shadows.samples;
            let name = &case.name;
            run.add(
                || format!("seed {seed}, camera {camera} ({from}), {samples} samples: {name}"),
                &case.stage,
                &view,
                &verdict,
            );
        }
    }
    run.end();
}

fn scenes(count: u64) -> u64 {
    let wanted = std::env::var("GNOMON_SCENES").ok();
    wanted.and_then(|count| count.parse().ok()).unwrap_or(count)
}

#[test]
fn random_scenes() {
    hold_random(scenes(200));
}

#[test]
fn degenerate_scenes() {
    hold_degenerate(scenes(100));
}
