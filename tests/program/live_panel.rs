//! The panel of the live window, driven as a person does: what is clicked and dragged becomes what is asked for.

use std::path::Path;
use std::sync::mpsc::channel;

use eframe::egui::accesskit::Role;
use egui_kittest::Harness;
use egui_kittest::kittest::Queryable as _;
use gnomon::app::authoring::{Edit, ThingPlace};
use gnomon::app::live::adding::{WantedShape, WantedThing};
use gnomon::app::live::command::{
    Clicks, ClosingAnswer, Commands, LiveCommand, Overlay, RecordingCommand, SceneCommand,
    Selected, WindowCommand,
};
use gnomon::app::live::meters::Meters;
use gnomon::app::live::panel::{DialogEnd, Facts, Panel};
use gnomon::app::live::views::ViewMode;
use gnomon::app::live::window_state::WindowState;
use gnomon::light::Light;
use gnomon::scene::{LoadStage, Placement, Scene, Shortcut};

/// A panel on a scene, and all that was asked for.
struct Desk {
    panel: Panel,
    scene: Option<Scene>,
    state: WindowState,
    commands: Vec<LiveCommand>,
    reading: Vec<(&'static str, LoadStage)>,
}

fn desk(scene: Option<Scene>, selected: Option<Selected>) -> Harness<'static, Desk> {
    let state = WindowState {
        selected,
        ..WindowState::new()
    };
    let desk = Desk {
        panel: Panel::default(),
        scene,
        state,
        commands: Vec::new(),
        reading: Vec::new(),
    };
    Harness::builder()
        .with_size([330.0, 1400.0])
        .build_ui_state(
            |ui, desk: &mut Desk| {
                let meters = Meters::default();
                let facts = Facts {
                    scene: desk.scene.as_ref(),
                    path: None,
                    unsaved: false,
                    place: &|thing| {
                        Some(match thing {
                            "table" => ThingPlace::TableTop { height_m: -0.0005 },
                            _ => ThingPlace::Free(Placement::default()),
                        })
                    },
                    history: [Some("place \"torus\""), None],
                    picture: None,
                    meters: &meters,
                    now_secs: 0.0,
                    frames: (0, [0; 3]),
                    camera: "a camera",
                    adapter: "an adapter",
                    records: [false, true],
                    reading: desk.reading.clone(),
                    clicks: None,
                };
                let commands = desk.panel.show(ui, &facts, &desk.state);
                desk.commands.extend(commands);
            },
            desk,
        )
}

fn lamp() -> Scene {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/lamp.toml");
    Scene::load(&path).expect("the demo's scene")
}

/// Clicks on what has this label: what is asked for then.
fn clicked(harness: &mut Harness<'_, Desk>, label: &str) -> Vec<LiveCommand> {
    harness.run();
    harness.state_mut().commands.clear();
    // A field that is named by a button has the same label.
    let button = harness.query_by_role_and_label(Role::Button, label);
    button
        .unwrap_or_else(|| harness.get_by_label(label))
        .click();
    harness.run();
    std::mem::take(&mut harness.state_mut().commands)
}

#[test]
fn buttons_ask_for_what_they_say() {
    let mut harness = desk(Some(lamp()), None);
    assert_eq!(
        clicked(&mut harness, "Picture"),
        [LiveCommand::Recording(RecordingCommand::Screenshot)]
    );
    assert_eq!(
        clicked(&mut harness, "Record session"),
        [LiveCommand::Recording(RecordingCommand::ToggleSession)]
    );
    assert_eq!(
        clicked(&mut harness, "End video"),
        [LiveCommand::Recording(RecordingCommand::ToggleVideo)]
    );
    assert_eq!(
        clicked(&mut harness, "Undo: place \"torus\""),
        [LiveCommand::Scene(SceneCommand::Undo)]
    );
    assert_eq!(
        clicked(&mut harness, "Redo"),
        [],
        "there is nothing to redo"
    );
    let select = |selected| [LiveCommand::Window(WindowCommand::Select(Some(selected)))];
    assert_eq!(
        clicked(&mut harness, "torus"),
        select(Selected::Thing("torus".to_owned()))
    );
    assert_eq!(
        clicked(&mut harness, "table"),
        select(Selected::Thing("table".to_owned()))
    );
    assert_eq!(
        clicked(&mut harness, "light 0 (point)"),
        select(Selected::Light(0))
    );
    assert_eq!(
        clicked(&mut harness, "Find the light in the picture"),
        [LiveCommand::Scene(SceneCommand::Clicks(Clicks::Begin))]
    );
    assert_eq!(
        clicked(&mut harness, "remove"),
        [LiveCommand::Scene(SceneCommand::Commit(Edit::RemoveLight(
            0
        )))]
    );
}

#[test]
fn views_and_overlays_are_behind_their_heading() {
    let mut harness = desk(Some(lamp()), None);
    assert_eq!(clicked(&mut harness, "View"), []);
    assert_eq!(
        clicked(&mut harness, "depth"),
        [LiveCommand::Window(WindowCommand::Show(ViewMode::Depth))]
    );
    assert_eq!(
        clicked(&mut harness, "composite"),
        [],
        "that is shown already"
    );
    assert_eq!(
        clicked(&mut harness, "marker outlines"),
        [LiveCommand::Window(WindowCommand::Toggle(
            Overlay::Outlines
        ))]
    );
}

#[test]
fn the_knobs_of_the_technique_are_edits() {
    let mut harness = desk(Some(lamp()), None);
    assert_eq!(clicked(&mut harness, "Shadows"), []);
    let commands = clicked(&mut harness, "1");
    let [LiveCommand::Scene(SceneCommand::Commit(Edit::Shadows(change)))] = commands[..] else {
        panic!("{commands:?}");
    };
    let shadows = change.made_in(lamp().shadows);
    assert_eq!(shadows.samples, 1);
    assert_eq!(shadows.technique, lamp().shadows.technique);
}

#[test]
fn a_dragged_field_is_shown_while_it_is_held_and_made_when_it_is_let_go() {
    let mut harness = desk(Some(lamp()), Some(Selected::Light(0)));
    harness.run();
    // The first number of the light's place.
    let field = harness.get_by_value("x -0.260").rect().center();
    harness.drag_at(field);
    harness.step();
    for moved in 1..=4 {
        harness.hover_at(field + eframe::egui::Vec2::new(10.0 * moved as f32, 0.0));
        harness.step();
    }
    let held = std::mem::take(&mut harness.state_mut().commands);
    assert!(!held.is_empty(), "it is shown while it is dragged");
    for command in &held {
        let LiveCommand::Scene(SceneCommand::Preview(Edit::Light { index: 0, light })) = command
        else {
            panic!("{command:?}");
        };
        let Light::Point { position_m, .. } = light else {
            panic!("{light:?}");
        };
        assert!(position_m.x > -0.26, "to the right is more");
    }
    harness.drop_at(field + eframe::egui::Vec2::new(40.0, 0.0));
    harness.run();
    let made = std::mem::take(&mut harness.state_mut().commands);
    assert!(
        matches!(
            made[..],
            [LiveCommand::Scene(SceneCommand::Commit(Edit::Light {
                index: 0,
                ..
            }))]
        ),
        "{made:?}"
    );
}

#[test]
fn without_a_scene_it_asks_for_a_marker() {
    let mut harness = desk(None, None);
    harness.run();
    assert!(harness.query_by_label("First use").is_some());
    assert!(
        harness.query_by_label_contains("gnomon markers").is_some(),
        "how to print one"
    );
    assert!(harness.query_by_label("Lights").is_none());
}

#[test]
fn shortcuts_are_switched_where_volumes_are_looked_at() {
    let mut harness = desk(Some(lamp()), None);
    _ = clicked(&mut harness, "View");
    assert!(harness.query_by_label("scissors").is_none());
    harness.state_mut().state.view = ViewMode::Volumes;
    harness.run();
    assert_eq!(
        clicked(&mut harness, "scissors"),
        [LiveCommand::Window(WindowCommand::ToggleShortcut(
            Shortcut::Scissors
        ))]
    );
}

#[test]
fn a_model_that_is_read_is_shown_and_can_be_stopped() {
    let mut harness = desk(Some(lamp()), None);
    harness.state_mut().reading = vec![("chair", LoadStage::Unpacking)];
    // (The bar moves on by itself for as long as it is there.)
    harness.run_steps(2);
    harness.get_by_label_contains("chair unpacks triangles and pictures");
    harness.state_mut().commands.clear();
    harness.get_by_label("stop").click();
    harness.run_steps(2);
    let stop = SceneCommand::GiveUpReading("chair".to_owned());
    assert_eq!(harness.state().commands, [LiveCommand::Scene(stop)]);
}

fn added(path: &str) -> LiveCommand {
    LiveCommand::Scene(SceneCommand::Add(WantedThing {
        is_real: false,
        shape: WantedShape::Model(path.into()),
        on: None,
    }))
}

#[test]
fn what_the_system_s_dialog_gives_is_asked_for_once() {
    let mut harness = desk(Some(lamp()), None);
    let (giver, chosen) = channel();
    harness.state_mut().panel.await_dialog(chosen);
    harness.run();
    assert_eq!(harness.state().commands, []);
    let file = "/models/a chair's.glb".into();
    giver.send(DialogEnd::Chosen(file)).unwrap();
    harness.run();
    harness.run();
    assert_eq!(harness.state().commands, [added("/models/a chair's.glb")]);
    // One that is closed without a file, and one that has come to grief.
    harness.state_mut().commands.clear();
    for answer in [Some(DialogEnd::Cancelled), None] {
        let (giver, chosen) = channel();
        harness.state_mut().panel.await_dialog(chosen);
        if let Some(answer) = answer {
            giver.send(answer).unwrap();
        }
        drop(giver);
        harness.run();
    }
    assert_eq!(harness.state().commands, []);
}

#[test]
fn where_there_is_no_dialog_it_is_said_and_a_name_stays_until_it_is_there() {
    let mut harness = desk(Some(lamp()), None);
    _ = clicked(&mut harness, "Add …");
    let (giver, ended) = channel();
    harness.state_mut().panel.await_dialog(ended);
    giver.send(DialogEnd::NoDialog).unwrap();
    harness.run();
    harness.run();
    harness.get_by_label_contains("There is no file dialog here");
    let fields = harness.query_all_by_role(Role::TextInput);
    let field = fields.last().expect("the field for a file's name");
    field.focus();
    field.type_text("chair.obj");
    harness.run();
    harness.key_press(eframe::egui::Key::Enter);
    harness.run();
    let asked = std::mem::take(&mut harness.state_mut().commands);
    assert_eq!(asked, [added("chair.obj")]);
    assert!(harness.query_all_by_value("chair.obj").count() > 0);
    let scene = harness.state_mut().scene.as_mut().expect("a scene");
    let chair = scene.virtuals[0].clone();
    scene.virtuals.push(chair);
    harness.run();
    assert_eq!(harness.query_all_by_value("chair.obj").count(), 0);
}

#[test]
fn the_table_s_top_has_what_can_be_done_with_it() {
    let table = Selected::Thing("table".to_owned());
    let mut harness = desk(Some(lamp()), Some(table));
    harness.run();
    for there in ["height", "albedo"] {
        assert!(harness.query_all_by_label(there).count() > 0, "{there}");
    }
    for absent in ["duplicate", "scale", "turned", "metallic"] {
        assert_eq!(harness.query_all_by_label(absent).count(), 0, "{absent}");
    }
}

#[test]
fn long_names_leave_the_picture_its_place() {
    let mut scene = lamp();
    let name = "a name of very many letters ".repeat(4);
    scene.virtuals[0].name.clone_from(&name);
    let mut harness = desk(Some(scene), None);
    harness.state_mut().reading = vec![("an endless wheel of a wagon", LoadStage::Unpacking)];
    harness.run_steps(3);
    harness.get_by_label_contains("unpacks triangles and pictures");
    // (Its box to tick has the same label.)
    for shown in harness.query_all_by_label_contains("a name of very") {
        assert!(shown.rect().right() < 330.0, "{:?}", shown.rect());
    }
}

/// What is asked before the window closes on a scene that is not saved.
fn closing_desk() -> Harness<'static, (Panel, Vec<LiveCommand>)> {
    Harness::builder().with_size([600.0, 400.0]).build_ui_state(
        |ui, (panel, commands): &mut (Panel, Vec<LiveCommand>)| {
            commands.extend(panel.ask_before_closing(ui.ctx()));
        },
        (Panel::default(), Vec::new()),
    )
}

#[test]
fn a_scene_that_is_not_saved_is_asked_for_before_the_window_closes() {
    for (label, answer) in [
        ("Save", ClosingAnswer::Save("scene.toml".into())),
        ("Discard it and close", ClosingAnswer::Discard),
        ("Stay", ClosingAnswer::Stay),
    ] {
        let mut harness = closing_desk();
        harness.run();
        assert!(harness.query_by_label("This scene is not saved").is_some());
        assert_eq!(harness.state().1, []);
        harness.get_by_role_and_label(Role::Button, label).click();
        harness.run();
        assert_eq!(harness.state().1, [LiveCommand::Close(answer)], "{label}");
    }
    let mut harness = closing_desk();
    harness.run();
    harness.key_press(eframe::egui::Key::Escape);
    harness.run();
    let stays = LiveCommand::Close(ClosingAnswer::Stay);
    assert_eq!(harness.state().1, [stays]);
}

#[test]
fn each_file_that_is_dropped_is_asked_for() {
    let mut commands = Commands::default();
    let files = ["/a/duck.glb", "", "/a/b c/x.obj"].map(Path::new);
    Panel::default().add_dropped(files, &mut commands);
    let commands: Vec<LiveCommand> = commands.into_iter().collect();
    assert_eq!(commands, [added("/a/duck.glb"), added("/a/b c/x.obj")]);
}
