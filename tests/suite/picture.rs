//! The composite, as users get it, in random scenes and in those where it was once wrong: every pixel against rays in
//! double precision.

use std::path::PathBuf;

use crate::common::composite::{Differences, Expected, State, Verdict};
use crate::common::degenerate::{Case, corners_of, degenerate_camera, degenerate_case};
use crate::common::random::{Random, random_camera, random_stage};
use crate::common::{
    Picture, Shape, Stage, Thing, frame_of, lamp, look_at, project_file, read_obj, shapes,
};
use glam::{DAffine3, DQuat, DVec2, DVec3};
use gnomon::app::truth::TruePoses;
use gnomon::app::truth::ray_cast::{View, pixels};
use gnomon::capture::load_calibration;
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::Light;
use gnomon::render::{REAL, Renderer, Shown};
use gnomon::scene::{Quality, Scene, ShadowSettings, Shortcut, Shortcuts};

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

/// Within so many pixels of an edge the picture may depend on shortcuts. Corners are snapped to 1/256 px.
const SNAPS_PX: f64 = 0.01;

/// Draws a stage over white and over noise, and holds both; the same again without shortcuts, and the layers.
fn judge(stage: &Stage, renderer: &mut Renderer, view: View) -> Verdict {
    let mut random = Random::new(99);
    let noise = frame_of(view.intrinsics.size_px, |_| random.below(256) as u8);
    renderer.upload(&noise).expect("an uploaded frame");
    let noisy = stage.picture(renderer, view.camera_from_world);
    let mut video = noise.rgba;
    if view.intrinsics.distortion.distorts() {
        renderer.draw(&stage.poses(view.camera_from_world), Shown::Bare);
        video = renderer.read_picture().expect("the video");
    }
    let white = frame_of(view.intrinsics.size_px, |_| 255);
    renderer.upload(&white).expect("an uploaded frame");
    let picture: Picture = stage.picture(renderer, view.camera_from_world);
    let expected = Expected::new(stage, view);
    let mut verdict = expected.judge(&picture, Some((&noisy, &video)));

    let layers = renderer.layers().expect("layers");
    let (disagreements, first) = expected.disagreements(&picture, &layers);
    if disagreements > 0 {
        verdict.wrong += disagreements;
        verdict.first.push(format!(
            "layers: {disagreements} pixels: {}",
            first.unwrap_or_default()
        ));
    }
    // Scissors, depth-pass and what is kept leave the picture as it is, bit for bit. The direct path may round a sum to the
    // other side of half a level. Where a volume ends moves what lies within the
    // snapping of an edge. Without `insides` the plain picture may show an inside along a rim, through the crack that rounding
    // leaves: that is the plain picture's fault, and it stays beside an edge; the one with all shortcuts must be right.
    let exact: Shortcuts = [Shortcut::Scissors, Shortcut::DepthPass, Shortcut::Kept]
        .into_iter()
        .collect();
    let direct = exact.with(Shortcut::Direct, true);
    let beside_edges = [
        (exact, 0, None),
        (direct, 1, None),
        (direct.with(Shortcut::Ends, true), 1, Some(SNAPS_PX)),
        (Shortcuts::ALL.with(Shortcut::Levels, false), 1, Some(1.0)),
    ];
    for (shortcuts, levels, plain_within_px) in beside_edges {
        let plain = without(shortcuts, stage, view);
        let snaps = |index: usize| {
            let is_explained = |picture, within_px| {
                let radius_px = expected.explained_within(index, picture);
                radius_px.is_some_and(|radius_px| radius_px <= within_px)
            };
            plain_within_px.is_some_and(|within_px| {
                is_explained(&picture, SNAPS_PX) && is_explained(&plain, within_px)
            })
        };
        let apart = |index: usize| {
            let pairs = picture.pixel(index).into_iter().zip(plain.pixel(index));
            pairs.map(|(one, other)| one.abs_diff(other)).max()
        };
        let differing = (0..picture.rgba.len() / 4).filter(|&index| apart(index) > Some(levels));
        let wrong = differing.filter(|&index| !snaps(index)).count();
        if wrong > 0 {
            verdict.wrong += wrong;
            verdict
                .first
                .push(told_apart(&picture, &plain, stage, view));
        }
    }
    verdict
}

/// The first pixel in which a picture differs from the one without shortcuts, and which of these alone change it.
fn told_apart(picture: &Picture, plain: &Picture, stage: &Stage, view: View) -> String {
    let pixels = 0..picture.rgba.len() / 4;
    let differs = |index: &usize| picture.pixel(*index) != plain.pixel(*index);
    let count = pixels.clone().filter(differs).count();
    let first = pixels.clone().find(differs).unwrap_or(0);
    let culprits = Shortcut::BY_NAME.iter().filter(|(_, shortcut)| {
        let other = without(std::iter::once(*shortcut).collect(), stage, view);
        other.pixel(first) != picture.pixel(first)
    });
    let culprits: Vec<&str> = culprits.map(|(name, _)| *name).collect();
    let width = view.intrinsics.size_px[0] as usize;
    format!(
        "{count} pixels differ from the picture without shortcuts, first [{}, {}]: {:?} for {:?} ({})",
        first % width,
        first / width,
        picture.pixel(first),
        plain.pixel(first),
        culprits.join(", ")
    )
}

/// The picture without some shortcuts. Levels of detail are not meant to draw the very same.
fn without(shortcuts: Shortcuts, stage: &Stage, view: View) -> Picture {
    let shadows = ShadowSettings {
        without: shortcuts,
        ..stage.scene.shadows
    };
    let mut renderer = stage.renderer_of(shadows, view.intrinsics);
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

/// Whoever looks for a wrong pixel draws it with other samples (`GNOMON_SAMPLES=1`) and without some shortcut or `all` of
/// them (`GNOMON_WITHOUT=scissors`).
fn as_asked(stage: &mut Stage) {
    let shadows = &mut stage.scene.shadows;
    if let Ok(samples) = std::env::var("GNOMON_SAMPLES") {
        shadows.samples = samples.parse().expect("1 or 4");
    }
    if let Ok(without) = std::env::var("GNOMON_WITHOUT") {
        let named = Shortcut::BY_NAME
            .iter()
            .filter(|(name, _)| *name == without);
        shadows.without = match without.as_str() {
            "all" => Shortcuts::ALL,
            _ => named.map(|(_, shortcut)| *shortcut).collect(),
        };
    }
}

fn hold_random(count: u64) {
    let mut run = Run::default();
    for seed in seeds(count) {
        let mut random = Random::new(seed);
        let (mut stage, places, intrinsics) = random_stage(&mut random, seed % 2 == 1);
        as_asked(&mut stage);
        let mut renderer = stage.renderer(intrinsics);
        for camera in 0..CAMERAS {
            let view = View {
                intrinsics,
                camera_from_world: random_camera(&mut random, &places, &stage.scene.world_lights()),
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
        as_asked(&mut case.stage);
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

#[test]
#[ignore = "a quarter of an hour; cargo test --release --test suite picture -- --ignored"]
fn thousands_of_random_scenes() {
    hold_random(scenes(3_300));
}

#[test]
#[ignore = "a quarter of an hour; cargo test --release --test suite picture -- --ignored"]
fn thousands_of_degenerate_scenes() {
    hold_degenerate(scenes(1_700));
}

// What was wrong in the picture once, though the layers were right.

fn table() -> Thing {
    Thing::file("plane.obj")
}

fn crate_() -> Thing {
    Thing::file("box.obj").at([-0.1, 0.02, 0.0])
}

/// A card of 10 x 8 cm in the plane z = 0.
fn sheet() -> Thing {
    Thing::made(shapes::rectangle([-0.05, -0.04], [0.05, 0.04])).faceted()
}

/// As a poses file has it: translation and rotation vector.
fn pose(translation: [f64; 3], rotation: [f64; 3]) -> DAffine3 {
    let turn = DQuat::from_scaled_axis(DVec3::from_array(rotation));
    DAffine3::from_rotation_translation(turn, DVec3::from_array(translation))
}

fn desk_pose() -> DAffine3 {
    pose(
        [0.0, 0.026_098_466_788_990_57, 0.683_972_857_671_460_5],
        [
            2.084_987_641_109_178,
            0.089_703_804_092_166_91,
            -0.052_264_105_367_304_91,
        ],
    )
}

const DESK: Intrinsics = Intrinsics {
    size_px: [640, 480],
    focal_px: DVec2::splat(650.0),
    center_px: DVec2::new(319.5, 239.5),
    distortion: Distortion::NONE,
};

/// Holds a scene of the world's anchor with one and four samples.
fn hold(name: &str, mut stage: Stage, view: View, least_changed: usize) {
    for samples in [1, 4] {
        stage.scene.shadows.samples = samples;
        let mut renderer = stage.renderer(view.intrinsics);
        let verdict = judge(&stage, &mut renderer, view);
        eprintln!("{name}, {samples} samples: {}", verdict.summary());
        assert!(
            verdict.wrong == 0 && verdict.changed >= least_changed,
            "{name}, {samples} samples: {} pixels are wrong of {} that virtual things change\n{}",
            verdict.wrong,
            verdict.changed,
            verdict.first.join("\n")
        );
    }
}

fn hold_on_desk(name: &str, phantoms: &[Thing], virtuals: &[Thing], light: Light) {
    let view = View {
        intrinsics: DESK,
        camera_from_world: desk_pose(),
    };
    let stage = Stage::new(phantoms, virtuals, None, vec![light], DVec3::splat(0.05));
    hold(name, stage, view, 3000);
}

fn desk_lamp() -> Light {
    lamp([-0.35, 0.15, 0.6], [0.7; 3])
}

#[test]
fn flat_card_that_is_the_highest_thing() {
    let card = sheet().at([0.06, -0.02, 0.06]);
    hold_on_desk("flat card", &[table()], &[card], desk_lamp());
}

#[test]
fn upright_card_at_the_side_of_the_table() {
    let upright = DAffine3::from_rotation_translation(
        DQuat::from_rotation_y(90_f64.to_radians()),
        DVec3::new(-0.45, 0.0, 0.06),
    );
    let stage = Stage::new(
        &[table()],
        &[sheet().placed(upright)],
        None,
        vec![lamp([-0.8, 0.05, 0.2], [0.7; 3])],
        DVec3::splat(0.05),
    );
    let camera_from_world = pose(
        [
            0.193_793_623_025_499_7,
            0.051_602_344_171_378_54,
            1.165_453_229_327_830_6,
        ],
        [
            2.114_836_384_979_67,
            0.265_498_156_376_161_64,
            -0.147_413_121_339_117_6,
        ],
    );
    let view = View {
        intrinsics: DESK,
        camera_from_world,
    };
    hold("upright card", stage, view, 3000);
}

#[test]
fn flat_phantom_above_a_virtual_torus() {
    let ring = Thing::made(shapes::torus(0.05, 0.02, 50, 25)).at([0.02, -0.02, 0.04]);
    let cover = sheet().at([0.0, 0.0, 0.1]);
    hold_on_desk("covered torus", &[table(), cover], &[ring], desk_lamp());
}

#[test]
fn light_on_a_vertex_of_a_closed_caster() {
    let block = Thing::made(shapes::cuboid([-0.03; 3], [0.03; 3])).at([0.06, -0.02, 0.06]);
    for (name, place) in [
        ("vertex", [0.09, 0.01, 0.09]),
        ("edge", [0.07, 0.01, 0.09]),
        ("face", [0.07, -0.01, 0.09]),
    ] {
        let block = block.clone().faceted();
        let light = lamp(place, [0.05; 3]);
        hold_on_desk(name, &[table(), crate_()], &[block], light);
    }
}

#[test]
fn virtual_sheet_at_the_table_s_own_height() {
    let sheet = sheet().at([0.06, -0.02, 0.0]);
    hold_on_desk(
        "sheet on table",
        &[table(), crate_()],
        &[sheet],
        desk_lamp(),
    );
}

/// A lamp so close above both that what is moved by some micrometres throws a shadow.
#[test]
fn light_grazing_a_virtual_card_beside_a_real_one() {
    let card = || Thing::made(shapes::rectangle([-0.04, -0.06], [0.04, 0.06])).faceted();
    let world_from_card = DAffine3::from_translation(DVec3::new(0.1, 0.02, 0.0));
    let stage = Stage::new(
        &[table().without_shadow(), card().at([0.03, -0.08, 0.04])],
        &[card().at([-0.15, -0.1, 0.04])],
        Some(world_from_card),
        vec![lamp([-0.036_666_666, -0.1, 0.040_1], [0.02; 3])],
        DVec3::splat(0.05),
    );
    let view = View {
        intrinsics: Intrinsics {
            size_px: [144, 108],
            focal_px: DVec2::splat(160.0),
            center_px: DVec2::new(71.5, 53.5),
            distortion: Distortion::NONE,
        },
        camera_from_world: look_at(DVec3::new(0.02, -0.33, 0.34), DVec3::new(0.0, -0.07, 0.04)),
    };
    hold("cards edge to edge", stage, view, 500);
}

/// Triangles that lie on one another, folded: no place gets the light twice.
#[test]
fn virtual_sheet_folded_on_to_itself() {
    let corners = [[-0.05, -0.04], [0.06, -0.03], [0.0, 0.05], [0.03, 0.05]];
    let positions = corners.map(|[x, y]: [f32; 2]| glam::Vec3::new(x, y, 0.0));
    let folded = shapes::Soup::new(positions.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    for tilt in [0.0, 0.3, 0.7] {
        let turned = DAffine3::from_rotation_translation(
            DQuat::from_rotation_x(tilt),
            DVec3::new(0.03, 0.02, 0.08),
        );
        let sheet = Thing::made(folded.clone()).placed(turned).faceted();
        hold_on_desk("folded", &[table()], &[sheet], desk_lamp());
    }
}

/// The scene that ships, with a card in the torus's place.
#[test]
fn flat_card_above_the_lamp_s_table() {
    let file = project_file("config/lamp.toml");
    let text = std::fs::read_to_string(&file).expect("the scene of the demo");
    let folder = tempfile::tempdir().expect("a folder");
    let card = folder.path().join("card.obj");
    let mesh = shapes::rectangle([-0.04, -0.03], [0.04, 0.03]);
    std::fs::write(&card, mesh.to_obj()).expect("a mesh");
    let (before, torus) = text.split_once("[[virtual]]").expect("the torus");
    let (_, after) = torus.split_once("[[light]]").expect("the lamp");
    let text = format!(
        "{before}[[virtual]]\nname = \"card\"\nmesh = \"{}\"\nposition_m = [0.02, 0.0, 0.12]\n\n[[light]]{after}",
        card.display()
    );
    let mut scene = Scene::parse(&file, &text).expect("the scene with a card");
    // (Held against rays to the lamp alone.)
    scene.shadows.ambient_samples = 0;
    let recording = project_file("recordings/lamp");
    let intrinsics = load_calibration(&recording.join("camera.toml")).expect("the calibration");
    let poses = TruePoses::read(&recording).expect("true poses");
    for frame in [25, 75] {
        let camera = poses
            .camera_from_anchors(frame, &scene.anchors)
            .expect("a pose");
        let view = View {
            intrinsics,
            camera_from_world: camera[0],
        };
        hold(
            "lamp with a card",
            Stage::of_scene(scene.clone()),
            view,
            3000,
        );
    }
}

// One renderer for a scene that changes.

/// Moves, hides, shows, and shines otherwise, as an editor would; draws after each change what a new renderer would.
fn hold_sequence(random: &mut Random, case: &mut Case, run: &mut Run, seed: u64) {
    const STEPS: usize = 5;
    let mut renderer = case.stage.renderer(case.intrinsics);
    let (mut camera_from_world, _) = degenerate_camera(random, case);
    for step in 0..STEPS {
        let what = match random.below(5) {
            0 => {
                (camera_from_world, _) = degenerate_camera(random, case);
                "another camera"
            }
            1 => {
                let count = case.stage.virtuals.len();
                let thing = &mut case.stage.virtuals[random.below(count)];
                thing.visible = !thing.visible;
                "a virtual thing shown or hidden"
            }
            2 => {
                let count = case.stage.phantoms.len();
                let thing = &mut case.stage.phantoms[random.below(count)];
                thing.visible = !thing.visible;
                "a real thing shown or hidden"
            }
            3 => {
                let by = DVec3::new(0.01, -0.02, 0.01) * f64::from(random.below(3) as u32);
                let count = case.stage.virtuals.len();
                let thing = &mut case.stage.virtuals[random.below(count)];
                thing.anchor_from_thing.translation += by;
                "a virtual thing moved"
            }
            _ => {
                let count = case.stage.scene.lights.len();
                case.stage.scene.lights[random.below(count)] = random_lamp(random).into();
                "a light moved"
            }
        };
        case.stage.place();
        let view = View {
            intrinsics: case.intrinsics,
            camera_from_world,
        };
        assert!(
            renderer.follow(&case.stage.scene),
            "seed {seed}: the renderer does not follow"
        );
        let white = frame_of(case.intrinsics.size_px, |_| 255);
        renderer.upload(&white).expect("an uploaded frame");
        let kept = case.stage.picture(&mut renderer, camera_from_world);
        // Standing still takes what was kept.
        let again = case.stage.picture(&mut renderer, camera_from_world);
        let mut anew = case.stage.renderer(case.intrinsics);
        let anew = case.stage.picture(&mut anew, camera_from_world);
        let mut verdict = match step + 1 {
            STEPS => Expected::new(&case.stage, view).judge(&kept, None),
            _ => Verdict::default(),
        };
        for (other, name) in [(&again, "drawn again"), (&anew, "of a new renderer")] {
            let differing = differing(&kept, other);
            if differing > 0 {
                verdict.wrong += differing;
                let text = format!("{differing} pixels differ from the picture {name}");
                verdict.first.push(text);
            }
        }
        let name = &case.name;
        let name = || format!("seed {seed}, step {step} ({what}): {name}");
        run.add(name, &case.stage, &view, &verdict);
    }
}

fn random_lamp(random: &mut Random) -> Light {
    let place = |random: &mut Random| random.vector_wide() * DVec3::new(0.5, 0.5, 0.2);
    let above = place(random) + DVec3::Z * 0.35;
    let rounded = (above * 100.0).round() / 100.0;
    lamp(rounded.to_array(), [0.3; 3])
}

fn hold_sequences(seeds: std::ops::Range<u64>) {
    let mut run = Run::default();
    for seed in seeds {
        let mut random = Random::new(99_000_000 + seed);
        // What surroundings throw back is not gathered anew.
        let case = (0..).map(|_| degenerate_case(&mut random));
        let mut on_card = case.filter(|case| case.stage.world_from_card.is_some());
        let mut case = on_card.next().expect("a case");
        drop(on_card);
        hold_sequence(&mut random, &mut case, &mut run, seed);
    }
    run.end();
}

#[test]
fn a_renderer_that_follows_draws_what_a_new_one_does() {
    hold_sequences(seeds(scenes(30)));
}

// Real meshes.

#[test]
fn meshes_of_thousands_of_triangles_have_no_stray_pixels() {
    let own = ["tests/stability/torus2500.obj", "models/house.obj"];
    hold_meshes(&own.map(project_file));
}

/// These come from public collections and are not the project's to ship.
#[test]
#[cfg_attr(not(has_shared), ignore = "needs ../shared/models")]
fn famous_meshes_have_no_stray_pixels() {
    let names = [
        "nefertiti_10000",
        "stanford-bunny_2500",
        "suzanne",
        "spot",
        "teapot",
        "venus",
    ];
    hold_meshes(&names.map(|name| project_file(&format!("../shared/models/{name}.obj"))));
}

/// No pixel is something that nothing in it explains, black for example.
fn hold_meshes(paths: &[PathBuf]) {
    let intrinsics = Intrinsics {
        size_px: [320, 240],
        focal_px: DVec2::splat(330.0),
        center_px: DVec2::new(159.5, 119.5),
        distortion: Distortion::NONE,
    };
    let mut run = Run::default();
    for path in paths {
        let mesh = read_obj(path);
        let places = || mesh.positions.iter().map(|place| place.as_dvec3());
        let low = places().fold(DVec3::MAX, DVec3::min);
        let high = places().fold(DVec3::MIN, DVec3::max);
        let scale = 0.12 / (high - low).max_element();
        let middle = DVec3::new(0.02, -0.01, 0.08) - (low + high) * 0.5 * scale;
        let thing = Thing::new(Shape::File(path.clone()))
            .scaled(DVec3::splat(scale))
            .at(middle.to_array());
        let block = Thing::made(shapes::cuboid([-0.02; 3], [0.02; 3]))
            .at([-0.08, -0.06, 0.02])
            .faceted();
        let lights = vec![
            lamp([-0.35, 0.15, 0.6], [0.5, 0.45, 0.4]),
            lamp([0.3, -0.3, 0.3], [0.1, 0.15, 0.2]),
        ];
        for (kind, phantoms, virtuals) in [
            ("virtual", vec![table()], vec![thing.clone(), block.clone()]),
            ("real", vec![table(), thing.clone()], vec![block.clone()]),
        ] {
            let card = Some(DAffine3::IDENTITY);
            let mut stage = Stage::new(
                &phantoms,
                &virtuals,
                card,
                lights.clone(),
                DVec3::splat(0.2),
            );
            stage.scene.shadows = ShadowSettings {
                ambient_samples: 0,
                ..Quality::Accurate.shadows()
            };
            let mut renderer = stage.renderer(intrinsics);
            for (index, eye) in [[0.05, -0.4, 0.3], [-0.3, 0.2, 0.2], [0.1, 0.3, 0.06]]
                .into_iter()
                .enumerate()
            {
                let view = View {
                    intrinsics,
                    camera_from_world: look_at(DVec3::from_array(eye), DVec3::new(0.0, 0.0, 0.07)),
                };
                let verdict = judge(&stage, &mut renderer, view);
                let name = path.display();
                run.add(
                    || format!("{name}, {kind}, camera {index}"),
                    &stage,
                    &view,
                    &verdict,
                );
            }
        }
    }
    run.end();
}

// Where a virtual shadow meets a real one.

/// The video is what an ideal camera records of a torus's shadow across the edge of a real box's: each of its pixels is the
/// average of its area, with the real shadow's edge in it. What the composite makes of it is held against the average with
/// the torus there.
#[test]
fn no_seam_where_a_virtual_shadow_meets_a_real_one() {
    let intrinsics = Intrinsics {
        size_px: [320, 240],
        focal_px: DVec2::splat(700.0),
        center_px: DVec2::new(159.5, 119.5),
        distortion: Distortion::NONE,
    };
    let view = View {
        intrinsics,
        camera_from_world: look_at(DVec3::new(0.05, -0.4, 0.42), DVec3::new(0.0, 0.0, 0.0)),
    };
    let ring = Thing::made(shapes::torus(0.05, 0.015, 50, 25))
        .at([-0.045, 0.0, 0.11])
        .faceted();
    let card = Some(DAffine3::IDENTITY);
    let lights = vec![lamp([-0.35, 0.15, 0.6], [1.0; 3])];
    let mut stage = Stage::new(
        &[table(), crate_()],
        &[ring],
        card,
        lights,
        DVec3::splat(0.05),
    );
    stage.virtuals[0].visible = false;
    stage.place();
    // With whether the real shadow's edge passes there.
    let real = recorded(&Expected::new(&stage, view), view, |area| {
        area.iter().any(|state| state.arriving != area[0].arriving)
    });
    let bytes = |index: usize| match index % 4 {
        3 => 255,
        channel => level_of_linear(real[index / 4].0[channel]).round() as u8,
    };
    let video = frame_of(intrinsics.size_px, bytes);
    stage.virtuals[0].visible = true;
    stage.place();
    // With whether the torus takes light there, and covers nothing.
    let ideal = recorded(&Expected::new(&stage, view), view, |area| {
        let taken = area.iter().any(|state| state.taken != 0);
        let whole = area
            .iter()
            .all(|state| state.surface.is_some_and(|s| s.role == REAL));
        taken && whole
    });
    for samples in [1, 4] {
        let shadows = ShadowSettings {
            samples,
            ..stage.scene.shadows
        };
        let mut renderer = stage.renderer_of(shadows, intrinsics);
        renderer.upload(&video).expect("an uploaded frame");
        let picture = stage.picture(&mut renderer, view.camera_from_world);
        measure_seam(samples, &picture, &real, &ideal);
    }
}

/// The radiance of each pixel's area as an ideal camera records it, and what is told of that area's states.
fn recorded(
    expected: &Expected,
    view: View,
    told: impl Fn(&[State]) -> bool,
) -> Vec<(DVec3, bool)> {
    const SIDE: usize = 12;
    const ALBEDO: f64 = 0.7;
    pixels(view.intrinsics.size_px)
        .map(|(index, center)| {
            let side = match expected.is_uniform(index) {
                true => 1,
                false => SIDE,
            };
            let area = expected.area(center, side);
            (expected.radiance(&area, ALBEDO), told(&area))
        })
        .collect()
}

/// Tells how far a picture is off the ideal one in the virtual shadow: on the real shadow's edge, and elsewhere.
fn measure_seam(samples: u32, picture: &Picture, real: &[(DVec3, bool)], ideal: &[(DVec3, bool)]) {
    let (mut seam, mut rest) = (Differences::default(), Differences::default());
    let (mut brightest, mut sum) = (0.0_f64, 0.0);
    for (index, (ideal, taken)) in ideal.iter().enumerate() {
        if !taken {
            continue;
        }
        let off = (picture.linear(index) - *ideal).x;
        if real[index].1 {
            seam.add(off);
            sum += off;
            brightest = brightest.max(off);
        } else {
            rest.add(off);
        }
    }
    eprintln!(
        "{samples} samples: {} pixels on the seam: mean {:+.4}, rms {:.4}, most {:.3}, brightest {brightest:+.3}; {} others: rms {:.4}, most {:.3}",
        seam.count,
        sum / seam.count as f64,
        seam.rms(),
        seam.most,
        rest.count,
        rest.rms(),
        rest.most
    );
    assert!(seam.count > 30);
}

fn level_of_linear(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    255.0
        * if linear <= 0.003_130_8 {
            12.92 * linear
        } else {
            1.055 * linear.powf(1.0 / 2.4) - 0.055
        }
}
