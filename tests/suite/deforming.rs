//! Pictures of things that change their shape: against rays in double precision over the triangles of each frame, and against
//! the same triangles as a thing that keeps its shape.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DAffine3, DVec2, DVec3};
use gnomon::app::truth::FACES_AWAY;
use gnomon::app::truth::ray_cast::{GRAZES, View};
use gnomon::geometry::camera::{Distortion, Intrinsics};
use gnomon::light::probe::Probe;
use gnomon::light::{Light, Material};
use gnomon::render::{Layers, REAL, Renderer, Shown, VIRTUAL, VIRTUAL_HIDES};
use gnomon::scene::{EnvironmentMethod, Scene, Shortcut, Shortcuts, Station};
use serde_json::Value;

use crate::common::composite::Expected;
use crate::common::judge::shadow_error;
use crate::common::rigs::{bar, hinge, morphing_box};
use crate::common::{Picture, Stage, lamp, look_at, project_file, sun};

const CAMERA: Intrinsics = Intrinsics {
    size_px: [400, 300],
    focal_px: DVec2::splat(460.0),
    center_px: DVec2::new(199.5, 149.5),
    distortion: Distortion::NONE,
};
/// Of the pixels.
const MOST_WRONG_PCT: f64 = 0.02;

fn camera() -> DAffine3 {
    look_at(DVec3::new(0.12, -0.42, 0.3), DVec3::new(0.0, 0.0, 0.04))
}

fn lights() -> Vec<Light> {
    vec![
        lamp([-0.3, -0.12, 0.5], [0.22; 3]),
        sun([0.2, 0.75, -0.9], [0.5; 3]),
    ]
}

/// A table under these lights, with these things on it; drawn with four samples.
fn scene(things: &str, lights: Vec<Light>) -> Scene {
    let text = format!(
        "[camera]\nsource = \"webcam:0\"\n[[board]]\nname = \"table\"\n\
         markers = [{{ id = 0, size_m = 0.045, center_m = [0, 0] }}]\n[ambient]\nradiance = 0.04\n\
         [table]\nrect_m = [-0.5, -0.5, 0.5, 0.5]\n{things}"
    );
    let mut scene = Scene::parse(&project_file("config/deforming.toml"), &text).expect("a scene");
    scene.lights = lights.into_iter().map(Into::into).collect();
    scene.shadows.samples = 4;
    scene.shadows.ambient_samples = 0;
    scene
}

/// The small models, as files of a folder that goes with them.
struct Models(tempfile::TempDir);

impl Models {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let models: [(&str, Value); 3] =
            [("bar", bar()), ("box", morphing_box()), ("hinge", hinge())];
        for (name, model) in models {
            let path = folder.path().join(format!("{name}.gltf"));
            std::fs::write(path, model.to_string()).expect("a model");
        }
        Self(folder)
    }

    /// The table of a thing that plays its file's first animation.
    fn thing(&self, kind: &str, model: &str, keys: &str) -> String {
        let path = self.0.path().join(format!("{model}.gltf"));
        thing(kind, model, &path, &format!("animation = 0\n{keys}"))
    }

    /// All three: a bar that bends over the others and its shadow over them, a phantom that opens.
    fn all(&self) -> String {
        [
            self.thing(
                "phantom",
                "hinge",
                "fit_m = 0.05\nposition_m = [-0.09, 0.02, 0.0]\nanimation_speed = 0.9\nmaterial = { albedo = 0.6 }\n",
            ),
            self.thing(
                "virtual",
                "bar",
                "fit_m = 0.11\nposition_m = [0.0, -0.02, 0.0]\nsmooth_deg = 0\nmaterial = { albedo = 0.7 }\n",
            ),
            self.thing(
                "virtual",
                "box",
                "fit_m = 0.04\nposition_m = [0.04, 0.0, 0.01]\nsmooth_deg = 0\nmaterial = { albedo = 0.3 }\n",
            ),
        ]
        .concat()
    }
}

fn thing(kind: &str, name: &str, path: &Path, keys: &str) -> String {
    let path = path.display();
    format!("[[{kind}]]\nname = \"{name}\"\nmesh = '{path}'\n{keys}")
}

fn draw(renderer: &mut Renderer, scene: &Scene, camera: DAffine3, time_s: f64) -> Picture {
    let nodes = scene.camera_from_nodes(&[Some(camera)], time_s);
    renderer.set_time(time_s);
    renderer.draw(&nodes, Shown::Composite);
    Picture::new(renderer.read_picture().expect("a picture"))
}

/// What a frame has wrong.
#[derive(Debug, Default)]
struct Wrong {
    pixels: usize,
    shadowed: usize,
    self_shadowed: usize,
}

/// Holds the layers of a frame: of each light the shadow of the virtual things on all that faces it, themselves among it.
fn hold_layers(stage: &Stage, view: &View, layers: &Layers, what: &str) -> Wrong {
    let lights = stage.scene.world_lights();
    let exact = stage.world.cast(&lights, view, 0.0);
    let mut total = Wrong::default();
    for (number, light) in lights.iter().enumerate() {
        let (bits, found) = (&exact.bits[number], &layers.shadow[number]);
        let error = shadow_error(&stage.world, view, &exact, light, bits, found);
        assert_eq!(error.far, 0, "{what}, light {number}: {error:?}");
        total.shadowed += error.shadowed;
        let mut wrong = 0;
        for (index, (&exact_bit, &found)) in bits.iter().zip(found).enumerate() {
            let role = exact.role(index);
            if role != layers.role[index] {
                wrong += 1;
                continue;
            }
            if ![REAL, VIRTUAL].contains(&role) || exact_bit & (FACES_AWAY | GRAZES) != 0 {
                continue;
            }
            let is_self = role == VIRTUAL && exact_bit & VIRTUAL_HIDES != 0;
            total.self_shadowed += usize::from(is_self);
            wrong += usize::from((exact_bit ^ found) & VIRTUAL_HIDES != 0);
        }
        let wrong_pct = 100.0 * wrong as f64 / bits.len() as f64;
        assert!(
            wrong_pct <= MOST_WRONG_PCT,
            "{what}, light {number}: {wrong} pixels, {wrong_pct:.4} %"
        );
        total.pixels += wrong;
    }
    total
}

/// Holds twenty frames of a scene: the composite, and its layers. `is_flat`: it is known how each virtual thing is shaded.
fn hold_frames(name: &str, scene: &Scene, (frames, step_s): (usize, f64), is_flat: bool) {
    let camera_from_world = camera();
    let view = View {
        intrinsics: CAMERA,
        camera_from_world,
    };
    let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
    let mut total = Wrong::default();
    let (mut judged, mut wrong) = (0, 0);
    let mut before: Option<Vec<u8>> = None;
    for frame in 0..frames {
        let time_s = 0.013 + step_s * frame as f64;
        let picture = draw(&mut renderer, scene, camera_from_world, time_s);
        let layers = renderer.layers().expect("layers");
        let mut stage = Stage::of_scene(scene.shaped_at(time_s).into_owned());
        if is_flat {
            // What moves by itself gets the plain ambient light: nothing of it is unknown.
            stage.world_from_card = Some(DAffine3::IDENTITY);
        }
        let what = format!("{name}, frame {frame}");
        let of_frame = hold_layers(&stage, &view, &layers, &what);
        let verdict = Expected::new(&stage, view).judge(&picture, None);
        let wrong_pct = 100.0 * verdict.wrong as f64 / verdict.judged as f64;
        assert!(
            wrong_pct <= MOST_WRONG_PCT,
            "{what}: {}\n{}",
            verdict.summary(),
            verdict.first.join("\n")
        );
        judged += verdict.judged;
        wrong += verdict.wrong;
        total.pixels += of_frame.pixels;
        total.shadowed += of_frame.shadowed;
        total.self_shadowed += of_frame.self_shadowed;
        let moves = before.as_ref().is_none_or(|before| *before != picture.rgba);
        assert!(moves, "{what} is as the one before");
        before = Some(picture.rgba);
    }
    eprintln!("{name}: composite {wrong} of {judged} pixels wrong; layers {total:?}");
    assert!(total.shadowed > 200 * frames, "{name}: {total:?}");
}

#[test]
fn what_bends_morphs_and_opens_shades_all_and_itself_as_rays_say() {
    let models = Models::new();
    hold_frames(
        "small models",
        &scene(&models.all(), lights()),
        (20, 0.0471),
        true,
    );
    // One lamp alone is drawn in fewer passes.
    let lamp_alone = scene(&models.all(), vec![lights()[0]]);
    hold_frames("under a lamp", &lamp_alone, (4, 0.217), true);
}

fn shared(name: &str) -> PathBuf {
    project_file("../shared/models/gltf").join(name)
}

#[cfg_attr(not(has_shared), ignore = "../shared is not here")]
#[test]
fn a_fox_walks_with_the_shadow_that_rays_see() {
    let keys = "fit_m = 0.16\nanimation = \"Walk\"\nsmooth_deg = 0\nmaterial = { albedo = 0.6 }\n\
                rotation_deg = [0, 0, 60]\n";
    let fox = thing("virtual", "fox", &shared("Fox.glb"), keys);
    let mut scene = scene(&fox, lights());
    // How gloss looks other tests tell.
    scene.virtuals[0].materials = vec![Material::matt(DVec3::splat(0.6))];
    hold_frames("Fox", &scene, (20, 0.7083 / 20.0), true);
}

#[cfg_attr(not(has_shared), ignore = "../shared is not here")]
#[test]
fn a_man_walks_with_the_shadow_that_rays_see() {
    let keys =
        "fit_m = 0.15\nanimation = 0\nrotation_deg = [0, 0, 40]\nmaterial = { albedo = 0.6 }\n";
    let man = thing("virtual", "man", &shared("CesiumMan.glb"), keys);
    hold_frames("CesiumMan", &scene(&man, lights()), (20, 0.1), false);
}

#[cfg_attr(not(has_shared), ignore = "../shared is not here")]
#[test]
fn a_fox_that_is_real_hides_and_shades_what_is_virtual() {
    let keys = "fit_m = 0.16\nanimation = \"Run\"\nrotation_deg = [0, 0, 60]\n";
    let fox = thing("phantom", "fox", &shared("Fox.glb"), keys);
    let ball = "[[virtual]]\nname = \"box\"\nbox_m = [0.05, 0.03, 0.07]\nposition_m = [0.02, 0.05, 0]\nsmooth_deg = 0\n\
                material = { albedo = 0.7 }\n";
    let scene = scene(&format!("{fox}{ball}"), lights());
    hold_frames("real Fox", &scene, (5, 0.21), false);
}

/// The scene with things that have the shape of a moment for good.
fn frozen(scene: &Scene, time_s: f64) -> Scene {
    let mut frozen = scene.shaped_at(time_s).into_owned();
    for thing in frozen.phantoms.iter_mut().chain(&mut frozen.virtuals) {
        // (What moves is lit more coarsely than what stands: it stays where it is, but by moving.)
        if thing.animation.take().is_some()
            && let Some(motion) = &mut thing.motion
        {
            motion.path = vec![Station {
                time_s: 0.0,
                offset_m: DVec3::ZERO,
                rotation_deg: DVec3::ZERO,
            }];
        }
        // (What is held is not cut finer, as nothing is that changes its shape.)
        if scene.shadows.technique != gnomon::scene::Technique::Environment {
            Arc::make_mut(&mut thing.mesh).held.clear();
        }
    }
    frozen
}

/// Pixels that are off by more than rounding may put them.
fn apart(one: &Picture, other: &Picture) -> usize {
    let pixels = 0..one.rgba.len() / 4;
    let is_apart = |index: &usize| {
        let pairs = one.pixel(*index).into_iter().zip(other.pixel(*index));
        pairs.into_iter().any(|(a, b)| a.abs_diff(b) > 2)
    };
    pixels.filter(is_apart).count()
}

/// Whatever draws it, a frame is that of things which have always had that shape; also after other frames.
fn hold_frozen(name: &str, scene: &Scene, times_s: &[f64], most_apart: usize) {
    let renderer_of = |scene: &Scene| Stage::of_scene(scene.clone()).renderer(CAMERA);
    let mut renderer = renderer_of(scene);
    let first = draw(&mut renderer, scene, camera(), 0.0);
    for &time_s in times_s {
        let found = draw(&mut renderer, scene, camera(), time_s);
        let still = frozen(scene, time_s);
        let expected = draw(&mut renderer_of(&still), &still, camera(), time_s);
        let off = apart(&found, &expected);
        assert!(
            off <= most_apart,
            "{name}, {time_s} s: {off} pixels are off"
        );
        let moved = apart(&found, &first);
        assert!(
            moved > 500,
            "{name}, {time_s} s: {moved} pixels have changed"
        );
    }
    // And back.
    let again = draw(&mut renderer, scene, camera(), 0.0);
    assert_eq!(again.rgba, first.rgba, "{name}");
}

#[test]
fn gathered_light_follows_the_shape() {
    let models = Models::new();
    // What stands gets what is around it: that is gathered once, and the bar takes from it where it bends over it.
    let below = "[[virtual]]\nname = \"below\"\nbox_m = [0.05, 0.04, 0.03]\nposition_m = [-0.035, -0.02, 0]\n\
                 smooth_deg = 0\nmaterial = { albedo = 0.8 }\n";
    let mut scene = scene(&format!("{}{below}", models.all()), lights());
    scene.ambient_radiance = DVec3::splat(0.15);
    // It is black, and takes more than it gives.
    scene.virtuals[0].materials = vec![Material::matt(DVec3::ZERO)];
    scene.shadows.ambient_samples = 64;
    scene.shadows.max_silhouette_error_px = 0.0;
    hold_frozen("gathered", &scene, &[0.4, 0.9], 4);
}

#[test]
fn one_lamp_drawn_straight_into_the_picture_follows_the_shape() {
    let models = Models::new();
    let mut scene = scene(&models.all(), vec![lights()[0]]);
    scene.shadows.samples = 1;
    hold_frozen("direct", &scene, &[0.4, 0.9], 4);
}

/// The scene of a recording, with a bar that bends in place of its own things.
fn in_a_recording(name: &str, models: &Models) -> Scene {
    let file = project_file(&format!("config/{name}.toml"));
    let text = std::fs::read_to_string(&file).expect("a scene that ships");
    let things = models.thing(
        "virtual",
        "bar",
        "fit_m = 0.11\nposition_m = [0.02, -0.03, 0.0]\nsmooth_deg = 0\nmaterial = { albedo = 0.7 }\n",
    );
    let mut scene = Scene::parse(&file, &format!("{text}\n{things}")).expect("a scene");
    scene.virtuals.drain(..scene.virtuals.len() - 1);
    for (number, thing) in scene.virtuals.iter_mut().enumerate() {
        thing.anchor = scene.anchors.len() + number;
    }
    scene.shadows.samples = 1;
    scene
}

#[test]
fn shafts_of_a_room_follow_the_shape() {
    let models = Models::new();
    let mut scene = in_a_recording("room", &models);
    scene.shadows.shafts.patches = 1500;
    hold_frozen("room", &scene, &[0.9], 4);
}

#[test]
fn an_environment_follows_the_shape_by_rays_and_by_maps() {
    let models = Models::new();
    for (name, method) in [
        ("rays", "rays"),
        ("penumbrae", "penumbrae"),
        ("maps", "maps"),
    ] {
        let mut scene = in_a_recording("room", &models);
        scene.shadows.technique = gnomon::scene::Technique::Environment;
        scene.shadows.environment.method = gnomon::scene::EnvironmentMethod::BY_NAME
            .into_iter()
            .find(|(known, _)| *known == method)
            .expect("a method")
            .1;
        scene.shadows.ambient_samples = 64;
        hold_frozen(name, &scene, &[0.9], 4);
    }
}

#[test]
fn what_lets_light_through_follows_the_shape() {
    let models = Models::new();
    let clear = |name: &str, mut model: Value, color: [f32; 4], keys: &str| {
        model["materials"] = serde_json::json!([{
            "alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": color}
        }]);
        model["meshes"][0]["primitives"][0]["material"] = serde_json::json!(0);
        let path = models.0.path().join(format!("clear {name}.gltf"));
        std::fs::write(&path, model.to_string()).expect("a model");
        thing("virtual", name, &path, &format!("{keys}smooth_deg = 0\n"))
    };
    // The bar bends towards the camera, past the middle of a pane that stands before it.
    let bending = "animation = \"Bend\"\nfit_m = 0.11\nrotation_deg = [0, 0, 90]\n";
    let pane = "fit_m = 0.06\nscale = [1, 0.05, 1]\nposition_m = [-0.03, -0.012, 0.0094]\n";
    let things = [
        clear("bar", bar(), [0.8, 0.3, 0.2, 0.5], bending),
        clear("pane", morphing_box(), [0.1, 0.3, 0.9, 0.5], pane),
    ];
    let scene = scene(&things.concat(), lights());
    hold_frozen("clear", &scene, &[0.5, 1.0], 4);
}

#[test]
fn a_replay_repeats_bit_for_bit_whatever_was_drawn_before() {
    let models = Models::new();
    let scene = scene(&models.all(), lights());
    let mut shown = Vec::new();
    for step in [1, 3] {
        let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
        for frame in (0..10).step_by(step) {
            let picture = draw(&mut renderer, &scene, camera(), f64::from(frame) / 15.0);
            shown.push((frame, picture.rgba));
        }
    }
    let (every, some) = shown.split_at(10);
    for (frame, picture) in some {
        assert_eq!(picture, &every[*frame as usize].1, "frame {frame}");
    }
    // Nothing that is kept from frame to frame is kept too long.
    let mut forgetful = scene.clone();
    forgetful.shadows.without = Shortcuts::NONE.with(Shortcut::Kept, true);
    let mut renderer = Stage::of_scene(forgetful).renderer(CAMERA);
    for (frame, picture) in every {
        let plain = draw(&mut renderer, &scene, camera(), f64::from(*frame) / 15.0);
        assert_eq!(&plain.rgba, picture, "frame {frame}");
    }
}

#[test]
fn an_edit_is_followed_in_the_shape_of_the_moment() {
    let models = Models::new();
    let scene = scene(&models.all(), lights());
    let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
    draw(&mut renderer, &scene, camera(), 0.6);
    let mut moved = scene.clone();
    moved.virtuals[0].anchor_from_object.translation.x += 0.03;
    assert!(renderer.follow(&moved));
    let found = draw(&mut renderer, &moved, camera(), 0.6);
    let fresh = &mut Stage::of_scene(moved.clone()).renderer(CAMERA);
    let expected = draw(fresh, &moved, camera(), 0.6);
    assert_eq!(apart(&found, &expected), 0);
    // Another speed takes another renderer.
    let mut faster = scene.clone();
    faster.virtuals[0].animation.as_mut().expect("one").speed = 2.0;
    assert!(!renderer.follow(&faster));
}

#[test]
fn edits_are_followed_from_frame_to_frame_while_an_animation_plays() {
    let models = Models::new();
    type Edit<'a> = (&'a str, &'a dyn Fn(&mut Scene));
    let edits: [Edit<'_>; 6] = [
        ("moved", &|scene| {
            let last = scene.virtuals.last_mut().expect("a thing");
            last.anchor_from_object.translation.x += 0.03;
        }),
        ("turned", &|scene| {
            let last = scene.virtuals.last_mut().expect("a thing");
            let place = last.anchor_from_object;
            last.anchor_from_object = place * DAffine3::from_rotation_z(0.7);
        }),
        ("hidden", &|scene| {
            scene.virtuals.last_mut().expect("a thing").visible = false;
        }),
        ("brightened", &|scene| {
            scene
                .lights
                .iter_mut()
                .for_each(|light| brighten(&mut light.light));
            scene
                .probe
                .iter_mut()
                .for_each(|probe| probe.exposure *= 1.4);
        }),
        ("light turned", &|scene| {
            if let Some(probe) = &mut scene.probe {
                let [width, height] = probe.probe.size_px();
                let mut pixels = probe.probe.pixels().to_vec();
                let rows = pixels.chunks_mut(width);
                rows.for_each(|row| row.rotate_right(width / 5));
                probe.probe = Probe::new([width, height], pixels).expect("pixels");
            }
        }),
        ("shown", &|scene| {
            scene.virtuals.last_mut().expect("a thing").visible = true;
        }),
    ];
    let environment = |method| {
        let mut scene = in_a_recording("room", &models);
        let ball =
            "[[virtual]]\nname = \"further\"\nsphere_m = 0.03\nposition_m = [-0.05, -0.03, 0.02]\n";
        let file = project_file("config/room.toml");
        let text = std::fs::read_to_string(&file).expect("a scene that ships");
        let with_ball = Scene::parse(&file, &format!("{text}\n{ball}")).expect("a scene");
        let mut ball = with_ball.virtuals.last().expect("the ball").clone();
        ball.anchor = 0;
        scene.virtuals.push(ball);
        scene.shadows.technique = gnomon::scene::Technique::Environment;
        scene.shadows.environment.method = method;
        scene.shadows.ambient_samples = 64;
        scene
    };
    let scenes = [
        ("lamps", scene(&models.all(), lights())),
        ("rays", environment(EnvironmentMethod::Rays)),
        ("maps", environment(EnvironmentMethod::Maps)),
    ];
    for (name, mut scene) in scenes {
        let mut renderer = Stage::of_scene(scene.clone()).renderer(CAMERA);
        draw(&mut renderer, &scene, camera(), 0.1);
        for (step, (what, edit)) in edits.iter().enumerate() {
            let time_s = 0.2 + 0.1 * step as f64;
            edit(&mut scene);
            assert!(renderer.follow(&scene), "{name}: {what}: not followed");
            let seen = |renderer: &mut Renderer| {
                // Where something has just moved, light is gathered finely from the next frame on.
                draw(renderer, &scene, camera(), time_s);
                draw(renderer, &scene, camera(), time_s)
            };
            let found = seen(&mut renderer);
            // A new renderer takes seconds; what was followed wrongly is wrong after the next edit too, as none takes back the one
            // before it.
            if step % 2 == 0 && name != "lamps" {
                continue;
            }
            let expected = seen(&mut Stage::of_scene(scene.clone()).renderer(CAMERA));
            assert_eq!(apart(&found, &expected), 0, "{name}: {what}");
        }
    }
}

fn brighten(light: &mut Light) {
    match light {
        Light::Point { intensity, .. } => *intensity *= 1.5,
        Light::Directional { irradiance, .. } => *irradiance *= 1.5,
    }
}
