//! Edits that are written into scenes of any look.

use glam::DVec3;
use gnomon::app::authoring::{Edit, NewForm, NewThing, SceneDocument};
use gnomon::light::Light;
use gnomon::scene::{Placement, Scene};

const MESH: &[u8] = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

fn edits(scene: &Scene) -> Vec<Edit> {
    let things = scene.phantoms.iter().chain(&scene.virtuals);
    let thing = things
        .last()
        .map_or(String::new(), |thing| thing.name.clone());
    let anchor = scene
        .anchors
        .last()
        .map_or(String::new(), |anchor| anchor.name.clone());
    let light = Light::point(DVec3::new(0.1, -0.2, 0.3), DVec3::splat(0.5));
    let placement = Placement {
        position_m: DVec3::new(0.1, 0.0, -0.25),
        rotation_deg: DVec3::new(0.0, 12.5, 0.0),
        scale: DVec3::new(1.0, 2.0, 1.0),
    };
    vec![
        Edit::Place {
            thing: thing.clone(),
            placement,
        },
        Edit::Show {
            thing: thing.clone(),
            visible: false,
        },
        Edit::Light { index: 0, light },
        Edit::AddLight(light),
        Edit::RemoveLight(0),
        Edit::Ambient(DVec3::new(0.2, 0.1, 0.3)),
        Edit::AnchorSize {
            anchor: anchor.clone(),
            size_m: 0.0625,
        },
        Edit::AddThing(NewThing {
            is_real: true,
            name: "new".to_owned(),
            form: NewForm::Mesh {
                file: "a.obj".to_owned(),
                fit_m: Some(0.1),
            },
            on: anchor,
            placement,
        }),
        Edit::Duplicate {
            thing: thing.clone(),
            name: "new".to_owned(),
            position_m: DVec3::new(0.1, 0.2, 0.0),
        },
        Edit::Rename {
            thing: thing.clone(),
            name: "new".to_owned(),
        },
        Edit::Material {
            thing: thing.clone(),
            albedo: Some(DVec3::splat(0.25)),
            roughness: Some(0.5),
            metallic: Some(0.75),
        },
        Edit::Animate {
            thing: thing.clone(),
            animation: None,
        },
        Edit::RemoveThing(thing),
    ]
}

pub fn run(bytes: &[u8]) {
    let text = super::text(bytes);
    super::file("a.obj", MESH);
    let path = super::file("edited.toml", text.as_bytes());
    if let Ok(mut document) = SceneDocument::open(&path) {
        for edit in edits(document.scene()) {
            let before = document.text().to_owned();
            if document.commit(&edit).is_ok() {
                // What was written is what is shown, and can be taken back.
                assert!(Scene::load(&path).is_ok(), "{edit:?}");
                if document.text() != before {
                    document.undo().expect("a step back");
                }
                assert_eq!(document.text(), before);
            }
        }
    }
}
