//! Edits of a scene against an account of them in memory, and a scene's files as editors change them.

use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::Duration;

use crate::common::random::Random;
use glam::DVec3;
use gnomon::app::authoring::{
    Edit, EditError, NewForm, NewThing, SceneDocument, SceneNews, SceneWatch, ThingPlace,
};
use gnomon::app::stopwatch::Stopwatch;
use gnomon::app::truth::{draw, key_frames};
use gnomon::light::{Light, Shape};
use gnomon::render::Renderer;
use gnomon::scene::{
    Difference, Object, Placement, Quality, Scene, ShadowChange, ShadowSettings, ShaftSettings,
    Shortcuts, Technique, VolumeCounting,
};

/// What is promised for the time from a saved file to its scene.
const PROMISED_MS: f64 = 500.0;

/// A copy of the demo's scene with its meshes; its recording is only named.
struct Project(tempfile::TempDir);

impl Project {
    fn new() -> Self {
        Self::with(|text| text)
    }

    fn with(change: impl FnOnce(String) -> String) -> Self {
        let folder = tempfile::tempdir().expect("a project of its own");
        fs::create_dir_all(folder.path().join("models")).expect("a project of its own");
        for mesh in ["house", "tin", "torus", "block"] {
            let place = format!("models/{mesh}.obj");
            fs::copy(
                crate::common::project_file(&place),
                folder.path().join(&place),
            )
            .expect("a project of its own");
        }
        let text = fs::read_to_string(crate::common::project_file("config/lamp.toml"))
            .expect("a project of its own");
        // What is edited here stands as in most scenes.
        let is_kept = |line: &&str| !line.starts_with("bounces = ");
        let text: String = text.split_inclusive('\n').filter(is_kept).collect();
        let text = text.replace("\"recordings/lamp\"", "\"webcam:0\"");
        fs::write(folder.path().join("scene.toml"), change(text)).expect("a project of its own");
        Self(folder)
    }

    fn file(&self) -> PathBuf {
        self.0.path().join("scene.toml")
    }

    fn text(&self) -> String {
        fs::read_to_string(self.file()).expect("a project of its own")
    }

    fn open(&self) -> SceneDocument {
        SceneDocument::open(&self.file()).expect("a project of its own")
    }
}

/// An edit puts `new` in the place of `old` in the file, and nothing else; its undoing brings the file back.
fn assert_changed_to(
    project: &Project,
    document: &mut SceneDocument,
    edit: &Edit,
    old: &str,
    new: &str,
) {
    let before = project.text();
    document.commit(edit).unwrap();
    assert!(before.contains(old), "{old}");
    assert_eq!(project.text(), before.replace(old, new), "{edit:?}");
    document.undo().unwrap();
    assert_eq!(project.text(), before);
}

fn torus_at(position_m: DVec3, old: Placement) -> Edit {
    Edit::Place {
        thing: "torus".to_owned(),
        placement: Placement { position_m, ..old },
    }
}

fn moved_torus(document: &SceneDocument, x_m: f64) -> Edit {
    let old = document.place("torus").expect("the torus").placement();
    torus_at(DVec3::new(x_m, old.position_m.y, old.position_m.z), old)
}

mod edits {
    use super::*;

    #[test]
    fn a_moved_thing_changes_its_numbers_alone() {
        let project = Project::new();
        let before = project.text();
        let mut document = project.open();
        let old = document.place("torus").expect("the torus").placement();
        assert_eq!(old.rotation_deg, DVec3::new(70.0, 0.0, 35.0));
        document
            .commit(&torus_at(DVec3::new(0.031_26, 0.0, 0.036), old))
            .unwrap();
        let expected = before.replace("[0.022, 0.0, 0.036]", "[0.0313, 0.0, 0.036]");
        assert_ne!(expected, before);
        assert_eq!(project.text(), expected);
        let torus = &document.scene().virtuals[0];
        assert_eq!(torus.anchor_from_object.translation.x, 0.0313);
    }

    #[test]
    fn things_of_shapes_are_edited_as_those_of_meshes() {
        let shapes = "\n[[phantom]]\nname = \"book\"   # the blue one\nbox_m = [0.15, 0.21, 0.03]  # lies flat\n\
             position_m = [0.1, 0.0, 0.0]\n\n[[virtual]]\nname = \"bottle\"\n# as drawn on paper\nrevolved = { profile_m = [\n    \
             [0.0, 0.0], # the bottom\n    [0.03, 0.0],\n    [0.03, 0.1],\n    [0.01, 0.15],\n] }\n\
             path = [{ time_s = 0 }, { time_s = 1, position_m = [0.1, 0, 0] }] # to the right\n";
        let project = Project::with(|text| text + shapes);
        let before = project.text();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let placed = |thing: &str, x_m: f64, scale: f64| Edit::Place {
            thing: thing.to_owned(),
            placement: Placement {
                position_m: DVec3::X * x_m,
                scale: DVec3::splat(scale),
                ..Placement::default()
            },
        };
        let lies = "position_m = [0.1, 0.0, 0.0]\n";
        changed_to(
            &placed("book", 0.12, 1.0),
            lies,
            "position_m = [0.12, 0.0, 0.0]\n",
        );
        let to_the_right = "# to the right\n";
        changed_to(
            &placed("bottle", 0.05, 2.0),
            to_the_right,
            &format!("{to_the_right}position_m = [0.05, 0.0, 0.0]\nscale = [2.0, 2.0, 2.0]\n"),
        );
        let hidden = Edit::Show {
            thing: "bottle".to_owned(),
            visible: false,
        };
        changed_to(
            &hidden,
            to_the_right,
            &format!("{to_the_right}visible = false\n"),
        );
        let bottle = &before[before.find("\n[[virtual]]\nname = \"bottle\"").unwrap()..];
        changed_to(&Edit::RemoveThing("bottle".to_owned()), bottle, "");
        // What another editor makes of the shape meanwhile is kept, and a place that it gave wins.
        let cube = before.replace("[0.15, 0.21, 0.03]", "[0.1, 0.1, 0.1]");
        fs::write(project.file(), &cube).unwrap();
        let mut document = project.open();
        document.commit(&placed("book", 0.12, 1.0)).unwrap();
        assert_eq!(
            project.text(),
            cube.replace(lies, "position_m = [0.12, 0.0, 0.0]\n")
        );
        let book = document
            .scene()
            .phantoms
            .iter()
            .find(|thing| thing.name == "book");
        assert_eq!(book.unwrap().mesh.positions[7].z, 0.1);
    }

    #[test]
    fn what_is_hidden_is_written_as_a_person_would() {
        let project = Project::new();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let hidden = Edit::Show {
            thing: "tin".to_owned(),
            visible: false,
        };
        let tin = "material = { albedo = [0.25, 0.42, 0.6] }\n";
        changed_to(&hidden, tin, &format!("{tin}visible = false\n"));
        let hidden = Edit::Show {
            thing: "table".to_owned(),
            visible: false,
        };
        let mean = "# the mean of its wood\n";
        changed_to(&hidden, mean, &format!("{mean}visible = false\n"));
    }

    #[test]
    fn lights_are_written_as_a_person_would() {
        let project = Project::new();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let ambient = Edit::Ambient(DVec3::new(0.1, 0.2, 0.130_02));
        changed_to(
            &ambient,
            "radiance = [0.1, 0.11, 0.13]",
            "radiance = [0.1, 0.2, 0.13]",
        );
        let sun = Light::Directional {
            direction: DVec3::new(0.6, 0.0, -0.8),
            irradiance: DVec3::new(0.5, 0.5, 0.25),
            angle_rad: 0.0,
        };
        changed_to(
            &Edit::Light {
                index: 0,
                light: sun,
            },
            "kind = \"point\"\nposition_m = [-0.26, 0.24, 0.46]\nintensity = [1.15, 1.06, 0.9]",
            "kind = \"directional\"\ndirection = [0.6, 0.0, -0.8]\nirradiance = [0.5, 0.5, 0.25]",
        );
        let end = "intensity = [1.15, 1.06, 0.9]\n";
        changed_to(
            &Edit::AddLight(sun),
            end,
            &format!(
                "{end}\n[[light]]\nkind = \"directional\"\ndirection = [0.6, 0.0, -0.8]\nirradiance = [0.5, 0.5, 0.25]\n"
            ),
        );
        changed_to(
            &Edit::RemoveLight(0),
            "[[light]]\nkind = \"point\"\nposition_m = [-0.26, 0.24, 0.46]\nintensity = [1.15, 1.06, 0.9]\n\n",
            "",
        );
    }

    #[test]
    fn settings_of_shadows_are_written_as_a_person_would() {
        let project = Project::new();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let settings = ShadowSettings {
            samples: 1,
            counting: VolumeCounting::DepthFail,
            frame_budget_ms: Some(16.0),
            ..ShadowSettings::default()
        };
        let end = "radiance = [0.1, 0.11, 0.13]\n";
        changed_to(
            &Edit::Shadows(ShadowChange {
                from: ShadowSettings::default(),
                to: settings,
            }),
            end,
            &format!(
                "{end}\n[shadows]\nsamples = 1\ncounting = \"depth-fail\"\nframe_budget_ms = 16.0\n"
            ),
        );
    }

    #[test]
    fn a_new_thing_is_written_as_a_person_would() {
        let project = Project::new();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let block = NewThing {
            is_real: false,
            name: "block".to_owned(),
            form: NewForm::Mesh {
                file: "models/block.obj".to_owned(),
                fit_m: None,
            },
            on: "table".to_owned(),
            placement: Placement {
                position_m: DVec3::new(0.05, 0.0, 0.0),
                ..Placement::default()
            },
        };
        let end = "material = { albedo = [0.75, 0.16, 0.12] }\n";
        changed_to(
            &Edit::AddThing(block),
            end,
            &format!(
                "{end}\n[[virtual]]\nname = \"block\"\nmesh = \"models/block.obj\"\nposition_m = [0.05, 0.0, 0.0]\n"
            ),
        );
    }

    /// The demo's scene, and a thing whose material is a table of its own.
    fn project_with_a_cup() -> Project {
        Project::with(|text| {
            let dotted = "\n# Mine.\n[[virtual]] # a cup\nname = \"cup\"\ncylinder_m = [0.04, 0.1] # 8 cm wide\n[virtual.material] # blue\nalbedo = [0.1, 0.1, 0.8]\n";
            text + dotted
        })
    }

    #[test]
    fn things_come_as_phantoms_and_are_copied_and_removed() {
        let project = project_with_a_cup();
        let before = project.text();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        let new = |is_real, name: &str, form| {
            Edit::AddThing(NewThing {
                is_real,
                name: name.to_owned(),
                form,
                on: "table".to_owned(),
                placement: Placement::default(),
            })
        };
        let house =
            &before[before.find("[[phantom]]").unwrap()..before.find("[[virtual]]").unwrap()];
        let house = house.trim_end();
        changed_to(
            &new(true, "book", NewForm::Box(DVec3::new(0.15, 0.21, 0.03))),
            house,
            &format!(
                "{house}\n\n[[phantom]]\nname = \"book\"\nbox_m = [0.15, 0.21, 0.03]\nposition_m = [0.0, 0.0, 0.0]"
            ),
        );
        let cup = &before[before.find("[[virtual]] # a cup").unwrap()..];
        let cup = cup.trim_end();
        let model = NewForm::Mesh {
            file: "models/tin.obj".to_owned(),
            fit_m: Some(0.1),
        };
        changed_to(
            &new(false, "tin of mine", model),
            cup,
            &format!(
                "{cup}\n\n[[virtual]]\nname = \"tin of mine\"\nmesh = \"models/tin.obj\"\nfit_m = 0.1\nposition_m = [0.0, 0.0, 0.0]"
            ),
        );
        changed_to(
            &Edit::Duplicate {
                thing: "cup".to_owned(),
                name: "cup 2".to_owned(),
                position_m: DVec3::X * 0.06,
            },
            cup,
            &format!(
                "{cup}\n\n[[virtual]] # a cup\nname = \"cup 2\"\ncylinder_m = [0.04, 0.1] # 8 cm wide\nposition_m = [0.06, 0.0, 0.0]\n[virtual.material] # blue\nalbedo = [0.1, 0.1, 0.8]"
            ),
        );
        changed_to(
            &Edit::RemoveThing("cup".to_owned()),
            &before[before.find("\n# Mine.").unwrap()..],
            "",
        );
    }

    #[test]
    fn things_are_renamed_and_painted() {
        let project = project_with_a_cup();
        let mut document = project.open();
        let mut changed_to = |edit: &Edit, old: &str, new: &str| {
            assert_changed_to(&project, &mut document, edit, old, new);
        };
        changed_to(
            &Edit::Rename {
                thing: "cup".to_owned(),
                name: "mug".to_owned(),
            },
            "name = \"cup\"",
            "name = \"mug\"",
        );
        let painted = |thing: &str, roughness| Edit::Material {
            thing: thing.to_owned(),
            albedo: Some(DVec3::new(0.5, 0.25, 0.125)),
            roughness,
            metallic: roughness.map(|_| 1.0),
        };
        changed_to(
            &painted("cup", Some(0.3)),
            "albedo = [0.1, 0.1, 0.8]\n",
            "albedo = [0.5, 0.25, 0.125]\nroughness = 0.3\nmetallic = 1.0\n",
        );
        changed_to(
            &painted("torus", None),
            "{ albedo = [0.75, 0.16, 0.12] }",
            "{ albedo = [0.5, 0.25, 0.125] }",
        );
    }

    #[test]
    fn what_is_copied_in_a_list_of_braces_is_another_member() {
        let project = Project::with(|text| {
            text + "\n[[marker]]\nname = \"card\"\nfamily = \"tag36h11\"\nid = 9\nsize_m = 0.04\n"
        });
        let text = project.text();
        let at = text.find("[[virtual]]").unwrap();
        let list = "virtual = [ { name = \"a\", sphere_m = 0.02 }, { name = \"b\", cone_m = [0.02, 0.05] } ] # all\n";
        let virtuals_end = text[at..].find("\n\n").map_or(text.len(), |end| at + end);
        let text = format!("{list}{}{}", &text[..at], &text[virtuals_end..]);
        fs::write(project.file(), &text).unwrap();
        let mut document = project.open();
        assert_changed_to(
            &project,
            &mut document,
            &Edit::Duplicate {
                thing: "a".to_owned(),
                name: "c".to_owned(),
                position_m: DVec3::ZERO,
            },
            "{ name = \"a\", sphere_m = 0.02 }",
            "{ name = \"a\", sphere_m = 0.02 }, { name = \"c\", sphere_m = 0.02, position_m = [0.0, 0.0, 0.0] }",
        );
    }

    #[test]
    fn a_board_is_stretched_as_a_whole() {
        let project = Project::new();
        let mut document = project.open();
        let old = document.scene().anchors[0].clone();
        document
            .commit(&Edit::AnchorSize {
                anchor: "table".to_owned(),
                size_m: 0.0429,
            })
            .unwrap();
        for (old, new) in old.markers.iter().zip(&document.scene().anchors[0].markers) {
            assert!((new.size_m - 0.0429).abs() < 1e-12);
            assert!((new.center_m() - old.center_m() * 0.975).length() < 0.8e-5);
        }
        assert!(
            project
                .text()
                .contains("{ id = 1, size_m = 0.0429, center_m = [0.0, 0.11213] },")
        );
    }

    #[test]
    fn the_table_s_top_is_lifted_and_painted_and_nothing_else() {
        let project = Project::new();
        let mut document = project.open();
        let place = document.place("table").expect("the table's top");
        assert_eq!(place, ThingPlace::TableTop { height_m: -0.0005 });
        assert!(place.placement().position_m.x.is_sign_positive());
        let painted = |albedo, roughness| Edit::Material {
            thing: "table".to_owned(),
            albedo,
            roughness,
            metallic: None,
        };
        let grey = Some(DVec3::splat(0.25));
        let [from, to] = ["[0.5, 0.335, 0.2]", "[0.25, 0.25, 0.25]"];
        assert_changed_to(&project, &mut document, &painted(grey, None), from, to);
        let before = project.text();
        for edit in [
            painted(None, Some(0.5)),
            Edit::RemoveThing("table".to_owned()),
            Edit::Rename {
                thing: "table".to_owned(),
                name: "desk".to_owned(),
            },
        ] {
            let message = document.commit(&edit).unwrap_err().to_string();
            assert!(message.contains("its height, its albedo"), "{message}");
            assert_eq!(project.text(), before);
        }
    }

    #[test]
    fn what_does_not_fit_changes_nothing() {
        let project = Project::new();
        let before = project.text();
        let mut document = project.open();
        let refused = |document: &mut SceneDocument, edit: Edit, expected: &str| {
            let message = document.commit(&edit).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
            assert_eq!(project.text(), before);
            assert_eq!(document.text(), before);
            assert_eq!(document.next_undo(), None);
        };
        let dark = Light::Point {
            position_m: DVec3::Z,
            intensity: DVec3::NEG_ONE,
            shape: Shape::Point,
        };
        refused(
            &mut document,
            Edit::AddLight(dark),
            "light.intensity = -1.0: out of range",
        );
        refused(
            &mut document,
            Edit::RemoveLight(3),
            "the scene has no light 3",
        );
        refused(
            &mut document,
            Edit::RemoveThing("shed".to_owned()),
            "no thing with the name \"shed\"",
        );
        let flat = Placement {
            rotation_deg: DVec3::X,
            ..Placement::default()
        };
        let tilted = Edit::Place {
            thing: "table".to_owned(),
            placement: flat,
        };
        refused(
            &mut document,
            tilted,
            "its height, its albedo and whether it is shown",
        );
        let same_name = NewThing {
            is_real: false,
            name: "house".to_owned(),
            form: NewForm::Sphere(0.03),
            on: "table".to_owned(),
            placement: Placement::default(),
        };
        refused(
            &mut document,
            Edit::AddThing(same_name),
            "the name is taken on line",
        );
        let mut rights = fs::metadata(project.file()).unwrap().permissions();
        rights.set_readonly(true);
        fs::set_permissions(project.file(), rights).unwrap();
        refused(&mut document, Edit::RemoveLight(0), "read-only");
    }

    /// An account of what an edit means, to the numbers of the file.
    fn expected(scene: &Scene, edit: &Edit) -> Scene {
        let mut scene = scene.clone();
        assert!(edit.show_in(&mut scene), "{edit:?}");
        scene
    }

    /// What is equal to 0.1 mm, 0.01° and four digits.
    fn assert_alike(a: &Scene, b: &Scene, what: &str) {
        assert_lights_alike(a, b, what);
        assert!(near(a.ambient_radiance, b.ambient_radiance), "{what}");
        assert_eq!(
            format!("{:?}", a.shadows),
            format!("{:?}", b.shadows),
            "{what}"
        );
        assert_anchors_alike(a, b, what);
        for (a, b) in [(&a.phantoms, &b.phantoms), (&a.virtuals, &b.virtuals)] {
            assert_eq!(a.len(), b.len(), "{what}");
            for (a, b) in a.iter().zip(b) {
                assert_things_alike(a, b, what);
            }
        }
    }

    fn near(a: DVec3, b: DVec3) -> bool {
        (a - b).abs().max_element() < 0.6e-4 + 0.6e-3 * a.abs().max_element()
    }

    fn assert_lights_alike(a: &Scene, b: &Scene, what: &str) {
        assert_eq!(a.lights.len(), b.lights.len(), "{what}");
        for (a, b) in a.lights.iter().zip(&b.lights) {
            let alike = match (&a.light, &b.light) {
                (
                    Light::Point {
                        position_m: p,
                        intensity: i,
                        shape: Shape::Point,
                    },
                    Light::Point {
                        position_m: q,
                        intensity: j,
                        shape: Shape::Point,
                    },
                ) => (*p - *q).abs().max_element() <= 0.51e-4 && near(*i, *j),
                (
                    Light::Directional {
                        direction: d,
                        irradiance: i,
                        angle_rad: 0.0,
                    },
                    Light::Directional {
                        direction: e,
                        irradiance: j,
                        angle_rad: 0.0,
                    },
                ) => d.angle_between(*e) < 2e-4 && near(*i, *j),
                _ => false,
            };
            assert!(alike, "{what}: {a:?} {b:?}");
        }
    }

    fn assert_anchors_alike(a: &Scene, b: &Scene, what: &str) {
        assert_eq!(a.anchors.len(), b.anchors.len());
        for (a, b) in a.anchors.iter().zip(&b.anchors) {
            assert_eq!(a.name, b.name);
            for (a, b) in a.markers.iter().zip(&b.markers) {
                assert!((a.size_m - b.size_m).abs() < 0.51e-5, "{what}");
                assert!(
                    (a.center_m() - b.center_m()).abs().max_element() < 1.1e-5,
                    "{what}"
                );
            }
        }
    }

    fn assert_things_alike(a: &Object, b: &Object, what: &str) {
        assert_eq!(
            (&a.name, a.visible, a.casts, a.anchor),
            (&b.name, b.visible, b.casts, b.anchor),
            "{what}"
        );
        for (a, b) in a.materials.iter().zip(&b.materials) {
            assert!(near(a.albedo, b.albedo), "{what}");
            let (a_metal, b_metal) = (a.metallic, b.metallic);
            let (a, b) = (a.roughness.unwrap_or(9.0), b.roughness.unwrap_or(9.0));
            assert!((a - b).abs() < 1e-3 * a, "{what}: {a} {b}");
            assert!((a_metal - b_metal).abs() < 1e-3, "{what}");
        }
        assert_eq!(
            (&a.mesh.positions, &a.mesh.triangles),
            (&b.mesh.positions, &b.mesh.triangles),
            "{what}"
        );
        let (m, n) = (a.anchor_from_object, b.anchor_from_object);
        assert!(
            (m.translation - n.translation).abs().max_element() <= 0.51e-4,
            "{what}"
        );
        for axis in 0..3 {
            let off = (m.matrix3.col(axis) - n.matrix3.col(axis)).length();
            assert!(off < 8e-4 * m.matrix3.col(axis).length(), "{what}: {off}");
        }
    }

    fn random_edit(random: &mut Random, scene: &Scene, document: &SceneDocument) -> Edit {
        let things: Vec<&str> = scene
            .phantoms
            .iter()
            .chain(&scene.virtuals)
            .map(|o| o.name.as_str())
            .collect();
        let thing = |random: &mut Random| things[random.below(things.len())].to_owned();
        match random.below(10) {
            0 if !scene.lights.is_empty() => Edit::Light {
                index: random.below(scene.lights.len()),
                light: random_light(random),
            },
            1 if scene.lights.len() < 6 => Edit::AddLight(random_light(random)),
            2 if !scene.lights.is_empty() => Edit::RemoveLight(random.below(scene.lights.len())),
            3 => Edit::Ambient(vector(random, 0.5).abs()),
            4 => Edit::Show {
                thing: thing(random),
                visible: random.chance(0.5),
            },
            5 => Edit::Shadows(ShadowChange {
                from: scene.shadows,
                to: random_shadows(random),
            }),
            6 => Edit::AnchorSize {
                anchor: "table".to_owned(),
                size_m: random.between(0.02, 0.08),
            },
            7 => {
                let things: Vec<&str> =
                    things.iter().copied().filter(|it| *it != "table").collect();
                let thing = things[random.below(things.len())].to_owned();
                random_name_or_material(random, thing)
            }
            8 if scene.virtuals.len() > 1 => Edit::RemoveThing(
                scene.virtuals[random.below(scene.virtuals.len())]
                    .name
                    .clone(),
            ),
            _ => {
                let thing = thing(random);
                let placement = document
                    .place(&thing)
                    .expect("a thing of the scene")
                    .placement();
                random_place(random, thing, placement)
            }
        }
    }

    fn vector(random: &mut Random, reach: f64) -> DVec3 {
        random.vector_wide() * reach
    }

    fn random_light(random: &mut Random) -> Light {
        if random.chance(0.5) {
            Light::Point {
                position_m: vector(random, 1.0),
                intensity: vector(random, 3.0).abs(),
                shape: Shape::Point,
            }
        } else {
            Light::Directional {
                direction: random.direction(),
                irradiance: DVec3::splat(random.between(0.0, 2.0)),
                angle_rad: 0.0,
            }
        }
    }

    fn random_shadows(random: &mut Random) -> ShadowSettings {
        ShadowSettings {
            compact_penumbra_px: (random.between(0.0, 40.0) * 100.0).round() / 100.0,
            environment: Default::default(),
            without: Shortcuts::NONE,
            light_samples: [16, 64, 100][random.below(3)],
            ambient_samples: [0, 32, 50][random.below(3)],
            reflection_samples: [0, 16, 20][random.below(3)],
            technique: if random.chance(0.5) {
                Technique::Auto
            } else {
                Technique::Volumes
            },
            samples: if random.chance(0.5) { 1 } else { 4 },
            counting: if random.chance(0.5) {
                VolumeCounting::Auto
            } else {
                VolumeCounting::DepthFail
            },
            max_silhouette_error_px: random.below(100) as f64 / 4.0,
            frame_budget_ms: random.chance(0.5).then_some(12.5),
            quality: match random.below(4) {
                grade @ 0..3 => Some(Quality::BY_NAME[grade].1),
                _ => None,
            },
            shafts: ShaftSettings {
                sources: random.chance(0.5).then(|| 1 + random.below(99) as u32),
                patches: 100 + random.below(900) as u32,
                map_px: 64 << random.below(3),
                difference: [Difference::Ratio, Difference::Subtract, Difference::Encoded]
                    [random.below(3)],
                ..ShaftSettings::default()
            },
        }
    }

    fn random_name_or_material(random: &mut Random, thing: String) -> Edit {
        match random.chance(0.5) {
            true => Edit::Rename {
                name: format!("{thing} {}", random.below(1000)),
                thing,
            },
            false => Edit::Material {
                thing,
                albedo: (random.chance(0.7)).then(|| vector(random, 1.0).abs().min(DVec3::ONE)),
                roughness: random.chance(0.5).then(|| random.between(0.1, 1.0)),
                metallic: random.chance(0.3).then(|| random.between(0.0, 1.0)),
            },
        }
    }

    /// A thing moved, turned or scaled; the table only up or down.
    fn random_place(random: &mut Random, thing: String, mut placement: Placement) -> Edit {
        if thing == "table" {
            placement.position_m.z = random.between(-0.1, 0.1);
        } else {
            match random.below(3) {
                0 => placement.position_m = vector(random, 0.5),
                1 => placement.rotation_deg = vector(random, 180.0),
                _ => placement.scale = vector(random, 2.0) + DVec3::splat(0.001),
            }
        }
        Edit::Place { thing, placement }
    }

    #[test]
    fn random_edits_read_back_as_they_were_meant_and_go_back_byte_for_byte() {
        let rich = |text: String| {
            let more = "\n# A second one.\n[[virtual]]   # here\nname = \"block\"\nmesh = 'models/block.obj'\nscale = 2 # all ways\n\n  # indented\n  [[light]]\n  kind = \"directional\"\n  direction = [0, 0, -2]\n  irradiance = 0.4\n\n[shadows] # how\nsamples = 1 # one\n# frame_budget_ms = 16\n";
            text + more
        };
        let crlf = |text: String| rich(text).replace('\n', "\r\n");
        let braced = |text: String| {
            let text = text.replace(
                "[[light]]\nkind = \"point\"\nposition_m = [-0.26, 0.24, 0.46]\nintensity = [1.15, 1.06, 0.9]\n\n[ambient]\nradiance = [0.1, 0.11, 0.13]\n",
                "",
            );
            format!(
                "ambient = {{ radiance = 0.1 }} # all round\nshadows.samples = 4\nlight = [ {{ kind = \"point\", position_m = [0, 0, 1], intensity = 1 }}, ] # lamps\n{}",
                text.trim_end()
            )
        };
        let changes: [&dyn Fn(String) -> String; 3] = [&rich, &crlf, &braced];
        for (kind, change) in changes.into_iter().enumerate() {
            for seed in 0..6 {
                let project = Project::with(change);
                let original = project.text();
                let comments = |text: &str| {
                    text.lines()
                        .filter_map(|line| line.split_once('#'))
                        .map(|(_, comment)| comment.to_owned())
                        .collect::<Vec<_>>()
                };
                let mut random = Random::new(seed);
                let mut document = project.open();
                let mut steps = 0;
                for _ in 0..12 {
                    let before = document.scene().clone();
                    let text_before = document.text().to_owned();
                    let edit = random_edit(&mut random, &before, &document);
                    let what = format!("kind {kind} seed {seed} {edit:?}");
                    document
                        .commit(&edit)
                        .unwrap_or_else(|error| panic!("{what}: {error}"));
                    assert_alike(&expected(&before, &edit), document.scene(), &what);
                    let text = project.text();
                    assert_eq!(text, document.text());
                    steps += u32::from(text != text_before);
                    let removes = matches!(edit, Edit::RemoveLight(_) | Edit::RemoveThing(_));
                    // A budget that is taken back, and what another quality says itself: with their keys go their comments.
                    let drops_key = match &edit {
                        Edit::Shadows(change) => {
                            change.to.frame_budget_ms.is_none()
                                || change.to.quality != before.shadows.quality
                        }
                        _ => false,
                    };
                    if !removes && !drops_key {
                        assert_eq!(comments(&text), comments(&text_before), "{what}");
                    }
                    if matches!(
                        edit,
                        Edit::Place { .. } | Edit::Ambient(_) | Edit::Show { .. }
                    ) {
                        let old: Vec<&str> = text_before.lines().collect();
                        let kept = text.lines().filter(|line| old.contains(line)).count();
                        assert!(old.len() - kept.min(old.len()) <= 3, "{what}");
                    }
                    if kind == 1 && !drops_key {
                        assert_eq!(
                            text.matches('\n').count(),
                            text.matches("\r\n").count(),
                            "{what}"
                        );
                    }
                }
                for _ in 0..steps {
                    document.undo().unwrap();
                }
                assert_eq!(document.next_undo(), None);
                assert_eq!(project.text(), original, "kind {kind} seed {seed}");
            }
        }
    }
}

mod history {
    use super::*;

    #[test]
    fn a_drag_is_one_step_and_shows_before_it_is_made() {
        let project = Project::new();
        let before = project.text();
        let mut document = project.open();
        for step in 1..20 {
            let edit = moved_torus(&document, 0.001 * f64::from(step));
            assert!(document.preview(&edit));
            let shown = document.scene().virtuals[0]
                .anchor_from_object
                .translation
                .x;
            assert!((shown - 0.001 * f64::from(step)).abs() < 1e-12);
        }
        assert_eq!(project.text(), before);
        document.commit(&moved_torus(&document, 0.05)).unwrap();
        assert_eq!(document.next_undo(), Some("place \"torus\""));
        document.undo().unwrap();
        assert_eq!(
            (project.text(), document.next_undo()),
            (before.clone(), None)
        );
        document.redo().unwrap();
        assert!(project.text().contains("[0.05, 0.0, 0.036]"));
        document.undo().unwrap();
        document
            .commit(&Edit::RemoveThing("torus".to_owned()))
            .unwrap();
        assert_eq!(document.next_redo(), None);
        assert!(document.scene().virtuals.is_empty());
        document.undo().unwrap();
        assert_eq!(project.text(), before);
        assert!(document.preview(&Edit::RemoveLight(0)));
        document.end_preview();
        assert_eq!(document.scene().lights.len(), 1);
    }

    #[test]
    fn an_outside_change_wins_where_both_meant_the_same_and_joins_elsewhere() {
        let project = Project::new();
        let mut document = project.open();
        let edit = moved_torus(&document, 0.05);
        // Another thing: both stand.
        let outside = project
            .text()
            .replace("[1.15, 1.06, 0.9]", "[2.0, 2.0, 2.0]");
        fs::write(project.file(), &outside).unwrap();
        document.commit(&edit).unwrap();
        let both = outside.replace("[0.022, 0.0, 0.036]", "[0.05, 0.0, 0.036]");
        assert_eq!(project.text(), both);
        // The same thing: the file's stands, ours is told of.
        let edit = moved_torus(&document, 0.06);
        let outside = both.replace("[0.05, 0.0, 0.036]", "[0.07, 0.0, 0.036]");
        fs::write(project.file(), &outside).unwrap();
        let error = document.commit(&edit).unwrap_err();
        assert!(
            matches!(&error, EditError::ChangedOutside { .. }),
            "{error}"
        );
        assert!(error.to_string().contains("not done: place \"torus\""));
        assert_eq!(project.text(), outside);
        let torus = document.scene().virtuals[0].anchor_from_object.translation;
        assert_eq!(torus.x, 0.07);
        // Nothing is lost: step by step back through all of it.
        document.undo().unwrap();
        assert_eq!(project.text(), both);
        // A broken file is left to the one who is at it.
        fs::write(project.file(), "[camera").unwrap();
        let error = document.commit(&edit).unwrap_err();
        let told = error.to_string();
        assert!(told.contains("scene.toml:1:"), "{told}");
        assert!(told.starts_with("not done: place \"torus\""), "{told}");
        assert_eq!(project.text(), "[camera");
        assert!(document.undo().is_err());
        assert_eq!(document.text(), both);
    }

    /// Settings of shadows are many keys of one table: an edit of one leaves the others to whoever changed them.
    #[test]
    fn an_edit_of_shadows_leaves_the_keys_that_changed_outside() {
        let project = Project::with(|text| text + "\n[shadows]\nsamples = 4 # two by two\n");
        let before = project.text();
        let here = project.open().scene().shadows;
        let to = ShadowSettings { samples: 1, ..here };
        let edit = Edit::Shadows(ShadowChange { from: here, to });
        for outside in [
            "sources = 7",
            "map_px = 64",
            "quality = \"fast\"",
            "patches = 900",
            "source_power = 0.5",
            "receivers_per_leaf = 3",
            "least_part = 0.5",
            "difference = \"subtract\"",
            "compositing = \"ldr\"",
            "technique = \"volumes\"",
            "counting = \"depth-fail\"",
            "max_silhouette_error_px = 3.0",
            "frame_budget_ms = 12.0",
        ] {
            fs::write(project.file(), &before).unwrap();
            let mut document = project.open();
            let changed = format!("{before}{outside} # theirs\n");
            fs::write(project.file(), &changed).unwrap();
            document.commit(&edit).unwrap();
            assert_eq!(
                project.text(),
                changed.replace("samples = 4 # two", "samples = 1 # two"),
                "{outside}"
            );
        }
        // The same key: theirs stays.
        let changed = before.replace("samples = 4", "samples = 1");
        fs::write(project.file(), &before).unwrap();
        let mut document = project.open();
        let quality = ShadowChange {
            from: here,
            to: here.with_quality(Quality::Fast),
        };
        fs::write(project.file(), &changed).unwrap();
        let error = document.commit(&Edit::Shadows(quality)).unwrap_err();
        assert!(matches!(error, EditError::ChangedOutside { .. }), "{error}");
        assert_eq!(project.text(), changed);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_stays_a_link_and_rights_stay() {
        use std::os::unix::fs::{PermissionsExt as _, symlink};
        let project = Project::new();
        fs::set_permissions(project.file(), fs::Permissions::from_mode(0o640)).unwrap();
        let link = project.0.path().join("link.toml");
        symlink("scene.toml", &link).unwrap();
        let mut document = SceneDocument::open(&link).unwrap();
        document.commit(&moved_torus(&document, 0.05)).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(project.text().contains("[0.05, 0.0, 0.036]"));
        let mode = fs::metadata(project.file()).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o640);
        let left = fs::read_dir(project.0.path()).unwrap().count();
        assert_eq!(left, 3, "scene, link, models: nothing half-written");
    }
}

mod watch {
    use super::*;

    /// The next news, and after how many milliseconds.
    fn next_news(watch: &SceneWatch) -> (SceneNews, f64) {
        let start = Stopwatch::start();
        loop {
            if let Some(news) = watch.next() {
                return (news, start.elapsed_ms());
            }
            assert!(start.elapsed_ms() < 5000.0, "no news");
            sleep(Duration::from_millis(5));
        }
    }

    fn changed(watch: &SceneWatch) -> Scene {
        let (news, ms) = next_news(watch);
        assert!(ms < PROMISED_MS, "{ms} ms");
        match news {
            SceneNews::Changed(change) => change.scene,
            SceneNews::Mistaken(error) => panic!("{error}"),
        }
    }

    fn mistake(watch: &SceneWatch) -> String {
        let (news, ms) = next_news(watch);
        assert!(ms < PROMISED_MS, "{ms} ms");
        match news {
            SceneNews::Mistaken(error) => error.to_string(),
            SceneNews::Changed(_) => panic!("a scene where a mistake was made"),
        }
    }

    fn nothing(watch: &SceneWatch) {
        sleep(Duration::from_millis(600));
        if let Some(news) = watch.next() {
            panic!("{news:?}");
        }
    }

    #[test]
    fn saved_files_give_their_scene_or_their_mistake() {
        let project = Project::new();
        let text = project.text();
        let document = project.open();
        let watch = document.watch(|| ());
        nothing(&watch);
        // As editors save: in place, or beside it and renamed.
        fs::write(project.file(), text.replace("[0.022,", "[0.033,")).unwrap();
        assert_eq!(
            changed(&watch).virtuals[0].anchor_from_object.translation.x,
            0.033
        );
        let beside = project.0.path().join("scene.toml.swp");
        fs::write(&beside, text.replace("[0.022,", "[0.044,")).unwrap();
        fs::rename(&beside, project.file()).unwrap();
        assert_eq!(
            changed(&watch).virtuals[0].anchor_from_object.translation.x,
            0.044
        );
        // A mistake is told once, with its place, and taken back with the file.
        fs::write(
            project.file(),
            text.replace("albedo = [0.75, 0.16, 0.12]", "albdo = 1"),
        )
        .unwrap();
        let message = mistake(&watch);
        assert!(
            message.contains("scene.toml:48:") && message.contains("did you mean \"albedo\""),
            "{message}"
        );
        nothing(&watch);
        fs::write(project.file(), text.replace("[0.022,", "[0.044,")).unwrap();
        changed(&watch);
    }

    #[test]
    fn half_written_files_are_waited_for() {
        let project = Project::new();
        let text = project.text();
        let document = project.open();
        let watch = document.watch(|| ());
        // In pieces, a tenth of a second between them; the file is gone in between.
        let new = text.replace("[0.022,", "[0.033,");
        for round in 0..3 {
            fs::remove_file(project.file()).unwrap();
            sleep(Duration::from_millis(120));
            for end in [100, 500, 900] {
                fs::write(project.file(), &new[..end]).unwrap();
                sleep(Duration::from_millis(120));
            }
            let whole = new.replace("0.033", &format!("0.0{}", 5 + round));
            fs::write(project.file(), &whole).unwrap();
            let x_m = changed(&watch).virtuals[0].anchor_from_object.translation.x;
            assert!((x_m - 0.05 - 0.01 * f64::from(round)).abs() < 1e-12);
        }
    }

    #[test]
    fn meshes_and_what_was_missing_are_watched_too() {
        let project = Project::new();
        let document = project.open();
        let watch = document.watch(|| ());
        sleep(Duration::from_millis(200));
        let house = project.0.path().join("models/house.obj");
        let mesh = fs::read_to_string(&house).unwrap();
        fs::write(&house, mesh.replace("0.085", "0.095")).unwrap();
        let positions = &changed(&watch).phantoms[2].mesh.positions;
        assert!(positions.iter().any(|position| position.z == 0.095));
        // A material file that was not there before.
        fs::write(&house, format!("mtllib house.mtl\nusemtl wall\n{mesh}")).unwrap();
        changed(&watch);
        fs::write(
            project.0.path().join("models/house.mtl"),
            "newmtl wall\nKd 1 0 0\nNs 10\n",
        )
        .unwrap();
        assert!(changed(&watch).phantoms[2].materials[0].roughness.is_some());
        fs::remove_file(&house).unwrap();
        assert!(mistake(&watch).contains("no such file"));
        fs::write(&house, mesh).unwrap();
        changed(&watch);
    }

    #[test]
    fn what_the_program_writes_is_no_news() {
        let project = Project::new();
        let mut document = project.open();
        let watch = document.watch(|| ());
        for step in 0..6 {
            document
                .commit(&moved_torus(&document, 0.01 + 0.002 * f64::from(step)))
                .unwrap();
            sleep(Duration::from_millis(90));
        }
        document.undo().unwrap();
        nothing(&watch);
        // A change from outside is one, and a step that can be taken back; then it is ours again.
        let ours = project.text();
        fs::write(project.file(), ours.replace("1.15", "2.15")).unwrap();
        let (news, _) = next_news(&watch);
        let SceneNews::Changed(change) = news else {
            panic!("{news:?}")
        };
        assert!(document.take(*change));
        assert_eq!(
            document.next_undo(),
            Some("change of the file from outside")
        );
        document.undo().unwrap();
        assert_eq!(project.text(), ours);
        nothing(&watch);
        // News that the file has outlived do not bring the old text back.
        fs::write(project.file(), ours.replace("1.15", "3.15")).unwrap();
        let (news, _) = next_news(&watch);
        document.commit(&moved_torus(&document, 0.1)).unwrap();
        let SceneNews::Changed(change) = news else {
            panic!("{news:?}")
        };
        assert!(!document.take(*change));
        assert!(project.text().contains("3.15") && document.text().contains("[0.1, "));
    }

    #[test]
    fn a_scene_without_files_besides_is_watched_by_its_path_alone() {
        let folder = tempfile::tempdir().unwrap();
        let file: &Path = &folder.path().join("s.toml");
        let text =
            "[camera]\nsource = \"webcam:0\"\n[[marker]]\nname = \"m\"\nid = 1\nsize_m = 0.05\n";
        fs::write(file, text).unwrap();
        let mut document = SceneDocument::open(file).unwrap();
        let watch = document.watch(|| ());
        document
            .commit(&Edit::AnchorSize {
                anchor: "m".to_owned(),
                size_m: 0.0512,
            })
            .unwrap();
        nothing(&watch);
        assert!(
            fs::read_to_string(file)
                .unwrap()
                .ends_with("size_m = 0.0512\n")
        );
        fs::write(file, text.replace("0.05", "0.06")).unwrap();
        assert_eq!(changed(&watch).anchors[0].markers[0].size_m, 0.06);
    }
}

#[test]
fn what_is_hidden_leaves_the_picture_as_if_it_were_not_there() {
    let folder = crate::common::project_file("recordings/lamp");
    let intrinsics = gnomon::capture::load_calibration(&folder.join("camera.toml")).unwrap();
    let whole = Scene::load(&crate::common::project_file("config/lamp.toml")).unwrap();
    let (frame, poses) = key_frames(&folder, &whole.anchors).unwrap().remove(0);
    let picture = |scene: &Scene| {
        let mut renderer = Renderer::new(crate::common::gpu(), scene, intrinsics).unwrap();
        draw(&mut renderer, &frame, &poses).unwrap()
    };
    let mut hidden = whole.clone();
    hidden.virtuals[0].visible = false;
    let drawn = picture(&hidden);
    assert_eq!(drawn.out, drawn.bare);
    let mut hidden = whole.clone();
    let house = whole
        .phantoms
        .iter()
        .position(|thing| thing.name == "house")
        .unwrap();
    hidden.phantoms[house].visible = false;
    let mut gone = whole.clone();
    gone.phantoms.remove(house);
    let without_house = picture(&gone).out;
    assert_eq!(picture(&hidden).out, without_house);
    assert_ne!(picture(&whole).out, without_house);
}
