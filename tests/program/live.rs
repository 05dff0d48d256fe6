//! The live pipeline without a window: the newest frame wins, what is shown is what a fresh renderer draws, files that
//! change are followed, and what is recorded replays.

use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, Weak};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{gpu, project_file};
use glam::{DAffine3, DVec3};
use gnomon::app::authoring::Edit;
use gnomon::app::input::live_capture::Tapped;
use gnomon::app::input::live_input::LiveInput;
use gnomon::app::input::mailbox::Taken;
use gnomon::app::live::TrackingPlan;
use gnomon::app::live::adding::{WantedShape, WantedThing};
use gnomon::app::live::beginning::Opening;
use gnomon::app::live::command::{
    Clicks, Commands, LiveCommand, RecordingCommand, SceneCommand, Selected, WindowCommand,
};
use gnomon::app::live::meters::Sample;
use gnomon::app::live::panel::Panel;
use gnomon::app::live::pipeline::{Pipeline, PipelineInput};
use gnomon::app::live::session::LiveSession;
use gnomon::app::live::views::ViewMode;
use gnomon::app::live::window_state::WindowState;
use gnomon::app::stopwatch::Stopwatch;
use gnomon::app::truth::TruePoses;
use gnomon::app::window::Wake;
use gnomon::capture::{Frame, FrameSource};
use gnomon::geometry::light_placing::{LightFreedom, PosedCamera};
use gnomon::geometry::pose::rotation_between;
use gnomon::light::{Light, Shape};
use gnomon::render::{Gpu, RenderError, Renderer, Shown};
use gnomon::scene::{CameraSettings, Placement, Scene};
use gnomon::tracking::Status;

const SOON: Duration = Duration::from_secs(60);

/// The scene of the lamp in a folder of its own.
fn lamp_in(folder: &Path) -> PathBuf {
    let path = folder.join("lamp.toml");
    let text = std::fs::read_to_string(project_file("config/lamp.toml")).unwrap();
    let root = project_file("");
    let text = text.replace("\"recordings/", &format!("\"{}recordings/", root.display()));
    let text = text.replace("\"models/", &format!("\"{}models/", root.display()));
    std::fs::write(&path, text).unwrap();
    path
}

fn open(path: &Path, out: &Path, repeats: bool) -> LiveSession {
    open_waking(path, out, repeats, Arc::new(|| ()))
}

fn open_waking(path: &Path, out: &Path, repeats: bool, wake: Wake) -> LiveSession {
    let opening = Opening::scene(path).unwrap();
    let now = Arc::new(Stopwatch::clock());
    LiveSession::open(opening, gpu(), out, repeats, (now, wake))
}

/// Whether the last frame is shown as well as can be: the camera's end is known before that frame is tracked.
fn has_ended(session: &LiveSession) -> bool {
    let last = session.picture().map(|picture| picture.frame.index);
    !session.is_live() && session.is_settled() && last == Some(119)
}

/// Moves a session on, as a window does, until something holds.
fn run_until(
    session: &mut LiveSession,
    state: &WindowState,
    what: &str,
    holds: impl Fn(&LiveSession) -> bool,
) {
    let began = Instant::now();
    while !holds(session) {
        assert!(began.elapsed() < SOON, "not in time: {what}");
        step(session, state);
    }
}

fn step(session: &mut LiveSession, state: &WindowState) {
    if session.step(state).unwrap() {
        let now_secs = session.now_secs();
        session.was_shown(now_secs).unwrap();
    } else {
        thread::sleep(Duration::from_millis(2));
    }
}

/// What a renderer made for this scene and nothing before draws of the session's frame.
fn drawn_afresh(session: &LiveSession, scene: &Scene) -> Vec<u8> {
    let picture = session.picture().unwrap();
    let mut renderer = Renderer::new(gpu(), scene, picture.intrinsics).unwrap();
    renderer.upload(&picture.frame).unwrap();
    let poses = picture.poses.iter();
    let (placed, visibility): (Vec<_>, Vec<_>) = poses
        .map(|pose| (pose.camera_from_anchor, pose.visibility))
        .unzip();
    renderer.draw_fading(&placed, &visibility, Shown::Composite);
    renderer.read_picture().unwrap()
}

fn shown(session: &LiveSession) -> Vec<u8> {
    let (renderer, ..) = session.renderer().unwrap();
    renderer.read_picture().unwrap()
}

/// Bytes that are clearly others.
fn count_off(picture: &[u8], exact: &[u8]) -> usize {
    let pairs = picture.iter().zip(exact);
    pairs.filter(|(a, b)| a.abs_diff(**b) > 24).count()
}

/// The torus of the lamp's scene, elsewhere.
fn moved_torus() -> Edit {
    Edit::Place {
        thing: "torus".to_owned(),
        placement: Placement {
            position_m: DVec3::new(-0.1, -0.06, 0.036),
            rotation_deg: DVec3::new(70.0, 0.0, -20.0),
            scale: DVec3::splat(1.25),
        },
    }
}

#[test]
fn a_slow_window_gets_the_newest_frame_and_nothing_queues() {
    let camera = CameraSettings {
        source: project_file("recordings/lamp").to_str().unwrap().to_owned(),
        ..CameraSettings::default()
    };
    let input = LiveInput::of(&camera).unwrap();
    let scene = Scene::load(&project_file("config/lamp.toml")).unwrap();
    let plan = TrackingPlan::Follow {
        settings: scene.tracking,
        anchors: scene.anchors.into(),
    };
    let pipeline_input = PipelineInput {
        source: camera.source,
        options: input.options(false),
        calibration: input.calibration,
    };
    let now = Arc::new(Stopwatch::clock());
    let pipeline = Pipeline::start(&pipeline_input, plan, &(now as _), Arc::new(|| ()));
    let frames: Arc<Mutex<Vec<Weak<Frame>>>> = Arc::default();
    pipeline.set_tap(Some(Box::new({
        let frames = Arc::clone(&frames);
        move |tapped| {
            if let Tapped::Frame(frame) = tapped {
                frames.lock().unwrap().push(Arc::downgrade(frame));
            }
        }
    })));
    let (mut shown, mut last) = (0, None);
    loop {
        let captured_before = pipeline.captured();
        let picture = match pipeline.tracked().take_within(Duration::from_millis(100)) {
            Taken::New(picture) => picture,
            Taken::Nothing => continue,
            Taken::Closed => break,
        };
        let index = picture.frame.index;
        assert!(last < Some(index), "in order");
        last = Some(index);
        shown += 1;
        // One at the window, one on its way there, one in tracking, one on its way there, one being captured.
        let alive = frames
            .lock()
            .unwrap()
            .iter()
            .filter(|f| f.strong_count() > 0)
            .count();
        assert!(alive <= 5, "{alive} frames are held");
        // Of those that were captured before it was taken one may just have come, one wait for tracking, one be in it and one
        // wait for the window; all others are shown or counted, else there is a queue.
        let [tracking, window, broken] = pipeline.dropped();
        let told = shown + tracking + window + broken;
        assert!(
            told + 4 >= captured_before,
            "frame {index}: {told} are shown or counted of {captured_before}"
        );
        // A very slow renderer.
        thread::sleep(Duration::from_millis(150));
    }
    assert_eq!(last, Some(119), "the last frame is shown");
    let [tracking, window, broken] = pipeline.dropped();
    assert_eq!(
        shown + tracking + window + broken,
        120,
        "each is shown or counted"
    );
    assert!(
        tracking + window > 60,
        "{tracking} and {window} were dropped before tracking and the window"
    );
}

#[test]
fn a_recording_is_shown_in_time_with_the_poses_of_its_own_images() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let mut source = FrameSource::open(project_file("recordings/lamp").to_str().unwrap()).unwrap();
    let mut recorded = Vec::new();
    while let Some(frame) = source.next_frame().unwrap() {
        recorded.push(frame);
    }
    let truth = TruePoses::read(&project_file("recordings/lamp")).unwrap();
    let began = Instant::now();
    let mut session = open(&path, folder.path(), false);
    let state = WindowState::new();
    let mut seen = 0;
    while session.is_live() {
        assert!(began.elapsed() < SOON, "it ends");
        step(&mut session, &state);
        let Some(picture) = session.picture() else {
            continue;
        };
        let index = picture.frame.index as usize;
        if index < seen {
            continue;
        }
        seen = index + 1;
        assert_eq!(picture.frame.rgba, recorded[index].rgba, "frame {index}");
        let [pose] = &picture.poses[..] else {
            panic!("one anchor");
        };
        assert_eq!(pose.status, Status::Tracked, "frame {index}");
        let found = pose.camera_from_anchor.expect("a tracked pose");
        // A pose that is filtered lags where many frames are dropped, but no other image's would be nearer.
        let off_px = |image: usize| {
            let true_pose = truth.camera_from_anchors(image as u32, &picture.anchors);
            let true_pose = true_pose.expect("a true pose")[0];
            let markers = picture.anchors[0]
                .markers
                .iter()
                .map(|marker| marker.center_m());
            let off = markers.map(|at_m| {
                let at_px =
                    |pose: DAffine3| picture.intrinsics.pixel_of(pose.transform_point3(at_m));
                at_px(found).unwrap().distance(at_px(true_pose).unwrap())
            });
            off.fold(0.0, f64::max)
        };
        for other in [index.saturating_sub(1), (index + 1).min(119)] {
            assert!(
                other == index || off_px(index) < 0.5 * off_px(other),
                "frame {index}: {} px off, {} px from frame {other}",
                off_px(index),
                off_px(other)
            );
        }
    }
    assert!(
        began.elapsed().as_secs_f64() >= 119.0 / 30.0,
        "in real time"
    );
    let idle_ms = session.meters.median(Sample::idle_ms).unwrap();
    let latency_ms = session.meters.median(|sample| sample.latency_ms).unwrap();
    eprintln!("latency {latency_ms:.1} ms, of which waiting {idle_ms:.1} ms");
    assert!(latency_ms > 0.0);
    assert!(
        idle_ms <= 1000.0 / 30.0,
        "beyond the stages' own time at most one interval of frames: {idle_ms} ms"
    );
}

#[test]
fn a_camera_that_nobody_has_calibrated_is_learnt_while_its_frames_come() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let text = std::fs::read_to_string(&path).unwrap();
    let text = text.replace("recordings/lamp\"", "recordings/lamp/video.mp4\"");
    std::fs::write(&path, text).unwrap();
    let truth = TruePoses::read(&project_file("recordings/lamp")).unwrap();
    let mut session = open(&path, folder.path(), false);
    let state = WindowState::new();
    let mut deviations = Vec::new();
    let began = Instant::now();
    while !has_ended(&session) {
        assert!(began.elapsed() < SOON, "it ends");
        step(&mut session, &state);
        let Some(picture) = session.picture() else {
            continue;
        };
        let learnt = picture.learnt.expect("a camera that is learnt");
        assert_eq!(
            learnt.intrinsics, picture.intrinsics,
            "what is tracked with is what is told"
        );
        deviations.push(learnt.focal_deviation);
        // Whatever the camera, the picture shows the board where it is.
        let pose = &picture.poses[0];
        let (Some(found), index) = (pose.camera_from_anchor, picture.frame.index) else {
            continue;
        };
        let true_pose = truth.camera_from_anchors(index, &picture.anchors).unwrap()[0];
        let off = rotation_between(&found, &true_pose).to_degrees();
        assert!(off < 6.0, "frame {index}: {off}°");
    }
    let picture = session.picture().unwrap();
    let learnt = picture.learnt.expect("a camera");
    let off = learnt.intrinsics.focal_px.x / 615.0 - 1.0;
    eprintln!("{}", learnt.in_words());
    assert!(off.abs() < 0.03, "{}", learnt.in_words());
    assert!(learnt.is_sure(), "{}", learnt.in_words());
    let falls = deviations.windows(2).all(|pair| pair[1] <= pair[0]);
    assert!(
        falls && deviations[0] > learnt.focal_deviation,
        "{deviations:?}"
    );
    let found = picture.poses[0].camera_from_anchor.expect("the board");
    let true_pose = truth.camera_from_anchors(119, &picture.anchors).unwrap()[0];
    let off = found.translation.distance(true_pose.translation) / true_pose.translation.length();
    assert!(off < 0.03, "{off} of its distance");
}

#[test]
fn what_is_edited_is_drawn_as_if_it_had_always_been_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let mut session = open(&path, folder.path(), true);
    let state = WindowState::new();
    run_until(&mut session, &state, "the scene is drawn", |session| {
        session.picture().is_some() && session.is_settled()
    });
    let before = Scene::load(&path).unwrap();
    assert!(
        shown(&session) == drawn_afresh(&session, &before),
        "the scene"
    );

    // While it is dragged, the file is as it was and what can be shown at once is shown.
    let text_before = std::fs::read_to_string(&path).unwrap();
    session.edit_scene(SceneCommand::Preview(moved_torus()), &state);
    step(&mut session, &state);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text_before);
    let mut dragged = before.clone();
    assert!(moved_torus().show_in(&mut dragged));
    let exact = drawn_afresh(&session, &dragged);
    let off = count_off(&shown(&session), &exact);
    // Only what surroundings throw on the torus may be that of the place it was at.
    assert!(off * 1000 < exact.len(), "{off} of {} bytes", exact.len());

    let dimmed = Edit::Light {
        index: 0,
        light: Light::Point {
            position_m: DVec3::new(0.2, 0.2, 0.5),
            intensity: DVec3::splat(0.8),
            shape: Shape::Point,
        },
    };
    session.edit_scene(SceneCommand::Commit(moved_torus()), &state);
    session.edit_scene(SceneCommand::Commit(dimmed), &state);
    run_until(
        &mut session,
        &state,
        "the edits are drawn",
        LiveSession::is_settled,
    );
    step(&mut session, &state);
    let written = Scene::load(&path).unwrap();
    assert_ne!(written.lights, before.lights);
    assert!(
        shown(&session) == drawn_afresh(&session, &written),
        "the edits"
    );

    session.edit_scene(SceneCommand::Undo, &state);
    session.edit_scene(SceneCommand::Undo, &state);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text_before);
    run_until(
        &mut session,
        &state,
        "the scene is back",
        LiveSession::is_settled,
    );
    step(&mut session, &state);
    assert!(shown(&session) == drawn_afresh(&session, &before), "undone");
}

#[test]
fn what_is_added_is_read_beside_the_picture_and_drawn_copied_and_renamed() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let cube = folder.path().join("cube, large.obj");
    std::fs::write(&cube, CUBE_MM).unwrap();
    let before = std::fs::read_to_string(&path).unwrap();
    let mut session = open(&path, folder.path(), true);
    let mut state = WindowState::new();
    run_until(&mut session, &state, "the scene is drawn", |session| {
        session.picture().is_some() && session.is_settled()
    });
    session.edit_scene(model(cube), &state);
    // It is on its way: the file says nothing of it yet.
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
    run_until(&mut session, &state, "the model is read", |session| {
        has(session, "cube_ large")
    });
    let selected = Some(Selected::Thing("cube_ large".to_owned()));
    state.apply(&session.take_selection().expect("what came is selected"));
    assert_eq!(state.selected, selected);
    let text = std::fs::read_to_string(&path).unwrap();
    assert!(
        text.contains("mesh = \"cube, large.obj\"\nfit_m = 0.1\n"),
        "{text}"
    );

    copy_rename_and_add_a_ball(&mut session, &state);
    let written = Scene::load(&path).unwrap();
    assert_apart(&written, &["cube_ large 2", "die", "ball"]);
    run_until(
        &mut session,
        &state,
        "all is drawn",
        LiveSession::is_settled,
    );
    step(&mut session, &state);
    assert!(
        shown(&session) == drawn_afresh(&session, &written),
        "the additions"
    );

    // What cannot be read is told, and changes nothing.
    let text = std::fs::read_to_string(&path).unwrap();
    session.edit_scene(model(folder.path().join("none.obj")), &state);
    let is_told = |session: &LiveSession| {
        let shown = session.notices.shown(session.now_secs());
        shown.iter().any(|(_, text)| text.contains("none.obj"))
    };
    run_until(&mut session, &state, "the missing file is told", is_told);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    for _ in 0..4 {
        session.edit_scene(SceneCommand::Undo, &state);
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
}

#[test]
fn what_is_refused_leaves_the_selection_and_what_is_removed_leaves_none() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let mut session = open(&path, folder.path(), true);
    let thing = |name: &str| Some(Selected::Thing(name.to_owned()));
    let mut state = WindowState::new();
    state.selected = thing("torus");
    let rename = |name: &str| SceneCommand::Rename {
        thing: "torus".to_owned(),
        name: name.to_owned(),
    };
    let text = std::fs::read_to_string(&path).unwrap();
    // Another thing has that name.
    let phantom = session.scene().unwrap().phantoms[1].name.clone();
    session.edit_scene(rename(&phantom), &state);
    assert_eq!(session.take_selection(), None);
    state.selected = thing("table");
    session.edit_scene(SceneCommand::RemoveSelected, &state);
    assert_eq!(session.take_selection(), None);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
    // While the file has a mistake, nothing is done, which is said.
    std::fs::write(&path, format!("{text}[nonsense]\n")).unwrap();
    state.selected = thing("torus");
    session.edit_scene(SceneCommand::RemoveSelected, &state);
    assert_eq!(session.take_selection(), None);
    let told = session.notices.shown(session.now_secs());
    let is_told = |text: &str| text.starts_with("not done: remove \"torus\"");
    assert!(told.iter().any(|(_, text)| is_told(text)), "{told:?}");
    std::fs::write(&path, text).unwrap();
    session.edit_scene(SceneCommand::RemoveSelected, &state);
    let none = WindowCommand::Select(None);
    assert_eq!(session.take_selection(), Some(none));
    state.selected = Some(Selected::Light(1));
    let added = SceneCommand::Commit(Edit::AddLight(Light::Point {
        position_m: DVec3::Z,
        intensity: DVec3::ONE,
        shape: Shape::Point,
    }));
    let lights = session.scene().unwrap().lights.len();
    session.edit_scene(added, &state);
    let last = WindowCommand::Select(Some(Selected::Light(lights)));
    assert_eq!(session.take_selection(), Some(last));
    state.selected = Some(Selected::Light(lights));
    session.edit_scene(SceneCommand::Commit(Edit::RemoveLight(0)), &state);
    let moved_up = WindowCommand::Select(Some(Selected::Light(lights - 1)));
    assert_eq!(session.take_selection(), Some(moved_up));
}

#[test]
fn a_picture_that_was_drawn_after_the_last_was_handed_over_is_not_yet_shown() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let mut session = open(&path, folder.path(), true);
    let state = WindowState::new();
    let began = Instant::now();
    while !session.step(&state).unwrap() {
        assert!(began.elapsed() < SOON, "no picture");
        thread::sleep(Duration::from_millis(2));
    }
    session.was_shown(0.0).unwrap();
    assert_eq!(session.meters.samples().count(), 0);
    session.was_shown(session.now_secs()).unwrap();
    let sample = session.meters.samples().next().expect("a picture is shown");
    assert!(sample.draw_ms >= 0.0 && sample.latency_ms >= 0.0);
}

#[test]
fn an_anchor_that_is_never_seen_is_told_with_what_is_seen_instead() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let card = "\n[[marker]]\nname = \"card\"\nfamily = \"tag36h11\"\nid = 78\nsize_m = 0.04\n";
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text + card).unwrap();
    let mut session = open(&path, folder.path(), true);
    let state = WindowState::new();
    let told = "\"card\" was never found: tag36h11 ";
    run_until(&mut session, &state, "it is told", |session| {
        let shown = session.notices.shown(session.now_secs());
        shown
            .iter()
            .any(|(_, text)| text.starts_with(told) && text.contains("wants tag36h11 78"))
    });
}

/// A cube in millimetres.
const CUBE_MM: &str = "v 0 0 0\nv 80 0 0\nv 80 80 0\nv 0 80 0\nv 0 0 80\nv 80 0 80\nv 80 80 80\nv 0 80 80\n\
     f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/// Whether a session's scene has a thing of this name.
fn has(session: &LiveSession, name: &str) -> bool {
    let scene = session.scene().unwrap();
    let mut things = scene.phantoms.iter().chain(&scene.virtuals);
    things.any(|thing| thing.name == name)
}

/// The large cube, which is selected, is copied and then called something else; a real ball comes beside both.
fn copy_rename_and_add_a_ball(session: &mut LiveSession, state: &WindowState) {
    session.edit_scene(SceneCommand::DuplicateSelected, state);
    let rename = SceneCommand::Rename {
        thing: "cube_ large".to_owned(),
        name: " die ".to_owned(),
    };
    session.edit_scene(rename, state);
    let ball = SceneCommand::Add(WantedThing {
        is_real: true,
        shape: WantedShape::Ball,
        on: None,
    });
    session.edit_scene(ball, state);
    for name in ["cube_ large 2", "die", "ball"] {
        assert!(has(session, name), "{name}");
    }
    assert!(!has(session, "cube_ large"));
}

/// No two of these things stand in one place.
fn assert_apart(scene: &Scene, names: &[&str]) {
    let places: Vec<DVec3> = (scene.phantoms.iter().chain(&scene.virtuals))
        .filter(|thing| names.contains(&thing.name.as_str()))
        .map(|thing| thing.anchor_from_object.translation.with_z(0.0))
        .collect();
    for (index, place) in places.iter().enumerate() {
        let others = &places[..index];
        assert!(
            others.iter().all(|other| other.distance(*place) > 0.05),
            "{places:?}"
        );
    }
}

/// What is to be added by a file.
fn model(path: PathBuf) -> SceneCommand {
    SceneCommand::Add(WantedThing {
        is_real: false,
        shape: WantedShape::Model(path),
        on: None,
    })
}

/// A sheet of so many squares a side, large enough to take a while.
fn large_model(path: &Path, squares: u32) {
    use std::fmt::Write as _;
    let mut text = String::new();
    let at = |column: u32, row: u32| row * (squares + 1) + column + 1;
    for (row, column) in (0..=squares).flat_map(|row| (0..=squares).map(move |it| (row, it))) {
        let [x, y] = [column, row].map(|it| f64::from(it) * 0.1 / f64::from(squares));
        let z = 0.01 * ((40.0 * x).sin() + (50.0 * y).cos());
        writeln!(text, "v {x:.6} {y:.6} {z:.6}").unwrap();
    }
    for (row, column) in (0..squares).flat_map(|row| (0..squares).map(move |it| (row, it))) {
        let [a, b] = [at(column, row), at(column + 1, row)];
        let [c, d] = [at(column + 1, row + 1), at(column, row + 1)];
        writeln!(text, "f {a} {b} {c} {d}").unwrap();
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn pictures_go_on_while_a_large_model_is_read_and_it_can_be_given_up() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let before = std::fs::read_to_string(&path).unwrap();
    let file = folder.path().join("sheet.obj");
    large_model(&file, 350);
    let mut session = open(&path, folder.path(), true);
    let state = WindowState::new();
    run_until(&mut session, &state, "the scene is drawn", |session| {
        session.picture().is_some() && session.is_settled()
    });
    session.edit_scene(model(file.clone()), &state);
    let mut frames = std::collections::BTreeSet::new();
    let mut stages = Vec::new();
    let mut longest = Duration::ZERO;
    let read = |session: &LiveSession| {
        let mut models = session.models_being_read();
        models.next().map(|(name, stage)| (name.to_owned(), stage))
    };
    while let Some((name, stage)) = read(&session) {
        assert_eq!(name, "sheet");
        if stages.last() != Some(&stage) {
            stages.push(stage);
        }
        let began = Instant::now();
        step(&mut session, &state);
        longest = longest.max(began.elapsed());
        frames.extend(session.picture().map(|picture| picture.frame.index));
    }
    eprintln!("{} pictures, the longest wait {longest:?}", frames.len());
    // (Nobody looks at each moment.)
    assert!(frames.len() >= 3, "{frames:?} while {stages:?}");
    assert!(stages.is_sorted() && stages.len() >= 2, "{stages:?}");
    let things = |session: &LiveSession| session.scene().unwrap().virtuals.len();
    assert_eq!(things(&session), 2);
    session.edit_scene(SceneCommand::Undo, &state);

    session.edit_scene(model(file), &state);
    let (name, _) = read(&session).unwrap();
    session.edit_scene(SceneCommand::GiveUpReading(name), &state);
    assert_eq!(read(&session), None);
    for _ in 0..200 {
        step(&mut session, &state);
    }
    assert_eq!(things(&session), 1);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
}

#[test]
fn files_that_are_dropped_become_things_or_are_told_of() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let place = |name: &str| folder.path().join(name);
    let triangle = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0.05\nf 1 2 3\n";
    let good = [
        "a chair's \"best\" #1, größer.obj",
        "two.obj",
        "two.stl.obj",
    ];
    for name in good {
        std::fs::write(place(name), triangle).unwrap();
    }
    for name in ["broken.glb", "film.mp4", "other.toml", "chair.mtl"] {
        std::fs::write(place(name), "nothing of the kind").unwrap();
    }
    std::fs::create_dir(place("models")).unwrap();
    let before = std::fs::read_to_string(&path).unwrap();
    let mut session = open(&path, folder.path(), true);
    let state = WindowState::new();
    run_until(&mut session, &state, "the scene is drawn", |session| {
        session.picture().is_some() && session.is_settled()
    });
    let drop = |session: &mut LiveSession, names: &[&str]| {
        let files: Vec<PathBuf> = names.iter().map(|name| place(name)).collect();
        let mut commands = Commands::default();
        Panel::default().add_dropped(files.iter().map(PathBuf::as_path), &mut commands);
        for command in commands {
            if let LiveCommand::Scene(command) = command {
                session.edit_scene(command, &state);
            }
        }
    };
    // What is none is told at once, or when it is read, and changes nothing.
    for (name, said) in [
        ("film.mp4", "is a video, no model"),
        ("other.toml", "a scene is opened with gnomon live"),
        ("chair.mtl", "belongs to a model"),
        ("models", "is a folder"),
        ("broken.glb", "broken.glb"),
        ("gone.obj", "gone.obj"),
    ] {
        drop(&mut session, &[name]);
        run_until(&mut session, &state, name, |session| {
            let shown = session.notices.shown(session.now_secs());
            shown
                .iter()
                .any(|(_, text)| text.contains(said) && text.contains(name))
        });
        assert_eq!(std::fs::read_to_string(&path).unwrap(), before, "{name}");
    }
    // Several at once, whatever they are called.
    drop(&mut session, &good);
    run_until(&mut session, &state, "all are there", |session| {
        session.scene().unwrap().virtuals.len() == 1 + good.len()
    });
    let written = Scene::load(&path).unwrap();
    let names: Vec<&str> = written.virtuals.iter().map(|it| it.name.as_str()).collect();
    for name in ["a chair_s _best_ #1_ größer", "two", "two.stl"] {
        assert!(names.contains(&name), "{names:?}");
    }
    let text = std::fs::read_to_string(&path).unwrap();
    for comment in before.lines().filter_map(|line| line.split_once('#')) {
        assert!(text.contains(comment.1), "{}", comment.1);
    }
    for _ in good {
        session.edit_scene(SceneCommand::Undo, &state);
    }
    assert_eq!(std::fs::read_to_string(&path).unwrap(), before);
}

#[test]
fn a_saved_scene_wakes_the_window_and_shows_at_once_and_a_mistake_keeps_the_last() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let (to_window, wakes) = channel();
    let wake = Arc::new(move || _ = to_window.send(()));
    let mut session = open_waking(&path, folder.path(), false, wake);
    let state = WindowState::new();
    run_until(&mut session, &state, "the end", has_ended);
    let before = session.scene().unwrap().clone();
    let text = std::fs::read_to_string(&path).unwrap();

    std::fs::write(
        &path,
        text.replace("[-0.26, 0.24, 0.46]", "[0.3, 0.1, 0.4]"),
    )
    .unwrap();
    let is_taken = |session: &LiveSession| {
        let light = session.scene().unwrap().lights[0];
        matches!(light.light, Light::Point { position_m, .. } if position_m.x == 0.3)
    };
    // No frame comes any more, and the window looks at nothing unless it is woken.
    while !is_taken(&session) {
        let woken = wakes.recv_timeout(SOON);
        woken.expect("the saved file wakes the window");
        step(&mut session, &state);
    }
    // The step that took the file drew it, whatever renderer has yet to come.
    let after = session.scene().unwrap().clone();
    let picture = shown(&session);
    let [off_before, off_after] =
        [&before, &after].map(|scene| count_off(&picture, &drawn_afresh(&session, scene)));
    eprintln!("{off_after} bytes off the saved scene, {off_before} off the one before");
    assert!(off_after * 10 < off_before);

    std::fs::write(
        &path,
        text.replace("samples", "sample")
            .replace("kind = ", "kinnd = "),
    )
    .unwrap();
    run_until(&mut session, &state, "the mistake is told", |session| {
        session.notices.scene.is_some()
    });
    let told = session.notices.scene.clone().unwrap();
    let line = text
        .lines()
        .position(|line| line.starts_with("kind = "))
        .unwrap()
        + 1;
    assert!(told.contains(&format!("lamp.toml:{line}:")), "{told}");
    assert!(is_taken(&session), "the last good scene stays");

    std::fs::write(&path, &text).unwrap();
    run_until(&mut session, &state, "the mistake is mended", |session| {
        session.notices.scene.is_none()
    });
}

#[test]
fn what_is_recorded_is_what_came() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let out = folder.path().join("recorded");
    let mut session = open(&path, &out, false);
    let state = WindowState::new();
    run_until(&mut session, &state, "a picture", |session| {
        session.picture().is_some()
    });
    session.record(RecordingCommand::ToggleSession);
    session.record(RecordingCommand::ToggleVideo);
    assert_eq!(session.records(), [true, true]);
    session.record(RecordingCommand::Screenshot);
    let picture = image::open(out.join("picture-001.png")).unwrap().to_rgba8();
    assert_eq!(picture.as_raw(), &shown(&session));
    run_until(&mut session, &state, "the recording's end", |session| {
        !session.is_live()
    });
    for said in session.finish() {
        said.unwrap();
    }
    let mut lamp = FrameSource::open(project_file("recordings/lamp").to_str().unwrap()).unwrap();
    let mut session = FrameSource::open(out.join("session-001").to_str().unwrap()).unwrap();
    let mut frames = 0;
    while let Some(frame) = session.next_frame().unwrap() {
        let same = std::iter::from_fn(|| lamp.next_frame().unwrap())
            .find(|recorded| recorded.rgba == frame.rgba);
        assert!(same.is_some(), "frame {} of the session", frame.index);
        frames += 1;
    }
    assert!(frames > 30, "{frames} frames");
    assert!(out.join("session-001/poses.csv").is_file());
    let mut video = FrameSource::open(out.join("composite-001.mkv").to_str().unwrap()).unwrap();
    let mut seconds = 0.0;
    while let Some(frame) = video.next_frame().unwrap() {
        seconds = frame.time_secs;
    }
    assert!(
        (1.0..4.1).contains(&seconds),
        "as long as it was recorded: {seconds}"
    );
}

/// The device is destroyed under the session, as a driver that is reset takes it away.
#[test]
fn a_device_that_is_lost_is_replaced_and_recordings_go_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let out = folder.path().join("recorded");
    let gpu = || Arc::new(Gpu::open(None).unwrap());
    let (first, now) = (gpu(), Arc::new(Stopwatch::clock()));
    let opening = Opening::scene(&path).unwrap();
    let timing = (now as _, Arc::new(|| ()) as _);
    let mut session = LiveSession::open(opening, Arc::clone(&first), &out, true, timing);
    let state = WindowState::new();
    let is_shown = |session: &LiveSession| session.picture().is_some() && session.is_settled();
    run_until(&mut session, &state, "a picture", is_shown);
    session.record(RecordingCommand::ToggleSession);
    session.record(RecordingCommand::ToggleVideo);
    first.shared().device.destroy();
    let began = Instant::now();
    let error = loop {
        assert!(began.elapsed() < SOON, "nobody notices");
        let shown = session.was_shown(session.now_secs());
        if let Err(error) = shown.and_then(|()| session.step(&state).map(drop)) {
            break error;
        }
    };
    let failed = error.downcast_ref::<RenderError>();
    assert!(failed.is_some_and(RenderError::ends_a_device), "{error:#}");
    assert_eq!(session.records(), [true, true]);
    session.renew(gpu());
    let lost_at = session.picture().map_or(0, |picture| picture.frame.index);
    run_until(&mut session, &state, "many pictures more", |session| {
        let index = session.picture().map(|picture| picture.frame.index);
        session.is_settled() && index > Some(lost_at + 90)
    });
    let scene = session.scene().unwrap().clone();
    let exact = drawn_afresh(&session, &scene);
    assert!(count_off(&shown(&session), &exact) < 20);
    for said in session.finish() {
        said.unwrap();
    }
    for recorded in ["session-001", "composite-001.mkv"] {
        let recorded = out.join(recorded);
        let mut frames = FrameSource::open(recorded.to_str().unwrap()).unwrap();
        while frames.next_frame().unwrap().is_some() {}
        assert_eq!(frames.notices(), [], "{}", recorded.display());
        let count = frames.good_frames();
        assert!(count > 20, "{count} frames in {}", recorded.display());
    }
}

#[test]
fn first_use_puts_something_on_a_marker_and_saves_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let camera = CameraSettings {
        source: project_file("recordings/lamp").to_str().unwrap().to_owned(),
        ..CameraSettings::default()
    };
    let opening = Opening::camera(camera).unwrap();
    let now = Arc::new(Stopwatch::clock());
    let clock = (now as _, Arc::new(|| ()) as _);
    let mut session = LiveSession::open(opening, gpu(), folder.path(), true, clock);
    let state = WindowState::new();
    let sees = |session: &LiveSession| {
        let seen = session.picture().map(|picture| &picture.detections);
        seen.is_some_and(|seen| seen.iter().any(|marker| marker.id == 4))
    };
    run_until(&mut session, &state, "markers are seen", sees);
    assert!(session.scene().is_none());
    let nothing = Scene::default();
    assert!(
        shown(&session) == drawn_afresh(&session, &nothing),
        "the video alone"
    );

    let (id, size_m) = (4, 0.044);
    session.edit_scene(SceneCommand::Demonstrate { id, size_m }, &state);
    let is_there = |session: &LiveSession| {
        let pose = session.picture().and_then(|p| p.poses.first());
        session.is_settled() && pose.is_some_and(|pose| pose.camera_from_anchor.is_some())
    };
    run_until(&mut session, &state, "the marker is tracked", is_there);
    assert!(session.is_unsaved());
    // Whoever ends the program by force finds it again.
    let kept = session.keep_unsaved().expect("a scene that is kept");
    let scene = session.scene().unwrap().clone();
    assert!(shown(&session) == drawn_afresh(&session, &scene));
    let (renderer, ..) = session.renderer().unwrap();
    let with_it = renderer.read_picture().unwrap();
    let video = &session.picture().unwrap().frame.rgba;
    let red = with_it
        .chunks(4)
        .zip(video.chunks(4))
        .filter(|(pixel, before)| pixel != before && pixel[0] > 2 * pixel[1])
        .count();
    assert!(red > 200, "a red torus is seen: {red} pixels");

    let taken = folder.path().join("taken.toml");
    std::fs::write(&taken, "mine").unwrap();
    session.edit_scene(SceneCommand::Save(taken), &state);
    assert!(session.is_unsaved());
    let told = session.notices.shown(session.now_secs());
    let is_told = |text: &str| text.contains("taken.toml: a file of that name is there already");
    assert!(told.iter().any(|(_, text)| is_told(text)), "{told:?}");

    let saved = folder.path().join("mine.toml");
    session.edit_scene(SceneCommand::Save(saved.clone()), &state);
    assert!(!session.is_unsaved());
    assert_eq!(session.title(), "mine.toml");
    assert!(Scene::load(&kept).is_ok(), "{}", kept.display());
    std::fs::remove_dir_all(kept.parent().unwrap()).unwrap();
    assert_eq!(Scene::load(&saved).unwrap().anchors[0].markers[0].id, 4);
    assert!(folder.path().join("torus.obj").is_file());
}

#[test]
fn a_light_is_found_by_clicks_on_corners_and_their_shadows() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let text = std::fs::read_to_string(&path).unwrap();
    // Nobody knows yet where the lamp is.
    let true_m = DVec3::new(-0.26, 0.24, 0.46);
    std::fs::write(
        &path,
        text.replace("[-0.26, 0.24, 0.46]", "[0.4, -0.1, 0.3]"),
    )
    .unwrap();
    let mut session = open(&path, folder.path(), true);
    let mut state = WindowState::new();
    let is_tracked = |session: &LiveSession| {
        let pose = session.picture().and_then(|picture| picture.poses.first());
        pose.is_some_and(|pose| pose.camera_from_anchor.is_some())
    };
    run_until(&mut session, &state, "the world is seen", is_tracked);
    state.holds = true;
    let frame = session.picture().unwrap().frame.index;
    session.edit_scene(SceneCommand::Clicks(Clicks::Begin), &state);
    let picture = session.picture().unwrap().clone();
    let sight = PosedCamera {
        intrinsics: picture.intrinsics,
        camera_from_world: picture.poses[0].camera_from_anchor.unwrap(),
    };
    // What a person sees: corners high up on the house, and where their shadows fall on the table.
    let house = &session.scene().unwrap().phantoms;
    let house = house
        .iter()
        .find(|phantom| phantom.name == "house")
        .unwrap();
    let mut corners: Vec<DVec3> = house
        .mesh
        .positions
        .iter()
        .map(|p| house.anchor_from_object.transform_point3(p.as_dvec3()))
        .collect();
    corners.sort_by(|a, b| b.z.total_cmp(&a.z));
    for corner_m in &corners[..2] {
        let away = corner_m - true_m;
        let shadow_m = corner_m - away * (corner_m.z / away.z);
        for (clicked_m, off_px) in [(*corner_m, 2.0), (shadow_m, -1.0)] {
            let pixel = sight.pixel(clicked_m).unwrap() + off_px;
            session.edit_scene(SceneCommand::Clicks(Clicks::At(pixel)), &state);
        }
    }
    assert_eq!(session.clicks().unwrap().pairs_px().len(), 2);
    for _ in 0..20 {
        step(&mut session, &state);
    }
    assert_eq!(session.picture().unwrap().frame.index, frame, "it is held");
    session.edit_scene(
        SceneCommand::Clicks(Clicks::Find(LightFreedom::Point)),
        &state,
    );
    assert!(session.clicks().is_none(), "{:?}", session.notices);
    let written = Scene::load(&path).unwrap();
    let Light::Point { position_m, .. } = written.lights[0].light else {
        panic!("a lamp");
    };
    let off_m = position_m.distance(true_m);
    assert!(off_m < 0.03, "{position_m} is {off_m} m off");
}

#[test]
fn every_view_shows_something_else_and_leads_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    let mut session = open(&path, folder.path(), false);
    let mut state = WindowState::new();
    run_until(&mut session, &state, "the end", has_ended);
    step(&mut session, &state);
    let composite = shown(&session);
    let mut pictures: Vec<(ViewMode, Vec<u8>)> = Vec::new();
    for (name, view) in ViewMode::BY_NAME {
        state.view = view;
        step(&mut session, &state);
        let picture = shown(&session);
        // Lines over the composite are the window's.
        let is_composite = matches!(
            view,
            ViewMode::Composite | ViewMode::Silhouettes | ViewMode::Volumes
        );
        assert_eq!(picture == composite, is_composite, "{name}");
        if !is_composite {
            for (other, before) in &pictures {
                assert!(picture != *before, "{name} and {other:?}");
            }
            pictures.push((view, picture));
        }
    }
    state.view = ViewMode::Composite;
    step(&mut session, &state);
    assert!(shown(&session) == composite, "back again");
}

#[test]
fn it_ends_at_once_whatever_it_is_at() {
    let folder = tempfile::tempdir().unwrap();
    let path = lamp_in(folder.path());
    for steps in [0, 1, 40] {
        let mut session = open(&path, folder.path(), true);
        let state = WindowState::new();
        for _ in 0..steps {
            step(&mut session, &state);
        }
        let began = Instant::now();
        drop(session);
        let took = began.elapsed();
        assert!(
            took < Duration::from_secs(10),
            "after {steps} steps: {took:?}"
        );
    }
}
